//! Scenes without light, and lamps whose light goes nowhere.
//!
//! Where the rays from what emits end, weighed by the power that they stand for, is where its light
//! goes first: on sides that reflect, on black ones, near ones, or out of the scene.

use std::collections::BTreeMap;

use glam::DVec3;

use super::Surveyed;
use super::finding::{Finding, Kind, Severity, percent};

/// Nothing sees a lamp if less than this share of its light falls on sides that reflect.
const UNSEEN: f64 = 1e-3;

/// Light that ends on black backs is said if it is more than this share.
const ON_BACKS: f64 = 0.5;

/// The same for light on something near ([`super::look::NEAR`]).
const ON_NEAR: f64 = 0.25;

/// Where the light of an object goes, W (of the brightest channel).
#[derive(Default)]
struct Light {
    power: f64,
    /// On sides that reflect.
    useful: f64,
    /// On black backs, by object.
    backs: BTreeMap<u32, f64>,
    /// On sides of other parts that are near, by object.
    near: BTreeMap<u32, f64>,
    /// On backs of parts that are turned: that is said already.
    turned_backs: f64,
    /// Out of the scene.
    escaped: f64,
    /// Whether some of it comes from parts that are turned: that is said already.
    turned: bool,
    at: Option<DVec3>,
}

/// Findings about what emits; `turned` are parts whose backs do not count as black, `reflects` is
/// for each triangle.
pub(super) fn find(survey: &Surveyed, turned: &[bool], reflects: &[bool]) -> Vec<Finding> {
    let error = |text: &str, remedy: &str| {
        Finding::new(Severity::Error, Kind::Darkness, "scene", text).remedy(remedy)
    };
    let mut findings = vec![];
    if survey.exitance.iter().all(|&e| e == 0.0) {
        findings.push(error(
            "nothing emits light, so everything is black",
            "let a material emit in the modelling program, or with --emission NAME=R,G,B",
        ));
    }
    if !reflects.contains(&true) {
        findings.push(error(
            "nothing reflects light, so all but the emitters is black",
            "let materials reflect: a base colour, no metal; or --reflectance NAME=R,G,B",
        ));
        return findings;
    }
    let lights = lights(survey, turned);
    let (mut power, mut useful) = (0.0, 0.0);
    for (&object, light) in &lights {
        power += light.power;
        useful += light.useful;
        findings.extend(of_light(survey, object, light));
    }
    if power > 0.0 && useful < UNSEEN * power {
        findings.push(error(
            "no light falls on anything that reflects, so all but the emitters is black",
            "see what is said about each emitter",
        ));
    }
    findings
}

/// Triangles that emit, of parts whose light falls on something that reflects.
pub(super) fn bright(survey: &Surveyed) -> Vec<bool> {
    let mut useful = vec![false; survey.parts.len()];
    for (point, look) in survey.each() {
        if survey.exitance[point.triangle as usize] > 0.0 {
            useful[point.part as usize] |= look.count(|m| !m.black && m.reflects) > 0;
        }
    }
    let of = |(&e, &part): (&f64, &u32)| e > 0.0 && useful[part as usize];
    survey.exitance.iter().zip(&survey.parts.of).map(of).collect()
}

fn lights(survey: &Surveyed, turned: &[bool]) -> BTreeMap<u32, Light> {
    let parts = survey.parts;
    let mut lights: BTreeMap<u32, Light> = BTreeMap::new();
    for (point, look) in survey.each() {
        let power = survey.exitance[point.triangle as usize] * point.area;
        if power == 0.0 {
            continue;
        }
        let light = lights.entry(parts.objects[point.part as usize]).or_default();
        light.power += power;
        light.turned |= turned[point.part as usize];
        light.at.get_or_insert(point.position);
        light.escaped += power * survey.share(look.escaped.len() as u32);
        for m in &look.front {
            let own = power * survey.share(m.count);
            let object = parts.objects[m.part as usize];
            if m.black && turned[m.part as usize] {
                light.turned_backs += own;
            } else if m.black {
                *light.backs.entry(object).or_default() += own;
            } else if m.reflects {
                light.useful += own;
            }
            if !m.black && m.near && m.part != point.part {
                *light.near.entry(object).or_default() += own;
            }
        }
    }
    lights
}

fn of_light(survey: &Surveyed, object: u32, light: &Light) -> Option<Finding> {
    let share = |power: f64| power / light.power;
    if light.turned || share(light.turned_backs) > ON_BACKS {
        return None;
    }
    let sum = |by: &BTreeMap<u32, f64>| share(by.values().sum());
    let most = |by: &BTreeMap<u32, f64>| -> String {
        let most = by.iter().max_by(|a, b| a.1.total_cmp(b.1));
        most.map_or_else(String::new, |(&object, _)| survey.object(object))
    };
    let (backs, near, escaped) = (sum(&light.backs), sum(&light.near), share(light.escaped));
    let finding = |severity, text: String, remedy: &str| {
        let own = Finding::new(severity, Kind::Emitter, survey.object(object), text).remedy(remedy);
        Some(Finding { place: light.at, ..own })
    };
    if share(light.useful) < UNSEEN {
        let black = 1.0 - share(light.useful + light.turned_backs) - backs - escaped;
        let mut ways = vec![];
        if backs > UNSEEN {
            let on = most(&light.backs);
            ways.push(format!("{} ends on black backs, most on those of {on}", percent(backs)));
        }
        if black > UNSEEN {
            ways.push(format!("{} on surfaces that reflect nothing", percent(black)));
        }
        if escaped > UNSEEN {
            ways.push(format!("{} leaves the scene", percent(escaped)));
        }
        let remedy = if escaped > backs + black {
            "turn it towards the scene, or let both sides radiate"
        } else if backs > black {
            "it lies inside of something: take it out, or flip the normals of what is around it"
        } else {
            "take it out of what is black, or let that reflect"
        };
        let text = format!("nothing sees this light: {}", ways.join(", "));
        return finding(Severity::Warning, text, remedy);
    }
    if backs > ON_BACKS {
        let text = format!(
            "{} of its light ends on black backs, most on those of {}",
            percent(backs),
            most(&light.backs)
        );
        let remedy = "flip the normals of what is around it, or let both sides of that radiate";
        return finding(Severity::Warning, text, remedy);
    }
    if near > ON_NEAR {
        let text = format!(
            "{} of its light falls on what lies right before it, most on {}",
            percent(near),
            most(&light.near)
        );
        let remedy = "if that is not meant, move it away, or let only its other side emit";
        return finding(Severity::Note, text, remedy);
    }
    None
}
