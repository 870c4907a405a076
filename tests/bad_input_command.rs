//! Bad input through the program: the exit code tells its kind, the message names file and object,
//! and what stood where the result would go is unharmed. The kinds themselves, case by case, are
//! in `scene_bad_input`.

mod command_support;
mod scene_support;

use std::fs;

use command_support::*;
use scene_support::{Folder, Gltf};
use serde_json::{Value, json};

const OLD: &[u8] = b"an old picture";

/// Renders and probes `input`, with an old file where the result would go: both must fail.
#[track_caller]
fn refused(input: &Folder, words: &str, wanted: i32, parts: &[&str]) {
    let directory = input.0.path();
    input.write("old.exr", OLD);
    input.write("old.csv", OLD);
    input.write("points.csv", "x,y,z,nx,ny,nz\n0,0,0,0,0,1\n");
    let before = names_in(directory);
    for result in ["-o old.exr", "--points points.csv -o old.csv"] {
        let command = if result.contains("points") { "probe" } else { "render" };
        fails(directory, &format!("{command} {words} {result} --report r.json"), wanted, parts);
        assert_eq!(fs::read(directory.join("old.exr")).unwrap(), OLD, "{words}");
        assert_eq!(fs::read(directory.join("old.csv")).unwrap(), OLD, "{words}");
        assert_eq!(names_in(directory), before, "{words}: something was left behind");
    }
}

/// A file with these bytes must be refused as a bad scene.
#[track_caller]
fn refused_file(name: &str, bytes: impl AsRef<[u8]>, parts: &[&str]) {
    let input = Folder::new();
    input.write(name, bytes);
    refused(&input, name, 3, &[&["Error: ", name][..], parts].concat());
}

/// The usual triangle with some member changed.
fn changed(change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let mut g = Gltf::triangle();
    change(&mut g.json);
    g.glb()
}

#[test]
fn the_unchanged_triangle_is_accepted() {
    let input = Folder::new();
    input.write("good.glb", Gltf::triangle().glb());
    let output = succeeds(input.0.path(), "render good.glb -o view.png --size 8x8");
    assert!(stderr(&output).contains("nothing emits light"), "{}", stderr(&output));
}

#[test]
fn coordinates_that_are_no_numbers() {
    let mut g = Gltf::triangle();
    g.bin[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
    refused_file("bad.glb", g.glb(), &["mesh 0 \"Tri\", primitive 0", "vertex 1"]);
    refused_file("bad.obj", "o Wall\nv 0 nan 0\n", &["line 2", "object \"Wall\"", "nan"]);
}

#[test]
fn indices_past_the_end() {
    let mut g = Gltf::triangle();
    let indices = g.shorts(&[0, 1, 3]);
    g.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    refused_file("bad.glb", g.glb(), &["mesh 0 \"Tri\"", "index 3", "3 vertices"]);
    let bytes = changed(|j| j["nodes"][0]["mesh"] = json!(3));
    refused_file("bad.glb", bytes, &["node 0 \"Tri\"", "mesh 3 does not exist"]);
    refused_file("bad.obj", "o Wall\nv 0 0 0\nf 1 2 3\n", &["line 3", "object \"Wall\""]);
}

#[test]
fn nodes_that_are_no_trees() {
    let cycle = changed(|j| {
        j["nodes"] = json!([{"name": "A", "mesh": 0}, {"name": "B", "children": [2]},
            {"name": "C", "children": [1]}]);
    });
    refused_file("bad.glb", cycle, &["node 1 \"B\"", "cycle"]);
    let two_parents = changed(|j| {
        j["nodes"] = json!([{"name": "A", "mesh": 0}, {"name": "B", "children": [0]},
            {"name": "C", "children": [0]}]);
        j["scenes"][0]["nodes"] = json!([1, 2]);
    });
    refused_file("bad.glb", two_parents, &["node 0 \"A\"", "node 1 \"B\" and node 2 \"C\""]);
}

#[test]
fn accessors_of_wrong_types() {
    let mut g = Gltf::triangle();
    let flat = g.floats("VEC2", &[0.0; 6]);
    g.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(flat);
    refused_file("bad.glb", g.glb(), &["mesh 0 \"Tri\"", "POSITION", "must hold"]);
}

#[test]
fn files_that_are_missing_or_cut_off() {
    refused(&Folder::new(), "none.gltf", 3, &["none.gltf", "cannot be read"]);
    let g = Gltf::triangle();
    refused_file("bad.gltf", g.external("none.bin"), &["buffer 0", "none.bin"]);
    let glb = g.glb();
    refused_file("cut.glb", &glb[..glb.len() - 8], &["cut off"]);
    refused_file("cut.glb", &glb[..30], &[]);
    refused_file("cut.gltf", "{", &["JSON"]);
}

#[test]
fn extensions_that_are_required_and_unknown() {
    let bytes = changed(|j| j["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]));
    let parts = ["required extension KHR_draco_mesh_compression", "without compression"];
    refused_file("bad.glb", bytes, &parts);
}

#[test]
fn overrides_of_materials_that_are_not_there() {
    let input = Folder::new();
    input.write("good.glb", Gltf::triangle().glb());
    for option in ["--emission", "--reflectance"] {
        let words = format!("good.glb {option} Lamp=1,1,1");
        refused(&input, &words, 2, &["Error: ", option, "Lamp", "Grey"]);
    }
    refused(&input, "good.glb --emission Grey=1,nan,1", 2, &["--emission", "nan"]);
}

#[test]
fn points_that_are_no_points() {
    for (table, parts) in [
        ("", &["header", "x,y,z,nx,ny,nz"][..]),
        ("x,y,z,nx,ny\n0,0,0,0,1\n", &["line 1", "nz"]),
        ("x,y,z,nx,ny,nz\n0,0,0,0,1,one\n", &["line 2", "one"]),
        ("x,y,z,nx,ny,nz\n0,0,0,0,1\n", &["line 2", "5 fields"]),
        ("x,y,z,nx,ny,nz\n0,0,inf,0,1,0\n", &["line 2", "inf"]),
        ("x,y,z,nx,ny,nz\n0,0,0,0,0,0\n", &["line 2"]),
    ] {
        let input = Folder::new();
        input.write("good.glb", Gltf::triangle().glb());
        input.write("points.csv", table);
        input.write("old.csv", OLD);
        let words = "probe good.glb --points points.csv -o old.csv";
        fails(input.0.path(), words, 3, &[&["points.csv"][..], parts].concat());
        assert_eq!(fs::read(input.0.path().join("old.csv")).unwrap(), OLD);
    }
}
