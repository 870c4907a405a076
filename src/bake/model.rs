//! A scene with its light as a glTF document: a node and a mesh for each object, a primitive for each
//! of its materials, cameras.
//!
//! Positions are those of the world, as f32. A scene that lies far from the origin (by more than
//! [`FAR`] of its size) would lose its shape in f32: its nodes are then moved to its middle.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use serde_json::{Value, json};

use super::atlas::Atlas;
use super::target::Target;
use super::vertices::LitTriangle;
use crate::error::Result;
use crate::output::gltf_file::{Document, Image};
use crate::output::gltf_mesh::{Corner, Primitive, SETS};
use crate::output::gltf_scene::{MaterialWriter, add_camera, add_page, coordinate_sets};
use crate::scene::{self, Material, Scene};

/// How far from the origin a scene may be, in its sizes, to be written about the origin: two bits of
/// the 24 of an f32 are lost.
const FAR: f64 = 4.0;

/// Of what one primitive is made: object, material, and the page of its light if it has one.
type Key = (u32, u32, Option<u32>);

/// A scene whose light is in pictures: `pages` are what the materials show (target `unlit`), `files`
/// the names of the lightmaps with the factor of their values, for their extras (others).
pub fn with_lightmaps(
    scene: &Scene,
    atlas: &Atlas,
    target: Target,
    pages: Vec<Image>,
    files: &[(String, f64)],
    stem: &str,
) -> Result<Document> {
    let mut document = Document::default();
    let origin = origin(scene);
    let mut parts: BTreeMap<Key, Primitive> = BTreeMap::new();
    let mut materials: BTreeMap<(u32, Option<u32>), usize> = BTreeMap::new();
    let mut writer = MaterialWriter::new(scene, stem);
    let pages: Vec<Value> = pages.into_iter().map(|image| add_page(&mut document, image)).collect();
    let has_colours = coloured(scene);
    for (index, triangle) in scene.triangles.iter().enumerate() {
        let page = atlas.page[index];
        let material = &scene.materials[triangle.material as usize];
        let shows_light = target == Target::Unlit && page.is_some();
        // The light's own set, which comes after another one.
        let sets = coordinate_sets(material, page.map(|_| 1));
        let written = match materials.get(&(triangle.material, page)) {
            Some(&known) => known,
            None => {
                let mut made = match page {
                    Some(page) if shows_light => {
                        writer.unlit(&mut document, material, Some(pages[page as usize].clone()))
                    }
                    _ => writer.lit(&mut document, material, &sets)?,
                };
                if let Some((image, scale)) = page.and_then(|p| files.get(p as usize)) {
                    made["extras"] = json!({ "lightmap": {
                        "image": image, "scale": scale, "texCoord": 1,
                        "quantity": target.quantity().name(),
                    } });
                }
                let known = document.push("materials", made);
                materials.insert((triangle.material, page), known);
                known
            }
        };
        let count = match page {
            Some(_) if shows_light => 2,
            Some(_) => sets.iter().map(|(_, place)| place + 1).fold(2, usize::max),
            None => sets.len(),
        };
        let coloured = !shows_light && has_colours[triangle.material as usize];
        let key = (triangle.object, triangle.material, page);
        let part = parts.entry(key).or_insert_with(|| Primitive::new(written, count, coloured));
        let (normal, _) = triangle.normal_and_area();
        part.add(std::array::from_fn(|k| {
            let mut uv = [DVec2::ZERO; SETS];
            if shows_light {
                uv[0] = triangle.uv[0][k];
            } else {
                sets.iter().for_each(|&(set, place)| uv[place] = triangle.uv[set][k]);
            }
            if page.is_some() {
                uv[1] = atlas.uv[index][k];
            }
            Corner {
                position: triangle.vertices[k] - origin,
                normal,
                uv,
                colour: triangle.colour[k],
            }
        }));
    }
    finish(document, scene, origin, parts)
}

