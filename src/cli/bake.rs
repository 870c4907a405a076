//! `lumel bake`: from its settings to its files.

use std::path::Path;

use glam::DVec3;
use lumel::bake::files::{self, FileOptions, Files};
use lumel::bake::vertices::{VertexOptions, vertex_light};
use lumel::bake::{Atlas, LightmapOptions, bake_lightmaps, make_atlas, wanted};
use lumel::output::atomic::{check_writable, write_together};
use lumel::reconstruct::irradiance::IrradianceCounts;
use lumel::scene::{Notice, Scene};
use lumel::solve::Light;
use lumel::{Error, Monitor, Result};

use super::advice::advice_of_light;
use super::args::ToArg;
use super::bake_settings::BakeSettings;
use super::progress::Progress;
use super::session::Session;
use super::{console, interrupt, outcome};

/// Error of light between vertices where the solution was not made to a tolerance.
const USUAL_ERROR: f64 = 0.01;

/// Does what was typed.
pub fn bake(settings: &BakeSettings) -> Result<()> {
    let path = settings.scene.path.as_path();
    let output = settings.output.as_path();
    let pages = usize::from(settings.to == ToArg::Lightmap);
    let names = files::names(output, pages, settings.format)?;
    let outputs: Vec<&Path> = names.iter().map(|name| name.as_path()).collect();
    let mut session =
        Session::begin("bake", path, &[], &outputs, settings.described(), &settings.run)?;
    let progress = Progress::new(settings.run.quiet, settings.run.time_limit);
    let tell = |stage, done, total| progress.hear(stage, done, total);
    let monitor = Monitor::new(interrupt::flag(), settings.run.time_limit, &tell);
    let warn = |notices: &[Notice]| {
        progress.clear();
        if !settings.run.quiet {
            console::print_warnings(notices);
        }
    };

    let scene = session.read(&settings.scene, &monitor)?;
    warn(&scene.notices);
    // Mistakes in names and sizes are found before the scene is solved.
    let wanted = wanted(&scene, &settings.atlas.only)?;
    let atlas = match settings.to {
        ToArg::Lightmap => Some(atlas(settings, &scene, &mut session)?),
        ToArg::Vertices => None,
    };
    if let Some(atlas) = &atlas {
        warn(&atlas.notices);
    }
    let light = session.light(&scene, &settings.solve, &monitor)?;
    progress.clear();
    session.warn(&advice_of_light(&scene, &light));
    let monitor = outcome::for_output(monitor, &tell);
    // What it takes from now on does not depend on how fine it is by much.
    let last = outcome::without_limit(&tell);
    let bake = |settings, atlas: Option<&Atlas>, session: &mut Session, monitor| match atlas {
        Some(atlas) => to_lightmaps(settings, &scene, &light, atlas, session, (monitor, &last)),
        None => to_vertices(settings, &scene, &light, &wanted, session, monitor),
    };
    let baked = bake(settings, atlas.as_ref(), &mut session, &monitor);
    let hurried = matches!(baked, Err(Error::TimeLimit(_)));
    let (files, counts) = match (hurried, &atlas) {
        (false, _) => baked?,
        (true, None) => bake(&settings.coarse(1), None, &mut session, &last)?,
        (true, Some(_)) => {
            let (coarse, atlas) = coarse_atlas(settings, &scene, &mut session)?;
            bake(&coarse, Some(&atlas), &mut session, &last)?
        }
    };
    warn(&files.notices);
    session.report.add_notices(&files.notices);
    if let Some(ev) = files.exposure_ev {
        session.report.value("exposure", ev);
    }
    session.clock.time("write", || write_together(&files.list, || last.check()))?;
    progress.clear();
    session.finish()?;
    let what = match settings.to {
        ToArg::Lightmap => "lightmaps are coarse, with down to an eighth of the texels each way",
        ToArg::Vertices => "triangles were not refined",
    };
    outcome::met(&light, filled(&light, &counts), hurried.then_some(what))
}

