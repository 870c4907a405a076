//! Faces that overlap in one plane: light is counted once, whatever lies on what.

mod common;
#[path = "common/random.rs"]
#[allow(dead_code)]
mod random;

use std::path::Path;

use common::{Prepared, box_quads, box_room, exact_of, material, rotated, scene, triangle};
use glam::{DMat3, DVec2, DVec3};
use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay::{Overlay, ShapeType};
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::i_float::int::point::IntPoint;
use lumel::mesh::{Basis, CONTACT, Refinement};
use lumel::monitor::Monitor;
use lumel::scene::{Overlaps, Scene, resolve_overlaps};
use lumel::solve::{SolveOptions, solve};
use random::Random;

type Quad = [DVec3; 4];

const ONE: u32 = 0;
const BOTH: u32 = 1;

/// A scene of quads that are one-sided or radiate on both sides. Each quad is an object.
fn of(quads: &[(Quad, u32)]) -> Scene {
    let mut both = material("both", 0.5, 0.0);
    both.two_sided = true;
    let mut scene = scene(quads, vec![material("one", 0.5, 0.0), both]);
    scene.objects =
        (0..quads.len()).map(|i| lumel::scene::Object { name: format!("quad {i}") }).collect();
    for (i, t) in scene.triangles.iter_mut().enumerate() {
        t.object = i as u32 / 2;
    }
    scene
}

fn room() -> Vec<(Quad, u32)> {
    box_quads(DVec3::ZERO, DVec3::ONE, false).into_iter().map(|q| (q, ONE)).collect()
}

/// A rectangle at height z that faces up.
fn flat(x0: f64, y0: f64, x1: f64, y1: f64, z: f64) -> Quad {
    [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| DVec3::new(x, y, z))
}

/// A square at height z that faces up, turned about its middle.
fn turned(x: f64, y: f64, size: f64, turn: f64, z: f64) -> Quad {
    let half = 0.5 * size;
    flat(-half, -half, half, half, z)
        .map(|p| DMat3::from_rotation_z(turn) * p + DVec3::new(x, y, 0.0))
}

fn down([a, b, c, d]: Quad) -> Quad {
    [d, c, b, a]
}

fn row_sums(scene: &Scene) -> (f64, f64) {
    let prepared = Prepared::new(scene, Basis::Linear, Refinement::Levels(1));
    let sums = exact_of(&prepared).row_sums(prepared.mesh.nodes());
    sums.into_iter().fold((f64::INFINITY, 0.0), |(low, high), s| (s.min(low), s.max(high)))
}

/// Largest error of a furnace: radiosity E / (1 - rho) everywhere.
fn furnace_error(scene: &Scene) -> f64 {
    let prepared = Prepared::new(scene, Basis::Linear, Refinement::Levels(1));
    let n = prepared.mesh.nodes();
    let options = SolveOptions { residual: 1e-13, most_iterations: 500 };
    let (rho, e) = (vec![DVec3::splat(0.75); n], vec![DVec3::ONE; n]);
    let solution =
        solve(&exact_of(&prepared), &rho, &e, None, &options, &Monitor::silent()).unwrap();
    let error = |u: &DVec3| (*u / 4.0 - 1.0).abs().max_element();
    solution.radiosity.iter().map(error).fold(0.0, f64::max)
}

fn turn() -> DMat3 {
    DMat3::from_axis_angle(DVec3::new(0.3, -0.5, 0.7).normalize(), 0.9)
}

fn places() -> [(DMat3, f64, DVec3); 4] {
    [
        (DMat3::IDENTITY, 1.0, DVec3::ZERO),
        (turn(), 1.0, DVec3::new(0.3, 0.1, -2.0)),
        (turn(), 1e-3, DVec3::ZERO),
        (turn(), 1e3, DVec3::new(400.0, 100.0, -300.0)),
    ]
}

fn resolved(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    resolve_overlaps(&mut scene);
    scene
}

