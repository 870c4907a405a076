//! Faces cut where others touch them: what is cut, how, and that light and picture follow.

mod common;

use common::{Prepared, box_quads, exact_of, material, rotated, scene, triangle};
use glam::{DMat3, DVec2, DVec3};
use lumel::geometry::Bounds;
use lumel::mesh::{Basis, CONTACT, Mesh, MeshOptions, Refinement};
use lumel::reconstruct::VertexIrradiance;
use lumel::scene::Scene;

type Quad = [DVec3; 4];

fn mesh_of(scene: &Scene, refinement: Refinement) -> Mesh {
    lumel::mesh::build(scene, &MeshOptions { basis: Basis::Linear, refinement }).unwrap()
}

fn of(quads: &[Quad]) -> Scene {
    let quads: Vec<_> = quads.iter().map(|&q| (q, 0)).collect();
    scene(&quads, vec![material("grey", 0.5, 0.0)])
}

/// A rectangle at height z, facing up.
fn floor(x0: f64, y0: f64, x1: f64, y1: f64, z: f64) -> Quad {
    [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| DVec3::new(x, y, z))
}

/// A block without a bottom that stands on z = `foot`, turned about its middle.
fn block(x: f64, y: f64, size: f64, turn: f64, foot: f64) -> Vec<Quad> {
    let half = DVec3::new(0.5 * size, 0.5 * size, 0.0);
    let quads = box_quads(-half, half + DVec3::new(0.0, 0.0, 0.3), true);
    let turn = DMat3::from_rotation_z(turn);
    let place = |p: DVec3| turn * p + DVec3::new(x, y, foot);
    quads.into_iter().skip(1).map(|q| q.map(place)).collect()
}

fn on_floor(blocks: &[Vec<Quad>]) -> Scene {
    of(&[vec![floor(0.0, 0.0, 1.0, 1.0, 0.0)], blocks.concat()].concat())
}

/// Corners of all roots, in space, by face.
fn roots_of(mesh: &Mesh, face: usize) -> Vec<[DVec3; 3]> {
    let f = &mesh.faces[face];
    let lift = |r: u32| mesh.roots[r as usize].corners.map(|c| f.frame.lift(c));
    (f.roots.0..f.roots.1).map(lift).collect()
}

fn twice_area(t: &[DVec2; 3]) -> f64 {
    (t[1] - t[0]).perp_dot(t[2] - t[0])
}

/// What must hold of every mesh: roots wind as their faces do and make them up; the mesh is the
/// same when it is built again.
fn check(scene: &Scene) -> Mesh {
    let mesh = mesh_of(scene, Refinement::Levels(1));
    for face in &mesh.faces {
        let roots = &mesh.roots[face.roots.0 as usize..face.roots.1 as usize];
        assert!(roots.iter().all(|r| twice_area(&r.corners) > 0.0));
        let sum: f64 = roots.iter().map(|r| twice_area(&r.corners)).sum();
        let whole = twice_area(&face.corners);
        assert!((sum - whole).abs() <= 1e-12 * whole, "{sum:e} of {whole:e}");
    }
    let again = mesh_of(scene, Refinement::Levels(1));
    assert!(mesh.element_corners == again.element_corners && mesh.seams == again.seams);
    mesh
}

