//! What lies between two triangles: for every pair of their points at once.
//!
//! The *shaft* of two triangles is their convex hull: the union of all segments between them. A
//! convex occluder that does not touch its inside hides no point of one from any point of the
//! other; one that all segments cross hides everything. Both are decided by signs of
//! determinants: for the edge w -> w' of an occluder
//!
//! D(P, Q) = det(w - P, w' - P, Q - P) = (w - P) x (w' - w) . (Q - P)
//!
//! is linear in P and linear in Q, so that a sign which it has at all pairs of corners it has at
//! all pairs of points. Where the occluder's plane cuts a triangle, corners above it are paired
//! with corners below it: the section of the shaft with the plane is the hull of their crossings.

use std::cell::OnceCell;

use glam::DVec3;

use super::occluders::Occluders;
use super::shadows::{Coverage, continues_flat};
use crate::geometry::Bounds;

/// Pairs of an edge of one triangle and a corner of the other.
const MOST_SIDES: usize = 18;

/// A convex occluder and a shaft.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Meeting {
    /// No segment crosses the occluder.
    None,
    /// Each segment does.
    All,
    /// Not known.
    Unknown,
}

/// A half space that holds the shaft: n.x <= c, with a unit normal, up to rounding.
#[derive(Clone, Copy, Debug)]
struct Side {
    n: DVec3,
    c: f64,
}

/// All segments from a receiving triangle to a source triangle.
pub struct Shaft<'a> {
    occluders: &'a Occluders,
    receiver: [DVec3; 3],
    source: [DVec3; 3],
    /// Unit normals of the sides that receive and send.
    normals: (DVec3, DVec3),
    hull: Bounds,
    sides: OnceCell<Vec<Side>>,
}

