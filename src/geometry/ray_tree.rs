//! The nearest triangle along a ray, for very many rays.
//!
//! Boxes are met in f32, padded so that none is missed; triangles decide in f64
//! ([`super::ray::intersect`]), so that a closed surface has no leaks.

use glam::{DVec3, Vec3A};

use super::box_tree::BoxTree;
use super::{Bounds, ray};

/// Padding of boxes in a scene scaled to the cube from -1 to 1: roundings of a ray's origin in f32,
/// and of differences from it.
const PADDING: f32 = 3e-7;

/// Distances to two sides of a box are compared with this much room for roundings, relative.
const ROOM: f32 = 1.0 + 1e-6;

/// Distances are the same if they differ by less than this, relative.
const SAME: f64 = 1e-12;

/// Triangles in the order of the leaves of a tree of boxes.
pub struct RayTree {
    nodes: Vec<Node>,
    triangles: Vec<[DVec3; 3]>,
    /// Numbers that the triangles came with, and whether front and back are preferred.
    numbers: Vec<u32>,
    preferred: Vec<[bool; 2]>,
    centre: DVec3,
    scale: f64,
}

/// A box, and two nodes or some triangles in it.
struct Node {
    min: Vec3A,
    max: Vec3A,
    /// The first of two children next to each other, or the first triangle.
    first: u32,
    /// How many triangles; none for a node with children.
    count: u32,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Distance in units of the direction.
    pub t: f64,
    /// Number of the triangle.
    pub triangle: u32,
    /// Whether its back was met: the side from which its corners run clockwise.
    pub back: bool,
}

impl RayTree {
    /// Of triangles, known by their index. Of coincident sides, one that is `preferred` (number,
    /// back) is met.
    pub fn build(triangles: &[[DVec3; 3]], preferred: impl Fn(usize, bool) -> bool) -> RayTree {
        let boxes: Vec<Bounds> = triangles.iter().map(Bounds::of).collect();
        let tree = BoxTree::build(&boxes);
        let mut ordered = RayTree {
            nodes: vec![],
            triangles: vec![],
            numbers: vec![],
            preferred: vec![],
            centre: tree.centre,
            scale: tree.scale,
        };
        for node in &tree.tree.nodes {
            let (mut first, mut count) = (node.first_index, 0);
            if node.is_leaf() {
                let begin = node.first_index as usize;
                (first, count) = (ordered.numbers.len() as u32, node.prim_count);
                for &number in &tree.tree.primitive_indices[begin..begin + count as usize] {
                    let own = [false, true].map(|back| preferred(number as usize, back));
                    ordered.numbers.push(number);
                    ordered.preferred.push(own);
                    ordered.triangles.push(triangles[number as usize]);
                }
            }
            let (min, max) = (node.aabb.min - PADDING, node.aabb.max + PADDING);
            ordered.nodes.push(Node { min, max, first, count });
        }
        ordered
    }

