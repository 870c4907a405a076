//! Whether light comes to parts, to their fronts and to their backs.
//!
//! Light is looked for along paths over sides that reflect, until one comes to what emits; where
//! nothing does, out of the scene. Lamps that nothing sees do not count.

use glam::DVec3;
use rayon::prelude::*;

use super::Surveyed;
use super::emitters::bright;
use super::points::on_parts;
use crate::error::Result;
use crate::monitor::Monitor;

/// Points on each part, and paths from each side of each of them at most.
const POINTS: usize = 32;
const MOST_PATHS: usize = 64;

/// Paths of all together, roughly.
const PATHS: usize = 1 << 18;

/// What fronts and backs of a part get: rays or paths, times what each stands for.
#[derive(Clone, Copy, Default)]
pub(super) struct Sums {
    pub all: f64,
    pub front: f64,
    pub back: f64,
    /// Where the back gets most.
    pub at: DVec3,
    best: f64,
}

impl Sums {
    /// Adds shares of front and back at a place that stands for `weight`.
    pub(super) fn add(&mut self, weight: f64, front: f64, back: f64, at: DVec3) {
        self.all += weight;
        self.front += weight * front;
        self.back += weight * back;
        if back > self.best {
            (self.best, self.at) = (back, at);
        }
    }

    /// Whether the back gets more than so many times as much as the front.
    pub(super) fn is_more(&self, times: f64) -> bool {
        self.back > times * self.front
    }
}

/// Whether there is light that a path could come to.
pub(super) fn is_there(survey: &Surveyed) -> bool {
    bright(survey).contains(&true) || survey.looks.iter().any(|look| !look.escaped.is_empty())
}

/// How many paths from each part that is `wanted` come to light: from the fronts of all sides, and
/// with `backs` from fronts and backs of one-sided triangles.
pub(super) fn comes(
    survey: &Surveyed,
    wanted: &[bool],
    backs: bool,
    monitor: &Monitor,
) -> Result<Vec<Sums>> {
    let points = on_parts(survey.scene, survey.parts, wanted, backs, POINTS);
    let paths = (PATHS / (2 * points.len().max(1))).clamp(1, MOST_PATHS) as u32;
    let bright = bright(survey);
    let bright = bright.contains(&true).then_some(&bright[..]);
    let stage = monitor.stage("audit", points.len() as u64);
    let counts: Vec<[usize; 2]> = points
        .par_iter()
        .map_init(Vec::new, |stack, point| {
            stage.advance(1)?;
            let mut lit = |behind| {
                let looker = survey.looker;
                let comes = |k: &u32| looker.comes_to_light(point, behind, *k, bright, stack);
                (0..paths).filter(comes).count()
            };
            Ok([lit(false), if backs { lit(true) } else { 0 }])
        })
        .collect::<Result<_>>()?;
    let mut sums = vec![Sums::default(); wanted.len()];
    for (point, own) in points.iter().zip(counts) {
        let [front, back] = own.map(|count| count as f64 / f64::from(paths));
        sums[point.part as usize].add(f64::from(paths), front, back, point.position);
    }
    Ok(sums)
}
