//! Light on surfaces: an atlas of texels, and the irradiance of each.
//!
//! | file | subject |
//! |---|---|
//! | `atlas` | where each triangle lies on the pages of a lightmap |

pub mod atlas;
