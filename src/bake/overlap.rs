//! Triangles of a plane that overlap.
//!
//! A quadtree brings together those that are near each other; pairs are clipped exactly. What lies on
//! a heap is not divided further, since its triangles meet everywhere: there each is compared with
//! [`NEXT`] others only, and time stays in proportion to the number of triangles.

use glam::DVec2;

use crate::geometry::polygon::{Linear, Pieces, twice_area};

/// So many triangles of a square are compared, each with each.
const FEW: usize = 24;

/// Where there are more, and dividing does not part them, each is compared with so many that follow.
const NEXT: usize = 64;

/// Most times that the square is divided.
const DEEPEST: u32 = 16;

/// Four squares that together have more than this many times the triangles are worth nothing. (The
/// triangles of a fan may all meet where the four do: they are parted in the next step.)
const TOO_MANY: usize = 3;

/// So many divisions in a row may be worth nothing.
const FUTILE: u32 = 3;

/// Triangles listed in squares, in units of their number, after which nothing is divided.
const BUDGET: usize = 2000;

struct Square {
    low: DVec2,
    side: f64,
    depth: u32,
    /// Divisions above it that were worth nothing, in a row.
    futile: u32,
    members: Vec<u32>,
}

/// How many triangles, of either winding, have a part wider than `width` in common with another.
pub(super) fn overlapping(triangles: &[[DVec2; 3]], width: f64) -> usize {
    let mut is_over = vec![false; triangles.len()];
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for x in triangles.iter().flatten() {
        (low, high) = (low.min(*x), high.max(*x));
    }
    let side = (high - low).max_element();
    let all: Vec<u32> = (0..triangles.len() as u32).collect();
    let mut stack = vec![Square { low, side, depth: 0, futile: 0, members: all }];
    let mut budget = BUDGET.saturating_mul(triangles.len());
    while let Some(square) = stack.pop() {
        let members = &square.members;
        let divides =
            members.len() > FEW && square.depth < DEEPEST && square.futile < FUTILE && budget > 0;
        if divides {
            let half = 0.5 * square.side;
            let mut parts: Vec<Square> = (0..4u32)
                .map(|k| {
                    let low = square.low + half * DVec2::new(f64::from(k & 1), f64::from(k >> 1));
                    let meets = |i: &u32| meets(&triangles[*i as usize], low, half);
                    let members = members.iter().copied().filter(meets).collect();
                    Square { low, side: half, depth: square.depth + 1, futile: 0, members }
                })
                .collect();
            let count: usize = parts.iter().map(|p| p.members.len()).sum();
            budget = budget.saturating_sub(count);
            if count > TOO_MANY * members.len() {
                parts.iter_mut().for_each(|p| p.futile = square.futile + 1);
            }
            stack.extend(parts.into_iter().filter(|p| p.members.len() > 1));
            continue;
        }
        for (k, &i) in members.iter().enumerate() {
            for &j in members[k + 1..].iter().take(NEXT) {
                let (i, j) = (i as usize, j as usize);
                if !(is_over[i] && is_over[j]) && overlap(&triangles[i], &triangles[j], width) {
                    (is_over[i], is_over[j]) = (true, true);
                }
            }
        }
    }
    is_over.into_iter().filter(|over| *over).count()
}

/// Whether a triangle and a square may share a point: no line along a side of either parts them.
fn meets(t: &[DVec2; 3], low: DVec2, side: f64) -> bool {
    let high = low + side;
    let least = t[0].min(t[1]).min(t[2]);
    let greatest = t[0].max(t[1]).max(t[2]);
    if least.cmpgt(high).any() || greatest.cmplt(low).any() {
        return false;
    }
    let turn = twice_area(t).signum();
    (0..3).all(|k| {
        let inward = turn * (t[(k + 1) % 3] - t[k]).perp();
        // The corner of the square that lies farthest inward.
        let far = DVec2::select(inward.cmpgt(DVec2::ZERO), high, low);
        inward.dot(far - t[k]) >= 0.0
    })
}

