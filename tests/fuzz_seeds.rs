//! What the fuzz targets in `tools/fuzz` begin with, and what they found, goes through the same checks
//! in every run of the tests.

#[path = "../tools/fuzz/src/after.rs"]
mod after;
#[path = "../tools/fuzz/src/faces.rs"]
mod faces;
#[path = "../tools/fuzz/src/readers.rs"]
mod readers;

use std::fs;
use std::path::Path;

use lumel::scene::{ReadOptions, read};

/// The files of a reader: seeds, and what was found.
fn files(kind: &str) -> Vec<std::path::PathBuf> {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/fuzz");
    let mut list: Vec<_> = ["seeds", "found"]
        .iter()
        .filter_map(|folder| fs::read_dir(fuzz.join(folder).join(kind)).ok())
        .flatten()
        .map(|entry| entry.unwrap().path())
        .collect();
    list.sort();
    list
}

/// One after the other: memory is measured.
#[test]
fn seeds_are_read_and_solved() {
    every_reader_stands_its_seeds();
    seeds_of_scenes_are_scenes_that_can_be_solved();
}

fn every_reader_stands_its_seeds() {
    let room = tempfile::tempdir().unwrap();
    for (kind, reader) in readers::READERS {
        let files = files(kind);
        assert!(files.len() > 1, "there are no seeds of {kind}");
        for file in files {
            println!("{}", file.display());
            reader(room.path(), &fs::read(&file).unwrap());
        }
    }
}

/// Seeds that are all refused would begin nothing.
fn seeds_of_scenes_are_scenes_that_can_be_solved() {
    let room = tempfile::tempdir().unwrap();
    fs::write(room.path().join("picture"), readers::PICTURE).unwrap();
    fs::write(room.path().join("scene.mtl"), readers::MTL).unwrap();
    for kind in ["gltf", "glb", "obj"] {
        for file in files(kind).iter().filter(|f| f.to_string_lossy().contains("seeds")) {
            let path = room.path().join(format!("scene.{kind}"));
            fs::copy(file, &path).unwrap();
            let scene = read(&path, &ReadOptions::default())
                .unwrap_or_else(|error| panic!("{}: {error}", file.display()));
            after::use_scene(&scene, 0);
        }
    }
}
