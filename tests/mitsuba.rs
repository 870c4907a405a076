//! Points and views of the shipped scenes against path tracing by Mitsuba: `data/mitsuba_*.json`,
//! which `tools/mitsuba/references.py` makes.
//!
//! A value may be off by four standard errors of the path tracer and by the error that lumel itself
//! reports there: the one of its error map, which tells where, and the root mean square over the
//! surface. Squares of what it is off by, in units of both, must have a mean of at most one, but for
//! four standard deviations of such a mean; and the sums must agree within four standard errors of
//! theirs and the root mean square, so that an error that all places share shows.
//!
//! The path tracer works in float32: its rays start a little above surfaces and end a little
//! before what they are to reach, which brightens penumbrae. How much is in the files, and checked
//! here to be below the standard errors.

use std::path::Path;

use glam::DVec3;
use lumel::Monitor;
use lumel::mesh::barycentric;
use lumel::output::csv::Point;
use lumel::probe::probe;
use lumel::reconstruct::Surface;
use lumel::reconstruct::fill::RootPoints;
use lumel::reconstruct::irradiance::changes;
use lumel::render::{RenderOptions, error_map, render};
use lumel::scene::{ReadOptions, Scene, read};
use lumel::solve::{Light, WithinOptions, light_within};
use serde_json::Value;

/// Standard errors that a value may be off by.
const ERRORS: f64 = 4.0;

/// A value by lumel and by path tracing.
struct Pair {
    /// What it is of, for messages.
    name: String,
    ours: DVec3,
    theirs: DVec3,
    /// Standard error of theirs.
    error: DVec3,
    /// What lumel reports for this place, and root mean square over the surface.
    here: DVec3,
    overall: DVec3,
}

fn vector(v: &Value) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|k| v[k].as_f64().unwrap()))
}

fn vectors(v: &Value) -> Vec<DVec3> {
    v.as_array().unwrap().iter().map(vector).collect()
}

/// The scene and its light, and what was traced there.
fn prepared(name: &str, tolerance: f64) -> (Scene, Light, Value) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join(format!("tests/data/mitsuba_{name}.json")));
    let data: Value = serde_json::from_str(&text.unwrap()).unwrap();
    let path = root.join(data["scene"].as_str().unwrap());
    let scene = read(&path, &ReadOptions::default()).unwrap();
    let options = WithinOptions::new(tolerance, u64::MAX);
    let light = light_within(&scene, &options, &Monitor::silent()).unwrap();
    assert_eq!(light.apart().unwrap().shortfall, None);
    (scene, light, data)
}

/// Errors of the irradiance that lumel reports at points of the surface, W/m^2: its error map.
fn reported(scene: &Scene, light: &Light, points: &[Point]) -> Vec<DVec3> {
    let surface = Surface::new(scene, &light.mesh);
    let within = 1e-6 * scene.extent();
    let asked: Vec<RootPoints> = points
        .iter()
        .map(|p| {
            let foot = surface.at(p.position, p.normal, within).unwrap();
            let roots = light.mesh.faces[foot.face as usize].roots;
            let inside =
                |&r: &u32| barycentric(&light.mesh.roots[r as usize].corners, foot.x).min_element();
            let root = (roots.0..roots.1).max_by(|a, b| inside(a).total_cmp(&inside(b))).unwrap();
            RootPoints { root, points: vec![foot.x] }
        })
        .collect();
    let of_change = light.apart().unwrap().estimate.of_change;
    let changes = changes(light, &asked, &Monitor::silent()).unwrap();
    changes.iter().map(|own| of_change * own[0]).collect()
}

fn pairs_of_points(scene: &Scene, light: &Light, data: &Value) -> Vec<Pair> {
    let entries = data["points"]["entries"].as_array().unwrap();
    assert!(entries.len() >= 50);
    let points: Vec<Point> = entries
        .iter()
        .map(|e| Point { position: vector(&e["position"]), normal: vector(&e["normal"]) })
        .collect();
    let results = probe(scene, light, &points, &Monitor::silent()).unwrap();
    let here = reported(scene, light, &points);
    let estimate = light.apart().unwrap().estimate;
    let pairs = entries.iter().zip(points).zip(results.iter().zip(here));
    pairs
        .map(|((entry, point), (result, here))| Pair {
            name: format!("irradiance at {}", point.position),
            ours: result.irradiance.expect("there is time for all"),
            theirs: vector(&entry["irradiance"]),
            error: vector(&entry["standard_error"]),
            here,
            overall: estimate.rms * estimate.mean,
        })
        .collect()
}

