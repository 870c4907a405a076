//! Exact diffuse light: solves the occluded radiosity equation for polyhedral scenes.
#![forbid(unsafe_code)]

pub mod error;
pub mod geometry;
pub mod kernel;
pub mod mesh;
pub mod monitor;
pub mod operator;
pub mod output;
pub mod probe;
pub mod reconstruct;
pub mod render;
pub mod scene;
pub mod solve;
pub mod visibility;

pub use error::{Error, Result};
pub use monitor::Monitor;
