//! What an audit found: for people a line each, for programs as JSON.

use glam::DVec3;
use lumel::audit::{Audit, Enclosure, Finding, Kind, Severity};
use serde::Serialize;

use super::table::{figure, figures};

/// Most findings of one kind that are listed for people.
const LISTED: usize = 20;

/// An audit in numbers and lines: the field `audit` of what `inspect --json` prints. Places are
/// metres, shares are from 0 to 1.
#[derive(Debug, Serialize)]
pub struct AuditBlock {
    /// Points of the surface from which rays were cast.
    points: usize,
    /// Rays from each of them.
    rays_each: u32,
    /// Objects on which no point lies: there are too many.
    objects_without_points: usize,
    closure: ClosureLine,
    row_sums: RowSumsLine,
    /// Faces that emit, and that reflect light.
    emitting_faces: usize,
    reflecting_faces: usize,
    errors: usize,
    warnings: usize,
    notes: usize,
    /// The most severe first.
    findings: Vec<FindingLine>,
}

/// What of the rays meets something.
#[derive(Debug, Serialize)]
struct ClosureLine {
    /// `closed`: all rays meet something. `leaking`: a few do not. `open`.
    enclosure: Enclosure,
    /// Mean over the area, without sides that see nothing at all.
    mean: f64,
    /// At the point from which most rays escape.
    least: f64,
    /// The object from which most rays escape, and the point.
    worst_object: Option<String>,
    worst_place: Option<[f64; 3]>,
    /// Share of the area that sees nothing at all: what looks outward.
    outward: f64,
}

/// Exact shares of the hemisphere that radiating sides fill: at most 1, and 1 in a closed scene.
#[derive(Debug, Serialize)]
struct RowSumsLine {
    /// Points at which they were computed; none in scenes of very many faces.
    points: usize,
    least: f64,
    largest: f64,
}

#[derive(Debug, Serialize)]
struct FindingLine {
    /// `error`, `warning` or `note`.
    severity: Severity,
    /// `darkness`, `row-sum`, `leak`, `flipped`, `winding`, `emitter`, `buried`, `open`, `outside`,
    /// `gap`, `sliver` or `reading`.
    kind: Kind,
    /// The object, or what else it is about.
    about: String,
    /// What was found.
    text: String,
    /// One place where it is.
    place: Option<[f64; 3]>,
    /// What to do; empty if nothing needs to be done.
    remedy: String,
}

/// The name of a severity where findings are counted.
pub fn name(severity: Severity) -> &'static str {
    match severity {
        Severity::Error => "errors found by the audit",
        Severity::Warning => "warnings found by the audit",
        Severity::Note => "notes of the audit",
    }
}

impl AuditBlock {
    /// Of an audit.
    pub fn new(audit: &Audit) -> AuditBlock {
        let closure = &audit.closure;
        let place = |place: Option<DVec3>| place.map(|x| x.to_array());
        let line = |f: &Finding| FindingLine {
            severity: f.severity,
            kind: f.kind,
            about: f.about.clone(),
            text: f.text.clone(),
            place: place(f.place),
            remedy: f.remedy.clone(),
        };
        AuditBlock {
            points: audit.points,
            rays_each: audit.rays,
            objects_without_points: audit.objects_without_points,
            closure: ClosureLine {
                enclosure: closure.enclosure,
                mean: closure.mean,
                least: closure.least,
                worst_object: closure.worst_object.clone(),
                worst_place: place(closure.worst_place),
                outward: closure.outward,
            },
            row_sums: RowSumsLine {
                points: audit.row_sums.points,
                least: audit.row_sums.least,
                largest: audit.row_sums.largest,
            },
            emitting_faces: audit.emitting,
            reflecting_faces: audit.reflecting,
            errors: audit.count(Severity::Error),
            warnings: audit.count(Severity::Warning),
            notes: audit.count(Severity::Note),
            findings: audit.findings.iter().map(line).collect(),
        }
    }

