//! Light to a tolerance: meshes are refined until the estimated error is small enough.
//!
//! Each mesh of the ladder has four times the elements of the one before. Irradiance is gathered
//! at points spread over the surface, from each solution: what changes from one to the next, and
//! how fast that falls, tells how far the last one is from the limit. Everything else (the operator, the
//! representation of direct light, fits, integrals, the iteration) is kept to shares of the
//! tolerance that were measured to be harmless; what gathering is off by is measured at the same
//! points.

use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use super::apart::{Apart, ApartOptions};
use super::direct::{Fineness, emission, surface_area};
use super::light::{ApartSource, FORECAST_FROM, Light, Reflected, Source};
use super::many::{is_many, light_of_many};
use super::samples::{Sample, samples};
use super::{LEAST_RESIDUAL, SolveOptions};
use crate::cluster::Clusters;
use crate::cluster::fit::Fit;
use crate::error::{Error, Result};
use crate::geometry::triangle_area;
use crate::mesh::{self, Basis, Mesh, MeshOptions, Refinement};
use crate::monitor::Monitor;
use crate::operator::gather::Radiant;
use crate::operator::walk::{Stage, Walker};
use crate::operator::{FastOptions, Operator, OperatorKind, reach};
use crate::scene::Scene;
use crate::visibility::Occluders;

/// The coarsest mesh, unless there are more roots.
pub const COARSEST: MeshOptions =
    MeshOptions { basis: Basis::Linear, refinement: Refinement::Elements(120) };

/// The largest error of all points over that of the samples.
const BETWEEN: f64 = 2.0;

/// Where something emits and no light has been found to arrive on meshes as fine as this, none does.
const DARK_FOR_GOOD: u32 = 5;

/// Parts of a solution are made as good as this share of the error that it is expected to have at
/// most, and the first ones to this tolerance.
const WORTH: f64 = 0.05;
const COARSEST_TOLERANCE: f64 = 0.01;

/// Iterated collocation on a mesh of four times the elements gains about this much.
const SWEEP_GAINS: f64 = 3.0;

/// Of every so many points one is gathered again to see what gathering is off by.
const GATHERED_AGAIN: usize = 4;

/// Roots are refined from the first mesh to the second, however small they are, if what they reflect
/// varies by more than this many units of the tolerance times the mean irradiance: what is the same in
/// both says nothing about its error.
const VARIED: f64 = 5.0;

/// Most steps of the ladder: elements 2^-12 of the coarsest.
const MOST_STEPS: u32 = 13;

/// A step costs at most about this many times the one before.
const GROWTH: f64 = 4.0;

/// What the tolerance leaves to each part, in units of it (times the mean irradiance).
///
/// Measured on the Cornell box at 0.1 %, as root mean square errors of the irradiance in the same
/// units: gathering 0.05, direct light 0.02, operator 0.02, residual 0.01.
pub(super) mod share {
    /// A cell's error in gathering.
    pub const GATHER: f64 = 0.5;
    /// Deviation of directly reflected light from linear, see [`super::Fineness`].
    pub const DIRECT: f64 = 0.2;
    /// A cell of an emitter.
    pub const EMITTER: f64 = 0.02;
    /// The operator, relative to the largest irradiance, where a fourth of the light and more is lost at
    /// each reflection. Where less is lost, errors go round more often: in proportion.
    pub const OPERATOR: f64 = 4.0;
    pub const LOST: f64 = 0.25;
    /// The residual.
    pub const RESIDUAL: f64 = 0.1;
    /// The estimated error of the solution: filling in takes what is left (errors add as squares).
    pub const SOLUTION: f64 = 0.92;
}

/// How one mesh follows from another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Four times the elements, everywhere: what wins in the benchmark.
    Uniform,
    /// Refined where two solutions differ most.
    Adaptive,
    /// As uniform, but the last mesh is not solved on: indirect light is gathered at its nodes from
    /// the solution before (iterated collocation).
    Iterated,
}

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WithinOptions {
    /// Root mean square error of irradiance over the surface, relative to its mean.
    pub tolerance: f64,
    /// Bytes that the operator may take.
    pub max_memory: u64,
    /// How one mesh follows from another.
    pub way: Way,
}

impl WithinOptions {
    /// The usual way to a tolerance.
    pub fn new(tolerance: f64, max_memory: u64) -> WithinOptions {
        WithinOptions { tolerance, max_memory, way: Way::Uniform }
    }
}