fn pairs_of_view(scene: &Scene, light: &Light, data: &Value) -> Vec<Pair> {
    let view = &data["view"];
    let number = |name: &str| view[name].as_u64().unwrap() as usize;
    let (width, height, across) = (number("width"), number("height"), number("across"));
    let camera = &scene.cameras[0];
    assert_eq!(camera.name, view["camera"].as_str().unwrap());
    // The rays of the file are those through the middles of finer pixels; light is gathered for each.
    let fine = (across * width) as u32;
    let options =
        RenderOptions { width: fine, height: (across * height) as u32, samples: 1, gather: true };
    let monitor = Monitor::silent();
    let (pixels, counts) = render(scene, light, camera, &options, &monitor).unwrap();
    let map = error_map(scene, light, camera, &options, &monitor).unwrap();
    let blocks = |pixels: &[[f32; 3]]| -> Vec<DVec3> {
        let mut sums = vec![DVec3::ZERO; width * height];
        for (k, pixel) in pixels.iter().enumerate() {
            let (x, y) = (k % (across * width) / across, k / (across * width) / across);
            sums[y * width + x] += DVec3::from_array(pixel.map(f64::from));
        }
        sums.into_iter().map(|sum| sum / (across * across) as f64).collect()
    };
    let (pixels, map) = (blocks(&pixels), blocks(&map));
    let estimate = light.apart().unwrap().estimate;
    // Radiance is rho H / pi with rho below 1.
    let unit = estimate.mean / std::f64::consts::PI;
    let overall = estimate.rms.hypot(counts.error()) * unit;
    let traced = vectors(&view["radiance"]).into_iter().zip(vectors(&view["standard_error"]));
    assert_eq!(traced.len(), pixels.len());
    let ours = pixels.iter().zip(&map).enumerate();
    ours.zip(traced)
        .map(|((k, (pixel, map)), (theirs, error))| Pair {
            name: format!("pixel {}, {}", k % width, k / width),
            ours: *pixel,
            theirs,
            error,
            here: *map * unit,
            overall,
        })
        .collect()
}

/// Asserts that values agree; prints how well.
fn compare(what: &str, pairs: &[Pair]) {
    let mut squares = DVec3::ZERO;
    let mut worst: f64 = 0.0;
    for p in pairs {
        let off = (p.ours - p.theirs).abs();
        let allowed = ERRORS * p.error + p.here + p.overall;
        assert!(
            off.cmple(allowed).all(),
            "{what}, {}: {} and not {}; it may be off by {allowed}",
            p.name,
            p.ours,
            p.theirs
        );
        let variance = p.error * p.error + p.overall * p.overall;
        let square = DVec3::select(off.cmpgt(DVec3::ZERO), off * off / variance, DVec3::ZERO);
        squares += square;
        worst = worst.max(square.max_element().sqrt());
    }
    let n = pairs.len() as f64;
    let mean = squares / n;
    let sum = |of: &dyn Fn(&Pair) -> DVec3| pairs.iter().map(of).sum::<DVec3>();
    let theirs = sum(&|p| p.theirs);
    let off = sum(&|p| p.ours) - theirs;
    let error = sum(&|p| p.error * p.error).map(f64::sqrt);
    println!(
        "{what}: {n} values; relative standard errors {:.1e}; sums differ by {:.1e} of them, standard \
         error {:.1e}; mean square {mean:.2} units, largest {worst:.1}",
        (sum(&|p| p.error) / theirs).abs().max_element(),
        (off / theirs).abs().max_element(),
        (error / theirs).abs().max_element(),
    );
    assert!(mean.max_element() <= 1.0 + ERRORS * (2.0 / n).sqrt(), "{what}: {mean}");
    let allowed = ERRORS * error + sum(&|p| p.overall);
    assert!(off.abs().cmple(allowed).all(), "{what}: the sums differ by {off}, not {allowed}");
}

/// Asserts that the path tracer's offsets from surfaces matter less than its standard errors.
fn bound_offsets(data: &Value, pairs: &[Pair]) {
    let farther = &data["points"]["offset_bias"]["ten_times_farther"];
    let number = |name: &str| farther[name].as_f64().unwrap();
    let bias = 0.1 * (number("relative_change").abs() + number("standard_error"));
    let errors: DVec3 = pairs.iter().map(|p| p.error).sum();
    let values: DVec3 = pairs.iter().map(|p| p.theirs).sum();
    assert!(bias <= (errors / values).min_element(), "offsets: {bias}");
}

fn check(name: &str, tolerance: f64) {
    let (scene, light, data) = prepared(name, tolerance);
    let points = pairs_of_points(&scene, &light, &data);
    bound_offsets(&data, &points);
    compare(&format!("{name}, points"), &points);
    compare(&format!("{name}, view"), &pairs_of_view(&scene, &light, &data));
}

#[test]
fn the_cornell_box_agrees() {
    check("cornell", 1e-3);
}

#[test]
fn the_papers_surface_agrees() {
    check("paper", 1e-4);
}

#[test]
fn the_room_agrees() {
    // Tight, since single points are off by several times the root mean square over the surface.
    check("room", 1e-3);
}

#[test]
fn an_arcade_of_many_faces_agrees() {
    // Single points have noise of rays: root mean squares are compared.
    let tolerance = 0.03;
    let (scene, light, data) = prepared("arcade", tolerance);
    let points = pairs_of_points(&scene, &light, &data);
    bound_offsets(&data, &points);
    let mean = light.apart().unwrap().estimate.mean;
    let (mut squares, mut theirs) = (DVec3::ZERO, DVec3::ZERO);
    for p in &points {
        squares += ((p.ours - p.theirs) / mean).powf(2.0) / points.len() as f64;
        theirs += (p.error / mean).powf(2.0) / points.len() as f64;
    }
    let (error, noise) = (squares.max_element().sqrt(), theirs.max_element().sqrt());
    println!("arcade: {error:.2e} with noise of {noise:.1e}");
    let allowed = 1.0 + ERRORS / (2.0 * points.len() as f64).sqrt();
    assert!(error <= allowed * tolerance.hypot(noise), "{error:e}");
}
