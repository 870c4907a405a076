//! Light on surfaces: an atlas of texels and the irradiance of each, or light at vertices; and the
//! files that hold them.
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
//! | `vertices` | irradiance at vertices, on triangles as fine as the light asks for |
//! | `conforming` | triangles without hanging vertices, refined where it is asked for |
//! | `target` | which quantity and which materials a program wants |
//! | `surface_map` | what the surface under each texel reflects and emits |
//! | `model` | a scene with its light as glTF |
//! | `files` | what is left on disk: scene, lightmaps, a description |

pub mod atlas;
mod buried;
mod charts;
mod conforming;
pub mod files;
mod gutter;
mod lightmap;
mod make;
mod model;
mod overlap;
mod pack;
mod raster;
pub mod second_set;
pub mod surface_map;
pub mod target;
mod texels;
pub mod vertices;

pub use atlas::{Atlas, AtlasOptions, BakeCounts, Chart, Density, Lightmap, Page};
pub use lightmap::{LightmapOptions, bake_lightmaps};
pub use make::{make_atlas, wanted};
pub use second_set::{SecondSet, second_sets};
