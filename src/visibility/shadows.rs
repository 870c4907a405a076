//! Shadows on one source plane as seen from one point, and what they leave visible.

use glam::{DVec2, DVec3};

use super::Occluders;
use super::silhouettes::{Seen, Silhouette, Silhouettes};
use crate::geometry::polygon::{Linear, Pieces};
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

/// Distance of the farthest corner of a polygon.
fn reach(frame: &Frame, polygon: &[DVec2], point: DVec3) -> f64 {
    let squares = polygon.iter().map(|&x| frame.lift(x).distance_squared(point));
    squares.fold(0.0, f64::max).sqrt()
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
    /// Its bounding lines: `lines[begin..end]`, all >= 0 inside, from `planes` on those of the planes
    /// that it lies beyond.
    begin: usize,
    planes: usize,
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
    silhouettes: Silhouettes,
    /// Bodies that were looked at, and the number of the shadow of each that casts one.
    bodies: Vec<(u32, Option<u32>)>,
    found: Vec<usize>,
    values: Vec<f64>,
    now: Pieces,
    next: Pieces,
    inside: Pieces,
    spare: Pieces,
}

impl Shadows {
    /// Looks from another point: to be called before shadows are found from there.
    pub fn look_from(&mut self, observer: &Observer) {
        self.silhouettes.look_from(observer);
    }

