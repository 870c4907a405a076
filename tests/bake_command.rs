//! `lumel bake` as a user runs it: files, light in them, and what happens to old ones.

mod command_support;

use std::f64::consts::PI;
use std::fs;
use std::path::Path;

use command_support::*;
use lumel::output::png_file::srgb_from_linear;
use lumel::scene::{self, ReadOptions, Scene};
use serde_json::Value;

/// Small pages, so that each scene takes a second.
const COARSE: &str = "--size 96 --tolerance 3%";

fn read(path: &Path) -> Scene {
    scene::read(path, &ReadOptions::default()).unwrap()
}

/// The JSON of a GLB file.
fn glb(path: &Path) -> Value {
    let file = fs::read(path).unwrap();
    let length = u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&file[20..20 + length]).unwrap()
}

/// Corners of all triangles in one order, as f32.
fn corners(scene: &Scene) -> Vec<[[u32; 3]; 3]> {
    let bits =
        |t: &scene::Triangle| t.vertices.map(|p| (p.as_vec3() + 0.0).to_array().map(f32::to_bits));
    let mut all: Vec<_> = scene.triangles.iter().map(bits).collect();
    all.sort_unstable();
    all
}

fn area(scene: &Scene) -> f64 {
    (0..scene.triangles.len()).map(|i| scene.triangle_normal_and_area(i).1).sum()
}

#[test]
fn every_shipped_scene_can_be_read_back() {
    let room = tempfile::tempdir().unwrap();
    for scene in SHIPPED {
        let before = read(&shipped(scene));
        for (output, options) in [
            ("a.glb", COARSE.to_string()),
            ("b.gltf", format!("{COARSE} --target three")),
            ("c.glb", "--to vertices --tolerance 5% --max-triangles 4000".into()),
        ] {
            let words = format!("bake scenes/{scene} -o {output} {options} --quiet");
            assert_eq!(stdout(&succeeds(room.path(), &words)), "", "{words}");
            let after = read(&room.path().join(output));
            if output != "c.glb" {
                assert_eq!(corners(&before), corners(&after), "{words}");
            }
            assert!((area(&before) - area(&after)).abs() < 1e-6 * area(&before), "{words}");
            assert_eq!(before.cameras.len(), after.cameras.len());
            let names = |s: &Scene| s.objects.iter().map(|o| o.name.clone()).collect::<Vec<_>>();
            assert_eq!(names(&before), names(&after), "{words}");
        }
    }
    let want = [
        "a-bake.json",
        "a-lightmap.exr",
        "a.glb",
        "b-bake.bin",
        "b-bake.json",
        "b-lightmap.exr",
        "b.gltf",
        "c-bake.json",
        "c.glb",
    ];
    assert_eq!(names_in(room.path()), want);
}

#[test]
fn a_furnace_is_the_same_everywhere_in_every_quantity() {
    const FINE: &str = "--size 96 --tolerance 0.1%";
    // E = 1 and rho = 1/2: u = E/(1 - rho) = 2 = H, and radiance is 2/pi.
    let room = tempfile::tempdir().unwrap();
    for (target, want) in
        [("three", 2.0), ("bevy", 2.0 / PI), ("blender", 2.0 / PI), ("unlit", 2.0 / PI)]
    {
        let words =
            format!("bake scenes/furnace.gltf -o f.glb {FINE} --target {target} --exposure -1");
        succeeds(room.path(), &format!("{words} --layers --quiet"));
        let exr = Exr::read(&room.path().join("f-lightmap.exr"));
        let sidecar = json(&room.path().join("f-bake.json"));
        assert_eq!(exr.text("quantity").as_deref(), sidecar["lightmap"]["quantity"].as_str());
        let of_surface = exr.pixels.iter().flatten().filter(|v| **v != 0.0);
        let (mut count, mut off) = (0, 0.0f64);
        for v in of_surface {
            count += 1;
            off = off.max((f64::from(*v) / want - 1.0).abs());
        }
        assert!(off < 1e-3, "{target}: {off}");
        assert!(count > exr.pixels.len(), "{target}: a third of the page is used at least");
        if target == "unlit" {
            let shown = &sidecar["shown"];
            assert_eq!(
                (shown["exposure_ev"].as_f64(), shown["scale"].as_f64()),
                (Some(-1.0), Some(2.0))
            );
        }
    }
    succeeds(
        room.path(),
        "bake scenes/furnace.gltf -o v.glb --to vertices --exposure -1 --tolerance 0.1%",
    );
    let scene = read(&room.path().join("v.glb"));
    for c in scene.triangles.iter().flat_map(|t| t.colour) {
        assert!((c / (1.0 / PI) - 1.0).abs().max_element() < 1e-3, "{c}");
    }
}

