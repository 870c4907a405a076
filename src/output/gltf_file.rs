//! glTF 2.0 files: the JSON, the binary buffer and the two ways to put them on disk.
//!
//! A [`Document`] grows by buffer views, accessors and images; [`Document::to_glb`] makes one file
//! of it (binary glTF: a header of 12 bytes, a JSON chunk and a BIN chunk, each padded to four
//! bytes), [`Document::to_gltf`] a JSON file, a buffer and images beside it. Objects of the JSON are
//! sorted by key and nothing in it is a time or a path: the same data give the same bytes.

use serde_json::{Map, Value, json};

use crate::error::{Error, Result};
use crate::output::SOFTWARE;

/// Component types and targets of the specification (sections 5.1.3 and 5.11.5).
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// The largest file that its 32-bit lengths can hold.
const LARGEST: usize = u32::MAX as usize;

/// An encoded picture that belongs to a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Its file name, where it stands beside a `.gltf`; its name without extension otherwise.
    pub file: String,
    /// PNG data.
    pub png: Vec<u8>,
}

/// The name of a file and what is in it.
pub type NamedFile = (String, Vec<u8>);

/// A file that grows.
#[derive(Default)]
pub struct Document {
    /// Top-level arrays by name, such as `nodes`.
    arrays: Map<String, Value>,
    extensions: Vec<&'static str>,
    default_scene: bool,
    views: Vec<Value>,
    bytes: Vec<u8>,
    images: Vec<Image>,
    /// Written as `asset.extras`.
    pub extras: Value,
}

impl Document {
    /// Adds an object to a top-level array; its index.
    pub fn push(&mut self, array: &str, object: Value) -> usize {
        let list = self.arrays.entry(array).or_insert_with(|| json!([]));
        match list {
            Value::Array(list) => {
                list.push(object);
                list.len() - 1
            }
            _ => unreachable!("only arrays are made here"),
        }
    }

    /// Makes the first scene the one that is shown.
    pub fn default_scene(&mut self) {
        self.default_scene = true;
    }

    /// Notes that an extension is used.
    pub fn uses(&mut self, extension: &'static str) {
        if !self.extensions.contains(&extension) {
            self.extensions.push(extension);
        }
    }

    /// Adds vectors of `N` floats, with their bounds where `bounded` (positions must be); the index
    /// of the accessor.
    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]], bounded: bool) -> usize {
        let bytes = values.iter().flatten().flat_map(|v| v.to_le_bytes());
        let view = self.view(bytes, ARRAY_BUFFER);
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let mut accessor = json!({
            "bufferView": view, "componentType": FLOAT, "count": values.len(), "type": kind,
        });
        if bounded && let Some((first, rest)) = values.split_first() {
            let fold = |pick: fn(f32, f32) -> f32| {
                rest.iter().fold(*first, |a, b| std::array::from_fn(|k| pick(a[k], b[k])))
            };
            // A float is exact as a double, and so is what JSON says of it.
            let exact = |v: [f32; N]| v.map(f64::from).to_vec();
            accessor["min"] = json!(exact(fold(f32::min)));
            accessor["max"] = json!(exact(fold(f32::max)));
        }
        self.push("accessors", accessor)
    }

    /// Adds corner numbers of triangles; the index of the accessor.
    pub fn indices(&mut self, indices: &[u32]) -> usize {
        let bytes = indices.iter().flat_map(|v| v.to_le_bytes());
        let view = self.view(bytes, ELEMENT_ARRAY_BUFFER);
        let accessor = json!({
            "bufferView": view, "componentType": UNSIGNED_INT, "count": indices.len(),
            "type": "SCALAR",
        });
        self.push("accessors", accessor)
    }

    /// Adds a picture; the index of the image.
    pub fn image(&mut self, image: Image) -> usize {
        self.images.push(image);
        self.images.len() - 1
    }

    fn view(&mut self, bytes: impl Iterator<Item = u8>, target: u32) -> usize {
        let (offset, length) = append(&mut self.bytes, bytes);
        let view = json!({
            "buffer": 0, "byteOffset": offset, "byteLength": length, "target": target,
        });
        self.views.push(view);
        self.views.len() - 1
    }

    /// The whole as one binary file.
    pub fn to_glb(mut self) -> Result<Vec<u8>> {
        for image in std::mem::take(&mut self.images) {
            let (offset, length) = append(&mut self.bytes, image.png.into_iter());
            self.views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": length }));
            let view = self.views.len() - 1;
            let name = image.file.rsplit_once('.').map_or(image.file.as_str(), |(stem, _)| stem);
            self.push(
                "images",
                json!({ "bufferView": view, "mimeType": "image/png", "name": name }),
            );
        }
        pad(&mut self.bytes, 0);
        let buffer = json!({ "byteLength": self.bytes.len() });
        let bytes = std::mem::take(&mut self.bytes);
        let mut text = self.text((!bytes.is_empty()).then_some(buffer), false)?;
        pad(&mut text, b' ');
        // Header, two chunk headers.
        let total = 12 + 8 + text.len() + if bytes.is_empty() { 0 } else { 8 + bytes.len() };
        if total > LARGEST {
            return Err(Error::Runtime(format!(
                "a GLB file holds at most 4 GiB, and this one would have {total} bytes: bake fewer \
                 or smaller pages, or write a .gltf file"
            )));
        }
        let mut file = Vec::with_capacity(total);
        let word = |file: &mut Vec<u8>, n: usize| file.extend((n as u32).to_le_bytes());
        file.extend(b"glTF");
        word(&mut file, 2);
        word(&mut file, total);
        for (kind, chunk) in [(b"JSON", text), (b"BIN\0", bytes)] {
            if !chunk.is_empty() {
                word(&mut file, chunk.len());
                file.extend(kind);
                file.extend(chunk);
            }
        }
        Ok(file)
    }

    /// The JSON text, and the files beside it by name: the buffer `buffer_file` and the images.
    pub fn to_gltf(mut self, buffer_file: &str) -> Result<(Vec<u8>, Vec<NamedFile>)> {
        let mut beside = vec![];
        for image in std::mem::take(&mut self.images) {
            let uri = escaped(&image.file);
            self.push("images", json!({ "uri": uri, "mimeType": "image/png" }));
            beside.push((image.file, image.png));
        }
        let bytes = std::mem::take(&mut self.bytes);
        let buffer = json!({ "byteLength": bytes.len(), "uri": escaped(buffer_file) });
        let text = self.text((!bytes.is_empty()).then_some(buffer), true)?;
        if !bytes.is_empty() {
            beside.push((buffer_file.to_string(), bytes));
        }
        Ok((text, beside))
    }

    fn text(self, buffer: Option<Value>, pretty: bool) -> Result<Vec<u8>> {
        let mut root = self.arrays;
        let mut asset = json!({ "version": "2.0", "generator": SOFTWARE });
        if !self.extras.is_null() {
            asset["extras"] = self.extras;
        }
        root.insert("asset".into(), asset);
        if self.default_scene {
            root.insert("scene".into(), json!(0));
        }
        if let Some(buffer) = buffer {
            root.insert("buffers".into(), json!([buffer]));
            root.insert("bufferViews".into(), Value::Array(self.views));
        }
        if !self.extensions.is_empty() {
            root.insert("extensionsUsed".into(), json!(self.extensions));
        }
        let write = if pretty { serde_json::to_vec_pretty } else { serde_json::to_vec };
        write(&Value::Object(root)).map_err(|e| Error::Runtime(format!("glTF: {e}")))
    }
}

