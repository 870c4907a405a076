//! Results on disk: pictures, baked scenes, tables of values, reports, scenes for others.
//!
//! Everything is first encoded in memory by a function from data to bytes and then put in its
//! place by [`atomic::write_whole`]: a file is written whole or not at all, and the same data
//! give the same bytes (no time stamps, no unordered maps). The price is one encoded copy in
//! memory; a picture of 8 million pixels costs at most 100 MB for the moment of writing.

pub mod atomic;
pub mod camera_matrices;
pub mod csv;
pub mod export;
pub mod exr_file;
pub mod gltf_file;
pub mod gltf_mesh;
pub mod gltf_scene;
pub mod hdr_file;
pub mod machine;
pub mod picture;
pub mod png_file;
pub mod report;

/// Name and version of the program, as written into files.
pub const SOFTWARE: &str = concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION"));
