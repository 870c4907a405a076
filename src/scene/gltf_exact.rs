//! Numbers of a glTF file in f64.
//!
//! The `gltf` crate rounds every JSON number to f32. Transforms and colours are wanted as they were
//! written, so the few places that matter here are read a second time. Everything is optional and
//! unknown members are skipped: what must be there is checked on the crate's own structures.

use serde::Deserialize;

/// The members of a glTF file that are wanted in f64.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Exact {
    /// As many as the file has nodes.
    pub(crate) nodes: Vec<Node>,
    /// As many as the file has materials.
    pub(crate) materials: Vec<Material>,
    /// As many as the file has cameras.
    pub(crate) cameras: Vec<Camera>,
}

/// Transform of a node.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Node {
    pub(crate) matrix: Option<[f64; 16]>,
    pub(crate) translation: Option<[f64; 3]>,
    pub(crate) rotation: Option<[f64; 4]>,
    pub(crate) scale: Option<[f64; 3]>,
}

/// Factors of a material.
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct Material {
    pub(crate) pbr_metallic_roughness: Pbr,
    pub(crate) emissive_factor: [f64; 3],
    pub(crate) extensions: MaterialExtensions,
}

/// Metallic-roughness factors; the defaults are the specification's.
#[derive(Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct Pbr {
    pub(crate) base_color_factor: [f64; 4],
    pub(crate) metallic_factor: f64,
}

impl Default for Pbr {
    fn default() -> Self {
        Pbr { base_color_factor: [1.0; 4], metallic_factor: 1.0 }
    }
}

/// Extensions of a material that carry numbers.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct MaterialExtensions {
    #[serde(rename = "KHR_materials_emissive_strength")]
    pub(crate) emissive_strength: EmissiveStrength,
}

/// `KHR_materials_emissive_strength`.
#[derive(Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct EmissiveStrength {
    pub(crate) emissive_strength: f64,
}

impl Default for EmissiveStrength {
    fn default() -> Self {
        EmissiveStrength { emissive_strength: 1.0 }
    }
}

/// Lens of a camera.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Camera {
    pub(crate) perspective: Option<Perspective>,
    pub(crate) orthographic: Option<Orthographic>,
}

/// Perspective lens.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Perspective {
    pub(crate) yfov: f64,
    pub(crate) aspect_ratio: Option<f64>,
}

/// Orthographic lens.
#[derive(Debug, Deserialize)]
pub(crate) struct Orthographic {
    pub(crate) xmag: f64,
    pub(crate) ymag: f64,
}