#[test]
fn the_number_of_threads_changes_no_byte() {
    let room = tempfile::tempdir().unwrap();
    for options in [
        "--size 128 --format exr --layers",
        "--target three --size 64 --format png",
        "--to vertices",
    ] {
        let files: Vec<Vec<Vec<u8>>> = ["1", "2", "3"]
            .iter()
            .map(|threads| {
                let own = tempfile::tempdir_in(room.path()).unwrap();
                let words =
                    format!("bake scenes/cornell.gltf -o o.gltf {options} --threads {threads}");
                succeeds(own.path(), &format!("{words} --tolerance 3% --quiet"));
                let names = names_in(own.path());
                assert!(names.len() >= 3);
                names.iter().map(|n| fs::read(own.path().join(n)).unwrap()).collect()
            })
            .collect();
        assert!(files[0] == files[1] && files[0] == files[2], "{options}");
    }
}

#[test]
fn layers_add_up_and_pictures_hold_what_floats_do() {
    use exr::prelude::{FlatSamples, read_first_flat_layer_from_file};
    let room = tempfile::tempdir().unwrap();
    let words = format!("bake scenes/cornell.gltf {COARSE} --quiet");
    succeeds(room.path(), &format!("{words} -o u.glb --layers"));
    succeeds(room.path(), &format!("{words} -o p.glb --format png"));
    let image = read_first_flat_layer_from_file(room.path().join("u-lightmap.exr")).unwrap();
    let channel = |name: &str| -> Vec<f32> {
        let all = &image.layer_data.channel_data.list;
        match &all.iter().find(|c| c.name.to_string() == name).expect(name).sample_data {
            FlatSamples::F32(values) => values.clone(),
            _ => panic!("{name} is not f32"),
        }
    };
    for c in ["R", "G", "B"] {
        let parts =
            ["direct", "indirect", "emission"].map(|layer| channel(&format!("{layer}.{c}")));
        assert!(parts.iter().all(|p| p.iter().any(|v| *v > 0.0)), "each has light in it");
        for (i, total) in channel(c).into_iter().enumerate() {
            let sum = parts[0][i] + parts[1][i] + parts[2][i];
            assert!((sum - total).abs() <= 1e-5 * (1.0 + total), "{c} {i}: {sum} {total}");
        }
    }
    // 16 bits in sRGB, with the scale that the description has.
    let scale = json(&room.path().join("p-bake.json"))["lightmap"]["scale"].as_f64().unwrap();
    let png = image::open(room.path().join("p-lightmap.png")).unwrap().to_rgb16();
    let exr = Exr::read(&room.path().join("u-lightmap.exr"));
    for (level, value) in png.pixels().zip(&exr.pixels) {
        for (level, value) in level.0.iter().zip(value) {
            let want = srgb_from_linear((f64::from(*value) / scale).clamp(0.0, 1.0));
            assert!((f64::from(*level) / 65535.0 - want).abs() < 2e-5, "{level} {value}");
        }
    }
}

#[test]
fn only_what_is_named_is_baked() {
    let room = tempfile::tempdir().unwrap();
    for options in [COARSE, "--to vertices --tolerance 3%"] {
        let words = format!("bake scenes/cornell.gltf -o o.glb --only *block --only red {options}");
        succeeds(room.path(), &format!("{words} --quiet"));
        let json = glb(&room.path().join("o.glb"));
        let materials = json["materials"].as_array().unwrap();
        for mesh in json["meshes"].as_array().unwrap() {
            let name = mesh["name"].as_str().unwrap();
            for primitive in mesh["primitives"].as_array().unwrap() {
                let material = &materials[primitive["material"].as_u64().unwrap() as usize];
                let unlit = material["extensions"]["KHR_materials_unlit"].is_object();
                let wanted = name.ends_with("block") || material["name"] == "red";
                assert_eq!(unlit, wanted, "{name}");
            }
        }
    }
}

#[test]
fn mistakes_are_answered_before_anything_long_begins() {
    let room = tempfile::tempdir().unwrap();
    fs::create_dir(room.path().join("x-lightmap.exr")).unwrap();
    fs::copy(shipped("cornell.gltf"), room.path().join("c.gltf")).unwrap();
    for (words, wanted, parts) in [
        ("scenes/cornell.gltf -o a.obj", 2, &[".glb", ".gltf"][..]),
        ("scenes/cornell.gltf -o a.glb --only Nothing", 2, &["Nothing", "--only"]),
        ("scenes/cornell.gltf -o a.glb --density Nothing=3", 2, &["Nothing"]),
        ("scenes/cornell.gltf -o a.glb --density floor", 2, &["NAME=N"]),
        ("scenes/cornell.gltf -o a.glb --size 3", 2, &["--size"]),
        ("scenes/cornell.gltf -o a.glb --texels-per-metre 0", 2, &["--texels-per-metre"]),
        ("scenes/cornell.gltf -o a.glb --target unity", 2, &["unlit", "three", "bevy", "blender"]),
        ("scenes/cornell.gltf -o a.glb --half --format hdr", 2, &["--half", "--format exr"]),
        ("scenes/cornell.gltf -o a.glb --texels-per-metre 1e9 --max-size 64", 1, &[]),
        ("c.gltf -o c.gltf", 1, &["also an input"]),
        ("scenes/cornell.gltf -o x.glb", 1, &["x-lightmap.exr", "directory"]),
        ("scenes/cornell.gltf -o no/such/x.glb", 1, &["does not exist"]),
        ("missing.gltf -o a.glb", 3, &["missing.gltf"]),
    ] {
        let output = lumel(room.path(), &format!("bake {words}"));
        let message = stderr(&output);
        if parts.is_empty() {
            // Clamped with a notice, or refused.
            assert!(!message.is_empty(), "{words}");
            continue;
        }
        assert_eq!(code(&output), wanted, "{words}: {message}");
        assert!(parts.iter().all(|p| message.contains(p)), "{words}: {message}");
    }
}

