//! How near is touching: one tolerance for everything in a scene that is meant to coincide.

use super::Bounds;

/// Share of the scene's longest side within which faces touch.
///
/// Scene files hold f32 coordinates, so features meant to coincide lie up to 2^-24 of a coordinate
/// apart, a few times that after a transform. 2^-20 (a hundredth of a millimetre in ten metres) is
/// 16 times as much and far below anything modelled on purpose. When it bites, a line moves by at
/// most this.
pub const CONTACT: f64 = 1.0 / 1_048_576.0;

/// The same for scenes far from the origin, relative to the largest coordinate: two units in the
/// last place of f32. Lengths below it are roundings of a file.
const FAR: f64 = 1.0 / 8_388_608.0;

/// Distance within which faces in `bounds` touch, in its unit; see [`CONTACT`].
pub fn contact_distance(bounds: Bounds) -> f64 {
    (CONTACT * bounds.extent()).max(file_rounding(bounds))
}

/// Largest distance, in the unit of `bounds`, that coordinates of f32 put between things that are
/// meant to coincide. At most [`contact_distance`].
pub fn file_rounding(bounds: Bounds) -> f64 {
    FAR * bounds.min.abs().max(bounds.max.abs()).max_element().max(0.0)
}
