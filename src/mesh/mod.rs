//! Elements: triangles of the refined surface, each radiating on one side.
//!
//! Every input triangle has one [`Face`] a radiating side. A face is covered by [`Root`]s (itself,
//! or the parts into which contacts with other faces cut it), each refined uniformly: edge
//! midpoints are joined, four congruent children (AC section 2). The elements of a root are its
//! finest triangles in the order of its quadtree, so each subtree is a range of elements.

mod appearance;
mod arrangement;
mod build;
mod clip;
mod contacts;
mod outlines;
mod pieces;
mod refine;
mod seams;
mod shape;

use glam::{DVec2, DVec3};

use crate::geometry::{Bounds, Frame, triangle_area};

pub use crate::geometry::CONTACT;
pub use appearance::appearance;
pub use build::{MeshOptions, build, build_to_tolerance};
pub use contacts::Contacts;
pub use refine::{DEEPEST, Refinement, child, level_for};
pub use seams::{Seam, Side};

/// Position of the interior nodes of linear elements, AC (2.5); 0 < alpha < 1/3.
pub const ALPHA: f64 = 1.0 / 6.0;

/// Polynomials on an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// One value an element, collocated at the centroid.
    Constant,
    /// Three values an element, collocated at the interior nodes of AC (2.5).
    Linear,
}

impl Basis {
    /// Values (and collocation nodes) an element: nu in AC section 2.2.
    pub fn nodes(self) -> usize {
        match self {
            Basis::Constant => 1,
            Basis::Linear => 3,
        }
    }

    /// Barycentric weights (of v1, v2, v3) of node `k`.
    ///
    /// With m(s, t) = u v3 + t v2 + s v1, the nodes q1 = (alpha, alpha), q2 = (alpha, 1 - 2 alpha)
    /// and q3 = (1 - 2 alpha, alpha) lie near v3, v2 and v1.
    pub fn node(self, k: usize) -> DVec3 {
        const NEAR: f64 = 1.0 - 2.0 * ALPHA;
        match (self, k) {
            (Basis::Constant, _) => DVec3::splat(1.0 / 3.0),
            (Basis::Linear, 0) => DVec3::new(ALPHA, ALPHA, NEAR),
            (Basis::Linear, 1) => DVec3::new(ALPHA, NEAR, ALPHA),
            (Basis::Linear, _) => DVec3::new(NEAR, ALPHA, ALPHA),
        }
    }

    /// Values of the basis functions at barycentric weights (s, t, u) of (v1, v2, v3); the first
    /// [`Basis::nodes`] entries count.
    pub fn values(self, weights: DVec3) -> [f64; 3] {
        match self {
            Basis::Constant => [1.0, 0.0, 0.0],
            Basis::Linear => {
                let l = |w: f64| (w - ALPHA) / (1.0 - 3.0 * ALPHA);
                [l(weights.z), l(weights.y), l(weights.x)]
            }
        }
    }
}

/// A radiating side of an input triangle.
#[derive(Clone, Debug)]
pub struct Face {
    /// Index of the input triangle.
    pub triangle: u32,
    /// Whether this is the side against the triangle's winding.
    pub back: bool,
    /// Its plane; the normal points to the side that radiates.
    pub frame: Frame,
    /// Corners in the plane, counter-clockwise about the normal.
    pub corners: [DVec2; 3],
    /// Its roots: `roots.0..roots.1`.
    pub roots: (u32, u32),
    /// Index of its smooth surface: coplanar faces joined by edges, contacts or not.
    pub surface: u32,
}

impl Face {
    /// Barycentric weights of the plane point `x` in the face's input triangle, whose corners the
    /// back side has in the order 1, 3, 2.
    pub fn triangle_weights(&self, x: DVec2) -> DVec3 {
        let w = barycentric(&self.corners, x);
        if self.back { DVec3::new(w.x, w.z, w.y) } else { w }
    }
}

/// A part of a face that is refined uniformly.
#[derive(Clone, Debug)]
pub struct Root {
    /// Index of its face.
    pub face: u32,
    /// Corners in the face's plane, counter-clockwise.
    pub corners: [DVec2; 3],
    /// How often it is refined: 4^level elements.
    pub level: u32,
    /// Its first element.
    pub first: u32,
    /// Smooth patch that it belongs to: roots connected by [`Mesh::seams`].
    pub patch: u32,
}