impl<'a> Shaft<'a> {
    /// The shaft between two triangles with unit normals.
    pub fn new(
        occluders: &'a Occluders,
        (receiver, receiver_normal): ([DVec3; 3], DVec3),
        (source, source_normal): ([DVec3; 3], DVec3),
    ) -> Shaft<'a> {
        let normals = (receiver_normal, source_normal);
        let hull = Bounds::of(receiver.iter().chain(&source));
        Shaft { occluders, receiver, source, normals, hull, sides: OnceCell::new() }
    }

    /// Appends to `found`, in ascending order, the occluders that may stand between.
    pub fn find(&self, found: &mut Vec<u32>) {
        let from = found.len();
        let hull = self.hull;
        let (up, out) = self.normals;
        let (on_receiver, on_source) = (self.receiver[0], self.source[0]);
        self.occluders.tree.visit(
            |b| {
                b.meets(hull)
                    && b.support(up) - up.dot(on_receiver) > 0.0
                    && b.support(out) - out.dot(on_source) > 0.0
                    && self.sides().iter().all(|side| -b.support(-side.n) <= side.c)
            },
            |i| {
                if self.meeting(i) != Meeting::None {
                    found.push(i as u32);
                }
            },
        );
        // The tree's shape must not show in the result.
        found[from..].sort_unstable();
    }

    /// Of the occluders in a range of `list`, appends to it those that may stand between.
    ///
    /// `Full` and `Hidden` are proofs; nothing is appended unless the answer is `Partial`.
    pub fn narrow(&self, list: &mut Vec<u32>, (begin, end): (u32, u32)) -> Coverage {
        let to = list.len();
        for k in begin as usize..end as usize {
            match self.meeting(list[k] as usize) {
                Meeting::None => {}
                Meeting::All => {
                    list.truncate(to);
                    return Coverage::Hidden;
                }
                Meeting::Unknown => list.push(list[k]),
            }
        }
        if list.len() == to { Coverage::Full } else { Coverage::Partial }
    }

    fn meeting(&self, index: usize) -> Meeting {
        let occluders = self.occluders;
        let tau = occluders.coincidence();
        let corners = occluders.corners(index);
        let (on_plane, n) = occluders.plane(index);
        let below = |normal: DVec3, on: DVec3| corners.iter().all(|&w| (w - on).dot(normal) <= tau);
        if below(self.normals.0, self.receiver[0]) || below(self.normals.1, self.source[0]) {
            return Meeting::None;
        }
        let points = self.points();
        let heights = points.map(|x| (x - on_plane).dot(n));
        let (above, under) = (|h: &f64| *h >= -tau, |h: &f64| *h <= tau);
        if heights.iter().all(above) || heights.iter().all(under) {
            return Meeting::None;
        }
        let (a, b) = heights.split_at(3);
        if continues_flat(self.normals.0, n, a) {
            return Meeting::None;
        }
        let strictly = |h: &[f64]| h.iter().any(|h| h.abs() > tau);
        let apart = (a.iter().all(above) && b.iter().all(under))
            || (a.iter().all(under) && b.iter().all(above));
        let mut all = apart && strictly(a) && strictly(b);
        let reach = self.reach(corners);
        for (i, &w) in corners.iter().enumerate() {
            let edge = corners[(i + 1) % corners.len()] - w;
            let slack = 2.0 * tau * edge.length() * reach;
            let (mut any_in, mut any_out) = (false, false);
            for (&p, _) in points.iter().zip(&heights).filter(|(_, h)| above(h)) {
                // Seen from above the corners run counter-clockwise: this points inward.
                let inward = edge.cross(w - p);
                for (&q, _) in points.iter().zip(&heights).filter(|(_, h)| under(h)) {
                    let d = inward.dot(q - p);
                    any_in |= d > slack;
                    any_out |= d < -slack;
                }
                if any_in && (any_out || !all) {
                    break;
                }
            }
            if !any_in {
                return Meeting::None;
            }
            all &= !any_out;
        }
        if all {
            return Meeting::All;
        }
        let outside = |side: &Side| corners.iter().all(|&w| side.n.dot(w) >= side.c - 2.0 * tau);
        if self.sides().iter().any(outside) { Meeting::None } else { Meeting::Unknown }
    }

    /// The corners of both triangles.
    fn points(&self) -> [DVec3; 6] {
        let ([a, b, c], [d, e, f]) = (self.receiver, self.source);
        [a, b, c, d, e, f]
    }

    /// A bound on all distances between points of the shaft and of an occluder.
    fn reach(&self, corners: &[DVec3]) -> f64 {
        let all = corners.iter().fold(self.hull, |all, &w| all.with(w));
        (all.max - all.min).length()
    }

    /// The sides of the hull that hold an edge of one triangle and a corner of the other.
    ///
    /// Where these are close together their plane is turned by roundings, tau over their distance.
    /// So the half space is put where it does hold the whole hull: a separation by it is a proof
    /// whatever its normal is, to a rounding of coordinates.
    fn sides(&self) -> &[Side] {
        self.sides.get_or_init(|| {
            let size = (self.hull.max - self.hull.min).length();
            let tau = self.occluders.coincidence();
            let mut sides = Vec::with_capacity(MOST_SIDES);
            for (own, other) in [(&self.receiver, &self.source), (&self.source, &self.receiver)] {
                for k in 0..3 {
                    let (p, edge, opposite) = (own[k], own[(k + 1) % 3] - own[k], own[(k + 2) % 3]);
                    for &corner in other {
                        let n = edge.cross(corner - p);
                        let length = n.length();
                        let turn = 2.0 * tau * edge.length() / length;
                        if turn.is_nan() || turn >= 1.0 {
                            continue;
                        }
                        let n = n / length;
                        let [a, b, c, d] =
                            [opposite, other[0], other[1], other[2]].map(|x| n.dot(x - p));
                        let highest = a.max(b).max(c.max(d)).max(0.0);
                        let lowest = a.min(b).min(c.min(d)).min(0.0);
                        if highest <= turn * size {
                            sides.push(Side { n, c: n.dot(p) + highest });
                        } else if -lowest <= turn * size {
                            sides.push(Side { n: -n, c: -(n.dot(p) + lowest) });
                        }
                    }
                }
            }
            sides
        })
    }
}
