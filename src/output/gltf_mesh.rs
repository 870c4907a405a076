//! Corners of triangles made into vertices of a glTF mesh.
//!
//! Corners that agree in everything (position, normal, coordinates, colour, after rounding to f32)
//! are one vertex, numbered in the order in which they come. Whatever differs splits the vertex:
//! creases, seams of charts, edges of shadows.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use serde_json::{Value, json};

use super::gltf_file::Document;
use crate::error::{Error, Result};

/// Most sets of texture coordinates.
pub const SETS: usize = 3;

/// One corner of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Metres, from the origin of the node.
    pub position: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Texture coordinates, of which the first sets of the primitive count.
    pub uv: [DVec2; SETS],
    /// Linear colour in [0, 1], where the primitive has one.
    pub colour: DVec3,
}

/// Triangles of one material in one object.
#[derive(Clone, Debug, Default)]
pub struct Primitive {
    /// Index of the material in the file.
    pub material: usize,
    /// Sets of texture coordinates that are written: `TEXCOORD_0` and on.
    pub sets: usize,
    /// Whether `COLOR_0` is written.
    pub coloured: bool,
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    uv: [Vec<[f32; 2]>; SETS],
    colours: Vec<[f32; 3]>,
    indices: Vec<u32>,
    /// Vertices by the bits of everything that they have.
    known: HashMap<[u32; 6 + 2 * SETS + 3], u32>,
}

impl Primitive {
    /// An empty one.
    pub fn new(material: usize, sets: usize, coloured: bool) -> Primitive {
        Primitive { material, sets: sets.min(SETS), coloured, ..Primitive::default() }
    }

    /// Vertices so far.
    pub fn vertices(&self) -> usize {
        self.positions.len()
    }

    /// Triangles so far.
    pub fn triangles(&self) -> usize {
        self.indices.len() / 3
    }

    /// Adds a triangle.
    pub fn add(&mut self, corners: [Corner; 3]) {
        for corner in corners {
            let index = self.vertex(&corner);
            self.indices.push(index);
        }
    }

    fn vertex(&mut self, corner: &Corner) -> u32 {
        // Minus zero is zero: it must not split a vertex.
        let float = |v: f64| v as f32 + 0.0;
        let position = corner.position.to_array().map(float);
        let normal = corner.normal.to_array().map(float);
        let uv = corner.uv.map(|uv| uv.to_array().map(float));
        let colour = corner.colour.to_array().map(float);
        let mut key = [0; 6 + 2 * SETS + 3];
        let sets = uv.iter().take(self.sets).flatten();
        let colours = colour.iter().filter(|_| self.coloured);
        let values = position.iter().chain(&normal).chain(sets).chain(colours);
        key.iter_mut().zip(values).for_each(|(k, v)| *k = v.to_bits());
        let next = self.positions.len() as u32;
        *self.known.entry(key).or_insert_with(|| {
            self.positions.push(position);
            self.normals.push(normal);
            for (set, uv) in self.uv.iter_mut().zip(uv).take(self.sets) {
                set.push(uv);
            }
            if self.coloured {
                self.colours.push(colour);
            }
            next
        })
    }

    /// Writes the vertices into a document; the primitive as glTF has it.
    ///
    /// # Errors
    ///
    /// [`Error::Runtime`] where a number is too large for f32.
    pub fn write(&self, document: &mut Document) -> Result<Value> {
        let all = self.positions.iter().chain(&self.normals).flatten();
        let uv = self.uv.iter().flatten().flatten();
        if !all.chain(uv).chain(self.colours.iter().flatten()).all(|v| v.is_finite()) {
            return Err(Error::Runtime(
                "glTF holds numbers up to 3e38, and a position or a texture coordinate of the scene \
                 is larger: scale the scene"
                    .into(),
            ));
        }
        let mut attributes = json!({
            "POSITION": document.floats(&self.positions, true),
            "NORMAL": document.floats(&self.normals, false),
        });
        for (k, set) in self.uv.iter().enumerate().take(self.sets) {
            attributes[format!("TEXCOORD_{k}")] = json!(document.floats(set, false));
        }
        if self.coloured {
            attributes["COLOR_0"] = json!(document.floats(&self.colours, false));
        }
        let indices = document.indices(&self.indices);
        Ok(json!({ "attributes": attributes, "indices": indices, "material": self.material }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(x: f64, colour: f64) -> Corner {
        Corner {
            position: DVec3::new(x, 0.0, 0.0),
            normal: DVec3::Z,
            uv: [DVec2::splat(x); SETS],
            colour: DVec3::splat(colour),
        }
    }

    #[test]
    fn equal_corners_are_one_vertex_and_colours_split_only_where_they_count() {
        let triangles = [[corner(0.0, 0.1), corner(1.0, 0.1), corner(2.0, 0.1)]; 2];
        let mut other = triangles[1];
        other[0].colour = DVec3::ONE;
        other[1].position.y = -0.0;
        for (coloured, vertices) in [(false, 3), (true, 4)] {
            let mut primitive = Primitive::new(0, 1, coloured);
            primitive.add(triangles[0]);
            primitive.add(other);
            assert_eq!((primitive.vertices(), primitive.triangles()), (vertices, 2));
        }
    }

    #[test]
    fn what_f32_cannot_hold_is_an_error() {
        let mut primitive = Primitive::new(0, 0, false);
        primitive.add([corner(1e39, 0.0), corner(0.0, 0.0), corner(1.0, 0.0)]);
        assert!(primitive.write(&mut Document::default()).is_err());
    }
}
