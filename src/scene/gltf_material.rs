//! Materials and textures of glTF files.
//!
//! Only diffuse reflection and emission are taken over. What else a material asks for is said in
//! one notice for each thing.

use std::collections::BTreeMap;

use gltf::json;
use json::material::AlphaMode;
use json::texture::{MagFilter, WrappingMode};
use json::validation::Checked;

use glam::DVec3;

use super::gltf_buffers;
use super::gltf_file::Source;
use super::limits::{Budget, Texels, clamp_reflectance};
use super::notices::Notices;
use super::texture::{self, DecodeError, Encoding, Texture, TextureUse, Wrap};
use super::{Material, gltf_exact};
use crate::error::{Error, Result};

/// Name of the material of primitives that have none.
const DEFAULT_NAME: &str = "default";

/// Materials as they are read, and the images that they use, each decoded once.
pub(crate) struct Materials {
    pub(crate) list: Vec<Material>,
    pub(crate) textures: Vec<Texture>,
    decoded: BTreeMap<(usize, Encoding), usize>,
    texels: Texels,
}

impl Materials {
    /// All materials of the file, in its order.
    pub(crate) fn read(source: &Source, budget: Budget, notices: &mut Notices) -> Result<Self> {
        let mut materials = Materials {
            list: Vec::new(),
            textures: Vec::new(),
            decoded: BTreeMap::new(),
            texels: Texels::new(budget),
        };
        for i in 0..source.root.materials.len() {
            let material = materials.material(source, i, notices)?;
            materials.list.push(material);
        }
        Ok(materials)
    }

    /// Adds glTF's default material and returns its index: white metal, so it reflects nothing
    /// diffusely.
    pub(crate) fn add_default(&mut self, notices: &mut Notices) -> u32 {
        let mut material = Material::plain(DEFAULT_NAME, DVec3::ONE);
        material.metallic = 1.0;
        notices.add(
            format!("material \"{DEFAULT_NAME}\""),
            "used where a mesh has no material; by the rules of glTF it is a perfect metal, which \
             reflects nothing diffusely: assign a material, or set its reflectance",
        );
        clamp_reflectance(&mut material, notices);
        self.list.push(material);
        // There are fewer than 2^32 materials: their indices in the file are u32.
        (self.list.len() - 1) as u32
    }

    fn material(
        &mut self,
        source: &Source,
        number: usize,
        notices: &mut Notices,
    ) -> Result<Material> {
        let read = &source.root.materials[number];
        let none = gltf_exact::Material::default();
        let exact = source.exact.materials.get(number).unwrap_or(&none);
        let what = source.material_name(number);
        let name = match &read.name {
            Some(name) if !name.is_empty() => name.clone(),
            _ => format!("material {number}"),
        };
        let pbr = &exact.pbr_metallic_roughness;
        let [r, g, b, _] = pbr.base_color_factor;
        let strength = exact.extensions.emissive_strength.emissive_strength;
        let radiance = DVec3::from(exact.emissive_factor) * strength;
        if !(radiance.is_finite() && radiance.min_element() >= 0.0) {
            return Err(Error::invalid(
                source.path,
                what,
                "its emission must be finite and not negative; correct the emissive factor or \
                 strength",
            ));
        }
        let mut material = Material::plain(name, DVec3::new(r, g, b));
        material.metallic = pbr.metallic_factor.clamp(0.0, 1.0);
        material.radiance = radiance;
        material.two_sided = read.double_sided;
        clamp_reflectance(&mut material, notices);

        let json_pbr = &read.pbr_metallic_roughness;
        // A texture that is multiplied by zero need not be there.
        if material.reflectance != DVec3::ZERO {
            let info = json_pbr.base_color_texture.as_ref();
            material.reflectance_texture = self.used(source, &what, info, Encoding::Srgb)?;
        }
        if material.metallic != 0.0 {
            let info = json_pbr.metallic_roughness_texture.as_ref();
            material.metallic_texture = self.used(source, &what, info, Encoding::Linear)?;
        }
        if material.radiance != DVec3::ZERO {
            let info = read.emissive_texture.as_ref();
            material.radiance_texture = self.used(source, &what, info, Encoding::Srgb)?;
        }
        say_what_is_lost(read, &material, notices);
        Ok(material)
    }