/// The layout of lightmaps; also makes sure that all of them can be written.
fn atlas(settings: &BakeSettings, scene: &Scene, session: &mut Session) -> Result<Atlas> {
    let atlas = session.clock.time("atlas", || make_atlas(scene, &settings.atlas))?;
    let inputs: Vec<&Path> = scene.files.iter().map(|file| file.as_path()).collect();
    for name in files::names(&settings.output, atlas.pages.len(), settings.format)? {
        check_writable(&name, &inputs)?;
    }
    session.report.count("pages", atlas.pages.len());
    session.report.count("charts", atlas.charts.len());
    session.report.count("faces baked", atlas.page.iter().flatten().count());
    session.report.add_notices(&atlas.notices);
    Ok(atlas)
}

/// A layout with an eighth of the texels in each direction, or as few as all charts fit on.
fn coarse_atlas(
    settings: &BakeSettings,
    scene: &Scene,
    session: &mut Session,
) -> Result<(BakeSettings, Atlas)> {
    let mut coarser = outcome::COARSER;
    loop {
        let coarse = settings.coarse(coarser);
        match atlas(&coarse, scene, session) {
            Err(Error::Usage(_)) if coarser > 1 => coarser /= 2,
            made => return made.map(|atlas| (coarse, atlas)),
        }
    }
}

fn to_lightmaps(
    settings: &BakeSettings,
    scene: &Scene,
    light: &Light,
    atlas: &Atlas,
    session: &mut Session,
    (monitor, last): (&Monitor, &Monitor),
) -> Result<(Files, IrradianceCounts)> {
    let (maps, counts) = session.clock.time("bake", || {
        bake_lightmaps(scene, light, atlas, &LightmapOptions::default(), monitor)
    })?;
    session.gathered(light, &counts.irradiance, mean(light));
    session.report.count("texels", atlas.pages.iter().map(|p| (p.width * p.height) as usize).sum());
    session.report.count("texels covered", counts.covered as usize);
    session.report.count("texels refined", counts.refined as usize);
    session.report.count("parts of faces buried", counts.buried as usize);
    let options = file_options(settings, error(light, filled(light, &counts.irradiance)));
    let mut files = session.clock.time("encode", || {
        files::lightmap_files(scene, atlas, &maps, &settings.output, &options, last)
    })?;
    files.notices.splice(0..0, counts.notices);
    Ok((files, counts.irradiance))
}

fn to_vertices(
    settings: &BakeSettings,
    scene: &Scene,
    light: &Light,
    wanted: &[bool],
    session: &mut Session,
    monitor: &Monitor,
) -> Result<(Files, IrradianceCounts)> {
    let tolerance = settings.solve.tolerance.unwrap_or(USUAL_ERROR);
    let options = VertexOptions { tolerance, most: settings.most_triangles };
    let surface =
        session.clock.time("bake", || vertex_light(scene, light, wanted, &options, monitor))?;
    session.gathered(light, &surface.counts, mean(light));
    session.report.count("triangles", surface.triangles.len());
    session.report.count("passes of refinement", surface.passes);
    session.report.value("error between vertices", surface.error);
    let error = error(light, filled(light, &surface.counts)).map(|e| e.hypot(surface.error));
    let mut files = session.clock.time("encode", || {
        let options = file_options(settings, error);
        files::vertex_files(scene, &surface, wanted, &settings.output, &options)
    })?;
    if surface.error > tolerance {
        let text = format!(
            "the error between vertices is {:.2} % of the mean irradiance, more than the {:.2} % asked \
             for: raise --max-triangles, or bake lightmaps",
            100.0 * surface.error,
            100.0 * tolerance
        );
        files.notices.push(Notice { about: "vertices".into(), text, count: 1 });
    }
    Ok((files, surface.counts))
}

fn file_options(settings: &BakeSettings, error: Option<f64>) -> FileOptions {
    FileOptions {
        target: settings.target,
        format: settings.format,
        exposure_ev: settings.exposure_ev,
        layers: settings.layers,
        metadata: settings.metadata(),
        error,
    }
}

/// Error of filling in, relative to the mean irradiance.
fn filled(light: &Light, counts: &IrradianceCounts) -> f64 {
    counts.error(mean(light))
}

/// The mean irradiance of the surface, where it is known.
fn mean(light: &Light) -> DVec3 {
    light.apart().map_or(DVec3::ZERO, |source| source.estimate.mean)
}

/// Estimated error of the irradiance, with that of filling in.
fn error(light: &Light, filled: f64) -> Option<f64> {
    light.apart().map(|source| source.estimate.rms.hypot(filled))
}
