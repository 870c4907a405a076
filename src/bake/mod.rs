//! Light on surfaces: an atlas of texels, and the irradiance of each.
//!
//! | file | subject |
//! |---|---|
//! | `atlas` | where each triangle lies on the pages of a lightmap |
//! | `conforming` | triangles without hanging vertices, refined where it is asked for |
//! | `files` | what is left on disk: scene, lightmaps, a description |
//! | `model` | a scene with its light as glTF |
//! | `surface_map` | what the surface under each texel reflects and emits |
//! | `target` | which quantity and which materials a program wants |
//! | `vertices` | irradiance at vertices, on triangles as fine as the light asks for |

pub mod atlas;
mod conforming;
pub mod files;
mod model;
pub mod surface_map;
pub mod target;
pub mod vertices;
