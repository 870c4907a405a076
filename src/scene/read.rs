//! Which reader a file gets, and the order of the steps that make it a scene.

use std::path::Path;

use super::limits::Budget;
use super::overrides::{self, Override};
use super::{Scene, canonical, gltf_file, hygiene, obj_file, overlaps, precision, uri, winding};
use crate::error::{Error, Result};

/// What the user wants changed in a scene while it is read. The default changes nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// Every material radiates on both sides.
    pub two_sided: bool,
    /// Factor on all emission.
    pub light_scale: f64,
    /// Radiances that replace those of the file (and their textures); later ones win.
    pub emission: Vec<Override>,
    /// Reflectances that replace those of the file (with textures, metal and vertex colours);
    /// later ones win.
    pub reflectance: Vec<Override>,
    /// Bytes that the scene may take until it is meshed (64 MiB it may take in any case).
    pub max_memory: u64,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions {
            two_sided: false,
            light_scale: 1.0,
            emission: Vec::new(),
            reflectance: Vec::new(),
            max_memory: u64::MAX,
        }
    }
}

/// Reads a scene: glTF (`.gltf`, `.glb`) or Wavefront OBJ (`.obj`).
///
/// The bytes decide before the name does: what begins with `glTF` is read as GLB whatever it is
/// called. Materials are then changed as `options` ask, degenerate and duplicate triangles are left
/// out, neighbours that disagree about their front are counted, triangles are put in an order that does
/// not depend on that of the objects, and faces that overlap in one plane are cut; see
/// [`Scene::notices`].
///
/// # Errors
///
/// [`Error::Unreadable`], [`Error::Invalid`] or [`Error::Unsupported`] for a bad file,
/// [`Error::Usage`] for options that do not fit it, [`Error::Memory`] for triangles or images that
/// together are too many.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Scene> {
    let bytes = uri::read_regular(path).map_err(|reason| Error::unreadable(path, reason))?;
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    let budget = Budget::new(options.max_memory);
    let mut scene = if bytes.starts_with(b"glTF") {
        gltf_file::read(path, &bytes, budget)?
    } else {
        match extension.as_deref() {
            Some("gltf" | "glb") => gltf_file::read(path, &bytes, budget)?,
            Some("obj") => obj_file::read(path, &bytes, budget)?,
            _ => {
                return Err(Error::unsupported(
                    path,
                    "file type",
                    "scenes are read from .gltf, .glb and .obj files; export to one of these",
                ));
            }
        }
    };
    scene.path = path.to_path_buf();
    scene.files.insert(0, path.to_path_buf());
    overrides::apply(&mut scene, options)?;
    hygiene::clean(&mut scene)?;
    // The reader leaves what it knows of coordinates before they were put in their place.
    scene.rounding = precision::rounding(&scene, scene.rounding);
    winding::check(&mut scene);
    canonical::arrange(&mut scene);
    overlaps::resolve(&mut scene);
    Ok(scene)
}
