//! The program as a user runs it: what is wrong is said, with the right exit code.

mod command_support;

use command_support::*;
use tempfile::TempDir;

/// A floor of 4 square metres and, 2 m above it, a lamp that shines down; one camera.
const SCENE: &str = r#"{
  "asset": {"version": "2.0"},
  "scene": 0,
  "scenes": [{"nodes": [0, 1, 2]}],
  "nodes": [
    {"name": "Floor", "mesh": 0},
    {"name": "Lamp", "mesh": 1, "translation": [0, 2, 0], "rotation": [1, 0, 0, 0]},
    {"name": "Desk", "camera": 0, "translation": [0, 1, 5]}
  ],
  "cameras": [{"name": "Desk", "type": "perspective",
               "perspective": {"yfov": 0.7, "znear": 0.1, "aspectRatio": 2.0}}],
  "meshes": [
    {"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]},
    {"primitives": [{"attributes": {"POSITION": 0}, "material": 1}]}
  ],
  "materials": [
    {"name": "floor", "pbrMetallicRoughness":
       {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0}},
    {"name": "lamp", "emissiveFactor": [1, 1, 0.5], "pbrMetallicRoughness":
       {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0}}
  ],
  "accessors": [{"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3",
                 "min": [-1, 0, -1], "max": [1, 0, 1]}],
  "bufferViews": [{"buffer": 0, "byteLength": 72}],
  "buffers": [{"byteLength": 72, "uri": "floor.bin"}]
}"#;

