//! Physics that must hold to rounding: closure, furnaces, invariance.

mod common;

use std::path::Path;

use common::{Prepared, box_room, exact_of, rotated, scene_of};
use glam::{DMat3, DVec3};
use lumel::mesh::{Basis, Refinement};
use lumel::monitor::Monitor;
use lumel::solve::{SolveOptions, solve};

fn row_sums(scene: &lumel::scene::Scene, basis: Basis, levels: u32) -> Vec<f64> {
    let prepared = Prepared::new(scene, basis, Refinement::Levels(levels));
    exact_of(&prepared).row_sums(prepared.mesh.nodes())
}

fn worst(sums: &[f64]) -> f64 {
    sums.iter().map(|s| (s - 1.0).abs()).fold(0.0, f64::max)
}

#[test]
fn an_empty_box_is_closed() {
    for basis in [Basis::Constant, Basis::Linear] {
        let sums = row_sums(&box_room(&[]), basis, 2);
        assert!(worst(&sums) < 1e-13, "{:e}", worst(&sums));
    }
}

#[test]
fn a_box_with_blocks_inside_is_closed() {
    let blocks = [
        (DVec3::new(0.3, 0.3, 0.2), DVec3::new(0.5, 0.6, 0.7)),
        (DVec3::new(0.6, 0.25, 0.1), DVec3::new(0.8, 0.5, 0.3)),
    ];
    for basis in [Basis::Constant, Basis::Linear] {
        let sums = row_sums(&box_room(&blocks), basis, 2);
        assert!(worst(&sums) < 1e-12, "{:e}", worst(&sums));
        let turned = rotated(
            &box_room(&blocks),
            DMat3::from_axis_angle(DVec3::new(0.3, -0.5, 0.7).normalize(), 0.9),
            1e3,
            DVec3::new(10.0, -4e3, 3.0),
        );
        let sums = row_sums(&turned, basis, 1);
        assert!(worst(&sums) < 1e-10, "{:e}", worst(&sums));
    }
}

#[test]
fn closed_shipped_scenes_are_closed() {
    for name in ["room.gltf", "furnace.gltf"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
        let scene = lumel::scene::read(&path, &Default::default()).unwrap();
        let prepared = Prepared::new(&scene, Basis::Linear, Refinement::Elements(1000));
        let sums = exact_of(&prepared).row_sums(prepared.mesh.nodes());
        assert!(worst(&sums) < 1e-9, "{name}: {:e}", worst(&sums));
    }
}

#[test]
fn a_furnace_is_uniform() {
    let scene = box_room(&[(DVec3::new(0.3, 0.3, 0.2), DVec3::new(0.5, 0.6, 0.7))]);
    let prepared = Prepared::new(&scene, Basis::Linear, Refinement::Levels(1));
    let (operator, n) = (exact_of(&prepared), prepared.mesh.nodes());
    for rho in [0.1, 0.5, 0.9, 0.99] {
        let solution = solve(
            &operator,
            &vec![DVec3::splat(rho); n],
            &vec![DVec3::new(1.0, 2.0, 0.0); n],
            None,
            &SolveOptions { residual: 1e-13, most_iterations: 500 },
            &Monitor::silent(),
        )
        .unwrap();
        let want = DVec3::new(1.0, 2.0, 0.0) / (1.0 - rho);
        for u in &solution.radiosity {
            assert!((*u - want).abs().max_element() <= 1e-9 * want.y, "{rho}: {u} not {want}");
        }
    }
}

#[test]
fn scenes_of_one_shape_have_one_solution() {
    let scene = scene_of("plates and a lamp");
    let irradiance = |scene: &lumel::scene::Scene| {
        let prepared = Prepared::new(scene, Basis::Linear, Refinement::Levels(2));
        let operator = exact_of(&prepared);
        let (rho, e) = lumel::mesh::appearance(scene, &prepared.mesh);
        let options = SolveOptions { residual: 1e-13, most_iterations: 500 };
        solve(&operator, &rho, &e, None, &options, &Monitor::silent()).unwrap().irradiance
    };
    let base = irradiance(&scene);
    let largest = base.iter().map(|h| h.x).fold(0.0, f64::max);
    for (scale, shift) in
        [(1.0, DVec3::ZERO), (1e-3, DVec3::ZERO), (1e3, DVec3::ZERO), (1.0, DVec3::splat(10.0))]
    {
        let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 2.1);
        let moved = irradiance(&rotated(&scene, turn, scale, shift));
        let worst = base.iter().zip(&moved).map(|(a, b)| (a.x - b.x).abs()).fold(0.0, f64::max);
        assert!(worst <= 1e-9 * largest, "scale {scale}, shift {shift}: {:e}", worst / largest);
    }
}