/// What is known of the error of the irradiance, relative to its mean over the surface; of the
/// channels the largest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Root mean square over the surface.
    pub rms: f64,
    /// Largest.
    pub maximum: f64,
    /// Mean irradiance over the surface, W/m^2.
    pub mean: DVec3,
    /// Error of this solution over its difference from the coarser one.
    pub of_change: f64,
    /// Meshes that were solved on.
    pub steps: u32,
}

/// Error of the finest solution over its difference from the one before, of solutions that changed
/// so much from step to step: 1/(r - 1) with a margin, where each step divides errors by r. One
/// change alone does not tell r: then the coarser solution was from the coarsest mesh, and worse
/// than it has to be. The last change tells too little where the coarser solution was also `rougher` in
/// its operator and the rest: but four times the elements halve what is left.
fn of_change(changes: &[f64], rougher: bool) -> f64 {
    const MARGIN: f64 = 1.3;
    /// Never less, however fast errors seem to fall: along rims they fall slowly, and are last to go.
    /// Never more, since steps with four times the elements do divide them.
    const BELIEVED: (f64, f64) = (0.7, 3.0);
    // The mean of all steps: single ones jump about.
    let reduction = match *changes {
        [first, .., last] if first > 0.0 && last > 0.0 => {
            (first / last).powf(1.0 / (changes.len() - 1) as f64)
        }
        _ => return FIRST,
    };
    let least = if rougher { 2.0 } else { 1.0 };
    (MARGIN / (reduction.max(least) - 1.0)).clamp(BELIEVED.0, BELIEVED.1)
}

/// Error over the first change, away from the edges of roots and beside them, where light is singular
/// and errors fall more slowly. Measured on rooms of blocks, strips and plates: at most 0.41 away from
/// edges, and 0.2 to 0.95 beside them, of changes that the balance of power ([`super::balance`]) does not
/// take a part of: a fifth more of those it does. Estimates for the shipped scenes are 1.2 to 2.7 times the
/// errors.
const FIRST: f64 = 0.5;
const FIRST_AT_RIM: f64 = 0.78;

/// The best so far.
struct Reached {
    apart: Apart,
    coarser: Option<Apart>,
    /// Indirect irradiance at the samples.
    at_samples: Vec<DVec3>,
    /// RMS changes from solution to solution, relative.
    changes: Vec<f64>,
    estimate: Estimate,
    /// What its parts were made for.
    tolerance: f64,
    allowed: f64,
}

/// What all steps share.
struct Ladder<'a> {
    scene: &'a Scene,
    occluders: &'a Occluders,
    options: &'a WithinOptions,
    base: &'a Mesh,
    emitters: &'a Radiant,
    /// Emitted power over area, W/m^2.
    emission: DVec3,
    /// Share of the light that is lost at a reflection, if nothing escapes.
    lost: f64,
    /// False where it is proved that no light arrives anywhere.
    arrives: bool,
    samples: Vec<Sample>,
    /// Direct irradiance at the samples.
    direct: Vec<DVec3>,
    /// What that is off by at some of them, W/m^2.
    direct_off: Vec<DVec3>,
    monitor: &'a Monitor<'a>,
}

