//! Things that float a little above others: light comes into the gap along its rim, no deeper than it is
//! high, and nobody knows that but the mesh.

mod common;
#[path = "common/random.rs"]
#[allow(dead_code)]
mod random;

use common::{box_quads, material, scene};
use glam::DVec3;
use lumel::Monitor;
use lumel::operator::Walker;
use lumel::scene::Scene;
use lumel::solve::{Light, WithinOptions, light_within};
use random::Random;
use rayon::prelude::*;

/// Size of the room, and the sheet's rectangle along x and y.
const ROOM: f64 = 2.0;
const SHEET: [[f64; 2]; 2] = [[0.4, 1.4], [0.5, 1.5]];

/// Where the sides of the sheet are cut: by hand, at depths of half a gap to 16 gaps.
fn graded([a, b]: [f64; 2], gap: f64) -> Vec<f64> {
    let depths = [0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0].map(|k| k * gap);
    let inside = |d: &&f64| **d < 0.3 * (b - a);
    let near: Vec<f64> = depths.iter().filter(inside).map(|d| a + d).collect();
    let far: Vec<f64> = depths.iter().filter(inside).rev().map(|d| b - d).collect();
    [near, far].concat()
}

/// A closed room with a two-sided sheet over its floor: each of both two triangles, or cut by hand.
fn room(gap: f64, by_hand: bool) -> Scene {
    let mut quads: Vec<_> =
        box_quads(DVec3::ZERO, DVec3::splat(ROOM), false).into_iter().map(|q| (q, 0)).collect();
    // The ceiling shines.
    quads[1].1 = 1;
    let [x, y] = if by_hand { SHEET.map(|side| graded(side, gap)) } else { SHEET.map(Vec::from) };
    let grid = |x: &[f64], y: &[f64], z: f64| -> Vec<[DVec3; 4]> {
        let cells = x.windows(2).flat_map(|x| y.windows(2).map(move |y| (x, y)));
        let corners =
            |(x, y): (&[f64], &[f64])| [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])];
        cells.map(|c| corners(c).map(|(x, y)| DVec3::new(x, y, z))).collect()
    };
    if by_hand {
        quads.remove(0);
        let pad = |x: &[f64]| [&[0.0], x, &[ROOM]].concat();
        quads.extend(grid(&pad(&x), &pad(&y), 0.0).into_iter().map(|q| (q, 0)));
    }
    quads.extend(grid(&x, &y, gap).into_iter().map(|q| (q, 2)));
    let mut room = scene(
        &quads,
        vec![material("grey", 0.5, 0.0), material("lamp", 0.5, 1.0), material("both", 0.5, 0.0)],
    );
    room.materials[2].two_sided = true;
    room
}

fn within(scene: &Scene, tolerance: f64) -> Light {
    light_within(scene, &WithinOptions::new(tolerance, 2 << 30), &Monitor::silent()).unwrap()
}

/// Points of a flat rectangle, evenly.
fn spread(random: &mut Random, count: usize, z: f64, normal: f64) -> Vec<(DVec3, DVec3)> {
    let [[x0, x1], [y0, y1]] = if z == 0.0 || z == ROOM { [[0.0, ROOM]; 2] } else { SHEET };
    let mut point = || DVec3::new(random.within(x0, x1), random.within(y0, y1), z);
    (0..count).map(|_| (point(), normal * DVec3::Z)).collect()
}

#[test]
fn light_comes_into_narrow_gaps_as_far_as_it_should() {
    for (gap, tolerance, most) in [(1e-4, 1e-2, 400), (1e-3, 3e-3, 8000), (1e-2, 1e-2, 4000)] {
        let reference = within(&room(gap, true), 0.3 * tolerance);
        let light = within(&room(gap, false), tolerance);
        // Floor, ceiling, the sheet's lower and upper side; walls are far away.
        let mut random = Random::new(5);
        let points = [
            spread(&mut random, 4000, 0.0, 1.0),
            spread(&mut random, 4000, ROOM, -1.0),
            spread(&mut random, 1000, gap, -1.0),
            spread(&mut random, 1000, gap, 1.0),
        ]
        .concat();
        let pairs: Vec<(f64, f64)> = points
            .par_iter()
            .map_init(Walker::default, |walker, &(x, n)| {
                (light.irradiance(walker, x, n).x, reference.irradiance(walker, x, n).x)
            })
            .collect();
        let count = pairs.len() as f64;
        let mean = pairs.iter().map(|p| p.1).sum::<f64>() / count;
        let squares = pairs.iter().map(|p| (p.0 - p.1) * (p.0 - p.1)).sum::<f64>();
        let error = (squares / count).sqrt() / mean;
        let estimate = light.apart().unwrap().estimate.rms;
        let elements = light.mesh.elements();
        println!("gap {gap:e}: error {error:.1e}, estimate {estimate:.1e}, {elements} elements");
        assert!(error <= tolerance && estimate <= tolerance, "gap {gap:e}: {error:e}");
        assert!(estimate >= 0.4 * error, "gap {gap:e}: error {error:e}, estimate {estimate:e}");
        assert!(elements <= most, "gap {gap:e}: {elements} elements");
    }
}
