//! Light to a tolerance, its balance of energy, and reflectances up to 1.

use std::f64::consts::PI;

use glam::DVec3;
use lumel::Error;
use lumel::geometry::triangle_area;
use lumel::mesh::{Basis, Refinement};
use lumel::monitor::Monitor;
use lumel::operator::Walker;
use lumel::scene::Scene;
use lumel::solve::{Light, SolveOptions, WithinOptions, light_within, solve};
use rayon::prelude::*;

use super::common::{Prepared, box_quads, exact_of, material, scene};
use super::random::Random;
use super::scenes::Place;

/// Most nodes at which energies are summed: each costs an exact row.
const MOST_NODES: usize = 4000;

/// A light made to a tolerance: its error, and what it says of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Within {
    /// Root mean square over the surface, relative to the mean, of the worst channel.
    pub error: f64,
    pub estimate: f64,
    /// (Emitted - absorbed - escaped) / emitted; 0 where there are too many nodes. What falls on black
    /// backs counts as escaped.
    pub imbalance: f64,
}

/// Random points of the surface, evenly by area.
fn spread(light: &Light, count: usize) -> Vec<(DVec3, DVec3)> {
    let areas: Vec<f64> = light.mesh.roots.iter().map(|r| triangle_area(&r.corners)).collect();
    let total: f64 = areas.iter().sum();
    let mut r = Random::new(17);
    (0..count)
        .map(|_| {
            let mut left = r.unit() * total;
            let number = areas.iter().position(|area| {
                left -= area;
                left < 0.0
            });
            let number = number.unwrap_or(0);
            let (t, frame) =
                (light.mesh.roots[number].corners, light.mesh.root_frame(number as u32));
            let (mut s, mut u) = (r.unit(), r.unit());
            if s + u > 1.0 {
                (s, u) = (1.0 - s, 1.0 - u);
            }
            (frame.lift(t[0] + s * (t[1] - t[0]) + u * (t[2] - t[0])), frame.n)
        })
        .collect()
}

fn irradiances(light: &Light, points: &[(DVec3, DVec3)]) -> Vec<DVec3> {
    points
        .par_iter()
        .map_init(Walker::default, |walker, &(point, normal)| {
            light.irradiance(walker, point, normal)
        })
        .collect()
}

/// A scene solved to a small tolerance, for comparison.
pub struct Truth {
    points: Vec<(DVec3, DVec3)>,
    irradiance: Vec<DVec3>,
}

fn solved(scene: &Scene, tolerance: f64) -> Light {
    light_within(scene, &WithinOptions::new(tolerance, 2 << 30), &Monitor::silent()).unwrap()
}

impl Truth {
    /// Irradiance at random points.
    pub fn of(scene: &Scene, tolerance: f64, points: usize) -> Truth {
        let light = solved(scene, tolerance);
        let points = spread(&light, points);
        Truth { irradiance: irradiances(&light, &points), points }
    }

    /// Compares with the scene, as it is or elsewhere in space, solved to a tolerance.
    pub fn against(&self, scene: &Scene, place: Option<&Place>, tolerance: f64) -> Within {
        let (light, got) = match place {
            None => {
                let light = solved(scene, tolerance);
                let got = irradiances(&light, &self.points);
                (light, got)
            }
            Some(place) => {
                let (moved, to) = place.put(scene);
                let light = solved(&moved, tolerance);
                let there: Vec<_> =
                    self.points.iter().map(|&(x, n)| (to(x), place.turn * n)).collect();
                let got = irradiances(&light, &there);
                (light, got)
            }
        };
        let want = &self.irradiance;
        let n = want.len() as f64;
        let mean = want.iter().sum::<DVec3>() / n;
        let squares = got.iter().zip(want).map(|(a, b)| (*a - *b) * (*a - *b)).sum::<DVec3>() / n;
        let few = light.mesh.nodes() <= MOST_NODES;
        Within {
            error: (squares / (mean * mean)).max_element().sqrt(),
            estimate: light.apart().unwrap().estimate.rms,
            imbalance: if few { imbalance(&light) } else { 0.0 },
        }
    }
}

/// What is emitted, less what is absorbed and what escapes, over the first.
pub fn imbalance(light: &Light) -> f64 {
    let nodes = light.mesh.basis.nodes();
    let sums: Vec<DVec3> = (0..light.mesh.nodes())
        .into_par_iter()
        .map_init(Walker::default, |walker, i| {
            let area = light.mesh.area(i / nodes) / nodes as f64;
            let (point, normal) = light.mesh.node(i);
            let mut sum = 0.0;
            walker.row(light.stage(), point, normal, |_, c| sum += c.iter().sum::<f64>() / PI);
            // Gathered: what arrives on black surfaces is not kept.
            let h = light.irradiance(walker, point, normal).x;
            let (e, rho) = (light.exitance[i].x, light.reflectance[i].x);
            area * DVec3::new(e, (1.0 - rho) * h, (e + rho * h) * (1.0 - sum))
        })
        .collect();
    let sum: DVec3 = sums.into_iter().sum();
    if sum.x > 0.0 { (sum.x - sum.y - sum.z) / sum.x } else { 0.0 }
}

