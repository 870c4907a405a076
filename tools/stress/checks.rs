//! What must hold in any scene, and how far it does not.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use lumel::geometry::polygon::twice_area;
use lumel::geometry::{Frame, triangle_area};
use lumel::mesh::{Basis, Refinement};
use lumel::monitor::Monitor;
use lumel::operator::fast::FastOptions;
use lumel::operator::{Operator, OperatorKind, Walker};
use lumel::scene::Scene;
use lumel::solve::{SolveOptions, solve};
use lumel::visibility::{Observer, Shadows};
use rayon::prelude::*;

use super::common::{Prepared, exact_of};
use super::random::Random;
use super::rays::{look, sees};
use super::scenes::{Case, Place};

/// Rays that tell whether all that a point sees radiates.
const RAYS_FOR_CLOSURE: usize = 64;

/// How much is looked at.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Elements aimed at.
    pub elements: usize,
    /// Points from which rays are cast, and how many from each.
    pub points: usize,
    pub rays: usize,
    /// Pairs of points that should see each other both ways.
    pub pairs: usize,
}

/// Radiosity that is linear in space, W/m^2: linear elements hold it exactly.
#[derive(Clone, Copy, Debug)]
pub struct Ramp {
    centre: DVec3,
    /// Change along one metre.
    slope: DVec3,
}

impl Ramp {
    /// Between 0.5 and 1.5 in a scene, or 1 everywhere.
    pub fn of(scene: &Scene, basis: Basis) -> Ramp {
        let (low, high) = scene.bounds();
        let slope = match basis {
            Basis::Constant => DVec3::ZERO,
            Basis::Linear => DVec3::new(0.4, -0.3, 0.3) / (high - low).max_element(),
        };
        Ramp { centre: 0.5 * (low + high), slope }
    }

    pub fn at(&self, x: DVec3) -> f64 {
        1.0 + self.slope.dot(x - self.centre)
    }
}

/// Irradiance from given radiosities at the nodes, and the sum of the row, by exact visibility.
pub fn gathered(
    prepared: &Prepared,
    walker: &mut Walker,
    (point, normal): (DVec3, DVec3),
    values: &[f64],
) -> [f64; 2] {
    let nodes = prepared.mesh.basis.nodes();
    let mut sums = [0.0; 2];
    walker.row(prepared.stage(), point, normal, |element, c| {
        for (k, c) in c[..nodes].iter().enumerate() {
            sums[0] += c * values[element as usize * nodes + k] / PI;
            sums[1] += c / PI;
        }
    });
    sums
}

/// Largest errors of one scene; zero where nothing was looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// |sum of a row - 1| where all that is seen radiates, beyond what may be lost in gaps whose sides count
    /// as touching, and rows looked at.
    pub closure: f64,
    pub rows: usize,
    /// Sum of a row above 1.
    pub above: f64,
    /// Exact irradiance against rays.
    pub rays: f64,
    /// Pairs of points of which one sees the other and not the other way round, or that a ray tells
    /// otherwise; and pairs looked at.
    pub one_way: usize,
    pub pairs: usize,
    /// The fast operator to 1e-6 against the exact one, relative to the largest irradiance.
    pub fast: f64,
    /// ||E - (I - K) u|| / ||E|| of the solution to 1e-10, computed again.
    pub residual: f64,
}

impl Errors {
    pub fn worst(self, o: Errors) -> Errors {
        Errors {
            closure: self.closure.max(o.closure),
            rows: self.rows + o.rows,
            above: self.above.max(o.above),
            rays: self.rays.max(o.rays),
            one_way: self.one_way + o.one_way,
            pairs: self.pairs + o.pairs,
            fast: self.fast.max(o.fast),
            residual: self.residual.max(o.residual),
        }
    }
}

