//! Typed arrays in glTF buffers.
//!
//! Everything is compared with the length of the buffers before memory is asked for, in arithmetic
//! that cannot overflow. An accessor without a buffer view holds zeros (plus its sparse values);
//! since nothing in the file backs its count, it may not have more elements than the file's
//! buffers have bytes.

use gltf::json;
use json::accessor::{ComponentType, Type};
use json::validation::Checked;

use super::gltf_buffers::{self, view_bytes};
use super::gltf_file::Source;
use crate::error::{Error, Result};

/// A kind of element: shape, number type, and whether integers stand for fractions.
pub(crate) type Kind = (Type, ComponentType, bool);

/// Positions.
pub(crate) const POSITION: &[Kind] = &[(Type::Vec3, ComponentType::F32, false)];

/// Texture coordinates.
pub(crate) const TEXCOORD: &[Kind] = &[
    (Type::Vec2, ComponentType::F32, false),
    (Type::Vec2, ComponentType::U8, true),
    (Type::Vec2, ComponentType::U16, true),
];

/// Vertex colours.
pub(crate) const COLOR: &[Kind] = &[
    (Type::Vec3, ComponentType::F32, false),
    (Type::Vec3, ComponentType::U8, true),
    (Type::Vec3, ComponentType::U16, true),
    (Type::Vec4, ComponentType::F32, false),
    (Type::Vec4, ComponentType::U8, true),
    (Type::Vec4, ComponentType::U16, true),
];

/// Vertex numbers.
pub(crate) const INDEX: &[Kind] = &[
    (Type::Scalar, ComponentType::U8, false),
    (Type::Scalar, ComponentType::U16, false),
    (Type::Scalar, ComponentType::U32, false),
];

/// The elements of an accessor, their components one after the other.
#[derive(Debug)]
pub(crate) struct Elements {
    /// Components of all elements; fractions are decoded.
    pub(crate) values: Vec<f64>,
    /// Components of one element.
    pub(crate) width: usize,
}

impl Elements {
    /// How many elements there are.
    pub(crate) fn len(&self) -> usize {
        self.values.len() / self.width
    }

    /// The elements in turn.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &[f64]> {
        self.values.chunks_exact(self.width)
    }
}

/// Reads an accessor that must be of one of the given kinds. `what` names its user and purpose.
pub(crate) fn read(
    source: &Source,
    what: &str,
    index: json::Index<json::Accessor>,
    kinds: &[Kind],
) -> Result<Elements> {
    let accessor = &source.root.accessors[index.value()];
    let what = &format!("{what}, accessor {}", index.value());
    let wrong = |reason: String| Error::invalid(source.path, what, reason);
    let (Checked::Valid(shape), Checked::Valid(component)) =
        (accessor.type_, accessor.component_type)
    else {
        return Err(wrong("unknown type; the file is damaged, export it again".into()));
    };
    let component = component.0;
    // What floats have no fractions to normalise: exporters set the flag on them nevertheless.
    let normalized = accessor.normalized && component != ComponentType::F32;
    if !kinds.contains(&(shape, component, normalized)) {
        let wanted: Vec<String> = kinds.iter().map(|&kind| words(kind)).collect();
        return Err(wrong(format!(
            "it holds {}, but must hold {}; export the scene again",
            words((shape, component, normalized)),
            wanted.join(" or ")
        )));
    }
    let width = shape.multiplicity();
    let count = accessor.count.0;
    let number = Number { component, normalized };
    let layout = Layout { width, number, offset: accessor.byte_offset.map_or(0, |o| o.0) };

    let mut values = match accessor.buffer_view {
        Some(view) => {
            let stride = source.root.buffer_views[view.value()].byte_stride.map(|s| s.0);
            layout.decode(view_bytes(source, what, view)?, stride, count).map_err(wrong)?
        }
        None => {
            let bytes = gltf_buffers::bytes(source);
            if count > bytes {
                return Err(wrong(format!(
                    "it has {count} elements without data, more than the file has bytes \
                     ({bytes}); the file is damaged, export it again"
                )));
            }
            vec![0.0; count as usize * width]
        }
    };
    if let Some(sparse) = &accessor.sparse {
        if sparse.count.0 > count {
            return Err(wrong(format!(
                "it replaces {} of {count} elements; the file is damaged, export it again",
                sparse.count.0
            )));
        }
        let Checked::Valid(places) = sparse.indices.component_type else {
            return Err(wrong("unknown type of sparse indices; export the scene again".into()));
        };
        let places = Layout {
            width: 1,
            number: Number { component: places.0, normalized: false },
            offset: sparse.indices.byte_offset.0,
        };
        let view = view_bytes(source, what, sparse.indices.buffer_view)?;
        let places = places.decode(view, None, sparse.count.0).map_err(wrong)?;
        let view = view_bytes(source, what, sparse.values.buffer_view)?;
        let layout = Layout { offset: sparse.values.byte_offset.0, ..layout };
        let replaced = layout.decode(view, None, sparse.count.0).map_err(wrong)?;
        for (place, new) in places.iter().zip(replaced.chunks_exact(width)) {
            let start = *place as usize * width;
            let old = values.get_mut(start..start + width).ok_or_else(|| {
                wrong(format!("it replaces element {place} of {count}; export the scene again"))
            })?;
            old.copy_from_slice(new);
        }
    }
    Ok(Elements { values, width })
}

