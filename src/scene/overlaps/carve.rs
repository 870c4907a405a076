//! Takes away from a triangle what covers it.
//!
//! The parts are the leaves of a tree: each cut divides a convex part in two along the line of an
//! edge of a covering triangle. In the end, parts that came from one and fared alike are one again.

use super::super::Triangle;
use super::outline::{Outline, outlines};
use super::pairs::Plate;
use crate::geometry::convex::{self, Corner};
use glam::{DVec2, DVec3};

/// The side from which the corners of a triangle run counter-clockwise.
pub(super) const FRONT: u8 = 1;
/// Its other side.
pub(super) const BACK: u8 = 2;

/// Most convex parts of one triangle: far more than floors have under what lies on them (letters on
/// a plate are about as many as their corners), and each becomes an element or several.
pub(super) const MOST_PARTS: usize = 2048;

/// Parts less high than this share of the contact distance are dropped, and leave a slit of that
/// width: 1e-8 of the scene. Cuts begin and end at corners that are nearer than the contact
/// distance, so that such parts come up in sharp corners only.
const SLIVER: f64 = 1.0 / 64.0;

/// What another triangle does to one that it overlaps: sets of the sides of the latter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cover {
    /// The number of the other one.
    pub by: u32,
    /// Sides that it covers with a radiating one.
    pub lost: u8,
    /// Sides that it covers with its black back, where they are not spared.
    pub dark: u8,
    /// Sides that face as the only one of the other does. There a plate of two one-sided triangles
    /// has a face, not a black back.
    pub spared: u8,
}

/// A part of a triangle that is still there, as a triangle.
pub(super) struct Part {
    corners: [Corner; 3],
    /// The sides that it still has.
    pub sides: u8,
}

impl Part {
    /// Whether it is all of a triangle that had `sides`.
    pub fn is_whole(&self, sides: u8) -> bool {
        self.sides == sides && self.corners.iter().all(|c| c.weights.max_element() == 1.0)
    }

    /// The part of `whole` that it is.
    pub fn of(&self, whole: &Triangle) -> Triangle {
        let colour = |c: &Corner| c.weights.to_array().into_iter().zip(whole.colour);
        let at = |set: &[DVec2; 3], c: &Corner| {
            let w = c.weights;
            w.x * set[0] + w.y * set[1] + w.z * set[2]
        };
        Triangle {
            vertices: self.corners.map(|c| c.x),
            uv: whole.uv.map(|set| self.corners.map(|c| at(&set, &c))),
            colour: self.corners.map(|c| colour(&c).map(|(w, x)| w * x).sum::<DVec3>()),
            ..*whole
        }
    }
}

struct Node {
    corners: Vec<Corner>,
    sides: u8,
    spared: u8,
    halves: Option<[usize; 2]>,
}

/// What is left of a triangle with `sides` that others cover; `None` when that is too many parts.
pub(super) fn carve(
    triangle: &[DVec3; 3],
    sides: u8,
    covers: &[Cover],
    plates: &[Option<Plate>],
    tolerance: f64,
) -> Option<Vec<Part>> {
    let root = Node { corners: convex::whole(triangle), sides, spared: 0, halves: None };
    let mut tree = Tree { nodes: vec![root], leaves: vec![0], tolerance };
    let [a, b, c] = *triangle;
    let normal = (b - a).cross(c - a).normalize_or_zero();
    // What does the same is taken together.
    let alike = |what: &dyn Fn(&Cover) -> u8| -> Vec<(u8, Vec<Outline>)> {
        let of = |sides: u8| {
            let its = covers.iter().filter(|c| what(c) == sides);
            let its = its.filter_map(|c| plates[c.by as usize].as_ref().map(|p| p.corners));
            (sides, outlines(&its.collect::<Vec<_>>(), normal, tolerance))
        };
        [FRONT, BACK, FRONT | BACK].into_iter().map(of).collect()
    };
    let dark = alike(&|c| c.dark);
    // What is spared must be known before it gets dark.
    if dark.iter().any(|(_, outlines)| !outlines.is_empty()) {
        for (sides, outlines) in alike(&|c| c.spared) {
            tree.cover(&outlines, sides, |n| n.spared |= sides)?;
        }
    }
    for (sides, outlines) in alike(&|c| c.lost) {
        tree.cover(&outlines, sides, |n| n.sides &= !sides)?;
    }
    for (sides, outlines) in dark {
        tree.cover(&outlines, sides, |n| n.sides &= !(sides & !n.spared))?;
    }
    Some(tree.parts())
}