/// All checks of one scene on one mesh.
pub fn errors(case: &Case, basis: Basis, effort: Effort, seed: u64) -> Errors {
    let prepared = Prepared::new(&case.scene, basis, Refinement::Elements(effort.elements));
    let scene = &case.scene;
    let ramp = Ramp::of(scene, basis);
    let count = prepared.mesh.nodes();
    let values: Vec<f64> = (0..count).map(|i| ramp.at(prepared.mesh.node(i).0)).collect();
    let mut places: Vec<(DVec3, DVec3)> = (0..count).map(|i| prepared.mesh.node(i)).collect();
    places.extend(&case.points);
    let lift = 8.0 * prepared.occluders.coincidence();
    let step = (places.len() / effort.points.max(1)).max(1);
    let mut errors = places
        .par_iter()
        .enumerate()
        .map_init(Walker::default, |walker, (i, &(point, normal))| {
            let [h, sum] = gathered(&prepared, walker, (point, normal), &values);
            let mut found = Errors { above: sum - 1.0, ..Errors::default() };
            let at = |x| ramp.at(x);
            if case.closed {
                let seen = look(scene, point, normal, RAYS_FOR_CLOSURE, lift, at);
                if seen.radiant == 1.0 && seen.black == 0.0 {
                    let short = 1.0 - sum - case.lost_in_gaps(point);
                    (found.closure, found.rows) = (short.max(sum - 1.0).max(0.0), 1);
                }
            }
            if i % step == step / 2 {
                let seen = look(scene, point, normal, effort.rays, lift, at);
                found.rays = (seen.irradiance - h).abs();
            }
            found
        })
        .reduce(Errors::default, Errors::worst);
    (errors.one_way, errors.pairs) = one_way(scene, &prepared, effort.pairs, seed);
    let exact = exact_of(&prepared);
    errors.residual = residual(scene, &prepared, &exact);
    errors.fast = fast_against(&prepared, &exact, &values);
    errors
}

/// Pairs of points that disagree about seeing each other, and pairs that were looked at.
fn one_way(scene: &Scene, prepared: &Prepared, pairs: usize, seed: u64) -> (usize, usize) {
    let mut r = Random::new(!seed);
    let (size, rounding) = (scene.extent(), prepared.occluders.coincidence());
    let (mut wrong, mut count) = (0, 0);
    let mut shadows = Shadows::default();
    for _ in 0..20 * pairs {
        if count == pairs {
            break;
        }
        let mut place = || {
            let face = &prepared.mesh.faces[r.below(prepared.mesh.faces.len())];
            let (mut s, mut t) = (r.unit(), r.unit());
            if s + t > 1.0 {
                (s, t) = (1.0 - s, 1.0 - t);
            }
            let [a, b, c] = face.corners;
            (face.frame, a + s * (b - a) + t * (c - a))
        };
        let (one, other) = (place(), place());
        let (p, q) = (one.0.lift(one.1), other.0.lift(other.1));
        let apart = 1e-4 * size;
        if one.0.height(q) < apart || other.0.height(p) < apart {
            continue;
        }
        let Some(free) = sees(scene, p, q, 1e-5 * size, rounding) else { continue };
        count += 1;
        let there = share_seen(prepared, &mut shadows, (p, one.0.n), other, size);
        let back = share_seen(prepared, &mut shadows, (q, other.0.n), one, size);
        let want = if free { 1.0 } else { 0.0 };
        // Nothing but roundings of a small triangle's area.
        if (there - want).abs() > 1e-6 || (back - want).abs() > 1e-6 {
            wrong += 1;
        }
    }
    (wrong, count)
}

/// Share of a small triangle around a point of a plane that is seen.
fn share_seen(
    prepared: &Prepared,
    shadows: &mut Shadows,
    (point, normal): (DVec3, DVec3),
    (frame, x): (Frame, DVec2),
    size: f64,
) -> f64 {
    let observer = Observer { occluders: &prepared.occluders, point, normal };
    let s = 1e-7 * size;
    let small =
        [DVec2::new(1.0, 0.0), DVec2::new(-0.5, 0.8), DVec2::new(-0.5, -0.8)].map(|d| x + s * d);
    let mut active = vec![];
    shadows.look_from(&observer);
    shadows.find(&observer, &frame, &small, &mut active);
    if active.is_empty() {
        return 1.0;
    }
    let seen: f64 = shadows.visible(&small, &active).iter().map(twice_area).sum();
    0.5 * seen / triangle_area(&small)
}