    /// The nearest triangle beyond the distance `beyond`, both in units of `direction`.
    ///
    /// The origin must lie in the scene's box or near it. Of triangles at one distance (but for
    /// roundings) a preferred side is met, then the one with the lowest number.
    pub fn nearest(
        &self,
        origin: DVec3,
        direction: DVec3,
        beyond: f64,
        stack: &mut Vec<(u32, f32)>,
    ) -> Option<RayHit> {
        let mut best: Option<(RayHit, bool)> = None;
        if self.nodes.is_empty() {
            return None;
        }
        let start = Vec3A::from(((origin - self.centre) / self.scale).as_vec3());
        // Nothing is divided by zero: a ray along a side of a box meets it.
        let tiny = |d: f64| {
            let d = (d / self.scale) as f32;
            if d.abs() < 1e-30 { 1e30f32.copysign(d) } else { d.recip() }
        };
        let inverse = Vec3A::new(tiny(direction.x), tiny(direction.y), tiny(direction.z));
        let enter = |node: &Node, end: f32| {
            let (a, b) = ((node.min - start) * inverse, (node.max - start) * inverse);
            let near = a.min(b).max_element().max(0.0);
            let far = a.max(b).min_element().min(end);
            (near <= far * ROOM).then_some(near)
        };
        let mut end = f32::INFINITY;
        stack.clear();
        if enter(&self.nodes[0], end).is_some() {
            stack.push((0, 0.0));
        }
        while let Some((index, near)) = stack.pop() {
            if near > end * ROOM {
                continue;
            }
            let mut node = &self.nodes[index as usize];
            while node.count == 0 {
                let pair = [node.first, node.first + 1];
                let [a, b] = pair.map(|i| enter(&self.nodes[i as usize], end));
                let (next, other) = match (a, b) {
                    (Some(a), Some(b)) if a <= b => (pair[0], Some((pair[1], b))),
                    (Some(a), Some(_)) => (pair[1], Some((pair[0], a))),
                    (Some(_), None) => (pair[0], None),
                    (None, Some(_)) => (pair[1], None),
                    (None, None) => break,
                };
                stack.extend(other);
                node = &self.nodes[next as usize];
            }
            for i in node.first as usize..(node.first + node.count) as usize {
                let triangle = &self.triangles[i];
                let Some(hit) = ray::intersect(origin, direction, triangle) else { continue };
                if hit.t <= beyond {
                    continue;
                }
                let [a, b, c] = *triangle;
                let back = direction.dot((b - a).cross(c - a)) > 0.0;
                let (number, preferred) = (self.numbers[i], self.preferred[i][usize::from(back)]);
                let wins = best.is_none_or(|(other, liked)| {
                    if (hit.t - other.t).abs() <= SAME * other.t {
                        (!preferred, number) < (!liked, other.triangle)
                    } else {
                        hit.t < other.t
                    }
                });
                if wins {
                    best = Some((RayHit { t: hit.t, triangle: number, back }, preferred));
                    end = (hit.t as f32).next_up();
                }
            }
        }
        best.map(|(hit, _)| hit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points that a simple recurrence scatters.
    fn scattered(count: usize) -> impl Iterator<Item = DVec3> {
        let mut x = 0.5f64;
        let mut next = move || {
            x = (x * 997.0 + 0.618_033_988_749).fract();
            x
        };
        (0..count).map(move |_| DVec3::new(next(), next(), next()))
    }

    #[test]
    fn the_nearest_is_found() {
        for scale in [1e-6, 1.0, 1e6] {
            let points: Vec<DVec3> = scattered(900).map(|p| scale * p).collect();
            let triangles: Vec<[DVec3; 3]> = points
                .as_chunks::<3>()
                .0
                .iter()
                .map(|t| [t[0], t[0] + 0.1 * (t[1] - t[0]), t[0] + 0.1 * (t[2] - t[0])])
                .collect();
            let tree = RayTree::build(&triangles, |_, _| true);
            let mut stack = vec![];
            let mut hits = 0;
            for (origin, to) in scattered(500).zip(scattered(700).skip(200)) {
                let (origin, direction) = (scale * origin, to - DVec3::splat(0.5));
                let hit = tree.nearest(origin, direction, 0.0, &mut stack);
                let want = (0..triangles.len())
                    .filter_map(|i| Some((ray::intersect(origin, direction, &triangles[i])?.t, i)))
                    .filter(|(t, _)| *t > 0.0)
                    .min_by(|a, b| a.0.total_cmp(&b.0));
                assert_eq!(hit.map(|h| (h.t, h.triangle as usize)), want);
                hits += usize::from(hit.is_some());
            }
            assert!(hits > 50, "{hits}");
        }
    }

    #[test]
    fn a_closed_box_has_no_leaks() {
        let p = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64);
        let faces =
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let triangles: Vec<[DVec3; 3]> = faces
            .iter()
            .flat_map(|f| [[p(f[0]), p(f[1]), p(f[2])], [p(f[0]), p(f[2]), p(f[3])]])
            .collect();
        let tree = RayTree::build(&triangles, |_, _| true);
        let mut stack = vec![];
        // Through corners, edges, diagonals and elsewhere.
        let origin = DVec3::new(0.5, 0.25, 0.75);
        for to in
            (0..8).map(p).chain((0..64).map(|k| p(k % 8).midpoint(p(k / 8)))).chain(scattered(2000))
        {
            let on_box = to - DVec3::splat(0.5);
            let to = DVec3::splat(0.5) + 0.5 * on_box / on_box.abs().max_element().max(1e-3);
            assert!(tree.nearest(origin, to - origin, 0.0, &mut stack).is_some(), "{to}");
        }
    }
}
