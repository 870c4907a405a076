//! Limits of time, memory and threads, and outputs that are inputs.

mod command_support;
mod scene_support;

use std::fs;
use std::process::Command;
use std::time::{Duration, Instant};

use command_support::*;
use scene_support::{Folder, Gltf, png};
use serde_json::json;

#[test]
fn any_number_of_threads_gives_the_same_file() {
    let room = tempfile::tempdir().unwrap();
    let render = |variable: Option<&str>, words: &str| {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("lumel"));
        command.current_dir(room.path()).arg("render").arg(shipped("cornell.gltf"));
        command.args(["-o", "v.exr", "--size", "24x24", "--tolerance", "5%"]);
        variable.map(|value| command.env("RAYON_NUM_THREADS", value));
        let output = command.args(words.split_whitespace()).output().unwrap();
        assert_eq!((code(&output), stderr(&output)), (0, String::new()), "{variable:?} {words}");
        fs::read(room.path().join("v.exr")).unwrap()
    };
    let one = render(None, "--threads 1");
    for (variable, words) in [
        (None, ""),
        (None, "--threads 64"),
        (None, "--threads 1024"),
        (Some("0"), ""),
        (Some("7"), ""),
        (Some("many"), ""),
        (Some("-1"), "--threads 2"),
    ] {
        assert!(render(variable, words) == one, "{variable:?} {words}");
    }
    for words in ["--threads 0", "--threads 1025", "--threads 99999999999999999999"] {
        let words = format!("render scenes/cornell.gltf -o v.exr {words}");
        fails(room.path(), &words, 2, &["--threads", "from 1 to 1024"]);
    }
}

/// Runs a command in a shell that has set a limit of memory, in KiB.
#[cfg(target_os = "linux")]
fn within_memory(room: &std::path::Path, kibibytes: u64, words: &str) -> std::process::Output {
    let program = assert_cmd::cargo::cargo_bin("lumel");
    let line = format!("ulimit -v {kibibytes}; exec '{}' {words}", program.display());
    Command::new("sh").args(["-c", &line]).current_dir(room).output().unwrap()
}

/// What is allowed is what is taken, but for what the program holds anyway: runs that would like to
/// have more end with their best under a real limit a little above it.
#[cfg(target_os = "linux")]
#[test]
fn memory_that_is_allowed_is_not_exceeded() {
    let room = tempfile::tempdir().unwrap();
    let scene = shipped("cornell.gltf");
    let words = format!(
        "render {} -o v.exr --size 64x64 --tolerance 0.05% --max-memory 24MiB --threads 2 \
         --report r.json --quiet",
        scene.display()
    );
    // Threads and libraries have room of their own, most of it never touched.
    let output = within_memory(room.path(), (24 + 300) << 10, &words);
    assert_eq!(code(&output), 4, "{}", stderr(&output));
    assert!(stderr(&output).contains("--max-memory"), "{}", stderr(&output));
    let report = json(&room.path().join("r.json"));
    let peak = report["values"]["peak_memory_bytes"].as_f64().unwrap();
    assert!(peak < f64::from((24 + 80) << 20), "{peak}");
    assert!(room.path().join("v.exr").exists());
    // Where nothing is said it follows from the limit.
    let words = format!("inspect {} --json --threads 1", scene.display());
    let output = within_memory(room.path(), 400_000, &words);
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["forecast"]["max_memory"], 400_000 * 1024 / 4 * 3);
}

