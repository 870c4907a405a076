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
use lumel::geometry::Frame;
use lumel::visibility::{Observer, Occluders, Shadows};
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

#[test]
fn areas_behind_solids_are_exact() {
    compare(scenes::solid_sight, 3000, 1e-10);
}

#[test]
fn areas_behind_solids_on_a_grid_are_exact() {
    compare(scenes::solid_grid_sight, 3000, 1e-10);
}

/// A box between, closed or standing without a bottom: one shadow, which is all that is cast.
#[test]
fn a_box_casts_one_shadow() {
    let frame = Frame::new(DVec3::ZERO, DVec3::Z);
    let floor = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]]
        .map(|[x, y]| frame.project(DVec3::new(x, y, 0.0)));
    let mut r = Random::new(1);
    for seed in 0..200 {
        let (point, bottom) = (DVec3::new(0.0, 0.0, 4.0) + r.point(0.9), seed % 2 == 0);
        let at = |x: usize, y: usize, z: usize| {
            DVec3::new(1.5 * x as f64 + 0.5, y as f64 - 0.5, z as f64 + f64::from(bottom))
        };
        let quad = |[a, b, c, d]: [DVec3; 4]| [[a, b, c], [a, c, d]];
        let mut faces: Vec<[DVec3; 3]> = vec![];
        for (a, b) in [((0, 0), (1, 0)), ((1, 0), (1, 1)), ((1, 1), (0, 1)), ((0, 1), (0, 0))] {
            faces.extend(quad([
                at(a.0, a.1, 0),
                at(b.0, b.1, 0),
                at(b.0, b.1, 1),
                at(a.0, a.1, 1),
            ]));
        }
        for z in [0, 1].into_iter().skip(usize::from(!bottom)) {
            faces.extend(quad([at(0, 0, z), at(1, 0, z), at(1, 1, z), at(0, 1, z)]));
        }
        let occluders = Occluders::build(&faces);
        let observer = Observer { occluders: &occluders, point, normal: -DVec3::Z };
        let (mut shadows, mut active) = (Shadows::default(), vec![]);
        shadows.look_from(&observer);
        shadows.find(&observer, &frame, &floor, &mut active);
        assert_eq!(active.len(), 1, "{seed}");
    }
}
