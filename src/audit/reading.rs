//! What is known without rays: notices of reading, winding, slivers; and faces that nearly touch.

use std::collections::BTreeMap;

use glam::DVec3;

use super::Surveyed;
use super::finding::{Finding, Kind, Severity, two_figures};
use crate::mesh::Contacts;
use crate::scene::{DISAGREES, Notice, group_notices};

/// Longest edge over height of a sliver: its area is less than a millionth of a square of its length.
const SLIVER: f64 = 1e6;

/// Notices as findings, those that say the same as one. Disagreement about fronts is a finding with a place, see [`of_geometry`].
pub(super) fn of_notices(notices: &[Notice]) -> Vec<Finding> {
    group_notices(notices)
        .into_iter()
        .filter(|notice| notice.text != DISAGREES)
        .map(|Notice { about, text, count }| {
            let times = if count > 1 { format!(" ({count} times)") } else { String::new() };
            Finding::new(Severity::Note, Kind::Reading, about, format!("{text}{times}"))
        })
        .collect()
}

/// Winding, slivers and gaps by object.
pub(super) fn of_geometry(survey: &Surveyed) -> Vec<Finding> {
    let mut findings: Vec<Finding> = survey
        .scene
        .winding
        .iter()
        .map(|own| {
            let edges = if own.edges == 1 { "edge" } else { "edges" };
            let text = format!(
                "neighbouring one-sided faces have their fronts on different sides of {} {edges}",
                own.edges
            );
            Finding::new(Severity::Warning, Kind::Winding, survey.object(own.object), text)
                .at(own.at)
                .remedy(
                    "recalculate the normals in the modelling program, or let both sides radiate \
                     with a two-sided material or --two-sided",
                )
        })
        .collect();
    findings.extend(slivers(survey));
    findings.extend(gaps(survey));
    findings
}

fn slivers(survey: &Surveyed) -> Vec<Finding> {
    // Of each object how many, and the middle of the first.
    let mut found: BTreeMap<u32, (usize, DVec3)> = BTreeMap::new();
    for triangle in &survey.scene.triangles {
        if aspect(&triangle.vertices) > SLIVER {
            let [a, b, c] = triangle.vertices;
            found.entry(triangle.object).or_insert((0, (a + b + c) / 3.0)).0 += 1;
        }
    }
    let finding = |(object, (count, at)): (u32, (usize, DVec3))| {
        let text = format!("{count} triangles are more than a million times longer than high");
        Finding::new(Severity::Note, Kind::Sliver, survey.object(object), text)
            .at(at)
            .remedy("merge vertices by distance, or dissolve degenerate faces; they only cost time")
    };
    found.into_iter().map(finding).collect()
}

/// Longest edge over height; infinite without area.
fn aspect([a, b, c]: &[DVec3; 3]) -> f64 {
    let edges = [*b - *a, *c - *b, *a - *c];
    let longest = edges.iter().map(|e| e.abs().max_element()).fold(0.0, f64::max);
    // In units of the longest edge nothing over- or underflows.
    let [e0, e1, e2] = edges.map(|e| e / longest);
    let square = e0.length_squared().max(e1.length_squared()).max(e2.length_squared());
    square / e0.cross(e1).length()
}

/// Faces of different parts that face each other within the contact distance, but do not touch: how
/// many pairs of objects have them, and the widest.
fn gaps(survey: &Surveyed) -> Option<Finding> {
    let parts = survey.parts;
    // By pairs of objects: the largest gap and its place.
    let mut found: BTreeMap<(u32, u32), (f64, DVec3)> = BTreeMap::new();
    for (point, look) in survey.each() {
        let Some((triangle, height)) = look.gap else { continue };
        let other = parts.objects[parts.of[triangle as usize] as usize];
        let own = parts.objects[point.part as usize];
        let gap = found.entry((own.min(other), own.max(other))).or_insert((0.0, DVec3::ZERO));
        if height > gap.0 {
            *gap = (height, point.position);
        }
    }
    let (&(a, b), &(height, at)) = found.iter().max_by(|x, y| x.1.0.total_cmp(&y.1.0))?;
    let other = if a == b { "another part of it".to_string() } else { survey.object(b) };
    let more = match found.len() - 1 {
        0 => String::new(),
        more => format!(", and {more} more pairs of objects likewise"),
    };
    let text = format!(
        "it faces {other} at a distance of {} m, which counts as touching{more}",
        two_figures(height)
    );
    let finding = Finding::new(Severity::Note, Kind::Gap, survey.object(a), text).at(at);
    Some(finding.remedy("harmless, unless a gap that can be seen was meant"))
}

/// What could not be cut well where faces touch.
pub(super) fn of_contacts(contacts: Contacts) -> Vec<Finding> {
    let note = |count: usize, what: &str, remedy: &str| {
        let text = format!("{count} faces {what}");
        let finding = Finding::new(Severity::Note, Kind::Gap, "scene", text).remedy(remedy);
        (count > 0).then_some(finding)
    };
    let simplified = note(
        contacts.simplified,
        "are touched by too many others, and cut along the longer contacts only",
        "split large faces that have much on them, if light is not right around small feet",
    );
    let whole = note(
        contacts.left_whole,
        "are touched by others, but could not be cut there",
        "look for faces that cross at nearly no angle, or are crumpled",
    );
    simplified.into_iter().chain(whole).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn aspect_does_not_depend_on_size() {
        for size in [1e-200, 1.0, 1e29] {
            let t = [DVec3::ZERO, 2.0 * size * DVec3::X, size * DVec3::new(1.0, 1e-3, 0.0)];
            assert!((aspect(&t) - 2000.0).abs() < 1e-3, "{}", aspect(&t));
        }
        assert_eq!(aspect(&[DVec3::ZERO, DVec3::X, DVec3::new(0.5, 0.0, 0.0)]), f64::INFINITY);
    }

    #[test]
    fn notices_are_notes_but_for_those_with_a_place() {
        let notice = |text: &str, count| Notice { about: "mesh".into(), text: text.into(), count };
        let found = of_notices(&[notice("is odd", 3), notice(DISAGREES, 1)]);
        assert_eq!(found.len(), 1);
        assert_eq!(
            (found[0].severity, found[0].text.as_str()),
            (Severity::Note, "is odd (3 times)")
        );
    }
}