/// The refined surface of a scene.
#[derive(Clone)]
pub struct Mesh {
    /// Polynomials on the elements.
    pub basis: Basis,
    /// Radiating sides of the input triangles.
    pub faces: Vec<Face>,
    /// Parts of faces.
    pub roots: Vec<Root>,
    /// Where values may be averaged across the edges of roots, in order.
    pub seams: Vec<Seam>,
    /// What was cut where faces touch.
    pub contacts: Contacts,
    /// Root of each element.
    pub element_root: Vec<u32>,
    /// Corners of each element in its face's plane.
    pub element_corners: Vec<[DVec2; 3]>,
    /// Box of all faces.
    pub bounds: Bounds,
    /// Largest coordinate in size; what roundings are relative to. Metres.
    pub magnitude: f64,
    /// Distance within which faces touch, metres.
    pub contact: f64,
}

impl Mesh {
    /// Number of elements n.
    pub fn elements(&self) -> usize {
        self.element_corners.len()
    }

    /// Number of collocation nodes d_n.
    pub fn nodes(&self) -> usize {
        self.elements() * self.basis.nodes()
    }

    /// The face of an element.
    pub fn face_of(&self, element: usize) -> &Face {
        &self.faces[self.roots[self.element_root[element] as usize].face as usize]
    }

    /// Position (metres) and unit normal of collocation node `node`.
    pub fn node(&self, node: usize) -> (DVec3, DVec3) {
        let (element, k) = (node / self.basis.nodes(), node % self.basis.nodes());
        let [v1, v2, v3] = self.element_corners[element];
        let w = self.basis.node(k);
        let frame = &self.face_of(element).frame;
        (frame.lift(w.x * v1 + w.y * v2 + w.z * v3), frame.n)
    }

    /// Front and back face of each input triangle, where it radiates.
    pub fn sides(&self, triangles: usize) -> Vec<[Option<u32>; 2]> {
        let mut sides = vec![[None; 2]; triangles];
        for (i, face) in self.faces.iter().enumerate() {
            sides[face.triangle as usize][usize::from(face.back)] = Some(i as u32);
        }
        sides
    }

    /// The plane of a root.
    pub fn root_frame(&self, root: u32) -> &Frame {
        &self.faces[self.roots[root as usize].face as usize].frame
    }

    /// Area of an element, square metres.
    pub fn area(&self, element: usize) -> f64 {
        triangle_area(&self.element_corners[element])
    }

    /// Longest edge of all elements, metres.
    pub fn longest_edge(&self) -> f64 {
        let square = |t: &[DVec2; 3]| {
            t[0].distance_squared(t[1])
                .max(t[1].distance_squared(t[2]))
                .max(t[2].distance_squared(t[0]))
        };
        self.element_corners.iter().map(square).fold(0.0, f64::max).sqrt()
    }

    /// Barycentric weights of a point of an element's plane.
    pub fn weights(&self, element: usize, x: DVec2) -> DVec3 {
        barycentric(&self.element_corners[element], x)
    }

    /// The element of a root that contains (or is nearest to) the plane point `x`, by descent.
    pub fn locate_in(&self, root: usize, x: DVec2) -> usize {
        let root = &self.roots[root];
        let (mut corners, mut index) = (root.corners, 0usize);
        for _ in 0..root.level {
            let w = barycentric(&corners, x);
            let k = if w.x >= 0.5 {
                0
            } else if w.y >= 0.5 {
                1
            } else if w.z >= 0.5 {
                2
            } else {
                3
            };
            corners = child(&corners, k);
            index = 4 * index + k;
        }
        root.first as usize + index
    }

    /// The root of a face that contains (or is nearest to) the plane point `x`.
    pub fn root_at(&self, face: usize, x: DVec2) -> usize {
        let (begin, end) = self.faces[face].roots;
        let inside = |r: u32| barycentric(&self.roots[r as usize].corners, x).min_element();
        let root = (begin..end).max_by(|&a, &b| inside(a).total_cmp(&inside(b)));
        root.unwrap_or(begin) as usize
    }

    /// The element of a face that contains (or is nearest to) the plane point `x`.
    pub fn locate(&self, face: usize, x: DVec2) -> usize {
        self.locate_in(self.root_at(face, x), x)
    }
}

/// Barycentric weights of `x` in a triangle of the same plane.
pub fn barycentric(t: &[DVec2; 3], x: DVec2) -> DVec3 {
    let twice = (t[1] - t[0]).perp_dot(t[2] - t[0]);
    let w2 = (x - t[0]).perp_dot(t[2] - t[0]) / twice;
    let w3 = (t[1] - t[0]).perp_dot(x - t[0]) / twice;
    DVec3::new(1.0 - w2 - w3, w2, w3)
}
