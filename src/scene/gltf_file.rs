//! glTF 2.0 files, as JSON or GLB, with their buffers and images.
//!
//! The order of the steps: take the container apart, parse the JSON, guard (see `gltf_guard`),
//! load buffers, read materials, place nodes, read each mesh once and copy it to every node that
//! uses it. A transform that mirrors reverses the winding, as the specification asks.

use std::borrow::Cow;
use std::path::Path;
use std::rc::Rc;

use gltf::json;
use json::validation::Checked;

use glam::{DAffine3, DVec3};

use super::camera::{Camera, Projection};
use super::gltf_buffers::{self, named};
use super::gltf_exact::Exact;
use super::gltf_material::Materials;
use super::gltf_mesh::{self, MaterialId};
use super::gltf_nodes::{self, Placed};
use super::limits::Budget;
use super::notices::Notices;
use super::{Object, Scene, Triangle, gltf_guard, gltf_index, uri};
use crate::error::{Error, Result};
use crate::geometry::SINGLE;

/// A glTF document with its bytes.
pub(crate) struct Source<'a> {
    /// The file, for messages and relative references.
    pub(crate) path: &'a Path,
    /// The crate's view of the JSON.
    pub(crate) root: &'a json::Root,
    /// Numbers of the JSON in f64.
    pub(crate) exact: &'a Exact,
    /// Bytes of every buffer; those of one file are there once.
    pub(crate) buffers: Vec<Rc<Cow<'a, [u8]>>>,
}

impl Source<'_> {
    /// A node in words.
    pub(crate) fn node_name(&self, i: usize) -> String {
        named("node", i, self.root.nodes.get(i).and_then(|n| n.name.as_deref()))
    }

    /// A primitive of a mesh in words.
    pub(crate) fn primitive_name(&self, mesh: usize, primitive: usize) -> String {
        let name = self.root.meshes.get(mesh).and_then(|m| m.name.as_deref());
        format!("{}, primitive {primitive}", named("mesh", mesh, name))
    }

    /// A material in words.
    pub(crate) fn material_name(&self, i: usize) -> String {
        named("material", i, self.root.materials.get(i).and_then(|m| m.name.as_deref()))
    }

    /// An image in words.
    pub(crate) fn image_name(&self, i: usize) -> String {
        let image = self.root.images.get(i);
        let file = image.and_then(|m| m.uri.as_deref()).filter(|uri| !uri.starts_with("data:"));
        named("image", i, image.and_then(|m| m.name.as_deref()).or(file))
    }
}

/// Reads a glTF or GLB file.
pub(crate) fn read(path: &Path, bytes: &[u8], budget: Budget) -> Result<Scene> {
    let parts = gltf_buffers::split(path, bytes)?;
    let bad_json = |e: serde_json::Error| {
        Error::unreadable(path, format!("its JSON is no glTF document: {e}; export it again"))
    };
    let root = json::Root::from_slice(&parts.json).map_err(|e| {
        // Other versions have other structures: that is what to say of them, not where they differ.
        match gltf_guard::other_version(&parts.json) {
            Some(version) => gltf_guard::unsupported_version(path, &version),
            None => bad_json(e),
        }
    })?;
    let exact: Exact = serde_json::from_slice(&parts.json).map_err(bad_json)?;
    if let Some((member, number)) = gltf_index::too_large(&parts.json).map_err(bad_json)? {
        return Err(Error::invalid(
            path,
            format!("member \"{member}\""),
            format!("{number} is too large; the file is damaged, export it again"),
        ));
    }
    let mut source = Source { path, root: &root, exact: &exact, buffers: Vec::new() };
    let mut notices = Notices::default();
    gltf_guard::check(&source, &mut notices)?;
    source.buffers = gltf_buffers::load(&source, parts.blob)?;

    let placed = gltf_nodes::placed(&source, &mut notices)?;
    let mut materials = Materials::read(&source, budget, &mut notices)?;
    let mut scene = Scene { path: path.to_path_buf(), ..Scene::default() };
    let mut meshes = Meshes::new(&source, budget);
    for node in &placed {
        let read = &root.nodes[node.node];
        if let Some(mesh) = read.mesh {
            meshes.place(&mut scene, &mut materials, node, mesh.value(), &mut notices)?;
        }
        if let Some(camera) = read.camera {
            let camera = self::camera(&source, node, camera.value(), &mut notices)?;
            scene.cameras.extend(camera);
        }
        let lamp = read.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
        if lamp.is_some() {
            notices.add(
                source.node_name(node.node),
                "a punctual light has no surface and is left out; use a mesh with emission",
            );
        }
    }
    scene.materials = materials.list;
    scene.textures = materials.textures;
    scene.notices = notices.into_list();
    let buffers = root.buffers.iter().filter_map(|b| b.uri.as_deref());
    let images = root.images.iter().filter_map(|i| i.uri.as_deref());
    scene.files = buffers.chain(images).filter_map(|uri| uri::file_of(path, uri)).collect();
    Ok(scene)
}

/// Meshes read so far, each in its own space.
struct Meshes<'a> {
    source: &'a Source<'a>,
    read: Vec<Option<Vec<(Triangle, MaterialId)>>>,
    default_material: Option<u32>,
    budget: Budget,
}