/// Closed and a furnace wherever it is; without resolving it is neither.
fn check_closed(name: &str, still: &Scene, close: f64, bad_before: bool) {
    if bad_before {
        let (low, high) = row_sums(still);
        assert!(high > 1.01 || low < 0.99, "{name}: already closed, {low} to {high}");
    }
    for (turn, scale, shift) in places() {
        let scene = resolved(&rotated(still, turn, scale, shift));
        assert_ne!(scene.overlaps.pairs, 0, "{name}");
        assert_eq!(scene.overlaps.left, 0, "{name}");
        assert!(scene.overlaps.cut + scene.overlaps.covered > 0, "{name}");
        assert!(!scene.notices.is_empty(), "{name}");
        let (low, high) = row_sums(&scene);
        let worst = (1.0 - low).max(high - 1.0);
        println!("{name}, scale {scale}: {} faces, {worst:.1e}", scene.triangles.len());
        assert!(worst <= close, "{name}, scale {scale}: row sums {low} to {high}");
        let error = furnace_error(&scene);
        assert!(error <= 4.0 * close, "{name}, scale {scale}: the furnace is off by {error:e}");
        // Nothing is left to do.
        let again = resolved(&scene);
        assert_eq!(again.overlaps, Overlaps::default(), "{name}, scale {scale}");
        assert_eq!(again.triangles, scene.triangles, "{name}");
    }
}

fn with(extra: &[(Quad, u32)]) -> Scene {
    of(&[&room()[..], extra].concat())
}

#[test]
fn rooms_with_things_flat_on_their_walls_are_closed() {
    let half = |low: f64, high: f64| {
        [(low, 0.0), (high, 0.0), (high, 1.0), (low, 1.0)].map(|(y, z)| DVec3::new(0.0, y, z))
    };
    let walls = |second: Quad| {
        // Without the wall at x = 0, which is two that overlap.
        let mut quads = room();
        let before = quads.len();
        quads.retain(|(q, _)| q.iter().any(|p| p.x != 0.0));
        assert_eq!(quads.len(), before - 1);
        quads.extend([(half(0.0, 0.6), ONE), (second, ONE)]);
        of(&quads)
    };
    let [a, b, c, d] = flat(0.0, 0.0, 1.0, 1.0, 0.0);
    let rug = turned(0.45, 0.5, 0.4, 0.3, 0.0);
    let sheet = flat(0.2, 0.3, 0.7, 0.6, 0.0);
    let close = 1e-11;
    for (name, scene) in [
        ("rug", with(&[(flat(0.3, 0.2, 0.7, 0.6, 0.0), ONE)])),
        ("turned rug", with(&[(rug, ONE)])),
        ("rug in the corner", with(&[(flat(0.0, 0.0, 0.5, 0.4, 0.0), ONE)])),
        ("rug on a rug", with(&[(rug, ONE), (turned(0.5, 0.5, 0.2, 0.1, 0.0), ONE)])),
        ("rugs that overlap", with(&[(rug, ONE), (turned(0.6, 0.55, 0.4, 0.1, 0.0), ONE)])),
        ("walls that overlap", walls(half(0.4, 1.0))),
        ("floors with two diagonals", with(&[([b, c, d, a], ONE)])),
        ("sheet", with(&[(sheet, BOTH)])),
        ("sheet that faces the wall", with(&[(down(sheet), BOTH)])),
        ("two sheets", with(&[(down(sheet), BOTH), (turned(0.5, 0.5, 0.3, 0.4, 0.0), BOTH)])),
    ] {
        check_closed(name, &scene, close, true);
    }
}

/// A gap below the contact distance is a slit around the rug; what it lets through is not seen
/// from above, and the rest is as large as the gap.
#[test]
fn rooms_with_rugs_a_hair_above_the_floor_are_closed() {
    for height in [1e-12, 1e-9, 1e-7, 4e-7, 9e-7] {
        for kind in [ONE, BOTH] {
            let scene = with(&[(turned(0.45, 0.5, 0.4, 0.3, height), kind)]);
            check_closed(&format!("rug at {height:e}"), &scene, 1.1 * height + 1e-11, false);
        }
    }
}

/// What is higher stays, even where it is larger.
#[test]
fn the_higher_one_stays() {
    let small = turned(0.5, 0.5, 0.2, 0.3, 0.0);
    for (z, covered) in [(4e-7, 2), (-4e-7, 0)] {
        for large_first in [true, false] {
            let large = flat(0.2, 0.2, 0.8, 0.8, z);
            let far = flat(0.0, 0.0, 1.0, 1.0, -1.0);
            let (first, second) = if large_first { (large, small) } else { (small, large) };
            let scene = resolved(&of(&[(far, ONE), (first, ONE), (second, ONE)]));
            assert_eq!(scene.overlaps.covered, covered, "{:?}", scene.overlaps);
            let area = |object: u32| -> f64 {
                let its = scene.triangles.iter().filter(|t| t.object == object);
                its.map(|t| t.normal_and_area().1).sum()
            };
            let (of_large, of_small) = if large_first { (1, 2) } else { (2, 1) };
            let want = if covered > 0 { [0.36, 0.0] } else { [0.32, 0.04] };
            let got = [area(of_large), area(of_small)];
            assert!((got[0] - want[0]).abs() + (got[1] - want[1]).abs() < 1e-12, "{got:?}");
        }
    }
}

