//! From a scene's triangles to faces, roots and elements.

use glam::DVec2;

use super::pieces::Cut;
use super::refine::{DEEPEST, Refinement, child, edge_for_count, level_for};
use super::seams::{self, Joins};
use super::{Basis, Face, Mesh, Root, contacts};
use crate::error::{Error, Result};
use crate::geometry::{Bounds, Frame, contact_distance};
use crate::scene::Scene;

/// How the surface is cut and refined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshOptions {
    /// Polynomials on the elements.
    pub basis: Basis,
    /// Size of the elements.
    pub refinement: Refinement,
}

/// Most elements a mesh may have: about 4 GB with their clusters, and far more than any operator
/// can take. A request for more is a mistake in units or levels, and refused before it allocates.
const MOST_ELEMENTS: f64 = 5.0e7;

/// Light that comes into a gap of height g and length L, on a surface of area A, and that elements do not
/// hold, is an error of (5e-3 g L / A)^(1/2) of the mean (measured: a sheet over a floor). It is a third of
/// the tolerance at this height over its square and the size of the scene, if the gap is four times as
/// long as the scene and the surface that of a cube.
const STRIPS: f64 = 33.0;

/// Builds the mesh of a scene; elements come in the order of the scene's triangles, the back side
/// of a two-sided triangle after its front.
pub fn build(scene: &Scene, options: &MeshOptions) -> Result<Mesh> {
    build_with_strips(scene, options, f64::INFINITY)
}

/// The same for light to a tolerance, relative to its mean: gaps between faces that can matter for it get
/// elements of their own (see `outlines.rs`).
pub fn build_to_tolerance(scene: &Scene, options: &MeshOptions, tolerance: f64) -> Result<Mesh> {
    build_with_strips(scene, options, STRIPS * tolerance * tolerance * scene.extent())
}

fn build_with_strips(scene: &Scene, options: &MeshOptions, least_gap: f64) -> Result<Mesh> {
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
    let joins = Joins::find(scene, &mut faces);
    let mut front = vec![None; scene.triangles.len()];
    for (i, face) in faces.iter().enumerate().filter(|(_, f)| !f.back) {
        front[face.triangle as usize] = Some(i as u32);
    }
    let (cuts, contacts) = contacts::find(scene, &faces, &front, &joins, least_gap);
    let mut roots = vec![];
    for i in 0..faces.len() {
        let triangle = faces[i].triangle as usize;
        let its_front = front[triangle].map_or(i, |f| f as usize);
        let corners = root_corners(&faces[i], &faces[its_front].frame, cuts[triangle].as_ref());
        let begin = roots.len() as u32;
        faces[i].roots = (begin, begin + corners.len() as u32);
        let root = |corners| Root { face: i as u32, corners, level: 0, first: 0, patch: 0 };
        roots.extend(corners.into_iter().map(root));
    }
    let seams = seams::find(&faces, &mut roots, &cuts, &joins);
    choose_levels(&mut roots, options.refinement);
    let bounds =
        scene.triangles.iter().fold(Bounds::EMPTY, |b, t| b.union(Bounds::of(&t.vertices)));
    let (element_root, element_corners) = elements(&mut roots)?;
    Ok(Mesh {
        basis: options.basis,
        faces,
        roots,
        seams,
        contacts,
        element_root,
        element_corners,
        bounds,
        magnitude: bounds.magnitude(),
        contact: contact_distance(bounds, scene.rounding),
    })
}

impl Mesh {
    /// The same surface, refined otherwise.
    pub fn refined_to(&self, refinement: Refinement) -> Result<Mesh> {
        let mut roots = self.roots.clone();
        choose_levels(&mut roots, refinement);
        let (element_root, element_corners) = elements(&mut roots)?;
        Ok(Mesh { roots, element_root, element_corners, ..self.clone() })
    }

    /// The same surface, each root refined as often as its entry in `levels` says.
    pub fn with_levels(&self, levels: &[u32]) -> Result<Mesh> {
        let mut roots = self.roots.clone();
        roots.iter_mut().zip(levels).for_each(|(r, &level)| r.level = level.min(DEEPEST));
        let (element_root, element_corners) = elements(&mut roots)?;
        Ok(Mesh { roots, element_root, element_corners, ..self.clone() })
    }

    /// The same surface, each root refined `levels` times less (or not at all).
    pub fn coarsened(&self, levels: u32) -> Result<Mesh> {
        let mut roots = self.roots.clone();
        roots.iter_mut().for_each(|r| r.level = r.level.saturating_sub(levels));
        let (element_root, element_corners) = elements(&mut roots)?;
        Ok(Mesh { roots, element_root, element_corners, ..self.clone() })
    }
}

/// Corners of the roots of a face whose triangle was cut as `cut` says, in coordinates of the
/// triangle's front, a plane with frame `front`.
fn root_corners(face: &Face, front: &Frame, cut: Option<&Cut>) -> Vec<[DVec2; 3]> {
    let Some(cut) = cut else { return vec![face.corners] };
    let corner = |i: u32| match (i, face.back) {
        (0..3, false) => face.corners[i as usize],
        (0..3, true) => face.corners[(3 - i as usize) % 3],
        (_, false) => cut.points[i as usize],
        (_, true) => face.frame.project(front.lift(cut.points[i as usize])),
    };
    let order = |p: &[u32; 3]| if face.back { [p[0], p[2], p[1]] } else { *p };
    cut.pieces.iter().map(|p| order(p).map(corner)).collect()
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
