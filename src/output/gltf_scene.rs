//! Cameras, materials and textures of a scene as glTF 2.0 has them.
//!
//! What is written is what was read of them: a camera's pose and projection; base colour, metallic
//! share and emission, with their textures (as 8-bit PNG: colours in sRGB, the metallic factor
//! linear). Gloss and transparency are not kept by [`crate::scene`]: surfaces are written opaque and
//! fully rough.

use std::collections::BTreeMap;

use glam::{DMat3, DQuat, DVec3};
use serde_json::{Value, json};

use super::gltf_file::{Document, Image};
use super::png_file::srgb_from_linear;
use crate::error::{Error, Result};
use crate::scene::{Camera, Material, Projection, Scene, Texture, TextureUse, Wrap};

/// The near plane of a camera, as a share of the distance to the farthest point of the scene: near
/// enough to cut nothing off, far enough that 24 bits of depth tell millimetres in a room.
const NEAR: f64 = 1e-3;

/// Numbers of glTF (sections 5.26 and 5.30): filters and wrapping of textures.
const NEAREST: u32 = 9728;
const LINEAR: u32 = 9729;
const LINEAR_MIPMAP_LINEAR: u32 = 9987;
const CLAMP: u32 = 33071;
const MIRRORED: u32 = 33648;
const REPEAT: u32 = 10497;

/// Adds a camera and its node; the index of the node. `scene` tells how far there is to see.
pub fn add_camera(document: &mut Document, scene: &Scene, camera: &Camera) -> usize {
    let (low, high) = scene.bounds();
    let corner = |k: usize| DVec3::from_array(std::array::from_fn(|a| [low, high][k >> a & 1][a]));
    let farthest = (0..8).map(|k| corner(k).distance(camera.eye)).fold(0.0, f64::max);
    // A margin so that the farthest point is inside.
    let far = if farthest > 0.0 { 1.1 * farthest } else { 1.0 };
    let lens = match camera.projection {
        Projection::Perspective { vertical_fov, aspect } => {
            let mut lens = json!({ "yfov": vertical_fov, "znear": NEAR * far, "zfar": far });
            if let Some(aspect) = aspect {
                lens["aspectRatio"] = json!(aspect);
            }
            json!({ "type": "perspective", "perspective": lens, "name": camera.name })
        }
        Projection::Orthographic { half_width, half_height } => json!({
            "type": "orthographic", "name": camera.name,
            "orthographic": { "xmag": half_width, "ymag": half_height, "znear": 0.0, "zfar": far },
        }),
    };
    let lens = document.push("cameras", lens);
    // A camera of glTF looks along its -z.
    let turn = DQuat::from_mat3(&DMat3::from_cols(camera.right, camera.up, -camera.forward));
    document.push(
        "nodes",
        json!({
            "name": camera.name, "camera": lens, "rotation": turn.normalize().to_array(),
            "translation": camera.eye.to_array(),
        }),
    )
}

/// Which sets of texture coordinates the textures of a material use, and the `TEXCOORD_n` that each
/// is written as; `taken` is one that must stay free for a lightmap.
pub fn coordinate_sets(material: &Material, taken: Option<usize>) -> Vec<(usize, usize)> {
    let textures =
        [&material.reflectance_texture, &material.metallic_texture, &material.radiance_texture];
    let used = |set| textures.iter().any(|t| t.as_ref().is_some_and(|t| t.set == set));
    let free = (0..).filter(|n| Some(*n) != taken);
    (0..2).filter(|&set| used(set)).zip(free).collect()
}

/// Makes materials in a document, each image once.
pub struct MaterialWriter<'a> {
    scene: &'a Scene,
    /// Begins the names of image files.
    stem: &'a str,
    /// Image by texture and whether it is encoded in sRGB, with the factor that it was divided by.
    images: BTreeMap<(usize, bool), (usize, f64)>,
    samplers: BTreeMap<(u32, u32, bool), usize>,
}

impl<'a> MaterialWriter<'a> {
    /// Image files of a `.gltf` will be `STEM-texture-N.png`.
    pub fn new(scene: &'a Scene, stem: &'a str) -> Self {
        MaterialWriter { scene, stem, images: BTreeMap::new(), samplers: BTreeMap::new() }
    }