struct Tree {
    nodes: Vec<Node>,
    leaves: Vec<usize>,
    tolerance: f64,
}

impl Tree {
    /// Cuts the leaves that have any of `sides` along `outlines`, and does something with those
    /// inside of them. `None` when there are too many leaves.
    fn cover(
        &mut self,
        outlines: &[Outline],
        sides: u8,
        mut inside: impl FnMut(&mut Node),
    ) -> Option<()> {
        outlines.iter().try_for_each(|outline| self.cover_one(outline, sides, &mut inside))
    }

    fn cover_one(
        &mut self,
        outline: &Outline,
        sides: u8,
        inside: &mut impl FnMut(&mut Node),
    ) -> Option<()> {
        for place in 0..self.leaves.len() {
            let leaf = self.leaves[place];
            if self.nodes[leaf].sides & sides == 0 {
                continue;
            }
            let on = self.tolerance;
            let corners = &self.nodes[leaf].corners;
            let beside = |k: usize| corners.iter().all(|c| outline.inside(k, c.x) <= on);
            if (0..outline.edges()).any(beside) {
                continue;
            }
            let mut rest = corners.clone();
            let mut cuts = vec![];
            for k in 0..outline.edges() {
                let [within, outside] = convex::split(&rest, |x| outline.inside(k, x), on);
                if !outside.is_empty() {
                    rest = within;
                    cuts.push([rest.clone(), outside]);
                }
            }
            if rest.is_empty() {
                continue;
            }
            let mut last = leaf;
            for halves in cuts {
                let Node { sides, spared, .. } = self.nodes[last];
                let first = self.nodes.len();
                let node = |corners| Node { corners, sides, spared, halves: None };
                self.nodes.extend(halves.map(node));
                self.nodes[last].halves = Some([first, first + 1]);
                self.leaves.push(first + 1);
                last = first;
            }
            self.leaves[place] = last;
            inside(&mut self.nodes[last]);
        }
        // What has no side left is cut no more.
        let Tree { nodes, leaves, .. } = self;
        leaves.retain(|&leaf| nodes[leaf].sides != 0);
        (leaves.len() <= MOST_PARTS).then_some(())
    }

    fn parts(mut self) -> Vec<Part> {
        // Halves come after what they are halves of.
        for i in (0..self.nodes.len()).rev() {
            if let Some([a, b]) = self.nodes[i].halves
                && self.nodes[a].halves.is_none()
                && self.nodes[b].halves.is_none()
                && self.nodes[a].sides == self.nodes[b].sides
            {
                self.nodes[i].sides = self.nodes[a].sides;
                self.nodes[i].halves = None;
            }
        }
        let least = SLIVER * self.tolerance;
        let mut parts = vec![];
        let mut stack = vec![0];
        while let Some(i) = stack.pop() {
            let node = &self.nodes[i];
            if let Some([a, b]) = node.halves {
                stack.extend([b, a]);
                continue;
            }
            if node.sides == 0 {
                continue;
            }
            for t in convex::triangulate(&node.corners) {
                let corners = t.map(|k| node.corners[k]);
                let x = corners.map(|c| c.x);
                // The triangle itself is never dropped, however thin it is.
                if convex::height(&x) > least || i == 0 {
                    parts.push(Part { corners, sides: node.sides });
                }
            }
        }
        parts
    }
}