/// A scene whose light is in the colours of its vertices: radiance times `factor`, at most 1, in
/// triangles of `lit`; what is not `wanted` (by input triangle) keeps the material that it has.
/// Also the share of colours (by vertices) that were limited.
pub fn with_colours(
    scene: &Scene,
    lit: &[LitTriangle],
    wanted: &[bool],
    factor: f64,
    stem: &str,
) -> Result<(Document, f64)> {
    let mut document = Document::default();
    let origin = origin(scene);
    let mut parts: BTreeMap<Key, Primitive> = BTreeMap::new();
    let mut materials: BTreeMap<(u32, bool), usize> = BTreeMap::new();
    let mut writer = MaterialWriter::new(scene, stem);
    let (mut limited, mut all) = (0u64, 0u64);
    for part_of in lit {
        let triangle = &scene.triangles[part_of.triangle as usize];
        let material = &scene.materials[triangle.material as usize];
        let shows_light = wanted[part_of.triangle as usize];
        if !shows_light && part_of.back {
            // The front stands for both.
            continue;
        }
        let own_textures = !shows_light || shows_texture(material);
        let textured = own_textures.then(|| coordinate_sets(material, None));
        let written = match materials.get(&(triangle.material, shows_light)) {
            Some(&known) => known,
            None if !shows_light => {
                let sets = textured.as_deref().unwrap_or_default();
                let made = writer.lit(&mut document, material, sets)?;
                let known = document.push("materials", made);
                materials.insert((triangle.material, false), known);
                known
            }
            None => {
                let base = match (&textured, &material.reflectance_texture) {
                    (Some(sets), Some(used)) => {
                        Some(writer.texture(&mut document, used, sets, true)?.0)
                    }
                    _ => None,
                };
                // Each side is written by itself.
                let one_sided = Material { two_sided: false, ..material.clone() };
                let made = writer.unlit(&mut document, &one_sided, base);
                let known = document.push("materials", made);
                materials.insert((triangle.material, true), known);
                known
            }
        };
        let sets = textured.as_deref().unwrap_or_default();
        let key = (triangle.object, triangle.material, None);
        let part = parts.entry(key).or_insert_with(|| Primitive::new(written, sets.len(), true));
        let (front, _) = triangle.normal_and_area();
        part.add(std::array::from_fn(|k| {
            let w = part_of.weights[k];
            let mut uv = [DVec2::ZERO; SETS];
            for &(set, place) in sets {
                let at = triangle.uv[set];
                uv[place] = at[0] * w.x + at[1] * w.y + at[2] * w.z;
            }
            let colour = if shows_light {
                let radiance = factor * radiance(scene, part_of, k);
                all += 1;
                limited += u64::from(radiance.max_element() > 1.0);
                radiance.clamp(DVec3::ZERO, DVec3::ONE)
            } else {
                let at = triangle.colour;
                at[0] * w.x + at[1] * w.y + at[2] * w.z
            };
            Corner {
                position: part_of.corners[k] - origin,
                normal: if part_of.back { -front } else { front },
                uv,
                colour,
            }
        }));
    }
    let share = if all > 0 { limited as f64 / all as f64 } else { 0.0 };
    Ok((finish(document, scene, origin, parts)?, share))
}

/// Whether a material's own texture is shown, multiplied by the colours of vertices, rather than
/// being part of these colours: where nothing else varies.
pub fn shows_texture(material: &Material) -> bool {
    material.reflectance_texture.is_some()
        && material.metallic_texture.is_none()
        && material.radiance == DVec3::ZERO
}

/// Radiance at a corner, W/(m^2 sr), without a texture that is shown as such.
pub fn radiance(scene: &Scene, part: &LitTriangle, corner: usize) -> DVec3 {
    let index = part.triangle as usize;
    let triangle = &scene.triangles[index];
    let material = &scene.materials[triangle.material as usize];
    let (w, irradiance) = (part.weights[corner], part.irradiance[corner]);
    let point = [w; 3];
    let radiosity = if shows_texture(material) {
        let colour = triangle.colour;
        let tint = colour[0] * w.x + colour[1] * w.y + colour[2] * w.z;
        material.reflectance * (1.0 - material.metallic) * tint * irradiance
    } else {
        scene::exitance(scene, index, &point)
            + scene::reflectance(scene, index, &point) * irradiance
    };
    radiosity / std::f64::consts::PI
}

/// Of each material whether triangles of it have colours at their corners.
fn coloured(scene: &Scene) -> Vec<bool> {
    let mut coloured = vec![false; scene.materials.len()];
    for triangle in scene.triangles.iter().filter(|t| t.colour != [DVec3::ONE; 3]) {
        coloured[triangle.material as usize] = true;
    }
    coloured
}

/// What positions are relative to.
fn origin(scene: &Scene) -> DVec3 {
    let (low, high) = scene.bounds();
    let farthest = low.abs().max(high.abs()).max_element();
    if farthest > FAR * scene.extent() {
        // What f32 holds exactly: the node's place is written in decimals.
        (0.5 * (low + high)).as_vec3().as_dvec3()
    } else {
        DVec3::ZERO
    }
}

fn finish(
    mut document: Document,
    scene: &Scene,
    origin: DVec3,
    parts: BTreeMap<Key, Primitive>,
) -> Result<Document> {
    let mut of_object: Vec<Vec<&Primitive>> = vec![vec![]; scene.objects.len()];
    for ((object, ..), part) in &parts {
        of_object[*object as usize].push(part);
    }
    let mut roots = vec![];
    for (object, parts) in scene.objects.iter().zip(of_object) {
        let mut node = json!({ "name": object.name });
        if !parts.is_empty() {
            let primitives: Vec<Value> =
                parts.iter().map(|part| part.write(&mut document)).collect::<Result<_>>()?;
            let mesh = json!({ "name": object.name, "primitives": primitives });
            node["mesh"] = json!(document.push("meshes", mesh));
            if origin != DVec3::ZERO {
                node["translation"] = json!(origin.to_array());
            }
        }
        roots.push(document.push("nodes", node));
    }
    for camera in &scene.cameras {
        roots.push(add_camera(&mut document, scene, camera));
    }
    document.push("scenes", json!({ "nodes": roots }));
    document.default_scene();
    Ok(document)
}
