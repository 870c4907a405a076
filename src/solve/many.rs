//! Light of scenes of many small faces, to a tolerance.
//!
//! Emitted light is gathered exactly, or by rays where few of them tell enough. What is reflected
//! is the radiosity of patches ([`crate::operator::patches`]), and irradiance from it a mean over
//! bundles of rays ([`crate::operator::bundles`]): each face of such a scene fills little of any
//! hemisphere. The error of the solution is known from what changes when patches are made smaller, and light
//! is gathered at other points of them. What bundles to the points that are asked for are off by comes to
//! that: it is known from parts of them, and takes what is left of the tolerance.

use glam::DVec3;
use rayon::prelude::*;

use super::direct::emission;
use super::light::{ApartSource, Light, RaySource, Reflected, Source};
use super::samples::{Sample, samples};
use super::within::{Estimate, largest, mean_emission, relative, rms, share, why_not};
use super::{LEAST_RESIDUAL, Solution, SolveOptions, WithinOptions, gmres};
use crate::cluster::Clusters;
use crate::error::{Error, Result};
use crate::mesh::{self, Mesh};
use crate::monitor::Monitor;
use crate::operator::bundles::{RayScene, Rows};
use crate::operator::lamps::{Lamps, Place, Samples};
use crate::operator::patches::{PatchSizes, Patches};
use crate::operator::ray_gather::{Enough, Estimated, RayCounts, RayRadiant, Sources};
use crate::operator::walk::{Stage, Walker};
use crate::scene::Scene;
use crate::visibility::Occluders;

/// From so many roots on bundles of rays are better than exact visibility, at a tolerance of 1 %.
const MANY_AT_ONE_PERCENT: f64 = 1500.0;

/// How the time for a bundle grows with one over the tolerance: errors fall like n^(-3/4).
const GROWTH: f64 = 4.0 / 3.0;

/// Side of the first squares in units of the scene's size, and of cubes in that of squares.
const FIRST_SQUARE: f64 = 1.0 / 14.0;
const CUBE: f64 = 0.25;

/// Smallest squares in units of the first.
const SMALLEST: f64 = 1.0 / 64.0;

/// Share of the squared differences within patches that is left unsplit.
const LEFT: f64 = 0.25;

/// At a tolerance of 1 %: rays from a spot into the hemisphere, and to what emits.
const RAYS_OF_SPOT: f64 = 128.0;
const POINTS_OF_LAMPS: f64 = 64.0;

/// Rays that are cast first for a gathered point, and how many times as many at most.
const FIRST_RAYS: f64 = 512.0;
const MORE_RAYS: u32 = 512;

/// Of the tolerance, what rays make the samples be off by, root mean square. It is no part of the error
/// of the solution: changes are looked at along the same rays. That is why some may be off by more, where it
/// would take more than so many times the first rays.
const AT_SAMPLES: f64 = 0.5;
const MORE_AT_SAMPLES: u32 = 32;

/// Of the tolerance, the estimated error of the solution: rays to the points that are asked for need the
/// rest.
const SOLUTION: f64 = 0.85;

/// Patches are split so many times by what a share of these rays tells, before errors are looked at.
const PREPARED: u32 = 5;
const COARSE: f64 = 0.25;

/// The error over the change: what is left once all that differs by chance is gone from the second
/// solution (0.7), what is not halved by patches of half the size, and what was not split has not
/// changed.
const OF_CHANGE: f64 = 1.5;

/// Most steps of the ladder.
const MOST_STEPS: u32 = 7;

/// Where there was little to split, cells being no more than so many times as many, and yet more than this
/// share of the estimated error is left, most of it is chance: then rows get twice the rays.
const LITTLE: f64 = 1.1;
const CHANCE: f64 = 0.8;

/// Whether bundles of rays are the better way for so many roots.
pub fn is_many(roots: usize, tolerance: f64) -> bool {
    roots as f64 > MANY_AT_ONE_PERCENT * (0.01 / tolerance).powf(GROWTH).max(1.0)
}

