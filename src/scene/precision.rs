//! To how many digits the coordinates of a file are known.
//!
//! Most files hold f32, whatever they are written as: far from the origin, things that are meant to
//! coincide are then apart by much of their size, and have to be brought together again. Others hold
//! more: text with all digits, or f32 about a node that stands far away. There nothing may be brought
//! together that is apart in the file.

use super::Scene;
use crate::geometry::{CONTACT, SINGLE};

/// What coordinates are known to, metres. `own` is that of coordinates before they were moved to
/// their place, metres: 0 where they are written in their place.
///
/// Where that is less than what touches anyway, they are taken for f32. Else they are, unless one of
/// them is no f32.
pub(super) fn rounding(scene: &Scene, own: f64) -> f64 {
    let (low, high) = scene.bounds();
    let single = SINGLE * low.abs().max(high.abs()).max_element();
    let near = single <= CONTACT * scene.extent();
    let mut all = scene.triangles.iter().flat_map(|t| t.vertices).flat_map(|p| p.to_array());
    if near || all.all(is_single) { single } else { own.min(single) }
}

/// Whether a number may have been an f32 before it was written in decimal digits: the nearest f32 is
/// as near as half a unit of the last digit.
fn is_single(x: f64) -> bool {
    let off = (x - f64::from(x as f32)).abs();
    if off == 0.0 {
        return true;
    }
    // The fewest digits that tell it from other numbers: those of the file, or fewer.
    let digits = format!("{x}");
    let decimals = digits.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    // A little more than half: halves are rounded either way.
    off <= 0.500_001 * 10f64.powi(-(decimals as i32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Triangle;
    use glam::{DVec2, DVec3};

    #[test]
    fn decimals_of_f32_are_known() {
        // f32 numbers with few and with all digits.
        for x in [0.0, 1e6, -0.25, 0.1, 1234.5677, 1234.567749, 500_123.438, 1.2e-7, 500_123.44] {
            assert!(is_single(x), "{x}");
        }
        for x in [500_123.45, 0.123_456_789, 1e6 + 0.333, 4_123_456.78, std::f64::consts::PI] {
            assert!(!is_single(x), "{x}");
        }
    }

    #[test]
    fn far_away_digits_count() {
        let scene = |far: f64| {
            let at = |x: f64, y: f64| DVec3::new(far + x, y, 0.0);
            let triangle = Triangle {
                vertices: [at(0.0, 0.0), at(1.0, 0.0), at(0.333, 1.0)],
                uv: [[DVec2::ZERO; 3]; 2],
                colour: [DVec3::ONE; 3],
                material: 0,
                object: 0,
            };
            Scene { triangles: vec![triangle], ..Scene::default() }
        };
        assert_eq!(rounding(&scene(0.0), 0.0), SINGLE);
        assert_eq!(rounding(&scene(1e6), 0.0), 0.0);
        assert_eq!(rounding(&scene(1e6), 1e-7), 1e-7);
        // 0.333 is lost: the nearest number is an f32.
        let mut single = scene(1e6);
        single.triangles[0].vertices[2].x = f64::from((1e6 + 0.333) as f32);
        assert_eq!(rounding(&single, 0.0), SINGLE * 1_000_001.0);
    }
}
