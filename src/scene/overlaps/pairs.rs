//! Pairs of triangles that overlap in one plane.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use crate::geometry::{Bounds, BoxTree, Frame, convex};

/// Largest sine of the angle between planes that count as one. Triangles are larger than the
/// contact distance by far, or not by far and then noisy; both are within that distance of each
/// other all over their common part, which decides. This only keeps steep ones out.
const STEEP: f64 = 0.1;

/// A triangle with what is asked of it again and again.
pub(super) struct Plate {
    pub corners: [DVec3; 3],
    /// Unit normal on the front.
    pub normal: DVec3,
    /// Unit normals of the edges k to k + 1 in the plane, inward.
    pub inward: [DVec3; 3],
    pub area: f64,
}

impl Plate {
    /// `None` for a triangle without area.
    pub fn new(corners: &[DVec3; 3]) -> Option<Plate> {
        let normal = Frame::of_triangle(corners)?.n;
        let edges = [0, 1, 2].map(|k| (corners[(k + 1) % 3] - corners[k]).normalize_or_zero());
        let inward = edges.map(|e| normal.cross(e));
        let double = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
        Some(Plate { corners: *corners, normal, inward, area: 0.5 * double })
    }

    /// Distance of `x` from the line of edge `k`, positive on the side of the triangle.
    pub fn inside(&self, k: usize, x: DVec3) -> f64 {
        (x - self.corners[k]).dot(self.inward[k])
    }

    fn height(&self, x: DVec3) -> f64 {
        (x - self.corners[0]).dot(self.normal)
    }

    /// Whether all of `corners` are beyond one edge, or reach across it by `tolerance` at most.
    fn is_beside(&self, corners: &[DVec3; 3], tolerance: f64) -> bool {
        (0..3).any(|k| corners.iter().all(|&x| self.inside(k, x) <= tolerance))
    }
}

/// Two triangles that overlap in one plane with sides that face the same way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    /// The first of them.
    pub a: u32,
    /// The second, later in the scene.
    pub b: u32,
    /// Whether their fronts face the same way.
    pub same: bool,
    /// Least height of b over a, along the normal of a.
    pub low: f64,
    /// Greatest height.
    pub high: f64,
}

/// All pairs, in order; `None` when there are more than `most`.
pub(super) fn find(
    plates: &[Option<Plate>],
    two_sided: &[bool],
    tolerance: f64,
    most: usize,
) -> Option<Vec<Pair>> {
    let boxes: Vec<Bounds> = plates
        .iter()
        .map(|p| p.as_ref().map_or(Bounds::EMPTY, |p| Bounds::of(&p.corners)))
        .collect();
    // Triangles without area have no place in the tree.
    let flat: Vec<usize> = (0..plates.len()).filter(|&i| plates[i].is_some()).collect();
    let tree = BoxTree::build(&flat.iter().map(|&i| boxes[i]).collect::<Vec<_>>());
    // Whether there are too many does not depend on the order of counting.
    let count = AtomicUsize::new(0);
    let found: Vec<Vec<Pair>> = flat
        .par_iter()
        .map(|&i| {
            let mut pairs = vec![];
            let Some(a) = plates[i].as_ref().filter(|_| count.load(Ordering::Relaxed) <= most)
            else {
                return pairs;
            };
            let near = boxes[i].grown(tolerance);
            let mut others = vec![];
            // A large triangle's box holds much that its plane does not meet.
            let level = a.corners[0].dot(a.normal);
            let meets = |b: Bounds| {
                b.meets(near)
                    && b.support(a.normal) >= level - 2.0 * tolerance
                    && -b.support(-a.normal) <= level + 2.0 * tolerance
            };
            tree.visit(meets, |k| others.push(flat[k]));
            others.retain(|&j| j > i);
            others.sort_unstable();
            for j in others {
                let Some(b) = &plates[j] else { continue };
                let same = a.normal.dot(b.normal) > 0.0;
                if (same || two_sided[i] || two_sided[j])
                    && let Some((low, high)) = overlap(a, b, tolerance)
                {
                    pairs.push(Pair { a: i as u32, b: j as u32, same, low, high });
                    if count.fetch_add(1, Ordering::Relaxed) >= most {
                        break;
                    }
                }
            }
            pairs
        })
        .collect();
    let pairs: Vec<Pair> = found.into_iter().flatten().collect();
    (pairs.len() <= most).then_some(pairs)
}

/// Least and greatest height of `b` over `a` along the normal of `a`, when they have a part in
/// common that is wider than `tolerance` and in which they are no farther apart than that.
fn overlap(a: &Plate, b: &Plate, tolerance: f64) -> Option<(f64, f64)> {
    if a.normal.cross(b.normal).length() > STEEP
        || a.is_beside(&b.corners, tolerance)
        || b.is_beside(&a.corners, tolerance)
    {
        return None;
    }
    // The larger one's plane is known better.
    let (base, other) = if b.area > a.area { (b, a) } else { (a, b) };
    let mut part = convex::whole(&other.corners);
    for k in 0..3 {
        let [inside, _] = convex::split(&part, |x| base.inside(k, x), 0.0);
        part = inside;
    }
    let (first, rest) = part.split_first()?;
    let double: f64 =
        rest.windows(2).map(|w| (w[0].x - first.x).cross(w[1].x - first.x).length()).sum();
    let apart = |x: DVec3| part.iter().map(|c| c.x.distance(x)).fold(0.0, f64::max);
    let longest = part.iter().map(|c| apart(c.x)).fold(0.0, f64::max);
    if double <= tolerance * longest {
        return None;
    }
    let heights = part.iter().map(|c| base.height(c.x));
    let (low, high) = heights
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| (h.min(low), h.max(high)));
    if low < -tolerance || high > tolerance {
        return None;
    }
    let upright = b.area <= a.area || a.normal.dot(b.normal) < 0.0;
    Some(if upright { (low, high) } else { (-high, -low) })
}
