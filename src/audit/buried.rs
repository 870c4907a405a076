//! Things inside of others.
//!
//! A point is buried if more than half of its rays first meet sides that do not radiate, not counting
//! those of turned parts. A part lies inside of something if half of it is buried, and no light comes
//! to any of it ([`super::light`]).

use std::collections::BTreeMap;

use glam::DVec3;

use super::Surveyed;
use super::finding::{Finding, Kind, Severity, largest_first, percent, two_figures};
use super::light;
use super::look::{Look, Met};
use crate::error::Result;
use crate::monitor::Monitor;

/// Share of black backs among what a buried point meets.
const ENCLOSED: f64 = 0.5;

/// What is buried is worth a look if it is this share of the area: what stands on a floor or in a wall
/// covers less of it.
const MENTIONED: f64 = 0.5;

/// Where there is no light at all, a part lies inside of something if this share of it is buried.
const WHOLLY: f64 = 0.9;

/// What an object, or one of its parts, has inside of other things.
#[derive(Default)]
struct Inside {
    area: f64,
    buried: f64,
    at: Option<DVec3>,
    /// Rays from buried points by the object whose backs they meet.
    within: BTreeMap<u32, u64>,
}

impl Inside {
    fn share(&self) -> f64 {
        if self.area > 0.0 { self.buried / self.area } else { 0.0 }
    }
}

/// Whether something is a black back, but not of what is turned.
fn hides(met: &Met, turned: &[bool]) -> bool {
    met.black && !turned[met.part as usize]
}

/// Whether a point lies inside of something.
pub(super) fn is_buried(survey: &Surveyed, look: &Look, turned: &[bool]) -> bool {
    survey.share(look.count(|m| hides(m, turned))) > ENCLOSED
}

/// Objects, and parts of them, inside of others. Those that emit are left to
/// [`super::emitters`].
pub(super) fn find(survey: &Surveyed, turned: &[bool], monitor: &Monitor) -> Result<Vec<Finding>> {
    let parts = survey.parts;
    let mut of_object: BTreeMap<u32, Inside> = BTreeMap::new();
    let mut of_part: Vec<[f64; 2]> = vec![[0.0; 2]; parts.len()];
    for (point, look) in survey.each() {
        if survey.exitance[point.triangle as usize] > 0.0 {
            continue;
        }
        let inside = of_object.entry(parts.objects[point.part as usize]).or_default();
        let own = &mut of_part[point.part as usize];
        inside.area += point.area;
        own[0] += point.area;
        if !is_buried(survey, look, turned) {
            continue;
        }
        inside.buried += point.area;
        own[1] += point.area;
        inside.at.get_or_insert(point.position);
        for m in look.front.iter().filter(|m| hides(m, turned)) {
            let within = parts.objects[m.part as usize];
            *inside.within.entry(within).or_default() += u64::from(m.count);
        }
    }
    let mut findings = vec![];
    let members = parts.of_objects(survey.scene.objects.len());
    let share = |part: usize| {
        let [area, buried] = of_part[part];
        if area > 0.0 { buried / area } else { 0.0 }
    };
    let suspected: Vec<bool> = (0..parts.len()).map(|part| share(part) >= MENTIONED).collect();
    let is_light = light::is_there(survey);
    let lit = light::comes(survey, &suspected, false, monitor)?;
    let is_hidden = |part: &usize| {
        let dark = if is_light { lit[*part].front == 0.0 } else { share(*part) >= WHOLLY };
        suspected[*part] && dark
    };
    for (&object, inside) in &of_object {
        let Some(at) = inside.at else { continue };
        let own = &members[object as usize];
        let hidden: Vec<usize> = own.iter().copied().filter(is_hidden).collect();
        let whole = hidden.len() == own.len();
        let (what, area) = if whole {
            ("it lies".to_string(), inside.area)
        } else if !hidden.is_empty() {
            let what = format!("{} of its {} connected parts lie", hidden.len(), own.len());
            (what, hidden.iter().map(|&part| of_part[part][0]).sum())
        } else if inside.share() >= MENTIONED {
            (format!("{} of it lies", percent(inside.share())), inside.buried)
        } else {
            continue;
        };
        let most =
            inside.within.iter().max_by_key(|(object, rays)| (**rays, std::cmp::Reverse(**object)));
        let within = match most {
            Some((&other, _)) if other != object => survey.object(other),
            _ => "itself".into(),
        };
        let severity = if whole { Severity::Warning } else { Severity::Note };
        let text =
            format!("{what} inside of {within}, where no light comes: {} m^2", two_figures(area));
        let finding = Finding::new(severity, Kind::Buried, survey.object(object), text)
            .at(at)
            .remedy("remove it; or, if it should be seen, open or flip what is around it");
        findings.push((area, finding));
    }
    Ok(largest_first(findings))
}