/// Solves for the light of a scene to a tolerance.
///
/// Where memory or time do not suffice the best result is returned, and the light's
/// [`ApartSource::shortfall`] says why. Errors are those of a scene that cannot be solved even
/// coarsely.
pub fn light_within(scene: &Scene, options: &WithinOptions, monitor: &Monitor) -> Result<Light> {
    let triangles: Vec<[DVec3; 3]> = scene.triangles.iter().map(|t| t.vertices).collect();
    let occluders = Occluders::build(&triangles);
    let base = mesh::build_to_tolerance(scene, &COARSEST, options.tolerance)?;
    if is_many(base.roots.len(), options.tolerance) {
        return light_of_many(scene, base, occluders, options, monitor);
    }
    let clusters = Clusters::build(&base);
    let stage = Stage { mesh: &base, clusters: &clusters, occluders: &occluders };
    refuse_too_large(stage, options)?;
    let whole = emission(scene, stage, f64::INFINITY, options.max_memory, monitor)?;
    let mean = mean_emission(&base, &whole);
    let sends = |fit: &Fit<3>| fit.iter().flatten().any(|&e| e > 0.0);
    let emits: Vec<bool> = whole.field.fits.iter().take(base.roots.len()).map(sends).collect();
    let arrives = reach::arrives(stage, &emits);
    let unit = options.tolerance * mean.max_element();
    let emitters = emission(scene, stage, share::DIRECT * unit, options.max_memory, monitor)?;
    let samples = samples(&base);
    let direct = gathered(stage, &emitters, &samples, share::EMITTER * unit, monitor)?;
    let some: Vec<Sample> = samples.iter().step_by(GATHERED_AGAIN).copied().collect();
    let again = gathered(stage, &emitters, &some, 0.1 * share::EMITTER * unit, monitor)?;
    let pairs = direct.iter().step_by(GATHERED_AGAIN).zip(&again);
    let direct_off = pairs.map(|(a, b)| (*a - *b).abs()).collect();
    let ladder = Ladder {
        scene,
        occluders: &occluders,
        options,
        base: &base,
        emitters: &emitters,
        emission: mean,
        lost: 1.0 - mean_reflectance(scene, &base),
        arrives,
        samples,
        direct,
        direct_off,
        monitor,
    };
    let (reached, why) = ladder.climb()?;
    let met = reached.tolerance <= options.tolerance && reached.estimate.rms <= options.tolerance;
    let out_of_time = matches!(why, Some(Error::TimeLimit(_)));
    let source = |reflected| {
        Source::Apart(Box::new(ApartSource {
            emitters,
            reflected: Reflected::Cells(reflected),
            coarser: reached.coarser.map(|c| Reflected::Cells(c.reflected)),
            rays: None,
            allowed: reached.allowed,
            allowed_direct: share::EMITTER / share::GATHER * reached.allowed,
            estimate: reached.estimate,
            tolerance: options.tolerance,
            shortfall: if met { None } else { Some(why_not(why)) },
            out_of_time,
        }))
    };
    Ok(reached.apart.into_light(scene, occluders, source))
}

