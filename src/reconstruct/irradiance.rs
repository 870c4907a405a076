//! Irradiance at many points at once.

use glam::{DVec2, DVec3};

use super::fill::{FillCounts, Region, RootPoints, fill};
use super::sheets::Sheets;
use crate::error::Result;
use crate::monitor::Monitor;
use crate::operator::beam::{Beam, Patch};
use crate::operator::gather::Radiant;
use crate::operator::hemisphere::flips;
use crate::operator::lamps::Place;
use crate::operator::ray_gather::{Enough, Estimated, Sources};
use crate::solve::{ApartSource, Light, RaySource, Reflected};

/// Where light is filled in, what is checked may be off by this much, in units of what the solution left
/// of the tolerance, times the mean irradiance. What is filled in is better: over the shipped scenes by
/// 0.3 to 0.5 units (root mean square, while `fill::DIFFER` was 0.35 to 0.6: it is 0.3 now). By rays, in
/// a kitchen at 1 %, 800 pixels were off by 0.56, 0.64 and 0.72 % with 2, 3 and 4.
const CHECKED: f64 = 3.0;

/// Of the tolerance so much is left in any case: where the solution could not be made better.
const LEAST_LEFT: f64 = 0.39;

/// Where something stands between an emitter and some of the points, at most so many of them are
/// filled in at once: the shadow of something thin could lie between the nodes.
const SHADED: usize = 32;

/// By rays nothing tells what stands around: at most so many points are filled in at once.
const AT_ONCE: usize = 512;

/// Of the error that points of a picture may have, what rays make: filling in makes the rest. In this many
/// looks it is found how many rays that takes.
const OF_RAYS: f64 = 0.92;
const LOOKS: usize = 2;

/// From one look to the next the spread is allowed to grow so many times at most.
const MOST_GROWTH: f64 = 4.0;

/// What was done for direct and for indirect light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct IrradianceCounts {
    /// Emitted light that arrives straight away; all light, where a solution does not tell it apart, or
    /// where rays find both at once.
    pub direct: FillCounts,
    /// Reflected light.
    pub indirect: FillCounts,
}

impl std::ops::AddAssign for IrradianceCounts {
    fn add_assign(&mut self, other: IrradianceCounts) {
        self.direct += other.direct;
        self.indirect += other.indirect;
    }
}

impl IrradianceCounts {
    /// Root mean square error over the points that filling in is expected to have made, relative to
    /// the `mean` irradiance; of the channels the largest.
    pub fn error(&self, mean: DVec3) -> f64 {
        let squares = (self.direct.squares + self.indirect.squares)
            / self.direct.points.max(self.indirect.points).max(1) as f64;
        let relative = DVec3::select(mean.cmpgt(DVec3::ZERO), squares / (mean * mean), squares);
        relative.max_element().sqrt()
    }

    /// The largest error that filling in is expected to have made, relative likewise.
    pub fn largest_error(&self, mean: DVec3) -> f64 {
        let least = mean.to_array().into_iter().filter(|&m| m > 0.0).fold(f64::INFINITY, f64::min);
        (self.direct.largest + self.indirect.largest) / least
    }
}

/// Irradiance (W/m^2) at points of roots, in the order given; the normals are those of the faces.
///
/// Light that was made to a tolerance ([`crate::solve::light_within`]) is gathered where it has to
/// be, and filled in where it is smooth; other light is gathered at every point.
pub fn irradiances(
    light: &Light,
    asked: &[RootPoints],
    monitor: &Monitor,
) -> Result<(Vec<Vec<DVec3>>, IrradianceCounts)> {
    irradiances_shown(light, asked, &Shown::default(), monitor)
}

/// What is known of the points of a picture, where light is gathered by rays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shown {
    /// What was seen of them.
    pub look: Look,
    /// Errors of rays, and of filling in between points, may be so many times as large by root, as
    /// they are asked for (1 where there is nothing): where little of what is off will be seen.
    pub slack: Vec<f64>,
}

/// What some points tell of all that a picture shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// How many times as bright as the mean of the surface they are, at least once: errors may be as
    /// many times as large.
    pub brighter: f64,
    /// How far off points may be, W/m^2, for all errors together to be what they may: by the square root
    /// of the number of rays ([`Enough::per_root`]); nothing where they are points of the surface as any.
    pub per_root: Option<f64>,
}

impl Default for Look {
    fn default() -> Look {
        Look { brighter: 1.0, per_root: None }
    }
}

/// [`irradiances`] for points that are `shown`. Errors are counted over the slack of their roots.
pub fn irradiances_shown(
    light: &Light,
    asked: &[RootPoints],
    shown: &Shown,
    monitor: &Monitor,
) -> Result<(Vec<Vec<DVec3>>, IrradianceCounts)> {
    if let Some(by_rays) = ByRays::of(light) {
        let (values, direct) = by_rays.shown(shown).gather(light, asked, |e| e, monitor)?;
        return Ok((values, IrradianceCounts { direct, ..IrradianceCounts::default() }));
    }
    let (mut values, direct) = irradiances_of(light, Part::Direct, asked, monitor)?;
    if light.apart().is_none() {
        return Ok((values, IrradianceCounts { direct, ..IrradianceCounts::default() }));
    }
    let (reflected, indirect) = irradiances_of(light, Part::Indirect, asked, monitor)?;
    for (sum, more) in values.iter_mut().flatten().zip(reflected.into_iter().flatten()) {
        *sum += more;
    }
    Ok((values, IrradianceCounts { direct, indirect }))
}

