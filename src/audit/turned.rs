//! Parts that show their backs to the light.
//!
//! **Suspected** is a connected part with one-sided faces from whose backs the share b of the rays,
//! [`LEAST_SEEN`] or more, meets sides of others that radiate and are not near
//! ([`super::look::NEAR`]): something could see those backs. A closed block in a room has b = 0, and
//! so has the room.
//!
//! **Turned** it is if light comes to its backs more than twice as often as to its fronts
//! ([`super::light`]). A sheet between two halves of a room is not turned, and a panel below
//! another one, with a cavity behind it, is not either: its back is seen by what nobody sees.
//!
//! What emits needs no other light: it is turned if b is more than ten times the same share of the
//! rays from its fronts.

use super::Surveyed;
use super::finding::{Finding, Kind, Severity, largest_first, percent};
use super::light::{self, Sums};
use super::look::Met;
use crate::error::Result;
use crate::monitor::Monitor;

/// Share of the rays from the backs of a turned part that meet others, at least: what is sunk into
/// others has a little of them inside.
const LEAST_SEEN: f64 = 0.02;

/// The back gets so many times as much as the front, at least: a pane that stands free is no mistake.
const MORE: f64 = 2.0;

/// The same for what emits: black backs of others before a lamp are no mistake of the lamp.
const MUCH_MORE: f64 = 10.0;

/// Of the paths from a turned part's back at least so many come to light: fewer may be chance.
const LEAST_LIT: f64 = 8.0;

/// Which parts are turned, and what is to be said about them.
pub(super) fn find(survey: &Surveyed, monitor: &Monitor) -> Result<(Vec<bool>, Vec<Finding>)> {
    let mut emits = vec![false; survey.parts.len()];
    for (i, &part) in survey.parts.of.iter().enumerate() {
        emits[part as usize] |= survey.exitance[i] > 0.0;
    }
    let mut sums = seen(survey);
    let suspected = |(own, emits): (&Sums, &bool)| {
        own.back > 0.0 && own.back >= LEAST_SEEN * own.all && (!emits || own.is_more(MUCH_MORE))
    };
    let mut turned: Vec<bool> = sums.iter().zip(&emits).map(suspected).collect();
    let unsure: Vec<bool> = turned.iter().zip(&emits).map(|(&yes, &emits)| yes && !emits).collect();
    let lit = light::comes(survey, &unsure, true, monitor)?;
    for part in (0..turned.len()).filter(|&part| unsure[part]) {
        turned[part] = lit[part].back >= LEAST_LIT && lit[part].is_more(MORE);
        sums[part] = lit[part];
    }
    let findings = findings(survey, &turned, &emits, &sums);
    Ok((turned, findings))
}

/// Shares of the rays from fronts and backs of each part that meet sides of others that radiate and
/// are not near, by area.
fn seen(survey: &Surveyed) -> Vec<Sums> {
    let mut sums = vec![Sums::default(); survey.parts.len()];
    for (point, look) in survey.each() {
        let triangle = &survey.scene.triangles[point.triangle as usize];
        if survey.scene.materials[triangle.material as usize].two_sided {
            continue;
        }
        let share = |list: &[Met]| {
            let far = list.iter().filter(|m| !m.black && !m.near && m.part != point.part);
            survey.share(far.map(|m| m.count).sum())
        };
        let back = look.behind.as_deref().map_or(0.0, share);
        sums[point.part as usize].add(point.area, share(&look.front), back, point.position);
    }
    sums
}

/// A finding for each object that has parts which are turned.
fn findings(survey: &Surveyed, turned: &[bool], emits: &[bool], sums: &[Sums]) -> Vec<Finding> {
    let parts = survey.parts;
    let mut triangles = vec![0; parts.len()];
    let mut areas = vec![0.0; parts.len()];
    for (&part, triangle) in parts.of.iter().zip(&survey.scene.triangles) {
        triangles[part as usize] += 1;
        areas[part as usize] += triangle.normal_and_area().1;
    }
    let members = parts.of_objects(survey.scene.objects.len());
    let mut findings = vec![];
    for (object, members) in members.into_iter().enumerate() {
        let wrong: Vec<usize> = members.iter().copied().filter(|&p| turned[p]).collect();
        if wrong.is_empty() {
            continue;
        }
        let count: usize = wrong.iter().map(|&p| triangles[p]).sum();
        let who = if wrong.len() == members.len() {
            format!("its {count} triangles are turned away")
        } else {
            let (some, all) = (wrong.len(), members.len());
            format!("{some} of its {all} connected parts ({count} triangles) are turned away")
        };
        // The part that shows most is an example for all.
        let area = |p: usize| areas[p];
        let Some(&largest) = wrong.iter().max_by(|&&p, &&q| area(p).total_cmp(&area(q))) else {
            continue;
        };
        let own = &sums[largest];
        let (back, front) = (percent(own.back / own.all), percent(own.front / own.all));
        let why = if emits[largest] {
            format!(
                "its light goes where {front} of the rays meet others, {back} do from its black backs"
            )
        } else {
            format!(
                "light comes to its black backs along {back} of the paths that look for it, to its \
                 fronts along {front}"
            )
        };
        let finding = Finding::new(
            Severity::Warning,
            Kind::Flipped,
            survey.object(object as u32),
            format!("{who}: {why}"),
        );
        let finding = finding.at(own.at).remedy(
            "flip the normals of these faces, or let both sides radiate with a two-sided material \
             or --two-sided",
        );
        findings.push((wrong.iter().map(|&p| areas[p]).sum(), finding));
    }
    largest_first(findings)
}
