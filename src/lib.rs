//! Exact diffuse light: solves the occluded radiosity equation for polyhedral scenes.
//!
//! u(P) - rho(P)/pi * int_S u(Q) G(P,Q) V(P,Q) dS_Q = E(P) at every surface point P: u is radiosity
//! and E exitance (W/m^2), rho the diffuse reflectance, G = cos cos / r^2, V whether P and Q see
//! each other. Light comes from a scene file in this order, and modules import only what stands
//! before them (a test keeps it):
//!
//! [`scene`] -> [`mesh`] -> [`cluster`] -> [`visibility`] -> [`kernel`] ->
//! [`near`] | [`gray`] | [`far`] -> [`operator`] -> [`solve`] -> [`reconstruct`] -> [`output`] ->
//! [`bake`] | [`render`] | [`probe`] | [`audit`]
//!
//! "AC" in the documentation is K. Atkinson and D. Chien, "A study of the fast solution of the
//! occluded radiosity equation" (2006), by its sections and equation numbers.
#![forbid(unsafe_code)]

pub mod audit;
pub mod bake;
pub mod cluster;
pub mod error;
pub mod far;
pub mod geometry;
pub mod gray;
pub mod kernel;
pub mod mesh;
pub mod monitor;
pub mod near;
pub mod operator;
pub mod output;
pub mod probe;
pub mod reconstruct;
pub mod reference;
pub mod render;
pub mod scene;
pub mod solve;
pub mod visibility;

pub use error::{Error, Result};
pub use monitor::Monitor;
