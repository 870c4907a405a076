//! From node values to values anywhere on the surface.
//!
//! What is reconstructed is irradiance, which is smooth where reflectance is not: radiosity is
//! E + rho H with E and rho taken where it is needed.

pub mod fill;
pub mod irradiance;
mod lattice;
mod sheets;
mod surface;
mod vertices;

pub use surface::{Foot, Met, Surface};
pub use vertices::VertexIrradiance;
