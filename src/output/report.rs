//! The report of a run: what was done, how long it took, how good the result is.
//!
//! A [`Report`] is filled by whoever runs the stages and written as JSON. Names in its maps are
//! sorted; a number that is not finite is written as `null`. Times and memory differ from run to
//! run; everything else depends on the input alone.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use crate::error::{Error, Result};
use crate::output::{atomic, machine};
use crate::scene::Notice;

/// Everything that is worth knowing about a run.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Name of the program.
    pub program: &'static str,
    /// Its version.
    pub version: &'static str,
    /// The command that was run, such as `render`.
    pub command: String,
    /// The scene file, as it was named.
    pub scene: PathBuf,
    /// Settings by name, as they were understood.
    pub settings: BTreeMap<String, String>,
    /// What was done, in order, and how long it took.
    pub stages: Vec<StageTime>,
    /// Whole numbers by name: faces, elements, iterations, rare branches taken.
    pub counts: BTreeMap<String, u64>,
    /// Other numbers by name: residuals, shares of light, bytes.
    pub values: BTreeMap<String, f64>,
    /// What was odd in the input and what was made of it.
    pub notices: Vec<NoticeEntry>,
}

/// The time that a stage took.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StageTime {
    /// Its name.
    pub name: String,
    /// Seconds on the wall clock.
    pub wall_seconds: f64,
    /// Processor seconds of all threads, to 0.01 s; none where the system does not tell.
    pub cpu_seconds: Option<f64>,
}

/// A [`Notice`] of the scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NoticeEntry {
    /// The object, material or file part that it is about.
    pub about: String,
    /// What was found and what was made of it.
    pub text: String,
    /// How often it occurred.
    pub count: usize,
}

impl Report {
    /// An empty report of `command` on `scene`.
    pub fn new(command: &str, scene: &Path) -> Report {
        Report {
            program: env!("CARGO_PKG_NAME"),
            version: env!("CARGO_PKG_VERSION"),
            command: command.into(),
            scene: scene.to_path_buf(),
            settings: BTreeMap::new(),
            stages: Vec::new(),
            counts: BTreeMap::new(),
            values: BTreeMap::new(),
            notices: Vec::new(),
        }
    }

    /// Notes a whole number.
    pub fn count(&mut self, name: &str, value: usize) {
        self.counts.insert(name.into(), value as u64);
    }

    /// Notes a number.
    pub fn value(&mut self, name: &str, value: f64) {
        self.values.insert(name.into(), value);
    }

    /// Notes one number for each channel, as `NAME_r`, `NAME_g` and `NAME_b`.
    pub fn channels(&mut self, name: &str, values: [f64; 3]) {
        for (channel, value) in ["r", "g", "b"].into_iter().zip(values) {
            self.value(&format!("{name}_{channel}"), value);
        }
    }

    /// Notes what was odd in a scene.
    pub fn add_notices(&mut self, notices: &[Notice]) {
        self.notices.extend(notices.iter().map(|notice| NoticeEntry {
            about: notice.about.clone(),
            text: notice.text.clone(),
            count: notice.count,
        }));
    }

    /// The report as JSON text. The peak of memory so far is noted as `peak_memory_bytes` where
    /// the system tells it.
    pub fn to_json(&self) -> Result<String> {
        let mut complete = self.clone();
        if let Some(bytes) = machine::peak_memory() {
            complete.value("peak_memory_bytes", bytes as f64);
        }
        let mut text = serde_json::to_string_pretty(&complete)
            .map_err(|e| Error::Runtime(format!("the report cannot be written as JSON: {e}")))?;
        text.push('\n');
        Ok(text)
    }

    /// Writes the report to a file, whole or not at all.
    pub fn write(&self, path: &Path) -> Result<()> {
        atomic::write_whole(path, self.to_json()?.as_bytes())
    }
}

/// Times the stages of a run.
#[derive(Debug, Default)]
pub struct StageClock {
    stages: Vec<StageTime>,
}

impl StageClock {
    /// A clock that has timed nothing.
    pub fn new() -> StageClock {
        StageClock::default()
    }

    /// Does `work` and notes how long it took under `name`. Stages do not nest; the same name
    /// twice is two stages.
    pub fn time<T>(&mut self, name: &str, work: impl FnOnce() -> T) -> T {
        let cpu_before = machine::cpu_seconds();
        let start = Instant::now();
        let result = work();
        let wall_seconds = start.elapsed().as_secs_f64();
        let cpu_seconds = machine::cpu_seconds().zip(cpu_before).map(|(end, start)| end - start);
        self.stages.push(StageTime { name: name.into(), wall_seconds, cpu_seconds });
        result
    }

    /// The stages timed, in order.
    pub fn stages(&self) -> &[StageTime] {
        &self.stages
    }

    /// The stages timed, in order, for a report.
    pub fn into_stages(self) -> Vec<StageTime> {
        self.stages
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_json_holds_what_was_noted() {
        let mut clock = StageClock::new();
        let answer = clock.time("read", || 42);
        let mut report = Report::new("probe", Path::new("scene.obj"));
        report.settings.insert("basis".into(), "linear".into());
        report.count("faces", answer);
        report.channels("residual", [1e-9, f64::NAN, 0.1]);
        report.add_notices(&[Notice { about: "m".into(), text: "odd".into(), count: 3 }]);
        report.stages = clock.into_stages();

        let json: serde_json::Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
        assert_eq!(json["program"], "lumel");
        assert_eq!(json["command"], "probe");
        assert_eq!(json["scene"], "scene.obj");
        assert_eq!(json["settings"]["basis"], "linear");
        assert_eq!(json["counts"]["faces"], 42);
        assert_eq!(json["values"]["residual_b"], 0.1);
        assert!(json["values"]["residual_g"].is_null());
        assert_eq!(json["notices"][0]["count"], 3);
        assert_eq!(json["stages"][0]["name"], "read");
        assert!(json["stages"][0]["wall_seconds"].as_f64().unwrap() >= 0.0);
    }

    #[test]
    fn a_report_is_written_whole() {
        let room = tempfile::tempdir().unwrap();
        let path = room.path().join("report.json");
        Report::new("inspect", Path::new("s.gltf")).write(&path).unwrap();
        let json: serde_json::Value =
            serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(json["scene"], "s.gltf");
    }
}
