//! Each reader with the files that it needs beside its own. Everything panics where the program
//! would, and where what is read breaks a promise.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use lumel::output::csv::{format_results, parse_points, read_points};
use lumel::output::machine;
use lumel::scene::{self, ReadOptions};

use crate::after::{number_of, refused, use_scene};

/// Most texels of a picture that is decoded: larger ones, up to the program's own limit, differ in
/// nothing but time.
const MOST_TEXELS: u64 = 1 << 20;

/// Bytes of memory for any file, for each byte of it, and for each texel, as the README states it.
const MEMORY_ANYWAY: u64 = 64 << 20;
const MEMORY_PER_BYTE: u64 = 600;
const MEMORY_PER_TEXEL: u64 = 24;

/// Polygons, concave ones too, negative indices, texture coordinates, a lamp.
pub const OBJ: &str = "\
mtllib scene.mtl
v 0 0 0
v 4 0 0
v 4 3 0
v 2 1 0
v 0 3 0
v 0 0 2
v 0 1 2
v 1 0 2
vt 0 0
vt 1 0
vt 1 1
usemtl wood
f 1/1 2/2 3/3 4/1 5/2
usemtl lamp
f -3/1 -2/2 -1/3
";

/// The materials of [`OBJ`], one of them with pictures.
pub const MTL: &str = "\
newmtl wood
Kd 0.5 0.25 0.125
map_Kd -s 2 2 1 -o 0.5 0 picture
newmtl lamp
Kd 0.1 0.1 0.1
Ke 10 9 8
map_Ke picture
";

/// Two by one texels.
pub const PICTURE: &[u8] = include_bytes!("../seeds/picture/two.png");

/// Has the bytes read as one kind of file, in a folder.
pub type Reader = fn(&Path, &[u8]);

/// Every reader by the name of its target.
pub const READERS: [(&str, Reader); 7] = [
    ("gltf", gltf),
    ("glb", glb),
    ("obj", obj),
    ("mtl", mtl),
    ("picture", picture),
    ("points", points),
    ("faces", crate::faces::faces),
];

/// A glTF document; buffers and pictures are inside of it, or are `picture` beside it.
pub fn gltf(folder: &Path, bytes: &[u8]) {
    if !bytes.starts_with(b"glTF") {
        scene(folder, "scene.gltf", bytes);
    }
}

/// A GLB container.
pub fn glb(folder: &Path, bytes: &[u8]) {
    scene(folder, "scene.glb", bytes);
}

/// An OBJ file; [`MTL`] is `scene.mtl` beside it.
pub fn obj(folder: &Path, bytes: &[u8]) {
    if !bytes.starts_with(b"glTF") {
        write(folder, "scene.mtl", MTL.as_bytes());
        scene(folder, "scene.obj", bytes);
    }
}

/// A material library, of [`OBJ`].
pub fn mtl(folder: &Path, bytes: &[u8]) {
    write(folder, "picture", PICTURE);
    write(folder, "scene.mtl", bytes);
    write(folder, "scene.obj", OBJ.as_bytes());
    read(folder, "scene.obj", bytes);
}

/// A picture, on the materials [`MTL`].
pub fn picture(folder: &Path, bytes: &[u8]) {
    let size = image::ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .ok()
        .and_then(|reader| reader.into_dimensions().ok());
    if size.is_some_and(|(w, h)| u64::from(w) * u64::from(h) > MOST_TEXELS) {
        return;
    }
    write(folder, "scene.mtl", MTL.as_bytes());
    write(folder, "scene.obj", OBJ.as_bytes());
    write(folder, "picture", bytes);
    read(folder, "scene.obj", bytes);
}

/// A table of points; what is read is written and read again.
pub fn points(folder: &Path, bytes: &[u8]) {
    write(folder, "points.csv", bytes);
    let path = folder.join("points.csv");
    match read_points(&path) {
        Ok(points) => {
            for p in &points {
                assert!(p.position.is_finite(), "{}", p.position);
                assert!((p.normal.length() - 1.0).abs() < 1e-12, "{}", p.normal);
            }
            let nothing = lumel::output::csv::ProbeResult { irradiance: None, radiosity: None };
            let text = format_results(&points, &vec![nothing; points.len()]);
            assert_eq!(parse_points(&path, &text).expect("what was written is read"), points);
        }
        Err(error) => refused(&error, &path.to_string_lossy()),
    }
}

/// Writes a scene, the picture beside it, and reads it.
fn scene(folder: &Path, name: &str, bytes: &[u8]) {
    write(folder, "picture", PICTURE);
    write(folder, name, bytes);
    read(folder, name, bytes);
}

/// Reads a scene; `bytes` are those that vary. Memory is what the README states, without what a
/// triangle takes to be meshed.
fn read(folder: &Path, name: &str, bytes: &[u8]) {
    let before = machine::peak_memory().unwrap_or(0);
    let result = scene::read(&folder.join(name), &ReadOptions::default());
    let grown = machine::peak_memory().unwrap_or(0).saturating_sub(before);
    let texels = result.as_ref().map_or(0, |scene| {
        scene.textures.iter().map(|t| u64::from(t.width) * u64::from(t.height)).sum()
    });
    let stated = MEMORY_ANYWAY + MEMORY_PER_BYTE * bytes.len() as u64 + MEMORY_PER_TEXEL * texels;
    assert!(grown <= stated, "{grown} bytes of memory for {}", bytes.len());
    match result {
        Ok(scene) => use_scene(&scene, number_of(bytes)),
        Err(error) => refused(&error, &folder.to_string_lossy()),
    }
}

pub(crate) fn write(folder: &Path, name: &str, bytes: &[u8]) {
    fs::write(folder.join(name), bytes).expect("the folder can be written to");
}
