//! The paper's surface against converged reference radiosities at 32 points (rho = 0.5, E = 1 on
//! S4), which an independent high-order panel method on shadow-aligned, graded panels gave to
//! 4e-10: `data/paper_oracle.json`.

use std::path::Path;

use glam::DVec3;
use lumel::mesh::{Basis, MeshOptions, Refinement};
use lumel::monitor::Monitor;
use lumel::operator::{FastOptions, OperatorKind};
use lumel::output::csv::Point;
use lumel::probe::probe;
use lumel::scene::{ReadOptions, Scene, read};
use lumel::solve::light::{LightOptions, light};
use lumel::solve::{Light, SolveOptions, WithinOptions, light_within};

struct Errors {
    /// Largest error of points farther than 0.05 from the common edge of S1 and S5, and of nearer
    /// ones, relative to the largest radiosity.
    far: f64,
    near: f64,
    /// Largest error relative to the point's own radiosity: umbra points are 1e-5 of the largest.
    pointwise: f64,
}

fn errors(levels: u32, operator: OperatorKind) -> Errors {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scene = read(&root.join("scenes/paper.gltf"), &ReadOptions::default()).unwrap();
    let options = LightOptions {
        mesh: MeshOptions { basis: Basis::Linear, refinement: Refinement::Levels(levels) },
        operator,
        solve: SolveOptions { residual: 1e-12, ..SolveOptions::default() },
        max_memory: u64::MAX,
    };
    let light = light(&scene, &options, &Monitor::silent()).unwrap();
    errors_of(&scene, &light)
}

fn errors_of(scene: &Scene, light: &Light) -> Errors {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join("tests/data/paper_oracle.json")).unwrap();
    let oracle: serde_json::Value = serde_json::from_str(&text).unwrap();
    let entries = oracle["points"].as_array().unwrap();
    let vector =
        |v: &serde_json::Value| DVec3::from_array([0, 1, 2].map(|k| v[k].as_f64().unwrap()));
    let points: Vec<Point> = entries
        .iter()
        .map(|p| Point { position: vector(&p["x"]), normal: vector(&p["normal"]) })
        .collect();
    let results = probe(scene, light, &points, &Monitor::silent()).unwrap();
    let want: Vec<f64> = entries.iter().map(|p| p["u"].as_f64().unwrap()).collect();
    let largest = want.iter().copied().fold(0.0, f64::max);
    let mut errors = Errors { far: 0.0, near: 0.0, pointwise: 0.0 };
    for ((entry, result), u) in entries.iter().zip(&results).zip(&want) {
        let got = result.radiosity.expect("every point lies on the surface");
        assert!(got.x == got.y && got.y == got.z, "grey");
        let error = (got.x - u).abs();
        let x = vector(&entry["x"]);
        let to_edge = (5.0 - x.y).hypot(x.z);
        let faces_the_edge = matches!(entry["piece"].as_str(), Some("S1" | "S5"));
        let slot =
            if faces_the_edge && to_edge < 0.05 { &mut errors.near } else { &mut errors.far };
        *slot = slot.max(error / largest);
        errors.pointwise = errors.pointwise.max(error / u);
    }
    errors
}

#[test]
fn probes_converge_to_the_oracle() {
    let ladder = [2, 3, 4].map(|levels| errors(levels, OperatorKind::Exact));
    for (e, n) in ladder.iter().zip([160, 640, 2560]) {
        println!("n {n}: far {:.2e} near {:.2e} pointwise {:.2e}", e.far, e.near, e.pointwise);
    }
    for pair in ladder.windows(2) {
        assert!(pair[1].far < pair[0].far && pair[1].near < pair[0].near);
        assert!(pair[1].pointwise < pair[0].pointwise);
    }
    assert!(ladder[2].far < 2e-5 && ladder[2].near < 2e-4);
    // Linear elements across shadow lines: h^2, so about 1e-2 of the light in an umbra here.
    assert!(ladder[2].pointwise < 1e-2);
}

#[test]
fn the_fast_operator_goes_on_converging_to_it() {
    let fast = OperatorKind::Fast(FastOptions::new(1e-7, None, None).unwrap());
    let ladder = [5, 6, 7].map(|levels| errors(levels, fast));
    for (e, n) in ladder.iter().zip([10240, 40960, 163840]) {
        println!("n {n}: far {:.2e} near {:.2e} pointwise {:.2e}", e.far, e.near, e.pointwise);
    }
    for pair in ladder.windows(2) {
        assert!(pair[1].far < 0.5 * pair[0].far && pair[1].near < 0.6 * pair[0].near);
        assert!(pair[1].pointwise < 0.5 * pair[0].pointwise);
    }
    assert!(ladder[2].far < 5e-8 && ladder[2].near < 1e-6);
    assert!(ladder[2].pointwise < 3e-4);
}

/// With direct light apart even points in the umbra, 1e-5 times as bright as the largest, are right.
#[test]
fn light_to_a_tolerance_is_right_at_each_point() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/paper.gltf");
    let scene = read(&path, &ReadOptions::default()).unwrap();
    for (tolerance, bounds) in [(1e-3, [1e-5, 3e-5, 3e-2]), (1e-5, [3e-7, 2e-6, 5e-4])] {
        let options = WithinOptions::new(tolerance, u64::MAX);
        let light = light_within(&scene, &options, &Monitor::silent()).unwrap();
        let errors = errors_of(&scene, &light);
        println!("{tolerance:e}: {:.1e} {:.1e} {:.1e}", errors.far, errors.near, errors.pointwise);
        let found = [errors.far, errors.near, errors.pointwise];
        assert!(found.iter().zip(bounds).all(|(error, bound)| *error <= bound), "{found:?}");
    }
}