/// From above and from below, what radiates in mid air covers what it covered before, once. (A hole
/// through a sheet leaves the room closed.)
fn check_sides(scene: &Scene, close: f64) {
    let facing = |s: &Scene, up: f64| -> Vec<[DVec2; 3]> {
        let near =
            s.triangles.iter().filter(|t| t.vertices.iter().all(|x| (x.z - 0.5).abs() < 0.1));
        let its = near.filter(|t| {
            s.materials[t.material as usize].two_sided || up * t.normal_and_area().0.z > 0.0
        });
        its.map(|t| t.vertices.map(|x| x.truncate())).collect()
    };
    let done = resolved(scene);
    for up in [1.0, -1.0] {
        check_union(&facing(scene, up), &facing(&done, up), close);
    }
}

/// Sheets in mid air, seen from both sides.
#[test]
fn sheets_on_sheets_are_closed_on_both_sides() {
    let table = flat(0.2, 0.2, 0.8, 0.8, 0.5);
    let cloth = turned(0.6, 0.5, 0.5, 0.3, 0.5);
    let raised = |h: f64| cloth.map(|p| p + h * DVec3::Z);
    let plate = [(table, ONE), (down(table), ONE)];
    let on_plate = |more: (Quad, u32)| with(&[&plate[..], &[more]].concat());
    for (name, scene, close) in [
        ("both on both", with(&[(table, BOTH), (cloth, BOTH)]), 1e-11),
        ("upside down", with(&[(table, BOTH), (down(cloth), BOTH)]), 1e-11),
        ("both on a plate", on_plate((cloth, BOTH)), 1e-11),
        ("a hair above", with(&[(table, BOTH), (raised(1e-7), BOTH)]), 1e-6),
        ("a hair below", with(&[(table, BOTH), (raised(-1e-7), BOTH)]), 1e-6),
        ("a hair above a plate", on_plate((raised(1e-7), BOTH)), 1e-6),
        ("a hair below a plate", on_plate((raised(-1e-7), BOTH)), 1e-6),
    ] {
        check_closed(name, &scene, close, false);
        check_sides(&scene, close);
    }
    // A one-sided cloth reaches over the table; its back there is black and seen from below.
    let inside = flat(0.3, 0.3, 0.6, 0.5, 0.5);
    for (name, cloth) in [("from above", inside), ("from below", down(inside))] {
        let scene = with(&[(table, BOTH), (cloth, ONE)]);
        check_closed(name, &scene, 1e-11, true);
        check_sides(&scene, 1e-11);
    }
}

/// Of two sheets the higher one keeps the side above, the lower one that below.
#[test]
fn what_is_higher_is_lower_from_behind() {
    let (lower, higher) = (flat(0.2, 0.2, 0.8, 0.8, 0.5), flat(0.1, 0.1, 0.6, 0.6, 0.5 + 4e-7));
    for order in [[0, 1], [1, 0]] {
        let quads = order.map(|i| ([lower, higher][i], BOTH));
        let scene = resolved(&with(&quads));
        for t in scene.triangles.iter().filter(|t| t.object >= 6) {
            if !scene.materials[t.material as usize].two_sided {
                let high = order[t.object as usize - 6] == 1;
                assert_eq!(t.normal_and_area().0.z > 0.0, high);
            }
        }
        assert_eq!(scene.materials.len(), 3);
    }
}

/// The covered part of a two-sided sheet still radiates on its other side, and only there.
#[test]
fn a_two_sided_sheet_keeps_its_other_side() {
    let table = flat(0.2, 0.2, 0.8, 0.8, 0.5);
    let rug = flat(0.3, 0.3, 0.6, 0.5, 0.5);
    let scene = resolved(&with(&[(table, BOTH), (rug, ONE)]));
    let mut areas = [0.0; 3];
    for t in scene.triangles.iter().filter(|t| t.object == 6) {
        let (n, area) = t.normal_and_area();
        let two_sided = scene.materials[t.material as usize].two_sided;
        areas[if two_sided { 0 } else { if n.z > 0.0 { 1 } else { 2 } }] += area;
    }
    let want = [0.36 - 0.06, 0.0, 0.06];
    assert!(areas.iter().zip(want).all(|(a, w)| (a - w).abs() < 1e-14), "{areas:?}");
    assert_eq!(scene.materials.len(), 3);
    assert_eq!(scene.materials[2].name, "both, one side");
    assert_eq!(scene.materials[2].reflectance, scene.materials[1].reflectance);
}

