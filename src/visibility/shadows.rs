//! Shadows on one source plane as seen from one point, and what they leave visible.

use glam::{DVec2, DVec3};

use super::Occluders;
use crate::geometry::polygon::{Linear, Pieces, opposite};
use crate::geometry::{Bounds, Frame};

/// Normals closer than this (radians, for small angles) bound a dihedral angle that light hardly
/// fills: between planes whose normals differ by delta, cos cos <= sin^2(delta/2), so that no
/// point of one receives more than delta^2/4 = 1e-12 of the hemisphere from the other, or is
/// shaded by it. Flat faces whose corners were rounded to f32 are flat by this measure.
const FLAT: f64 = 2e-6;

/// Most that the plane through the observer and an occluder's edge is taken to be turned by the
/// roundings of the edge's ends, radians. Edges shorter than COINCIDENCE / TURN, 2e-6 of the
/// scene's size, turn by more, but what is coplanar with so short an edge matters less than what
/// its line would sweep over: areas beyond 1e-9 of the distance squared would go to the wrong side.
const TURN: f64 = 1e-9;

/// A point that looks out over a plane.
#[derive(Clone, Copy)]
pub struct Observer<'a> {
    /// What can block its sight.
    pub occluders: &'a Occluders,
    /// Where it is.
    pub point: DVec3,
    /// Unit normal there.
    pub normal: DVec3,
}

impl Observer<'_> {
    /// Whether light between this point and a source plane with normal `n` is negligible however
    /// they lie: both face the same way but for `FLAT`.
    pub fn faces_away(&self, n: DVec3) -> bool {
        faces_away(self.normal, n)
    }

    /// Whether the occluder blocks nothing that matters, seen from this point: the point is in its
    /// plane, or it is all at or below the horizon, or it continues the point's own flat surface.
    fn cannot_be_shaded_by(&self, index: usize) -> bool {
        let (on_plane, n) = self.occluders.plane(index);
        let (tau, height) = (self.occluders.coincidence(), (self.point - on_plane).dot(n));
        if height.abs() <= tau {
            return true;
        }
        if continues_flat(self.normal, n, &[height]) {
            return true;
        }
        self.occluders.corners(index).iter().all(|&w| (w - self.point).dot(self.normal) <= tau)
    }
}

/// Whether light between planes with these unit normals is negligible however they lie.
pub fn faces_away(receiver: DVec3, source: DVec3) -> bool {
    receiver.distance_squared(source) <= FLAT * FLAT
}

/// Whether a plane with unit normal `n` continues the flat surface of receivers with unit `normal`
/// that have these heights above it.
pub(super) fn continues_flat(normal: DVec3, n: DVec3, heights: &[f64]) -> bool {
    let side = n.dot(normal).signum();
    heights.iter().all(|h| h * side > 0.0) && faces_away(normal, side * n)
}

/// What is seen of a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coverage {
    /// Everything: no occluder is between (a proof).
    Full,
    /// Nothing: one occluder covers it all (a proof).
    Hidden,
    /// Occluders cover some or all of it.
    Partial,
}

/// One occluder's shadow on the source plane.
#[derive(Clone, Copy, Debug)]
struct Shadow {
    /// Its bounding lines: `lines[begin..end]`, all >= 0 inside, the last one the occluder's plane.
    begin: usize,
    end: usize,
    /// Its corners in `corners[first..last]`.
    first: usize,
    last: usize,
}

/// A corner of an occluder, homogeneous: its shadow is foot + a/b where b > 0.
///
/// For a line g.x + k through the plane, the side on which the occluder's corner lies of the plane
/// through the observer and that line is the sign of g.a + (g.foot + k) b, whatever the sign of b.
#[derive(Clone, Copy, Debug)]
struct Corner {
    a: DVec2,
    b: f64,
}

/// The shadows on one source plane from one observer; an arena that is used again and again.
#[derive(Default)]
pub struct Shadows {
    shadows: Vec<Shadow>,
    lines: Vec<Linear>,
    corners: Vec<Corner>,
    foot: DVec2,
    found: Vec<usize>,
    now: Pieces,
    next: Pieces,
    inside: Pieces,
    spare: Pieces,
}

