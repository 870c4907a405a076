//! What a point sees of a polygon: exactly, by cutting away shadows.
//!
//! Occluders are the input faces, both of whose sides block light. From a point P a convex
//! occluder with corners w_i casts the cone {x : N_i.(x - P) >= 0 for all i} beyond its plane,
//! N_i = (w_i - P) x (w_{i+1} - P) turned inward. On a source plane each condition is a linear
//! function of two coordinates, so the visible part of a polygon is found by cutting convex
//! polygons with lines; nothing is projected and nothing divided. The faces of a convex body cast one
//! such shadow together.

mod bodies;
mod occluders;
mod shadows;
mod shaft;
mod silhouettes;

pub use occluders::Occluders;
pub use shadows::{Coverage, Observer, Shadows, faces_away};
pub use shaft::Shaft;
