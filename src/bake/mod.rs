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
//! | `lightmap` | the irradiance of every texel of an atlas |
//! | `texels`, `raster` | means over texels, and the parts of texels that triangles cover |
//! | `buried` | parts of faces that nobody sees |
//! | `gutter` | texels around charts |

pub mod atlas;
mod buried;
mod charts;
mod gutter;
mod lightmap;
mod make;
mod overlap;
mod pack;
mod raster;
pub mod second_set;
mod texels;

pub use atlas::{Atlas, AtlasOptions, BakeCounts, Chart, Density, Lightmap, Page};
pub use lightmap::{LightmapOptions, bake_lightmaps};
pub use make::make_atlas;
pub use second_set::{SecondSet, second_sets};