/// Bytes that the rows of the last solution take, about: from the patches of the first, without a ray.
///
/// # Errors
///
/// Those of [`Patches::build`].
pub fn forecast(scene: &Scene, base: &Mesh, tolerance: f64) -> Result<u64> {
    let square = FIRST_SQUARE * base.bounds.extent();
    let sizes = PatchSizes { square, cube: CUBE * square };
    let cells = Patches::build(scene, base, &sizes)?.count_of_cells() as f64;
    let rays = f64::from(rays(RAYS_OF_SPOT, tolerance));
    let row = ENTRY_BYTES * OF_RAYS * rays + ROW_BYTES;
    let last = (MORE_CELLS * cells + ANY_CELLS).min(MOST_CELLS * cells);
    Ok((last * row) as u64)
}

/// How many cells the last patches have: for each of the first, and in any scene, for splitting goes where
/// light varies, not where faces are; but at most so many times the first. And what share of a cell's
/// rays meet a cell of their own. At 1 %, over what it takes: arcades of 5,000, 50,000 and 250,000
/// triangles 0.8, 0.7 and 0.9, a kitchen of 62,000 1.5.
const MORE_CELLS: f64 = 1.6;
const ANY_CELLS: f64 = 157_000.0;
const MOST_CELLS: f64 = 12.0;
const OF_RAYS: f64 = 0.57;

/// Bytes of a row, and of each cell that it has.
const ROW_BYTES: f64 = 16.0;
const ENTRY_BYTES: f64 = 8.0;

fn rays(at_one_percent: f64, tolerance: f64) -> u32 {
    let wanted = at_one_percent * (0.01 / tolerance).powf(GROWTH);
    (wanted.clamp(16.0, 65_536.0) as u32).next_power_of_two()
}

/// What was found with patches of one size.
struct Step {
    radiant: RayRadiant,
    irradiance: Vec<DVec3>,
    varies: Vec<bool>,
    entries: usize,
    bytes: usize,
    row_sums: (f64, f64),
    iterations: usize,
    residual: DVec3,
}

/// Solves for the light of a scene of many faces; `base` is its coarsest mesh.
pub fn light_of_many(
    scene: &Scene,
    base: Mesh,
    occluders: Occluders,
    options: &WithinOptions,
    monitor: &Monitor,
) -> Result<Light> {
    let clusters = Clusters::build(&base);
    let stage = Stage { mesh: &base, clusters: &clusters, occluders: &occluders };
    let max_memory = options.max_memory;
    let whole = emission(scene, stage, f64::INFINITY, max_memory, monitor)?;
    let emitted = mean_emission(&base, &whole);
    let unit = options.tolerance * emitted.max_element();
    let emitters = emission(scene, stage, share::DIRECT * unit, max_memory, monitor)?;
    let at = samples(&base);
    let mut rays = RaySource {
        scene: RayScene::new(scene, &base),
        lamps: Lamps::new(scene, &base),
        counts: ladder_counts(options.tolerance),
        share: 0.0,
        error: 0.0,
        allowed: 0.0,
        per_root: 0.0,
    };
    let lamps = &rays.lamps;
    let sources = Sources { reflected: None, before: None, emitted: Some(lamps), lamps };
    let direct: Vec<Estimated> = at
        .par_iter()
        .map_init(Walker::default, |walker, s| {
            monitor.check()?;
            let (how, place) = ((&emitters, share::EMITTER * unit), Place::new(s.point, s.normal));
            let enough = Enough::of(share::GATHER * unit);
            Ok(rays.gather(&sources, how, walker, stage, place, enough))
        })
        .collect::<Result<_>>()?;
    let ladder = Ladder {
        scene,
        stage,
        rays: &rays,
        samples: &at,
        direct: &direct,
        emitted,
        options,
        monitor,
    };
    let (reached, why) = ladder.climb()?;
    let Reached { step, coarser, estimate, share: reflected, spread, roughness } = reached;
    (rays.share, rays.error) = (reflected, spread);
    let met = estimate.rms <= options.tolerance;
    let out_of_time = matches!(why, Some(Error::TimeLimit(_)));
    let unit = options.tolerance * estimate.mean.max_element();
    let allowed = share::GATHER * unit;
    let solved = (estimate.rms / options.tolerance).min(1.0);
    rays.allowed = ((1.0 - solved * solved).sqrt() * unit).max(allowed);
    let both = roughness.iter().zip(&direct).map(|(own, direct)| own.hypot(direct.roughness()));
    let rough: f64 = both.zip(&at).map(|(s, at)| at.weight * s).sum();
    rays.per_root = per_root(rays.allowed, rough);
    let (reflectance, exitance) = mesh::appearance(scene, &base);
    let irradiance: Vec<DVec3> = (0..base.nodes())
        .map(|node| {
            let element = node / base.basis.nodes();
            let face = base.roots[base.element_root[element] as usize].face;
            let x = base.faces[face as usize].frame.project(base.node(node).0);
            step.irradiance[step.radiant.patches.at(face, x)]
        })
        .collect();
    let nodes = exitance.iter().zip(&reflectance).zip(&irradiance);
    let radiosity = nodes.map(|((e, rho), h)| *e + *rho * *h).collect();
    let solution = Solution {
        radiosity,
        irradiance,
        residual: step.residual,
        iterations: step.iterations,
        channels: 3,
    };
    let counts = vec![("patches", step.radiant.patches.len() as u64)];
    let source = ApartSource {
        emitters,
        reflected: Reflected::Rays(Box::new(step.radiant)),
        coarser: coarser.map(|coarser| Reflected::Rays(Box::new(coarser))),
        rays: Some(rays),
        allowed,
        allowed_direct: share::EMITTER * unit,
        estimate,
        tolerance: options.tolerance,
        shortfall: if met { None } else { Some(why_not(why)) },
        out_of_time,
    };
    Ok(Light {
        source: Source::Apart(Box::new(source)),
        mesh: base,
        clusters,
        occluders,
        reflectance,
        exitance,
        solution,
        forecast: None,
        entries: step.entries,
        bytes: step.bytes,
        counts,
        seconds: vec![],
        row_sums: step.row_sums,
    })
}