/// The residual of a solution, from rows that are summed again here.
fn residual(scene: &Scene, prepared: &Prepared, exact: &Operator) -> f64 {
    let (rho, e) = lumel::mesh::appearance(scene, &prepared.mesh);
    let options = SolveOptions { residual: 1e-10, most_iterations: 2000 };
    let solution = solve(exact, &rho, &e, None, &options, &Monitor::silent()).unwrap();
    let u: Vec<f64> = solution.radiosity.iter().map(|u| u.x).collect();
    let off: Vec<f64> = (0..u.len())
        .into_par_iter()
        .map_init(Walker::default, |walker, i| {
            let [h, _] = gathered(prepared, walker, prepared.mesh.node(i), &u);
            e[i].x - (u[i] - rho[i].x * h)
        })
        .collect();
    let norm = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>().sqrt();
    let size = norm(&mut e.iter().map(|e| e.x));
    if size > 0.0 { norm(&mut off.into_iter()) / size } else { 0.0 }
}

fn fast_against(prepared: &Prepared, exact: &Operator, values: &[f64]) -> f64 {
    let options = OperatorKind::Fast(FastOptions::new(1e-6, None, None).unwrap());
    let fast = Operator::build(prepared.stage(), options, u64::MAX, &Monitor::silent()).unwrap();
    let u: Vec<[f64; 1]> = values.iter().map(|&u| [u]).collect();
    let of = |operator: &Operator| {
        let mut out = vec![[0.0]; u.len()];
        operator.apply(&u, &mut out);
        out
    };
    let (got, want) = (of(&fast), of(exact));
    let largest = want.iter().map(|h| h[0]).fold(0.0, f64::max);
    got.iter().zip(&want).map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f64::max) / largest
}

/// Largest difference between irradiances of a scene and of the same one elsewhere in space, at the
/// same points, relative to the largest. Meshes may differ, the light may not.
pub fn moved(case: &Case, basis: Basis, place: &Place, effort: Effort) -> f64 {
    let (scene, to) = place.put(&case.scene);
    let still = Prepared::new(&case.scene, basis, Refinement::Elements(effort.elements));
    let gone = Prepared::new(&scene, basis, Refinement::Elements(effort.elements));
    let ramp = Ramp::of(&case.scene, basis);
    // Gradients are turned with the scene.
    let (origin, inverse) = (to(DVec3::ZERO), place.turn.transpose());
    let back = |x: DVec3| inverse * (x - origin) / place.scale;
    let of = |prepared: &Prepared, at: &dyn Fn(DVec3) -> f64| -> Vec<f64> {
        (0..prepared.mesh.nodes()).map(|i| at(prepared.mesh.node(i).0)).collect()
    };
    let here = of(&still, &|x| ramp.at(x));
    let there = of(&gone, &|x| ramp.at(back(x)));
    let mut points: Vec<(DVec3, DVec3)> =
        (0..still.mesh.nodes()).step_by(7).map(|i| still.mesh.node(i)).collect();
    // Points beside edges would be on their other side.
    if place.far == DVec3::ZERO {
        points.extend(&case.points);
    }
    let off: Vec<[f64; 2]> = points
        .par_iter()
        .map_init(Walker::default, |walker, &(point, normal)| {
            let [want, _] = gathered(&still, walker, (point, normal), &here);
            let [got, _] = gathered(&gone, walker, (to(point), place.turn * normal), &there);
            [(got - want).abs(), want]
        })
        .collect();
    let worst = |k: usize| off.iter().map(|o| o[k]).fold(0.0, f64::max);
    worst(0) / worst(1).max(f64::MIN_POSITIVE)
}
