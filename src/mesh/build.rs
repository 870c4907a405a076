//! From a scene's triangles to faces, roots and elements.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::refine::{Refinement, child, edge_for_count, level_for};
use super::{Basis, Face, Mesh, Root};
use crate::error::{Error, Result};
use crate::geometry::{Bounds, Frame};
use crate::scene::Scene;

/// How the surface is cut and refined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshOptions {
    /// Polynomials on the elements.
    pub basis: Basis,
    /// Size of the elements.
    pub refinement: Refinement,
}

/// Most elements a mesh may have: their numbers are 32 bits wide, and so are their nodes'.
const MOST_ELEMENTS: f64 = 1.0e9;

/// Builds the mesh of a scene; elements come in the order of the scene's triangles, the back side
/// of a two-sided triangle after its front.
pub fn build(scene: &Scene, options: &MeshOptions) -> Result<Mesh> {
    let mut faces: Vec<Face> = vec![];
    for (index, triangle) in scene.triangles.iter().enumerate() {
        let two_sided = scene.materials[triangle.material as usize].two_sided;
        let [a, b, c] = triangle.vertices;
        for (back, corners) in [(false, [a, b, c]), (true, [a, c, b])] {
            if back && !two_sided {
                continue;
            }
            // The reader drops triangles without area.
            let Some(frame) = Frame::of_triangle(&corners) else { continue };
            let corners = corners.map(|x| frame.project(x));
            let roots = (faces.len() as u32, faces.len() as u32 + 1);
            faces.push(Face { triangle: index as u32, back, frame, corners, roots, surface: 0 });
        }
    }
    join_surfaces(scene, &mut faces);
    let mut roots: Vec<Root> = faces
        .iter()
        .enumerate()
        .map(|(i, f)| Root {
            face: i as u32,
            corners: f.corners,
            level: 0,
            first: 0,
            patch: f.surface,
        })
        .collect();
    choose_levels(&mut roots, options.refinement);
    let bounds =
        scene.triangles.iter().fold(Bounds::EMPTY, |b, t| b.union(Bounds::of(&t.vertices)));
    let magnitude = bounds.min.abs().max(bounds.max.abs()).max_element();
    let (element_root, element_corners) = elements(&mut roots)?;
    Ok(Mesh {
        basis: options.basis,
        faces,
        roots,
        element_root,
        element_corners,
        bounds,
        magnitude,
    })
}

fn longest_edge(t: &[DVec2; 3]) -> f64 {
    t[0].distance(t[1]).max(t[1].distance(t[2])).max(t[2].distance(t[0]))
}

fn choose_levels(roots: &mut [Root], refinement: Refinement) {
    let longest: Vec<f64> = roots.iter().map(|r| longest_edge(&r.corners)).collect();
    let max_edge = match refinement {
        Refinement::Levels(level) => {
            roots.iter_mut().for_each(|r| r.level = level);
            return;
        }
        Refinement::MaxEdge(edge) => edge,
        Refinement::Elements(target) => edge_for_count(&longest, target),
    };
    for (root, l) in roots.iter_mut().zip(longest) {
        root.level = level_for(l, max_edge);
    }
}

/// Numbers the elements and lists their corners.
fn elements(roots: &mut [Root]) -> Result<(Vec<u32>, Vec<[DVec2; 3]>)> {
    let count: f64 = roots.iter().map(|r| 4f64.powi(r.level as i32)).sum();
    if count > MOST_ELEMENTS {
        return Err(Error::Usage(format!(
            "the refinement asks for {count:.2e} elements, more than {MOST_ELEMENTS:.0e}: \
             choose a longer --max-edge or fewer --subdivide levels"
        )));
    }
    let (mut element_root, mut element_corners) = (vec![], Vec::with_capacity(count as usize));
    for (index, root) in roots.iter_mut().enumerate() {
        root.first = element_corners.len() as u32;
        let begin = element_corners.len();
        element_corners.push(root.corners);
        for _ in 0..root.level {
            let parents = element_corners.split_off(begin);
            element_corners.extend(parents.iter().flat_map(|t| (0..4).map(move |k| child(t, k))));
        }
        element_root.resize(element_corners.len(), index as u32);
    }
    Ok((element_root, element_corners))
}

/// Normals that differ by at most this (radians) belong to one smooth surface: flat surfaces whose
/// corners were rounded to f32 stay one; creases are never joined across.
const SMOOTH: f64 = 1e-5;

/// Numbers the smooth surfaces: faces joined by whole edges, with the same normal.
fn join_surfaces(scene: &Scene, faces: &mut [Face]) {
    let key = |x: DVec3| (x + 0.0).to_array().map(f64::to_bits);
    let corners = |face: &Face| {
        let [a, b, c] = scene.triangles[face.triangle as usize].vertices.map(key);
        if face.back { [a, c, b] } else { [a, b, c] }
    };
    let mut sides: HashMap<_, Vec<u32>> = HashMap::new();
    for (i, face) in faces.iter().enumerate() {
        let c = corners(face);
        for k in 0..3 {
            sides.entry((c[k], c[(k + 1) % 3])).or_default().push(i as u32);
        }
    }
    let mut owner: Vec<u32> = (0..faces.len() as u32).collect();
    for i in 0..faces.len() {
        let c = corners(&faces[i]);
        for k in 0..3 {
            for &j in sides.get(&(c[(k + 1) % 3], c[k])).into_iter().flatten() {
                if faces[i].frame.n.distance(faces[j as usize].frame.n) <= SMOOTH {
                    let (p, q) = (find(&mut owner, i as u32), find(&mut owner, j));
                    owner[p.max(q) as usize] = p.min(q);
                }
            }
        }
    }
    for i in 0..faces.len() {
        faces[i].surface = find(&mut owner, i as u32);
    }
}

/// Representative of `i` in a union-find forest, with path halving.
fn find(owner: &mut [u32], mut i: u32) -> u32 {
    while owner[i as usize] != i {
        owner[i as usize] = owner[owner[i as usize] as usize];
        i = owner[i as usize];
    }
    i
}
