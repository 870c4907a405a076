//! What comes after reading, as cheaply as can be: the checks that `lumel inspect` and `probe` would
//! be the first to fail.

use std::sync::atomic::AtomicBool;

use glam::DVec3;
use lumel::bake::second_sets;
use lumel::cluster::Clusters;
use lumel::operator::{FastOptions, Operator, OperatorKind, Stage};
use lumel::output::csv::Point;
use lumel::output::machine;
use lumel::scene::{self, MAX_REFLECTANCE, Scene};
use lumel::solve::within::COARSEST;
use lumel::solve::{WithinOptions, light_within};
use lumel::visibility::Occluders;
use lumel::{Error, Monitor, audit, mesh, probe};

/// Most triangles of a scene that is meshed, and of one that is audited and solved: the rest of
/// those that get so far differ in nothing that costs would be worth.
const MESHED: usize = 2000;
const SOLVED: usize = 48;

/// Seconds for the audit, and again for the solution.
const SECONDS: f64 = 2.0;

/// Bytes that a solution may take, and what it may take beside that, as the README states.
const ALLOWED: u64 = 64 << 20;
const MEMORY_BESIDE: u64 = 64 << 20;

/// Of so many files that can be read one is solved, and one is audited: it takes hundreds of times
/// as long as to read one. Which ones follows from their bytes, so that what is found is found again.
const SOLVED_OF: u64 = 32;
const AUDITED_OF: u64 = 256;

/// A number that follows from bytes (FNV-1a).
pub fn number_of(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |h, &b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
}

/// What every scene that is read must be.
pub fn check(scene: &Scene) {
    assert!(!scene.triangles.is_empty());
    for (i, t) in scene.triangles.iter().enumerate() {
        assert!(t.vertices.iter().all(|p| p.is_finite()), "a corner is not finite");
        assert!(t.uv.iter().flatten().all(|x| x.is_finite()), "texture coordinates are not finite");
        let (normal, area) = t.normal_and_area();
        assert!(area >= 0.0 && normal.is_finite(), "area {area}, normal {normal}");
        assert!((t.material as usize) < scene.materials.len());
        assert!((t.object as usize) < scene.objects.len());
        let whole = [DVec3::X, DVec3::Y, DVec3::Z];
        let (rho, e) = (scene::reflectance(scene, i, &whole), scene::exitance(scene, i, &whole));
        assert!(rho.min_element() >= 0.0 && rho.max_element() <= MAX_REFLECTANCE, "{rho}");
        assert!(e.min_element() >= 0.0 && e.is_finite(), "{e}");
    }
    for camera in &scene.cameras {
        assert!(camera.eye.is_finite() && (camera.forward.length() - 1.0).abs() < 1e-6);
    }
    let camera = scene::default_camera(scene);
    assert!(camera.eye.is_finite() && camera.forward.is_finite(), "{camera:?}");
}

/// A refusal to read: it names the file and is not short of words.
pub fn refused(error: &Error, file: &str) {
    let message = error.to_string();
    if !matches!(error, Error::Memory { .. }) {
        assert!(message.contains(file), "no file is named: {message}");
        assert_eq!(error.exit_code(), 3, "{message}");
    }
    assert!(message.len() > file.len() + 20, "too short: {message}");
}

/// Meshes a scene, and audits and solves it where it is small and `number` says so. A refusal is an
/// answer; values that are no numbers are not.
pub fn use_scene(scene: &Scene, number: u64) {
    check(scene);
    if scene.triangles.len() > MESHED {
        return;
    }
    let Ok(mesh) = mesh::build(scene, &COARSEST) else { return };
    for set in second_sets(scene) {
        assert!((set.object as usize) < scene.objects.len());
    }
    if scene.triangles.len() > SOLVED {
        return;
    }
    let never = AtomicBool::new(false);
    let nobody = |_: &'static str, _: u64, _: u64| {};
    let monitor = Monitor::new(&never, Some(SECONDS), &nobody);
    if number.is_multiple_of(SOLVED_OF) {
        forecast(scene, &mesh);
        solve(scene, &monitor);
    }
    if number.is_multiple_of(AUDITED_OF) {
        match audit::audit(scene, &scene.notices, &monitor) {
            Ok(audit) => {
                assert!(audit.row_sums.largest.is_finite());
                let closed = audit.closure.mean;
                assert!((0.0..=1.0 + 1e-9).contains(&closed), "{closed}");
            }
            Err(error) => answer(&error),
        }
    }
}

/// What `inspect` says of memory.
fn forecast(scene: &Scene, mesh: &mesh::Mesh) {
    let triangles: Vec<_> = scene.triangles.iter().map(|t| t.vertices).collect();
    let occluders = Occluders::build(&triangles);
    let clusters = Clusters::build(mesh);
    let stage = Stage { mesh, clusters: &clusters, occluders: &occluders };
    let options = FastOptions::new(1e-2, None, None).expect("these options are good ones");
    assert!(Operator::forecast(stage, OperatorKind::Fast(options)) < 1 << 40);
}

/// Solves coarsely, and probes the middles of the first triangles.
fn solve(scene: &Scene, monitor: &Monitor) {
    let middle = |t: &scene::Triangle| {
        let normal = t.normal_and_area().0.try_normalize()?;
        Some(Point { position: t.vertices.iter().sum::<DVec3>() / 3.0, normal })
    };
    let points: Vec<Point> = scene.triangles.iter().take(3).filter_map(middle).collect();
    let before = machine::peak_memory().unwrap_or(0);
    let results = light_within(scene, &WithinOptions::new(0.3, ALLOWED), monitor)
        .and_then(|light| probe::probe(scene, &light, &points, monitor));
    let grown = machine::peak_memory().unwrap_or(0).saturating_sub(before);
    assert!(grown <= ALLOWED + MEMORY_BESIDE, "{grown} bytes of memory, {ALLOWED} are allowed");
    match results {
        Ok(results) => {
            for h in results.iter().filter_map(|r| r.irradiance) {
                assert!(h.is_finite(), "irradiance {h}");
            }
        }
        Err(error) => answer(&error),
    }
}

/// A refusal to work on a scene that was read.
fn answer(error: &Error) {
    assert!((1..=4).contains(&error.exit_code()) && error.to_string().len() > 20, "{error}");
}
