//! Builds small scene files for tests.
#![allow(dead_code)] // Each test binary uses its own part.

use std::fs;
use std::path::PathBuf;

use base64::Engine;
use glam::DVec3;
use lumel::Error;
use lumel::scene::{ReadOptions, Scene, read};
use serde_json::{Value, json};
use tempfile::TempDir;

/// A folder for one test.
pub struct Folder(pub TempDir);

impl Folder {
    pub fn new() -> Self {
        Folder(tempfile::tempdir().unwrap())
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, bytes).unwrap();
        path
    }

    pub fn read(&self, name: &str, bytes: impl AsRef<[u8]>) -> Result<Scene, Error> {
        read(&self.write(name, bytes), &ReadOptions::default())
    }
}

/// A glTF document being built; all data lie in one buffer.
#[derive(Clone)]
pub struct Gltf {
    pub json: Value,
    pub bin: Vec<u8>,
}

impl Gltf {
    pub fn empty() -> Self {
        let json = json!({
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [], "meshes": [], "accessors": [], "bufferViews": [],
            "buffers": [{"byteLength": 0}]
        });
        Gltf { json, bin: Vec::new() }
    }

    /// One right triangle of area 1/2 in the plane z = 0, named "Tri", with a grey material "Grey".
    pub fn triangle() -> Self {
        let mut g = Gltf::empty();
        g.push("materials", grey());
        let positions = g.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
        g.mesh("Tri", json!({"attributes": {"POSITION": positions}, "material": 0}));
        g
    }

    /// Appends to a member array; returns the new one's index.
    pub fn push(&mut self, member: &str, value: Value) -> usize {
        if self.json.get(member).is_none() {
            self.json[member] = json!([]);
        }
        let list = self.json[member].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.bin.len().is_multiple_of(4) {
            self.bin.push(0);
        }
        let offset = self.bin.len();
        self.bin.extend(bytes);
        self.push(
            "bufferViews",
            json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}),
        )
    }

    pub fn accessor(&mut self, bytes: &[u8], kind: &str, component: u32, count: usize) -> usize {
        let view = self.view(bytes);
        self.push(
            "accessors",
            json!({"bufferView": view, "type": kind, "componentType": component, "count": count}),
        )
    }

    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = match kind {
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 1,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, kind, 5126, values.len() / width)
    }

    pub fn shorts(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, "SCALAR", 5123, values.len())
    }

    /// A mesh of one primitive and a root node of the same name that uses it.
    pub fn mesh(&mut self, name: &str, primitive: Value) -> usize {
        let mesh = self.push("meshes", json!({"name": name, "primitives": [primitive]}));
        self.root(json!({"name": name, "mesh": mesh}))
    }

    pub fn root(&mut self, node: Value) -> usize {
        let node = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
        node
    }

    fn finished(&self) -> Value {
        let mut json = self.json.clone();
        json["buffers"][0]["byteLength"] = json!(self.bin.len());
        json
    }

    pub fn glb(&self) -> Vec<u8> {
        let mut text = self.finished().to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let mut glb = b"glTF".to_vec();
        let length = 12 + 8 + text.len() + 8 + bin.len();
        glb.extend(2u32.to_le_bytes());
        glb.extend((length as u32).to_le_bytes());
        glb.extend((text.len() as u32).to_le_bytes());
        glb.extend(b"JSON");
        glb.extend(text);
        glb.extend((bin.len() as u32).to_le_bytes());
        glb.extend(b"BIN\0");
        glb.extend(bin);
        glb
    }

    /// JSON with the buffer inside.
    pub fn embedded(&self) -> String {
        let mut json = self.finished();
        let data = base64::engine::general_purpose::STANDARD.encode(&self.bin);
        json["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{data}"));
        json.to_string()
    }

    /// JSON with the buffer at a URI.
    pub fn external(&self, uri: &str) -> String {
        let mut json = self.finished();
        json["buffers"][0]["uri"] = json!(uri);
        json.to_string()
    }

    pub fn read(&self) -> Result<Scene, Error> {
        Folder::new().read("scene.glb", self.glb())
    }
}

/// A material of reflectance 1/2.
pub fn grey() -> Value {
    json!({"name": "Grey", "pbrMetallicRoughness": {
        "baseColorFactor": [0.5, 0.5, 0.5, 1.0], "metallicFactor": 0.0
    }})
}

pub fn close(a: DVec3, b: DVec3) -> bool {
    (a - b).length() <= 1e-12 * (1.0 + b.length())
}

/// Sum of the areas of all triangles as vectors along their normals.
pub fn area_vector(scene: &Scene) -> DVec3 {
    (0..scene.triangles.len())
        .map(|i| scene.triangle_normal_and_area(i))
        .map(|(normal, area)| normal * area)
        .sum()
}

/// Whether there is a notice about something that says something.
pub fn noticed(scene: &Scene, about: &str, text: &str) -> bool {
    scene.notices.iter().any(|n| n.about.contains(about) && n.text.contains(text))
}

/// A PNG image of 8-bit RGB texels.
pub fn png(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 3]) -> Vec<u8> {
    let image = image::RgbImage::from_fn(width, height, |x, y| image::Rgb(texel(x, y)));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}
