//! Reflectance and exitance at the collocation nodes.

use glam::DVec3;
use rayon::prelude::*;

use super::{Basis, Mesh, child};
use crate::scene::{self, Scene};

/// Reflectance rho and exitance E (W/m^2) at each collocation node, per channel.
///
/// What varies over the surface (textures, vertex colours) is averaged over the part of the element
/// that the node stands for: the child triangle whose centroid it is (for alpha = 1/6), or the
/// whole element in the constant basis.
pub fn appearance(scene: &Scene, mesh: &Mesh) -> (Vec<DVec3>, Vec<DVec3>) {
    (0..mesh.nodes())
        .into_par_iter()
        .map(|node| {
            let (element, k) = (node / mesh.basis.nodes(), node % mesh.basis.nodes());
            let corners = &mesh.element_corners[element];
            let part = match mesh.basis {
                Basis::Constant => *corners,
                // Node 0 lies near v3, node 2 near v1.
                Basis::Linear => child(corners, 2 - k),
            };
            let face = mesh.face_of(element);
            let footprint = part.map(|x| face.triangle_weights(x));
            let triangle = face.triangle as usize;
            (
                scene::reflectance(scene, triangle, &footprint),
                scene::exitance(scene, triangle, &footprint),
            )
        })
        .unzip()
}
