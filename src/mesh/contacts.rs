//! Contacts: the lines along which a face is touched or crossed by other faces.
//!
//! Irradiance jumps across such a line (the floor beside a block and the floor below it), so no
//! element may lie on both sides: faces are cut there before they are refined. For an input
//! triangle T each near triangle B leaves on the plane of T
//!
//! - nothing, when B is on one side of the plane or touches it in a point only;
//! - one segment, when B crosses the plane or stands on it with an edge;
//! - its outline, when B lies in the plane: the edges over which no flat neighbour continues it.
//!
//! Heights over the plane of at most the contact tolerance count as zero. The segments are clipped
//! to T, snapped and cut at their crossings ([`super::arrangement`]), and T is triangulated with
//! them as constraints ([`super::pieces`]), large ones with more points for the sake of its shape
//! ([`super::shape`]).
//!
//! A segment along the boundary of T cuts nothing. Where a flat neighbour continues T there (the
//! diagonal of a quad under a wall), the segment severs the two, so that no values are averaged
//! across it.
//!
//! Cost: O((n + k) log n) for n triangles with k pairs of near ones, then for each cut triangle the
//! square of its few segments. Contacts wider than the tolerance (a block that floats a little) are
//! none: nothing is moved to close them.

use glam::DVec2;
use rayon::prelude::*;

use super::Face;
use super::arrangement::arrange;
use super::pieces::{Cut, cut_along};
use super::seams::Joins;
use super::shape::improve;
use crate::geometry::{Bounds, BoxTree, Frame, contact_distance};
use crate::scene::Scene;

/// Triangles less high than this many tolerances are not cut: their pieces would be slivers of
/// the size of roundings.
const THIN: f64 = 8.0;

/// Planes that meet at less than this angle (radians) count as parallel where an edge is judged
/// that a flat neighbour continues: ten times what still counts as flat ([`super::seams`]).
const PARALLEL: f64 = 1e-4;

/// Triangles longer than this share of the scene are cut into well-shaped pieces: they will be
/// refined and seen. Small ones become few elements whatever their shape.
const LARGE: f64 = 1.0 / 6.0;

/// Most segments of one triangle that are tried: far more than may be left once they are snapped.
const MOST_SEGMENTS: usize = 1000;

/// Where a triangle has too many contacts, those shorter than this share of it are left out: the
/// first share with which it can be cut. They are the feet of small and round things.
const LEAST_LENGTHS: [f64; 6] = [0.0, 1.0 / 256.0, 1.0 / 128.0, 1.0 / 64.0, 1.0 / 32.0, 1.0 / 16.0];

/// What the cutting did; the report shows it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Contacts {
    /// Input triangles that were cut into several roots.
    pub cut: usize,
    /// Segments that they were cut along, or severed from a neighbour.
    pub segments: usize,
    /// Triangles among them that too many others touch: cut along the longer contacts only.
    pub simplified: usize,
    /// Triangles left whole although others touch them: no triangulation was found.
    pub left_whole: usize,
}

/// Cuts of all triangles of a scene: `None` for those that nothing touches.
///
/// `faces` has the front of every triangle; `front[i]` is its number.
pub(super) fn find(
    scene: &Scene,
    faces: &[Face],
    front: &[Option<u32>],
    joins: &Joins,
) -> (Vec<Option<Cut>>, Contacts) {
    let boxes: Vec<Bounds> = scene.triangles.iter().map(|t| Bounds::of(&t.vertices)).collect();
    let tree = BoxTree::build(&boxes);
    let all = boxes.iter().fold(Bounds::EMPTY, |a, &b| a.union(b));
    let (tolerance, extent) = (contact_distance(all, scene.rounding), all.extent());
    let finder = Finder { scene, faces, front, joins, boxes, tree, tolerance, extent };
    let found: Vec<(Option<Cut>, Contacts)> =
        (0..scene.triangles.len()).into_par_iter().map(|i| finder.cut(i)).collect();
    let mut sum = Contacts::default();
    let cuts = found.into_iter().map(|(cut, c)| {
        sum.cut += c.cut;
        sum.segments += c.segments;
        sum.simplified += c.simplified;
        sum.left_whole += c.left_whole;
        cut
    });
    (cuts.collect(), sum)
}

