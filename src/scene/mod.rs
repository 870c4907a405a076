//! What is to be lit: world-space triangles, materials, textures, cameras.
//!
//! A scene file is read into plain data here and nowhere else. Every oddity of the input is
//! resolved in this room; what was resolved is listed in [`Scene::notices`], so that later rooms
//! see only finite, non-degenerate, distinct triangles in metres, right-handed axes.
//!
//! | file | subject |
//! |---|---|
//! | `read` | which reader a file gets, and the order of the steps |
//! | `gltf_*` | glTF and GLB |
//! | `obj_*`, `mtl`, `polygon` | OBJ with MTL |
//! | `uri` | files that a scene file refers to |
//! | `overrides` | what the command line changes in materials |
//! | `hygiene` | degenerate and duplicate triangles |
//! | `winding`, `corners` | neighbours that disagree about their front; which triangles share corners |
//! | `canonical` | the order of objects, which follows from where they are |
//! | `precision` | to how many digits coordinates are known |
//! | `overlaps` | faces that overlap in one plane |
//! | `texture`, `appearance` | images, and averages of what varies over a surface |
//! | `camera`, `default_view` | views |
//! | `limits`, `notices` | bounds of what is accepted, and the list of oddities |

mod appearance;
mod camera;
mod canonical;
mod corners;
mod default_view;
mod gltf_accessor;
mod gltf_buffers;
mod gltf_exact;
mod gltf_file;
mod gltf_guard;
mod gltf_index;
mod gltf_material;
mod gltf_mesh;
mod gltf_nodes;
mod hygiene;
mod limits;
mod mtl;
mod notices;
mod obj_file;
mod obj_text;
mod overlaps;
mod overrides;
mod polygon;
mod precision;
mod read;
mod texture;
mod uri;
mod winding;

use std::path::PathBuf;

use glam::{DVec2, DVec3};

use crate::geometry::{Bounds, contact_distance};

pub use appearance::{exitance, reflectance};
pub use camera::{Camera, Projection, look_at};
pub use corners::corner_numbers;
pub use default_view::default_camera;
pub use limits::MAX_REFLECTANCE;
pub use notices::group_notices;
pub use overlaps::{Overlaps, resolve as resolve_overlaps};
pub use overrides::{Override, name_fits};
pub use read::{ReadOptions, read};
pub use texture::{Texture, TextureUse, Wrap};
pub use winding::DISAGREES;

/// A whole scene, in world space.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The file that it was read from.
    pub path: PathBuf,
    /// All files that it was read from: that one, buffers, images, material libraries.
    pub files: Vec<PathBuf>,
    /// Named things that triangles belong to: a glTF node with a mesh, an OBJ object or group.
    pub objects: Vec<Object>,
    /// Materials; every triangle's index is valid.
    pub materials: Vec<Material>,
    /// Decoded images.
    pub textures: Vec<Texture>,
    /// Input faces, counter-clockwise seen from the side that radiates; those of one object together,
    /// in the order of the file, and objects in an order that does not depend on the file's.
    pub triangles: Vec<Triangle>,
    /// What coordinates are known to, metres, where f64 holds more digits than the file gave; else 0.
    pub rounding: f64,
    /// Cameras in the order of the file.
    pub cameras: Vec<Camera>,
    /// What was odd in the input and what was made of it.
    pub notices: Vec<Notice>,
    /// What was done about faces that overlap in one plane.
    pub overlaps: Overlaps,
    /// Objects whose faces do not agree about their front, in ascending order.
    pub winding: Vec<Disagreement>,
}

/// An object with neighbouring one-sided triangles that have their fronts on different sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disagreement {
    /// Index into [`Scene::objects`].
    pub object: u32,
    /// Edges across which it happens.
    pub edges: usize,
    /// The middle of one of them, metres.
    pub at: DVec3,
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
    /// Reflectance rho, per channel, in [0, [`MAX_REFLECTANCE`]]; multiplied by texture and
    /// vertex colour.
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

impl Scene {
    /// The corners of the smallest axis-parallel box that holds all triangles: least, greatest.
    /// Both are zero for a scene without triangles, which no reader returns.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let mut corners = self.triangles.iter().flat_map(|t| t.vertices);
        let Some(first) = corners.next() else {
            return (DVec3::ZERO, DVec3::ZERO);
        };
        corners.fold((first, first), |(low, high), p| (low.min(p), high.max(p)))
    }

    /// The largest side of [`Scene::bounds`], metres.
    pub fn extent(&self) -> f64 {
        let (low, high) = self.bounds();
        (high - low).max_element()
    }

    /// Distance within which faces touch, metres; see [`contact_distance`].
    pub fn contact_distance(&self) -> f64 {
        let (min, max) = self.bounds();
        contact_distance(Bounds { min, max }, self.rounding)
    }

    /// Whether a material emits light in any channel, somewhere on its texture. An index past the
    /// end emits nothing.
    pub fn emits(&self, material: usize) -> bool {
        self.materials.get(material).is_some_and(|m| m.radiance.max_element() > 0.0)
    }

    /// Unit normal, on the side from which the corners run counter-clockwise, and area in square
    /// metres of a triangle.
    ///
    /// # Panics
    ///
    /// If there is no such triangle.
    pub fn triangle_normal_and_area(&self, triangle: usize) -> (DVec3, f64) {
        self.triangles[triangle].normal_and_area()
    }
}

impl Triangle {
    /// Unit normal and area; the normal is zero for a triangle that [`read`] would have dropped.
    pub fn normal_and_area(&self) -> (DVec3, f64) {
        let [a, b, c] = self.vertices;
        let double = (b - a).cross(c - a);
        let length = double.length();
        if length > 0.0 { (double / length, 0.5 * length) } else { (DVec3::ZERO, 0.0) }
    }

    /// The same face seen from behind: winding and everything given by corner reversed.
    pub(crate) fn reverse(&mut self) {
        self.vertices.swap(1, 2);
        self.colour.swap(1, 2);
        for set in &mut self.uv {
            set.swap(1, 2);
        }
    }
}

impl Material {
    /// A material without textures, metal or emission, one-sided.
    pub fn plain(name: impl Into<String>, reflectance: DVec3) -> Self {
        Material {
            name: name.into(),
            reflectance,
            reflectance_texture: None,
            metallic: 0.0,
            metallic_texture: None,
            radiance: DVec3::ZERO,
            radiance_texture: None,
            two_sided: false,
        }
    }
}