#[test]
fn a_report_and_a_description_say_how_good_it_is() {
    let room = tempfile::tempdir().unwrap();
    succeeds(room.path(), "bake scenes/cornell.gltf -o o.glb --size 128 --report r.json --quiet");
    let report = json(&room.path().join("r.json"));
    let sidecar = json(&room.path().join("o-bake.json"));
    let error = report["values"]["estimated error of the output rms"].as_f64().unwrap();
    assert_eq!(sidecar["estimated_error"].as_f64(), Some(error));
    assert!(error > 0.0 && error <= 0.01);
    assert_eq!(sidecar["settings"]["tolerance"], "0.01");
    assert_eq!(sidecar["pages"][0]["image"], "o-lightmap.exr");
    let page = &sidecar["pages"][0];
    for node in sidecar["nodes"].as_array().unwrap() {
        for r in node["rectangles"].as_array().unwrap() {
            for (place, size, side) in [("x", "width", "width"), ("y", "height", "height")] {
                let end = r[place].as_u64().unwrap() + r[size].as_u64().unwrap();
                assert!(r[size].as_u64().unwrap() > 0 && end <= page[side].as_u64().unwrap());
            }
        }
    }
    let exr = Exr::read(&room.path().join("o-lightmap.exr"));
    let size = ["width", "height"].map(|k| page[k].as_u64().unwrap() as usize);
    assert_eq!(exr.size(), (size[0], size[1]));
}

/// Starts a bake over old files, interrupts it after a while, and looks at what is left.
#[cfg(unix)]
fn interrupted(options: &str, after: u64) {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let room = tempfile::tempdir().unwrap();
    let old = ["o-bake.bin", "o-bake.json", "o-lightmap.exr", "o.gltf"];
    old.iter().for_each(|name| fs::write(room.path().join(name), "old").unwrap());
    let mut child = Command::new(assert_cmd::cargo::cargo_bin("lumel"))
        .current_dir(room.path())
        .arg("bake")
        .arg(shipped("room.gltf"))
        .args(["-o", "o.gltf", "--threads", "1", "--quiet"])
        .args(options.split_whitespace())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(after));
    assert!(child.try_wait().unwrap().is_none(), "{options}: the work is not long enough");
    let interruption = Instant::now();
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let output = child.wait_with_output().unwrap();
    assert!(interruption.elapsed() < Duration::from_secs(8), "{:?}", interruption.elapsed());
    assert_eq!((code(&output), stderr(&output)), (130, "Error: interrupted\n".into()), "{options}");
    assert_eq!(names_in(room.path()), old);
    for name in old {
        assert_eq!(fs::read(room.path().join(name)).unwrap(), b"old", "{name}");
    }
}

#[cfg(unix)]
#[test]
fn an_interruption_leaves_the_old_files_whole() {
    interrupted("--tolerance 0.05% --size 256", 300);
    interrupted("--tolerance 3% --size 4096", 8000);
    interrupted("--tolerance 0.02% --to vertices --max-triangles 2000000", 300);
}

#[test]
fn time_that_runs_out_still_leaves_a_result() {
    let room = tempfile::tempdir().unwrap();
    let words = "bake scenes/room.gltf -o o.glb --size 64 --tolerance 0.01% --time-limit 8 --quiet";
    fails(room.path(), words, 4, &["tolerance"]);
    assert_eq!(names_in(room.path()), ["o-bake.json", "o-lightmap.exr", "o.glb"]);
    // Not known where there was time for one mesh only.
    let error = json(&room.path().join("o-bake.json"))["estimated_error"].as_f64();
    assert!(error.is_none_or(|error| error > 1e-4), "{error:?}");
}

#[test]
fn inspect_says_what_lightmap_coordinates_lack() {
    let room = tempfile::tempdir().unwrap();
    let text = stdout(&succeeds(room.path(), "inspect scenes/cornell.gltf"));
    assert!(text.contains("missing in") && text.contains("TEXCOORD_1"), "{text}");
    // What bake made is good.
    succeeds(
        room.path(),
        &format!("bake scenes/cornell.gltf -o o.glb {COARSE} --target three --quiet"),
    );
    let text = stdout(&succeeds(room.path(), "inspect o.glb"));
    assert!(!text.contains("TEXCOORD_1"), "{text}");
    // And it is kept when it is baked again.
    succeeds(room.path(), &format!("bake o.glb -o p.glb {COARSE} --target three --quiet"));
    let (a, b) = (read(&room.path().join("o.glb")), read(&room.path().join("p.glb")));
    for (a, b) in a.triangles.iter().zip(&b.triangles) {
        assert!((0..3).all(|k| a.uv[1][k].distance(b.uv[1][k]) < 1e-6));
    }
}
