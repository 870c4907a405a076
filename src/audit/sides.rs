//! Objects that show their backs to the rest of the scene, and things inside of others.
//!
//! **Turned.** Of the rays from the fronts of an object's one-sided faces the share f, and of those from
//! their backs the share b, meets sides of other objects that radiate and are not near
//! ([`super::look::NEAR`]). Where light goes, light comes from: f and b are what the rest of the scene
//! sees of its fronts and of its black backs. It is turned when b is [`LEAST_SEEN`] or more, and more
//! than twice f. Each connected part of an object is judged for itself, against all that is not of it;
//! where that does not decide (six loose sides of a box see each other) the object does. A closed block in a room has b = 0, a room has f > 0 = b, a sheet between two
//! halves of a room f = b. A turned room is known by what stands in it.
//!
//! **Buried.** More than half of the rays from a point first meet sides that do not radiate (not
//! counting those of turned objects): it lies inside of something, and no light comes there.

use std::collections::BTreeMap;

use glam::DVec3;

use super::Surveyed;
use super::finding::{Finding, Kind, Severity, percent, two_figures};
use super::look::{Look, Met};

/// Share of the rays from the backs of a turned object that meet others, at least.
const LEAST_SEEN: f64 = 0.02;

/// Of an object's backs so many times as much is seen as of its fronts, at least, if it is turned: a
/// poster or a pane that stands free is no mistake.
const MORE: f64 = 2.0;

/// Share of black backs among what a buried point meets.
const ENCLOSED: f64 = 0.5;

/// An object lies inside of something if this share of its area does: rims may stick out.
const WHOLLY: f64 = 0.9;

/// What lies inside is worth a line if it is this share of an object's area: what stands on a floor or
/// in a wall covers less of it.
const MENTIONED: f64 = 0.5;

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
pub(super) fn turned(survey: &Surveyed) -> (Vec<bool>, Vec<Finding>) {
    let parts = &survey.parts;
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
    let turned: Vec<bool> = (0..parts.len())
        .map(|part| {
            let (own, all) = (of_part[part], of_object[parts.objects[part] as usize]);
            own.is_turned() || (all.is_turned() && !own.is_right())
        })
        .collect();
    let findings = of_turned(survey, &turned, &of_object, &of_part);
    (turned, findings)
}

fn of_turned(
    survey: &Surveyed,
    turned: &[bool],
    of_object: &[Sums],
    of_part: &[Sums],
) -> Vec<Finding> {
    let parts = &survey.parts;
    let mut triangles = vec![0; parts.len()];
    let mut emits = vec![false; parts.len()];
    for (i, &part) in parts.of.iter().enumerate() {
        triangles[part as usize] += 1;
        emits[part as usize] |= survey.exitance[i] > 0.0;
    }
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

/// Findings by the area that they are about.
fn largest_first(mut findings: Vec<(f64, Finding)>) -> Vec<Finding> {
    findings.sort_by(|a, b| b.0.total_cmp(&a.0));
    findings.into_iter().map(|(_, finding)| finding).collect()
}

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
pub(super) fn buried(survey: &Surveyed, turned: &[bool]) -> Vec<Finding> {
    let parts = &survey.parts;
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
    let is_hidden = |part: &&usize| {
        let [area, buried] = of_part[**part];
        buried > 0.0 && buried >= WHOLLY * area
    };
    for (&object, inside) in &of_object {
        let Some(at) = inside.at else { continue };
        let own = &members[object as usize];
        let (all, some) = (own.len(), own.iter().filter(is_hidden).count());
        let whole = inside.share() >= WHOLLY;
        let what = if whole {
            "it lies".to_string()
        } else if some > 0 {
            format!("{some} of its {all} connected parts lie")
        } else if inside.share() >= MENTIONED {
            format!("{} of it lies", percent(inside.share()))
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
        let text = format!(
            "{what} inside of {within}, where no light comes: {} m^2",
            two_figures(inside.buried)
        );
        let finding = Finding::new(severity, Kind::Buried, survey.object(object), text)
            .at(at)
            .remedy("leave it away; or, if it should be seen, open or flip what is around it");
        findings.push((inside.buried, finding));
    }
    largest_first(findings)
}