    /// Finds the occluders that may shade the convex `polygon` (plane coordinates of `frame`) from
    /// `observer` ([`Shadows::look_from`]), and their shadows. Numbers of these, for [`Shadows::narrow`], go to `active`.
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
        self.bodies.clear();
        self.found.clear();
        let (point, normal) = (observer.point, observer.normal);
        let tau = observer.occluders.coincidence();
        self.foot = frame.project(point);
        let lifted = |x: DVec2| frame.lift(x);
        let hull =
            polygon.iter().fold(Bounds { min: point, max: point }, |b, &x| b.with(lifted(x)));
        let reach = reach(frame, polygon, point);
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
            let known = self.shadows.len();
            let Some(shadow) = self.add(observer, frame, index, reach) else { continue };
            // Another face of a body.
            if self.shadows.len() == known {
                continue;
            }
            if self.leaves(shadow as usize, polygon) == Coverage::Full {
                self.drop_last();
            } else {
                active.push(shadow);
            }
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
        self.bodies.clear();
        self.foot = frame.project(observer.point);
        let reach = reach(frame, polygon, observer.point);
        for &index in candidates {
            let number = self.add(observer, frame, index as usize, reach);
            numbers.push(number.unwrap_or(Self::NONE));
        }
    }

    /// The shadow of an occluder, or of the body that it is a face of, if it may shade anything of the
    /// plane.
    fn add(&mut self, observer: &Observer, frame: &Frame, index: usize, reach: f64) -> Option<u32> {
        let occluders = observer.occluders;
        match self.silhouettes.of(observer, index) {
            Seen::Nothing => None,
            Seen::Alone(outline) => {
                self.add_outline(observer, frame, &outline, occluders.corners(index), reach)
            }
            Seen::Together(body, outline) => {
                if let Some((_, shadow)) = self.bodies.iter().find(|known| known.0 == body) {
                    return *shadow;
                }
                let corners = &occluders.bodies[body as usize].corners;
                let shadow = self.add_outline(observer, frame, &outline, corners, reach);
                self.bodies.push((body, shadow));
                shadow
            }
        }
    }

    fn add_outline(
        &mut self,
        observer: &Observer,
        frame: &Frame,
        outline: &Silhouette,
        corners: &[DVec3],
        reach: f64,
    ) -> Option<u32> {
        let tau = observer.occluders.coincidence();
        if corners.iter().all(|&w| frame.height(w) <= tau) {
            return None;
        }
        let point = observer.point;
        let (begin, first) = (self.lines.len(), self.corners.len());
        let line = |normal: DVec3, through: DVec3, uncertainty: f64| Linear {
            g: DVec2::new(normal.dot(frame.u), normal.dot(frame.v)),
            c: normal.dot(frame.origin - through),
            uncertainty,
        };
        let d = frame.height(point);
        for edge in &self.silhouettes.edges[outline.begin..outline.end] {
            // What shifts of P, x and the edge by tau do to the volume a x edge . (x - P), and what
            // shifts of the edge's ends by tau against each other do.
            let shifted = edge.edge * (edge.distance + reach);
            let turned = 2.0 * (edge.distance + edge.edge) * reach;
            let uncertainty = tau * shifted + (tau * turned).min(TURN * edge.twice_area * reach);
            self.lines.push(line(edge.normal, point, uncertainty));
            let w = edge.to_corner;
            let a = d * DVec2::new(w.dot(frame.u), w.dot(frame.v));
            self.corners.push(Corner { a, b: -w.dot(frame.n) });
        }
        let planes = self.lines.len();
        for &(on_plane, beyond) in &self.silhouettes.planes[outline.first..outline.last] {
            self.lines.push(line(beyond, on_plane, tau));
        }
        let (end, last) = (self.lines.len(), self.corners.len());
        self.shadows.push(Shadow { begin, planes, end, first, last });
        Some(self.shadows.len() as u32 - 1)
    }

    fn drop_last(&mut self) {
        if let Some(shadow) = self.shadows.pop() {
            self.lines.truncate(shadow.begin);
            self.corners.truncate(shadow.first);
            let number = self.shadows.len() as u32;
            self.bodies.iter_mut().filter(|(_, s)| *s == Some(number)).for_each(|b| b.1 = None);
        }
    }

    /// What one shadow leaves to be seen of a convex polygon. All of it where a line certainly separates
    /// them: for two convex sets in a plane some line along a side of one of them does.
    fn leaves(&self, shadow: usize, polygon: &[DVec2]) -> Coverage {
        let Shadow { begin, end, first, last, .. } = self.shadows[shadow];
        let mut inside = true;
        for f in &self.lines[begin..end] {
            let (least, most) = f.range(polygon);
            if most <= f.uncertainty {
                return Coverage::Full;
            }
            inside &= least >= -f.uncertainty;
        }
        if inside {
            return Coverage::Hidden;
        }
        let corners = &self.corners[first..last];
        let separated = (0..polygon.len()).any(|i| {
            let (p, q) = (polygon[i], polygon[(i + 1) % polygon.len()]);
            let edge = q - p;
            let inward = DVec2::new(-edge.y, edge.x);
            let at_foot = inward.dot(self.foot - p);
            corners.iter().fold(true, |all, w| all & (inward.dot(w.a) + at_foot * w.b <= 0.0))
        });
        if separated { Coverage::Full } else { Coverage::Partial }
    }

    /// Of the shadows `active[from..]`, appends to `active` those that may touch `polygon`.
    ///
    /// Returns how much of the polygon is seen; nothing is appended unless it is partial.
    pub fn narrow(&self, polygon: &[DVec2], active: &mut Vec<u32>, from: usize) -> Coverage {
        let to = active.len();
        for k in from..to {
            let shadow = active[k];
            match self.leaves(shadow as usize, polygon) {
                Coverage::Full => {}
                Coverage::Hidden => {
                    active.truncate(to);
                    return Coverage::Hidden;
                }
                Coverage::Partial => active.push(shadow),
            }
        }
        if active.len() == to { Coverage::Full } else { Coverage::Partial }
    }

    /// The part of convex `polygon` that none of the shadows `active` covers, as disjoint convex
    /// pieces. None are returned when it is all covered.
    pub fn visible(&mut self, polygon: &[DVec2], active: &[u32]) -> &Pieces {
        self.now.clear();
        self.now.push(polygon);
        for &shadow in active {
            let Shadow { begin, planes, end, .. } = self.shadows[shadow as usize];
            let lines = &self.lines[begin..end];
            self.next.clear();
            for piece in self.now.iter() {
                let before = self.next.len();
                self.inside.clear();
                self.inside.push(piece);
                let mut shaded = true;
                for (k, f) in lines.iter().enumerate() {
                    let rest = self.inside.get(0);
                    let values = &mut self.values;
                    f.cut(rest, values);
                    // What lies in the plane of an occluder it does not shade. A thin
                    // occluder's plane is known where the occluder is: here, between its edges.
                    if begin + k >= planes && values.iter().all(|&v| v <= 0.0) {
                        shaded = false;
                        break;
                    }
                    if values.iter().all(|&v| v >= 0.0) {
                        continue;
                    }
                    self.next.push_part(rest, values, -1.0);
                    self.spare.clear();
                    if !self.spare.push_part(rest, values, 1.0) {
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