/// A part of the irradiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// What emitters send straight away; all light, where a solution does not tell it apart.
    Direct,
    /// What surfaces reflect; nothing, where a solution does not tell it apart.
    Indirect,
}

/// One part of what [`irradiances`] finds.
pub fn irradiances_of(
    light: &Light,
    part: Part,
    asked: &[RootPoints],
    monitor: &Monitor,
) -> Result<(Vec<Vec<DVec3>>, FillCounts)> {
    let Some(source) = light.apart() else {
        if part == Part::Indirect {
            let zeros = asked.iter().map(|own| vec![DVec3::ZERO; own.points.len()]).collect();
            return Ok((zeros, FillCounts::default()));
        }
        let place = |root: u32, x: DVec2| {
            let frame = light.mesh.root_frame(root);
            (frame.lift(x), frame.n)
        };
        return fill(
            &regions(light, asked),
            (0.0, false),
            |_, _, _| (),
            |walker, (), (root, _), x| {
                let (point, normal) = place(root, x);
                Estimated::exactly(light.irradiance(walker, point, normal))
            },
            |()| usize::MAX,
            monitor,
        );
    };
    let checked = checked(source);
    match part {
        Part::Direct => {
            if let Some(mut by_rays) = ByRays::of(light) {
                by_rays.sources.reflected = None;
                return by_rays.gather(light, asked, |e| e, monitor);
            }
            let how = (source.allowed_direct, checked, SHADED);
            from_radiant(light, &source.emitters, how, asked, monitor)
        }
        Part::Indirect => from_reflected(light, source, &source.reflected, asked, monitor),
    }
}

/// What reflected light changed by from the next coarser solution to this one, at points of roots:
/// what the error is estimated from. Nothing where there was no coarser one.
pub fn changes(light: &Light, asked: &[RootPoints], monitor: &Monitor) -> Result<Vec<Vec<DVec3>>> {
    let zero = || asked.iter().map(|own| vec![DVec3::ZERO; own.points.len()]).collect();
    let Some(source) = light.apart() else { return Ok(zero()) };
    let Some(coarser) = &source.coarser else { return Ok(zero()) };
    if let (Some(mut by_rays), Reflected::Rays(before)) = (ByRays::of(light), coarser) {
        (by_rays.sources.before, by_rays.sources.emitted) = (Some(before.as_ref()), None);
        let change = |found: Estimated| Estimated::exactly(found.change.abs());
        return Ok(by_rays.gather(light, asked, change, monitor)?.0);
    }
    let from = |reflected| from_reflected(light, source, reflected, asked, monitor).map(|(v, _)| v);
    let (mut values, before) = (from(&source.reflected)?, from(coarser)?);
    for (value, before) in values.iter_mut().flatten().zip(before.into_iter().flatten()) {
        *value = (*value - before).abs();
    }
    Ok(values)
}

fn checked(source: &ApartSource) -> f64 {
    let (wanted, made) = (source.tolerance, source.estimate.rms);
    let left = (wanted * wanted - made * made).max(0.0).sqrt().max(LEAST_LEFT * wanted);
    CHECKED * left * source.estimate.mean.max_element()
}

fn regions(light: &Light, asked: &[RootPoints]) -> Vec<Region> {
    asked.iter().map(|own| own.region(&light.mesh)).collect()
}

fn from_reflected(
    light: &Light,
    source: &ApartSource,
    reflected: &Reflected,
    asked: &[RootPoints],
    monitor: &Monitor,
) -> Result<(Vec<Vec<DVec3>>, FillCounts)> {
    match (reflected, ByRays::of(light)) {
        (Reflected::Cells(radiant), _) => {
            let how = (source.allowed, checked(source), usize::MAX);
            from_radiant(light, radiant, how, asked, monitor)
        }
        (Reflected::Rays(_), Some(mut by_rays)) => {
            by_rays.sources.emitted = None;
            by_rays.gather(light, asked, |e| e, monitor)
        }
        (Reflected::Rays(_), None) => {
            let zeros = asked.iter().map(|own| vec![DVec3::ZERO; own.points.len()]).collect();
            Ok((zeros, FillCounts::default()))
        }
    }
}

/// How light that was solved for with rays is gathered.
struct ByRays<'a> {
    source: &'a ApartSource,
    rays: &'a RaySource,
    sources: Sources<'a>,
    /// How far off a point may be, and what is checked where values are filled in, W/m^2.
    enough: Enough,
    checked: f64,
    /// So many times as far by root, as they are asked for.
    slack: &'a [f64],
}

