//! Objects that show their backs to the rest of the scene.
//!
//! Of the rays from the fronts of an object's one-sided faces the share f, and of those from their
//! backs the share b, meets sides of other objects that radiate and are not near
//! ([`super::look::NEAR`]). Where light goes, light comes from: f and b are what the rest of the scene
//! sees of its fronts and of its black backs. It is *suspected* when b is [`LEAST_SEEN`] or more, and
//! more than twice f. Each connected part of an object is judged for itself, against all that is not
//! of it; where that does not decide (six loose sides of a box see each other) the object does. A
//! closed block in a room has b = 0, a room has f > 0 = b, a sheet between two halves of a room f = b.
//! A room that is inside out is known by what stands in it.
//!
//! Not all that a back sees is seen by anybody: a panel below another one has a cavity behind it.
//! So it is *turned* only if light comes to its back, along paths over sides that reflect, and more
//! than twice as often as to its front. What emits needs no other light.

use glam::DVec3;
use rayon::prelude::*;

use super::Surveyed;
use super::finding::{Finding, Kind, Severity, largest_first, percent};
use super::look::Met;
use super::points::on_parts;
use crate::error::Result;
use crate::monitor::Monitor;

/// Share of the rays from the backs of a turned object that meet others, at least.
const LEAST_SEEN: f64 = 0.02;

/// The back gets so many times as much as the front, at least: a poster or a pane that stands free is
/// no mistake.
const MORE: f64 = 2.0;

/// Points on each suspected part, and paths from each side of each of them at most.
const POINTS: usize = 32;
const MOST_PATHS: usize = 64;

/// Paths of all together, roughly.
const PATHS: usize = 1 << 18;

/// Of the paths from a turned part's back at least so many come to light: fewer may be chance.
const LEAST_LIT: usize = 8;

/// What fronts and backs see, times area; square metres.
#[derive(Clone, Copy, Default)]
struct Sums {
    area: f64,
    front: f64,
    back: f64,
    /// The point whose back sees most, and how much.
    best: f64,
    at: DVec3,
}

impl Sums {
    fn add(&mut self, other: Sums) {
        self.area += other.area;
        self.front += other.front;
        self.back += other.back;
        if other.best > self.best {
            (self.best, self.at) = (other.best, other.at);
        }
    }

    fn is_turned(&self) -> bool {
        self.back >= LEAST_SEEN * self.area && self.back > MORE * self.front
    }

    fn is_right(&self) -> bool {
        self.front >= LEAST_SEEN * self.area && self.front > MORE * self.back
    }
}

/// Which parts are turned, and what is to be said about them.
pub(super) fn find(survey: &Surveyed, monitor: &Monitor) -> Result<(Vec<bool>, Vec<Finding>)> {
    let parts = survey.parts;
    let mut of_object = vec![Sums::default(); survey.scene.objects.len()];
    let mut of_part = vec![Sums::default(); parts.len()];
    for (point, look) in survey.each() {
        let triangle = &survey.scene.triangles[point.triangle as usize];
        if survey.scene.materials[triangle.material as usize].two_sided {
            continue;
        }
        let object = parts.objects[point.part as usize];
        let sums = |other: &dyn Fn(u32) -> bool| {
            let count = |list: &[Met]| -> f64 {
                let far = list.iter().filter(|m| !m.black && !m.near && other(m.part));
                survey.share(far.map(|m| m.count).sum())
            };
            let back = look.behind.as_deref().map_or(0.0, count);
            Sums {
                area: point.area,
                front: point.area * count(&look.front),
                back: point.area * back,
                best: back,
                at: point.position,
            }
        };
        of_object[object as usize].add(sums(&|part| parts.objects[part as usize] != object));
        of_part[point.part as usize].add(sums(&|part| part != point.part));
    }
    let suspected: Vec<bool> = (0..parts.len())
        .map(|part| {
            let (own, all) = (of_part[part], of_object[parts.objects[part] as usize]);
            own.is_turned() || (all.is_turned() && !own.is_right())
        })
        .collect();
    let turned = confirmed(survey, &suspected, monitor)?;
    let findings = of_turned(survey, &turned, &of_object, &of_part);
    Ok((turned, findings))
}

