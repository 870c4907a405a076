//! Light on surfaces: an atlas of texels, and the irradiance of each.
//!
//! | file | subject |
//! |---|---|
//! | `atlas` | where each triangle lies on the pages of a lightmap |
//! | `conforming` | triangles without hanging vertices, refined where it is asked for |
//! | `vertices` | irradiance at vertices, on triangles as fine as the light asks for |

pub mod atlas;
mod conforming;
pub mod vertices;