/// Coordinates in f32, as files hold them: planes and lines that coincide only nearly.
#[test]
fn rooms_rounded_to_f32_are_closed() {
    for seed in 0..6 {
        let mut r = Random::new(seed);
        let table = flat(0.2, 0.2, 0.8, 0.8, 0.0);
        let rug = turned(0.45, 0.5, 0.4, r.within(0.0, 1.0), 0.0);
        let scene = with(&[(table, ONE), (rug, if seed % 2 == 0 { ONE } else { BOTH })]);
        let mut scene = rotated(&scene, r.turn(), 1.0, r.point(1.0));
        for t in &mut scene.triangles {
            t.vertices = t.vertices.map(|x| x.as_vec3().as_dvec3());
        }
        let (low, high) = row_sums(&resolved(&scene));
        println!("seed {seed}: {low} to {high}");
        assert!(1.0 - low < 1e-6 && high - 1.0 < 1e-6, "seed {seed}: {low} to {high}");
    }
}

/// Three sheets, each a little higher than the next one at the place where they overlap, and one
/// place where all three do: no part may be covered by all others.
#[test]
fn circles_leave_no_hole() {
    let mut r = Random::new(5);
    for _ in 0..200 {
        // Up to the contact distance apart, tilted, of sizes that do not agree with the heights.
        let quads: Vec<(Quad, u32)> = (0..5)
            .map(|_| {
                let (size, angle) = (r.within(0.3, 0.5), r.within(0.0, 6.0));
                let quad = turned(r.within(0.4, 0.6), r.within(0.4, 0.6), size, angle, 0.0);
                let (a, b, c) = (r.within(-4e-7, 4e-7), r.within(-4e-7, 4e-7), 1e-7);
                (quad.map(|p| p + DVec3::Z * (a * p.x + b * p.y + c * r.unit())), ONE)
            })
            .collect();
        let far = flat(0.0, 0.0, 1.0, 1.0, -1.0);
        let scene = of(&[&quads[..], &[(far, ONE)]].concat());
        let done = resolved(&scene);
        assert_ne!(done.overlaps.pairs, 0);
        let plane = |s: &Scene| -> Vec<[DVec2; 3]> {
            let near = s.triangles.iter().filter(|t| t.vertices[0].z > -0.5);
            near.map(|t| t.vertices.map(|x| x.truncate())).collect()
        };
        check_union(&plane(&scene), &plane(&done), 1e-5);
    }
}

/// Area that triangles cover together, by polygon booleans in integers.
fn union_area(triangles: &[[DVec2; 3]]) -> f64 {
    let unit = 2f64.powi(40);
    let mut overlay = Overlay::<i64>::new(4 * triangles.len());
    for t in triangles {
        let whole = |p: DVec2| {
            IntPoint::<i64>::new((p.x * unit).round() as i64, (p.y * unit).round() as i64)
        };
        let mut corners = t.map(whole);
        if (t[1] - t[0]).perp_dot(t[2] - t[0]) < 0.0 {
            corners.swap(1, 2);
        }
        overlay.add_contour(&corners, ShapeType::Subject);
    }
    let mut twice = 0.0;
    for contour in overlay.overlay(OverlayRule::Subject, FillRule::NonZero).into_iter().flatten() {
        for i in 0..contour.len() {
            let (p, q) = (contour[i], contour[(i + 1) % contour.len()]);
            let (a, b) = (p, q);
            let at = |v: IntPoint<i64>| DVec2::new(v.x as f64, v.y as f64) / unit;
            twice += at(a).perp_dot(at(b));
        }
    }
    0.5 * twice.abs()
}

/// Together the triangles cover what they covered before, and no place twice.
fn check_union(before: &[[DVec2; 3]], after: &[[DVec2; 3]], close: f64) {
    let sum: f64 = after.iter().map(|t| 0.5 * (t[1] - t[0]).perp_dot(t[2] - t[0]).abs()).sum();
    let (want, got) = (union_area(before), union_area(after));
    assert!((sum - want).abs() <= close * want, "sum {sum}, union {want}");
    assert!((got - want).abs() <= close * want, "union {got}, was {want}");
}

