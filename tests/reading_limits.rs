//! Small files that ask for much: reading them takes time and memory in proportion to their size, or is
//! refused. Each of these took minutes, or gigabytes.

mod scene_support;

use std::time::{Duration, Instant};

use lumel::output::machine;
use lumel::scene::{ReadOptions, read};
use lumel::{Error, Result};
use scene_support::*;
use serde_json::json;

/// Half a second at most on a free machine.
const SOON: Duration = Duration::from_secs(15);

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// Reads soon.
#[track_caller]
fn soon<T>(work: impl FnOnce() -> T) -> T {
    let begin = Instant::now();
    let result = work();
    assert!(begin.elapsed() < SOON, "{:?}", begin.elapsed());
    result
}

#[test]
fn a_line_may_be_continued_a_million_times() {
    let text = format!("{TRIANGLE}#\nf 1 2 \\\n{}3\n", "\\\n".repeat(1_000_000));
    let scene = soon(|| Folder::new().read("s.obj", text)).unwrap();
    // The second face is the first one again.
    assert_eq!(scene.triangles.len(), 1);
    assert!(noticed(&scene, "object", "duplicate"));
    // One that ends with the file, too.
    let text = format!("{TRIANGLE}{}", "\\\n".repeat(1_000_000));
    assert_eq!(soon(|| Folder::new().read("s.obj", text)).unwrap().triangles.len(), 1);
}

#[test]
fn a_material_library_is_read_once() {
    let folder = Folder::new();
    let materials: String = (0..2000).map(|i| format!("newmtl m{i}\nKd 0.5 0.5 0.5\n")).collect();
    folder.write("m.mtl", materials);
    let lines = "mtllib m.mtl\nmtllib m.mtl missing.mtl m.mtl\n".repeat(20_000);
    let scene = soon(|| folder.read("s.obj", format!("{lines}{TRIANGLE}"))).unwrap();
    assert!(!noticed(&scene, "material", "more than once"), "{:?}", scene.notices);
    assert!(noticed(&scene, "missing.mtl", "missing"));
}

#[test]
fn an_image_is_looked_for_once_in_each_library() {
    let folder = Folder::new();
    // What follows the picture is skipped, but has to be read.
    let mut picture = png(2, 2, |x, y| [100 + 50 * x as u8, 100 + 50 * y as u8, 9]);
    picture.resize(4 << 20, 0);
    folder.write("a.png", picture);
    let materials: String =
        (0..20_000).map(|i| format!("newmtl m{i}\nKd 1 1 1\nmap_Kd a.png\n")).collect();
    folder.write("m.mtl", materials);
    let text = format!("mtllib m.mtl\nusemtl m7\n{TRIANGLE}");
    let scene = soon(|| folder.read("s.obj", text)).unwrap();
    assert_eq!(scene.textures.len(), 1);
    let used = |i: usize| scene.materials[i].reflectance_texture.as_ref().map(|t| t.texture);
    assert_eq!((used(7), used(19_999)), (Some(0), Some(0)));
}

#[test]
fn a_file_that_is_the_buffer_of_thousands_is_there_once() {
    let mut g = Gltf::triangle();
    let folder = Folder::new();
    let size = 4 << 20;
    let mut data = g.bin.clone();
    data.resize(size, 0);
    folder.write("b.bin", data);
    g.json["buffers"] = json!(vec![json!({"byteLength": size, "uri": "b.bin"}); 2000]);
    let text = g.json.to_string();
    let before = machine::peak_memory().unwrap_or(0);
    let scene = soon(|| folder.read("s.gltf", text)).unwrap();
    assert_eq!(scene.triangles.len(), 1);
    let grown = machine::peak_memory().unwrap_or(0).saturating_sub(before);
    assert!(grown < 1 << 30, "{grown} bytes for {size}");
    // Nor do elements without data count it again and again.
    g.json["accessors"][0] = json!({"type": "VEC3", "componentType": 5126, "count": size + 1,
        "sparse": {"count": 1, "indices": {"bufferView": 0, "componentType": 5121},
            "values": {"bufferView": 0}}});
    let message = folder.read("s.gltf", g.json.to_string()).unwrap_err().to_string();
    assert!(message.contains("without data"), "{message}");
}

/// An outline that goes round and round costs the cube of its length where ears are cut from it.
#[test]
fn outlines_that_go_round_and_round_are_cut_as_they_come() {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let round = |turns: usize| format!("{square}f{}\n", " 1 2 3 4".repeat(turns));
    let text = format!("{}{}", round(1000), round(1000).replace(square, "").repeat(20));
    let scene = soon(|| Folder::new().read("s.obj", text)).unwrap();
    assert!(noticed(&scene, "object", "cross themselves"), "{:?}", scene.notices);
    let area = area_vector(&scene).length();
    assert!((1.0..2.0 + 1e-12).contains(&area), "{area}");
    let error = Folder::new().read("s.obj", round(2000)).unwrap_err();
    let text = error.to_string();
    assert!(matches!(error, Error::Unsupported { .. }), "{text}");
    assert!(
        ["s.obj", "line 5", "8000 corners", "cut it"].iter().all(|p| text.contains(p)),
        "{text}"
    );
}

