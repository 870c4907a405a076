//! The commands, each from its settings to its result.

use std::path::Path;

use lumel::output::camera_matrices::CameraMatrices;
use lumel::output::csv;
use lumel::output::picture::{Picture, Quantity, write_picture};
use lumel::render::{self, RenderOptions};
use lumel::{Error, Monitor, Result, probe, reference};

use super::args::{Cli, Command};
use super::progress::Progress;
use super::session::Session;
use super::settings::{InspectSettings, ProbeSettings, ReferenceSettings, RenderSettings};
use super::{console, inspect, interrupt, reference_text, view};

/// Does what was typed.
pub fn run(cli: Cli) -> Result<()> {
    interrupt::listen()?;
    match cli.command {
        Command::Inspect(args) => inspect(&InspectSettings::new(args)?),
        Command::Render(args) => render(&RenderSettings::new(args)?),
        Command::Probe(args) => probe(&ProbeSettings::new(args)?),
        Command::Reference(args) => tables(&ReferenceSettings::new(args)),
    }
}

fn inspect(settings: &InspectSettings) -> Result<()> {
    let path = settings.scene.path.as_path();
    let mut session =
        Session::begin("inspect", path, &[], None, settings.described(), &settings.run)?;
    let progress = Progress::new(settings.run.quiet);
    let tell = |stage, done, total| progress.hear(stage, done, total);
    let monitor = Monitor::new(interrupt::flag(), settings.run.time_limit, &tell);

    let scene = session.read(&settings.scene, &monitor)?;
    let view = view::choose(&scene, &settings.view)?;
    let forecast = session.forecast(&scene, &settings.solve)?;
    let description = session.clock.time("describe", || inspect::describe(&scene, &view, forecast));
    progress.clear();
    let text = if settings.json {
        let json = serde_json::to_string_pretty(&description);
        json.map_err(|e| Error::Runtime(format!("no JSON can be made: {e}")))? + "\n"
    } else {
        description.to_text()
    };
    console::print(&text)?;
    session.finish()
}

fn render(settings: &RenderSettings) -> Result<()> {
    let path = settings.scene.path.as_path();
    let output = settings.output.as_path();
    let mut session =
        Session::begin("render", path, &[], Some(output), settings.described(), &settings.run)?;
    let progress = Progress::new(settings.run.quiet);
    let tell = |stage, done, total| progress.hear(stage, done, total);
    let monitor = Monitor::new(interrupt::flag(), settings.run.time_limit, &tell);

    let scene = session.read(&settings.scene, &monitor)?;
    progress.clear();
    if !settings.run.quiet {
        console::print_warnings(&scene.notices);
    }
    let view = view::choose(&scene, &settings.view)?;
    let light = session.light(&scene, &settings.solve, &monitor)?;
    let options = RenderOptions {
        width: view.width,
        height: view.height,
        samples: settings.samples,
        gather: settings.gather,
    };
    let pixels = session
        .clock
        .time("render", || render::render(&scene, &light, &view.camera, &options, &monitor))?;
    let mut metadata = settings.metadata();
    metadata.push(("view".into(), view.camera.name.clone()));
    let aspect = f64::from(view.width) / f64::from(view.height);
    let picture = Picture {
        width: view.width,
        height: view.height,
        pixels,
        quantity: Quantity::Radiance,
        metadata,
        camera: Some(CameraMatrices::of(&view.camera, aspect)),
    };
    session.clock.time("write", || write_picture(output, &picture, &settings.picture))?;
    progress.clear();
    session.finish()
}

fn probe(settings: &ProbeSettings) -> Result<()> {
    let path = settings.scene.path.as_path();
    let inputs = [settings.points.as_path()];
    let output = settings.output.as_deref();
    let mut session =
        Session::begin("probe", path, &inputs, output, settings.described(), &settings.run)?;
    let progress = Progress::new(settings.run.quiet);
    let tell = |stage, done, total| progress.hear(stage, done, total);
    let monitor = Monitor::new(interrupt::flag(), settings.run.time_limit, &tell);

    // The points first: a mistake in them is found before the scene is read.
    let points = csv::read_points(&settings.points)?;
    session.report.count("points", points.len());
    let scene = session.read(&settings.scene, &monitor)?;
    progress.clear();
    if !settings.run.quiet {
        console::print_warnings(&scene.notices);
    }
    let light = session.light(&scene, &settings.solve, &monitor)?;
    let results =
        session.clock.time("probe", || probe::probe(&scene, &light, &points, &monitor))?;
    progress.clear();
    match output {
        Some(path) => csv::write_results(path, &points, &results)?,
        None => console::print(&csv::format_results(&points, &results))?,
    }
    session.finish()
}

fn tables(settings: &ReferenceSettings) -> Result<()> {
    let paper = Path::new("Atkinson and Chien 2006");
    let mut session =
        Session::begin("reference", paper, &[], None, settings.described(), &settings.run)?;
    let progress = Progress::new(settings.run.quiet);
    let tell = |stage, done, total| progress.hear(stage, done, total);
    let monitor = Monitor::new(interrupt::flag(), settings.run.time_limit, &tell);
    // JSON lines go out as they are found: a long run shows what it has.
    let mut printed = Ok(());
    let rows = session.clock.time("reference", || {
        reference::run(&settings.options, &monitor, &mut |row| {
            if settings.json && printed.is_ok() {
                progress.clear();
                printed = reference_text::json_line(row).and_then(|line| console::print(&line));
            }
        })
    })?;
    progress.clear();
    printed?;
    if !settings.json {
        console::print(&reference_text::tables(&rows))?;
    }
    session.finish()
}