impl<'a> Meshes<'a> {
    fn new(source: &'a Source<'a>, budget: Budget) -> Self {
        let read = source.root.meshes.iter().map(|_| None).collect();
        Meshes { source, read, default_material: None, budget }
    }

    /// Adds a node's mesh to the scene.
    fn place(
        &mut self,
        scene: &mut Scene,
        materials: &mut Materials,
        placed: &Placed,
        mesh: usize,
        notices: &mut Notices,
    ) -> Result<()> {
        let source = self.source;
        let triangles = match &mut self.read[mesh] {
            Some(triangles) => triangles,
            empty => empty.insert(gltf_mesh::read(source, mesh, self.budget, notices)?),
        };
        let count = scene.triangles.len() + triangles.len();
        self.budget.triangles(source.path, &source.node_name(placed.node), count)?;
        let node = &source.root.nodes[placed.node];
        let mut world = placed.world;
        if node.skin.is_some() {
            // Joints alone place a skinned mesh; its own node does not.
            world = DAffine3::IDENTITY;
            notices.add(
                source.node_name(placed.node),
                "its skin is left out; the mesh is used as it was modelled",
            );
        }
        let mesh_name = source.root.meshes[mesh].name.as_ref();
        let name = [node.name.as_ref(), mesh_name].into_iter().flatten().find(|n| !n.is_empty());
        let name = name.cloned().unwrap_or_else(|| format!("node {}", placed.node));
        // Fewer than 2^32: one for each node, whose indices are u32.
        let object = scene.objects.len() as u32;
        scene.objects.push(Object { name });

        let mirrors = world.matrix3.determinant() < 0.0;
        let (mut largest, m) = (0.0f64, world.matrix3);
        for (triangle, material) in triangles.iter() {
            let mut triangle = triangle.clone();
            let sizes = triangle.vertices.map(|p| p.abs().max_element());
            largest = sizes.into_iter().fold(largest, f64::max);
            triangle.vertices = triangle.vertices.map(|p| world.transform_point3(p));
            triangle.object = object;
            triangle.material = match material {
                Some(material) => *material as u32,
                None => {
                    *self.default_material.get_or_insert_with(|| materials.add_default(notices))
                }
            };
            if mirrors {
                triangle.reverse();
            }
            scene.triangles.push(triangle);
        }
        // Positions of a mesh are f32; a transform spreads the rounding of each over all three.
        let stretch = (m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs()).max_element();
        scene.rounding = scene.rounding.max(SINGLE * stretch * largest);
        Ok(())
    }
}

/// A camera at a node: it looks along the node's -Z, with +Y up. Scale does not matter for it,
/// as the specification asks.
fn camera(
    source: &Source,
    placed: &Placed,
    number: usize,
    notices: &mut Notices,
) -> Result<Option<Camera>> {
    let read = &source.root.cameras[number];
    let what = named("camera", number, read.name.as_deref());
    let wrong = |reason: &str| Error::invalid(source.path, &what, reason);
    let missing = || wrong("it lacks the lens of its type; export the scene again");
    let exact = source.exact.cameras.get(number).ok_or_else(missing)?;
    let positive = |x: f64| x.is_finite() && x > 0.0;
    let projection = match read.type_ {
        Checked::Valid(json::camera::Type::Perspective) => {
            let lens = exact.perspective.as_ref().ok_or_else(missing)?;
            if !(lens.yfov > 0.0 && lens.yfov < std::f64::consts::PI) {
                return Err(wrong("its field of view (yfov) must be between 0 and pi; correct it"));
            }
            if lens.aspect_ratio.is_some_and(|a| !positive(a)) {
                return Err(wrong("its aspect ratio must be positive; correct or remove it"));
            }
            Projection::Perspective { vertical_fov: lens.yfov, aspect: lens.aspect_ratio }
        }
        Checked::Valid(json::camera::Type::Orthographic) => {
            let lens = exact.orthographic.as_ref().ok_or_else(missing)?;
            // Negative magnifications mirror the picture and are discouraged.
            let (half_width, half_height) = (lens.xmag.abs(), lens.ymag.abs());
            if !(positive(half_width) && positive(half_height)) {
                return Err(wrong("its magnification must be finite and not zero; correct it"));
            }
            Projection::Orthographic { half_width, half_height }
        }
        Checked::Invalid => return Err(missing()),
    };
    let matrix = placed.world.matrix3;
    let forward = (matrix * DVec3::NEG_Z).try_normalize();
    // Perpendicular axes, whatever the node's scale and shear; never mirrored.
    let right = forward.and_then(|f| f.cross(matrix * DVec3::Y).try_normalize());
    let (Some(forward), Some(right)) = (forward, right) else {
        notices.add(what, "its node is flattened to nothing; the camera is left out");
        return Ok(None);
    };
    let node = source.root.nodes[placed.node].name.as_ref();
    let name = [node, read.name.as_ref()].into_iter().flatten().find(|n| !n.is_empty());
    Ok(Some(Camera {
        name: name.cloned().unwrap_or_else(|| format!("camera {number}")),
        eye: placed.world.translation,
        right,
        up: right.cross(forward),
        forward,
        projection,
    }))
}
