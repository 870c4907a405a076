//! Scenes built by hand, shared by the tests.
#![allow(dead_code)]

use glam::{DMat3, DVec2, DVec3};
use lumel::cluster::Clusters;
use lumel::mesh::{Basis, Mesh, MeshOptions, Refinement};
use lumel::monitor::Monitor;
use lumel::operator::{Operator, OperatorKind, Stage};
use lumel::scene::{Material, Object, Scene, Triangle};
use lumel::visibility::Occluders;

/// A grey material.
pub fn material(name: &str, reflectance: f64, radiance: f64) -> Material {
    Material {
        name: name.into(),
        reflectance: DVec3::splat(reflectance),
        reflectance_texture: None,
        metallic: 0.0,
        metallic_texture: None,
        radiance: DVec3::splat(radiance),
        radiance_texture: None,
        two_sided: false,
    }
}

pub fn triangle(vertices: [DVec3; 3], material: u32) -> Triangle {
    Triangle { vertices, uv: [[DVec2::ZERO; 3]; 2], colour: [DVec3::ONE; 3], material, object: 0 }
}

/// A scene of quads (two triangles each), with the index of a material each.
pub fn scene(quads: &[([DVec3; 4], u32)], materials: Vec<Material>) -> Scene {
    let triangles = quads
        .iter()
        .flat_map(|&([a, b, c, d], m)| [triangle([a, b, c], m), triangle([a, c, d], m)])
        .collect();
    Scene { triangles, materials, objects: vec![Object { name: "all".into() }], ..Scene::default() }
}

/// The six quads of a box, outward when `out`, else inward.
pub fn box_quads(min: DVec3, max: DVec3, out: bool) -> Vec<[DVec3; 4]> {
    let p = |x: u8, y: u8, z: u8| {
        DVec3::new(
            if x == 0 { min.x } else { max.x },
            if y == 0 { min.y } else { max.y },
            if z == 0 { min.z } else { max.z },
        )
    };
    let outward = [
        [p(0, 0, 0), p(0, 1, 0), p(1, 1, 0), p(1, 0, 0)],
        [p(0, 0, 1), p(1, 0, 1), p(1, 1, 1), p(0, 1, 1)],
        [p(0, 0, 0), p(1, 0, 0), p(1, 0, 1), p(0, 0, 1)],
        [p(0, 1, 0), p(0, 1, 1), p(1, 1, 1), p(1, 1, 0)],
        [p(0, 0, 0), p(0, 0, 1), p(0, 1, 1), p(0, 1, 0)],
        [p(1, 0, 0), p(1, 1, 0), p(1, 1, 1), p(1, 0, 1)],
    ];
    outward.into_iter().map(|[a, b, c, d]| if out { [a, b, c, d] } else { [d, c, b, a] }).collect()
}

/// A closed unit box that holds floating blocks.
pub fn box_room(blocks: &[(DVec3, DVec3)]) -> Scene {
    let mut quads: Vec<_> =
        box_quads(DVec3::ZERO, DVec3::ONE, false).into_iter().map(|q| (q, 0)).collect();
    for &(min, max) in blocks {
        quads.extend(box_quads(min, max, true).into_iter().map(|q| (q, 0)));
    }
    scene(&quads, vec![material("grey", 0.5, 0.0)])
}

/// Named scenes of a few faces.
pub fn scene_of(name: &str) -> Scene {
    assert_eq!(name, "plates and a lamp");
    let square = |z: f64, s: f64, up: bool| {
        let q = [
            DVec3::new(-s, -s, z),
            DVec3::new(s, -s, z),
            DVec3::new(s, s, z),
            DVec3::new(-s, s, z),
        ];
        if up { q } else { [q[3], q[2], q[1], q[0]] }
    };
    let wall = [
        DVec3::new(-2.0, 2.0, 0.0),
        DVec3::new(2.0, 2.0, 0.0),
        DVec3::new(2.0, 2.0, 1.5),
        DVec3::new(-2.0, 2.0, 1.5),
    ];
    let quads = [
        (square(0.0, 2.0, true), 0),
        (square(1.0, 0.7, true), 0),
        (square(1.0, 0.7, false), 0),
        (square(2.0, 0.5, false), 1),
        (wall, 0),
    ];
    scene(&quads, vec![material("grey", 0.6, 0.0), material("lamp", 0.2, 1.0)])
}

/// The scene turned, scaled and moved.
pub fn rotated(scene: &Scene, turn: DMat3, scale: f64, shift: DVec3) -> Scene {
    let mut moved = scene.clone();
    for t in &mut moved.triangles {
        t.vertices = t.vertices.map(|x| scale * (turn * x) + shift);
    }
    moved
}

/// A scene made ready for looking at.
pub struct Prepared {
    pub mesh: Mesh,
    pub clusters: Clusters,
    pub occluders: Occluders,
}

impl Prepared {
    pub fn new(scene: &Scene, basis: Basis, refinement: Refinement) -> Prepared {
        let mesh = lumel::mesh::build(scene, &MeshOptions { basis, refinement }).unwrap();
        let triangles: Vec<_> = scene.triangles.iter().map(|t| t.vertices).collect();
        let clusters = Clusters::build(&mesh);
        Prepared { mesh, clusters, occluders: Occluders::build(&triangles) }
    }

    pub fn stage(&self) -> Stage<'_> {
        Stage { mesh: &self.mesh, clusters: &self.clusters, occluders: &self.occluders }
    }
}

/// The exact operator of a prepared scene.
pub fn exact_of(prepared: &Prepared) -> Operator<'_> {
    Operator::build(prepared.stage(), OperatorKind::Exact, u64::MAX, &Monitor::silent()).unwrap()
}
