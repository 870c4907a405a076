//! Checks of a glTF document before anything in it is followed.
//!
//! The `gltf` crate panics on some files (an index past the end inside its own validation) and
//! accepts others in silence (cyclic nodes, version 1). So its structures are checked here first:
//! version, required extensions, every index that this program or that validation follows, and the
//! shape of the node graph. After that its validation runs, and nothing it refuses is accepted,
//! except a missing `min` or `max`, which nothing here needs.

use gltf::json;
use json::validation::{Checked, Validate};

use super::gltf_file::Source;
use super::notices::Notices;
use crate::error::{Error, Result};

/// Extensions that a file may require.
const SUPPORTED: [&str; 4] = [
    "KHR_materials_emissive_strength",
    "KHR_materials_unlit",
    "KHR_lights_punctual",
    "KHR_texture_transform",
];

/// Checks everything that later steps rely on.
pub(crate) fn check(source: &Source, notices: &mut Notices) -> Result<()> {
    version(source)?;
    extensions(source, notices)?;
    indices(source)?;
    graph(source)?;
    validate(source)
}

fn version(source: &Source) -> Result<()> {
    let asset = &source.root.asset;
    if !asset.version.starts_with("2.") {
        return Err(unsupported_version(source.path, &asset.version));
    }
    match &asset.min_version {
        Some(least) if least != "2.0" => Err(unsupported_version(source.path, least)),
        _ => Ok(()),
    }
}

/// The error for a version that is not read.
pub(crate) fn unsupported_version(path: &std::path::Path, version: &str) -> Error {
    let reason = format!("glTF version \"{version}\"; export it as glTF 2.0");
    Error::unsupported(path, "asset", reason)
}

/// The version of a document, if it says one that is not 2.
pub(crate) fn other_version(json: &[u8]) -> Option<String> {
    #[derive(serde::Deserialize)]
    struct Document {
        asset: Asset,
    }
    #[derive(serde::Deserialize)]
    struct Asset {
        /// A number in the oldest ones.
        version: serde_json::Value,
    }
    let document: Document = serde_json::from_slice(json).ok()?;
    let version = match document.asset.version {
        serde_json::Value::String(text) => text,
        serde_json::Value::Number(number) => number.to_string(),
        _ => return None,
    };
    (!version.starts_with("2.")).then_some(version)
}

fn extensions(source: &Source, notices: &mut Notices) -> Result<()> {
    for name in &source.root.extensions_required {
        if SUPPORTED.contains(&name.as_str()) {
            continue;
        }
        let remedy = match name.as_str() {
            "KHR_draco_mesh_compression" | "EXT_meshopt_compression" => "without compression",
            "KHR_mesh_quantization" => "without quantization (32-bit float positions)",
            "KHR_texture_basisu" | "EXT_texture_webp" | "EXT_texture_avif" => {
                "with PNG or JPEG textures"
            }
            _ => "without it",
        };
        return Err(Error::unsupported(
            source.path,
            format!("required extension {name}"),
            format!("export the scene again {remedy}"),
        ));
    }
    for name in &source.root.extensions_used {
        let by_material = name.starts_with("KHR_materials_") || name.contains("_texture_");
        if !SUPPORTED.contains(&name.as_str()) && !by_material {
            notices.add(format!("extension {name}"), "not read; what it adds is left out");
        }
    }
    Ok(())
}

/// Reports indices past the end.
struct Ids<'a> {
    source: &'a Source<'a>,
}

impl Ids<'_> {
    fn one<T>(
        &self,
        owner: impl FnOnce() -> String,
        member: &str,
        index: json::Index<T>,
        of: &[T],
    ) -> Result<()> {
        if index.value() < of.len() {
            return Ok(());
        }
        Err(Error::invalid(
            self.source.path,
            owner(),
            format!(
                "{member} {} does not exist (there are {}); the file is damaged, export it again",
                index.value(),
                of.len()
            ),
        ))
    }
}