impl<'a> ByRays<'a> {
    fn of(light: &'a Light) -> Option<ByRays<'a>> {
        let source = light.apart()?;
        let (Reflected::Rays(radiant), Some(rays)) = (&source.reflected, &source.rays) else {
            return None;
        };
        let sources =
            Sources { emitted: Some(&rays.lamps), ..Sources::reflected(radiant, &rays.lamps) };
        let (enough, checked) = (Enough::by_root(rays.per_root), CHECKED * rays.allowed);
        Some(ByRays { source, rays, sources, enough, checked, slack: &[] })
    }

    fn shown(mut self, shown: &'a Shown) -> ByRays<'a> {
        let Look { brighter, per_root } = shown.look;
        self.enough = per_root.map_or(self.enough, Enough::by_root);
        self.checked *= brighter;
        self.slack = &shown.slack;
        self
    }

    /// What there is `of` what is found at some points.
    fn gather(
        &self,
        light: &Light,
        asked: &[RootPoints],
        of: impl Fn(Estimated) -> Estimated + Sync,
        monitor: &Monitor,
    ) -> Result<(Vec<Vec<DVec3>>, FillCounts)> {
        let stage = light.stage();
        let emitters = (&self.source.emitters, self.source.allowed_direct);
        let sheets = Sheets::new(&light.mesh, asked, |own| self.slack.get(own).map_or(1.0, |s| *s));
        let (values, counts) = fill(
            &sheets.regions,
            (self.checked, true),
            |_, _, _| (),
            |walker, (), (root, slack), x| {
                let frame = light.mesh.root_frame(root);
                let flips = flips(frame.lift(DVec2::ZERO));
                let place = Place { point: frame.lift(x), normal: frame.n, flips };
                let enough = self.enough.times(slack);
                of(self.rays.gather(&self.sources, emitters, walker, stage, place, enough))
            },
            |()| AT_ONCE,
            monitor,
        )?;
        Ok((sheets.in_order(asked, values), counts))
    }

    /// Of squares of errors those of the channel in which they are largest relative to its mean, as if that
    /// were the largest of the means.
    fn largest(&self, squares: DVec3) -> f64 {
        let mean = self.source.estimate.mean;
        let relative = DVec3::select(mean.cmpgt(DVec3::ZERO), squares / (mean * mean), DVec3::ZERO);
        relative.max_element() * mean.max_element().powi(2)
    }
}

/// Looks at some points of a picture, where light is gathered by rays: from as few rays as say how bright
/// they are, then from as many as make all errors together what they may be. `weights` are in the order
/// of the points; `slack` as in [`Shown`].
pub fn look(
    light: &Light,
    asked: &[RootPoints],
    weights: &[f64],
    slack: &[f64],
    monitor: &Monitor,
) -> Result<Look> {
    let Some(by_rays) = ByRays::of(light) else { return Ok(Look::default()) };
    let mean = by_rays.source.estimate.mean.max_element();
    // Every point by itself.
    let mut few = ByRays { enough: Enough::of(f64::INFINITY), checked: 0.0, slack, ..by_rays };
    let (values, _) = few.gather(light, asked, |e| e, monitor)?;
    let all: DVec3 = values.iter().flatten().zip(weights).map(|(v, w)| *w * *v).sum();
    let all = all.max_element() / weights.iter().sum::<f64>();
    let brighter = if all > mean { all / mean } else { 1.0 };
    let wanted = OF_RAYS * brighter * few.rays.allowed;
    let mut per_root = wanted / f64::from(few.rays.counts.least).sqrt();
    for _ in 0..LOOKS {
        few.enough = Enough::by_root(per_root);
        let (_, counts) = few.gather(light, asked, |e| e, monitor)?;
        let found = (few.largest(counts.squares) / counts.points.max(1) as f64).sqrt();
        // Squares of spreads are in proportion to it.
        per_root *= (wanted / found).min(MOST_GROWTH).powi(2);
    }
    Ok(Look { brighter, per_root: Some(per_root) })
}

fn from_radiant(
    light: &Light,
    radiant: &Radiant,
    (allowed, checked, shaded): (f64, f64, usize),
    asked: &[RootPoints],
    monitor: &Monitor,
) -> Result<(Vec<Vec<DVec3>>, FillCounts)> {
    let stage = light.stage();
    let frame = |root: u32| light.mesh.root_frame(root);
    fill(
        &regions(light, asked),
        (checked, false),
        |root, corners, around: Option<&Beam>| {
            let frame = frame(root);
            let patch = Patch::new(corners.map(|x| frame.lift(x)), frame.n);
            match around {
                Some(beam) => beam.narrowed(radiant, stage, &patch, allowed),
                None => Beam::new(radiant, stage, &patch, allowed),
            }
        },
        |walker, beam, (root, _), x| {
            let frame = frame(root);
            let point = frame.lift(x);
            Estimated::exactly(beam.gather(radiant, walker, stage, point, frame.n, allowed))
        },
        |beam| if beam.is_clear() { usize::MAX } else { shaded },
        monitor,
    )
}