#[test]
fn no_output_is_an_input_under_any_name() {
    let folder = Folder::new();
    let mut g = Gltf::triangle();
    let image = g.push("images", json!({"uri": "wood%20planks.png"}));
    let texture = g.push("textures", json!({"source": image}));
    g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": texture});
    folder.write("wood planks.png", png(2, 2, |_, _| [90; 3]));
    folder.write("s.bin", &g.bin);
    folder.write("s.gltf", g.external("s.bin"));
    folder.write("o.obj", "mtllib o.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
    folder.write("o.mtl", "newmtl a\nmap_Kd grey.png\n");
    folder.write("grey.png", png(2, 2, |_, _| [90; 3]));
    folder.write("p.csv", "x,y,z,nx,ny,nz\n0,0,0,0,0,1\n");
    let room = folder.0.path();
    #[cfg(unix)]
    std::os::unix::fs::symlink("s.gltf", room.join("soft.gltf")).unwrap();
    #[cfg(not(unix))]
    fs::hard_link(room.join("s.gltf"), room.join("soft.gltf")).unwrap();
    fs::hard_link(room.join("grey.png"), room.join("hard.png")).unwrap();
    fs::hard_link(room.join("wood planks.png"), room.join("hard-wood.png")).unwrap();
    let before: Vec<_> = names_in(room);
    let bytes = || before.iter().map(|n| fs::read(room.join(n)).unwrap()).collect::<Vec<_>>();
    let contents = bytes();
    for words in [
        "bake s.gltf -o s.gltf",
        "bake s.gltf -o soft.gltf",
        "bake s.gltf -o ./soft.gltf",
        "render s.gltf -o hard-wood.png",
        "render o.obj -o grey.png",
        "render o.obj -o hard.png",
        "render o.obj -o v.png --error-map grey.png",
        "render o.obj -o v.png --report o.mtl",
        "probe s.gltf --points p.csv -o s.bin",
        "probe s.gltf --points p.csv --report p.csv",
        "inspect s.gltf --report s.bin",
        "inspect o.obj --export o.mtl",
    ] {
        fails(room, words, 1, &["cannot be written", "also an input"]);
        assert_eq!(names_in(room), before, "{words}");
        assert!(bytes() == contents, "{words}");
    }
}

/// Runs a command to a time limit, which it may overrun by about `seconds` on a machine that does
/// nothing else, and returns its message. On a busy machine the limit may be over before there is
/// anything to write: then it is doubled.
fn hurried(room: &std::path::Path, words: &str, limit: f64, seconds: u64) -> String {
    let begin = Instant::now();
    let output = lumel(room, &format!("{words} --time-limit {limit}"));
    let took = begin.elapsed();
    if limit < 10.0 && stderr(&output).contains("before there was a result") {
        return hurried(room, words, 2.0 * limit, seconds);
    }
    assert_eq!(code(&output), 4, "{words}: {}", stderr(&output));
    assert!(took < Duration::from_secs(4 * seconds), "{words}: {took:?}");
    let message = stderr(&output);
    assert!(message.contains("--time-limit"), "{words}: {message}");
    message
}

#[test]
fn output_that_takes_too_long_is_coarse_and_said_to_be() {
    let room = tempfile::tempdir().unwrap();
    let words = "render scenes/cornell.gltf -o v.exr --tolerance 3% --size 3000x2000 --samples 16 \
                 --error-map e.exr --quiet";
    let message = hurried(room.path(), words, 1.5, 10);
    assert!(message.contains("an eighth of the pixels"), "{message}");
    let picture = Exr::read(&room.path().join("v.exr"));
    assert_eq!(picture.size(), (3000, 2000));
    assert!(picture.text("hurried").is_some());
    // As bright as it should be.
    let mean = |exr: &Exr| {
        let sum: f64 = exr.pixels.iter().flatten().map(|&v| f64::from(v)).sum();
        sum / exr.pixels.len() as f64
    };
    succeeds(
        room.path(),
        "render scenes/cornell.gltf -o w.exr --tolerance 3% --size 375x250 --quiet",
    );
    let small = Exr::read(&room.path().join("w.exr"));
    let (got, want) = (mean(&picture), mean(&small));
    assert!((got / want - 1.0).abs() < 1e-3, "{got} {want}");
    assert_eq!(Exr::read(&room.path().join("e.exr")).size(), (3000, 2000));

    let words = "bake scenes/cornell.gltf -o o.glb --tolerance 3% --size 4096 --quiet";
    let message = hurried(room.path(), words, 1.5, 10);
    assert!(message.contains("an eighth of the texels each way"), "{message}");
    let size = Exr::read(&room.path().join("o-lightmap.exr")).size();
    assert!(size.0 <= 512 && size.1 <= 512, "{size:?}");
    assert_eq!(json(&room.path().join("o-bake.json"))["settings"]["size"], "512");

    let words = "bake scenes/cornell.gltf -o t.glb --tolerance 0.2% --to vertices \
                 --max-triangles 9000000 --quiet";
    hurried(room.path(), words, 2.0, 10);
    assert!(room.path().join("t.glb").exists());
}

#[test]
fn points_that_time_does_not_suffice_for_are_empty() {
    let room = tempfile::tempdir().unwrap();
    let mut table = String::from("x,y,z,nx,ny,nz\n");
    for i in 0..1_000_000 {
        table.push_str(&format!("{},0,0.1,0,1,0\n", 0.5 * f64::from(i) / 1e6));
    }
    fs::write(room.path().join("p.csv"), table).unwrap();
    let words = "probe scenes/cornell.gltf --points p.csv -o r.csv --tolerance 3% \
                 --report r.json";
    let message = hurried(room.path(), words, 1.5, 10);
    assert!(message.contains("of 1000000 points have no values"), "{message}");
    let result = fs::read_to_string(room.path().join("r.csv")).unwrap();
    let columns = |line: &str| line.matches(',').count();
    assert!(result.lines().all(|line| columns(line) == 11), "a line has too few columns");
    let empty = result.lines().filter(|line| line.ends_with(",,,,,,")).count();
    let report = json(&room.path().join("r.json"));
    assert_eq!(report["counts"]["points without values"], empty);
    assert!(empty > 0 && empty < 1_000_000, "{empty}");
}
