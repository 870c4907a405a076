//! What the command line changes in materials.
//!
//! `NAME=R,G,B` replaces the radiance or the reflectance of every material whose name fits NAME,
//! where `*` stands for any run of characters. Case matters. A name that fits no material is a
//! mistake of the user and is answered with the list of names.

use glam::DVec3;

use super::limits::{MAX_REFLECTANCE, clamp_reflectance, triple};
use super::notices::Notices;
use super::{ReadOptions, Scene};
use crate::error::{Error, Result};

/// How many materials a usage error lists before it only counts them.
const LISTED: usize = 30;

/// A value for all materials whose name fits a pattern.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    /// A material name in which `*` stands for any run of characters, also an empty one.
    pub pattern: String,
    /// Red, green and blue, linear.
    pub value: DVec3,
}

impl Override {
    /// Parses `NAME=R,G,B` or `NAME=GREY`. The last `=` divides, so that names may contain it.
    ///
    /// # Errors
    ///
    /// What is wrong with it, in words: not of this form, a number that is not finite or is
    /// negative.
    ///
    /// # Examples
    ///
    /// ```
    /// use lumel::scene::Override;
    /// let lamp = Override::parse("Lamp*=10,9.5,8").unwrap();
    /// assert_eq!(lamp.pattern, "Lamp*");
    /// assert_eq!(lamp.value.y, 9.5);
    /// assert_eq!(Override::parse("wall=0.5").unwrap().value.z, 0.5);
    /// assert!(Override::parse("wall=-1").is_err());
    /// ```
    pub fn parse(text: &str) -> std::result::Result<Override, String> {
        let form = || format!("\"{text}\" is not of the form NAME=R,G,B (or NAME=GREY)");
        let (pattern, numbers) = text.rsplit_once('=').ok_or_else(form)?;
        if pattern.is_empty() {
            return Err(format!("{}: the name is empty (* means every material)", form()));
        }
        let parsed: Vec<f64> = numbers
            .split(',')
            .map(|n| n.trim().parse().map_err(|_| format!("{}: \"{n}\" is no number", form())))
            .collect::<std::result::Result<_, _>>()?;
        let value = match parsed[..] {
            [grey] => DVec3::splat(grey),
            [r, g, b] => DVec3::new(r, g, b),
            _ => return Err(format!("{}: one or three numbers are expected", form())),
        };
        let wanted = Override { pattern: pattern.to_string(), value };
        wanted.check().map_err(|reason| format!("\"{text}\": {reason}"))?;
        Ok(wanted)
    }

    /// Whether a material's name fits the pattern.
    pub fn matches(&self, name: &str) -> bool {
        name_fits(&self.pattern, name)
    }

    fn check(&self) -> std::result::Result<(), String> {
        if !self.value.is_finite() {
            return Err("the numbers must be finite".into());
        }
        if self.value.min_element() < 0.0 {
            return Err("the numbers must not be negative".into());
        }
        Ok(())
    }
}