/// How a number is stored.
#[derive(Clone, Copy)]
struct Number {
    component: ComponentType,
    normalized: bool,
}

impl Number {
    /// The value of little-endian bytes, of which there are as many as the type has.
    fn decode(self, bytes: &[u8]) -> f64 {
        let mut word = [0; 4];
        word[..bytes.len()].copy_from_slice(bytes);
        let word = u32::from_le_bytes(word);
        let (value, one) = match self.component {
            ComponentType::U8 => (f64::from(word as u8), 255.0),
            ComponentType::I8 => (f64::from(word as u8 as i8), 127.0),
            ComponentType::U16 => (f64::from(word as u16), 65535.0),
            ComponentType::I16 => (f64::from(word as u16 as i16), 32767.0),
            ComponentType::U32 => (f64::from(word), 1.0),
            ComponentType::F32 => (f64::from(f32::from_bits(word)), 1.0),
        };
        if self.normalized { (value / one).max(-1.0) } else { value }
    }
}

/// Where the elements lie in a buffer view.
struct Layout {
    width: usize,
    number: Number,
    offset: u64,
}

impl Layout {
    /// All components; the reason if the view does not hold them.
    fn decode(
        &self,
        view: &[u8],
        stride: Option<usize>,
        count: u64,
    ) -> std::result::Result<Vec<f64>, String> {
        let part = self.number.component.size();
        let size = part * self.width;
        let stride = stride.unwrap_or(size);
        if stride < size {
            return Err(format!(
                "elements of {size} bytes overlap at a stride of {stride}; export the scene again"
            ));
        }
        if count == 0 {
            return Ok(Vec::new());
        }
        let end = u128::from(self.offset) + u128::from(count - 1) * stride as u128 + size as u128;
        if end > view.len() as u128 {
            return Err(format!(
                "its {count} elements need {end} bytes, but its buffer view has {}; the file is \
                 damaged, export it again",
                view.len()
            ));
        }
        let mut values = Vec::with_capacity(count as usize * self.width);
        for element in view[self.offset as usize..].chunks(stride).take(count as usize) {
            let parts = element[..size].chunks_exact(part);
            values.extend(parts.map(|bytes| self.number.decode(bytes)));
        }
        Ok(values)
    }
}

fn words((shape, component, normalized): Kind) -> String {
    let shape = format!("{shape:?}").to_uppercase();
    let normalized = if normalized { "normalised " } else { "" };
    format!("{shape} of {normalized}{component:?}")
}
