//! What lies between two triangles: for every pair of their points at once.
//!
//! The *shaft* of two triangles is their convex hull: the union of all segments between them. A
//! convex occluder that does not touch its inside hides no point of one from any point of the
//! other; one that all segments cross hides everything. Both are decided by signs of
//! determinants: for the edge w -> w' of an occluder
//!
//! D(P, Q) = det(w - P, w' - P, Q - P) = (w - P) x (w' - w) . (Q - P)
//!
//! is linear in P and linear in Q, so that a sign which it has at the nine pairs of corners it has
//! at all pairs of points.

use std::cell::OnceCell;

use glam::DVec3;

use super::occluders::Occluders;
use super::shadows::{Coverage, continues_flat};
use crate::geometry::Bounds;

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

/// A half space that holds the shaft: n.x <= c, up to rounding.
#[derive(Clone, Copy, Debug)]
struct Side {
    n: DVec3,
    c: f64,
    uncertainty: f64,
}

/// All segments from a receiving triangle to a source triangle.
pub struct Shaft<'a> {
    occluders: &'a Occluders,
    receiver: [DVec3; 3],
    source: [DVec3; 3],
    /// Unit normals of the sides that receive and send.
    normals: (DVec3, DVec3),
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
        Shaft { occluders, receiver, source, normals, sides: OnceCell::new() }
    }

    /// Appends to `found`, in ascending order, the occluders that may stand between.
    pub fn find(&self, found: &mut Vec<u32>) {
        let from = found.len();
        let hull = Bounds::of(self.receiver.iter().chain(&self.source));
        let (up, out) = self.normals;
        let (on_receiver, on_source) = (self.receiver[0], self.source[0]);
        self.occluders.tree.visit(
            |b| {
                b.meets(hull)
                    && b.support(up) - up.dot(on_receiver) > 0.0
                    && b.support(out) - out.dot(on_source) > 0.0
                    && self
                        .sides()
                        .iter()
                        .all(|side| -b.support(-side.n) <= side.c + side.uncertainty)
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
        let heights = |t: &[DVec3; 3]| t.map(|x| (x - on_plane).dot(n));
        let (a, b) = (heights(&self.receiver), heights(&self.source));
        let (above, under) = (|h: &f64| *h >= -tau, |h: &f64| *h <= tau);
        let (a_above, b_above) = (a.iter().all(above), b.iter().all(above));
        let (a_under, b_under) = (a.iter().all(under), b.iter().all(under));
        if (a_above && b_above) || (a_under && b_under) {
            return Meeting::None;
        }
        if continues_flat(self.normals.0, n, &a) {
            return Meeting::None;
        }
        let opposite = (a_above && b_under) || (a_under && b_above);
        if opposite {
            // From the receiver the corners run clockwise when it is above: crossing products of
            // successive corners point inward.
            let inward = if a_above { -1.0 } else { 1.0 };
            let reach = self.reach(corners);
            let mut all = true;
            for (i, &w) in corners.iter().enumerate() {
                let edge = corners[(i + 1) % corners.len()] - w;
                let slack = 2.0 * tau * edge.length() * reach;
                let (mut any_in, mut any_out) = (false, false);
                for p in self.receiver {
                    let normal = inward * (w - p).cross(edge);
                    for q in self.source {
                        let d = normal.dot(q - p);
                        any_in |= d > slack;
                        any_out |= d < -slack;
                    }
                }
                if !any_in {
                    return Meeting::None;
                }
                all &= !any_out;
            }
            let strictly = |h: &[f64; 3]| h.iter().any(|h| h.abs() > tau);
            if all && strictly(&a) && strictly(&b) {
                return Meeting::All;
            }
        }
        let outside =
            |side: &Side| corners.iter().all(|w| side.n.dot(*w) >= side.c - side.uncertainty);
        if self.sides().iter().any(outside) { Meeting::None } else { Meeting::Unknown }
    }

    /// A bound on all distances between points of the shaft and of an occluder.
    fn reach(&self, corners: &[DVec3]) -> f64 {
        let all = Bounds::of(self.receiver.iter().chain(&self.source).chain(corners));
        (all.max - all.min).length()
    }

    /// The sides of the hull that hold an edge of one triangle and a corner of the other.
    fn sides(&self) -> &[Side] {
        self.sides.get_or_init(|| {
            let hull = Bounds::of(self.receiver.iter().chain(&self.source));
            let size = (hull.max - hull.min).length();
            let tau = self.occluders.coincidence();
            let mut sides = vec![];
            for (own, other) in [(&self.receiver, &self.source), (&self.source, &self.receiver)] {
                for k in 0..3 {
                    let (p, q, opposite) = (own[k], own[(k + 1) % 3], own[(k + 2) % 3]);
                    for &corner in other {
                        let n = (q - p).cross(corner - p);
                        let (c, uncertainty) = (n.dot(p), 2.0 * tau * (q - p).length() * size);
                        let beyond = |sign: f64| {
                            std::iter::once(&opposite)
                                .chain(other)
                                .all(|x| sign * (n.dot(*x - p)) <= uncertainty)
                        };
                        if n.length() <= uncertainty {
                            continue;
                        }
                        if beyond(1.0) {
                            sides.push(Side { n, c, uncertainty });
                        } else if beyond(-1.0) {
                            sides.push(Side { n: -n, c: -c, uncertainty });
                        }
                    }
                }
            }
            sides
        })
    }
}
