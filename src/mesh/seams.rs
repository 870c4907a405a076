//! What continues what: flat surfaces of faces, and the seams between their roots.
//!
//! Faces that share a whole edge and have the same normal are *joined*; joined faces make up one
//! *surface*. Roots of one surface that share an edge, or a part of one, have a *seam* there unless
//! a contact runs along it. Values may be averaged across seams and nowhere else: irradiance is
//! continuous over flat surfaces, but for contacts. Roots connected by seams are one *patch*; two
//! sides of a contact that ends inside a surface are the same patch, with no seam between them.

use std::collections::HashMap;

use glam::DVec3;

use super::pieces::Cut;
use super::{Face, Root};
use crate::scene::Scene;

/// Normals that differ by at most this (radians) belong to one smooth surface: flat surfaces whose
/// corners were rounded to f32 stay one; creases are never joined across.
const SMOOTH: f64 = 1e-5;

/// Edges overlap when they do by more than this share of the face's edge: roundings do not.
const OVERLAP: f64 = 1e-9;

/// A root and one of its edges: edge k runs from corner k to corner k + 1 (mod 3).
pub type Side = (u32, u8);

/// Two edges of roots that lie on one line and overlap, across which values may be averaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seam {
    /// The two edges; they run in opposite directions.
    pub sides: [Side; 2],
}

/// Faces and their edges that continue each other.
pub(super) struct Joins {
    /// Pairs of a face and its edge.
    pairs: Vec<[Side; 2]>,
    continued: Vec<[bool; 3]>,
    surface: Vec<u32>,
    /// The other side of each face, when it has one.
    back: Vec<u32>,
}

impl Joins {
    /// Finds the joined faces and numbers their surfaces ([`Face::surface`]).
    pub fn find(scene: &Scene, faces: &mut [Face]) -> Joins {
        let key = |x: DVec3| (x + 0.0).to_array().map(f64::to_bits);
        let corners = |face: &Face| {
            let [a, b, c] = scene.triangles[face.triangle as usize].vertices.map(key);
            if face.back { [a, c, b] } else { [a, b, c] }
        };
        let mut sides: HashMap<_, Vec<Side>> = HashMap::new();
        for (i, face) in faces.iter().enumerate() {
            let c = corners(face);
            for k in 0..3 {
                sides.entry((c[k], c[(k + 1) % 3])).or_default().push((i as u32, k as u8));
            }
        }
        let mut owner: Vec<u32> = (0..faces.len() as u32).collect();
        let (mut pairs, mut continued) = (vec![], vec![[false; 3]; faces.len()]);
        for i in 0..faces.len() {
            let c = corners(&faces[i]);
            for k in 0..3 {
                for &(j, m) in sides.get(&(c[(k + 1) % 3], c[k])).into_iter().flatten() {
                    if faces[i].frame.n.distance(faces[j as usize].frame.n) > SMOOTH {
                        continue;
                    }
                    continued[i][k] = true;
                    if (i as u32) < j {
                        pairs.push([(i as u32, k as u8), (j, m)]);
                        unite(&mut owner, i as u32, j);
                    }
                }
            }
        }
        for (i, face) in faces.iter_mut().enumerate() {
            face.surface = root_of(&mut owner, i as u32);
        }
        let surface: Vec<u32> = faces.iter().map(|f| f.surface).collect();
        let mut back: Vec<u32> = (0..faces.len() as u32).collect();
        for i in 1..faces.len() {
            if faces[i].triangle == faces[i - 1].triangle {
                (back[i], back[i - 1]) = (i as u32 - 1, i as u32);
            }
        }
        Joins { pairs, continued, surface, back }
    }

    /// Whether a flat neighbour continues `face` over its edge `k`.
    pub fn continued(&self, face: u32, k: usize) -> bool {
        self.continued[face as usize][k]
    }

    /// Whether a face has another side that radiates.
    pub fn two_sided(&self, face: u32) -> bool {
        self.back[face as usize] != face
    }

    /// Whether two faces, or one and the other side of the other, are of one surface.
    pub fn same_surface(&self, face: u32, other: u32) -> bool {
        let surface = |f: u32| self.surface[f as usize];
        let behind = self.back[other as usize];
        surface(face) == surface(other) || surface(face) == surface(behind)
    }
}

