//! A bounding volume hierarchy that proposes candidates; f64 geometry elsewhere decides.
//!
//! Built by `obvhs` (PLOC with reinsertion) over boxes in f32, rounded outward, of coordinates
//! scaled to the unit cube: no scene is too small, too large or too far away for f32 boxes. Boxes that
//! lie inside of each other by the thousand, which take `obvhs` minutes, have a builder of their own. What a
//! query proposes is a superset of what is asked for; its order depends on the shape of the tree,
//! so callers that need an order must sort.

use std::time::Duration;

use glam::{DVec3, Vec3};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

use super::{Bounds, nested};

/// A hierarchy over a list of boxes.
pub struct BoxTree {
    pub(super) tree: Bvh2,
    pub(super) centre: DVec3,
    pub(super) scale: f64,
}

impl BoxTree {
    /// Builds the tree of `boxes`; items are known by their index.
    pub fn build(boxes: &[Bounds]) -> BoxTree {
        BoxTree::built_as(boxes, BvhBuildParams::medium_build())
    }

    /// The same for very many queries: takes longer to build, and is a twentieth faster.
    pub fn build_well(boxes: &[Bounds]) -> BoxTree {
        // Without cut boxes: items are in one leaf each.
        let how = BvhBuildParams { pre_split: false, ..BvhBuildParams::slow_build() };
        BoxTree::built_as(boxes, how)
    }

    fn built_as(boxes: &[Bounds], how: BvhBuildParams) -> BoxTree {
        let all = boxes.iter().fold(Bounds::EMPTY, |a, &b| a.union(b));
        let (centre, scale) = match 0.5 * all.extent() {
            half if half > 0.0 => (all.centre(), half),
            _ if boxes.is_empty() => (DVec3::ZERO, 1.0),
            _ => (all.centre(), 1.0),
        };
        let down = |x: DVec3| x.as_vec3().to_array().map(|c| c.next_down().next_down());
        let up = |x: DVec3| x.as_vec3().to_array().map(|c| c.next_up().next_up());
        let proposed: Vec<Aabb> = boxes
            .iter()
            .map(|b| {
                let (min, max) = ((b.min - centre) / scale, (b.max - centre) / scale);
                Aabb::new(Vec3::from(down(min)).into(), Vec3::from(up(max)).into())
            })
            .collect();
        let tree = if proposed.is_empty() {
            Bvh2::default()
        } else if nested::merges_slowly(&proposed) {
            nested::halved(&proposed)
        } else {
            build_bvh2(&proposed, how, &mut Duration::default())
        };
        BoxTree { tree, centre, scale }
    }

    /// Calls `found` with the index of every item whose box, and every box above it, `may` accept.
    pub fn visit(&self, mut may: impl FnMut(Bounds) -> bool, mut found: impl FnMut(usize)) {
        if self.tree.nodes.is_empty() {
            return;
        }
        let mut stack = vec![0usize];
        while let Some(index) = stack.pop() {
            let node = &self.tree.nodes[index];
            if !may(self.bounds(&node.aabb)) {
                continue;
            }
            let first = node.first_index as usize;
            if node.is_leaf() {
                for i in first..first + node.prim_count as usize {
                    found(self.tree.primitive_indices[i] as usize);
                }
            } else {
                stack.extend([first + 1, first]);
            }
        }
    }

    /// Calls `hit` with the items whose boxes the ray may meet before `t_max`, near ones first.
    ///
    /// `hit` gets an index and the current end of the ray and returns the new end (smaller after a
    /// nearer hit). Returns the final end.
    pub fn cast(
        &self,
        origin: DVec3,
        direction: DVec3,
        t_max: f64,
        mut hit: impl FnMut(usize, f64) -> f64,
    ) -> f64 {
        let mut end = t_max;
        if self.tree.nodes.is_empty() {
            return end;
        }
        let inverse = direction.recip();
        let enter = |bounds: Bounds, end: f64| {
            // NaN (0 * inf, a ray inside a slab's face) must not reject: f64::max and min drop it.
            let near = (bounds.min - origin) * inverse;
            let far = (bounds.max - origin) * inverse;
            let (mut low, mut high) = (0.0f64, end);
            for k in 0..3 {
                low = low.max(near[k].min(far[k]));
                high = high.min(near[k].max(far[k]));
            }
            // Boxes are rounded outward in f32, far more than these roundings in f64.
            (low <= high).then_some(low)
        };
        let mut stack = Vec::with_capacity(64);
        if let Some(t) = enter(self.bounds(&self.tree.nodes[0].aabb), end) {
            stack.push((0usize, t));
        }
        while let Some((index, t)) = stack.pop() {
            if t > end {
                continue;
            }
            let node = &self.tree.nodes[index];
            let first = node.first_index as usize;
            if node.is_leaf() {
                for i in first..first + node.prim_count as usize {
                    end = hit(self.tree.primitive_indices[i] as usize, end);
                }
                continue;
            }
            let a = enter(self.bounds(&self.tree.nodes[first].aabb), end).map(|t| (first, t));
            let b =
                enter(self.bounds(&self.tree.nodes[first + 1].aabb), end).map(|t| (first + 1, t));
            match (a, b) {
                (Some(a), Some(b)) if a.1 <= b.1 => stack.extend([b, a]),
                (Some(a), Some(b)) => stack.extend([a, b]),
                (one, other) => stack.extend(one.or(other)),
            }
        }
        end
    }

    fn bounds(&self, aabb: &Aabb) -> Bounds {
        Bounds {
            min: self.centre + self.scale * aabb.min.as_dvec3(),
            max: self.centre + self.scale * aabb.max.as_dvec3(),
        }
    }
}