/// No root of `face` lies on both sides of the segment from `p` to `q`, beyond the tolerance.
fn on_one_side(mesh: &Mesh, face: usize, p: DVec3, q: DVec3) {
    let tolerance = 4.0 * CONTACT * mesh.bounds.extent();
    let f = &mesh.faces[face];
    let (p, q) = (f.frame.project(p), f.frame.project(q));
    let along = (q - p).normalize();
    for r in f.roots.0..f.roots.1 {
        // The part of the root over the segment's length must not reach across its line.
        let corners = mesh.roots[r as usize].corners;
        let mut part = corners.to_vec();
        for (from, sign) in [(p, 1.0), (q, -1.0)] {
            let inside = |x: DVec2| sign * (x - from).dot(along) - tolerance;
            let mut kept = vec![];
            for i in 0..part.len() {
                let (a, b) = (part[i], part[(i + 1) % part.len()]);
                let (fa, fb) = (inside(a), inside(b));
                if fa >= 0.0 {
                    kept.push(a);
                }
                if fa * fb < 0.0 {
                    kept.push(a + (b - a) * (fa / (fa - fb)));
                }
            }
            part = kept;
        }
        let sides: Vec<f64> = part.iter().map(|&x| along.perp_dot(x - p)).collect();
        let (low, high) = sides.iter().fold((0.0f64, 0.0f64), |(l, h), &s| (l.min(s), h.max(s)));
        assert!(low >= -tolerance || high <= tolerance, "root {r} of face {face}: {low} {high}");
    }
}

/// The feet of blocks (as [`block`] makes them), checked against the floor: faces 0 and 1.
fn feet_are_cut(mesh: &Mesh, blocks: &[Vec<Quad>], map: impl Fn(DVec3) -> DVec3) {
    for quad in blocks.iter().flat_map(|b| &b[1..]) {
        let mut foot: Vec<DVec3> = quad.to_vec();
        foot.sort_by(|a, b| a.z.total_cmp(&b.z));
        for face in 0..2 {
            on_one_side(mesh, face, map(foot[0]), map(foot[1]));
        }
    }
}

#[test]
fn blocks_cut_the_floor() {
    let s = |x: f64| f64::from(x as f32);
    let cases: Vec<(&str, Vec<Vec<Quad>>)> = vec![
        ("in one triangle", vec![block(0.75, 0.25, 0.25, 0.0, 0.0)]),
        ("turned", vec![block(0.7, 0.3, 0.2, 0.3, 0.0)]),
        ("over the diagonal", vec![block(0.5, 0.5, 0.25, 0.0, 0.0)]),
        ("turned over the diagonal", vec![block(s(0.47), s(0.55), 0.3, 0.29, 0.0)]),
        ("corners on the diagonal", vec![block(0.5, 0.5, 0.25, 0.0, 0.0)]),
        ("side on the diagonal", vec![block(0.5, 0.5, 0.25, std::f64::consts::FRAC_PI_4, 0.0)]),
        ("two that touch", vec![block(0.4, 0.5, 0.2, 0.0, 0.0), block(0.6, 0.55, 0.2, 0.0, 0.0)]),
        ("in the floor's corner", vec![block(0.125, 0.125, 0.25, 0.0, 0.0)]),
        ("a little above", vec![block(0.45, 0.5, 0.2, 0.1, 1e-7)]),
        ("a little below", vec![block(0.45, 0.5, 0.2, 0.1, -1e-7)]),
        ("sunk in", vec![block(0.45, 0.5, 0.2, 0.1, -0.1)]),
        ("two that cross", vec![block(0.4, 0.5, 0.2, 0.0, 0.0), block(0.5, 0.55, 0.2, 0.4, 0.0)]),
    ];
    for (name, blocks) in &cases {
        let flat = on_floor(blocks);
        let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7);
        for (turn, scale, shift) in [
            (DMat3::IDENTITY, 1.0, DVec3::ZERO),
            (turn, 1e-3, DVec3::ZERO),
            (turn, 1e3, DVec3::splat(300.0)),
        ] {
            let moved = rotated(&flat, turn, scale, shift);
            let mesh = check(&moved);
            assert_eq!(mesh.contacts.left_whole, 0, "{name}");
            assert!(
                mesh.contacts.cut >= 1 && mesh.roots.len() < 400,
                "{name}: {mesh:?}",
                mesh = mesh.contacts
            );
            feet_are_cut(&mesh, blocks, |p| scale * (turn * p) + shift);
        }
    }
}