/// Part of a face's edge that a root has: from and to, in shares of the edge.
struct Part {
    begin: f64,
    end: f64,
    side: Side,
}

/// Finds the seams and numbers the patches ([`Root::patch`]). `cuts[t]` is how triangle t was cut,
/// if it was.
pub(super) fn find(
    faces: &[Face],
    roots: &mut [Root],
    cuts: &[Option<Cut>],
    joins: &Joins,
) -> Vec<Seam> {
    let mut seams = vec![];
    let mut parts: Vec<[Vec<Part>; 3]> = Vec::with_capacity(faces.len());
    for face in faces {
        let first = face.roots.0;
        parts.push(match &cuts[face.triangle as usize] {
            None => [0, 1, 2].map(|k| vec![Part { begin: 0.0, end: 1.0, side: (first, k) }]),
            Some(cut) => {
                let edges = open_edges(cut, face.back, first);
                for (&(a, b), &side) in edges.iter().filter(|((a, b), _)| a < b) {
                    if let Some(&other) = edges.get(&(b, a)) {
                        seams.push(Seam { sides: [side, other] });
                    }
                }
                [0, 1, 2].map(|k| boundary_parts(cut, face.back, k, &edges))
            }
        });
    }
    for &[(f, k), (g, m)] in &joins.pairs {
        for p in &parts[f as usize][k as usize] {
            for q in &parts[g as usize][m as usize] {
                // The same edge, run through the other way.
                let overlap = p.end.min(1.0 - q.begin) - p.begin.max(1.0 - q.end);
                if overlap > OVERLAP {
                    seams.push(Seam { sides: [p.side, q.side] });
                }
            }
        }
    }
    seams.sort_unstable_by_key(|s| s.sides);
    let mut owner: Vec<u32> = (0..roots.len() as u32).collect();
    for seam in &seams {
        unite(&mut owner, seam.sides[0].0, seam.sides[1].0);
    }
    for (i, root) in roots.iter_mut().enumerate() {
        root.patch = root_of(&mut owner, i as u32);
    }
    seams
}

/// Edges of the roots of a cut face by their points, in the direction in which the root has them;
/// those on contacts left out.
fn open_edges(cut: &Cut, back: bool, first: u32) -> HashMap<(u32, u32), Side> {
    let mut edges = HashMap::new();
    for (i, piece) in cut.pieces.iter().enumerate() {
        let ids = if back { [piece[0], piece[2], piece[1]] } else { *piece };
        for k in 0..3 {
            let (a, b) = (ids[k], ids[(k + 1) % 3]);
            if !cut.contacts.contains(&(a.min(b), a.max(b))) {
                edges.insert((a, b), (first + i as u32, k as u8));
            }
        }
    }
    edges
}

/// What roots have of edge `k` of a face.
fn boundary_parts(cut: &Cut, back: bool, k: usize, edges: &HashMap<(u32, u32), Side>) -> Vec<Part> {
    // The back's corners are the front's 0, 2, 1.
    let mut chain = cut.chains[if back { 2 - k } else { k }].clone();
    if back {
        chain.reverse();
    }
    let place = |i: usize| cut.points[chain[i] as usize];
    let (from, last) = (place(0), chain.len() - 1);
    let length = from.distance(place(last));
    let share = |i: usize| if i == last { 1.0 } else { place(i).distance(from) / length };
    let part = |i: usize| {
        let side = *edges.get(&(chain[i], chain[i + 1]))?;
        Some(Part { begin: share(i), end: share(i + 1), side })
    };
    (0..last).filter_map(part).collect()
}

/// Joins the sets of `i` and `j` in a union-find forest; the lower number represents both.
fn unite(owner: &mut [u32], i: u32, j: u32) {
    let (p, q) = (root_of(owner, i), root_of(owner, j));
    owner[p.max(q) as usize] = p.min(q);
}

/// Representative of `i` in a union-find forest, with path halving.
fn root_of(owner: &mut [u32], mut i: u32) -> u32 {
    while owner[i as usize] != i {
        owner[i as usize] = owner[owner[i as usize] as usize];
        i = owner[i as usize];
    }
    i
}
