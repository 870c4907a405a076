//! What a point sees of a triangle, against polygon booleans in integers.

mod found;
mod look;
mod oracle;
mod scenes;

use look::look;
use scenes::{Random, Sight, grid_sight, random_sight};

/// Visible areas of `count` scenes, placed in space in the ways that change roundings most,
/// against the oracle's of the scene as made. Also refined zero to three times.
fn compare(make: fn(u64) -> Sight, count: u64) {
    for (scale, far) in [(1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 1e3), (1e-6, 1e3), (1e6, 1e3)] {
        // A shift by a thousand sizes costs as much in rounding.
        let close = 1e-10 * f64::max(1.0, far);
        for seed in 0..count {
            let exact = make(seed);
            let want = oracle::areas(&exact);
            let mut r = Random::new(seed);
            let moved = exact.moved(r.turn(), scale, r.direction() * far * scale);
            let off =
                (look(&moved, seed as u32 % 4).visible / (scale * scale) - want.visible).abs();
            let allowed = oracle::allowance(&moved) / (scale * scale) + 1e-14 * want.source;
            assert!(
                off <= allowed && off <= close * want.source,
                "seed {seed}, scale {scale}, {far} sizes away: off by {off:e} of {}, allowed {allowed:e}",
                want.source
            );
        }
    }
}

#[test]
fn areas_of_random_scenes_are_exact() {
    compare(random_sight, 3000);
}

#[test]
fn areas_of_scenes_on_a_grid_are_exact() {
    compare(grid_sight, 5000);
}
