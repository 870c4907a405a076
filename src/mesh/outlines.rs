//! Outlines of what hovers close to a face: under a block that floats by a hair it is dark, and beside
//! it bright. What is between takes as little room as the gap is high, and an element that lies partly
//! under the block would have to hold all of it; so faces are cut there too ([`super::contacts`]).
//!
//! Seen along the normal of a face, near triangles cover a part of it, and the outline is the edges of
//! that part: those that no other near triangle continues. A steep one continues nothing, since it
//! leaves the face faster than it leads away from the edge: the sides of a block do not, a bevel does.
//! Where steep ones end above the face (a screen, a block without a bottom) is an outline, too.

use std::collections::HashSet;

use glam::{DVec2, DVec3};

use super::barycentric;
use super::clip::clip;
use crate::geometry::Frame;

/// Triangles steeper than 45 degrees continue nothing.
const STEEP: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Light that comes into a gap of height g falls like (g / 2d)^2 with the depth d, and what is lost outside
/// does with the distance: at this many heights from the outline it is 1/36. Lines there, on both sides, give
/// what is between elements of its own, where they would not be much too small to matter.
const DEPTH: f64 = 3.0;

/// Strips narrower than this many contact tolerances are not cut off: they have no area.
const LEAST_STRIP: f64 = 32.0;

/// Heights over a plane at which outlines count: above `touching`, below that is contact, up to `reach`.
/// On the side of the normal if `side` is 1, on the other one if it is -1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Heights {
    pub side: f64,
    pub touching: f64,
    pub reach: f64,
    /// Gaps from this height on get strips.
    pub strips: f64,
}

impl Heights {
    /// Marks the part `[p, q]` of an edge from `a` to `b`, which hovers at the given heights over its ends, if
    /// that is near enough, and the ends of the strips beside the edge. One that is shorter than it is high counts for nothing: light comes in
    /// below it from all sides.
    fn mark(
        self,
        [a, b]: [DVec2; 2],
        [p, q]: [DVec2; 2],
        over: [f64; 2],
        mark: &mut impl FnMut(DVec2, DVec2),
    ) {
        let [low, gap] = [over[0].min(over[1]), over[0].max(over[1])];
        if low < -self.touching || gap <= self.touching || gap > self.reach.min(p.distance(q)) {
            return;
        }
        mark(p, q);
        let depth = DEPTH * gap;
        if gap >= self.strips && depth >= LEAST_STRIP * self.touching {
            let inward = depth * (q - p).perp().normalize();
            mark(a + inward, b + inward);
            mark(a - inward, b - inward);
        }
    }
}

/// Corners counter-clockwise as seen from the front of a plane; `None` where the triangle is steep.
fn shallow(frame: &Frame, [a, b, c]: [DVec3; 3]) -> Option<[DVec3; 3]> {
    let n = (b - a).cross(c - a);
    let towards = frame.n.dot(n);
    let corners = if towards > 0.0 { [a, b, c] } else { [a, c, b] };
    (towards.abs() >= STEEP * n.length() && towards != 0.0).then_some(corners)
}

/// Edges of a triangle, each with the corner that is not on it.
fn edges([a, b, c]: [DVec3; 3]) -> [([DVec3; 2], DVec3); 3] {
    [([a, b], c), ([b, c], a), ([c, a], b)]
}

/// Edges of shallow triangles that no other one continues, and those where steep ones end, seen from the
/// front (`side` 1) or from the back (-1).
fn ends(frame: &Frame, side: f64, shallow: &[[DVec3; 3]], steep: &[[DVec3; 3]]) -> Vec<[DVec3; 2]> {
    let key = |x: DVec3| (x + 0.0).to_array().map(f64::to_bits);
    let height = |x: DVec3| side * frame.height(x);
    let of_shallow = || shallow.iter().flat_map(|&t| edges(t)).map(|e| e.0);
    let directed: HashSet<_> = of_shallow().map(|e| e.map(key)).collect();
    let mut ends: Vec<[DVec3; 2]> =
        of_shallow().filter(|&[a, b]| !directed.contains(&[b, a].map(key))).collect();
    // Whether all that meets in an edge leads away from the face.
    let leads_away = |[a, b]: [DVec3; 2], c: DVec3| height(c) > height(a).max(height(b));
    let both = |[a, b]: [DVec3; 2]| [[a, b], [b, a]].map(|e| e.map(key));
    let on: HashSet<_> = shallow
        .iter()
        .chain(steep)
        .flat_map(|&t| edges(t))
        .filter(|&(edge, c)| !leads_away(edge, c))
        .flat_map(|(edge, _)| both(edge))
        .collect();
    let of_steep = steep.iter().flat_map(|&t| edges(t));
    let last = of_steep.filter(|&(e, c)| leads_away(e, c) && !on.contains(&e.map(key)));
    ends.extend(last.map(|(e, _)| e));
    ends
}

/// Calls `mark` with the outline of `triangles` over a face with the given corners in its plane, and with
/// the ends of its strips. `open` are edges of the face that no flat neighbour continues.
pub(super) fn outline(
    frame: &Frame,
    corners: &[DVec2; 3],
    open: [bool; 3],
    heights: Heights,
    triangles: &[[DVec3; 3]],
    mut mark: impl FnMut(DVec2, DVec2),
) {
    let (mut level, mut steep) = (vec![], vec![]);
    for &t in triangles {
        match shallow(frame, t) {
            Some(t) => level.push(t),
            None => steep.push(t),
        }
    }
    for [a, b] in ends(frame, heights.side, &level, &steep) {
        let [from, to] = [a, b].map(|x| frame.project(x));
        if let Some(part) = clip(from, to, corners, heights.touching) {
            let share = |x: DVec2| (x - from).dot(to - from) / (to - from).length_squared();
            let over = part.map(|x| heights.side * frame.height(a.lerp(b, share(x))));
            heights.mark([from, to], part, over, &mut mark);
        }
    }
    // Its own edges, wherever something lies over them.
    for t in level {
        let its = t.map(|x| frame.project(x));
        for k in (0..3).filter(|&k| open[k]) {
            if let Some(part) = clip(corners[k], corners[(k + 1) % 3], &its, heights.touching) {
                let over = part.map(|x| {
                    let w = barycentric(&its, x);
                    heights.side * frame.height(w.x * t[0] + w.y * t[1] + w.z * t[2])
                });
                heights.mark(part, part, over, &mut mark);
            }
        }
    }
}
