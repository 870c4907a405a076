//! Files that nobody should have written: variants of good ones, broken at random, are read or
//! refused, soon and without much memory, and never with a panic.
//!
//! A scene that is read must be one that can be solved; a refusal names the file. Variants follow
//! from their number, which a failure prints: `HOSTILE=1234 cargo test --release --test hostile one`
//! reads that one alone. The long form is
//! `cargo test --release --test hostile -- --ignored --nocapture`.

// What must hold of scenes is what the fuzz targets check.
#[allow(dead_code)]
#[path = "../../tools/fuzz/src/after.rs"]
mod after;
mod change;
#[allow(dead_code)]
#[path = "../common/random.rs"]
mod random;
#[path = "../scene_support/mod.rs"]
mod scene_support;

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use lumel::output::csv::parse_points;
use lumel::output::machine;
use lumel::scene::{self, ReadOptions};
use random::Random;
use scene_support::{Gltf, grey, png};
use serde_json::json;

/// A file is read or refused in this time, on a machine that others use too: the good ones take a
/// hundredth of a second.
const LONGEST: Duration = Duration::from_secs(20);

/// Memory beside what the test itself needs: a multiple of the size of the file, and what a texture
/// that says it is large may take before it turns out that it is not.
const MEMORY_PER_BYTE: u64 = 2000;
const MEMORY_ANYWAY: u64 = 256 << 20;

/// A good file: its name, the files beside it, and how it is broken.
struct Good {
    name: String,
    bytes: Vec<u8>,
    beside: Vec<(String, Vec<u8>)>,
}