    /// For people.
    pub fn to_text(&self) -> String {
        let AuditBlock { points, rays_each, closure, row_sums, .. } = self;
        let mut text = format!(
            "\naudit ({}, {}, {})\n  {points} points with {rays_each} rays each: {}\n",
            count(self.errors, "error"),
            count(self.warnings, "warning"),
            count(self.notes, "note"),
            closure.to_text()
        );
        if row_sums.points > 0 {
            text.push_str(&format!(
                "  exact sums of rows at {} points: {} to {}\n",
                row_sums.points,
                sum(row_sums.least),
                sum(row_sums.largest)
            ));
        } else {
            text.push_str(
                "  no exact sums of rows: no point sees anything, or there are too many faces\n",
            );
        }
        if self.objects_without_points > 0 {
            text.push_str(&format!(
                "  {} objects were not looked at: they are small, and there are too many\n",
                self.objects_without_points
            ));
        }
        let same = |a: &FindingLine, b: &FindingLine| (a.severity, a.kind) == (b.severity, b.kind);
        for group in self.findings.chunk_by(same) {
            for finding in &group[..group.len().min(LISTED)] {
                text.push_str(&format!("  {}\n", finding.to_text()));
            }
            if group.len() > LISTED {
                let more = group.len() - LISTED;
                text.push_str(&format!(
                    "  {:<7}  and {more} more like these\n",
                    severity(group[0].severity)
                ));
            }
        }
        text
    }
}

impl ClosureLine {
    fn to_text(&self) -> String {
        match self.enclosure {
            Enclosure::Closed => "closed, all meet something".into(),
            Enclosure::Leaking | Enclosure::Open => format!(
                "{}, {} % meet nothing, {} % at the worst point",
                if self.enclosure == Enclosure::Open { "open" } else { "leaking" },
                figure(100.0 * (1.0 - self.mean)),
                figure(100.0 * (1.0 - self.least))
            ),
        }
    }
}

impl FindingLine {
    fn to_text(&self) -> String {
        let mut line = format!("{:<7}  {}: {}", severity(self.severity), self.about, self.text);
        if let Some(place) = self.place {
            line.push_str(&format!(", at {}", figures(&place)));
        }
        if !self.remedy.is_empty() {
            line.push_str(&format!(": {}", self.remedy));
        }
        line.replace('\n', " ")
    }
}

fn severity(severity: Severity) -> &'static str {
    match severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Note => "note",
    }
}

fn count(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

/// A sum of a row: how far from one it is matters when it is near.
fn sum(v: f64) -> String {
    let off = v - 1.0;
    if off != 0.0 && off.abs() < 1e-3 { format!("1 {:+.0e}", off) } else { figure(v) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(findings: usize) -> AuditBlock {
        let finding = |k: usize| FindingLine {
            severity: if k == 0 { Severity::Warning } else { Severity::Note },
            kind: if k == 0 { Kind::Leak } else { Kind::Reading },
            about: format!("object \"{k}\""),
            text: "is\nodd".into(),
            place: (k == 0).then_some([0.5, 1.0, -2.0]),
            remedy: if k == 0 { "mend it".into() } else { String::new() },
        };
        AuditBlock {
            points: 10,
            rays_each: 64,
            objects_without_points: 3,
            closure: ClosureLine {
                enclosure: Enclosure::Leaking,
                mean: 0.99995,
                least: 0.98,
                worst_object: None,
                worst_place: None,
                outward: 0.0,
            },
            row_sums: RowSumsLine { points: 4, least: 0.75, largest: 1.0 + 2e-14 },
            emitting_faces: 1,
            reflecting_faces: 1,
            errors: 0,
            warnings: 1,
            notes: findings - 1,
            findings: (0..findings).map(finding).collect(),
        }
    }

    #[test]
    fn each_finding_is_one_line_up_to_a_limit() {
        let text = block(30).to_text();
        for part in [
            "\naudit (0 errors, 1 warning, 29 notes)\n",
            "  10 points with 64 rays each: leaking, 0.005 % meet nothing, 2 % at the worst point\n",
            "  exact sums of rows at 4 points: 0.75 to 1 +2e-14\n",
            "  3 objects were not looked at",
            "\n  warning  object \"0\": is odd, at 0.5 1 -2: mend it\n",
            "\n  note     object \"20\": is odd\n",
            "\n  note     and 9 more like these\n",
        ] {
            assert!(text.contains(part), "{part:?} is not in\n{text}");
        }
        assert!(!text.contains("object \"21\""));
        assert!(!block(21).to_text().contains("more like these"));
    }

    #[test]
    fn the_json_has_all_of_them() {
        let json = serde_json::to_value(block(30)).unwrap();
        assert_eq!(json["findings"].as_array().unwrap().len(), 30);
        assert_eq!(json["findings"][0]["severity"], "warning");
        assert_eq!(json["findings"][1]["kind"], "reading");
        assert_eq!(json["closure"]["enclosure"], "leaking");
    }
}
