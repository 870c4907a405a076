//! What a finding is, in words.

use glam::DVec3;
use serde::Serialize;

/// How bad it is; the worst first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The result will be wrong, or black.
    Error,
    /// Light is probably not as it was meant.
    Warning,
    /// Worth knowing.
    Note,
}

/// What it is about, in the order in which findings are listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// No light in the scene, or none that arrives anywhere.
    Darkness,
    /// A point sees more than its whole hemisphere.
    RowSum,
    /// Light leaves a scene that is closed but for small gaps.
    Leak,
    /// An object shows the rest of the scene its backs.
    Flipped,
    /// Neighbouring faces disagree about their front.
    Winding,
    /// Light of a lamp goes nowhere.
    Emitter,
    /// An object lies inside of another one.
    Buried,
    /// The scene is open.
    Open,
    /// An object lies outside of a scene that is closed.
    Outside,
    /// Faces that nearly touch.
    Gap,
    /// Triangles so long and thin that their light has no use.
    Sliver,
    /// What reading the file found and resolved.
    Reading,
}

/// One thing that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// What kind of thing it is.
    pub kind: Kind,
    /// What it is about: `object "Lamp"`, `scene`.
    pub about: String,
    /// What was found.
    pub text: String,
    /// Where: one place of it, metres.
    pub place: Option<DVec3>,
    /// What to do about it; empty where nothing needs to be done.
    pub remedy: String,
}

impl Finding {
    /// A finding without a place and a remedy.
    pub(super) fn new(
        severity: Severity,
        kind: Kind,
        about: impl Into<String>,
        text: impl Into<String>,
    ) -> Finding {
        let (about, text) = (about.into(), text.into());
        Finding { severity, kind, about, text, place: None, remedy: String::new() }
    }

    /// The same at a place.
    pub(super) fn at(self, place: DVec3) -> Finding {
        Finding { place: Some(place), ..self }
    }

    /// The same with a remedy.
    pub(super) fn remedy(self, remedy: impl Into<String>) -> Finding {
        Finding { remedy: remedy.into(), ..self }
    }
}

/// Findings by the area that they are about.
pub(super) fn largest_first(mut findings: Vec<(f64, Finding)>) -> Vec<Finding> {
    findings.sort_by(|a, b| b.0.total_cmp(&a.0));
    findings.into_iter().map(|(_, finding)| finding).collect()
}

/// A share in words: `12 %`, `0.034 %`.
pub(super) fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if percent == 0.0 || percent >= 9.95 {
        format!("{percent:.0} %")
    } else if percent >= 0.0095 {
        format!("{percent:.2} %")
    } else {
        format!("{percent:.1e} %")
    }
}

/// An area or a length in words, with two figures.
pub(super) fn two_figures(v: f64) -> String {
    let size = v.abs();
    if v == 0.0 || !(1e-3..1e5).contains(&size) {
        return if v == 0.0 { "0".into() } else { format!("{v:.1e}") };
    }
    let decimals = (1 - size.log10().floor() as i32).max(0) as usize;
    format!("{v:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (share, text) in
            [(0.0, "0 %"), (1.0, "100 %"), (0.25, "25 %"), (0.012, "1.20 %"), (2e-6, "2.0e-4 %")]
        {
            assert_eq!(percent(share), text);
        }
        for (v, text) in
            [(0.0, "0"), (1.234, "1.2"), (123.4, "123"), (0.0456, "0.046"), (1e-9, "1.0e-9")]
        {
            assert_eq!(two_figures(v), text);
        }
    }
}
