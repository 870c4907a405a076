//! What the fuzz targets share: how bytes reach each reader, what must hold of what comes out, and
//! mutations that know the formats.
#![forbid(unsafe_code)]

pub mod after;
#[path = "../../../tests/hostile/change.rs"]
mod change;
pub mod faces;
pub mod mutate;
#[allow(dead_code)]
#[path = "../../../tests/common/random.rs"]
mod random;
pub mod readers;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The folder of this process for the files that it reads: in memory where that can be had.
pub fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let memory = Path::new("/dev/shm");
        let room = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
        let folder = room.join(format!("lumel-fuzz-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder for the files that are read");
        folder
    })
}
