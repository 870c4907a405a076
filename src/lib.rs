//! Exact diffuse light: solves the occluded radiosity equation for polyhedral scenes.
#![forbid(unsafe_code)]

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