#[test]
fn random_heaps_of_triangles_keep_their_union() {
    let (mut cut, mut covered) = (0, 0);
    for seed in 0..400 {
        let mut r = Random::new(seed);
        let count = 2 + r.below(if seed % 10 == 0 { 60 } else { 8 });
        let grid = seed % 2 == 0;
        let mut flat: Vec<[DVec2; 3]> = vec![];
        while flat.len() < count {
            let mut point = || match grid {
                true => DVec2::new(r.below(7) as f64, r.below(7) as f64) / 7.0,
                false => DVec2::new(r.unit(), r.unit()),
            };
            let t = [point(), point(), point()];
            if (t[1] - t[0]).perp_dot(t[2] - t[0]) > 1e-3 && !flat.contains(&t) {
                flat.push(t);
            }
        }
        let turn = r.turn();
        let mut still = of(&[]);
        still.objects.push(lumel::scene::Object { name: "heap".into() });
        still.triangles = flat.iter().map(|t| triangle(t.map(|p| p.extend(0.0)), 0)).collect();
        // Something to have a size by.
        let scene = rotated(&still, turn, 1.0, DVec3::ZERO);
        let done = resolved(&scene);
        assert_eq!(done.overlaps.left, 0);
        (cut, covered) = (cut + done.overlaps.cut, covered + done.overlaps.covered);
        let back = |x: DVec3| (turn.transpose() * x).truncate();
        let after: Vec<[DVec2; 3]> = done.triangles.iter().map(|t| t.vertices.map(back)).collect();
        // On the grid, crossings are far from corners; elsewhere lines come near them, and each
        // such place costs the contact distance at most.
        check_union(&flat, &after, if grid { 1e-10 } else { 20.0 * CONTACT });
        for t in &done.triangles {
            assert!(t.normal_and_area().0.dot(turn * DVec3::Z) > 0.999);
        }
    }
    assert!(cut > 1000 && covered > 10, "{cut} {covered}");
}

#[test]
fn texture_coordinates_and_colours_are_interpolated() {
    let mut scene =
        with(&[(turned(0.45, 0.5, 0.4, 0.3, 0.0), ONE), (turned(0.5, 0.6, 0.5, 0.8, 0.0), BOTH)]);
    let uv = |x: DVec3, k: f64| DVec2::new(k + 3.0 * x.x - x.y, 2.0 * x.y + k * x.x + 0.1);
    let colour = |x: DVec3| 0.2 + 0.1 * DVec3::new(x.x, x.y + x.z, 3.0 * x.x - x.y);
    for t in &mut scene.triangles {
        t.uv = [1.0, 2.0].map(|k| t.vertices.map(|x| uv(x, k)));
        t.colour = t.vertices.map(colour);
    }
    let done = resolved(&scene);
    assert!(done.triangles.len() > scene.triangles.len() + 8);
    for t in &done.triangles {
        for k in 0..3 {
            let x = t.vertices[k];
            assert!(t.uv[0][k].distance(uv(x, 1.0)) < 1e-14);
            assert!(t.uv[1][k].distance(uv(x, 2.0)) < 1e-14);
            assert!(t.colour[k].distance(colour(x)) < 1e-15);
        }
    }
    // Those that nothing covers are untouched, and so is the order.
    let kept = |t: &&lumel::scene::Triangle| t.object != 0 && t.object < 6;
    assert!(done.triangles.iter().filter(kept).eq(scene.triangles.iter().filter(kept)));
    assert!(done.triangles.is_sorted_by_key(|t| t.object));
}

