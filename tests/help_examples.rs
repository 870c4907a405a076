//! Every example of the help and of the README does what it says, in a shell, on small scenes that
//! have the names of the shipped ones (`--ignored`: on the shipped ones themselves).
#![cfg(unix)]

mod command_support;
mod scene_support;

use std::fs;
use std::path::Path;
use std::process::Command;

use command_support::*;
use scene_support::Gltf;
use serde_json::json;
use tempfile::TempDir;

/// A floor, a wall and a lamp, with names from the shipped scenes.
fn small_scene() -> Gltf {
    let mut g = Gltf::empty();
    let parts: [(&str, &str, [f32; 3], [f32; 12]); 3] = [
        ("floor", "white", [0.; 3], [0., 0., 0., 0., 0., 1., 1., 0., 1., 1., 0., 0.]),
        ("wall_north", "red", [0.; 3], [0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.]),
        ("light", "light", [9., 8., 6.], [0., 1., 0., 1., 1., 0., 1., 1., 1., 0., 1., 1.]),
    ];
    for (object, material, emission, corners) in parts {
        let material = g.push(
            "materials",
            json!({"name": material, "emissiveFactor": emission, "pbrMetallicRoughness":
                {"baseColorFactor": [0.6, 0.5, 0.4, 1.0], "metallicFactor": 0.0}}),
        );
        let positions = g.floats("VEC3", &corners);
        let indices = g.shorts(&[0, 1, 2, 0, 2, 3]);
        g.mesh(
            object,
            json!({"attributes": {"POSITION": positions}, "indices": indices, "material": material}),
        );
    }
    for name in ["overview", "table"] {
        let camera = g.push(
            "cameras",
            json!({"name": name, "type": "perspective",
                "perspective": {"yfov": 0.6, "znear": 0.1, "aspectRatio": 2.0}}),
        );
        g.root(json!({"name": name, "camera": camera, "translation": [0.5, 0.5, 3.0]}));
    }
    g
}

/// The same without cameras; its materials are those of the Cornell box.
const SMALL_OBJ: &str = "\
mtllib cornell.mtl
v 0 0 0
v 0 0 1
v 1 0 1
v 1 0 0
v 1 1 0
v 0 1 0
v 1 1 1
v 0 1 1
o floor
usemtl white
f 1 2 3 4
o wall_north
usemtl red
f 1 4 5 6
o light
usemtl light
f 6 5 7 8
";

/// A folder for examples: scenes in it and in `scenes` below it, a table of points, and the places
/// that completions and manuals go to.
fn place(shipped_ones: bool) -> TempDir {
    let room = tempfile::tempdir().unwrap();
    let at = |name: &str| room.path().join(name);
    for folder in [
        "scenes",
        "bin",
        ".zfunc",
        ".config/fish/completions",
        ".local/share/bash-completion/completions",
        ".local/share/man/man1",
    ] {
        fs::create_dir_all(at(folder)).unwrap();
    }
    for folder in ["", "scenes/"] {
        for name in ["cornell.mtl"].iter().chain(&SHIPPED) {
            let to = at(&format!("{folder}{name}"));
            match name.rsplit_once('.').unwrap().1 {
                _ if shipped_ones => drop(fs::copy(shipped(name), to).unwrap()),
                "gltf" => fs::write(to, small_scene().embedded()).unwrap(),
                "obj" => fs::write(to, SMALL_OBJ).unwrap(),
                _ => fs::copy(shipped(name), to).map(drop).unwrap(),
            }
        }
    }
    fs::write(at("desk.csv"), "x,y,z,nx,ny,nz\n0.3,0.5,0.3,0,1,0\n").unwrap();
    // Programs of others that examples hand their output to need not be here.
    for name in ["jq", "man"] {
        use std::os::unix::fs::PermissionsExt;
        fs::write(at(&format!("bin/{name}")), "#!/bin/sh\ncat > /dev/null\n").unwrap();
        let executable = fs::Permissions::from_mode(0o755);
        fs::set_permissions(at(&format!("bin/{name}")), executable).unwrap();
    }
    room
}

/// Lines that begin with `margin` and then with the program or what is written for it, lines that are
/// continued in one.
fn examples(text: &str, margin: &str) -> Vec<String> {
    let text = text.replace("\\\n", " ");
    let lines = text.lines().filter_map(|line| line.strip_prefix(margin));
    let ours = |line: &&str| line.starts_with("lumel ") || line.starts_with("printf ");
    lines.filter(ours).map(str::to_string).collect()
}

/// Runs a line in a shell; what it prints to standard error comes back.
fn run(room: &Path, line: &str) -> String {
    let program = assert_cmd::cargo::cargo_bin("lumel");
    let path = format!(
        "{}:{}:{}",
        room.join("bin").display(),
        program.parent().unwrap().display(),
        std::env::var("PATH").unwrap()
    );
    let output = Command::new("sh")
        .args(["-e", "-c", line])
        .current_dir(room)
        .env("PATH", path)
        .env("HOME", room)
        .output()
        .unwrap();
    assert!(output.status.success(), "{line}: {}", stderr(&output));
    stderr(&output)
}

/// All examples: of the help of the program and each command, and of the README.
fn all_examples() -> Vec<String> {
    let room = tempfile::tempdir().unwrap();
    let help = stdout(&succeeds(room.path(), "--help"));
    let commands: Vec<&str> = help
        .lines()
        .skip_while(|line| !line.starts_with("Commands:"))
        .skip(1)
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert!(commands.len() >= 7, "{commands:?}");
    let mut all = examples(&help, "  ");
    for command in commands {
        let help = stdout(&succeeds(room.path(), &format!("{command} --help")));
        let own = examples(&help, "  ");
        assert!(own.len() >= 2, "{command}: {own:?}");
        all.extend(own);
    }
    let readme = Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md");
    let own = examples(&fs::read_to_string(readme).unwrap(), "    ");
    assert!(own.len() > 10, "{own:?}");
    all.extend(own);
    all
}

#[test]
fn every_example_works() {
    let room = place(false);
    for line in all_examples() {
        // Larger tables take minutes.
        let line = line.replace("40960", "160").replace("163840", "40");
        let said = run(room.path(), &line);
        assert!(!said.contains("Error"), "{line}: {said}");
    }
}

#[test]
#[ignore = "minutes of computing"]
fn every_example_works_on_the_shipped_scenes() {
    let room = place(true);
    for line in all_examples().iter().filter(|line| !line.contains("163840")) {
        println!("{line}");
        assert_eq!(run(room.path(), line), "", "{line}");
    }
}
