//! A triangle cut into triangles along given edges: constrained Delaunay triangulation.

use std::collections::BTreeSet;

use glam::DVec2;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

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

/// Coordinates below this are zero, in units of the triangle's longest edge: `spade` refuses
/// numbers below 2^-142, and no difference of coordinates is as small.
const TINY: f64 = 1e-30;

/// Cuts the triangle of an arrangement along its edges; `None` when that cannot be done.
pub(super) fn cut_along(arrangement: &Arrangement, tolerance: f64) -> Option<Cut> {
    let points = &arrangement.points;
    let size = (0..3).map(|k| points[k].distance(points[(k + 1) % 3])).fold(0.0, f64::max);
    let chains = [0, 1, 2].map(|k| chain(points, k, tolerance));
    let mut cdt = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    let mut handles = vec![];
    let normal = |x: f64| if (x / size).abs() < TINY { 0.0 } else { x / size };
    for (i, x) in points.iter().enumerate() {
        let handle = cdt.insert(Point2::new(normal(x.x), normal(x.y))).ok()?;
        if handle.index() != i {
            return None;
        }
        handles.push(handle);
    }
    let boundary: BTreeSet<(u32, u32)> = chains
        .iter()
        .flat_map(|c| c.windows(2).map(|w| (w[0].min(w[1]), w[0].max(w[1]))))
        .collect();
    for &(a, b) in boundary.iter().chain(&arrangement.edges) {
        if cdt.try_add_constraint(handles[a as usize], handles[b as usize]).is_empty() {
            return None;
        }
    }

    let mut contacts: BTreeSet<(u32, u32)> =
        arrangement.edges.iter().copied().filter(|e| boundary.contains(e)).collect();
    for edge in cdt.undirected_edges().filter(|e| e.is_constraint_edge()) {
        let [a, b] = edge.vertices().map(|v| v.fix().index() as u32);
        let key = (a.min(b), a.max(b));
        if !boundary.contains(&key) {
            contacts.insert(key);
        }
    }
    let mut pieces: Vec<[u32; 3]> = vec![];
    let mut area = 0.0;
    for face in cdt.inner_faces() {
        let ids = face.vertices().map(|v| v.fix().index() as u32);
        let [a, b, c] = ids.map(|i| points[i as usize]);
        let twice = (b - a).perp_dot(c - a);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        if twice > FLAT * size * longest {
            let first = (0..3).min_by_key(|&k| ids[k]).unwrap_or(0);
            pieces.push([0, 1, 2].map(|k| ids[(first + k) % 3]));
            area += twice;
        }
    }
    pieces.sort_unstable();
    let whole = (points[1] - points[0]).perp_dot(points[2] - points[0]);
    let complete = (area - whole).abs() <= AREA * whole;
    (complete && pieces.len() <= MOST_POINTS).then(|| Cut {
        points: points.clone(),
        pieces,
        contacts,
        chains,
    })
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