    /// How a material uses a texture, which is decoded if it has not been before.
    fn used(
        &mut self,
        source: &Source,
        what: &str,
        info: Option<&json::texture::Info>,
        encoding: Encoding,
    ) -> Result<Option<TextureUse>> {
        let Some(info) = info else { return Ok(None) };
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        let set = transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord);
        if set > 1 {
            return Err(Error::unsupported(
                source.path,
                what,
                format!("a texture with TEXCOORD_{set}; use TEXCOORD_0 or TEXCOORD_1"),
            ));
        }
        let texture = &source.root.textures[info.index.value()];
        let sampler = texture.sampler.and_then(|s| source.root.samplers.get(s.value()));
        let wrap = |mode: Checked<WrappingMode>| match mode {
            Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
            Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        let index = self.texture(source, texture.source.value(), encoding)?;
        let used = TextureUse {
            set: set as usize,
            transform: transform.map_or(TextureUse::plain(0).transform, matrix),
            wrap: sampler.map_or([Wrap::Repeat; 2], |s| [wrap(s.wrap_s), wrap(s.wrap_t)]),
            nearest: sampler
                .is_some_and(|s| s.mag_filter == Some(Checked::Valid(MagFilter::Nearest))),
            ..TextureUse::plain(index)
        };
        if !used.transform.iter().flatten().all(|x| x.is_finite()) {
            return Err(Error::invalid(
                source.path,
                what,
                "a texture transform is not finite; correct its numbers",
            ));
        }
        Ok(Some(used))
    }

    fn texture(&mut self, source: &Source, image: usize, encoding: Encoding) -> Result<usize> {
        if let Some(&index) = self.decoded.get(&(image, encoding)) {
            return Ok(index);
        }
        let what = source.image_name(image);
        let fail = |error| match error {
            DecodeError::Invalid(reason) => Error::invalid(source.path, &what, reason),
            DecodeError::Unsupported(reason) => Error::unsupported(source.path, &what, reason),
        };
        let bytes = gltf_buffers::image(source, image)?;
        let (width, height) = texture::dimensions(&bytes).map_err(fail)?;
        self.texels.add(source.path, &what, width, height)?;
        let texture = texture::decode(&bytes, &what, encoding).map_err(fail)?;
        self.textures.push(texture);
        self.decoded.insert((image, encoding), self.textures.len() - 1);
        Ok(self.textures.len() - 1)
    }
}

/// The affine map of `KHR_texture_transform`: scale, then rotate, then move. Counter-clockwise is
/// meant as seen on the image, whose second axis points down: u' = u cos + v sin,
/// v' = v cos - u sin. (The extension's example, a quadrant turned by a quarter, comes out this
/// way; the matrix printed beside it turns the other way.)
fn matrix(transform: &json::extensions::texture::TextureTransform) -> [[f64; 3]; 2] {
    let [su, sv] = transform.scale.0.map(f64::from);
    let [ou, ov] = transform.offset.0.map(f64::from);
    let (sin, cos) = f64::from(transform.rotation.0).sin_cos();
    [[cos * su, sin * sv, ou], [-sin * su, cos * sv, ov]]
}

/// Notices for everything of a material that diffuse reflection and emission cannot hold.
fn say_what_is_lost(read: &json::Material, material: &Material, notices: &mut Notices) {
    let about = format!("material \"{}\"", material.name);
    let mut say = |text: &str| notices.add(&about, text);
    if material.metallic_texture.is_some() {
        say("where its texture says metal, only the share that is not metal reflects diffusely");
    } else if material.metallic == 1.0 {
        say("it is a perfect metal (metallicFactor 1, also glTF's default), which reflects \
             nothing diffusely: set metallicFactor to 0, or set its reflectance");
    } else if material.metallic > 0.0 {
        say("it is partly metal; only the share that is not metal reflects diffusely");
    }
    if !matches!(read.alpha_mode, Checked::Valid(AlphaMode::Opaque)) {
        say("transparency (alpha) is left out: it is opaque");
    }
    if read.normal_texture.is_some() {
        say("its normal map is left out");
    }
    if read.occlusion_texture.is_some() {
        say("its occlusion texture is left out: occlusion is computed");
    }
    let Some(extensions) = &read.extensions else { return };
    if extensions.unlit.is_some() {
        say("it is unlit in glTF; here it is lit like any other, by its base colour");
    }
    for name in extensions.others.keys() {
        say(&match name.as_str() {
            "KHR_materials_transmission" | "KHR_materials_diffuse_transmission" => {
                format!("transmission ({name}) is left out: it is opaque")
            }
            _ => format!("{name} is left out"),
        });
    }
}
