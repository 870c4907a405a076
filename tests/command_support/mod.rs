//! Runs the program as a user would, and reads what it wrote.
#![allow(dead_code)] // Each test binary uses its own part.

use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;

/// The shipped scenes: all that lie in `scenes` except for what belongs to another file.
pub const SHIPPED: [&str; 5] =
    ["paper.gltf", "cornell.gltf", "cornell.obj", "room.gltf", "furnace.gltf"];

/// The path of a shipped scene.
pub fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

/// Runs the program in `directory` with words separated by spaces; a word `scenes/NAME` means a
/// shipped scene.
pub fn lumel(directory: &Path, words: &str) -> Output {
    let words = words.split_whitespace().map(|word| match word.strip_prefix("scenes/") {
        Some(name) => shipped(name),
        None => word.into(),
    });
    Command::cargo_bin("lumel").unwrap().current_dir(directory).args(words).output().unwrap()
}

/// Runs the program and demands that all goes well.
#[track_caller]
pub fn succeeds(directory: &Path, words: &str) -> Output {
    let output = lumel(directory, words);
    assert_eq!(code(&output), 0, "{words}: {}", stderr(&output));
    output
}

/// Runs the program and demands an exit code and parts of the message.
#[track_caller]
pub fn fails(directory: &Path, words: &str, wanted: i32, parts: &[&str]) {
    let output = lumel(directory, words);
    let message = stderr(&output);
    assert_eq!(code(&output), wanted, "{words}: {message}");
    assert_eq!(stdout(&output), "", "{words}: a failure prints no result");
    for part in parts {
        assert!(message.contains(part), "{words}: \"{part}\" is not in\n{message}");
    }
}

pub fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

pub fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Names of all files in a directory, sorted.
pub fn names_in(directory: &Path) -> Vec<String> {
    let names = std::fs::read_dir(directory).unwrap().map(|e| e.unwrap().file_name());
    let mut names: Vec<String> = names.map(|n| n.into_string().unwrap()).collect();
    names.sort();
    names
}

/// A JSON file.
pub fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// An EXR picture: width, pixels row by row, and text attributes of the kind `lumel:NAME`.
pub struct Exr {
    pub width: usize,
    pub pixels: Vec<[f32; 3]>,
    pub attributes: exr::meta::header::LayerAttributes,
}

impl Exr {
    pub fn read(path: &Path) -> Exr {
        use exr::prelude::*;
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .rgb_channels(
                |size, _| (size.x(), vec![[0f32; 3]; size.area()]),
                |(width, pixels), at, (r, g, b): (f32, f32, f32)| {
                    pixels[at.y() * *width + at.x()] = [r, g, b];
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_file(path)
            .unwrap();
        let (width, pixels) = image.layer_data.channel_data.pixels;
        Exr { width, pixels, attributes: image.layer_data.attributes }
    }

    /// The text attribute `lumel:NAME`.
    pub fn text(&self, name: &str) -> Option<String> {
        let name = exr::prelude::Text::from(format!("lumel:{name}").as_str());
        match self.attributes.other.get(&name) {
            Some(exr::prelude::AttributeValue::Text(value)) => Some(value.to_string()),
            _ => None,
        }
    }

    pub fn size(&self) -> (usize, usize) {
        (self.width, self.pixels.len() / self.width)
    }
}