/// Whether a name fits a pattern, in which `*` stands for any run of characters.
pub fn name_fits(pattern: &str, name: &str) -> bool {
    let pattern: Vec<char> = pattern.chars().collect();
    let name: Vec<char> = name.chars().collect();
    let (mut p, mut n) = (0, 0);
    // Where to go on when a later part does not fit: let the last star take one more.
    let mut retry: Option<(usize, usize)> = None;
    while n < name.len() {
        if p < pattern.len() && pattern[p] == '*' {
            retry = Some((p + 1, n));
            p += 1;
        } else if p < pattern.len() && pattern[p] == name[n] {
            p += 1;
            n += 1;
        } else if let Some((after, taken)) = retry {
            retry = Some((after, taken + 1));
            p = after;
            n = taken + 1;
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|&c| c == '*')
}

/// Changes the materials of a scene as the options ask.
pub(crate) fn apply(scene: &mut Scene, options: &ReadOptions) -> Result<()> {
    if !(options.light_scale.is_finite() && options.light_scale >= 0.0) {
        return Err(Error::Usage(format!(
            "the light scale must be finite and not negative, not {}",
            options.light_scale
        )));
    }
    let mut notices = Notices::default();
    for wanted in &options.reflectance {
        let hit = matching(scene, wanted, "--reflectance")?;
        for (material, _) in scene.materials.iter_mut().zip(&hit).filter(|(_, hit)| **hit) {
            material.reflectance = wanted.value;
            material.reflectance_texture = None;
            material.metallic = 0.0;
            material.metallic_texture = None;
            if wanted.value.max_element() > MAX_REFLECTANCE {
                clamp_reflectance(material, &mut notices);
            }
        }
        for triangle in &mut scene.triangles {
            if hit.get(triangle.material as usize).is_some_and(|&hit| hit) {
                triangle.colour = [DVec3::ONE; 3];
            }
        }
    }
    for wanted in &options.emission {
        let hit = matching(scene, wanted, "--emission")?;
        for (material, _) in scene.materials.iter_mut().zip(&hit).filter(|(_, hit)| **hit) {
            material.radiance = wanted.value;
            material.radiance_texture = None;
        }
    }
    for material in &mut scene.materials {
        material.two_sided |= options.two_sided;
        material.radiance *= options.light_scale;
        if !material.radiance.is_finite() {
            return Err(Error::Usage(format!(
                "the light scale {} makes the radiance of material \"{}\" infinite; lower it",
                options.light_scale, material.name
            )));
        }
    }
    scene.notices.extend(notices.into_list());
    Ok(())
}

/// Which materials fit, or the error that lists them.
fn matching(scene: &Scene, wanted: &Override, option: &str) -> Result<Vec<bool>> {
    let name = &wanted.pattern;
    wanted.check().map_err(|reason| {
        Error::Usage(format!("{option} {name}={}: {reason}", triple(wanted.value)))
    })?;
    let hit: Vec<bool> = scene.materials.iter().map(|m| wanted.matches(&m.name)).collect();
    if hit.contains(&true) {
        return Ok(hit);
    }
    let mut list: Vec<String> =
        scene.materials.iter().take(LISTED).map(|m| format!("\"{}\"", m.name)).collect();
    if scene.materials.len() > LISTED {
        list.push(format!("and {} more", scene.materials.len() - LISTED));
    }
    Err(Error::Usage(format!(
        "{option} {name}: no material has this name in {}, which has: {}",
        scene.path.display(),
        if list.is_empty() { "none".to_string() } else { list.join(", ") }
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fits(pattern: &str, name: &str) -> bool {
        Override { pattern: pattern.into(), value: DVec3::ZERO }.matches(name)
    }

    #[test]
    fn stars_match_any_run() {
        assert!(fits("*", ""));
        assert!(fits("*", "abc"));
        assert!(fits("a*c", "abbc"));
        assert!(fits("a*c", "ac"));
        assert!(fits("*ab*ab", "abxabab"));
        assert!(!fits("a*c", "abcd"));
        assert!(!fits("Wall", "wall"));
        assert!(!fits("", "a"));
        assert!(fits("w\u{e4}nd*", "w\u{e4}nde"));
    }

    #[test]
    fn long_patterns_of_stars_end() {
        assert!(!fits(&"*a".repeat(200), &"a".repeat(199)));
    }

    #[test]
    fn parsing_refuses_what_is_no_colour() {
        for bad in ["a", "=1", "a=1,2", "a=1,2,3,4", "a=x", "a=nan", "a=inf", "a=1,-1,1", "a="] {
            assert!(Override::parse(bad).is_err(), "{bad}");
        }
        let odd = Override::parse("a=b=1, 2,3").unwrap();
        assert_eq!((odd.pattern.as_str(), odd.value), ("a=b", DVec3::new(1.0, 2.0, 3.0)));
    }
}
