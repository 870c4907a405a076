//! What a scene does not need is not done, and the answer is the same.

mod common;

use common::{box_quads, box_room, material, scene};
use glam::DVec3;
use lumel::Monitor;
use lumel::mesh::{Basis, MeshOptions, Refinement};
use lumel::operator::{FastOptions, OperatorKind};
use lumel::scene::Scene;
use lumel::solve::light::light;
use lumel::solve::{Light, LightOptions, SolveOptions, WithinOptions, light_within};

const TOLERANCE: f64 = 1e-6;

fn solved(scene: &Scene, operator: OperatorKind) -> Light {
    let options = LightOptions {
        mesh: MeshOptions { basis: Basis::Linear, refinement: Refinement::Levels(3) },
        operator,
        solve: SolveOptions { residual: 1e-10, ..SolveOptions::default() },
        max_memory: u64::MAX,
    };
    light(scene, &options, &Monitor::silent()).unwrap()
}

fn fast(scene: &Scene) -> Light {
    solved(scene, OperatorKind::Fast(FastOptions::new(TOLERANCE, None, None).unwrap()))
}

fn count(light: &Light, name: &str) -> u64 {
    light.counts.iter().find(|(n, _)| *n == name).unwrap_or_else(|| panic!("{name}")).1
}

/// Compares the radiosities with those of the exact operator, which leaves nothing out.
fn agrees_with_exact(scene: &Scene, fast: &Light) {
    let exact = solved(scene, OperatorKind::Exact);
    let largest = exact.solution.irradiance.iter().map(|h| h.max_element()).fold(0.0, f64::max);
    assert!(largest > 0.0);
    for (a, b) in fast.solution.radiosity.iter().zip(&exact.solution.radiosity) {
        assert!((*a - *b).abs().max_element() <= 2.0 * TOLERANCE * largest, "{a} {b}");
    }
}

/// A box of a material per side: floor, ceiling, and four walls; the corners of a box from `at`.
fn room(at: DVec3, materials: [u32; 6]) -> Vec<([DVec3; 4], u32)> {
    box_quads(at, at + DVec3::new(1.0, 1.2, 0.8), false).into_iter().zip(materials).collect()
}

#[test]
fn a_convex_room_asks_for_no_visibility() {
    let materials = vec![material("grey", 0.5, 0.0), material("lamp", 0.2, 1.0)];
    let empty = scene(&room(DVec3::ZERO, [0, 1, 0, 0, 0, 0]), materials);
    let light = fast(&empty);
    assert_eq!(count(&light, "pairs with occluders between"), 0);
    assert!(count(&light, "pairs clear of occluders") > 0);
    agrees_with_exact(&empty, &light);
    // A block in it changes that.
    let mut blocked = box_room(&[(DVec3::splat(0.3), DVec3::splat(0.6))]);
    blocked.materials[0].radiance = DVec3::ONE;
    assert!(count(&fast(&blocked), "pairs with occluders between") > 0);
}

#[test]
fn colours_in_proportion_are_solved_once() {
    let block = box_quads(DVec3::splat(0.3), DVec3::splat(0.6), true);
    let coloured = |reflectance: DVec3, radiance: DVec3| {
        let mut quads = room(DVec3::ZERO, [0, 1, 0, 0, 0, 0]);
        quads.extend(block.iter().map(|&q| (q, 0)));
        let mut scene = scene(&quads, vec![material("wall", 0.5, 0.0), material("lamp", 0.2, 1.0)]);
        scene.materials[0].reflectance = reflectance;
        scene.materials[1].radiance = radiance;
        fast(&scene)
    };
    let lamp = DVec3::new(1.0, 0.7, 0.1);
    let once = coloured(DVec3::splat(0.5), lamp);
    assert_eq!(count(&once, "channels solved"), 1);
    // A hair of colour, far below the tolerance, and each is solved for itself.
    let each = coloured(DVec3::new(0.5, 0.5 + 1e-12, 0.5 - 1e-12), lamp);
    assert_eq!(count(&each, "channels solved"), 3);
    let largest = once.solution.radiosity.iter().map(|u| u.max_element()).fold(0.0, f64::max);
    for (a, b) in once.solution.radiosity.iter().zip(&each.solution.radiosity) {
        assert!((*a - *b).abs().max_element() <= 1e-9 * largest, "{a} {b}");
    }
    assert_eq!(count(&coloured(DVec3::splat(0.5), DVec3::X), "channels solved"), 1);
    assert_eq!(count(&coloured(DVec3::splat(0.5), DVec3::ZERO), "channels solved"), 0);
}

