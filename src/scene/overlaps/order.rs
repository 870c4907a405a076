//! What lies on what: one order of all sides that overlap.
//!
//! Sides are compared by patch: what is decided for one triangle of a rug holds for the others.
//! Comparisons that hold within a tolerance may contradict each other, and then every part of some
//! point could be covered by another one, and a hole be left. So they are only wishes: an order of
//! all patches is made that fulfils them all where that is possible (Kahn 1962), and cutting
//! follows the order.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap, HashMap};

use glam::DVec3;

use super::super::Scene;
use super::carve::{BACK, FRONT};
use super::pairs::{Pair, Plate};

/// Normals that differ by at most this (radians) belong to one patch: a plane whose corners were
/// rounded to f32 stays one.
const FLAT: f64 = 1e-5;

/// Areas of patches that differ by at most this share count as equal: roundings of f32 do not
/// decide which of two equal squares is the smaller.
const AREA: f64 = 1e-6;

/// The place of each side in the order, by triangle and side: greater ones cover lesser ones.
pub(super) fn ranks(
    scene: &Scene,
    plates: &[Option<Plate>],
    two_sided: &[bool],
    pairs: &[Pair],
    rounding: f64,
) -> Box<dyn Fn(u32, u8) -> (u32, u32)> {
    let patch = patches(scene, plates);
    let mut area = vec![0.0; patch.len()];
    for (&p, plate) in patch.iter().zip(plates) {
        area[p as usize] += plate.as_ref().map_or(0.0, |t| t.area);
    }
    let node = |triangle: u32, side: u8| 2 * patch[triangle as usize] + u32::from(side == BACK);
    // Patches are numbered by their first triangle. Objects are numbered in the order of the file,
    // which may not be that of the triangles.
    let in_file = |n: u32| (scene.triangles[n as usize / 2].object, n);

    // Heights of the second patch over the first, all pairs of triangles together.
    let mut heights: BTreeMap<(u32, u32), (f64, f64)> = BTreeMap::new();
    for pair in pairs {
        for side in [FRONT, BACK] {
            let its = if pair.same { side } else { side ^ (FRONT | BACK) };
            let radiates = |i: u32, side: u8| side == FRONT || two_sided[i as usize];
            if !radiates(pair.a, side) || !radiates(pair.b, its) {
                continue;
            }
            let (a, b) = (node(pair.a, side), node(pair.b, its));
            let up = (pair.low, pair.high);
            // Each turn reverses the direction in which heights are taken.
            let (low, high) = if (side == BACK) != (a > b) { (-up.1, -up.0) } else { up };
            let sum = heights.entry((a.min(b), a.max(b))).or_insert((low, high));
            *sum = (sum.0.min(low), sum.1.max(high));
        }
    }
    let mut above: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let mut below: BTreeMap<u32, usize> = BTreeMap::new();
    for (&(a, b), &(low, high)) in heights.iter().filter(|((a, b), _)| a != b) {
        let (of_a, of_b) = (area[a as usize / 2], area[b as usize / 2]);
        let equal = (of_a - of_b).abs() <= AREA * of_a.max(of_b);
        let b_above = if low > rounding {
            true
        } else if high < -rounding {
            false
        } else if equal {
            in_file(b) > in_file(a)
        } else {
            of_b < of_a
        };
        let (low, high) = if b_above { (a, b) } else { (b, a) };
        above.entry(low).or_default().push(high);
        *below.entry(high).or_default() += 1;
        below.entry(low).or_default();
    }
    let order = sorted(above, below, |n| area[n as usize / 2]);
    let place: HashMap<u32, u32> = order.into_iter().zip(0..).collect();
    let patch_of = patch;
    Box::new(move |triangle, side| {
        let node = 2 * patch_of[triangle as usize] + u32::from(side == BACK);
        // Within one patch the later triangle covers the earlier.
        (place.get(&node).copied().unwrap_or(0), triangle)
    })
}

/// A topological order; where there are several, and in circles, larger areas go first, then
/// lower numbers.
fn sorted(
    above: BTreeMap<u32, Vec<u32>>,
    mut below: BTreeMap<u32, usize>,
    area: impl Fn(u32) -> f64,
) -> Vec<u32> {
    // Areas are not negative: their bits are in the order of their values.
    let key = |n: u32| (Reverse(area(n).to_bits()), n);
    let mut left: BTreeSet<_> = below.keys().map(|&n| key(n)).collect();
    let free = below.iter().filter(|(_, count)| **count == 0);
    let mut ready: BinaryHeap<_> = free.map(|(&n, _)| Reverse(key(n))).collect();
    let mut order = vec![];
    while let Some(next) = ready.pop().map(|r| r.0).or_else(|| left.first().copied()) {
        // What was taken out of a circle becomes ready once more.
        if !left.remove(&next) {
            continue;
        }
        order.push(next.1);
        for &n in above.get(&next.1).into_iter().flatten() {
            if let Some(count) = below.get_mut(&n) {
                *count -= 1;
                if *count == 0 {
                    ready.push(Reverse(key(n)));
                }
            }
        }
    }
    order
}

/// The patch of each triangle, by the number of its first triangle: triangles of one object that
/// share edges and have the same normal.
fn patches(scene: &Scene, plates: &[Option<Plate>]) -> Vec<u32> {
    let key = |x: DVec3| (x + 0.0).to_array().map(f64::to_bits);
    let mut edges: HashMap<_, Vec<u32>> = HashMap::new();
    let edge = |i: usize, k: usize| {
        let corners = scene.triangles[i].vertices;
        (key(corners[k]), key(corners[(k + 1) % 3]))
    };
    let mut owner: Vec<u32> = (0..plates.len() as u32).collect();
    for i in 0..plates.len() {
        for k in 0..3 {
            let (from, to) = edge(i, k);
            for &j in edges.get(&(to, from)).into_iter().flatten() {
                let (Some(a), Some(b)) = (&plates[i], &plates[j as usize]) else { continue };
                let one = scene.triangles[i].object == scene.triangles[j as usize].object;
                if one && a.normal.distance(b.normal) <= FLAT {
                    let (p, q) = (root_of(&mut owner, i as u32), root_of(&mut owner, j));
                    owner[p.max(q) as usize] = p.min(q);
                }
            }
            edges.entry((from, to)).or_default().push(i as u32);
        }
    }
    (0..plates.len() as u32).map(|i| root_of(&mut owner, i)).collect()
}

/// Representative of `i` in a union-find forest, with path halving.
fn root_of(owner: &mut [u32], mut i: u32) -> u32 {
    while owner[i as usize] != i {
        owner[i as usize] = owner[owner[i as usize] as usize];
        i = owner[i as usize];
    }
    i
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order_of(edges: &[(u32, u32)]) -> Vec<u32> {
        let (mut above, mut below) = (BTreeMap::<u32, Vec<u32>>::new(), BTreeMap::new());
        for &(low, high) in edges {
            above.entry(low).or_default().push(high);
            *below.entry(high).or_insert(0) += 1;
            below.entry(low).or_insert(0);
        }
        sorted(above, below, |n| f64::from(10 - n))
    }

    #[test]
    fn an_order_that_can_be_kept_is_kept() {
        assert_eq!(order_of(&[(3, 1), (1, 2), (0, 2)]), [0, 3, 1, 2]);
        assert_eq!(order_of(&[(2, 1), (1, 0)]), [2, 1, 0]);
    }

    #[test]
    fn circles_are_opened_at_the_largest() {
        assert_eq!(order_of(&[(1, 2), (2, 3), (3, 1), (5, 4)]), [5, 4, 1, 2, 3]);
    }
}