impl Shadows {
    /// Finds the occluders that may shade the convex `polygon` (plane coordinates of `frame`) from
    /// `observer`, and their shadows. Numbers of these, for [`Shadows::narrow`], go to `active`.
    pub fn find(
        &mut self,
        observer: &Observer,
        frame: &Frame,
        polygon: &[DVec2],
        active: &mut Vec<u32>,
    ) {
        self.shadows.clear();
        self.lines.clear();
        self.corners.clear();
        self.found.clear();
        let (point, normal) = (observer.point, observer.normal);
        let tau = observer.occluders.coincidence();
        self.foot = frame.project(point);
        let lifted = |x: DVec2| frame.lift(x);
        let hull =
            polygon.iter().fold(Bounds { min: point, max: point }, |b, &x| b.with(lifted(x)));
        let reach = polygon.iter().map(|&x| lifted(x).distance(point)).fold(0.0, f64::max);
        // Planes through the observer and the polygon's edges; the polygon is on the positive side.
        let beam = |i: usize| {
            let (p, q) = (lifted(polygon[i]), lifted(polygon[(i + 1) % polygon.len()]));
            (q - point).cross(p - point)
        };
        let tilt = tau * reach * reach;
        let found = &mut self.found;
        observer.occluders.tree.visit(
            |b| {
                b.meets(hull)
                    && b.support(normal) - normal.dot(point) > 0.0
                    && b.support(frame.n) - frame.n.dot(frame.origin) > 0.0
                    && (0..polygon.len()).all(|i| {
                        let side = beam(i);
                        b.support(side) - side.dot(point) >= -tilt
                    })
            },
            |i| found.push(i),
        );
        // The tree's shape must not show in the result.
        self.found.sort_unstable();
        for k in 0..self.found.len() {
            let index = self.found[k];
            active.extend(self.try_add(observer, frame, polygon, index, reach));
        }
    }

    /// No shadow.
    pub const NONE: u32 = u32::MAX;

    /// As [`Shadows::find`], with occluders that are known to be the only candidates: the number of
    /// the shadow of each, or [`Shadows::NONE`], goes to `numbers`.
    pub fn cast(
        &mut self,
        observer: &Observer,
        frame: &Frame,
        polygon: &[DVec2],
        candidates: &[u32],
        numbers: &mut Vec<u32>,
    ) {
        self.shadows.clear();
        self.lines.clear();
        self.corners.clear();
        self.foot = frame.project(observer.point);
        let distance = |&x: &DVec2| frame.lift(x).distance(observer.point);
        let reach = polygon.iter().map(distance).fold(0.0, f64::max);
        for &index in candidates {
            let number = self.try_add(observer, frame, polygon, index as usize, reach);
            numbers.push(number.unwrap_or(Self::NONE));
        }
    }

    /// Adds the shadow of an occluder that may shade the polygon; its number.
    fn try_add(
        &mut self,
        observer: &Observer,
        frame: &Frame,
        polygon: &[DVec2],
        index: usize,
        reach: f64,
    ) -> Option<u32> {
        let tau = observer.occluders.coincidence();
        if observer.cannot_be_shaded_by(index)
            || observer.occluders.corners(index).iter().all(|&w| frame.height(w) <= tau)
        {
            return None;
        }
        self.add(observer, frame, index, reach);
        let number = self.shadows.len() - 1;
        if self.misses(number, polygon) {
            let shadow = self.shadows.pop()?;
            self.lines.truncate(shadow.begin);
            self.corners.truncate(shadow.first);
            return None;
        }
        Some(number as u32)
    }

