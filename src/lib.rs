//! Exact diffuse light: solves the occluded radiosity equation for polyhedral scenes.
#![forbid(unsafe_code)]

pub mod error;
pub mod geometry;
pub mod kernel;
pub mod monitor;
pub mod scene;

pub use error::{Error, Result};
pub use monitor::Monitor;
