//! Triangles of glTF meshes, in the mesh's own space.

use gltf::json;
use json::mesh::{Mode, Semantic};
use json::validation::Checked;

use glam::{DVec2, DVec3};

use super::Triangle;
use super::gltf_accessor::{self as accessor, Elements};
use super::gltf_file::Source;
use super::limits::Budget;
use super::notices::Notices;
use crate::error::{Error, Result};

/// A triangle's material in the file; none stands for the default material.
pub(crate) type MaterialId = Option<usize>;

/// The triangles of a mesh with their materials; the triangles' own indices are not yet set.
pub(crate) fn read(
    source: &Source,
    mesh: usize,
    budget: Budget,
    notices: &mut Notices,
) -> Result<Vec<(Triangle, MaterialId)>> {
    let mut triangles = Vec::new();
    for k in 0..source.root.meshes[mesh].primitives.len() {
        let primitive = &source.root.meshes[mesh].primitives[k];
        let what = source.primitive_name(mesh, k);
        if primitive.targets.as_ref().is_some_and(|t| !t.is_empty()) {
            notices.add(&what, "morph targets are left out; the base shape is used");
        }
        read_primitive(source, &what, primitive, &mut triangles, notices)?;
        budget.triangles(source.path, &what, triangles.len())?;
    }
    Ok(triangles)
}

fn read_primitive(
    source: &Source,
    what: &str,
    primitive: &json::mesh::Primitive,
    triangles: &mut Vec<(Triangle, MaterialId)>,
    notices: &mut Notices,
) -> Result<()> {
    let mode = match primitive.mode {
        Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
        _ => {
            notices.add(what, "points and lines have no surface and are left out");
            return Ok(());
        }
    };
    let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
    let Some(positions) = attribute(Semantic::Positions) else {
        notices.add(what, "it has no positions and is left out");
        return Ok(());
    };
    let positions = read_positions(source, what, positions)?;
    let optional = |semantic: Semantic, name: &str, kinds| -> Result<Option<Elements>> {
        let Some(index) = attribute(semantic) else { return Ok(None) };
        let what = format!("{what}, {name}");
        let elements = accessor::read(source, &what, index, kinds)?;
        if elements.len() != positions.len() {
            return Err(Error::invalid(
                source.path,
                what,
                format!(
                    "{} elements for {} vertices; export the scene again",
                    elements.len(),
                    positions.len()
                ),
            ));
        }
        Ok(Some(elements))
    };
    let mut uv = Vec::new();
    for (set, name) in [(0, "TEXCOORD_0"), (1, "TEXCOORD_1")] {
        let elements = optional(Semantic::TexCoords(set), name, accessor::TEXCOORD)?;
        uv.push(elements.map(|e| texture_coordinates(&e, what, name, notices)));
    }
    let colour = optional(Semantic::Colors(0), "COLOR_0", accessor::COLOR)?;
    let colour = colour.map(|e| colours(source, what, &e)).transpose()?;

    let corner_order = match primitive.indices {
        Some(index) => read_indices(source, what, index, positions.len())?,
        None => (0..positions.len()).collect(),
    };
    let faces = faces(mode, &corner_order);
    if mode == Mode::Triangles && corner_order.len() % 3 != 0 {
        notices.add(what, "corners are no multiple of three; the last ones are left out");
    }
    let material = primitive.material.map(|m| m.value());
    triangles.extend(faces.map(|corners| {
        let uv = [0, 1].map(|set| {
            uv[set].as_ref().map_or([DVec2::ZERO; 3], |uv: &Vec<DVec2>| corners.map(|i| uv[i]))
        });
        let triangle = Triangle {
            vertices: corners.map(|i| positions[i]),
            uv,
            colour: colour.as_ref().map_or([DVec3::ONE; 3], |colour| corners.map(|i| colour[i])),
            material: 0,
            object: 0,
        };
        (triangle, material)
    }));
    Ok(())
}

fn read_positions(
    source: &Source,
    what: &str,
    index: json::Index<json::Accessor>,
) -> Result<Vec<DVec3>> {
    let what = format!("{what}, POSITION");
    let elements = accessor::read(source, &what, index, accessor::POSITION)?;
    let positions: Vec<DVec3> = elements.iter().map(DVec3::from_slice).collect();
    match positions.iter().position(|p| !p.is_finite()) {
        None => Ok(positions),
        Some(i) => Err(Error::invalid(
            source.path,
            what,
            format!(
                "vertex {i} is at ({}), which is not finite; repair the mesh and export it again",
                positions[i]
            ),
        )),
    }
}

fn read_indices(
    source: &Source,
    what: &str,
    index: json::Index<json::Accessor>,
    vertices: usize,
) -> Result<Vec<usize>> {
    let what = format!("{what}, indices");
    let elements = accessor::read(source, &what, index, accessor::INDEX)?;
    // Exact: indices have at most 32 bits.
    let indices: Vec<usize> = elements.values.iter().map(|&i| i as usize).collect();
    match indices.iter().find(|&&i| i >= vertices) {
        None => Ok(indices),
        Some(i) => Err(Error::invalid(
            source.path,
            what,
            format!("index {i} is past the last of {vertices} vertices; export the scene again"),
        )),
    }
}

/// Texture coordinates; those that are no numbers become zero, since a mesh can be lit without.
fn texture_coordinates(
    elements: &Elements,
    what: &str,
    name: &str,
    notices: &mut Notices,
) -> Vec<DVec2> {
    let mut bad = 0;
    let uv = elements
        .iter()
        .map(DVec2::from_slice)
        .map(|uv| {
            if uv.is_finite() {
                uv
            } else {
                bad += 1;
                DVec2::ZERO
            }
        })
        .collect();
    notices.add_many(what, format!("{name} that is not finite is set to zero"), bad);
    uv
}

/// Vertex colours without alpha, in [0, 1].
fn colours(source: &Source, what: &str, elements: &Elements) -> Result<Vec<DVec3>> {
    let colours: Vec<DVec3> = elements.iter().map(DVec3::from_slice).collect();
    match colours.iter().position(|c| c.is_nan()) {
        None => Ok(colours.into_iter().map(|c| c.clamp(DVec3::ZERO, DVec3::ONE)).collect()),
        Some(i) => Err(Error::invalid(
            source.path,
            format!("{what}, COLOR_0"),
            format!("the colour of vertex {i} is not a number; export the scene again"),
        )),
    }
}

/// Corner triples, counter-clockwise (glTF 2.0, section 3.7.2.1).
fn faces(mode: Mode, corners: &[usize]) -> impl Iterator<Item = [usize; 3]> {
    let count = match mode {
        Mode::Triangles => corners.len() / 3,
        _ => corners.len().saturating_sub(2),
    };
    (0..count).map(move |i| {
        let places = match mode {
            Mode::Triangles => [3 * i, 3 * i + 1, 3 * i + 2],
            Mode::TriangleStrip => [i, i + 1 + i % 2, i + 2 - i % 2],
            _ => [i + 1, i + 2, 0],
        };
        places.map(|k| corners[k])
    })
}