/// Whether the common part of two triangles is wider than `width`.
fn overlap(a: &[DVec2; 3], b: &[DVec2; 3], width: f64) -> bool {
    let orient = |t: &[DVec2; 3]| if twice_area(t) < 0.0 { [t[0], t[2], t[1]] } else { *t };
    let (a, b) = (orient(a), orient(b));
    let box_of = |t: &[DVec2; 3]| (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
    let ((a_low, a_high), (b_low, b_high)) = (box_of(&a), box_of(&b));
    if a_low.cmpgt(b_high).any() || b_low.cmpgt(a_high).any() {
        return false;
    }
    // Relative to a corner, so that small triangles keep their digits.
    let (a, b) = (a.map(|x| x - b[0]), b.map(|x| x - b[0]));
    let (mut parts, mut current) = (Pieces::default(), a.to_vec());
    for k in 0..3 {
        let (p, q) = (b[k], b[(k + 1) % 3]);
        let g = (q - p).perp();
        parts.clear();
        if !parts.push_clipped(&current, &Linear { g, c: -g.dot(p), uncertainty: 0.0 }) {
            return false;
        }
        current.clear();
        current.extend_from_slice(parts.get(0));
    }
    let around: f64 =
        (0..current.len()).map(|k| current[k].distance(current[(k + 1) % current.len()])).sum();
    // Of a long strip, area over half the outline is its width.
    twice_area(&current) > width * around
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: f64 = 2.5e-6;

    fn t(corners: [[f64; 2]; 3]) -> [DVec2; 3] {
        corners.map(DVec2::from)
    }

    #[test]
    fn common_edges_are_no_overlap_and_common_parts_are() {
        let lower = t([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
        let upper = t([[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        let beside = t([[1.0, 1.0], [0.0, 0.0], [0.0, 1.0]]);
        assert_eq!(overlapping(&[lower, upper], WIDTH), 0);
        // Mirrored triangles count as others do.
        assert_eq!(overlapping(&[lower, upper, beside], WIDTH), 2);
        assert_eq!(overlapping(&[lower, [lower[0], lower[2], lower[1]]], WIDTH), 2);
        // A T-junction with a rounding of f32.
        let left = t([[0.0, 0.5], [0.500_000_1, 0.7], [0.5, 0.1]]);
        let right = t([[0.5, 0.0], [1.0, 0.5], [0.5, 1.0]]);
        assert_eq!(overlapping(&[left, right], WIDTH), 0);
        let deeper = left.map(|x| x + DVec2::X * 1e-4);
        assert_eq!(overlapping(&[deeper, right], WIDTH), 2);
        // One inside of the other.
        let inner = lower.map(|x| DVec2::new(0.7, 0.3) + 1e-3 * x);
        assert_eq!(overlapping(&[inner, lower], WIDTH), 2);
    }

    #[test]
    fn a_heap_ends_soon() {
        // Blades of one heap, each 1e-4 wide and turned a little.
        let heap: Vec<[DVec2; 3]> = (0..30_000)
            .map(|k| {
                let x = f64::from(k) / 30_000.0;
                t([[x, 0.0], [x + 1e-4, 0.0], [1.0 - x, 1.0]])
            })
            .collect();
        assert!(overlapping(&heap, WIDTH) > 20_000);
    }

    #[test]
    fn one_overlap_among_many_triangles_is_found() {
        // A fan and a grid, both without overlaps, then with one.
        let around = |k: i32| {
            let angle = std::f64::consts::TAU * f64::from(k) / 3000.0;
            DVec2::splat(0.5) + 0.5 * DVec2::new(angle.cos(), angle.sin())
        };
        let mut fan: Vec<[DVec2; 3]> =
            (0..3000).map(|k| [DVec2::splat(0.5), around(k), around(k + 1)]).collect();
        assert_eq!(overlapping(&fan, WIDTH), 0);
        fan.push([DVec2::splat(0.5), around(700), around(701)].map(|x| x - DVec2::new(0.0, 1e-3)));
        let met = fan[..3000].iter().filter(|t| overlap(t, &fan[3000], WIDTH)).count();
        assert!(met > 0);
        assert_eq!(overlapping(&fan, WIDTH), met + 1);
        let mut grid = vec![];
        for i in 0..100 {
            for j in 0..100 {
                let at = |a, b| 0.01 * DVec2::new(f64::from(i + a), f64::from(j + b));
                grid.push([at(0, 0), at(1, 0), at(1, 1)]);
                grid.push([at(0, 0), at(1, 1), at(0, 1)]);
            }
        }
        assert_eq!(overlapping(&grid, WIDTH), 0);
        // Inside of the lower triangle of one cell.
        grid.push([DVec2::new(0.336, 0.332), DVec2::new(0.337, 0.332), DVec2::new(0.336, 0.333)]);
        assert_eq!(overlapping(&grid, WIDTH), 2);
    }
}
