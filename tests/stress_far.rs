//! Scenes far from the origin, as maps have them: digits that a file has are kept, and digits that it
//! does not have are not looked for.

use std::fs;
use std::path::Path;

use glam::{DVec3, dvec3};
use lumel::mesh::{self, Basis, MeshOptions, Refinement};
use lumel::scene::{ReadOptions, Scene, read};
use tempfile::TempDir;

/// A floor of 4 x 3 m with a rug 1 cm above it, a block on it and a shelf on the block, moved by `far`;
/// coordinates as `write` writes them.
fn scene_at(far: DVec3, write: impl Fn(f64) -> String) -> Scene {
    let quad = |x: (f64, f64), y: (f64, f64), z: f64| {
        [dvec3(x.0, y.0, z), dvec3(x.1, y.0, z), dvec3(x.1, y.1, z), dvec3(x.0, y.1, z)]
    };
    let up = |x: (f64, f64), y: (f64, f64), z: (f64, f64)| {
        let (low, high) = (quad(x, y, z.0), quad(x, y, z.1));
        (0..4).map(move |k| [low[k], low[(k + 1) % 4], high[(k + 1) % 4], high[k]])
    };
    let mut quads = vec![quad((0.0, 4.0), (0.0, 3.0), 0.0), quad((0.31, 0.87), (0.42, 2.14), 0.01)];
    quads.extend(up((2.13, 2.78), (1.11, 1.73), (0.0, 0.57)));
    quads.push(quad((2.13, 2.78), (1.11, 1.73), 0.57));
    let mut text = String::new();
    for (k, quad) in quads.iter().enumerate() {
        for x in quad.map(|x| (x + far).to_array()) {
            text += &format!("v {} {} {}\n", write(x[0]), write(x[1]), write(x[2]));
        }
        text += &format!("o part{k}\nf {} {} {} {}\n", 4 * k + 1, 4 * k + 2, 4 * k + 3, 4 * k + 4);
    }
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("far.obj");
    fs::write(&path, text).unwrap();
    read(Path::new(&path), &ReadOptions::default()).unwrap()
}

fn roots(scene: &Scene) -> usize {
    let options = MeshOptions { basis: Basis::Linear, refinement: Refinement::Levels(0) };
    mesh::build(scene, &options).unwrap().roots.len()
}

const UTM: DVec3 = dvec3(500_123.0, 4_123_456.0, 117.0);

#[test]
fn centimetres_are_kept_on_a_map() {
    let two = |x: f64| format!("{x:.2}");
    let (here, there) = (scene_at(DVec3::ZERO, two), scene_at(UTM, two));
    assert_eq!((here.overlaps.cut, here.overlaps.covered), (0, 0));
    assert_eq!(there.overlaps, here.overlaps, "{:?}", there.notices);
    assert_eq!(there.triangles.len(), here.triangles.len());
    // The floor is cut along the foot of the block, and nothing else is.
    assert!(roots(&here) > here.triangles.len());
    assert_eq!(roots(&there), roots(&here));
}

#[test]
fn what_single_precision_blurred_is_brought_together() {
    // Numbers of f32 are half a metre apart there: the rug is in the floor.
    let single = |x: f64| format!("{}", f64::from(x as f32));
    let there = scene_at(UTM, single);
    assert!(there.rounding > 0.4 && there.contact_distance() > 0.4);
    let here = scene_at(DVec3::ZERO, single);
    assert!(here.contact_distance() < 1e-5);
    assert_eq!((here.overlaps.cut, here.overlaps.covered), (0, 0));
}