/// Appends at a multiple of four bytes; offset and length.
fn append(bytes: &mut Vec<u8>, more: impl Iterator<Item = u8>) -> (usize, usize) {
    pad(bytes, 0);
    let offset = bytes.len();
    bytes.extend(more);
    (offset, bytes.len() - offset)
}

fn pad(bytes: &mut Vec<u8>, with: u8) {
    bytes.resize(bytes.len().next_multiple_of(4), with);
}

/// A file name as a relative URI (RFC 3986): all but unreserved characters as %XX.
fn escaped(name: &str) -> String {
    let mut uri = String::new();
    for byte in name.bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => {
                uri.push(char::from(byte));
            }
            _ => uri.push_str(&format!("%{byte:02X}")),
        }
    }
    uri
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_are_padded_and_lengths_add_up() {
        let mut document = Document::default();
        let positions = [[0.1f32, -2.0, 3.0], [0.5, 7.0, -1.0], [0.0, 0.0, 0.0]];
        document.floats(&positions, true);
        document.image(Image { file: "a.b.png".into(), png: vec![1, 2, 3] });
        let file = document.to_glb().unwrap();
        let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&file[..4], word(4), word(8)), (&b"glTF"[..], 2, file.len()));
        let length = word(12);
        assert_eq!(length % 4, 0);
        let json: Value = serde_json::from_slice(&file[20..20 + length]).unwrap();
        assert_eq!(20 + length + 8 + word(20 + length), file.len());
        assert_eq!(json["buffers"][0]["byteLength"], word(20 + length));
        // Bounds are the floats themselves, not their decimals.
        assert_eq!(json["accessors"][0]["max"], json!([0.5, 7.0, 3.0]));
        assert_eq!(json["accessors"][0]["min"], json!([0.0, -2.0, -1.0]));
        assert_eq!(json["images"][0]["name"], "a.b");
        assert_eq!(json["bufferViews"][1]["byteOffset"], 36);
    }

    #[test]
    fn names_are_escaped_in_uris_and_not_on_disk() {
        let mut document = Document::default();
        document.indices(&[0, 1, 2]);
        document.image(Image { file: "a b%.png".into(), png: vec![1] });
        let (text, beside) = document.to_gltf("ä.bin").unwrap();
        let json: Value = serde_json::from_slice(&text).unwrap();
        assert_eq!(json["images"][0]["uri"], "a%20b%25.png");
        assert_eq!(json["buffers"][0]["uri"], "%C3%A4.bin");
        let names: Vec<&str> = beside.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["a b%.png", "ä.bin"]);
    }
}