/// What is below is as dark, whether a block touches the floor or not.
#[test]
fn floating_blocks_cut_the_floor() {
    for foot in [1e-5, 1e-4, 1e-3, 1e-2] {
        for open in [false, true] {
            for (x, y, turn) in [(0.7, 0.3, 0.3), (0.5, 0.5, 0.0), (0.47, 0.55, 0.29)] {
                let mut blocks = vec![block(x, y, 0.25, turn, foot)];
                if !open {
                    let top = blocks[0][0];
                    blocks[0].push(top.map(|p| DVec3::new(p.x, p.y, foot)));
                }
                let mesh = check(&on_floor(&blocks));
                assert!(mesh.contacts.cut >= 1 && mesh.roots.len() < 200, "{:?}", mesh.contacts);
                blocks[0].truncate(5);
                feet_are_cut(&mesh, &blocks, |p| p);
            }
        }
    }
    // Light from all sides comes in below what is higher.
    let mesh = check(&on_floor(&[block(0.7, 0.3, 0.25, 0.3, 0.05)]));
    assert_eq!(mesh.contacts.cut, 0);
}

/// A wall that is not quite flat, and one that goes on at another height: nothing hovers.
#[test]
fn what_goes_on_beside_a_face_does_not_cut_it() {
    let mut bent = floor(0.0, 0.0, 1.0, 1.0, 0.0);
    for height in [1e-3, -1e-3] {
        bent[2].z = height;
        assert_eq!(check(&of(&[bent])).contacts.cut, 0);
    }
    let step = [floor(0.0, 0.0, 1.0, 1.0, 0.0), floor(1.0, 0.0, 2.0, 1.0, 1e-3)];
    assert_eq!(check(&of(&step)).contacts.cut, 0);
}

/// Strips below the rim of a sheet and beside it, if light is wanted to a tolerance, and else none.
#[test]
fn narrow_gaps_get_elements_of_their_own() {
    let sheet = [floor(0.0, 0.0, 1.0, 1.0, 0.0), floor(0.2, 0.3, 0.7, 0.6, 5e-3)];
    let mut scene = of(&sheet);
    scene.materials[0].two_sided = true;
    let options = MeshOptions { basis: Basis::Linear, refinement: Refinement::Levels(0) };
    let roots = |tolerance: f64| {
        lumel::mesh::build_to_tolerance(&scene, &options, tolerance).unwrap().roots.len()
    };
    let without = mesh_of(&scene, Refinement::Levels(0)).roots.len();
    assert_eq!(roots(3e-2), without);
    assert!(roots(1e-2) > without + 50, "{} and {without}", roots(1e-2));
    assert_eq!(roots(1e-3), roots(1e-2));
    // On both sides of the outline, three heights away.
    let mesh = lumel::mesh::build_to_tolerance(&scene, &options, 1e-2).unwrap();
    for x in [0.2 - 0.015, 0.2, 0.2 + 0.015] {
        for face in 0..mesh.faces.len() {
            if mesh.faces[face].triangle < 2 {
                on_one_side(&mesh, face, DVec3::new(x, 0.35, 0.0), DVec3::new(x, 0.55, 0.0));
            }
        }
    }
}

#[test]
fn coordinates_rounded_to_f32_make_no_slivers() {
    for k in 0..20 {
        let turn = 0.1 + 0.07 * f64::from(k);
        let blocks = vec![block(0.45, 0.5, 0.2, turn, 0.0), block(0.52, 0.48, 0.3, turn, 0.0)];
        let mut scene = on_floor(&blocks);
        for t in &mut scene.triangles {
            t.vertices = t.vertices.map(|v| v.as_vec3().as_dvec3());
        }
        let mesh = check(&scene);
        assert_eq!(mesh.contacts.left_whole, 0);
        for root in &mesh.roots {
            let c = root.corners;
            let longest = (0..3).map(|i| c[i].distance(c[(i + 1) % 3])).fold(0.0, f64::max);
            let height = twice_area(&c) / longest;
            assert!(height > 10.0 * CONTACT, "turn {turn}: height {height:e}");
        }
    }
}