#[test]
fn black_surfaces_have_no_rows() {
    let block = box_quads(DVec3::splat(0.3), DVec3::splat(0.6), true);
    let with_block = |reflectance: f64| {
        let mut quads = room(DVec3::ZERO, [0, 1, 0, 0, 0, 0]);
        quads.extend(block.iter().map(|&q| (q, 2)));
        let materials = vec![
            material("wall", 0.5, 0.0),
            material("lamp", 0.2, 1.0),
            material("block", reflectance, 0.0),
        ];
        scene(&quads, materials)
    };
    let (grey, black) = (fast(&with_block(0.5)), fast(&with_block(0.0)));
    assert_eq!(count(&grey, "roots that reflect nothing"), 0);
    assert_eq!(count(&black, "roots that reflect nothing"), 12);
    assert!(count(&black, "links") < count(&grey, "links") * 3 / 4);
    agrees_with_exact(&with_block(0.0), &black);
}

#[test]
fn rooms_that_no_light_reaches_are_not_built() {
    let materials = vec![material("grey", 0.5, 0.0), material("lamp", 0.2, 1.0)];
    let lit = room(DVec3::ZERO, [0, 1, 0, 0, 0, 0]);
    let dark = room(DVec3::new(1.5, 0.0, 0.0), [0; 6]);
    let alone = fast(&scene(&lit, materials.clone()));
    let both = scene(&[lit, dark].concat(), materials);
    let light = fast(&both);
    assert_eq!(count(&light, "roots that no light reaches"), 12);
    for name in ["links", "far pairs"] {
        assert_eq!(count(&light, name), count(&alone, name), "{name}");
    }
    let lit_nodes = alone.solution.radiosity.len();
    for (a, b) in light.solution.radiosity.iter().zip(&alone.solution.radiosity) {
        assert!((*a - *b).abs().max_element() <= TOLERANCE, "{a} {b}");
    }
    assert!(light.solution.radiosity[lit_nodes..].iter().all(|u| *u == DVec3::ZERO));
    agrees_with_exact(&both, &light);
}

/// Meshes are refined in search of light that was missed, but not where it is proved that there is none.
#[test]
fn where_no_light_arrives_one_mesh_is_enough() {
    let solve = |quads: &[([DVec3; 4], u32)]| {
        let materials = vec![material("grey", 0.5, 0.0), material("lamp", 0.2, 1.0)];
        let options = WithinOptions::new(0.3, u64::MAX);
        light_within(&scene(quads, materials), &options, &Monitor::silent()).unwrap()
    };
    // A box that shines outward.
    let outward: Vec<_> =
        box_quads(DVec3::ZERO, DVec3::ONE, true).into_iter().map(|q| (q, 1)).collect();
    let dark = solve(&outward);
    let estimate = dark.apart().unwrap().estimate;
    assert_eq!((estimate.steps, estimate.rms, estimate.mean), (1, 0.0, DVec3::ZERO));
    assert!(dark.apart().unwrap().shortfall.is_none());
    // A speck that it shines on lies between all points of coarse meshes.
    let (x, y) = (1e-3 * DVec3::X, 1e-3 * DVec3::Y);
    let at = DVec3::new(0.31, 0.47, 1.4);
    let lit = solve(&[outward, vec![([at, at + y, at + x + y, at + x], 0)]].concat());
    let estimate = lit.apart().unwrap().estimate;
    assert!(estimate.steps > 1 && estimate.mean.min_element() > 0.0, "{estimate:?}");
}
