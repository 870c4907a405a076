//! Exact diffuse light: solves the occluded radiosity equation for polyhedral scenes.
#![forbid(unsafe_code)]

pub mod error;
pub mod monitor;
pub mod output;
pub mod scene;

pub use error::{Error, Result};
pub use monitor::Monitor;