/// A box, closed or without its ceiling and a wall, with blocks floating in it.
fn boxes(seed: u64, closed: bool) -> Scene {
    let mut r = Random::new(seed);
    let mut quads = box_quads(DVec3::ZERO, DVec3::ONE, false);
    if !closed {
        quads.truncate(4);
        quads.remove(1);
    }
    for k in 0..1 + r.below(3) {
        let low = DVec3::new(0.1 + 0.3 * k as f64, r.within(0.1, 0.4), r.within(0.1, 0.4));
        let size = DVec3::new(r.within(0.05, 0.25), r.within(0.1, 0.5), r.within(0.1, 0.5));
        quads.extend(box_quads(low, low + size, true));
    }
    let quads: Vec<_> = quads.into_iter().map(|q| (q, 0)).collect();
    scene(&quads, vec![material("grey", 0.5, 0.0)])
}

/// How a scene of one reflectance is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Largest error of the radiosity, relative to the largest, and products with the operator.
    Solved(f64, usize),
    /// It is said that there is no solution.
    Refused,
}

impl std::fmt::Display for Outcome {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Outcome::Solved(error, products) => write!(f, "{error:.0e}, {products}"),
            Outcome::Refused => write!(f, "refused"),
        }
    }
}

/// Solves boxes all of which emit and reflect alike. The truth is E / (1 - rho) where they are closed,
/// and the limit of the series of reflections where they are not.
pub fn reflecting(seed: u64, closed: bool, rho: f64) -> Outcome {
    let scene = boxes(seed, closed);
    let prepared = Prepared::new(&scene, Basis::Linear, Refinement::Elements(150));
    let (operator, n) = (exact_of(&prepared), prepared.mesh.nodes());
    let options = SolveOptions { residual: 1e-12, most_iterations: 3000 };
    let (all, e) = (vec![DVec3::splat(rho); n], vec![DVec3::ONE; n]);
    let solution = match solve(&operator, &all, &e, None, &options, &Monitor::silent()) {
        Ok(solution) => solution,
        Err(Error::NotConverged { .. }) => return Outcome::Refused,
        Err(other) => panic!("{other}"),
    };
    let want = if closed { vec![1.0 / (1.0 - rho); n] } else { reflections(&prepared, rho) };
    let largest = want.iter().copied().fold(0.0, f64::max);
    let off = solution.radiosity.iter().zip(&want).map(|(u, want)| (u.x - want).abs());
    Outcome::Solved(off.fold(0.0, f64::max) / largest, solution.iterations)
}

/// Sum of all reflections of E = 1, one after the other, by rows that are summed here.
fn reflections(prepared: &Prepared, rho: f64) -> Vec<f64> {
    let n = prepared.mesh.nodes();
    let rows: Vec<Vec<(usize, f64)>> = (0..n)
        .into_par_iter()
        .map_init(Walker::default, |walker, i| {
            let (point, normal) = prepared.mesh.node(i);
            let mut row = vec![];
            walker.row(prepared.stage(), point, normal, |element, c| {
                row.extend((0..3).map(|k| (3 * element as usize + k, c[k] / PI)));
            });
            row
        })
        .collect();
    let (mut sum, mut last) = (vec![1.0; n], vec![1.0; n]);
    while last.iter().any(|&x: &f64| x.abs() > 1e-14) {
        last =
            rows.iter().map(|r| rho * r.iter().map(|&(j, c)| c * last[j]).sum::<f64>()).collect();
        sum.iter_mut().zip(&last).for_each(|(s, x)| *s += x);
    }
    sum
}

/// Rooms of two chambers with a gap between, a lamp in each, one a thousand times as bright as the
/// other.
pub fn contrast(seed: u64) -> Scene {
    let mut r = Random::new(seed);
    let mut quads: Vec<_> = box_quads(DVec3::ZERO, DVec3::new(2.0, 1.0, 1.0), false)
        .into_iter()
        .map(|q| (q, 0))
        .collect();
    let door = r.within(0.05, 0.3);
    let at = |y: f64, z: f64| DVec3::new(1.0, y, z);
    quads.push(([at(door, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(door, 1.0)], 1));
    for (k, x) in [r.within(0.2, 0.7), r.within(1.3, 1.8)].into_iter().enumerate() {
        let (y, half) = (r.within(0.3, 0.7), r.within(0.01, 0.1));
        let p = |i: f64, j: f64| DVec3::new(x + half * i, y + half * j, 0.98);
        let lamp = [p(-1.0, -1.0), p(-1.0, 1.0), p(1.0, 1.0), p(1.0, -1.0)];
        quads.push((lamp, 2 + (k as u32 + seed as u32) % 2));
    }
    let mut wall = material("wall", 0.6, 0.0);
    wall.two_sided = true;
    let lamps = [material("bright", 0.5, 1000.0), material("dim", 0.5, 1.0)];
    let [bright, dim] = lamps;
    scene(&quads, vec![material("grey", 0.6, 0.0), wall, bright, dim])
}

/// A closed furnished room of one reflectance, with a lamp.
pub fn bright(seed: u64, rho: f64) -> Scene {
    let mut room = boxes(seed, true);
    room.materials.push(material("lamp", rho, 1.0));
    room.materials[0].reflectance = DVec3::splat(rho);
    let p = |x: f64, y: f64| DVec3::new(x, y, 0.97);
    let lamp = [p(0.4, 0.4), p(0.4, 0.6), p(0.6, 0.6), p(0.6, 0.4)];
    for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
        room.triangles.push(super::common::triangle([lamp[a], lamp[b], lamp[c]], 1));
    }
    room
}