fn indices(source: &Source) -> Result<()> {
    let root = source.root;
    let ids = Ids { source };
    if let Some(scene) = root.scene {
        ids.one(|| "file".into(), "default scene", scene, &root.scenes)?;
    }
    for (i, scene) in root.scenes.iter().enumerate() {
        for &node in &scene.nodes {
            ids.one(|| format!("scene {i}"), "node", node, &root.nodes)?;
        }
    }
    for (i, node) in root.nodes.iter().enumerate() {
        let owner = || source.node_name(i);
        for &child in node.children.iter().flatten() {
            ids.one(owner, "child node", child, &root.nodes)?;
        }
        if let Some(mesh) = node.mesh {
            ids.one(owner, "mesh", mesh, &root.meshes)?;
        }
        if let Some(camera) = node.camera {
            ids.one(owner, "camera", camera, &root.cameras)?;
        }
        if let Some(skin) = node.skin {
            ids.one(owner, "skin", skin, &root.skins)?;
        }
    }
    for (i, mesh) in root.meshes.iter().enumerate() {
        for (k, primitive) in mesh.primitives.iter().enumerate() {
            let owner = || source.primitive_name(i, k);
            for (semantic, &accessor) in &primitive.attributes {
                let name = match semantic {
                    Checked::Valid(semantic) => format!("{semantic:?} accessor"),
                    Checked::Invalid => "attribute accessor".into(),
                };
                ids.one(owner, &name, accessor, &root.accessors)?;
            }
            if let Some(accessor) = primitive.indices {
                ids.one(owner, "index accessor", accessor, &root.accessors)?;
            }
            if let Some(material) = primitive.material {
                ids.one(owner, "material", material, &root.materials)?;
            }
        }
    }
    for (i, accessor) in root.accessors.iter().enumerate() {
        let owner = || format!("accessor {i}");
        if let Some(view) = accessor.buffer_view {
            ids.one(owner, "buffer view", view, &root.buffer_views)?;
        }
        if let Some(sparse) = &accessor.sparse {
            let views = &root.buffer_views;
            ids.one(owner, "buffer view of sparse indices", sparse.indices.buffer_view, views)?;
            ids.one(owner, "buffer view of sparse values", sparse.values.buffer_view, views)?;
        }
    }
    for (i, view) in root.buffer_views.iter().enumerate() {
        ids.one(|| format!("buffer view {i}"), "buffer", view.buffer, &root.buffers)?;
    }
    for (i, image) in root.images.iter().enumerate() {
        if let Some(view) = image.buffer_view {
            ids.one(|| source.image_name(i), "buffer view", view, &root.buffer_views)?;
        }
    }
    for (i, texture) in root.textures.iter().enumerate() {
        let owner = || format!("texture {i}");
        if let Some(sampler) = texture.sampler {
            ids.one(owner, "sampler", sampler, &root.samplers)?;
        }
        if texture.source.value() == u32::MAX as usize {
            return Err(Error::unsupported(
                source.path,
                owner(),
                "it has no PNG or JPEG image; export the scene with such textures",
            ));
        }
        ids.one(owner, "image", texture.source, &root.images)?;
    }
    for (i, material) in root.materials.iter().enumerate() {
        let pbr = &material.pbr_metallic_roughness;
        let used =
            [&pbr.base_color_texture, &pbr.metallic_roughness_texture, &material.emissive_texture];
        for info in used.into_iter().flatten() {
            ids.one(|| source.material_name(i), "texture", info.index, &root.textures)?;
        }
    }
    Ok(())
}

/// The nodes must form trees, and a scene's nodes must be roots of distinct ones.
fn graph(source: &Source) -> Result<()> {
    let nodes = &source.root.nodes;
    let wrong =
        |node: usize, reason: String| Error::invalid(source.path, source.node_name(node), reason);
    let mut parent = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for child in node.children.iter().flatten().map(|c| c.value()) {
            if let Some(other) = parent[child].replace(i) {
                return Err(wrong(
                    child,
                    format!(
                        "it is a child of both {} and {}; a node may have one parent: \
                         give each its own copy",
                        source.node_name(other),
                        source.node_name(i)
                    ),
                ));
            }
        }
    }
    // Walk down from the roots; with one parent each, what is not reached hangs on a cycle.
    let mut reached = vec![false; nodes.len()];
    let mut stack: Vec<usize> = (0..nodes.len()).filter(|&i| parent[i].is_none()).collect();
    while let Some(i) = stack.pop() {
        reached[i] = true;
        stack.extend(nodes[i].children.iter().flatten().map(|c| c.value()));
    }
    if let Some(i) = reached.iter().position(|&r| !r) {
        return Err(wrong(i, "it is its own ancestor (a cycle of nodes)".into()));
    }
    for (i, scene) in source.root.scenes.iter().enumerate() {
        let mut listed = vec![false; nodes.len()];
        for node in scene.nodes.iter().map(|n| n.value()) {
            if std::mem::replace(&mut listed[node], true) {
                return Err(wrong(node, format!("scene {i} lists it twice")));
            }
            if parent[node].is_some() {
                return Err(wrong(
                    node,
                    format!("scene {i} lists it as a root, but it is a child"),
                ));
            }
        }
    }
    Ok(())
}

/// What the crate itself refuses.
fn validate(source: &Source) -> Result<()> {
    let mut first = None;
    source.root.validate(source.root, json::Path::new, &mut |path, error| {
        let path = path().to_string();
        let bounds = error == json::validation::Error::Missing
            && (path.ends_with(".min") || path.ends_with(".max"));
        // A primitive without positions draws nothing; its reader says so.
        let empty = error == json::validation::Error::Missing && path.contains("[\"POSITION\"]");
        if !bounds && !empty && first.is_none() {
            first = Some((path, error));
        }
    });
    match first {
        None => Ok(()),
        Some((path, error)) => Err(Error::invalid(
            source.path,
            path,
            format!("{}; the file is damaged, export it again", error.to_string().to_lowercase()),
        )),
    }
}
