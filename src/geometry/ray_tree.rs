//! The nearest triangle along a ray, for very many rays.
//!
//! Boxes are met in f32, padded so that none is missed, and so are triangles, four at once
//! ([`super::triangle_packs`]); of those that may be met each decides in f64
//! ([`super::ray::intersect`]), so that a closed surface has no leaks.

use std::ops::Range;

use glam::{DVec3, Vec4};
use obvhs::bvh2::node::Bvh2Node;

use super::box_tree::BoxTree;
use super::triangle_packs::{PACK, Pack, Sheared};
use super::{Bounds, ray};

/// Padding of boxes in a scene scaled to the cube from -1 to 1: roundings of a ray's origin in f32,
/// and of differences from it.
const PADDING: f32 = 3e-7;

/// Distances to two sides of a box are compared with this much room for roundings, relative.
const ROOM: f32 = 1.0 + 1e-6;

/// Distances are the same if they differ by less than this, relative.
const SAME: f64 = 1e-12;

/// Children of a node.
const WIDTH: usize = 4;

/// Triangles in the order of the leaves of a tree of boxes.
pub struct RayTree {
    /// The root first; none where there are no triangles.
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    triangles: Vec<[DVec3; 3]>,
    /// Those of each leaf in f32.
    packs: Vec<Pack>,
    /// Numbers that the triangles came with, and whether front and back are preferred.
    numbers: Vec<u32>,
    preferred: Vec<[bool; 2]>,
    centre: DVec3,
    scale: f64,
}

/// Up to four boxes, and what is in them.
#[derive(Clone, Copy)]
struct Node {
    /// Least, then largest coordinates: by axis those of all boxes.
    sides: [[Vec4; 3]; 2],
    /// Numbers of nodes, or of leaves with [`LEAF`] added.
    children: [u32; WIDTH],
    /// A bit for each box that is there.
    there: u32,
}

const LEAF: u32 = 1 << 31;

/// Triangles and packs of a leaf.
#[derive(Clone, Copy)]
struct Leaf {
    /// Its first triangle.
    first: u32,
    /// Its first pack, and how many it has.
    pack: u32,
    packs: u32,
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
        let tree = BoxTree::build_well(&boxes);
        let mut own = RayTree {
            nodes: vec![],
            leaves: vec![],
            triangles: vec![],
            packs: vec![],
            numbers: vec![],
            preferred: vec![],
            centre: tree.centre,
            scale: tree.scale,
        };
        // Nodes of the tree of pairs, and where their numbers go.
        let mut left: Vec<(&Bvh2Node, Option<(usize, usize)>)> = vec![];
        left.extend(tree.tree.nodes.first().map(|root| (root, None)));
        while let Some((node, place)) = left.pop() {
            let number = own.nodes.len();
            if let Some((above, k)) = place {
                own.nodes[above].children[k] = number as u32;
            }
            let below = opened(&tree, node);
            own.nodes.push(Node {
                sides: [[Vec4::ZERO; 3]; 2],
                children: [0; WIDTH],
                there: (1 << below.len()) - 1,
            });
            for (k, &child) in below.iter().enumerate() {
                let (min, max) = (child.aabb.min - PADDING, child.aabb.max + PADDING);
                let sides = &mut own.nodes[number].sides;
                for axis in 0..3 {
                    sides[0][axis][k] = min[axis];
                    sides[1][axis][k] = max[axis];
                }
                if child.is_leaf() {
                    own.nodes[number].children[k] = LEAF + own.leaves.len() as u32;
                    own.add_leaf(&tree, child, triangles, &preferred);
                }
            }
            let inner = below.iter().enumerate().filter(|(_, child)| !child.is_leaf());
            left.extend(inner.rev().map(|(k, child)| (*child, Some((number, k)))));
        }
        own
    }

    fn add_leaf(
        &mut self,
        tree: &BoxTree,
        leaf: &Bvh2Node,
        triangles: &[[DVec3; 3]],
        preferred: &impl Fn(usize, bool) -> bool,
    ) {
        let (first, begin) = (self.numbers.len() as u32, leaf.first_index as usize);
        for &number in &tree.tree.primitive_indices[begin..begin + leaf.prim_count as usize] {
            self.numbers.push(number);
            self.preferred.push([false, true].map(|back| preferred(number as usize, back)));
            self.triangles.push(triangles[number as usize]);
        }
        let (centre, scale) = (self.centre, self.scale);
        let own = self.triangles[first as usize..].iter();
        let scaled: Vec<[DVec3; 3]> = own.map(|t| t.map(|x| (x - centre) / scale)).collect();
        let pack = self.packs.len() as u32;
        self.packs.extend(scaled.chunks(PACK).map(Pack::new));
        self.leaves.push(Leaf { first, pack, packs: self.packs.len() as u32 - pack });
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
        let line = Line::new(self, origin, direction);
        self.visit(&line, f32::INFINITY, stack, |i, end| {
            let triangle = &self.triangles[i];
            let Some(hit) = ray::intersect(origin, direction, triangle) else { return Some(end) };
            if hit.t <= beyond {
                return Some(end);
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
            if !wins {
                return Some(end);
            }
            best = Some((RayHit { t: hit.t, triangle: number, back }, preferred));
            Some((hit.t as f32).next_up())
        });
        best.map(|(hit, _)| hit)
    }

    /// Whether any triangle is met within a range of distances, in units of `direction`; ends not
    /// included.
    pub fn is_blocked(
        &self,
        origin: DVec3,
        direction: DVec3,
        range: Range<f64>,
        stack: &mut Vec<(u32, f32)>,
    ) -> bool {
        let line = Line::new(self, origin, direction);
        let mut blocked = false;
        self.visit(&line, (range.end as f32).next_up(), stack, |i, end| {
            let hit = ray::intersect(origin, direction, &self.triangles[i]);
            blocked = hit.is_some_and(|hit| hit.t > range.start && hit.t < range.end);
            (!blocked).then_some(end)
        });
        blocked
    }

    /// Calls `may_meet` with the triangles that a line may meet before `end`, nearer ones
    /// mostly first; it returns where the line ends from then on, or nothing to stop.
    fn visit(
        &self,
        line: &Line,
        mut end: f32,
        stack: &mut Vec<(u32, f32)>,
        mut may_meet: impl FnMut(usize, f32) -> Option<f32>,
    ) {
        stack.clear();
        if self.nodes.is_empty() {
            return;
        }
        let mut index = 0;
        loop {
            if index < LEAF {
                let node = &self.nodes[index as usize];
                let (near, mut met) = line.enter(node, end);
                if met != 0 {
                    // Goes on with the nearest; the others wait, nearer ones on top.
                    let mut nearest = met.trailing_zeros() as usize;
                    met &= met - 1;
                    let begin = stack.len();
                    while met != 0 {
                        let mut k = met.trailing_zeros() as usize;
                        met &= met - 1;
                        if near[k] < near[nearest] {
                            std::mem::swap(&mut k, &mut nearest);
                        }
                        let mut place = stack.len();
                        stack.push((node.children[k], near[k]));
                        while place > begin && stack[place - 1].1 < near[k] {
                            stack.swap(place, place - 1);
                            place -= 1;
                        }
                    }
                    index = node.children[nearest];
                    continue;
                }
            } else {
                let leaf = self.leaves[(index - LEAF) as usize];
                let packs = &self.packs[leaf.pack as usize..][..leaf.packs as usize];
                let mut begin = leaf.first as usize;
                for pack in packs {
                    let mut met = line.sheared.may_meet(pack, end * ROOM);
                    while met != 0 {
                        let i = begin + met.trailing_zeros() as usize;
                        met &= met - 1;
                        match may_meet(i, end) {
                            Some(nearer) => end = nearer,
                            None => return,
                        }
                    }
                    begin += PACK;
                }
            }
            index = loop {
                match stack.pop() {
                    None => return,
                    Some((_, near)) if near > end * ROOM => continue,
                    Some((waiting, _)) => break waiting,
                }
            };
        }
    }
}

