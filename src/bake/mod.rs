//! Light on surfaces: an atlas of texels, and the irradiance of each.
//!
//! | file | subject |
//! |---|---|
//! | `atlas` | what an atlas and a lightmap are |
//! | `make` | makes an atlas: what is kept and what is charted, how dense, on which page |
//! | `second_set` | whether a file's own texture coordinates can hold a lightmap |
//! | `charts` | parts of the surface that are laid out flat |
//! | `overlap` | triangles of a plane that overlap |
//! | `pack` | rectangles on pages |

pub mod atlas;
mod charts;
mod make;
mod overlap;
mod pack;
pub mod second_set;

pub use atlas::{Atlas, AtlasOptions, BakeCounts, Chart, Density, Lightmap, Page};
pub use make::make_atlas;
pub use second_set::{SecondSet, second_sets};
