//! How near is touching: one tolerance for everything in a scene that is meant to coincide.

use super::{Bounds, COINCIDENCE};

/// Share of the scene's longest side within which faces touch.
///
/// Scene files hold f32 coordinates, so features meant to coincide lie up to 2^-24 of a coordinate
/// apart, a few times that after a transform. 2^-20 (a hundredth of a millimetre in ten metres) is
/// 16 times as much and far below anything modelled on purpose. When it bites, a line moves by at
/// most this.
pub const CONTACT: f64 = 1.0 / 1_048_576.0;

/// Two units in the last place of an f32, relative to it: what is between things of a file that are
/// meant to coincide.
pub const SINGLE: f64 = 1.0 / 8_388_608.0;

/// Distance within which faces in `bounds` touch, in its unit; see [`CONTACT`]. Far from the origin
/// it is what coordinates are known to: `rounding`, or that of f64.
pub fn contact_distance(bounds: Bounds, rounding: f64) -> f64 {
    (CONTACT * bounds.extent()).max(known_to(bounds, rounding))
}

/// What coordinates in `bounds` are known to, in its unit: `rounding`, if that is not better than
/// f64. At most [`contact_distance`].
pub fn known_to(bounds: Bounds, rounding: f64) -> f64 {
    rounding.max(COINCIDENCE * bounds.magnitude())
}