impl Ladder<'_> {
    /// Refines until the tolerance is met, or until something else ends it.
    fn climb(&self) -> Result<(Reached, Option<Error>)> {
        let mut reached = self.step(0, None)?;
        for step in 1..MOST_STEPS {
            if self.is_good_enough(&reached, 1.0) {
                break;
            }
            let start = Instant::now();
            match self.step(step, Some(&reached)) {
                Ok(next) => {
                    let coarser = std::mem::replace(&mut reached, next);
                    reached.coarser = Some(coarser.apart);
                }
                Err(Error::Interrupted) => return Err(Error::Interrupted),
                Err(why) => return Ok((reached, Some(why))),
            }
            let predicted = GROWTH * start.elapsed().as_secs_f64();
            if let (Some(left), Some(limit)) =
                (self.monitor.seconds_left(), self.monitor.time_limit())
                && predicted > left
                && !self.is_good_enough(&reached, 1.0)
            {
                return Ok((reached, Some(Error::TimeLimit(limit))));
            }
        }
        Ok((reached, None))
    }

    /// Whether errors are below what is left to the solution, times `slack`.
    fn is_good_enough(&self, reached: &Reached, slack: f64) -> bool {
        let wanted = self.options.tolerance;
        let best = reached.tolerance <= wanted || reached.estimate.mean == DVec3::ZERO;
        best && reached.estimate.rms <= slack * share::SOLUTION * wanted
    }

    /// One mesh more, finer than that of `before`.
    fn step(&self, step: u32, before: Option<&Reached>) -> Result<Reached> {
        let mean = self.brightness(before);
        // The first meshes are far off: what is much better than they are would be wasted on them.
        let expected = before.map_or(f64::INFINITY, |b| b.estimate.rms);
        let tolerance = self.options.tolerance.max((WORTH * expected).min(COARSEST_TOLERANCE));
        let unit = tolerance * mean.max_element();
        let max_memory = self.options.max_memory;
        let operator = share::OPERATOR * (self.lost / share::LOST).min(1.0);
        let options = ApartOptions {
            fineness: Fineness {
                deviation: share::DIRECT * unit,
                ambient: 0.5 * mean.max_element(),
                allowed: share::EMITTER * unit,
                max_memory,
            },
            fast: FastOptions::new((operator * tolerance).clamp(1e-10, 1e-2), None, None)?,
            solve: SolveOptions {
                residual: (share::RESIDUAL * tolerance).clamp(LEAST_RESIDUAL, 1e-3),
                ..SolveOptions::default()
            },
            mean,
            max_memory,
            sweep: match before {
                Some(before) if self.options.way == Way::Iterated => {
                    self.is_good_enough(before, SWEEP_GAINS).then_some(share::GATHER * unit)
                }
                _ => None,
            },
        };
        let mesh = match before {
            Some(Reached { apart, coarser: Some(coarser), .. })
                if self.options.way == Way::Adaptive =>
            {
                apart.refined_where_it_differs(coarser)?
            }
            _ => self.even_mesh(step, before)?,
        };
        let coarser = before.map(|b| &b.apart);
        let apart = Apart::new(
            self.scene,
            mesh,
            self.occluders,
            self.emitters,
            coarser,
            &options,
            self.monitor,
        )?;
        self.look(step, apart, before, tolerance)
    }

    /// The mesh of a step: elements as even as can be, but for roots whose light varies.
    fn even_mesh(&self, step: u32, before: Option<&Reached>) -> Result<Mesh> {
        // One level more everywhere would be just as many.
        let even = Refinement::Elements(self.base.elements() << (2 * step));
        let mesh = self.base.refined_to(even)?;
        let Some(before) = before else { return Ok(mesh) };
        let unit = self.options.tolerance * self.brightness(Some(before)).max_element();
        let levels: Vec<u32> = (0..mesh.roots.len())
            .map(|root| {
                let varies = before.apart.variation(root) > VARIED * unit;
                mesh.roots[root].level.max(self.base.roots[root].level + u32::from(varies))
            })
            .collect();
        mesh.with_levels(&levels)
    }

    /// Gathers at the samples and estimates the error.
    fn look(
        &self,
        step: u32,
        apart: Apart,
        before: Option<&Reached>,
        tolerance: f64,
    ) -> Result<Reached> {
        let samples = &self.samples;
        let stage = apart.stage(self.occluders);
        let unit = tolerance * self.brightness(before).max_element();
        let found = gathered(stage, &apart.reflected, samples, share::GATHER * unit, self.monitor)?;
        let total = found.iter().zip(&self.direct).map(|(w, d)| *w + *d);
        let mean: DVec3 = total.zip(samples).map(|(h, s)| s.weight * h).sum();
        if !mean.is_finite() {
            return Err(Error::Runtime(
                "the irradiance is not finite: the emission is too large (--light-scale)".into(),
            ));
        }
        let allowed = share::GATHER * tolerance * mean.max_element();
        let off_by = |a: &[DVec3], b: &[DVec3]| -> Vec<DVec3> {
            a.iter().zip(b).map(|(a, b)| relative((*a - *b).abs(), mean)).collect()
        };
        let some: Vec<Sample> = samples.iter().step_by(GATHERED_AGAIN).copied().collect();
        // The first solution has no estimate: what gathering is off by does not matter.
        let gathering = match before {
            Some(_) => {
                let once: Vec<DVec3> = found.iter().step_by(GATHERED_AGAIN).copied().collect();
                let finer = 0.1 * allowed;
                off_by(&once, &gathered(stage, &apart.reflected, &some, finer, self.monitor)?)
            }
            None => vec![DVec3::ZERO; some.len()],
        };
        let direct: Vec<DVec3> = self.direct_off.iter().map(|x| relative(*x, mean)).collect();
        let mut changes = before.map_or(vec![], |b| b.changes.clone());
        let local = match before {
            Some(before) => off_by(&found, &before.at_samples),
            None => vec![DVec3::splat(f64::INFINITY); samples.len()],
        };
        let change = rms(&local, samples);
        if before.is_some() {
            changes.push(change);
        }
        // With one change alone, it is known where errors fall slowly.
        let of_change = match &changes[..] {
            [change] if *change > 0.0 => {
                let share = |s: &Sample| if s.at_rim { FIRST_AT_RIM } else { FIRST };
                let errors: Vec<DVec3> =
                    local.iter().zip(samples).map(|(x, s)| share(s) * *x).collect();
                rms(&errors, samples) / change
            }
            changes => of_change(changes, before.is_some_and(|b| b.tolerance > tolerance)),
        };
        // A spot of light may lie between all nodes of the first meshes.
        let dark_for_good = !self.arrives || step >= DARK_FOR_GOOD;
        let (error, most) = match mean == DVec3::ZERO {
            true if dark_for_good => (0.0, 0.0),
            true => (f64::INFINITY, f64::INFINITY),
            false => (
                (of_change * change).hypot(rms(&gathering, &some)).hypot(rms(&direct, &some)),
                BETWEEN * (largest(&local) + largest(&gathering) + largest(&direct)),
            ),
        };
        let estimate = Estimate { rms: error, maximum: most, mean, of_change, steps: step + 1 };
        let coarser = None;
        Ok(Reached { apart, coarser, at_samples: found, changes, estimate, tolerance, allowed })
    }

    /// The mean irradiance as far as it is known, W/m^2.
    fn brightness(&self, reached: Option<&Reached>) -> DVec3 {
        let mean = match reached {
            Some(reached) => reached.estimate.mean,
            None => self.direct.iter().zip(&self.samples).map(|(h, s)| s.weight * *h).sum(),
        };
        if mean == DVec3::ZERO { self.emission } else { mean }
    }
}

