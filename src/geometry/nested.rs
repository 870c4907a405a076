//! Trees over boxes that lie inside of each other.
//!
//! The usual builder merges neighbours that both find each other the nearest. Of thousands of boxes of
//! growing size around one place each finds the next smaller one the nearest, and only the two smallest
//! agree: one merge a pass, n passes over n boxes, and a tree as deep as n. [`merges_slowly`] tells such
//! lists by doing the same merges on paper until they have cost too much; [`halved`] builds a tree for
//! them by halving, of depth log n, in O(n log^2 n) whatever the boxes.

use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

/// Fewer boxes than this take at most about a second, however they lie.
const FEW: usize = 4096;

/// Neighbours on each side that are looked at, in the order of a space-filling curve: as many as the
/// usual builder looks at.
const WINDOW: usize = 14;

/// The first passes look only at the next ones.
const NARROW_PASSES: usize = 3;

/// Passes over the whole list that merging may take. Boxes of ordinary scenes take 3 to 4 in all,
/// since each pass leaves some two thirds of them; nested ones take thousands.
const PASSES: usize = 40;

/// Boxes in a leaf, at most.
const LEAF: usize = 4;

/// Whether merging neighbours would take far more passes than it usually does.
pub(super) fn merges_slowly(boxes: &[Aabb]) -> bool {
    if boxes.len() < FEW {
        return false;
    }
    let mut current = along_curve(boxes);
    let (mut work, mut pass) = (0, 0);
    while current.len() >= FEW {
        work += current.len();
        if work > PASSES * boxes.len() {
            return true;
        }
        let window = if pass < NARROW_PASSES { 1 } else { WINDOW };
        pass += 1;
        let nearest: Vec<usize> =
            (0..current.len()).map(|i| nearest(&current, i, window)).collect();
        current = (0..current.len())
            .filter_map(|i| {
                let other = nearest[i];
                match nearest[other] == i {
                    // Of a pair the second stands for both.
                    true if other > i => None,
                    true => Some(current[i].union(&current[other])),
                    false => Some(current[i]),
                }
            })
            .collect();
    }
    false
}

/// Of the neighbours in the window the one whose union with box i is smallest; of equal ones the last.
fn nearest(boxes: &[Aabb], i: usize, window: usize) -> usize {
    let mut best = (f32::INFINITY, i);
    for j in i.saturating_sub(window)..(i + window + 1).min(boxes.len()) {
        let area = boxes[i].union(&boxes[j]).half_area();
        if j != i && area <= best.0 {
            best = (area, j);
        }
    }
    best.1
}

/// The boxes in the order of their centres along a Z-shaped curve, equal ones as they came.
fn along_curve(boxes: &[Aabb]) -> Vec<Aabb> {
    let all = boxes.iter().fold(Aabb::empty(), |a, b| a.union(b));
    let size = all.diagonal().max(Vec3A::splat(f32::MIN_POSITIVE));
    let code = |b: &Aabb| {
        let place = ((b.center() - all.min) / size * 1_048_576.0).to_array();
        (0..20).rev().fold(0u64, |code, bit| {
            // Conversion from float saturates.
            place.iter().fold(code, |code, x| code << 1 | u64::from((*x as u32) >> bit & 1))
        })
    };
    let mut order: Vec<(u64, usize)> = boxes.iter().map(code).zip(0..).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, i)| boxes[i]).collect()
}

/// A tree made by halving lists, by place or by size as costs less.
pub(super) fn halved(boxes: &[Aabb]) -> Bvh2 {
    let mut tree = Bvh2 { primitive_indices: (0..boxes.len() as u32).collect(), ..Bvh2::default() };
    tree.nodes.push(Bvh2Node::default());
    // Node, and the part of the list below it.
    let mut open = vec![(0, 0..boxes.len())];
    while let Some((node, range)) = open.pop() {
        let items = &mut tree.primitive_indices[range.clone()];
        let around = union(boxes, items);
        if items.len() <= LEAF {
            tree.nodes[node] = Bvh2Node::new(around, items.len() as u32, range.start as u32);
            continue;
        }
        halve(boxes, items);
        let middle = range.start + items.len() / 2;
        let first = tree.nodes.len();
        tree.nodes[node] = Bvh2Node::new(around, 0, first as u32);
        tree.nodes.extend([Bvh2Node::default(), Bvh2Node::default()]);
        open.push((first, range.start..middle));
        open.push((first + 1, middle..range.end));
    }
    tree
}

