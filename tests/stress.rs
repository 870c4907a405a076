//! What must hold in scenes that are hard on purpose: the short form of `cargo bench --bench stress`.

#[path = "../tools/stress/checks.rs"]
mod checks;
mod common;
#[path = "../tools/stress/light.rs"]
mod light;
#[path = "common/packed.rs"]
mod packed;
#[path = "common/random.rs"]
#[allow(dead_code)]
mod random;
#[path = "../tools/stress/rays.rs"]
mod rays;
#[path = "../tools/stress/scenes.rs"]
mod scenes;

use checks::{Effort, errors, moved};
use light::{Outcome, Truth, bright, contrast, imbalance, reflecting};
use lumel::Monitor;
use lumel::operator::Walker;
use lumel::scene::Scene;
use lumel::solve::{WithinOptions, light_within};
use rayon::prelude::*;
use rays::look;
use scenes::{FAMILIES, places};

const EFFORT: Effort = Effort { elements: 60, points: 3, rays: 5000, pairs: 60 };

/// Seeds that are not among those of the tables.
const SEEDS: std::ops::Range<u64> = 1000..1002;

#[test]
fn rows_are_right_wherever_a_scene_is() {
    for family in &FAMILIES {
        let rows = SEEDS.into_par_iter().map(|seed| {
            let case = (family.make)(seed);
            let found = errors(&case, family.basis, EFFORT, seed);
            let name = family.name;
            let most = family.closure.max(1e-13);
            assert!(found.closure.max(found.above) <= most, "{name}, {seed}: {found:?}");
            // 5000 rays of a lattice.
            assert!(found.rays < 1e-2, "{name}, {seed}: {found:?}");
            assert!(found.one_way == 0 && found.pairs > 20, "{name}, {seed}: {found:?}");
            assert!(found.fast < 1e-6 && found.residual < 2e-10, "{name}, {seed}: {found:?}");
            let (turned, far) = places(seed);
            let at = |place| moved(&case, family.basis, place, EFFORT);
            let one = (turned.iter().map(at).fold(0.0, f64::max), at(&far[1]));
            assert!(one.0 <= family.turned && one.1 <= family.far, "{name}, {seed}: {one:?}");
            if case.closed { found.rows } else { 1000 }
        });
        assert!(rows.sum::<usize>() > 100, "{}", family.name);
    }
}

/// A block with an edge that passes a point of the floor by some roundings: a row was 1.3e-4 too large.
#[test]
fn edges_along_the_line_of_sight_are_exact() {
    let family = &FAMILIES[8];
    let found = errors(&(family.make)(1002), family.basis, EFFORT, 1002);
    assert!(found.closure <= family.closure, "{found:?}");
}

/// Checks a scene against itself, solved to a tenth of the tolerance.
fn is_within(name: &str, scene: &Scene, tolerance: f64) {
    let found = Truth::of(scene, 0.1 * tolerance, 1500).against(scene, None, tolerance);
    println!("{name}: {found:?}, {:.2}", found.estimate / found.error);
    assert!(found.error <= tolerance, "{name}: {found:?}");
    // Far below the tolerance, what emitted light is off by is not in the estimate.
    let seen = found.error - 1e-3 * tolerance;
    assert!(found.estimate >= 0.5 * seen, "{name}: {found:?}");
    assert!(found.imbalance.abs() <= 2.0 * tolerance, "{name}: {found:?}");
}

#[test]
fn tolerances_are_met_in_hard_scenes() {
    for family in [1, 4, 5, 7].map(|k| &FAMILIES[k]) {
        is_within(family.name, &(family.make)(SEEDS.start).scene, 2e-2);
    }
}

#[test]
fn bright_rooms_and_lamps_of_contrast_meet_their_tolerance() {
    is_within("contrast", &contrast(SEEDS.start), 2e-2);
    is_within("reflectance 0.999", &bright(SEEDS.start, 0.999), 2e-2);
    is_within("reflectance 0", &bright(SEEDS.start, 0.0), 2e-2);
}

#[test]
fn bright_closed_rooms_keep_their_power() {
    for seed in [1, 3] {
        let options = WithinOptions::new(1e-2, 1 << 30);
        let light = light_within(&bright(seed, 0.9), &options, &Monitor::silent()).unwrap();
        let off = imbalance(&light);
        println!("{seed}: {off:.1e}");
        assert!(off.abs() < 4e-3, "{seed}: {off:e}");
    }
}

#[test]
fn all_light_is_found_whatever_is_reflected() {
    for seed in SEEDS {
        for rho in [0.0, 0.9, 0.999, 1.0] {
            for closed in [true, false] {
                match reflecting(seed, closed, rho) {
                    Outcome::Refused => assert!(closed && rho == 1.0, "{seed}, {closed}, {rho}"),
                    Outcome::Solved(error, _) => {
                        assert!(!closed || rho < 1.0, "{seed}: there is no solution");
                        assert!(error < 1e-9, "{seed}, {closed}, {rho}: {error:e}");
                    }
                }
            }
        }
    }
}

/// Of two blocks side by side each has a face that looks into the other one, and lies on one that does
/// not: neither hides the other. But no light comes there.
#[test]
fn it_is_dark_below_bottomless_blocks_side_by_side() {
    let mut inside = 0;
    for seed in 0..4 {
        let scene = (FAMILIES[2].make)(seed).scene;
        let options = WithinOptions::new(2e-2, 1 << 30);
        let light = light_within(&scene, &options, &Monitor::silent()).unwrap();
        let mean = light.apart().unwrap().estimate.mean.x;
        let mut walker = Walker::default();
        for node in 0..light.mesh.nodes() {
            let (point, normal) = light.mesh.node(node);
            if look(&scene, point, normal, 100, 1e-14, |_| 0.0).black == 1.0 {
                inside += 1;
                let h = light.irradiance(&mut walker, point, normal).x / mean;
                assert!(h <= 1e-6, "seed {seed}: {point} looking along {normal} gets {h:e}");
            }
        }
    }
    assert!(inside > 50, "{inside}");
}
