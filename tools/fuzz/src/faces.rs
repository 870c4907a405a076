//! Scenes of a few triangles from bytes: corners on a small grid, so that they coincide, touch and
//! cross all the time, moved by hairs and stretched by powers of ten.

use std::fmt::Write;
use std::path::Path;

use lumel::scene::{self, ReadOptions};

use crate::after::{number_of, refused, use_scene};
use crate::readers::write;

/// Most triangles: what more of them would find takes too long.
const MOST: usize = 32;

/// What is added to coordinates on the grid, by the high bits of their byte; mostly nothing.
const HAIRS: [f64; 16] =
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-15, 1e-12, -1e-12, 1e-9, -1e-7, 1e-6, 1e-3, 0.5];

/// Powers of ten that a scene is stretched by, by the first byte; mostly none.
const SCALES: [i32; 16] = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, -6, 6, -20, 20, -100, 29];

const MTL: &str = "newmtl wall\nKd 0.5 0.6 0.7\nnewmtl lamp\nKd 0.2 0.2 0.2\nKe 5 4 3\n";

/// Reads and solves the scene that the bytes stand for.
///
/// The first byte is the scale (low four bits), how far the scene is from the origin (next two)
/// and whether all is two-sided (the highest). Each ten bytes after it are a triangle: nine coordinates,
/// from 0 to 15 in the low four bits and [`HAIRS`] in the high ones, and a material.
pub fn faces(folder: &Path, bytes: &[u8]) {
    let Some((&first, rest)) = bytes.split_first() else { return };
    let (triangles, _) = rest.as_chunks::<10>();
    let scale = 10f64.powi(SCALES[usize::from(first & 15)]);
    let moved = [0.0, 1e3, 1e6, -1e9][usize::from(first >> 4 & 3)];
    let mut text = String::from("mtllib scene.mtl\n");
    for t in triangles.iter().take(MOST) {
        for p in t[..9].as_chunks::<3>().0 {
            let [x, y, z] =
                p.map(|b| (f64::from(b & 15) + HAIRS[usize::from(b >> 4)] + moved) * scale);
            let _ = writeln!(text, "v {x:?} {y:?} {z:?}");
        }
        let material = if t[9] & 3 == 0 { "lamp" } else { "wall" };
        let _ = writeln!(text, "usemtl {material}\nf -3 -2 -1");
    }
    write(folder, "scene.mtl", MTL.as_bytes());
    write(folder, "scene.obj", text.as_bytes());
    let options = ReadOptions { two_sided: first & 128 != 0, ..ReadOptions::default() };
    match scene::read(&folder.join("scene.obj"), &options) {
        Ok(scene) => use_scene(&scene, number_of(bytes)),
        Err(error) => refused(&error, &folder.to_string_lossy()),
    }
}
