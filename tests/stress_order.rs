//! The same bits whatever the number of threads and the order of objects in the file, run after run.

#[path = "common/random.rs"]
#[allow(dead_code)]
mod random;

use std::fs;
use std::path::{Path, PathBuf};

use lumel::Monitor;
use lumel::operator::Walker;
use lumel::render::{RenderOptions, render};
use lumel::scene::{ReadOptions, Scene, default_camera, read};
use lumel::solve::{WithinOptions, light_within};
use random::Random;
use rayon::prelude::*;
use serde_json::{Value, json};
use tempfile::TempDir;

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

/// Fisher and Yates.
fn shuffle<T>(list: &mut [T], random: &mut Random) {
    for k in (1..list.len()).rev() {
        list.swap(k, random.below(k + 1));
    }
}

/// A glTF file with its nodes in another order, and its materials as well.
fn shuffled_gltf(from: &Path, to: &Path, seed: u64) {
    let mut file: Value = serde_json::from_slice(&fs::read(from).unwrap()).unwrap();
    let mut random = Random::new(seed);
    shuffle(file["scenes"][0]["nodes"].as_array_mut().unwrap(), &mut random);
    let materials = file["materials"].as_array_mut().unwrap();
    let mut order: Vec<usize> = (0..materials.len()).collect();
    shuffle(&mut order, &mut random);
    let before = materials.clone();
    for (new, &old) in order.iter().enumerate() {
        materials[new] = before[old].clone();
    }
    for mesh in file["meshes"].as_array_mut().unwrap() {
        for primitive in mesh["primitives"].as_array_mut().unwrap() {
            if let Some(old) = primitive["material"].as_u64() {
                let new = order.iter().position(|&k| k as u64 == old).unwrap();
                primitive["material"] = json!(new);
            }
        }
    }
    fs::write(to, file.to_string()).unwrap();
}

/// An OBJ file with its objects in another order; all vertices come first.
fn shuffled_obj(from: &Path, to: &Path, seed: u64) {
    let text = fs::read_to_string(from).unwrap();
    let (mut head, mut objects): (Vec<String>, Vec<String>) = (vec![], vec![]);
    for line in text.lines() {
        if line.starts_with("o ") || line.starts_with("g ") {
            objects.push(String::new());
        }
        match objects.last_mut() {
            Some(object) => *object += &format!("{line}\n"),
            None => head.push(line.into()),
        }
    }
    assert!(objects.len() > 3 && !objects.iter().any(|o| o.lines().any(|l| l.starts_with("v "))));
    shuffle(&mut objects, &mut Random::new(seed));
    fs::write(to, head.join("\n") + "\n" + &objects.concat()).unwrap();
}

/// Bits of the irradiance at points of each triangle, with those of the triangle, and of a picture.
fn light_of(scene: &Scene, tolerance: f64) -> (Vec<[u64; 12]>, Vec<u32>) {
    let options = WithinOptions::new(tolerance, u64::MAX);
    let light = light_within(scene, &options, &Monitor::silent()).unwrap();
    let mut values: Vec<[u64; 12]> = scene
        .triangles
        .par_iter()
        .step_by(1 + scene.triangles.len() / 300)
        .map_init(Walker::default, |walker, t| {
            let [a, b, c] = t.vertices;
            let h = light.irradiance(walker, 0.5 * a + 0.3 * b + 0.2 * c, t.normal_and_area().0);
            let numbers = [a, b, c, h].map(|x| x.to_array().map(f64::to_bits));
            std::array::from_fn(|k| numbers[k / 3][k % 3])
        })
        .collect();
    values.sort_unstable();
    // Cameras come in the order of the file.
    let first = scene.cameras.iter().min_by(|a, b| a.name.cmp(&b.name));
    let camera = first.cloned().unwrap_or_else(|| default_camera(scene));
    let options = RenderOptions { width: 24, height: 24, samples: 1, gather: true };
    let (picture, _) = render(scene, &light, &camera, &options, &Monitor::silent()).unwrap();
    (values, picture.iter().flat_map(|p| p.map(f32::to_bits)).collect())
}

fn scene_at(path: &Path) -> Scene {
    read(path, &ReadOptions::default()).unwrap()
}

/// Checks that some orders of the objects of a shipped file give the same light.
fn any_order(name: &str, tolerance: f64, orders: u64) {
    let folder = TempDir::new().unwrap();
    let from = shipped(name);
    let want = light_of(&scene_at(&from), tolerance);
    let mut moved = 0;
    for seed in 0..orders {
        let to = folder.path().join(name);
        if name.ends_with(".obj") {
            fs::copy(from.with_extension("mtl"), to.with_extension("mtl")).unwrap();
            shuffled_obj(&from, &to, seed);
        } else {
            shuffled_gltf(&from, &to, seed);
        }
        let scene = scene_at(&to);
        moved += u32::from(scene.objects != scene_at(&from).objects);
        let found = light_of(&scene, tolerance);
        let same = found.0.iter().zip(&want.0).filter(|(a, b)| a == b).count();
        assert!(found == want, "{name}, order {seed}: {same} of {} values agree", want.0.len());
    }
    assert!(moved > 0, "{name}: the orders differ");
}

#[test]
fn the_order_of_objects_changes_no_bit() {
    any_order("cornell.gltf", 1e-2, 2);
    any_order("cornell.obj", 1e-2, 2);
    any_order("paper.gltf", 1e-2, 2);
    any_order("room.gltf", 3e-2, 1);
}

#[test]
fn the_order_of_objects_changes_no_bit_of_many_small_faces() {
    any_order("arcade.gltf", 0.2, 1);
}

#[test]
fn any_number_of_threads_and_any_run_gives_the_same_bits() {
    for (name, tolerance) in [("cornell.gltf", 1e-2), ("arcade.gltf", 0.2)] {
        let scene = scene_at(&shipped(name));
        let want = light_of(&scene, tolerance);
        for threads in [1, 2, 3, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let found = pool.install(|| light_of(&scene, tolerance));
            assert!(found == want, "{name} on {threads} threads");
        }
    }
}
