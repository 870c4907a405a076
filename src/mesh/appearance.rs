//! Reflectance and exitance at the collocation nodes.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{Basis, Mesh, barycentric, child};
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
            let footprint = part.map(|x| face_weights(mesh, element, x));
            let triangle = face.triangle as usize;
            (
                scene::reflectance(scene, triangle, &footprint),
                scene::exitance(scene, triangle, &footprint),
            )
        })
        .unzip()
}

/// Barycentric weights of a plane point of an element's face in its input triangle.
pub fn face_weights(mesh: &Mesh, element: usize, x: DVec2) -> DVec3 {
    let face = mesh.face_of(element);
    let w = barycentric(&face.corners, x);
    // The back side has the triangle's corners in the order 1, 3, 2.
    if face.back { DVec3::new(w.x, w.z, w.y) } else { w }
}