    /// A material as it was read; `sets` are those of [`coordinate_sets`].
    pub fn lit(
        &mut self,
        document: &mut Document,
        material: &Material,
        sets: &[(usize, usize)],
    ) -> Result<Value> {
        let mut pbr = json!({ "roughnessFactor": 1.0, "metallicFactor": material.metallic });
        let mut colour = material.reflectance;
        if let Some(used) = &material.reflectance_texture {
            let (info, factor) = self.texture(document, used, sets, true)?;
            pbr["baseColorTexture"] = info;
            colour = (colour * factor).min(DVec3::ONE);
        }
        pbr["baseColorFactor"] = json!([colour.x, colour.y, colour.z, 1.0]);
        if let Some(used) = &material.metallic_texture {
            pbr["metallicRoughnessTexture"] = self.texture(document, used, sets, false)?.0;
        }
        let mut written = json!({ "name": material.name, "pbrMetallicRoughness": pbr });
        if material.two_sided {
            written["doubleSided"] = json!(true);
        }
        let mut radiance = material.radiance;
        if let Some(used) = &material.radiance_texture {
            let (info, factor) = self.texture(document, used, sets, true)?;
            written["emissiveTexture"] = info;
            radiance *= factor;
        }
        let strength = radiance.max_element();
        if strength > 1.0 {
            written["emissiveFactor"] = json!((radiance / strength).to_array());
            written["extensions"] =
                json!({ "KHR_materials_emissive_strength": { "emissiveStrength": strength } });
            document.uses("KHR_materials_emissive_strength");
        } else if strength > 0.0 {
            written["emissiveFactor"] = json!(radiance.to_array());
        }
        Ok(written)
    }

    /// A material that shows its colour as it is, whatever lights there are; `base` is the texture
    /// information of its colour where it has one. Viewers that do not know the extension see a
    /// rough surface of that colour.
    pub fn unlit(
        &self,
        document: &mut Document,
        material: &Material,
        base: Option<Value>,
    ) -> Value {
        let mut pbr = json!({ "metallicFactor": 0.0, "roughnessFactor": 1.0 });
        if let Some(info) = base {
            pbr["baseColorTexture"] = info;
        }
        document.uses("KHR_materials_unlit");
        json!({
            "name": material.name, "pbrMetallicRoughness": pbr,
            "doubleSided": material.two_sided, "extensions": { "KHR_materials_unlit": {} },
        })
    }

    /// Texture information, and the factor that the texture was divided by so that it fits into
    /// [0, 1] (above 1 for textures of high dynamic range only).
    pub fn texture(
        &mut self,
        document: &mut Document,
        used: &TextureUse,
        sets: &[(usize, usize)],
        srgb: bool,
    ) -> Result<(Value, f64)> {
        let (image, factor) = self.image(document, used.texture, srgb)?;
        let sampler = self.sampler(document, used);
        let texture = document.push("textures", json!({ "source": image, "sampler": sampler }));
        let place = sets.iter().find(|(set, _)| *set == used.set).map_or(0, |(_, place)| *place);
        let mut info = json!({ "index": texture, "texCoord": place });
        if used.transform != TextureUse::plain(0).transform {
            // As it was read: scale, then rotate, then move; there is no shear.
            let [[a, b, u], [c, d, v]] = used.transform;
            let angle = (-c).atan2(a);
            let (sin, cos) = angle.sin_cos();
            let (across, down) = (cos * a - sin * c, sin * b + cos * d);
            info["extensions"] = json!({ "KHR_texture_transform": {
                "offset": [u, v], "rotation": angle, "scale": [across, down],
            } });
            document.uses("KHR_texture_transform");
        }
        Ok((info, factor))
    }

    fn image(
        &mut self,
        document: &mut Document,
        texture: usize,
        srgb: bool,
    ) -> Result<(usize, f64)> {
        if let Some(&known) = self.images.get(&(texture, srgb)) {
            return Ok(known);
        }
        let source = &self.scene.textures[texture];
        let largest = source.texels.iter().flatten().fold(1.0f32, |a, &b| a.max(b));
        let file = format!("{}-texture-{}.png", self.stem, self.images.len());
        let png = encode(source, srgb, largest)?;
        let known = (document.image(Image { file, png }), f64::from(largest));
        self.images.insert((texture, srgb), known);
        Ok(known)
    }