/// A square with holes along a line, each joined to the outline by a bridge: corners that are there
/// twice are no reason to cut it as it comes.
#[test]
fn outlines_with_many_holes_are_cut_well() {
    let holes = 60;
    let mut text = String::from("v 0 0 0\nv 100 0 0\nv 100 4 0\nv 0 4 0\n");
    let mut face = String::from("f 1");
    for i in 0..holes {
        // Down from the bottom edge to a triangle, clockwise about it, and back.
        let x = 1.5 * f64::from(i) + 1.0;
        let first = 5 + 4 * i;
        text += &format!("v {x} 0 0\nv {x} 1 0\nv {} 2 0\nv {} 1 0\n", x + 0.5, x + 1.0);
        let [foot, a, b, c] = [first, first + 1, first + 2, first + 3];
        face += &format!(" {foot} {a} {b} {c} {a} {foot}");
    }
    text += &format!("{face} 2 3 4\n");
    let scene = Folder::new().read("s.obj", text).unwrap();
    let area: f64 = (0..scene.triangles.len()).map(|i| scene.triangle_normal_and_area(i).1).sum();
    let want = 400.0 - 0.5 * f64::from(holes);
    assert!((area - want).abs() < 1e-9 * want, "{area} {want} {:?}", scene.notices);
    assert!(!noticed(&scene, "object", "cross themselves"), "{:?}", scene.notices);
}

fn limited(folder: &Folder, name: &str, bytes: impl AsRef<[u8]>, mib: u64) -> Result<usize> {
    let options = ReadOptions { max_memory: mib << 20, ..ReadOptions::default() };
    read(&folder.write(name, bytes), &options).map(|scene| scene.triangles.len())
}

/// One mesh in many places, many images in one colour: files of kilobytes that stand for gigabytes.
#[test]
fn scenes_that_do_not_fit_into_memory_are_refused() {
    let folder = Folder::new();
    let mut g = Gltf::triangle();
    // Thousands of triangles, each a step above the one before.
    let corners: Vec<f32> = (0..9000)
        .map(|i| [0., 0., 1., 0., 1., 1.][i % 3 * 2 + i / 3 % 2] + (i / 9) as f32)
        .collect();
    let positions = g.floats("VEC3", &corners);
    g.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(positions);
    for i in 1..100 {
        g.root(json!({"name": format!("copy {i}"), "mesh": 0, "translation": [0, 3 * i, 0]}));
    }
    let error = limited(&folder, "many.glb", g.glb(), 100).unwrap_err();
    let text = error.to_string();
    assert!(matches!(error, Error::Memory { .. }), "{text}");
    assert!(["many.glb", "copy ", "--max-memory"].iter().all(|p| text.contains(p)), "{text}");

    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_string() + &"f 1 2 3\n".repeat(100_000);
    let text = limited(&folder, "many.obj", obj, 100).unwrap_err().to_string();
    assert!(["many.obj", "object", "--max-memory"].iter().all(|p| text.contains(p)), "{text}");

    folder.write("a.png", png(2048, 2048, |_, _| [128; 3]));
    folder.write("b.png", png(2048, 2048, |_, _| [128; 3]));
    folder.write("m.mtl", "newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd b.png\n");
    let obj = format!("mtllib m.mtl\nusemtl a\n{TRIANGLE}");
    let error = limited(&folder, "picture.obj", &obj, 100).unwrap_err();
    let text = error.to_string();
    assert!(matches!(error, Error::Memory { .. }), "{text}");
    assert!(["b.png", "\"b\"", "--max-memory"].iter().all(|p| text.contains(p)), "{text}");
    assert_eq!(limited(&folder, "picture.obj", &obj, 200).unwrap(), 1);
    // What takes little is not refused, whatever the limit.
    assert_eq!(limited(&folder, "one.obj", TRIANGLE, 0).unwrap(), 1);
}

#[test]
fn other_versions_are_named_though_their_structures_differ() {
    for (text, version) in [
        (r#"{"asset": {"version": "1.0"}, "meshes": {"a": {}}, "accessors": {"b": {}}}"#, "1.0"),
        (r#"{"asset": {"version": 0.8}, "nodes": {"a": {}}}"#, "0.8"),
    ] {
        let error = Folder::new().read("old.gltf", text).unwrap_err();
        let said = error.to_string();
        assert!(matches!(error, Error::Unsupported { .. }), "{said}");
        assert!(["old.gltf", version, "2.0"].iter().all(|p| said.contains(p)), "{said}");
    }
}