    fn add(&mut self, observer: &Observer, frame: &Frame, index: usize, reach: f64) {
        let tau = observer.occluders.coincidence();
        let point = observer.point;
        let corners = observer.occluders.corners(index);
        let (on_plane, n) = observer.occluders.plane(index);
        // Seen from its front the corners run counter-clockwise, and the cross products of
        // successive corners point outward.
        let side = -(point - on_plane).dot(n).signum();
        let (begin, first) = (self.lines.len(), self.corners.len());
        let line = |normal: DVec3, through: DVec3, uncertainty: f64| Linear {
            g: DVec2::new(normal.dot(frame.u), normal.dot(frame.v)),
            c: normal.dot(frame.origin - through),
            uncertainty,
        };
        for (i, &w) in corners.iter().enumerate() {
            // a x edge is a x b, without the cancellation for short edges.
            let (a, edge) = (w - point, corners[(i + 1) % corners.len()] - w);
            let normal = side * a.cross(edge);
            // What shifts of P, x and the edge by tau do to the volume a x edge . (x - P), and what
            // shifts of the edge's ends by tau against each other do.
            let shifted = edge.length() * (a.length() + reach);
            let turned = 2.0 * (a.length() + edge.length()) * reach;
            let uncertainty = tau * shifted + (tau * turned).min(TURN * normal.length() * reach);
            self.lines.push(line(normal, point, uncertainty));
        }
        self.lines.push(line(side * n, on_plane, tau));
        let d = frame.height(point);
        self.corners.extend(
            corners
                .iter()
                .map(|&w| Corner { a: (frame.project(w) - self.foot) * d, b: d - frame.height(w) }),
        );
        let (end, last) = (self.lines.len(), self.corners.len());
        self.shadows.push(Shadow { begin, end, first, last });
    }

    /// Whether a shadow certainly does not touch the inside of a convex polygon: a line separates
    /// them. For two convex sets in a plane some line along a side of one of them does.
    fn misses(&self, shadow: usize, polygon: &[DVec2]) -> bool {
        let Shadow { begin, end, first, last } = self.shadows[shadow];
        if self.lines[begin..end].iter().any(|f| f.nowhere_positive(polygon)) {
            return true;
        }
        let corners = &self.corners[first..last];
        (0..polygon.len()).any(|i| {
            let (p, q) = (polygon[i], polygon[(i + 1) % polygon.len()]);
            let edge = q - p;
            let inward = DVec2::new(-edge.y, edge.x);
            let at_foot = inward.dot(self.foot - p);
            corners.iter().fold(true, |all, w| all & (inward.dot(w.a) + at_foot * w.b <= 0.0))
        })
    }

    /// Of the shadows `active[from..]`, appends to `active` those that may touch `polygon`.
    ///
    /// Returns how much of the polygon is seen; nothing is appended unless it is partial.
    pub fn narrow(&self, polygon: &[DVec2], active: &mut Vec<u32>, from: usize) -> Coverage {
        let to = active.len();
        for k in from..to {
            let shadow = active[k];
            if self.misses(shadow as usize, polygon) {
                continue;
            }
            let Shadow { begin, end, .. } = self.shadows[shadow as usize];
            if self.lines[begin..end].iter().all(|f| f.nowhere_negative(polygon)) {
                active.truncate(to);
                return Coverage::Hidden;
            }
            active.push(shadow);
        }
        if active.len() == to { Coverage::Full } else { Coverage::Partial }
    }

    /// The part of convex `polygon` that none of the shadows `active` covers, as disjoint convex
    /// pieces. None are returned when it is all covered.
    pub fn visible(&mut self, polygon: &[DVec2], active: &[u32]) -> &Pieces {
        self.now.clear();
        self.now.push(polygon);
        for &shadow in active {
            let Shadow { begin, end, .. } = self.shadows[shadow as usize];
            let lines = &self.lines[begin..end];
            self.next.clear();
            for piece in self.now.iter() {
                let before = self.next.len();
                self.inside.clear();
                self.inside.push(piece);
                let mut shaded = true;
                for (k, f) in lines.iter().enumerate() {
                    let rest = self.inside.get(0);
                    // What lies in the occluder's plane, the last line, it does not shade. A thin
                    // occluder's plane is known where the occluder is: here, between its edges.
                    if k + 1 == lines.len() && f.nowhere_positive(rest) {
                        shaded = false;
                        break;
                    }
                    if f.nowhere_negative(rest) {
                        continue;
                    }
                    self.next.push_clipped(rest, &opposite(f));
                    self.spare.clear();
                    if !self.spare.push_clipped(rest, f) {
                        shaded = false;
                        break;
                    }
                    std::mem::swap(&mut self.inside, &mut self.spare);
                }
                // A piece that the shadow misses stays whole: cutting it would only cost.
                if !shaded {
                    self.next.truncate(before);
                    self.next.push(piece);
                }
            }
            std::mem::swap(&mut self.now, &mut self.next);
            if self.now.is_empty() {
                break;
            }
        }
        &self.now
    }
}