fn ladder_counts(tolerance: f64) -> RayCounts {
    let least = rays(FIRST_RAYS, tolerance);
    RayCounts { least, most: (least * MORE_RAYS).min(1 << 22) }
}

struct Ladder<'a> {
    scene: &'a Scene,
    stage: Stage<'a>,
    rays: &'a RaySource,
    samples: &'a [Sample],
    direct: &'a [Estimated],
    emitted: DVec3,
    options: &'a WithinOptions,
    monitor: &'a Monitor<'a>,
}

/// The best so far.
struct Reached {
    step: Step,
    coarser: Option<RayRadiant>,
    estimate: Estimate,
    /// Of reflected light in the mean irradiance, of the channels the largest.
    share: f64,
    /// What rays are off by at the samples.
    spread: f64,
    /// How rough reflected light is at each of them, W/m^2 ([`Estimated::roughness`]).
    roughness: Vec<f64>,
}

impl Reached {
    /// Whether more rays from each cell are needed rather than more cells, as far as the step `before`
    /// tells.
    fn is_left_to_chance(&self, before: &Reached) -> bool {
        let cells = |reached: &Reached| reached.step.irradiance.len() as f64;
        let little = cells(self) <= LITTLE * cells(before);
        little && self.estimate.rms > CHANCE * before.estimate.rms
    }
}

/// What points may be off by, by the square root of the number of their rays, for a root mean square of
/// `target`: with s/sqrt(n) from n rays it is sqrt(per_root s) where n is what that asks for. `rough` is the
/// mean of s.
fn per_root(target: f64, rough: f64) -> f64 {
    if rough > 0.0 { target * target / rough } else { f64::INFINITY }
}

