//! From node values to values anywhere on the surface.
//!
//! What is reconstructed is irradiance, which is smooth where reflectance is not: radiosity is
//! E + rho H with E and rho taken where it is needed.

mod surface;

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use crate::mesh::Mesh;

pub use surface::{Foot, Met, Surface};

/// Irradiance at the corners of the elements, continuous over each smooth patch.
pub struct VertexIrradiance {
    /// Vertex numbers of the corners of each element.
    corners: Vec<[u32; 3]>,
    /// Irradiance at each vertex, W/m^2 per channel.
    values: Vec<DVec3>,
}

/// Distance below which two corners of one patch are one vertex, relative to the longest element
/// edge. Corners of neighbours differ by roundings only (1e-16), true neighbours by far more.
const SAME: f64 = 1e-7;

impl VertexIrradiance {
    /// Extrapolates each element's polynomial to its corners, and averages over the elements of a
    /// patch that share the corner; never across a crease or a contact. Negative means (undershoot
    /// of the extrapolation at shadow edges) become zero.
    pub fn new(mesh: &Mesh, irradiance: &[DVec3]) -> VertexIrradiance {
        let nodes = mesh.basis.nodes();
        let cell = SAME * mesh.longest_edge().max(f64::MIN_POSITIVE);
        let mut vertices: HashMap<(u32, [i64; 3]), u32> = HashMap::new();
        let mut sums: Vec<(DVec3, f64)> = vec![];
        let mut corners = Vec::with_capacity(mesh.elements());
        for (element, t) in mesh.element_corners.iter().enumerate() {
            let root = &mesh.roots[mesh.element_root[element] as usize];
            let frame = &mesh.faces[root.face as usize].frame;
            let here = &irradiance[element * nodes..][..nodes];
            corners.push(std::array::from_fn(|k| {
                let vertex = vertex_at(&mut vertices, root.patch, frame.lift(t[k]) / cell, || {
                    sums.push((DVec3::ZERO, 0.0));
                    sums.len() as u32 - 1
                });
                let weights = mesh.basis.values(DVec3::AXES[k]);
                let value: DVec3 = here.iter().zip(weights).map(|(h, w)| *h * w).sum();
                let (sum, count) = &mut sums[vertex as usize];
                *sum += value;
                *count += 1.0;
                vertex
            }));
        }
        let values = sums.iter().map(|(sum, count)| (*sum / *count).max(DVec3::ZERO)).collect();
        VertexIrradiance { corners, values }
    }

    /// Irradiance at the plane point `x` of an element, linear between its corners.
    pub fn at(&self, mesh: &Mesh, element: usize, x: DVec2) -> DVec3 {
        let w = mesh.weights(element, x);
        let [a, b, c] = self.corners[element].map(|v| self.values[v as usize]);
        w.x * a + w.y * b + w.z * c
    }
}

/// Number of the vertex of `patch` at `place` (in cells), made by `new` when there is none yet.
///
/// A vertex is kept under its own cell; one that was rounded into a neighbouring cell is found by
/// looking there as well.
fn vertex_at(
    vertices: &mut HashMap<(u32, [i64; 3]), u32>,
    patch: u32,
    place: DVec3,
    new: impl FnOnce() -> u32,
) -> u32 {
    let base = place.floor();
    let side = |k: usize| if place[k] - base[k] < 0.5 { -1 } else { 1 };
    let cell = base.to_array().map(|x| x as i64);
    for mask in 0..8 {
        let near = std::array::from_fn(|k| cell[k] + if mask >> k & 1 == 1 { side(k) } else { 0 });
        if let Some(&vertex) = vertices.get(&(patch, near)) {
            return vertex;
        }
    }
    let vertex = new();
    vertices.insert((patch, cell), vertex);
    vertex
}
