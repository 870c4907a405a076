//! The commands, each from its settings to its result.

use std::path::Path;

use lumel::audit::Severity;
use lumel::output::camera_matrices::CameraMatrices;
use lumel::output::csv;
use lumel::output::export::write_export;
use lumel::output::picture::{Picture, Quantity, write_picture};
use lumel::render::{self, RenderOptions};
use lumel::scene::Notice;
use lumel::{Error, Monitor, Result, audit, probe, reference};

use super::advice::{advice_of_light, darkness};
use super::args::{Cli, Command};
use super::audit_text::AuditBlock;
use super::bake_settings::BakeSettings;
use super::progress::Progress;
use super::session::Session;
use super::settings::{InspectSettings, ProbeSettings, ReferenceSettings, RenderSettings};
use super::{
    audit_text, bake, console, inspect, interrupt, outcome, reference_text, shell, sight, view,
};

/// Does what was typed.
pub fn run(cli: Cli) -> Result<()> {
    interrupt::listen()?;
    match cli.command {
        Command::Inspect(args) => inspect(&InspectSettings::new(args)?),
        Command::Render(args) => render(&RenderSettings::new(args)?),
        Command::Bake(args) => bake::bake(&BakeSettings::new(args)?),
        Command::Probe(args) => probe(&ProbeSettings::new(args)?),
        Command::Reference(args) => tables(&ReferenceSettings::new(args)),
        Command::Completions(args) => console::print(&shell::completions(args.shell)),
        Command::Manual(args) => console::print(&shell::manual(args.command.as_deref())?),
    }
}

fn inspect(settings: &InspectSettings) -> Result<()> {
    let path = settings.scene.path.as_path();
    let outputs: Vec<&Path> = settings.export.as_deref().into_iter().collect();
    let mut session =
        Session::begin("inspect", path, &[], &outputs, settings.described(), &settings.run)?;
    let progress = Progress::new(settings.run.quiet, settings.run.time_limit);
    let tell = |stage, done, total| progress.hear(stage, done, total);
    let monitor = Monitor::new(interrupt::flag(), settings.run.time_limit, &tell);

    let mut scene = session.read(&settings.scene, &monitor)?;
    let view = view::choose(&scene, &settings.view)?;
    // Shown with what else is odd about the scene.
    let blind = sight::advice(&scene, &view);
    session.report.add_notices(blind.as_slice());
    scene.notices.extend(blind);
    let forecast = session.forecast(&scene, &settings.solve)?;
    let mut description =
        session.clock.time("describe", || inspect::describe(&scene, &view, forecast));
    if settings.audit {
        // That there is no light the audit finds for itself.
        let own = darkness(&scene, settings.scene.options.light_scale);
        let notices: Vec<Notice> =
            scene.notices.iter().filter(|n| !own.contains(n)).cloned().collect();
        let audit = session.clock.time("audit", || audit::audit(&scene, &notices, &monitor))?;
        for severity in [Severity::Error, Severity::Warning, Severity::Note] {
            session.report.count(audit_text::name(severity), audit.count(severity));
        }
        description.add_audit(AuditBlock::new(&audit));
    }
    if let Some(path) = &settings.export {
        let size = (view.width, view.height);
        session.clock.time("write", || write_export(path, &scene, &view.camera, size))?;
    }
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
    let outputs: Vec<&Path> = [output].into_iter().chain(settings.error_map.as_deref()).collect();
    let mut session =
        Session::begin("render", path, &[], &outputs, settings.described(), &settings.run)?;
    let progress = Progress::new(settings.run.quiet, settings.run.time_limit);
    let tell = |stage, done, total| progress.hear(stage, done, total);
    let monitor = Monitor::new(interrupt::flag(), settings.run.time_limit, &tell);

    let scene = session.read(&settings.scene, &monitor)?;
    progress.clear();
    if !settings.run.quiet {
        console::print_warnings(&scene.notices);
    }
    let view = view::choose(&scene, &settings.view)?;
    session.warn(sight::advice(&scene, &view).as_slice());
    let light = session.light(&scene, &settings.solve, &monitor)?;
    progress.clear();
    session.warn(&advice_of_light(&scene, &light));
    let monitor = outcome::for_output(monitor, &tell);
    let options = RenderOptions {
        width: view.width,
        height: view.height,
        samples: settings.samples,
        gather: settings.gather,
    };
    let (pixels, gathered, hurried) = session.clock.time("render", || {
        outcome::drawn(&options, &monitor, &tell, |options, monitor| {
            render::render(&scene, &light, &view.camera, options, monitor)
        })
    })?;
    let hurried = hurried.then_some("the picture is coarse, with an eighth of the pixels each way");
    session.gathered(&light, &gathered.counts, gathered.against);
    let mut metadata = settings.metadata();
    metadata.push(("view".into(), view.camera.name.clone()));
    if let Some(source) = light.apart() {
        let error = source.estimate.rms.hypot(gathered.error());
        metadata.push(("estimated error".into(), format!("{error:.2e}")));
        metadata.extend(source.shortfall.iter().map(|why| ("shortfall".into(), why.clone())));
    }
    metadata.extend(hurried.map(|what| ("hurried".into(), what.into())));
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
    if let Some(path) = &settings.error_map {
        let (pixels, ..) = session.clock.time("error map", || {
            outcome::drawn(&options, &monitor, &tell, |options, monitor| {
                let map = render::error_map(&scene, &light, &view.camera, options, monitor);
                map.map(|pixels| (pixels, ()))
            })
        })?;
        let map = Picture { pixels, quantity: Quantity::RelativeError, ..picture };
        session.clock.time("write", || write_picture(path, &map, &settings.picture))?;
    }
    progress.clear();
    session.finish()?;
    let filled = gathered.error();
    outcome::met(&light, filled, hurried)
}

fn probe(settings: &ProbeSettings) -> Result<()> {
    let path = settings.scene.path.as_path();
    let inputs = [settings.points.as_path()];
    let output = settings.output.as_deref();
    let outputs: Vec<&Path> = output.into_iter().collect();
    let mut session =
        Session::begin("probe", path, &inputs, &outputs, settings.described(), &settings.run)?;
    let progress = Progress::new(settings.run.quiet, settings.run.time_limit);
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
    progress.clear();
    session.warn(&advice_of_light(&scene, &light));
    let monitor = outcome::for_output(monitor, &tell);
    let results =
        session.clock.time("probe", || probe::probe(&scene, &light, &points, &monitor))?;
    progress.clear();
    let unknown = results.iter().filter(|result| result.irradiance.is_none()).count();
    session.report.count("points without values", unknown);
    if unknown > 0 && unknown == points.len() {
        monitor.check()?;
    }
    match output {
        Some(path) => csv::write_results(path, &points, &results)?,
        None => console::print(&csv::format_results(&points, &results))?,
    }
    session.finish()?;
    let hurried = format!("{unknown} of {} points have no values", points.len());
    outcome::met(&light, 0.0, (unknown > 0).then_some(hurried.as_str()))
}

fn tables(settings: &ReferenceSettings) -> Result<()> {
    let paper = Path::new("Atkinson and Chien 2006");
    let mut session =
        Session::begin("reference", paper, &[], &[], settings.described(), &settings.run)?;
    let progress = Progress::new(settings.run.quiet, settings.run.time_limit);
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