struct Finder<'a> {
    scene: &'a Scene,
    faces: &'a [Face],
    front: &'a [Option<u32>],
    joins: &'a Joins,
    boxes: Vec<Bounds>,
    tree: BoxTree,
    tolerance: f64,
    extent: f64,
}

impl Finder<'_> {
    fn cut(&self, triangle: usize) -> (Option<Cut>, Contacts) {
        let mut counts = Contacts::default();
        let segments = self.segments(triangle);
        let Some(face) = self.front[triangle].filter(|_| !segments.is_empty()) else {
            return (None, counts);
        };
        let corners = &self.faces[face as usize].corners;
        let shapely = self.boxes[triangle].extent() > LARGE * self.extent;
        let cut = LEAST_LENGTHS.iter().find_map(|share| {
            let least = share * self.boxes[triangle].extent();
            let long = |s: &&[DVec2; 2]| s[0].distance(s[1]) >= least;
            let segments: Vec<[DVec2; 2]> = segments.iter().filter(long).copied().collect();
            if segments.is_empty() || segments.len() > MOST_SEGMENTS {
                return None;
            }
            let arrangement = arrange(corners, &segments, self.tolerance)?;
            let mut cut = cut_along(arrangement, self.tolerance)?;
            if shapely && cut.pieces.len() > 1 {
                improve(&mut cut);
            }
            counts.simplified = usize::from(*share > 0.0);
            Some(cut)
        });
        match &cut {
            Some(cut) => {
                counts.segments = cut.contacts.len();
                counts.cut = usize::from(cut.pieces.len() > 1);
            }
            None => counts.left_whole = 1,
        }
        (cut, counts)
    }

    /// What all near triangles leave on `triangle`, in coordinates of its front.
    fn segments(&self, triangle: usize) -> Vec<[DVec2; 2]> {
        let Some(front) = self.front[triangle] else { return vec![] };
        let face = &self.faces[front as usize];
        if height(&face.corners) < THIN * self.tolerance {
            return vec![];
        }
        let near = self.boxes[triangle].grown(self.tolerance);
        let mut others = vec![];
        self.tree.visit(|b| b.meets(near), |i| others.push(i));
        // The order in which a tree proposes depends on its shape.
        others.sort_unstable();
        let joined = [0, 1, 2].map(|k| self.joins.continued(front, k));
        let mut segments = vec![];
        for other in others {
            let Some(its) = self.front[other] else { continue };
            let same = self.joins.same_surface(front, its);
            if same || other == triangle || !self.boxes[other].meets(near) {
                continue;
            }
            self.marks(&face.frame, other, its, |p, q| {
                if let Some([p, q]) = clip(p, q, &face.corners, self.tolerance)
                    && !(0..3).any(|k| {
                        !joined[k]
                            && beside(&face.corners, k, p, self.tolerance)
                            && beside(&face.corners, k, q, self.tolerance)
                    })
                {
                    segments.push([p, q]);
                }
            });
        }
        segments
    }

    /// Calls `mark` with each segment that triangle `other`, whose front is face `its`, leaves on
    /// the plane of `frame`.
    fn marks(&self, frame: &Frame, other: usize, its: u32, mut mark: impl FnMut(DVec2, DVec2)) {
        let vertices = &self.scene.triangles[other].vertices;
        let heights = vertices.map(|x| {
            let h = frame.height(x);
            if h.abs() <= self.tolerance { 0.0 } else { h }
        });
        let place = vertices.map(|x| frame.project(x));
        let next = |k: usize| (k + 1) % 3;
        match heights.iter().filter(|&&h| h == 0.0).count() {
            3 => {
                for k in (0..3).filter(|&k| !self.joins.continued(its, k)) {
                    mark(place[k], place[next(k)]);
                }
            }
            2 => {
                let off = (0..3).find(|&k| heights[k] != 0.0).unwrap_or(0);
                let k = next(off);
                let n = self.faces[its as usize].frame.n;
                // A nearly parallel sheet whose diagonal alone comes within the tolerance.
                let crosses = frame.n.cross(n).length() > PARALLEL;
                if crosses || !self.joins.continued(its, k) {
                    mark(place[k], place[next(k)]);
                }
            }
            on => {
                let mut ends = vec![];
                for k in 0..3 {
                    let (a, b) = (heights[k], heights[next(k)]);
                    if on == 1 && a == 0.0 {
                        ends.push(place[k]);
                    }
                    if a * b < 0.0 {
                        ends.push(place[k] + (place[next(k)] - place[k]) * (a / (a - b)));
                    }
                }
                if let [p, q] = ends[..] {
                    mark(p, q);
                }
            }
        }
    }
}

