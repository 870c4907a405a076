//! What is to be lit: world-space triangles, materials, textures, cameras.
//!
//! A scene file is read into plain data here and nowhere else. Every oddity of the input is
//! resolved in this room; what was resolved is listed in [`Scene::notices`], so that later rooms
//! see only finite, non-degenerate, distinct triangles in metres, right-handed axes.


use std::path::PathBuf;

use glam::{DVec2, DVec3};


/// A whole scene, in world space.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The file that it was read from.
    pub path: PathBuf,
    /// Named things that triangles belong to: a glTF node with a mesh, an OBJ object or group.
    pub objects: Vec<Object>,
    /// Materials; every triangle's index is valid.
    pub materials: Vec<Material>,
    /// Decoded images.
    pub textures: Vec<Texture>,
    /// Input faces, counter-clockwise seen from the side that radiates.
    pub triangles: Vec<Triangle>,
    /// Cameras in the order of the file.
    pub cameras: Vec<Camera>,
    /// What was odd in the input and what was made of it.
    pub notices: Vec<Notice>,
}

/// A named part of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Its name in the file, or one made from its place there.
    pub name: String,
}

/// One input face.
#[derive(Clone, Debug, PartialEq)]
pub struct Triangle {
    /// Corners in metres, counter-clockwise about the normal.
    pub vertices: [DVec3; 3],
    /// Texture coordinates of the corners, for the first and the second set (zero where absent).
    pub uv: [[DVec2; 3]; 2],
    /// Linear vertex colours, which multiply the reflectance (white where absent).
    pub colour: [DVec3; 3],
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Index into [`Scene::objects`].
    pub object: u32,
}

/// Diffuse reflection and emission of a surface. Colours are linear, channels R, G, B.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file, or one made from its place there.
    pub name: String,
    /// Reflectance rho, per channel, in [0, 1); multiplied by texture and vertex colour.
    pub reflectance: DVec3,
    /// Texture that multiplies the reflectance.
    pub reflectance_texture: Option<TextureUse>,
    /// Share of the base colour that a metal takes away from diffuse reflection: the reflectance
    /// is multiplied by (1 - metallic * texture's blue channel).
    pub metallic: f64,
    /// Texture of the metallic factor (blue channel, linear).
    pub metallic_texture: Option<TextureUse>,
    /// Emitted radiance, per channel; multiplied by its texture. Exitance is pi times this.
    pub radiance: DVec3,
    /// Texture that multiplies the radiance.
    pub radiance_texture: Option<TextureUse>,
    /// Whether both sides of its triangles radiate.
    pub two_sided: bool,
}

/// Something odd in the input, said once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// The object, material or file part that it is about.
    pub about: String,
    /// What was found and what was made of it.
    pub text: String,
    /// How often it occurred.
    pub count: usize,
}

/// A decoded image. (Being written: see `texture`.)
#[derive(Clone, Debug, Default)]
pub struct Texture;

/// How a material uses a texture.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureUse;

/// A view of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the file, or one made from its place there.
    pub name: String,
    /// Position of the eye, metres.
    pub eye: DVec3,
    /// Unit vector to the right of the picture.
    pub right: DVec3,
    /// Unit vector to the top of the picture.
    pub up: DVec3,
    /// Unit vector into the picture.
    pub forward: DVec3,
    /// How points are projected.
    pub projection: Projection,
}

/// Projection of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Full vertical field of view, radians; width over height where the file fixes it.
    Perspective { vertical_fov: f64, aspect: Option<f64> },
    /// Half width and half height of the view, metres.
    Orthographic { half_width: f64, half_height: f64 },
}