fn union(boxes: &[Aabb], items: &[u32]) -> Aabb {
    items.iter().fold(Aabb::empty(), |a, &i| a.union(&boxes[i as usize]))
}

/// Orders a list so that its halves have small boxes: along one of the axes, or the small boxes
/// before the large ones.
fn halve(boxes: &[Aabb], items: &mut [u32]) {
    let key = |way: usize, i: u32| match way {
        3 => boxes[i as usize].half_area(),
        axis => boxes[i as usize].center()[axis],
    };
    // Of equal keys the lower number comes first: the tree is the same in every run.
    let order = |items: &mut [u32], way: usize| {
        let middle = items.len() / 2;
        items.select_nth_unstable_by(middle, |&a, &b| {
            key(way, a).total_cmp(&key(way, b)).then(a.cmp(&b))
        });
    };
    let mut best = (f32::INFINITY, 0);
    for way in 0..4 {
        order(items, way);
        let (low, high) = items.split_at(items.len() / 2);
        // The halves are equally long, so that areas alone count.
        let cost = union(boxes, low).half_area() + union(boxes, high).half_area();
        if cost < best.0 {
            best = (cost, way);
        }
    }
    order(items, best.1);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(centre: Vec3A, half: f32) -> Aabb {
        Aabb { min: centre - half, max: centre + half }
    }

    /// A grid of small boxes.
    fn grid(side: u32) -> Vec<Aabb> {
        let place = |i: u32| {
            Vec3A::new((i % side) as f32, (i / side % side) as f32, (i / side / side) as f32)
        };
        (0..side.pow(3)).map(|i| cube(place(i), 0.4)).collect()
    }

    fn concentric(count: usize) -> Vec<Aabb> {
        (1..=count).map(|i| cube(Vec3A::ONE, i as f32)).collect()
    }

    /// Boxes that share a corner and grow.
    fn fan(count: usize) -> Vec<Aabb> {
        (1..=count).map(|i| Aabb { min: Vec3A::ZERO, max: Vec3A::splat(i as f32) }).collect()
    }

    #[test]
    fn nested_boxes_are_told_from_others() {
        assert!(merges_slowly(&concentric(6000)));
        assert!(merges_slowly(&fan(6000)));
        assert!(!merges_slowly(&grid(20)));
        // All the same, and too few to matter.
        assert!(!merges_slowly(&concentric(1000)));
        // A part of a scene is enough.
        let mixed = [grid(16), concentric(20_000)].concat();
        assert!(merges_slowly(&mixed));
    }

    #[test]
    fn halved_trees_are_shallow_and_hold_everything_once() {
        for boxes in [concentric(5000), fan(777), grid(9), vec![cube(Vec3A::ZERO, 1.0); 999]] {
            let tree = halved(&boxes);
            let mut seen = vec![0; boxes.len()];
            let mut open = vec![(0, 0)];
            while let Some((index, depth)) = open.pop() {
                let node = &tree.nodes[index];
                assert!(depth < 20, "{depth}");
                let first = node.first_index as usize;
                if node.is_leaf() {
                    for &i in &tree.primitive_indices[first..first + node.prim_count as usize] {
                        seen[i as usize] += 1;
                        assert_eq!(node.aabb.union(&boxes[i as usize]), node.aabb);
                    }
                    continue;
                }
                for child in [first, first + 1] {
                    assert_eq!(node.aabb.union(&tree.nodes[child].aabb), node.aabb);
                    open.push((child, depth + 1));
                }
            }
            assert!(seen.iter().all(|&n| n == 1));
        }
    }
}
