//! The gray field: exact integrals over the visible part of elements that a shadow crosses.
//!
//! The visibility line of AC section 3 is found exactly, as the boundary of the disjoint convex
//! pieces into which shadows cut the element.

use glam::DVec2;

use crate::geometry::Pieces;
use crate::geometry::polygon::Linear;
use crate::kernel::{Moments, Precision, View, moments_above};

/// Moments of G V about the element's centroid, from its visible pieces.
pub fn moments(
    view: &View,
    horizon: &Linear,
    element: &[DVec2; 3],
    visible: &Pieces,
    precision: &Precision,
    scratch: &mut Pieces,
) -> Moments {
    let centroid = (element[0] + element[1] + element[2]) / 3.0;
    let mut sum = Moments::default();
    for piece in visible.iter() {
        sum += moments_above(view, piece, centroid, horizon, precision, scratch);
    }
    sum
}