/// A ray as boxes are met by it.
struct Line {
    start: [Vec4; 3],
    inverse: [Vec4; 3],
    /// Which side of boxes is met first, by axis.
    first: [usize; 3],
    sheared: Sheared,
}

impl Line {
    fn new(tree: &RayTree, origin: DVec3, direction: DVec3) -> Line {
        // Nothing is divided by zero: a ray along a side of a box meets it.
        let direction = direction / tree.scale;
        let origin = (origin - tree.centre) / tree.scale;
        let inverse = direction
            .as_vec3()
            .to_array()
            .map(|d| if d.abs() < 1e-30 { 1e30f32.copysign(d) } else { d.recip() });
        let start = origin.as_vec3().to_array();
        Line {
            start: start.map(Vec4::splat),
            inverse: inverse.map(Vec4::splat),
            first: inverse.map(|d| usize::from(d < 0.0)),
            sheared: Sheared::new(origin, direction),
        }
    }

    /// Distances at which the boxes of a node are entered, and a bit for each that is before `end`.
    fn enter(&self, node: &Node, end: f32) -> ([f32; WIDTH], u32) {
        let at = |side: usize, axis: usize| {
            (node.sides[side][axis] - self.start[axis]) * self.inverse[axis]
        };
        let [x, y, z] = self.first;
        let near = at(x, 0).max(at(y, 1)).max(at(z, 2)).max(Vec4::ZERO);
        let far = at(1 - x, 0).min(at(1 - y, 1)).min(at(1 - z, 2)).min(Vec4::splat(end));
        let met = near.cmple(far * ROOM).bitmask() & node.there;
        (near.to_array(), met)
    }
}

/// What is below a node: the largest box is opened until there are [`WIDTH`].
fn opened<'a>(tree: &'a BoxTree, node: &'a Bvh2Node) -> Vec<&'a Bvh2Node> {
    let mut boxes = vec![node];
    while boxes.len() < WIDTH {
        let inner = (0..boxes.len()).filter(|&k| !boxes[k].is_leaf());
        let size = |&k: &usize| boxes[k].aabb.half_area();
        let Some(largest) = inner.max_by(|a, b| size(a).total_cmp(&size(b))) else { break };
        let first = boxes[largest].first_index as usize;
        boxes[largest] = &tree.tree.nodes[first];
        boxes.insert(largest + 1, &tree.tree.nodes[first + 1]);
    }
    boxes
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
                let nearest = hit.map_or(1.0, |hit| hit.t);
                let mut blocked = |end| tree.is_blocked(origin, direction, 0.0..end, &mut stack);
                assert!(!blocked(nearest * (1.0 - 1e-9)));
                assert_eq!(blocked(nearest * (1.0 + 1e-9)), hit.is_some());
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
