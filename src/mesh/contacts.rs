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
//! square of its few segments. A block that floats by more than the tolerance has no contact, and
//! nothing is moved to close the gap; where it is narrow, the face is cut along the block's outline all
//! the same ([`super::outlines`]).

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::Face;
use super::arrangement::arrange;
use super::clip::{beside, clip, height};
use super::outlines::{Heights, outline};
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

/// Gaps of at most this share of a triangle's size are narrow.
const NARROW: f64 = 1.0 / 64.0;

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
/// `faces` has the front of every triangle; `front[i]` is its number. Gaps from `least_gap` on get strips.
pub(super) fn find(
    scene: &Scene,
    faces: &[Face],
    front: &[Option<u32>],
    joins: &Joins,
    least_gap: f64,
) -> (Vec<Option<Cut>>, Contacts) {
    let boxes: Vec<Bounds> = scene.triangles.iter().map(|t| Bounds::of(&t.vertices)).collect();
    let tree = BoxTree::build(&boxes);
    let all = boxes.iter().fold(Bounds::EMPTY, |a, &b| a.union(b));
    let (tolerance, extent) = (contact_distance(all, scene.rounding), all.extent());
    let finder = Finder { scene, faces, front, joins, boxes, tree, tolerance, extent, least_gap };
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
    least_gap: f64,
}

impl Finder<'_> {
    fn cut(&self, triangle: usize) -> (Option<Cut>, Contacts) {
        let mut counts = Contacts::default();
        let Some(front) = self.front[triangle] else { return (None, counts) };
        let corners = &self.faces[front as usize].corners;
        if height(corners) < THIN * self.tolerance {
            return (None, counts);
        }
        let touching = self.segments(triangle, front);
        let hovering = self.outlines(triangle, front);
        if touching.is_empty() && hovering.is_empty() {
            return (None, counts);
        }
        let shapely = self.boxes[triangle].extent() > LARGE * self.extent;
        let along = |segments: &[[DVec2; 2]]| {
            if segments.is_empty() || segments.len() > MOST_SEGMENTS {
                return None;
            }
            let arrangement = arrange(corners, segments, self.tolerance)?;
            let mut cut = cut_along(arrangement, self.tolerance)?;
            if shapely && cut.pieces.len() > 1 {
                improve(&mut cut);
            }
            Some(cut)
        };
        let both = if hovering.is_empty() {
            None
        } else {
            along(&[&touching[..], &hovering[..]].concat())
        };
        let cut = both.or_else(|| {
            LEAST_LENGTHS.iter().find_map(|share| {
                let least = share * self.boxes[triangle].extent();
                let long = |s: &&[DVec2; 2]| s[0].distance(s[1]) >= least;
                let cut = along(&touching.iter().filter(long).copied().collect::<Vec<_>>())?;
                counts.simplified = usize::from(*share > 0.0);
                Some(cut)
            })
        });
        match &cut {
            Some(cut) => {
                counts.segments = cut.contacts.len();
                counts.cut = usize::from(cut.pieces.len() > 1);
            }
            None => counts.left_whole = usize::from(!touching.is_empty()),
        }
        (cut, counts)
    }

    /// Triangles within a distance of one, in order, but for those of its own surface, and their fronts.
    fn near(&self, triangle: usize, front: u32, distance: f64) -> Vec<(usize, u32)> {
        let near = self.boxes[triangle].grown(distance);
        let mut others = vec![];
        self.tree.visit(|b| b.meets(near), |i| others.push(i));
        // The order in which a tree proposes depends on its shape.
        others.sort_unstable();
        others.retain(|&other| other != triangle && self.boxes[other].meets(near));
        let fronts = others.into_iter().filter_map(|other| Some((other, self.front[other]?)));
        fronts.filter(|&(_, its)| !self.joins.same_surface(front, its)).collect()
    }

    /// The part of a segment that cuts a face or severs it from a flat neighbour.
    fn kept(&self, front: u32, p: DVec2, q: DVec2) -> Option<[DVec2; 2]> {
        let corners = &self.faces[front as usize].corners;
        let [p, q] = clip(p, q, corners, self.tolerance)?;
        let along = |k| {
            !self.joins.continued(front, k)
                && beside(corners, k, p, self.tolerance)
                && beside(corners, k, q, self.tolerance)
        };
        (!(0..3).any(along)).then_some([p, q])
    }

    /// What all triangles that touch `triangle` or cross it leave on it, in coordinates of its front.
    fn segments(&self, triangle: usize, front: u32) -> Vec<[DVec2; 2]> {
        let frame = &self.faces[front as usize].frame;
        let mut segments = vec![];
        for (other, its) in self.near(triangle, front, self.tolerance) {
            self.marks(frame, other, its, |p, q| segments.extend(self.kept(front, p, q)));
        }
        segments
    }

    /// What hovers over a radiating side of `triangle`, the same way.
    fn outlines(&self, triangle: usize, front: u32) -> Vec<[DVec2; 2]> {
        let reach = NARROW * self.boxes[triangle].extent();
        let others = self.near(triangle, front, reach);
        let mut segments = vec![];
        if others.is_empty() || reach <= self.tolerance {
            return segments;
        }
        let sides: &[f64] = if self.joins.two_sided(front) { &[1.0, -1.0] } else { &[1.0] };
        let triangles: Vec<[DVec3; 3]> =
            others.iter().map(|&(other, _)| self.scene.triangles[other].vertices).collect();
        let Face { frame, corners, .. } = &self.faces[front as usize];
        let open = [0, 1, 2].map(|k| !self.joins.continued(front, k));
        for &side in sides {
            let (touching, strips) = (self.tolerance, self.least_gap);
            let heights = Heights { side, touching, reach, strips };
            outline(frame, corners, open, heights, &triangles, |p, q| {
                segments.extend(self.kept(front, p, q));
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
