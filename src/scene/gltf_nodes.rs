//! The node hierarchy: world transforms of everything in the scene to be read.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::gltf_exact;
use super::gltf_file::Source;
use super::notices::Notices;
use crate::error::{Error, Result};

/// A node of the scene with its transform to world space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    /// Its number in the file.
    pub(crate) node: usize,
    /// From its own space to the world's.
    pub(crate) world: DAffine3,
}

/// The nodes of the default scene (else the first, else all), parents before children, in the
/// order of the file. The node graph has been checked to be a forest; depth is not limited.
pub(crate) fn placed(source: &Source, notices: &mut Notices) -> Result<Vec<Placed>> {
    let root = source.root;
    let scene = root.scene.map_or(0, |s| s.value());
    let mut stack: Vec<Placed> = match root.scenes.get(scene) {
        Some(scene) => scene.nodes.iter().map(|n| at_origin(n.value())).collect(),
        None => {
            let mut is_root = vec![true; root.nodes.len()];
            for child in root.nodes.iter().flat_map(|n| n.children.iter().flatten()) {
                is_root[child.value()] = false;
            }
            (0..root.nodes.len()).filter(|&i| is_root[i]).map(at_origin).collect()
        }
    };
    if root.scenes.len() > 1 {
        let name = root.scenes.get(scene).and_then(|s| s.name.as_deref()).unwrap_or("");
        notices.add(
            "file",
            format!("of its {} scenes only scene {scene} \"{name}\" is read", root.scenes.len()),
        );
    }
    stack.reverse();
    let mut placed = Vec::new();
    while let Some(mut next) = stack.pop() {
        next.world *= local(source, next.node, notices)?;
        if !next.world.is_finite() {
            return Err(Error::invalid(
                source.path,
                source.node_name(next.node),
                "its transform, with those above it, is not finite; correct its scale",
            ));
        }
        let children = root.nodes[next.node].children.iter().flatten().rev();
        stack.extend(children.map(|c| Placed { node: c.value(), world: next.world }));
        placed.push(next);
    }
    Ok(placed)
}

fn at_origin(node: usize) -> Placed {
    Placed { node, world: DAffine3::IDENTITY }
}

/// The transform of a node to its parent.
fn local(source: &Source, node: usize, notices: &mut Notices) -> Result<DAffine3> {
    let wrong = |reason: &str| Error::invalid(source.path, source.node_name(node), reason);
    let Some(exact) = source.exact.nodes.get(node) else {
        return Ok(DAffine3::IDENTITY);
    };
    let gltf_exact::Node { matrix, translation, rotation, scale } = exact;
    if let Some(m) = matrix {
        if translation.is_some() || rotation.is_some() || scale.is_some() {
            return Err(wrong(
                "it has a matrix and also a translation, rotation or scale; remove one of them",
            ));
        }
        if !m.iter().all(|x| x.is_finite()) {
            return Err(wrong("its matrix is not finite; correct its numbers"));
        }
        if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
            return Err(wrong(
                "the last row of its matrix is not 0 0 0 1; only affine transforms are possible",
            ));
        }
        let columns = [[m[0], m[1], m[2]], [m[4], m[5], m[6]], [m[8], m[9], m[10]]];
        return Ok(DAffine3::from_mat3_translation(
            DMat3::from_cols_array_2d(&columns),
            DVec3::new(m[12], m[13], m[14]),
        ));
    }
    let translation = DVec3::from(translation.unwrap_or_default());
    let scale = DVec3::from(scale.unwrap_or([1.0; 3]));
    let rotation = DQuat::from_array(rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    let length = rotation.length();
    if !(length > 0.0 && length.is_finite()) {
        return Err(wrong("its rotation is no quaternion of length 1; correct its numbers"));
    }
    // Single precision leaves 1e-7; a hundred times more is somebody's mistake.
    if (length - 1.0).abs() > 1e-5 {
        notices.add(
            source.node_name(node),
            format!("its rotation quaternion has length {length:.6}; it is scaled to 1"),
        );
    }
    Ok(DAffine3::from_scale_rotation_translation(scale, rotation / length, translation))
}
