//! A triangle cut into triangles along given edges: constrained Delaunay triangulation.

use std::collections::BTreeSet;

use glam::DVec2;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

use super::arrangement::Arrangement;

/// A triangle's parts, in coordinates of its front.
#[derive(Clone)]
pub(super) struct Cut {
    /// The corners of the triangle, then the points that were added.
    pub points: Vec<DVec2>,
    /// The parts: corners by number, counter-clockwise; in order. One part is the whole triangle.
    pub pieces: Vec<[u32; 3]>,
    /// Edges of pieces that lie on a contact, the lower point first.
    pub contacts: BTreeSet<(u32, u32)>,
    /// The points on each edge of the triangle, from its first corner to its second.
    pub chains: [Vec<u32>; 3],
    /// Longest edge of the triangle.
    pub size: f64,
}

/// Pieces less high than this, in units of the triangle's longest edge, have no area.
///
/// Points meant to be on one line, the boundary of the triangle, are off it by a few roundings
/// (1e-16); Delaunay triangulation fills that gap with a piece. True pieces are higher than the
/// contact tolerance, at least 1e-7 of the scene, by a wide margin.
const FLAT: f64 = 1e-14;

/// The pieces must make up the triangle, relative to its area.
const AREA: f64 = 1e-12;

/// Where the coordinates begin that `spade` gets, in units of the triangle's longest edge: they are
/// between 1 and 3, far from the tiny ones that it refuses.
const ORIGIN: f64 = 2.0;

/// Cuts the triangle of an arrangement along its edges; `None` when that cannot be done.
pub(super) fn cut_along(arrangement: Arrangement, tolerance: f64) -> Option<Cut> {
    let Arrangement { points, edges } = arrangement;
    let mut cut = Cut {
        chains: [0, 1, 2].map(|k| chain(&points, k, tolerance)),
        size: (0..3).map(|k| points[k].distance(points[(k + 1) % 3])).fold(0.0, f64::max),
        points,
        pieces: vec![],
        contacts: edges.into_iter().collect(),
    };
    cut.triangulate()?;
    Some(cut)
}

impl Cut {
    /// Edges that pieces must not cross, the lower point first: contacts and the boundary.
    pub fn segments(&self) -> BTreeSet<(u32, u32)> {
        let boundary = self.chains.iter().flat_map(|c| c.windows(2).map(|w| sorted(w[0], w[1])));
        boundary.chain(self.contacts.iter().copied()).collect()
    }

    /// Finds the pieces anew; `None` when they do not make up the triangle.
    pub fn triangulate(&mut self) -> Option<()> {
        let mut cdt = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
        let mut handles = vec![];
        for (i, x) in self.points.iter().enumerate() {
            let x = *x / self.size + ORIGIN;
            let handle = cdt.insert(Point2::new(x.x, x.y)).ok()?;
            if handle.index() != i {
                return None;
            }
            handles.push(handle);
        }
        for (a, b) in self.segments() {
            // None: it crosses another one; several: a point lies on it. Neither is an arrangement.
            if cdt.try_add_constraint(handles[a as usize], handles[b as usize]).len() != 1 {
                return None;
            }
        }
        self.pieces.clear();
        let mut area = 0.0;
        for face in cdt.inner_faces() {
            let ids = face.vertices().map(|v| v.fix().index() as u32);
            let [a, b, c] = ids.map(|i| self.points[i as usize]);
            let twice = (b - a).perp_dot(c - a);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            if twice > FLAT * self.size * longest {
                let first = (0..3).min_by_key(|&k| ids[k]).unwrap_or(0);
                self.pieces.push([0, 1, 2].map(|k| ids[(first + k) % 3]));
                area += twice;
            }
        }
        self.pieces.sort_unstable();
        let whole = (self.points[1] - self.points[0]).perp_dot(self.points[2] - self.points[0]);
        ((area - whole).abs() <= AREA * whole).then_some(())
    }

    /// Adds a point to the middle of a segment.
    pub fn split(&mut self, (a, b): (u32, u32)) {
        let middle = self.points.len() as u32;
        self.points.push(0.5 * (self.points[a as usize] + self.points[b as usize]));
        if self.contacts.remove(&(a, b)) {
            self.contacts.extend([(a, middle), (b, middle)]);
        }
        for chain in &mut self.chains {
            if let Some(i) = chain.windows(2).position(|w| sorted(w[0], w[1]) == (a, b)) {
                chain.insert(i + 1, middle);
            }
        }
    }
}

/// The two numbers of an edge, the lower first.
pub(super) fn sorted(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// The points on edge `k`, in order. Points near the boundary were moved onto it: those that are
/// not on it are the tolerance away, or nearly so in a sharp corner.
fn chain(points: &[DVec2], k: usize, tolerance: f64) -> Vec<u32> {
    let (i, j) = (k as u32, (k as u32 + 1) % 3);
    let (a, b) = (points[i as usize], points[j as usize]);
    let along = (b - a).normalize();
    let mut on: Vec<(f64, u32)> = vec![];
    for (m, x) in points.iter().enumerate().skip(3) {
        if (*x - a).perp_dot(along).abs() <= 1e-3 * tolerance {
            on.push(((*x - a).dot(along), m as u32));
        }
    }
    on.sort_by(|x, y| x.0.total_cmp(&y.0));
    [i].into_iter().chain(on.into_iter().map(|(_, m)| m)).chain([j]).collect()
}