#[test]
fn what_does_not_overlap_is_unchanged() {
    let block = (DVec3::new(0.25, 0.25, 0.0), DVec3::new(0.5, 0.5, 0.5));
    let plate = flat(0.1, 0.1, 0.9, 0.9, 0.7);
    for scene in [
        box_room(&[]),
        // A block on the floor, and one on the block.
        box_room(&[block, (DVec3::new(0.3, 0.3, 0.5), DVec3::new(0.6, 0.4, 0.6))]),
        with(&[(plate, ONE), (down(plate), ONE)]),
        with(&[(plate, ONE), (down(turned(0.5, 0.5, 0.6, 0.3, 0.7)), ONE)]),
        // Side by side in one plane, with and without a common corner; ever so little apart.
        with(&[(flat(0.1, 0.1, 0.5, 0.5, 0.7), BOTH), (flat(0.5, 0.2, 0.9, 0.6, 0.7), BOTH)]),
        with(&[(plate, BOTH), (turned(0.5, 0.5, 0.3, 0.2, 0.7 + 1e-5), BOTH)]),
        // Through each other at a small angle.
        with(&[
            (plate, BOTH),
            (
                turned(0.5, 0.5, 0.3, 0.2, 0.0).map(|p| p + DVec3::Z * (0.7 + 1e-3 * (p.x - 0.5))),
                BOTH,
            ),
        ]),
    ] {
        for (turn, scale, shift) in places() {
            let scene = rotated(&scene, turn, scale, shift);
            let done = resolved(&scene);
            assert_eq!(done.overlaps, Overlaps::default());
            assert!(done.notices.is_empty());
            let bits = |s: &Scene| -> Vec<u64> {
                let all = s.triangles.iter().flat_map(|t| t.vertices);
                all.flat_map(|x| x.to_array().map(f64::to_bits)).collect()
            };
            assert_eq!(bits(&done), bits(&scene));
            assert_eq!(done.triangles, scene.triangles);
            assert_eq!(done.materials, scene.materials);
        }
    }
}

#[test]
fn shipped_scenes_have_no_overlaps() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let names =
        ["cornell.gltf", "cornell.obj", "room.gltf", "paper.gltf", "furnace.gltf", "arcade.gltf"];
    for name in names {
        let scene = lumel::scene::read(&scenes.join(name), &Default::default()).unwrap();
        assert_eq!(scene.overlaps, Overlaps::default(), "{name}");
    }
}

#[test]
fn the_reader_resolves_and_says_so() {
    let text = "o floor\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n\
                o rug\nv 0.3 0.2 0\nv 0.7 0.2 0\nv 0.7 0.6 0\nv 0.3 0.6 0\nf 5 6 7 8\n\
                o again\nv 0.3 0.6 0\nv 0.3 0.2 0\nv 0.7 0.2 0\nv 0.7 0.6 0\nf 9 10 11 12\n";
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("rug.obj");
    std::fs::write(&path, text).unwrap();
    let scene = lumel::scene::read(&path, &Default::default()).unwrap();
    let area: f64 = (0..scene.triangles.len()).map(|i| scene.triangle_normal_and_area(i).1).sum();
    assert!((area - 1.0).abs() < 1e-15, "{area}");
    let notices: Vec<_> =
        scene.notices[1..].iter().map(|n| (n.about.as_str(), n.text.as_str(), n.count)).collect();
    assert_eq!(
        notices,
        [
            ("object \"rug\"", "faces left out: others in the same plane cover them", 2),
            ("object \"floor\"", "faces that overlap others in one plane cut", 2),
        ]
    );
    assert_eq!((scene.overlaps.cut, scene.overlaps.covered, scene.overlaps.left), (2, 2, 0));
    // The later of two equal ones stays.
    assert!(scene.triangles.iter().all(|t| scene.objects[t.object as usize].name != "rug"));
}

#[test]
fn too_many_parts_are_left_and_said() {
    let tile = |k: usize| {
        let at = |i: usize| 0.01 + 0.98 * i as f64 / 70.0;
        turned(at(k % 70) + 0.005, at(k / 70) + 0.005, 0.006, 0.4, 0.0)
    };
    let tiles: Vec<(Quad, u32)> = (0..70 * 70).map(|k| (tile(k), ONE)).collect();
    let scene = of(&[&[(flat(0.0, 0.0, 1.0, 1.0, 0.0), ONE)], &tiles[..]].concat());
    let done = resolved(&scene);
    assert_eq!((done.overlaps.left, done.overlaps.cut), (2, 0));
    assert_eq!(done.triangles, scene.triangles);
    let notice = &done.notices[0];
    assert!(notice.text.contains("counted twice") && notice.count == 2, "{notice:?}");
}

#[test]
fn threads_do_not_matter() {
    let mut r = Random::new(1);
    let quads: Vec<(Quad, u32)> = (0..40)
        .map(|_| {
            let quad = turned(r.unit(), r.unit(), r.within(0.1, 0.5), r.unit(), 0.0);
            (quad, r.below(2) as u32)
        })
        .collect();
    let scene = of(&quads);
    let by = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| resolved(&scene))
    };
    let (one, three) = (by(1), by(3));
    assert!(one.overlaps.cut > 50);
    assert_eq!(one.triangles, three.triangles);
    assert_eq!(one.notices, three.notices);
}
