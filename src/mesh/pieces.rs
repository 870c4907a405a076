//! A triangle cut into triangles along given edges: constrained Delaunay triangulation.

use std::collections::BTreeSet;

use glam::DVec2;
use spade::{
    AngleLimit, ConstrainedDelaunayTriangulation, Point2, RefinementParameters, Triangulation,
};

use super::arrangement::{Arrangement, MOST_POINTS};

/// A triangle's parts, in coordinates of its front.
pub(super) struct Cut {
    /// The corners of the triangle, then the points that were added.
    pub points: Vec<DVec2>,
    /// The parts: corners by number, counter-clockwise; in order. One part is the whole triangle.
    pub pieces: Vec<[u32; 3]>,
    /// Edges of pieces that lie on a contact, the lower point first.
    pub contacts: BTreeSet<(u32, u32)>,
    /// The points on each edge of the triangle, from its first corner to its second.
    pub chains: [Vec<u32>; 3],
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

/// Least angle that pieces of a large triangle should have, degrees. Delaunay refinement is sure to
/// end up to 20.7 (Ruppert 1995); angles between contacts that are smaller stay.
const LEAST_ANGLE: f64 = 20.0;

/// Pieces of less than this share of the square of the longest edge keep their angles: they end up
/// smaller than the elements around them, and what is seen of them is not worth more pieces.
const SMALL: f64 = 5e-4;

/// A triangle being cut.
struct Cutting<'a> {
    arrangement: &'a Arrangement,
    size: f64,
    cdt: ConstrainedDelaunayTriangulation<Point2<f64>>,
}

/// Cuts the triangle of an arrangement along its edges; `None` when that cannot be done.
///
/// Where `shapely`, points are added for pieces without small angles (Ruppert's refinement), unless
/// that takes too many. The neighbours of the triangle do not know of those on its boundary.
pub(super) fn cut_along(a: &Arrangement, tolerance: f64, shapely: bool) -> Option<Cut> {
    let chains = [0, 1, 2].map(|k| chain(&a.points, k, tolerance));
    let size = chains.iter().map(|c| length(&a.points, c)).fold(0.0, f64::max);
    let mut cutting = Cutting { arrangement: a, size, cdt: Default::default() };
    cutting.triangulate(&chains)?;
    if shapely {
        let plain = cutting.cdt.clone();
        let parameters = RefinementParameters::new()
            .with_angle_limit(AngleLimit::from_deg(LEAST_ANGLE))
            .with_min_required_area(SMALL)
            .with_max_additional_vertices(MOST_POINTS.saturating_sub(a.points.len()));
        if cutting.cdt.refine(parameters).refinement_complete
            && let Some(cut) = cutting.pieces(&chains, tolerance)
        {
            return Some(cut);
        }
        cutting.cdt = plain;
    }
    cutting.pieces(&chains, tolerance)
}

impl Cutting<'_> {
    /// Puts in the points, then the boundary and the contacts.
    fn triangulate(&mut self, chains: &[Vec<u32>; 3]) -> Option<()> {
        let mut handles = vec![];
        for (i, x) in self.arrangement.points.iter().enumerate() {
            let x = *x / self.size + ORIGIN;
            let handle = self.cdt.insert(Point2::new(x.x, x.y)).ok()?;
            if handle.index() != i {
                return None;
            }
            handles.push(handle);
        }
        let boundary = chains.iter().flat_map(|c| c.windows(2).map(|w| (w[0], w[1])));
        for (a, b) in boundary.chain(self.arrangement.edges.iter().copied()) {
            if self.cdt.try_add_constraint(handles[a as usize], handles[b as usize]).is_empty() {
                return None;
            }
        }
        Some(())
    }

    /// Reads off the pieces; `None` when they do not make up the triangle.
    fn pieces(&self, old_chains: &[Vec<u32>; 3], tolerance: f64) -> Option<Cut> {
        let mut points = self.arrangement.points.clone();
        for vertex in self.cdt.vertices().skip(points.len()) {
            let p = vertex.position();
            points.push((DVec2::new(p.x, p.y) - ORIGIN) * self.size);
        }
        let chains = [0, 1, 2].map(|k| chain(&points, k, tolerance));
        let mut boundary = BTreeSet::new();
        let mut contacts = BTreeSet::new();
        let old: BTreeSet<_> = self.arrangement.edges.iter().copied().collect();
        for (chain, old_chain) in chains.iter().zip(old_chains) {
            // What was added to the boundary comes between what was there.
            let mut from = 0;
            for w in chain.windows(2) {
                boundary.insert(sorted(w[0], w[1]));
                if old_chain.get(from + 1) == Some(&w[0]) {
                    from += 1;
                }
                let part = old_chain.get(from).zip(old_chain.get(from + 1));
                if part.is_some_and(|(&a, &b)| old.contains(&sorted(a, b))) {
                    contacts.insert(sorted(w[0], w[1]));
                }
            }
        }
        for edge in self.cdt.undirected_edges().filter(|e| e.is_constraint_edge()) {
            let [a, b] = edge.vertices().map(|v| v.fix().index() as u32);
            if !boundary.contains(&sorted(a, b)) {
                contacts.insert(sorted(a, b));
            }
        }
        let mut pieces: Vec<[u32; 3]> = vec![];
        let mut area = 0.0;
        for face in self.cdt.inner_faces() {
            let ids = face.vertices().map(|v| v.fix().index() as u32);
            let [a, b, c] = ids.map(|i| points[i as usize]);
            let twice = (b - a).perp_dot(c - a);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            if twice > FLAT * self.size * longest {
                let first = (0..3).min_by_key(|&k| ids[k]).unwrap_or(0);
                pieces.push([0, 1, 2].map(|k| ids[(first + k) % 3]));
                area += twice;
            }
        }
        pieces.sort_unstable();
        let whole = (points[1] - points[0]).perp_dot(points[2] - points[0]);
        let complete = (area - whole).abs() <= AREA * whole;
        (complete && pieces.len() <= MOST_POINTS).then(|| Cut { points, pieces, contacts, chains })
    }
}

fn sorted(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// Distance between the ends of a chain.
fn length(points: &[DVec2], chain: &[u32]) -> f64 {
    match (chain.first(), chain.last()) {
        (Some(&a), Some(&b)) => points[a as usize].distance(points[b as usize]),
        _ => 0.0,
    }
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