#[test]
fn what_only_touches_in_points_or_along_edges_cuts_nothing() {
    let room = of(&box_quads(DVec3::ZERO, DVec3::ONE, false));
    let mesh = check(&room);
    assert_eq!((mesh.roots.len(), mesh.contacts), (12, Default::default()));
    let tip = [DVec3::new(0.5, 0.4, 0.0), DVec3::new(0.6, 0.4, 0.3), DVec3::new(0.5, 0.6, 0.4)];
    let mut scene = on_floor(&[]);
    scene.triangles.push(triangle(tip, 0));
    assert_eq!(check(&scene).roots.len(), 3);
    let floating = on_floor(&[block(0.5, 0.5, 0.25, 0.2, 0.05)]);
    assert_eq!(check(&floating).roots.len(), floating.triangles.len());
}

#[test]
fn the_papers_surface_stays_as_it_is() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/paper.gltf");
    let scene = lumel::scene::read(&path, &Default::default()).unwrap();
    let mesh = check(&scene);
    assert_eq!((mesh.roots.len(), mesh.contacts), (10, Default::default()));
    for (face, root) in mesh.faces.iter().zip(&mesh.roots) {
        assert_eq!((face.corners, root.level), (root.corners, 1));
    }
}

#[test]
fn crossing_walls_cut_each_other() {
    let wall = |x: bool| {
        [(0.1, 0.1), (0.9, 0.1), (0.9, 0.9), (0.1, 0.9)]
            .map(|(a, z)| if x { DVec3::new(a, 0.45, z) } else { DVec3::new(0.55, a, z) })
    };
    let mesh = check(&of(&[wall(true), wall(false)]));
    assert_eq!(mesh.contacts.cut, 4);
    for face in 0..4 {
        on_one_side(&mesh, face, DVec3::new(0.55, 0.45, 0.1), DVec3::new(0.55, 0.45, 0.9));
    }
}

#[test]
fn a_rug_cuts_the_floor_along_its_outline_only() {
    let rug = floor(0.2, 0.3, 0.7, 0.6, 0.0);
    let mesh = check(&of(&[floor(0.0, 0.0, 1.0, 1.0, 0.0), rug]));
    for face in 0..2 {
        for k in 0..4 {
            on_one_side(&mesh, face, rug[k], rug[(k + 1) % 4]);
        }
    }
    // The rug itself stays as it is, and so does the floor under its diagonal.
    assert_eq!(mesh.faces[2].roots.1 - mesh.faces[2].roots.0, 1);
    let middle = rug[0].lerp(rug[2], 0.3).truncate();
    let across = (0..2).flat_map(|f| roots_of(&mesh, f)).any(|t| {
        let side = |x: DVec3| (rug[2] - rug[0]).truncate().perp_dot(x.truncate() - middle);
        t.iter().any(|&x| side(x) > 0.02) && t.iter().any(|&x| side(x) < -0.02)
    });
    assert!(across);
}

#[test]
fn two_sided_faces_are_cut_alike_on_both_sides() {
    let mut scene = on_floor(&[block(0.45, 0.5, 0.2, 0.1, 0.0)]);
    scene.materials[0].two_sided = true;
    let mesh = check(&scene);
    let key = |t: [DVec3; 3]| {
        let mut points = t.map(|p| (p * 1e9).round().to_array().map(|x| x as i64));
        points.sort_unstable();
        points
    };
    for front in [0, 2] {
        let [mut a, mut b] =
            [front, front + 1].map(|f| roots_of(&mesh, f).into_iter().map(key).collect::<Vec<_>>());
        a.sort_unstable();
        b.sort_unstable();
        assert!(a == b && a.len() > 1);
    }
    // Seams on both sides: as many, and never between the sides.
    let back = |r: u32| mesh.faces[mesh.roots[r as usize].face as usize].back;
    assert!(mesh.seams.iter().all(|s| back(s.sides[0].0) == back(s.sides[1].0)));
    let backs = mesh.seams.iter().filter(|s| back(s.sides[0].0)).count();
    assert_eq!(2 * backs, mesh.seams.len());
}