/// A scene with a texture, a second set of coordinates, vertex colours, instances and a camera.
fn rich() -> Gltf {
    let mut g = Gltf::triangle();
    let view = g.view(&png(4, 4, |x, y| [50 * x as u8, 60 * y as u8, 9]));
    let image = g.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
    let sampler = g.push("samplers", json!({"wrapS": 33071}));
    let texture = g.push("textures", json!({"source": image, "sampler": sampler}));
    let mut material = grey();
    material["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": texture, "texCoord": 1,
        "extensions": {"KHR_texture_transform": {"offset": [0.5, 0.5], "rotation": 0.3}}});
    material["emissiveFactor"] = json!([1.0, 0.5, 0.25]);
    material["emissiveTexture"] = json!({"index": texture});
    material["extensions"] = json!({"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}});
    material["doubleSided"] = json!(true);
    let material = g.push("materials", material);
    let positions = g.floats("VEC3", &[0., 0., 1., 2., 0., 1., 2., 2., 1., 0., 2., 1.]);
    let uv = [0., 0., 1., 0., 1., 1., 0., 1.];
    let (first, second) = (g.floats("VEC2", &uv), g.floats("VEC2", &uv));
    let colours = g.accessor(&[200; 16], "VEC4", 5121, 4);
    g.json["accessors"][colours]["normalized"] = json!(true);
    let indices = g.shorts(&[0, 1, 2, 0, 2, 3]);
    let node = g.mesh(
        "Quad",
        json!({"attributes": {"POSITION": positions, "TEXCOORD_0": first, "TEXCOORD_1": second,
            "COLOR_0": colours}, "indices": indices, "material": material}),
    );
    let mesh = g.json["nodes"][node]["mesh"].clone();
    g.root(json!({"mesh": mesh, "translation": [3, 0, 0], "scale": [1, 2, 1]}));
    let strip = g.floats("VEC3", &[5., 0., 0., 6., 0., 0., 5., 1., 0., 6., 1., 0.]);
    g.mesh("Strip", json!({"attributes": {"POSITION": strip}, "mode": 5}));
    let camera = g.push(
        "cameras",
        json!({"type": "orthographic",
        "orthographic": {"xmag": 2, "ymag": 1, "znear": 0, "zfar": 9}}),
    );
    g.root(json!({"camera": camera, "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,5,1]}));
    g
}

/// Polygons, concave ones too, negative indices, textures with options.
const RICH_OBJ: &str = "\
mtllib rich.mtl
o Wall
v 0 0 0
v 4 0 0
v 4 3 0
v 2 1 0
v 0 3 0
vt 0 0
vt 1 0
vt 1 1
vn 0 0 1
usemtl wood
s 1
f 1/1/1 2/2/1 3/3/1 4/1/1 5/2/1
g Roof
v 0 0 2 0.5 0.5 0.5
v 1 0 2 0.5 0.5 1
v 0 1 2 1 0.5 0.5
usemtl lamp
f -3 -2 -1
f 1//1 3//1 \\
  2//1
l 1 2
";

const RICH_MTL: &str = "\
newmtl wood
Kd 0.5 0.25 0.125
map_Kd -s 2 2 1 -o 0.5 0 -clamp on wood.png
d 0.5
Ns 10
newmtl lamp
Kd 0 0 0
Ke 10 9 8
";

fn goods() -> Vec<Good> {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let read = |name: &str| fs::read(scenes.join(name)).unwrap();
    let good = |name: &str, bytes: Vec<u8>, beside: &[(&str, Vec<u8>)]| Good {
        name: name.into(),
        bytes,
        beside: beside.iter().map(|(name, bytes)| (name.to_string(), bytes.clone())).collect(),
    };
    let wood = || ("wood.png", png(4, 4, |x, y| [9, 60 * x as u8, 60 * y as u8]));
    let mut list = vec![];
    for name in ["cornell.gltf", "furnace.gltf", "paper.gltf", "room.gltf"] {
        list.push(good(name, read(name), &[]));
    }
    list.push(good("rich.glb", rich().glb(), &[]));
    list.push(good("rich.gltf", rich().embedded().into_bytes(), &[]));
    list.push(good("cornell.obj", read("cornell.obj"), &[("cornell.mtl", read("cornell.mtl"))]));
    let mtl = ("rich.mtl", RICH_MTL.as_bytes().to_vec());
    list.push(good("rich.obj", RICH_OBJ.into(), &[mtl.clone(), wood()]));
    // What is beside a scene may be what is broken.
    list.push(good("rich.mtl", mtl.1.clone(), &[("rich.obj", RICH_OBJ.into()), wood()]));
    list.push(good("wood.png", wood().1, &[("rich.obj", RICH_OBJ.into()), mtl]));
    list
}

/// Writes a variant and what belongs to it; the scene file to read.
fn write(folder: &Path, good: &Good, number: u64) -> PathBuf {
    let mut random = Random::new(number);
    let bytes = if good.name.ends_with(".glb") || good.name.ends_with(".png") {
        change::glb_changed(&good.bytes, &mut random)
    } else {
        change::changed(&good.bytes, good.name.ends_with(".gltf"), &mut random)
    };
    fs::write(folder.join(&good.name), bytes).unwrap();
    good.beside.iter().for_each(|(name, bytes)| fs::write(folder.join(name), bytes).unwrap());
    let is_scene = |name: &&str| !name.ends_with(".mtl") && !name.ends_with(".png");
    let mut names =
        [good.name.as_str()].into_iter().chain(good.beside.iter().map(|b| b.0.as_str()));
    folder.join(names.rfind(is_scene).unwrap())
}

/// Reads a variant; whether it was a scene.
fn read(path: &Path) -> bool {
    match scene::read(path, &ReadOptions::default()) {
        Ok(scene) => {
            after::check(&scene);
            true
        }
        Err(error) => {
            let message = error.to_string();
            let folder = path.parent().unwrap().to_string_lossy();
            let is_memory = matches!(error, lumel::Error::Memory { .. });
            assert!(is_memory || message.contains(&*folder), "no file is named: {message}");
            assert!(is_memory || error.exit_code() == 3, "{message}");
            assert!(message.len() > folder.len() + 20, "too short: {message}");
            false
        }
    }
}

/// Reads variants with these numbers, and says how many of them were scenes.
fn read_all(numbers: impl Iterator<Item = u64>) -> usize {
    let room = tempfile::tempdir().unwrap();
    let goods = goods();
    // All of them as they are: they must be scenes.
    for good in &goods {
        write(room.path(), good, 0);
        fs::write(room.path().join(&good.name), &good.bytes).unwrap();
        if !good.name.ends_with(".mtl") && !good.name.ends_with(".png") {
            assert!(read(&room.path().join(&good.name)), "{}", good.name);
        }
    }
    let largest = goods.iter().map(|good| good.bytes.len() as u64).max().unwrap();
    let before = machine::peak_memory().unwrap_or(0);
    let mut scenes = 0;
    let mut slowest = (Duration::ZERO, 0);
    for number in numbers {
        let good = &goods[number as usize % goods.len()];
        let path = write(room.path(), good, number);
        let (send, receive) = channel();
        let begin = Instant::now();
        std::thread::spawn(move || {
            let result = catch_unwind(AssertUnwindSafe(|| read(&path)));
            let _ = send.send(result.map_err(drop));
        });
        // A panic's own message is printed by its thread.
        match receive.recv_timeout(LONGEST) {
            Ok(Ok(is_scene)) => scenes += usize::from(is_scene),
            Ok(Err(())) => panic!("HOSTILE={number} ({}): it panics", good.name),
            Err(_) => panic!("HOSTILE={number} ({}): it takes too long", good.name),
        }
        slowest = slowest.max((begin.elapsed(), number));
        let size = fs::metadata(room.path().join(&good.name)).unwrap().len().max(largest);
        let grown = machine::peak_memory().unwrap_or(0).saturating_sub(before);
        assert!(
            grown <= MEMORY_ANYWAY + MEMORY_PER_BYTE * size,
            "HOSTILE={number} ({}): {grown} bytes of memory for a file of {size}",
            good.name
        );
    }
    let grown = machine::peak_memory().unwrap_or(0).saturating_sub(before);
    println!("{scenes} scenes; slowest {slowest:?}; {} MiB of memory", grown >> 20);
    scenes
}

#[test]
fn broken_files_are_read_or_refused() {
    let count = 1000;
    let scenes = read_all(0..count);
    // Both happen, or this would test nothing.
    assert!(scenes > 100 && scenes < 900, "{scenes} of {count} were scenes");
}

#[test]
#[ignore = "minutes of computing"]
fn ten_thousand_broken_files_are_read_or_refused() {
    read_all(0..10_000);
}

/// For a look at one variant.
#[test]
#[ignore = "a tool: HOSTILE names the variant"]
fn one() {
    let number = std::env::var("HOSTILE").ok().and_then(|text| text.parse().ok());
    if let Some(number) = number {
        read_all(std::iter::once(number));
    }
}

#[test]
fn broken_tables_of_points_are_read_or_refused() {
    let good = "x,y,z,nx,ny,nz,name\r\n0,0,0,0,1,0,a\n# a comment\n\n\"1\", 2 ,3,0,0,-1,b\n1e3,2,-3,1,1,1,c\n";
    let path = Path::new("points.csv");
    let (mut tables, mut refused) = (0, 0);
    for number in 0..5000 {
        let bytes = change::changed(good.as_bytes(), false, &mut Random::new(number));
        match parse_points(path, &String::from_utf8_lossy(&bytes)) {
            Ok(points) => {
                tables += 1;
                for p in points {
                    assert!(p.position.is_finite(), "{number}: {}", p.position);
                    assert!((p.normal.length() - 1.0).abs() < 1e-12, "{number}: {}", p.normal);
                }
            }
            Err(error) => {
                refused += 1;
                assert_eq!(error.exit_code(), 3, "{number}: {error}");
                assert!(error.to_string().contains("points.csv"), "{number}: {error}");
            }
        }
    }
    assert!(tables > 500 && refused > 500, "{tables} {refused}");
}