const SQUARE: [[f32; 3]; 6] = [
    [-1.0, 0.0, -1.0],
    [-1.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [-1.0, 0.0, -1.0],
    [1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
];

/// A directory with `room.gltf` and a table of points.
fn room() -> TempDir {
    let room = tempfile::tempdir().unwrap();
    let floor: Vec<u8> = SQUARE.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    std::fs::write(room.path().join("room.gltf"), SCENE).unwrap();
    std::fs::write(room.path().join("floor.bin"), floor).unwrap();
    std::fs::write(room.path().join("points.csv"), "x,y,z,nx,ny,nz\n0,0,0,0,1,0\n").unwrap();
    room
}

#[test]
fn help_and_version_are_results() {
    let room = room();
    for words in ["--help", "help", "inspect --help", "render --help", "probe -h", "--version"] {
        let output = lumel(room.path(), words);
        assert_eq!(code(&output), 0, "{words}");
        assert!(stdout(&output).contains("lumel"), "{words}");
        assert_eq!(stderr(&output), "", "{words}");
    }
    assert!(stdout(&lumel(room.path(), "--help")).contains("Exit codes"));
    assert!(stdout(&lumel(room.path(), "render --help")).contains("Examples:"));
}

#[test]
fn a_scene_is_exported_as_it_was_read() {
    let room = room();
    let output = lumel(
        room.path(),
        "inspect room.gltf --export scene.json --two-sided --light-scale 3 --size 20x10 --quiet",
    );
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(stdout(&output).contains("materials (2)"));
    let text = std::fs::read_to_string(room.path().join("scene.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let triangles = &json["triangles"];
    for list in ["vertices", "material", "object", "reflectance", "radiance"] {
        assert_eq!(triangles[list].as_array().unwrap().len(), 4, "{list}");
    }
    assert_eq!(json["materials"][1]["two_sided"], true);
    // The lamp hangs 2 m above the floor, and three times as bright.
    let lamp: Vec<f64> = serde_json::from_value(triangles["vertices"][2].clone()).unwrap();
    assert_eq!([lamp[1], lamp[4], lamp[7]], [2.0; 3]);
    let radiance: Vec<f64> = serde_json::from_value(triangles["radiance"][2].clone()).unwrap();
    for (value, wanted) in radiance.iter().zip([3.0, 3.0, 1.5]) {
        assert!((value - wanted).abs() < 1e-15);
    }
    assert_eq!(json["view"]["camera"], "Desk");
    assert_eq!((&json["view"]["width"], &json["view"]["height"]), (&20.into(), &10.into()));

    // The scene itself is no place to write to.
    let output = lumel(room.path(), "inspect room.gltf --export room.gltf");
    assert_ne!(code(&output), 0);
    assert!(stderr(&output).contains("also an input"), "{}", stderr(&output));
    assert_eq!(std::fs::read_to_string(room.path().join("room.gltf")).unwrap(), SCENE);
}

#[test]
fn wrong_words_are_usage_errors_that_teach() {
    let room = room();
    for (words, parts) in [
        ("", &["Usage"][..]),
        ("paint room.gltf", &["paint"]),
        ("inspect", &["SCENE"]),
        ("render room.gltf", &["--output"]),
        ("probe room.gltf", &["--points"]),
        ("inspect room.gltf --max-edge 0", &["above 0", "0.25"]),
        ("inspect room.gltf --max-edge -1", &["above 0"]),
        ("inspect room.gltf --max-edge 1 --subdivide 2", &["cannot be used with"]),
        ("inspect room.gltf --subdivide 99", &["0 to 15"]),
        ("inspect room.gltf --residual 2", &["1e-8"]),
        ("inspect room.gltf --max-memory 12", &["2GiB"]),
        ("inspect room.gltf --light-scale -1", &["at least 0"]),
        ("inspect room.gltf --emission lamp", &["lamp", "NAME=R,G,B"]),
        ("inspect room.gltf --emission lamp=1,2", &["lamp=1,2"]),
        ("inspect room.gltf --size 960", &["960x540"]),
        ("inspect room.gltf --eye 0,0,0", &["--look-at"]),
        ("inspect room.gltf --camera 0 --eye 0,0,0 --look-at 1,0,0", &["cannot be used with"]),
        ("inspect room.gltf --eye 0,0 --look-at 1,0,0", &["three numbers"]),
        ("inspect room.gltf --fov 60", &["--eye"]),
        ("inspect room.gltf --threads 0", &["threads"]),
        ("inspect room.gltf --basis cubic", &["constant", "linear"]),
        ("render room.gltf -o view.png --bits 12", &["8", "16"]),
        ("render room.gltf -o view.png --samples 0", &["1..=64"]),
        ("render room.gltf -o view.png --exposure bright", &["number"]),
    ] {
        fails(room.path(), words, 2, parts);
    }
}

#[test]
fn settings_that_do_not_fit_are_usage_errors_too() {
    let room = room();
    for (words, parts) in [
        ("render room.gltf -o view.jpg", &[".exr", ".png", ".hdr", "view.jpg"][..]),
        ("render room.gltf -o view.png --report view.png", &["same file"]),
        ("inspect room.gltf --eye 1,1,1 --look-at 1,1,1", &["same point"]),
        ("inspect room.gltf --camera Chair", &["Chair", "Desk"]),
        ("inspect room.gltf --emission chair=1,1,1", &["chair", "lamp"]),
    ] {
        fails(room.path(), words, 2, parts);
    }
}

#[test]
fn bad_scenes_and_points_have_exit_code_3() {
    let room = room();
    std::fs::write(room.path().join("broken.gltf"), "{").unwrap();
    std::fs::write(room.path().join("bad.csv"), "x,y,z,nx,ny,nz\n0,0,0,0,1,one\n").unwrap();
    fails(room.path(), "inspect missing.gltf", 3, &["Error: ", "missing.gltf"]);
    fails(room.path(), "inspect broken.gltf", 3, &["broken.gltf"]);
    fails(room.path(), "inspect room.blend", 3, &["room.blend"]);
    fails(room.path(), "probe room.gltf --points bad.csv", 3, &["bad.csv", "line 2", "one"]);
    fails(room.path(), "probe room.gltf --points none.csv", 3, &["none.csv"]);
}

#[test]
fn outputs_that_cannot_be_written_are_found_before_the_work() {
    let room = room();
    std::fs::create_dir(room.path().join("folder.png")).unwrap();
    for (words, parts) in [
        ("render missing.gltf -o no/view.png", &["no/view.png", "does not exist"][..]),
        ("render missing.gltf -o folder.png", &["folder.png", "directory"]),
        ("probe room.gltf --points points.csv -o points.csv", &["points.csv", "input"]),
        ("inspect room.gltf --report room.gltf", &["room.gltf", "input"]),
    ] {
        fails(room.path(), words, 1, parts);
    }
    assert_eq!(std::fs::read_to_string(room.path().join("room.gltf")).unwrap(), SCENE);
}

#[test]
fn a_time_limit_that_runs_out_has_exit_code_4() {
    let room = room();
    fails(room.path(), "inspect room.gltf --time-limit 1e-9", 4, &["--time-limit"]);
}

#[test]
fn inspect_prints_what_was_read() {
    let room = room();
    let output = lumel(room.path(), "inspect room.gltf");
    assert_eq!((code(&output), stderr(&output)), (0, String::new()));
    let text = stdout(&output);
    for part in ["materials (2)", "emitters (1)", "lamp", "cameras (1)", "Desk", "960 x 480 pixels"]
    {
        assert!(text.contains(part), "\"{part}\" is not in\n{text}");
    }
}

#[test]
fn inspect_forecasts_and_says_what_the_scene_lacks() {
    let room = room();
    let inspect = |words: &str| {
        let output = lumel(room.path(), &format!("inspect room.gltf {words}"));
        assert_eq!((code(&output), stderr(&output)), (0, String::new()), "{words}");
        stdout(&output)
    };
    let text = inspect("--subdivide 2 --max-memory 1GiB");
    for part in ["64 elements, 192 nodes", "1 GiB may be used"] {
        assert!(text.contains(part), "\"{part}\" is not in\n{text}");
    }
    assert!(!text.contains("notices"), "{text}");
    let text = inspect("--subdivide 4 --max-memory 1MB");
    assert!(text.contains("but only 976.6 KiB") && text.contains("--max-edge"), "{text}");
    let json: serde_json::Value =
        serde_json::from_str(&inspect("--subdivide 4 --max-memory 1MB --json")).unwrap();
    assert_eq!(json["forecast"]["elements"], 1024);
    assert_eq!(json["forecast"]["fits"], false);
    let dark = inspect("--emission *=0");
    assert!(dark.contains("scene: nothing emits light") && dark.contains("floor, lamp"), "{dark}");
    assert!(inspect("--light-scale 0").contains("--light-scale 0"));
    assert!(inspect("--reflectance *=0").contains("nothing reflects light"));
    let clamped = inspect("--reflectance floor=1.5");
    assert!(clamped.contains("material \"floor\": reflectance (1.5"), "{clamped}");
}

#[test]
fn inspect_can_print_json_and_write_a_report() {
    let room = room();
    let words = "inspect room.gltf --json --light-scale 2 --reflectance f*=0.25 --report r.json";
    let output = lumel(room.path(), words);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["faces"], 4);
    let radiance = json["materials"][1]["radiance"][0].as_f64().unwrap();
    assert!((radiance - 2.0).abs() < 1e-9, "{radiance}");
    let reflectance = json["materials"][0]["reflectance"][0].as_f64().unwrap();
    assert!((reflectance - 0.25).abs() < 1e-9, "{reflectance}");

    let report = std::fs::read(room.path().join("r.json")).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
    assert_eq!(report["command"], "inspect");
    assert_eq!(report["counts"]["faces"], 4);
    assert_eq!(report["settings"]["light-scale"], "2");
    assert_eq!(report["stages"][0]["name"], "read");
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_failure_but_a_full_disk_is() {
    use std::process::{Command, Stdio};
    let room = room();
    let run = |out: Stdio| {
        Command::new(assert_cmd::cargo::cargo_bin("lumel"))
            .current_dir(room.path())
            .args(["inspect", "room.gltf"])
            .stdout(out)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    };
    let mut child = run(Stdio::piped());
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((code(&output), stderr(&output)), (0, String::new()));

    if let Ok(full) = std::fs::OpenOptions::new().write(true).open("/dev/full") {
        let output = run(full.into()).wait_with_output().unwrap();
        assert_eq!(code(&output), 1);
        assert!(stderr(&output).contains("standard output"), "{}", stderr(&output));
    }
}