#[test]
fn thousands_of_contacts_on_one_face_are_kept_in_bounds() {
    let blocks: Vec<_> = (0..900)
        .map(|i| {
            block(
                0.03 + 0.032 * f64::from(i % 30),
                0.03 + 0.032 * f64::from(i / 30),
                0.02,
                0.2,
                0.0,
            )
        })
        .chain([block(0.5, 0.5, 0.6, 0.3, 0.0)])
        .collect();
    let mesh = check(&on_floor(&blocks));
    assert!(mesh.contacts.simplified + mesh.contacts.left_whole >= 2, "{:?}", mesh.contacts);
    assert!(mesh.faces[..2].iter().all(|f| f.roots.1 - f.roots.0 <= 256));
}

#[test]
fn darkness_stays_below_the_blocks() {
    // A closed room whose floor goes on below two blocks without bottoms.
    let blocks = [
        vec![block(0.3, 0.4, 0.25, 0.3, 0.0), block(0.7, 0.6, 0.2, -0.2, 0.0)],
        vec![block(0.5, 0.5, 0.25, std::f64::consts::FRAC_PI_4, 0.0)],
    ];
    for blocks in blocks {
        let room = box_quads(DVec3::ZERO, DVec3::ONE, false);
        let scene = of(&[room, blocks.concat()].concat());
        let prepared = Prepared::new(&scene, Basis::Linear, Refinement::MaxEdge(0.3));
        let operator = exact_of(&prepared);
        let footprint = |p: DVec3| {
            blocks.iter().any(|b| {
                b[1..].iter().all(|q| {
                    let n = (q[1] - q[0]).cross(q[2] - q[0]);
                    n.dot(p - q[0]) < 0.0
                })
            })
        };
        let (mut inside, mut outside) = (0, 0);
        for (node, sum) in operator.row_sums(prepared.mesh.nodes()).into_iter().enumerate() {
            let (point, normal) = prepared.mesh.node(node);
            if point.z == 0.0 && normal.z == 1.0 {
                let want = if footprint(point) { 0.0 } else { 1.0 };
                assert!((sum - want).abs() <= 1e-9, "{point}: {sum}, not {want}");
                if want == 0.0 { inside += 1 } else { outside += 1 }
            }
        }
        assert!(inside >= 12 && outside >= 100, "{inside} {outside}");
    }
}

/// Irradiance on both sides of every seam, at many places along it.
fn jumps(mesh: &Mesh, vertices: &VertexIrradiance) -> f64 {
    let mut worst = 0.0f64;
    for seam in &mesh.seams {
        let [(line, f, r), (_, g, s)] = seam.sides.map(|(r, k)| {
            let root = &mesh.roots[r as usize];
            let face = root.face as usize;
            let lift = |i: u8| mesh.faces[face].frame.lift(root.corners[i as usize % 3]);
            ([lift(k), lift(k + 1)], face, r as usize)
        });
        for i in 0..=64 {
            let x = line[0].lerp(line[1], f64::from(i) / 64.0);
            let at = |face: usize, root: usize| {
                let p = mesh.faces[face].frame.project(x);
                let element = mesh.locate_in(root, p);
                let inside = mesh.weights(element, p).min_element() >= -1e-9;
                inside.then(|| vertices.at(mesh, element, p))
            };
            if let (Some(a), Some(b)) = (at(f, r), at(g, s)) {
                worst = worst.max((a - b).abs().max_element());
            }
        }
    }
    worst
}