/// Those of the suspected parts that emit, or to whose backs light comes.
fn confirmed(survey: &Surveyed, suspected: &[bool], monitor: &Monitor) -> Result<Vec<bool>> {
    let emits = emitting(survey);
    let unsure: Vec<bool> = suspected.iter().zip(&emits).map(|(&s, &e)| s && !e).collect();
    let points = on_parts(survey.scene, survey.parts, &unsure, POINTS);
    let paths = (PATHS / (2 * points.len().max(1))).clamp(1, MOST_PATHS) as u32;
    let stage = monitor.stage("audit", points.len() as u64);
    let counts: Vec<[usize; 2]> = points
        .par_iter()
        .map_init(Vec::new, |stack, point| {
            stage.advance(1)?;
            let mut lit = |behind| {
                let comes = |k: &u32| survey.looker.comes_to_light(point, behind, *k, stack);
                (0..paths).filter(comes).count()
            };
            Ok([lit(false), lit(true)])
        })
        .collect::<Result<_>>()?;
    let mut sums = vec![[0; 2]; suspected.len()];
    for (point, own) in points.iter().zip(counts) {
        let sum = &mut sums[point.part as usize];
        *sum = [sum[0] + own[0], sum[1] + own[1]];
    }
    let comes = |[front, back]: [usize; 2]| back >= LEAST_LIT && back as f64 > MORE * front as f64;
    Ok((0..suspected.len()).map(|p| suspected[p] && (emits[p] || comes(sums[p]))).collect())
}

/// Which parts emit.
fn emitting(survey: &Surveyed) -> Vec<bool> {
    let mut emits = vec![false; survey.parts.len()];
    for (i, &part) in survey.parts.of.iter().enumerate() {
        emits[part as usize] |= survey.exitance[i] > 0.0;
    }
    emits
}

fn of_turned(
    survey: &Surveyed,
    turned: &[bool],
    of_object: &[Sums],
    of_part: &[Sums],
) -> Vec<Finding> {
    let parts = survey.parts;
    let emits = emitting(survey);
    let mut triangles = vec![0; parts.len()];
    parts.of.iter().for_each(|&part| triangles[part as usize] += 1);
    let mut findings = vec![];
    for (object, members) in parts.of_objects(of_object.len()).into_iter().enumerate() {
        let wrong: Vec<usize> = members.iter().copied().filter(|&p| turned[p]).collect();
        if wrong.is_empty() {
            continue;
        }
        let mut sums = Sums::default();
        if wrong.len() == members.len() && of_object[object].is_turned() {
            sums = of_object[object];
        } else {
            wrong.iter().for_each(|&p| sums.add(of_part[p]));
        }
        let count: usize = wrong.iter().map(|&p| triangles[p]).sum();
        let who = if wrong.len() == members.len() {
            format!("its {count} triangles are turned away")
        } else {
            let (some, all) = (wrong.len(), members.len());
            format!("{some} of its {all} connected parts ({count} triangles) are turned away")
        };
        let lost = if wrong.iter().any(|&p| emits[p]) { "; its light goes there" } else { "" };
        let text = format!(
            "{who}: {} of the rays from its black backs meet the rest of the scene, {} of those from \
             its fronts{lost}",
            percent(sums.back / sums.area),
            percent(sums.front / sums.area)
        );
        let finding =
            Finding::new(Severity::Warning, Kind::Flipped, survey.object(object as u32), text)
                .at(sums.at)
                .remedy(
                    "flip the normals of these faces, or let both sides radiate with a two-sided \
                     material or --two-sided",
                );
        findings.push((sums.area, finding));
    }
    largest_first(findings)
}
