//! A small lamp in front of a wall: a spot of light smaller than an element, and the lamp that made it in
//! the way of what it reflects.
//!
//! The other way to the answer is a light tracer of its own: photons from the lamp, each bounce joined
//! to the points that are asked for.

mod common;
#[allow(dead_code)]
#[path = "common/random.rs"]
mod random;

use std::f64::consts::{PI, TAU};

use common::{box_quads, material, scene};
use glam::{DVec3, dvec3};
use lumel::Monitor;
use lumel::operator::Walker;
use lumel::scene::Scene;
use lumel::solve::{WithinOptions, light_within};
use random::Random;
use rayon::prelude::*;

const SIZE: DVec3 = dvec3(5.0, 2.7, 5.0);
const REFLECTANCE: f64 = 0.6;
/// Middle of the lamp, which faces the wall z = 0, and half of its side.
const LAMP: DVec3 = dvec3(2.5, 1.9, 0.05);
const HALF: f64 = 0.03;

/// Points of floor and ceiling.
const POINTS: [(DVec3, DVec3); 3] = [
    (dvec3(1.5, 0.0, 4.2), DVec3::Y),
    (dvec3(4.4, 2.7, 2.2), DVec3::NEG_Y),
    (dvec3(0.7, 2.7, 1.5), DVec3::NEG_Y),
];

fn room() -> Scene {
    let mut quads: Vec<_> =
        box_quads(DVec3::ZERO, SIZE, false).into_iter().map(|quad| (quad, 0)).collect();
    let p = |x: f64, y: f64| LAMP + HALF * dvec3(x, y, 0.0);
    quads.push(([p(-1.0, -1.0), p(-1.0, 1.0), p(1.0, 1.0), p(1.0, -1.0)], 1));
    scene(&quads, vec![material("wall", REFLECTANCE, 0.0), material("lamp", 0.0, 1.0)])
}

/// Whether the lamp is between `o` and `o` + `most` `d`.
fn meets_lamp(o: DVec3, d: DVec3, most: f64) -> bool {
    let t = (LAMP.z - o.z) / d.z;
    let off = (o + t * d - LAMP).abs();
    t > 1e-9 && t < most && off.x <= HALF && off.y <= HALF
}

/// Distance to the walls, and the axis of the one that is met.
fn walls(o: DVec3, d: DVec3) -> (f64, usize) {
    let reach = |k: usize| {
        let wall = if d[k] > 0.0 { SIZE[k] } else { 0.0 };
        if d[k] == 0.0 { f64::INFINITY } else { (wall - o[k]) / d[k] }
    };
    let axis = (0..3).min_by(|&a, &b| reach(a).total_cmp(&reach(b))).unwrap();
    (reach(axis), axis)
}

fn diffuse(random: &mut Random, axis: usize, sign: f64) -> DVec3 {
    let (r, (s, c)) = (random.unit().sqrt(), (TAU * random.unit()).sin_cos());
    let mut d = DVec3::ZERO;
    d[axis] = sign * (1.0 - r * r).sqrt();
    d[(axis + 1) % 3] = r * c;
    d[(axis + 2) % 3] = r * s;
    d
}

/// What one photon of power 1 adds to the irradiance at the points.
fn photon(random: &mut Random) -> [f64; 3] {
    let mut found = [0.0; 3];
    let mut o = LAMP + HALF * dvec3(random.within(-1.0, 1.0), random.within(-1.0, 1.0), 0.0);
    let mut d = diffuse(random, 2, -1.0);
    let mut power = 1.0;
    for bounce in 0.. {
        let (t, axis) = walls(o, d);
        if bounce > 0 && meets_lamp(o, d, t) {
            break;
        }
        let sign = -d[axis].signum();
        o += t * d;
        o[axis] = if sign < 0.0 { SIZE[axis] } else { 0.0 };
        power *= REFLECTANCE;
        for (sum, (point, normal)) in found.iter_mut().zip(POINTS) {
            let to = point - o;
            let square = to.length_squared();
            let cosines = (sign * to[axis]).max(0.0) * (-to.dot(normal)).max(0.0);
            if cosines > 0.0 && !meets_lamp(o, to, 1.0) {
                *sum += power * cosines / (PI * square * square);
            }
        }
        if power < 0.05 {
            if random.below(2) == 0 {
                break;
            }
            power *= 2.0;
        }
        d = diffuse(random, axis, sign);
    }
    found
}

/// Irradiance at the points, and its standard deviation.
fn traced() -> ([f64; 3], [f64; 3]) {
    const SEEDS: u64 = 64;
    const PHOTONS: u32 = 40_000;
    let power = PI * (2.0 * HALF).powi(2);
    let batches: Vec<[f64; 3]> = (0..SEEDS)
        .into_par_iter()
        .map(|seed| {
            let mut random = Random::new(seed);
            let mut sum = [0.0; 3];
            for _ in 0..PHOTONS {
                let one = photon(&mut random);
                (0..3).for_each(|k| sum[k] += one[k]);
            }
            sum.map(|s| power * s / f64::from(PHOTONS))
        })
        .collect();
    let n = SEEDS as f64;
    let mean = [0, 1, 2].map(|k| batches.iter().map(|b| b[k]).sum::<f64>() / n);
    let square = |k: usize| batches.iter().map(|b| (b[k] - mean[k]).powi(2)).sum::<f64>();
    (mean, [0, 1, 2].map(|k| (square(k) / (n * (n - 1.0))).sqrt()))
}

#[test]
fn a_lamp_close_to_a_wall_agrees_with_a_light_tracer() {
    let room = room();
    let (want, noise) = traced();
    for tolerance in [1e-2, 2e-3] {
        let options = WithinOptions::new(tolerance, 1 << 33);
        let light = light_within(&room, &options, &Monitor::silent()).unwrap();
        let mean = light.apart().unwrap().estimate.mean.x;
        for (k, (point, normal)) in POINTS.into_iter().enumerate() {
            let got = light.irradiance(&mut Walker::default(), point, normal).x;
            println!("{tolerance}: {got:.4e}, traced {:.4e} +- {:.1e}", want[k], noise[k]);
            let most = tolerance * mean + 4.0 * noise[k];
            assert!((got - want[k]).abs() <= most, "{got} {} at {tolerance}", want[k]);
        }
    }
}
