//! Convex outlines of what covers a triangle: fewer cuts than by each covering triangle.

use std::collections::HashMap;

use glam::DVec3;

/// Most corners of an outline: joining looks at all of them for each edge.
const MOST_CORNERS: usize = 16;

/// Corners of an outline may be beyond its edges by this share of the contact distance: far more
/// than roundings of f64, far less than counts.
const CONVEX: f64 = 1e-4;

/// A convex polygon in space.
pub(super) struct Outline {
    corners: Vec<DVec3>,
    /// Unit normals of the edges k to k + 1 in the plane, inward.
    inward: Vec<DVec3>,
}

impl Outline {
    /// Of corners in order around `normal`.
    fn new(corners: Vec<DVec3>, normal: DVec3) -> Outline {
        let next = |k: usize| corners[(k + 1) % corners.len()];
        let edges = (0..corners.len()).map(|k| (next(k) - corners[k]).normalize_or_zero());
        Outline { inward: edges.map(|e| normal.cross(e)).collect(), corners }
    }

    /// How many edges it has.
    pub fn edges(&self) -> usize {
        self.corners.len()
    }

    /// Distance of `x` from the line of edge `k`, positive on the inner side.
    pub fn inside(&self, k: usize, x: DVec3) -> f64 {
        (x - self.corners[k]).dot(self.inward[k])
    }

    fn is_convex(&self, tolerance: f64) -> bool {
        let all = |k: usize| self.corners.iter().all(|&x| self.inside(k, x) >= -tolerance);
        (0..self.edges()).all(all)
    }
}

/// Joins triangles of one plane over common edges while the result is convex; the same points.
/// `normal` is that of the plane, on either side. Which edge goes first follows from the order of
/// the triangles.
pub(super) fn outlines(triangles: &[[DVec3; 3]], normal: DVec3, contact: f64) -> Vec<Outline> {
    let key = |x: DVec3| (x + 0.0).to_array().map(f64::to_bits);
    let mut outlines: Vec<Option<Outline>> = vec![];
    let mut edges = HashMap::new();
    let mut shared = vec![];
    for (i, &[a, b, c]) in triangles.iter().enumerate() {
        let upright = (b - a).cross(c - a).dot(normal) > 0.0;
        let corners = if upright { [a, b, c] } else { [a, c, b] };
        for k in 0..3 {
            let (p, q) = (corners[k], corners[(k + 1) % 3]);
            if let Some(&j) = edges.get(&(key(q), key(p))) {
                shared.push((p.distance_squared(q), i, j, p, q));
            }
            edges.insert((key(p), key(q)), i);
        }
        outlines.push(Some(Outline::new(corners.to_vec(), normal)));
    }
    // Diagonals before the short edges of slivers.
    shared.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut owner: Vec<usize> = (0..triangles.len()).collect();
    for (_, i, j, p, q) in shared {
        let (i, j) = (find(&owner, i), find(&owner, j));
        let (Some(one), Some(other)) = (&outlines[i], &outlines[j]) else { continue };
        if i == j || one.edges() + other.edges() > MOST_CORNERS + 2 {
            continue;
        }
        let Some(corners) = join(&one.corners, &other.corners, p, q) else { continue };
        let joined = Outline::new(corners, normal);
        if joined.is_convex(CONVEX * contact) {
            outlines[i] = Some(joined);
            outlines[j] = None;
            owner[j] = i;
        }
    }
    outlines.into_iter().flatten().collect()
}

fn find(owner: &[usize], mut i: usize) -> usize {
    while owner[i] != i {
        i = owner[i];
    }
    i
}

/// Two loops as one over their common edge p to q (q to p in the second).
fn join(one: &[DVec3], other: &[DVec3], p: DVec3, q: DVec3) -> Option<Vec<DVec3>> {
    let edge = |l: &[DVec3], from: DVec3, to: DVec3| {
        (0..l.len()).find(|&k| l[k] == from && l[(k + 1) % l.len()] == to)
    };
    let (i, j) = (edge(one, p, q)?, edge(other, q, p)?);
    // From q around the first to p, then what follows p in the second.
    let around = (1..=one.len()).map(|k| one[(i + k) % one.len()]);
    let rest = (2..other.len()).map(|k| other[(j + k) % other.len()]);
    Some(around.chain(rest).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn p(x: f64, y: f64) -> DVec3 {
        DVec3::new(x, y, 0.0)
    }

    #[test]
    fn a_fan_is_one_outline_whatever_its_winding() {
        let rim = |k: usize| DVec3::new((0.7 * k as f64).cos(), (0.7 * k as f64).sin(), 0.0);
        let fan: Vec<_> = (0..8)
            .map(|k| match k % 2 {
                0 => [rim(0), rim(k + 1), rim(k)],
                _ => [rim(0), rim(k), rim(k + 1)],
            })
            .collect();
        let outlines = outlines(&fan[1..7], DVec3::Z, 1e-6);
        assert_eq!(outlines.len(), 1);
        assert_eq!(outlines[0].edges(), 8);
        assert!((0..8).all(|k| outlines[0].inside(k, DVec3::ZERO) > 0.7));
    }

    #[test]
    fn an_l_stays_in_parts() {
        let l = [
            [p(0., 0.), p(1., 0.), p(1., 1.)],
            [p(0., 0.), p(1., 1.), p(0., 1.)],
            [p(0., 1.), p(1., 1.), p(0., 2.)],
            [p(1., 0.), p(2., 0.), p(2., 1.)],
            [p(1., 0.), p(2., 1.), p(1., 1.)],
        ];
        let parts = outlines(&l, DVec3::Z, 1e-6);
        assert_eq!(parts.len(), 2);
        let holds = |x: DVec3| {
            parts.iter().filter(|o| (0..o.edges()).all(|k| o.inside(k, x) > 0.0)).count()
        };
        for (x, want) in [(p(0.4, 0.6), 1), (p(1.7, 0.6), 1), (p(0.2, 1.6), 1), (p(1.2, 1.2), 0)] {
            assert_eq!(holds(x), want, "{x}");
        }
    }
}
