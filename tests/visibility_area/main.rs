//! What a point sees of a triangle: against polygon booleans in integers, and against rays.

mod found;
mod look;
mod oracle;
mod proofs;
#[path = "../common/random.rs"]
mod random;
mod rays;
mod scenes;

use glam::DVec3;
use look::look;
use random::Random;
use scenes::Sight;

/// Scales, and distances from the origin in sizes, that change roundings most.
const PLACES: [(f64, f64); 6] =
    [(1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 1e3), (1e-6, 1e3), (1e6, 1e3)];

/// The scene turned at random, scaled, and shifted by `far` times its size.
fn placed(sight: &Sight, seed: u64, (scale, far): (f64, f64)) -> Sight {
    let mut r = Random::new(seed);
    let turn = r.turn();
    let shift: DVec3 = r.direction() * far * scale;
    sight.moved(turn, scale, shift)
}

/// Compares the visible areas of `count` scenes in each place, refined zero to three times, with
/// the oracle's of the scene as made: within the oracle's allowance, and within `close` times
/// (a thousand times that where a thousand sizes away) the source's area.
fn compare(make: fn(u64) -> Sight, count: u64, close: f64) {
    for place in PLACES {
        let (scale, far) = place;
        let (mut undecided, mut worst) = (0, 0.0f64);
        for seed in 0..count {
            let exact = make(seed);
            if !oracle::decidable(&exact) {
                undecided += 1;
                continue;
            }
            let want = oracle::areas(&exact);
            let moved = placed(&exact, seed, place);
            let got = look(&moved, seed as u32 % 4).visible / (scale * scale);
            let off = (got - want.visible).abs();
            worst = worst.max(off / want.source);
            let allowed = oracle::allowance(&moved) / (scale * scale) + 1e-14 * want.source;
            assert!(
                off <= allowed && off <= close * far.max(1.0) * want.source,
                "seed {seed}, scale {scale}, {far} sizes away: {got} is off by {off:e} of {}, \
                 allowed {allowed:e}",
                want.source
            );
        }
        println!("scale {scale}, {far} sizes away: worst {worst:e}");
        assert!(undecided * 5 <= count, "{undecided} scenes cannot be judged");
    }
}

#[test]
fn areas_of_random_scenes_are_exact() {
    compare(scenes::random_sight, 3000, 1e-10);
}

#[test]
fn areas_of_scenes_on_a_grid_are_exact() {
    compare(scenes::grid_sight, 6000, 1e-10);
}

#[test]
fn areas_of_nearly_coincident_scenes_are_exact() {
    // Within the allowance alone: the oracle itself loses digits here.
    compare(scenes::nearly_coincident_sight, 3000, f64::INFINITY);
}

#[test]
fn areas_past_very_short_edges_are_exact() {
    compare(scenes::short_edged_sight, 2000, 1e-7);
}