#[test]
fn irradiance_is_continuous_across_seams_whatever_the_levels() {
    let blocks = [block(0.4, 0.5, 0.2, 0.1, 0.0), block(0.7, 0.45, 0.3, 0.4, 0.0)];
    let scene = on_floor(&blocks);
    for edge in [0.5, 0.2, 0.1, 0.03] {
        let mesh = mesh_of(&scene, Refinement::MaxEdge(edge));
        // Rough values: every node has its own.
        let value = |i: usize| DVec3::splat(1.0 + ((i * 7919) % 1013) as f64 / 1013.0);
        let values: Vec<DVec3> = (0..mesh.nodes()).map(value).collect();
        let worst = jumps(&mesh, &VertexIrradiance::new(&mesh, &values));
        assert!(worst <= 1e-9, "edge {edge}: {worst:e}");
        let levels = mesh.faces[0].roots.0..mesh.faces[1].roots.1;
        let levels: Vec<u32> = levels.map(|r| mesh.roots[r as usize].level).collect();
        assert!(edge > 0.3 || levels.iter().min() < levels.iter().max());
    }
}

#[test]
fn linear_irradiance_is_kept_and_contacts_keep_jumps() {
    let blocks = [block(0.45, 0.55, 0.25, 0.3, 0.0)];
    let scene = on_floor(&blocks);
    let mesh = mesh_of(&scene, Refinement::MaxEdge(0.1));
    // Linear outside of the footprint, zero inside.
    let turn = DMat3::from_rotation_z(-0.3);
    let outside = |p: DVec3| {
        let local = turn * (p - DVec3::new(0.45, 0.55, 0.0));
        local.abs().max_element() > 0.125
    };
    let light = |p: DVec3| DVec3::splat(1.0 + 2.0 * p.x + 3.0 * p.y + p.z);
    let values: Vec<DVec3> = (0..mesh.nodes())
        .map(|i| mesh.node(i).0)
        .map(|p| if outside(p) { light(p) } else { DVec3::ZERO })
        .collect();
    let vertices = VertexIrradiance::new(&mesh, &values);
    for i in 0..100 {
        for j in 0..100 {
            let p = DVec3::new(f64::from(i) + 0.5, f64::from(j) + 0.5, 0.0) / 100.0;
            let face = usize::from(p.y > p.x);
            let x = mesh.faces[face].frame.project(p);
            let got = vertices.at(&mesh, mesh.locate(face, x), x);
            let want = if outside(p) { light(p) } else { DVec3::ZERO };
            assert!((got - want).abs().max_element() < 1e-9, "{p}: {got}, not {want}");
        }
    }
}

#[test]
fn a_wall_on_the_diagonal_severs_the_floor() {
    let wall = |from: f64, to: f64| {
        let at = |s: f64, z: f64| DVec3::new(s, s, z);
        [at(from, 0.0), at(to, 0.0), at(to, 0.4), at(from, 0.4)]
    };
    let crossing = |quads: &[Quad]| {
        let mesh = check(&of(quads));
        let face = |r: u32| mesh.roots[r as usize].face;
        let seams = mesh.seams.iter().map(|s| s.sides.map(|(r, _)| face(r)));
        let patch = |f: usize| mesh.roots[mesh.faces[f].roots.0 as usize].patch;
        (seams.filter(|f| *f == [0, 1]).count(), patch(0) == patch(1))
    };
    let ground = floor(0.0, 0.0, 1.0, 1.0, 0.0);
    assert_eq!(crossing(&[ground]), (1, true));
    assert_eq!(crossing(&[ground, wall(0.0, 1.0)]), (0, false));
    let (count, one_patch) = crossing(&[ground, wall(0.25, 0.75)]);
    assert!(count >= 2 && one_patch);
}

#[test]
fn bounds_of_the_roots_are_those_of_the_scene() {
    let mesh = check(&on_floor(&[block(0.45, 0.5, 0.2, 0.1, 0.0)]));
    let all = (0..mesh.faces.len())
        .flat_map(|f| roots_of(&mesh, f))
        .fold(Bounds::EMPTY, |b, t| b.union(Bounds::of(&t)));
    assert!(all.min.distance(mesh.bounds.min) < 1e-12 && all.max.distance(mesh.bounds.max) < 1e-12);
}
