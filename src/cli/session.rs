//! What every command does around its own work: checks of the outputs before it, clocks and the
//! report beside it.

use std::path::{Path, PathBuf};

use glam::DVec3;
use lumel::output::atomic::{check_writable, same_file};
use lumel::output::report::{Report, StageClock};
use lumel::reconstruct::irradiance::IrradianceCounts;
use lumel::scene::{self, Notice, Scene};
use lumel::solve::light::{self, Light};
use lumel::solve::{WithinOptions, light_within};
use lumel::{Error, Monitor, Result};

use super::advice::advice;
use super::console;
use super::forecast::Forecast;
use super::settings::{Described, RunSettings, SceneSettings, SolveSettings};

/// One run of a command.
pub struct Session {
    /// Times the stages.
    pub clock: StageClock,
    /// What is known about the run so far; stages are added at the end.
    pub report: Report,
    report_path: Option<PathBuf>,
    /// All files that will be written, as far as they are known at the beginning.
    targets: Vec<PathBuf>,
    quiet: bool,
}

impl Session {
    /// Begins a command: fails early where its `outputs` or the report could not be written, and
    /// sets the number of threads. The scene and `inputs` must not be overwritten.
    pub fn begin(
        command: &str,
        scene: &Path,
        inputs: &[&Path],
        outputs: &[&Path],
        settings: Described,
        run: &RunSettings,
    ) -> Result<Session> {
        let inputs = [&[scene], inputs].concat();
        let report_path = run.report.as_deref();
        let targets: Vec<&Path> = outputs.iter().copied().chain(report_path).collect();
        for (k, target) in targets.iter().enumerate() {
            check_writable(target, &inputs)?;
            if let Some(twin) = targets[..k].iter().find(|other| same_file(other, target)) {
                return Err(Error::Usage(format!(
                    "two outputs are the same file, {} and {}; give them different names",
                    twin.display(),
                    target.display()
                )));
            }
        }
        if let Some(threads) = run.threads {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build_global()
                .map_err(|e| Error::Runtime(format!("{threads} threads cannot be had: {e}")))?;
        }
        let mut report = Report::new(command, scene);
        report.settings = settings.into_iter().collect();
        Ok(Session {
            clock: StageClock::new(),
            report,
            targets: targets.into_iter().map(Path::to_path_buf).collect(),
            report_path: run.report.clone(),
            quiet: run.quiet,
        })
    }

    /// Notes what was odd, and says it unless that is unwanted.
    pub fn warn(&mut self, notices: &[Notice]) {
        self.report.add_notices(notices);
        if !self.quiet {
            console::print_warnings(notices);
        }
    }

    /// Reads the scene and notes what was found, and what it lacks.
    pub fn read(&mut self, settings: &SceneSettings, monitor: &Monitor) -> Result<Scene> {
        let stage = monitor.stage("read", 1);
        let mut scene =
            self.clock.time("read", || scene::read(&settings.path, &settings.options))?;
        // Which files are its buffers, images and materials is known only now.
        let files: Vec<&Path> = scene.files.iter().map(PathBuf::as_path).collect();
        self.targets.iter().try_for_each(|target| check_writable(target, &files))?;
        // What concerns the whole scene comes first.
        scene.notices.splice(0..0, advice(&scene, settings.options.light_scale));
        stage.advance(1)?;
        self.report.count("objects", scene.objects.len());
        self.report.count("faces", scene.triangles.len());
        self.report.count("materials", scene.materials.len());
        self.report.count("cameras", scene.cameras.len());
        self.report.count("overlaps in one plane", scene.overlaps.pairs);
        self.report.count("faces cut where they overlap", scene.overlaps.cut);
        self.report.count("faces covered by others", scene.overlaps.covered);
        self.report.count("faces with overlaps left", scene.overlaps.left);
        self.report.add_notices(&scene.notices);
        Ok(scene)
    }

    /// Forecasts what solving the scene takes.
    pub fn forecast(&mut self, scene: &Scene, settings: &SolveSettings) -> Result<Forecast> {
        let forecast = self.clock.time("forecast", || Forecast::new(scene, settings))?;
        self.report.count("elements", forecast.elements);
        self.report.count("nodes", forecast.nodes);
        self.report.value("operator bytes forecast", forecast.operator_bytes as f64);
        Ok(forecast)
    }

    /// Solves the scene and notes how it went.
    pub fn light(
        &mut self,
        scene: &Scene,
        settings: &SolveSettings,
        monitor: &Monitor,
    ) -> Result<Light> {
        let light = self.clock.time("solve", || match settings.tolerance {
            Some(tolerance) => {
                let max_memory = settings.max_memory.unwrap_or(u64::MAX);
                light_within(scene, &WithinOptions::new(tolerance, max_memory), monitor)
            }
            None => light::light(scene, &settings.light_options(), monitor),
        })?;
        let report = &mut self.report;
        if let Some(source) = light.apart() {
            let estimate = source.estimate;
            report.count("meshes solved on", estimate.steps as usize);
            report.value("estimated error rms", estimate.rms);
            report.value("estimated error maximum", estimate.maximum);
            report.channels("mean irradiance", estimate.mean.to_array());
            if let Some(rays) = &source.rays {
                report.value("share of irradiance that rays estimate", rays.share);
                report.value("estimated error of rays rms", rays.error);
            }
        }
        let contacts = light.mesh.contacts;
        report.count("faces cut at contacts", contacts.cut);
        report.count("segments of contacts", contacts.segments);
        report.count("faces cut at longer contacts only", contacts.simplified);
        report.count("faces with contacts left whole", contacts.left_whole);
        report.count("roots", light.mesh.roots.len());
        report.count("elements", light.mesh.elements());
        report.count("nodes", light.mesh.nodes());
        report.count("occluders", light.occluders.len());
        report.count("iterations", light.solution.iterations);
        report.count("operator entries", light.entries);
        for (name, count) in &light.counts {
            report.count(name, *count as usize);
        }
        for (name, seconds) in &light.seconds {
            report.value(name, *seconds);
        }
        report.value("operator bytes", light.bytes as f64);
        if let Some(bytes) = light.forecast {
            report.value("operator bytes forecast", bytes as f64);
        }
        report.value("smallest row sum", light.row_sums.0);
        report.value("largest row sum", light.row_sums.1);
        report.channels("residual", light.solution.residual.to_array());
        Ok(light)
    }

    /// Notes how much was gathered for the output, with errors relative to the irradiance `mean`.
    pub fn gathered(&mut self, light: &Light, counts: &IrradianceCounts, mean: DVec3) {
        let report = &mut self.report;
        report.count("points", counts.direct.points as usize);
        report.count("gathers of direct light", counts.direct.gathered as usize);
        report.count("gathers of indirect light", counts.indirect.gathered as usize);
        if let Some(source) = light.apart() {
            let filled = counts.error(mean);
            report.value("estimated error of filling in", filled);
            report.value("estimated error of the output rms", source.estimate.rms.hypot(filled));
            let largest = counts.largest_error(mean);
            report
                .value("estimated error of the output maximum", source.estimate.maximum + largest);
        }
    }

    /// Ends the command: writes the report where one was asked for.
    pub fn finish(mut self) -> Result<()> {
        self.report.stages = self.clock.into_stages();
        match &self.report_path {
            Some(path) => self.report.write(path),
            None => Ok(()),
        }
    }
}
