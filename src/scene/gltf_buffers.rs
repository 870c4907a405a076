//! The bytes behind a glTF document: the GLB container, buffers, images.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::rc::Rc;

use base64::Engine;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};
use gltf::json;

use super::gltf_file::Source;
use super::uri::{self, Refused};
use crate::error::{Error, Result};

/// The parts of a glTF file: JSON text, and the binary chunk of a GLB.
pub(crate) struct Parts<'a> {
    pub(crate) json: Cow<'a, [u8]>,
    pub(crate) blob: Option<Cow<'a, [u8]>>,
}

/// Takes a GLB apart, or takes the bytes for JSON if they are none.
pub(crate) fn split<'a>(path: &std::path::Path, bytes: &'a [u8]) -> Result<Parts<'a>> {
    if !bytes.starts_with(b"glTF") {
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        return Ok(Parts { json: text.into(), blob: None });
    }
    let word = |at: usize| {
        let bytes = bytes.get(at..at + 4)?.try_into().ok()?;
        Some(u32::from_le_bytes(bytes))
    };
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(Error::unreadable(path, "the GLB header is cut off; copy the file again"));
    };
    if version != 2 {
        return Err(Error::unsupported(
            path,
            "GLB header",
            format!("container version {version}; export it as glTF 2.0"),
        ));
    }
    // The crate subtracts the header from the length unchecked, and reads past the length.
    let whole =
        bytes.get(..length as usize).filter(|whole| whole.len() >= 12).ok_or_else(|| {
            Error::unreadable(
                path,
                format!(
                    "the file is cut off: it says it has {length} bytes but has {}; copy it again",
                    bytes.len()
                ),
            )
        })?;
    let glb = gltf::Glb::from_slice(whole).map_err(|e| {
        Error::unreadable(path, format!("the GLB container is damaged: {e}; export it again"))
    })?;
    Ok(Parts { json: glb.json, blob: glb.bin })
}

/// The bytes of every buffer, at least as long as the file says.
pub(crate) fn load<'a>(
    source: &Source,
    mut blob: Option<Cow<'a, [u8]>>,
) -> Result<Vec<Rc<Cow<'a, [u8]>>>> {
    let mut buffers = Vec::new();
    // A file that is the buffer of thousands is there once.
    let mut files: HashMap<&str, Rc<Cow<[u8]>>> = HashMap::new();
    for (i, buffer) in source.root.buffers.iter().enumerate() {
        let what = named("buffer", i, buffer.name.as_deref());
        let bytes = match &buffer.uri {
            Some(uri) => match files.get(uri.as_str()) {
                Some(bytes) => bytes.clone(),
                None => {
                    let bytes = Rc::new(Cow::Owned(resolve(source, &what, uri)?));
                    files.insert(uri, Rc::clone(&bytes));
                    bytes
                }
            },
            None if i == 0 => Rc::new(blob.take().ok_or_else(|| {
                Error::invalid(
                    source.path,
                    &what,
                    "it has neither a URI nor a binary chunk; export the scene again",
                )
            })?),
            None => {
                return Err(Error::invalid(
                    source.path,
                    &what,
                    "only the first buffer may lie in the binary chunk; export the scene again",
                ));
            }
        };
        if (bytes.len() as u64) < buffer.byte_length.0 {
            return Err(Error::invalid(
                source.path,
                &what,
                format!(
                    "it should have {} bytes but has {}; it is cut off, copy or export it again",
                    buffer.byte_length.0,
                    bytes.len()
                ),
            ));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// Bytes of all buffers, those of one file counted once.
pub(crate) fn bytes(source: &Source) -> u64 {
    let mut distinct = HashSet::new();
    source.buffers.iter().filter(|b| distinct.insert(Rc::as_ptr(b))).map(|b| b.len() as u64).sum()
}

/// The encoded bytes of an image.
pub(crate) fn image<'a>(source: &'a Source, image: usize) -> Result<Cow<'a, [u8]>> {
    let what = source.image_name(image);
    let image = &source.root.images[image];
    match (&image.uri, image.buffer_view) {
        (Some(uri), None) => Ok(Cow::Owned(resolve(source, &what, uri)?)),
        (None, Some(view)) => Ok(Cow::Borrowed(view_bytes(source, &what, view)?)),
        _ => Err(Error::invalid(
            source.path,
            &what,
            "it must have either a URI or a buffer view; export the scene again",
        )),
    }
}

/// The bytes of a buffer view, checked against its buffer.
pub(crate) fn view_bytes<'a>(
    source: &'a Source,
    what: &str,
    view: json::Index<json::buffer::View>,
) -> Result<&'a [u8]> {
    let number = view.value();
    let view = &source.root.buffer_views[number];
    let buffer = &source.buffers[view.buffer.value()];
    let offset = view.byte_offset.map_or(0, |o| o.0);
    let range = offset
        .checked_add(view.byte_length.0)
        .filter(|&end| end <= buffer.len() as u64)
        .map(|end| offset as usize..end as usize);
    range.and_then(|range| buffer.get(range)).ok_or_else(|| {
        Error::invalid(
            source.path,
            what,
            format!(
                "buffer view {number} (offset {offset}, {} bytes) goes past the end of its \
                 buffer ({} bytes); the file is damaged, export it again",
                view.byte_length.0,
                buffer.len()
            ),
        )
    })
}

/// The bytes that a URI stands for.
fn resolve(source: &Source, what: &str, uri: &str) -> Result<Vec<u8>> {
    if let Some(data) = uri.strip_prefix("data:") {
        return data_uri(source, what, data);
    }
    uri::read_relative(source.path, uri).map_err(|refused| match refused {
        Refused::Unsupported(reason) => Error::unsupported(source.path, what, reason),
        Refused::Unreadable(file, reason) => {
            Error::unreadable(source.path, format!("{what}: file {}: {reason}", file.display()))
        }
    })
}

fn data_uri(source: &Source, what: &str, data: &str) -> Result<Vec<u8>> {
    let Some((kind, text)) = data.split_once(',') else {
        return Err(Error::invalid(
            source.path,
            what,
            "its data URI has no comma; export it again",
        ));
    };
    if !kind.ends_with(";base64") {
        return Err(Error::unsupported(
            source.path,
            what,
            "a data URI that is not base64; export it as base64 or as a separate file",
        ));
    }
    // Both ways of padding are in use.
    let engine = GeneralPurpose::new(
        &base64::alphabet::STANDARD,
        GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
    );
    engine
        .decode(text)
        .map_err(|e| Error::invalid(source.path, what, format!("its base64 data is damaged: {e}")))
}

/// An object of the file in words.
pub(crate) fn named(kind: &str, number: usize, name: Option<&str>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{kind} {number} \"{name}\""),
        _ => format!("{kind} {number}"),
    }
}
