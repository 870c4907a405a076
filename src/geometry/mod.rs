//! f64 planes, convex polygons, bounds, rays and signed predicates. Knows nothing of light.

pub mod bounds;
pub mod box_tree;
pub mod circle;
pub mod contact;
pub mod convex;
pub mod frame;
mod nested;
pub mod polygon;
pub mod ray;
pub mod ray_tree;
pub mod triangle_packs;

pub use bounds::Bounds;
pub use box_tree::BoxTree;
pub use contact::{CONTACT, SINGLE, contact_distance, known_to};
pub use frame::Frame;
pub use polygon::{Linear, Pieces, triangle_area};
pub use ray_tree::{RayHit, RayTree};

/// Half a unit in the last place of 1: the relative error of one rounded f64 operation.
pub const ROUNDING: f64 = f64::EPSILON / 2.0;

/// A coordinate is trusted to this share of the scene's largest coordinate.
///
/// Unit: relative to the magnitude M of the scene. Sixteen roundings cover the few operations
/// (a transform into a plane's frame, a midpoint, an intersection) between an input vertex and the
/// point that a predicate sees. Signed quantities that a shift of their points by this much could
/// reverse count as zero ("on"), so that coincident features of a scene are seen as coincident.
/// When it bites, areas of at most this share of the scene's size times its edges are given to
/// one side instead of the other.
pub const COINCIDENCE: f64 = 16.0 * ROUNDING;