    fn sampler(&mut self, document: &mut Document, used: &TextureUse) -> usize {
        let wrap = |wrap| match wrap {
            Wrap::Repeat => REPEAT,
            Wrap::Mirror => MIRRORED,
            Wrap::Clamp => CLAMP,
        };
        let [s, t] = used.wrap.map(wrap);
        *self.samplers.entry((s, t, used.nearest)).or_insert_with(|| {
            let (mag, min) =
                if used.nearest { (NEAREST, NEAREST) } else { (LINEAR, LINEAR_MIPMAP_LINEAR) };
            let sampler = json!({ "magFilter": mag, "minFilter": min, "wrapS": s, "wrapT": t });
            document.push("samplers", sampler)
        })
    }
}

/// A texture of one page of light: interpolated, without coarser levels (which would mix charts),
/// not repeated. Its information for `TEXCOORD_1`.
pub fn add_page(document: &mut Document, image: Image) -> Value {
    let sampler =
        json!({ "magFilter": LINEAR, "minFilter": LINEAR, "wrapS": CLAMP, "wrapT": CLAMP });
    let sampler = document.push("samplers", sampler);
    let image = document.image(image);
    let texture = document.push("textures", json!({ "source": image, "sampler": sampler }));
    json!({ "index": texture, "texCoord": 1 })
}

fn encode(texture: &Texture, srgb: bool, largest: f32) -> Result<Vec<u8>> {
    let level = |v: f32| {
        let v = f64::from(v / largest).clamp(0.0, 1.0);
        (255.0 * if srgb { srgb_from_linear(v) } else { v }).round() as u8
    };
    let levels: Vec<u8> = texture.texels.iter().flatten().map(|&v| level(v)).collect();
    plain_png(texture.width, texture.height, &levels)
}

/// An 8-bit RGB picture without any chunk that says how it is meant: glTF says that, and its
/// validator complains of such chunks.
pub fn plain_png(width: u32, height: u32, levels: &[u8]) -> Result<Vec<u8>> {
    let failed = |e: png::EncodingError| Error::Runtime(format!("PNG: {e}"));
    let mut bytes = vec![];
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(levels).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transform_is_taken_apart_into_what_it_was_made_of() {
        let scene = Scene {
            textures: vec![Texture::new("t", 1, 1, vec![[4.0, 0.0, 1.0]])],
            ..Scene::default()
        };
        // Made as the reader makes them, a mirrored one among them.
        for (angle, [su, sv], [u, v]) in
            [(0.3f64, [2.0, 0.5], [0.1, -3.0]), (-2.5, [1.0, -1.0], [0.0, 1.0])]
        {
            let (sin, cos) = angle.sin_cos();
            let mut used = TextureUse::plain(0);
            used.transform = [[cos * su, sin * sv, u], [-sin * su, cos * sv, v]];
            let mut writer = MaterialWriter::new(&scene, "s");
            let mut document = Document::default();
            let (info, factor) = writer.texture(&mut document, &used, &[(0, 0)], true).unwrap();
            assert_eq!(factor, 4.0);
            let written = &info["extensions"]["KHR_texture_transform"];
            let number = |v: &Value| v.as_f64().unwrap();
            assert!((number(&written["rotation"]) - angle).abs() < 1e-12);
            assert!((number(&written["scale"][0]) - su).abs() < 1e-12);
            assert!((number(&written["scale"][1]) - sv).abs() < 1e-12);
            assert_eq!((number(&written["offset"][0]), number(&written["offset"][1])), (u, v));
        }
    }

    #[test]
    fn sets_of_coordinates_leave_room_for_the_lightmap() {
        let mut material = Material::plain("m", DVec3::ONE);
        assert_eq!(coordinate_sets(&material, Some(1)), []);
        material.radiance_texture = Some(TextureUse { set: 1, ..TextureUse::plain(0) });
        assert_eq!(coordinate_sets(&material, Some(1)), [(1, 0)]);
        material.reflectance_texture = Some(TextureUse::plain(0));
        assert_eq!(coordinate_sets(&material, Some(1)), [(0, 0), (1, 2)]);
        assert_eq!(coordinate_sets(&material, None), [(0, 0), (1, 1)]);
    }
}
