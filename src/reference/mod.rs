//! The paper's experiments: AC sections 5 and 6, Tables 6.1 to 6.11.
//!
//! | file | subject |
//! |---|---|
//! | `surface` | the 5-piece surface of section 5 |
//! | `manufactured` | solutions (6.8) and (5.2), and the emissivity (6.7) that belongs to them |
//! | `printed` | what the paper prints |
//! | `tables` | the runs, side by side with that |
//! | `fit` | growth exponents by least squares |
#![doc = include_str!("tables.md")]

pub mod fit;
pub mod manufactured;
pub mod printed;
pub mod surface;
pub mod tables;

pub use tables::{ReferenceOptions, Row, run};