impl Ladder<'_> {
    /// Makes patches smaller until the tolerance is met, or until something else ends it.
    fn climb(&self) -> Result<(Reached, Option<Error>)> {
        let mut first = self.step(None, COARSE)?;
        for _ in 1..PREPARED {
            first = self.step(Some(&first), COARSE)?;
        }
        let mut reached = self.look((0, 1.0), Some(&first), None)?;
        let mut share_of_rays = 1.0;
        for number in 1..MOST_STEPS {
            match self.look((number, share_of_rays), Some(&reached.step), Some(&reached)) {
                Ok(next) => {
                    if next.is_left_to_chance(&reached) {
                        share_of_rays *= 2.0;
                    }
                    let before = std::mem::replace(&mut reached, next);
                    reached.coarser = Some(before.step.radiant);
                }
                Err(Error::Interrupted) => return Err(Error::Interrupted),
                Err(why) => return Ok((reached, Some(why))),
            }
            if reached.estimate.rms <= SOLUTION * self.options.tolerance {
                return Ok((reached, None));
            }
        }
        Ok((reached, None))
    }

    /// Solves with patches of one size, looks at the samples and estimates the error.
    fn look(
        &self,
        (number, share_of_rays): (u32, f64),
        coarser: Option<&Step>,
        before: Option<&Reached>,
    ) -> Result<Reached> {
        let step = self.step(coarser, share_of_rays)?;
        let tolerance = self.options.tolerance;
        let mean = match before {
            Some(before) => before.estimate.mean,
            None => self.emitted,
        };
        // Errors count by the weights of samples; the first look tells but how rough light is.
        let enough: Vec<Enough> = match before {
            Some(Reached { roughness, .. }) => {
                let rough = |(s, r): (&Sample, &f64)| s.weight.sqrt() * r;
                let all: f64 = self.samples.iter().zip(roughness).map(rough).sum();
                let per_root = per_root(AT_SAMPLES * tolerance * mean.max_element(), all);
                let each = |s: &Sample| Enough::by_root(per_root / s.weight.sqrt());
                self.samples.iter().map(each).collect()
            }
            None => vec![Enough::of(f64::INFINITY); self.samples.len()],
        };
        let mesh = self.stage.mesh;
        let sources = Sources {
            before: before.map(|b| &b.step.radiant),
            ..Sources::reflected(&step.radiant, &self.rays.lamps)
        };
        let least = self.rays.counts.least;
        let counts = RayCounts { least, most: least * MORE_AT_SAMPLES };
        let found: Vec<Estimated> = self
            .samples
            .par_iter()
            .zip(&enough)
            .map_init(Walker::default, |walker, (s, enough)| {
                self.monitor.check()?;
                let (place, scene) = (Place::new(s.point, s.normal), (&self.rays.scene, mesh));
                Ok(sources.gather(walker, scene, place, *enough, counts))
            })
            .collect::<Result<_>>()?;
        let at_samples: Vec<DVec3> = found.iter().map(|e| e.irradiance).collect();
        let totals = at_samples.iter().zip(self.direct).zip(self.samples);
        let mean: DVec3 = totals.map(|((w, d), s)| s.weight * (*w + d.irradiance)).sum();
        if !mean.is_finite() {
            return Err(Error::Runtime(
                "the irradiance is not finite: the emission is too large (--light-scale)".into(),
            ));
        }
        let spread: Vec<DVec3> = found.iter().map(|e| relative(e.spread, mean)).collect();
        let local: Vec<DVec3> = match before {
            Some(_) => found.iter().map(|e| relative(e.change.abs(), mean)).collect(),
            None => vec![DVec3::INFINITY; at_samples.len()],
        };
        let change = rms(&local, self.samples);
        let off = rms(&spread, self.samples);
        let (error, maximum) = match mean == DVec3::ZERO {
            true => (0.0, 0.0),
            false => (OF_CHANGE * change, 2.0 * (largest(&local) + largest(&spread))),
        };
        let estimate =
            Estimate { rms: error, maximum, mean, of_change: OF_CHANGE, steps: number + 1 };
        let reflected: DVec3 =
            at_samples.iter().zip(self.samples).map(|(w, s)| s.weight * *w).sum();
        let share = relative(reflected, mean).max_element();
        let roughness = found.iter().map(Estimated::roughness).collect();
        Ok(Reached { step, coarser: None, estimate, share, spread: off, roughness })
    }

    /// Solves on patches: the first ones, or those of the solution `before` split where its light
    /// varies.
    fn step(&self, before: Option<&Step>, share_of_rays: f64) -> Result<Step> {
        let mesh = self.stage.mesh;
        let tolerance = self.options.tolerance;
        let square = FIRST_SQUARE * mesh.bounds.extent();
        let mut patches = match before {
            None => {
                let sizes = PatchSizes { square, cube: CUBE * square };
                Patches::build(self.scene, mesh, &sizes)?
            }
            Some(before) => {
                let least = square * SMALLEST;
                before.radiant.patches.split(self.scene, mesh, &before.varies, least)
            }
        };
        let samples = Samples {
            points: rays(share_of_rays * POINTS_OF_LAMPS, tolerance),
            rays: rays(share_of_rays * RAYS_OF_SPOT, tolerance),
        };
        let max_memory = self.options.max_memory;
        let (scene, lamps) = ((&self.rays.scene, self.scene), (&self.rays.lamps, samples));
        let known = before.map(|before| &before.radiant);
        let rows = Rows::cast(scene, mesh, &mut patches, known, lamps, max_memory, self.monitor)?;
        let direct = rows.of_cells(&patches, rows.direct.clone());
        let begin: Vec<[f64; 3]> = times(&direct, &patches.reflectance);
        let apply = |u: &[[f64; 3]], out: &mut [[f64; 3]]| {
            let own = rows.of_cells(&patches, rows.at_cells(u));
            let reflected = own.iter().zip(&patches.reflectance);
            out.par_iter_mut().zip(u).zip(reflected.collect::<Vec<_>>()).for_each(
                |((out, u), (h, rho))| *out = std::array::from_fn(|c| u[c] - rho[c] * h[c]),
            );
        };
        let residual = (share::RESIDUAL * tolerance).clamp(LEAST_RESIDUAL, 1e-3);
        let how = SolveOptions { residual, ..SolveOptions::default() };
        let how = how.relative_to(self.emitted, begin.iter().map(|b| DVec3::from_array(*b)));
        let (u, residual, iterations) = gmres(&apply, &begin, None, &how, self.monitor)?;
        // What is not a number has not converged either.
        if !residual.iter().all(|&r| r <= how.residual) {
            return Err(Error::NotConverged {
                residual: residual.into_iter().fold(0.0, f64::max),
                iterations,
                tolerance: how.residual,
            });
        }
        let mut at_cells = rows.at_cells(&u);
        for (h, d) in at_cells.iter_mut().zip(&rows.direct) {
            (0..3).for_each(|c| h[c] += d[c]);
        }
        let irradiance = rows.of_cells(&patches, at_cells);
        let radiosity = times(&irradiance, &patches.reflectance);
        patches.learn(&irradiance, |cell| rows.is_buried(cell));
        let varies = self.varies(&patches);
        let vectors = |x: Vec<[f64; 3]>| x.into_iter().map(DVec3::from_array).collect();
        Ok(Step {
            radiant: RayRadiant::new((self.scene, mesh), vectors(radiosity), patches),
            irradiance: vectors(irradiance),
            varies,
            entries: rows.entries(),
            bytes: rows.bytes(),
            row_sums: rows.sums(),
            iterations,
            residual: DVec3::from_array(residual),
        })
    }

    /// Which patches radiate so unevenly that they are to be split: those with nearly all of the
    /// squared differences that were found within patches.
    fn varies(&self, patches: &Patches) -> Vec<bool> {
        let squares: Vec<f64> = (0..patches.len())
            .map(|patch| {
                let area: f64 = patches.area[patches.cells(patch)].iter().sum();
                let [least, most] = patches.found[patch];
                area * (0.5 * (most - least).max_element()).max(0.0).powi(2)
            })
            .collect();
        let total: f64 = squares.iter().sum();
        let mut order: Vec<usize> = (0..squares.len()).collect();
        order.sort_by(|&a, &b| squares[a].total_cmp(&squares[b]).then(a.cmp(&b)));
        let mut left = 0.0;
        let mut varies = vec![false; squares.len()];
        for patch in order {
            left += squares[patch];
            varies[patch] = left > LEFT * total;
        }
        varies
    }
}

/// Irradiance times reflectance.
fn times(irradiance: &[[f64; 3]], reflectance: &[DVec3]) -> Vec<[f64; 3]> {
    let product = |(h, rho): (&[f64; 3], &DVec3)| std::array::from_fn(|c| h[c] * rho[c]);
    irradiance.iter().zip(reflectance).map(product).collect()
}