/// Mean reflectance over the surface, of the channels the largest.
fn mean_reflectance(scene: &Scene, mesh: &Mesh) -> f64 {
    let (reflectance, _) = mesh::appearance(scene, mesh);
    let nodes = mesh.basis.nodes();
    let weigh = |(node, rho): (usize, &DVec3)| mesh.area(node / nodes) / nodes as f64 * *rho;
    let sum: DVec3 = reflectance.iter().enumerate().map(weigh).sum();
    (sum / surface_area(mesh)).max_element()
}

pub(super) fn why_not(why: Option<Error>) -> String {
    match why {
        Some(Error::TimeLimit(seconds)) => {
            format!("the time limit of {seconds} s would run out (--time-limit)")
        }
        // Elements and operator follow from the tolerance: their own remedies do not help.
        Some(Error::Memory { what, needed, allowed, .. }) => {
            let mebibytes = |bytes: u64| bytes as f64 / f64::from(1 << 20);
            format!(
                "{what} would need about {:.1} MiB of memory, but only {:.1} MiB may be used \
                 (--max-memory)",
                mebibytes(needed),
                mebibytes(allowed)
            )
        }
        Some(Error::Usage(_)) => "there would be too many elements".into(),
        Some(why) => why.to_string(),
        None => "elements cannot be made smaller".into(),
    }
}

/// Scenes of very many faces: memory is forecast before anything long is begun.
fn refuse_too_large(stage: Stage, options: &WithinOptions) -> Result<()> {
    if stage.mesh.roots.len() <= FORECAST_FROM {
        return Ok(());
    }
    let bytes = Operator::forecast(stage, OperatorKind::Fast(FastOptions::new(1e-2, None, None)?));
    if bytes <= options.max_memory {
        return Ok(());
    }
    Err(Error::Memory {
        what: format!("the operator of {} elements", stage.mesh.elements()),
        needed: bytes,
        allowed: options.max_memory,
        remedy: "choose a scene of fewer faces, or raise --max-memory".into(),
    })
}

pub(super) fn relative(off: DVec3, mean: DVec3) -> DVec3 {
    DVec3::select(mean.cmpgt(DVec3::ZERO), off / mean, DVec3::ZERO)
}

/// Of the channels the largest root mean square.
pub(super) fn rms(off: &[DVec3], at: &[Sample]) -> f64 {
    let sum: DVec3 = off.iter().zip(at).map(|(x, s)| s.weight * *x * *x).sum();
    let weights: f64 = off.iter().zip(at).map(|(_, s)| s.weight).sum();
    if weights > 0.0 { (sum / weights).max_element().sqrt() } else { 0.0 }
}

pub(super) fn largest(off: &[DVec3]) -> f64 {
    off.iter().map(|x| x.max_element()).fold(0.0, f64::max)
}

/// Emitted power over area: the mean irradiance of a closed black scene.
pub(super) fn mean_emission(mesh: &Mesh, emitters: &Radiant) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for (root, fit) in mesh.roots.iter().zip(&emitters.field.fits) {
        let mean = fit.iter().map(|v| DVec3::from_array(*v)).sum::<DVec3>() / 3.0;
        sum += triangle_area(&root.corners) * mean;
    }
    let area = surface_area(mesh);
    if area > 0.0 { sum / area } else { DVec3::ZERO }
}

fn gathered(
    stage: Stage,
    radiant: &Radiant,
    samples: &[Sample],
    allowed: f64,
    monitor: &Monitor,
) -> Result<Vec<DVec3>> {
    samples
        .par_iter()
        .map_init(Walker::default, |walker, sample| {
            monitor.check()?;
            Ok(radiant.gather(walker, stage, sample.point, sample.normal, allowed))
        })
        .collect()
}
