//! Whatever happens to a bake on its way, old files stay whole: signals at random moments, two runs at
//! once, a full disk, a folder that goes away.
#![cfg(unix)]

mod command_support;
#[allow(dead_code)]
#[path = "common/random.rs"]
mod random;

use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use command_support::*;
use random::Random;

/// A quick bake that writes three files.
const BAKE: &str = "--size 64 --tolerance 5% --quiet --threads 1";

/// Files of `bake -o o.gltf`, sorted.
const FILES: [&str; 4] = ["o-bake.bin", "o-bake.json", "o-lightmap.exr", "o.gltf"];

fn start(room: &Path, options: &str) -> Child {
    Command::new(assert_cmd::cargo::cargo_bin("lumel"))
        .current_dir(room)
        .arg("bake")
        .arg(shipped("cornell.gltf"))
        .args(["-o", "o.gltf"])
        .args(options.split_whitespace())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn contents(room: &Path) -> Vec<Vec<u8>> {
    FILES.iter().map(|name| fs::read(room.join(name)).unwrap()).collect()
}

/// What an undisturbed bake writes, and how long it takes.
fn undisturbed(room: &Path) -> (Vec<Vec<u8>>, Duration) {
    let begin = Instant::now();
    let output = start(room, BAKE).wait_with_output().unwrap();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let took = begin.elapsed();
    let mut there = names_in(room);
    there.retain(|name| !name.starts_with("o.") || FILES.contains(&name.as_str()));
    assert!(FILES.iter().all(|name| there.contains(&name.to_string())), "{there:?}");
    (contents(room), took)
}

fn write_old(room: &Path) -> Vec<Vec<u8>> {
    FILES.iter().for_each(|name| fs::write(room.join(name), format!("old {name}")).unwrap());
    contents(room)
}

/// Bakes over old files and sends a signal after a part of the time that it takes.
fn disturbed(room: &Path, signal: &str, after: Duration) -> Output {
    let child = start(room, BAKE);
    std::thread::sleep(after);
    // It may have ended.
    let kill = format!("kill -{signal} {} 2> /dev/null || true", child.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    child.wait_with_output().unwrap()
}

#[test]
fn interrupted_at_any_moment_all_files_are_old_or_all_are_new() {
    let room = tempfile::tempdir().unwrap();
    let (new, took) = undisturbed(room.path());
    let names = names_in(room.path());
    let mut random = Random::new(1);
    let mut ends = [0; 2];
    for _ in 0..16 {
        let old = write_old(room.path());
        let output = disturbed(room.path(), "INT", took.mul_f64(1.1 * random.unit()));
        let found = contents(room.path());
        match output.status.code() {
            Some(130) => assert!(found == old, "interrupted, and not as it was"),
            Some(0) => assert!(found == new, "done, and not complete"),
            // Before the program listens to signals the system ends it.
            None => assert!(found == old && output.status.signal() == Some(2)),
            other => panic!("{other:?}: {}", stderr(&output)),
        }
        ends[usize::from(output.status.success())] += 1;
        assert_eq!(names_in(room.path()), names, "something was left behind");
    }
    assert!(ends[0] > 0, "no bake was interrupted: {ends:?}");
}

#[test]
fn killed_at_any_moment_each_file_is_old_or_new_and_the_next_run_works() {
    let room = tempfile::tempdir().unwrap();
    let (new, took) = undisturbed(room.path());
    let names = names_in(room.path());
    let mut random = Random::new(2);
    for _ in 0..16 {
        let old = write_old(room.path());
        disturbed(room.path(), "KILL", took.mul_f64(1.1 * random.unit()));
        for (k, found) in contents(room.path()).iter().enumerate() {
            assert!(*found == old[k] || *found == new[k], "{} is neither old nor new", FILES[k]);
        }
        // Nobody can clean up after this; what is left is told by its name.
        let left: Vec<String> =
            names_in(room.path()).into_iter().filter(|name| !names.contains(name)).collect();
        assert!(
            left.iter().all(|name| name.starts_with(".lumel-") && name.ends_with(".tmp")),
            "{left:?}"
        );
    }
    // As if the numbers of processes came round: the next temporary names are taken.
    let mut child = start(room.path(), BAKE);
    for number in 0..8 {
        let name = format!(".lumel-{}-{number}.tmp", child.id());
        let _ = fs::OpenOptions::new().write(true).create_new(true).open(room.path().join(name));
    }
    assert!(child.wait().unwrap().success());
    assert!(contents(room.path()) == new);
}

#[test]
fn two_runs_at_once_do_not_disturb_each_other() {
    let room = tempfile::tempdir().unwrap();
    let (new, _) = undisturbed(room.path());
    let names = names_in(room.path());
    for _ in 0..3 {
        write_old(room.path());
        let both = [start(room.path(), BAKE), start(room.path(), BAKE)];
        for child in both {
            let output = child.wait_with_output().unwrap();
            assert_eq!((code(&output), stderr(&output)), (0, String::new()));
        }
        assert!(contents(room.path()) == new);
        assert_eq!(names_in(room.path()), names);
    }
}

/// A limit on the size of files is as good as a full disk: writing fails on the way.
#[test]
fn a_full_disk_is_said_and_harms_nothing() {
    let room = tempfile::tempdir().unwrap();
    let old = write_old(room.path());
    let program = assert_cmd::cargo::cargo_bin("lumel");
    let full = |words: &str| {
        let line = format!("trap '' XFSZ; ulimit -f 4; exec '{}' {words}", program.display());
        let output = Command::new("sh").args(["-c", &line]).current_dir(room.path()).output();
        let output = output.unwrap();
        assert_eq!(code(&output), 1, "{words}: {}", stderr(&output));
        assert!(stderr(&output).contains("cannot be written: "), "{}", stderr(&output));
    };
    let scene = shipped("cornell.gltf");
    let scene = scene.display();
    full(&format!("bake {scene} -o o.gltf {BAKE}"));
    full(&format!("bake {scene} -o o.gltf {BAKE} --to vertices --max-triangles 2000"));
    assert!(contents(room.path()) == old);
    fs::write(room.path().join("v.png"), "old").unwrap();
    full(&format!("render {scene} -o v.png --size 160x160 --tolerance 5%"));
    assert_eq!(fs::read(room.path().join("v.png")).unwrap(), b"old");
    let names: Vec<String> = FILES.iter().map(|f| f.to_string()).chain(["v.png".into()]).collect();
    assert_eq!(names_in(room.path()), names);
    // A device that is full.
    if Path::new("/dev/full").exists() {
        std::os::unix::fs::symlink("/dev/full", room.path().join("full.png")).unwrap();
        let words = "render scenes/paper.gltf -o full.png --size 16x16 --tolerance 5%";
        fails(room.path(), words, 1, &["full.png: cannot be written"]);
    }
}

#[test]
fn a_folder_that_goes_away_or_closes_is_said() {
    let room = tempfile::tempdir().unwrap();
    let folder = room.path().join("out");
    fs::create_dir(&folder).unwrap();
    let child = start(&folder, "--size 256 --tolerance 1% --quiet --threads 1");
    std::thread::sleep(Duration::from_millis(200));
    fs::remove_dir_all(&folder).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(code(&output), 1, "{}", stderr(&output));
    assert!(stderr(&output).contains("cannot be written"), "{}", stderr(&output));
    assert_eq!(names_in(room.path()), [""; 0]);
}