/// Smallest height of a triangle.
fn height(t: &[DVec2; 3]) -> f64 {
    let longest = (0..3).map(|k| t[k].distance(t[(k + 1) % 3])).fold(0.0, f64::max);
    (t[1] - t[0]).perp_dot(t[2] - t[0]) / longest
}

/// Inward unit normal of edge `k` of a counter-clockwise triangle.
fn inward(t: &[DVec2; 3], k: usize) -> DVec2 {
    (t[(k + 1) % 3] - t[k]).perp().normalize()
}

/// Whether `x` lies on the line of edge `k`, within the tolerance.
fn beside(t: &[DVec2; 3], k: usize, x: DVec2, tolerance: f64) -> bool {
    (x - t[k]).dot(inward(t, k)).abs() <= tolerance
}

/// The part of a segment in a counter-clockwise triangle.
///
/// Distances from an edge of at most the tolerance count as zero, and such an end is moved onto
/// the edge: both triangles beside a shared edge then see a line that runs up to it end in the same
/// point. `None` when no more than the tolerance is left.
fn clip(p: DVec2, q: DVec2, t: &[DVec2; 3], tolerance: f64) -> Option<[DVec2; 2]> {
    let (mut p, mut q) = (p, q);
    for k in 0..3 {
        let n = inward(t, k);
        let distance = |x: DVec2| {
            let d = (x - t[k]).dot(n);
            if d.abs() <= tolerance { 0.0 } else { d }
        };
        let (dp, dq) = (distance(p), distance(q));
        if dp.min(dq) < 0.0 && dp.max(dq) <= 0.0 {
            return None;
        }
        let onto = |x: DVec2| x - n * (x - t[k]).dot(n);
        let cross = p + (q - p) * (dp / (dp - dq));
        let (from, to) = (p, q);
        p = if dp == 0.0 {
            onto(from)
        } else if dp < 0.0 {
            cross
        } else {
            from
        };
        q = if dq == 0.0 {
            onto(to)
        } else if dq < 0.0 {
            cross
        } else {
            to
        };
    }
    (p.distance(q) > tolerance).then_some([p, q])
}

#[cfg(test)]
mod tests {
    use super::*;

    const T: [DVec2; 3] = [DVec2::ZERO, DVec2::X, DVec2::Y];
    const TOLERANCE: f64 = 1e-6;

    #[test]
    fn a_segment_is_clipped() {
        let at = DVec2::new;
        let cases = [
            (at(-1.0, 0.25), at(2.0, 0.25), Some([at(0.0, 0.25), at(0.75, 0.25)])),
            (at(0.125, 0.25), at(0.25, 0.25), Some([at(0.125, 0.25), at(0.25, 0.25)])),
            (at(0.25, -5e-7), at(0.25, 0.5), Some([at(0.25, 0.0), at(0.25, 0.5)])),
            (at(0.25, -5e-7), at(0.5, 5e-7), Some([at(0.25, 0.0), at(0.5, 0.0)])),
            (at(0.25, -1.0), at(0.25, 5e-7), None),
            (at(-1.0, 1.0), at(1.0, -1.0), None),
            (at(-1.0, 0.5), at(0.5, -1.0), None),
            (at(2.0, 2.0), at(3.0, 0.0), None),
        ];
        for (p, q, want) in cases {
            let got = clip(p, q, &T, TOLERANCE);
            match (got, want) {
                (Some([a, b]), Some([c, d])) => {
                    assert!(a.distance(c) < 1e-15 && b.distance(d) < 1e-15, "{p} {q}: {got:?}");
                }
                _ => assert_eq!(got, want, "{p} {q}"),
            }
        }
    }
}
