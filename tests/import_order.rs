//! Keeps the structure of `src`: imports go one way, files stay small, nothing is unsafe.
//!
//! A *room* is a module directly below `src`. It imports only rooms that stand before it in
//! [`ORDER`], in its unit tests too: a test that needs more belongs here in `tests`. Paths are
//! found in the text, not by a parser: `crate::room`, `crate::{room, ...}` and `super::room`.
//! Comments do not count, so documentation may link forward.

use std::fs;
use std::path::{Path, PathBuf};

/// Rooms in the order of imports; those of one line never import each other.
const ORDER: [&[&str]; 17] = [
    &["error"],
    &["monitor"],
    &["geometry"],
    &["scene"],
    &["mesh"],
    &["cluster"],
    &["visibility"],
    &["kernel"],
    &["near", "gray", "far"],
    &["operator"],
    &["solve"],
    &["reconstruct"],
    &["output"],
    &["bake", "render", "probe", "audit", "reference"],
    // Names that belong to no room come from lib.rs, where rooms must not look.
    &["lib"],
    &["cli"],
    &["main"],
];

/// Most lines of a file: a longer one has a second subject.
const MOST_LINES: usize = 700;

fn rank(room: &str) -> Option<usize> {
    ORDER.iter().position(|rooms| rooms.contains(&room))
}

/// The room that a file belongs to: `src/mesh/refine.rs` to `mesh`.
fn room_of(path: &Path) -> String {
    let inside = path.strip_prefix("src").unwrap();
    let first = inside.components().next().unwrap().as_os_str().to_str().unwrap();
    first.trim_end_matches(".rs").to_string()
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The text without line comments.
fn code(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// What follows each place where `word` stands by itself.
fn after<'a>(code: &'a str, word: &'a str) -> impl Iterator<Item = &'a str> {
    code.match_indices(word).filter_map(move |(at, _)| {
        let rest = &code[at + word.len()..];
        let alone = !code[..at].ends_with(is_word) && !rest.starts_with(is_word);
        alone.then_some(rest)
    })
}

/// The first names of what follows `crate` or `super`: one, or several in braces.
fn first_names(rest: &str) -> Vec<String> {
    let Some(rest) = rest.trim_start().strip_prefix("::") else { return vec![] };
    let rest = rest.trim_start();
    let word = |text: &str| text.trim_start().chars().take_while(|&c| is_word(c)).collect();
    let Some(inside) = rest.strip_prefix('{') else { return vec![word(rest)] };
    let mut names: Vec<String> = vec![word(inside)];
    let mut depth = 1;
    for (at, c) in inside.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 1 => names.push(word(&inside[at + 1..])),
            _ => {}
        }
        if depth == 0 {
            break;
        }
    }
    names.retain(|name| !name.is_empty());
    names
}

/// Rooms that a file imports, each name once for each time it stands there.
fn imports(code: &str) -> Vec<String> {
    // In the module of a room itself `super` is the crate; elsewhere what follows is no room.
    let by_super = after(code, "super").flat_map(first_names).filter(|n| rank(n).is_some());
    let by_crate = after(code, "crate").flat_map(first_names);
    by_crate.map(|n| if rank(&n).is_some() { n } else { "lib".into() }).chain(by_super).collect()
}

/// What is wrong with a file.
fn faults(path: &Path, text: &str) -> Vec<String> {
    let name = path.display();
    let mut faults = vec![];
    let room = room_of(path);
    let code = code(text);
    match rank(&room) {
        None => faults.push(format!("{name}: \"{room}\" has no place in the order of imports")),
        Some(own) => {
            for other in imports(&code) {
                let forward = rank(&other).is_none_or(|rank| rank >= own);
                if other != room && room != "lib" && forward {
                    faults.push(format!("{name}: {room} imports {other}, which comes after it"));
                }
            }
        }
    }
    let lines = text.lines().count();
    if lines > MOST_LINES {
        faults.push(format!("{name}: {lines} lines, more than {MOST_LINES}"));
    }
    if after(&code, "unsafe").next().is_some() {
        faults.push(format!("{name}: unsafe code"));
    }
    faults
}

fn files(directory: &Path) -> Vec<PathBuf> {
    let mut found = vec![];
    for entry in fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn the_source_keeps_its_structure() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let files = files(&root.join("src"));
    assert!(files.len() > 50, "only {} files found", files.len());
    let faults: Vec<String> = files
        .iter()
        .flat_map(|path| {
            faults(path.strip_prefix(root).unwrap(), &fs::read_to_string(path).unwrap())
        })
        .collect();
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

#[test]
fn made_up_faults_are_found() {
    let count = |path: &str, text: &str| faults(Path::new(path), text).len();
    for (path, text) in [
        ("src/scene/read.rs", "use crate::mesh::Mesh;"),
        ("src/error.rs", "fn f() { crate::monitor::Monitor::silent(); }"),
        ("src/near/mod.rs", "use crate::{error::Result, gray::{self, Piece}};"),
        ("src/far/mod.rs", "use crate::{\n    mesh::{Mesh, Basis},\n    far::x,\n    near,\n};"),
        ("src/probe/mod.rs", "use super::render::Ray;"),
        ("src/mesh/mod.rs", "#[cfg(test)]\nmod tests { use crate::solve::Light; }"),
        ("src/solve/mod.rs", "use crate::Error;"),
        ("src/solve/mod.rs", "use crate::*;"),
        ("src/output/csv.rs", "use crate :: main;"),
        ("src/attic/mod.rs", ""),
        ("src/mesh/mod.rs", "pub unsafe fn f() {}"),
        ("src/mesh/mod.rs", &"\n".repeat(MOST_LINES + 1)),
    ] {
        assert_eq!(count(path, text), 1, "{path}: {text}");
    }
}

#[test]
fn what_is_in_order_is_no_fault() {
    for (path, text) in [
        ("src/scene/read.rs", "use crate::error::Result;\nuse super::{Scene, Error};"),
        ("src/scene/mod.rs", "//! [`crate::mesh`]\npub(crate) fn f() {} // crate::mesh, unsafe"),
        ("src/render/mod.rs", "use crate::{output::csv, render::Ray, scene::{self, mesh}};"),
        ("src/cli/view.rs", "use crate::cli::args::Cli;\nuse lumel::render;"),
        ("src/lib.rs", "#![forbid(unsafe_code)]\npub use error::{Error, Result};"),
        ("src/mesh/mod.rs", &"\n".repeat(MOST_LINES)),
    ] {
        let faults = faults(Path::new(path), text);
        assert!(faults.is_empty(), "{faults:?}");
    }
}
