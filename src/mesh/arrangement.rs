//! Snapped segments inside a triangle: a planar graph of points well apart.
//!
//! Contacts come from coordinates that were rounded separately, so that one line of a scene shows
//! up as several that almost coincide. All decisions are made within the contact tolerance: points
//! closer than that are one, a point that close to a segment lies on it, and segments that cross
//! get a point there (snap rounding in the manner of Hobby 1999, with the first point that comes
//! in the place of the pixel). Moving a segment onto a point can bring it near another one, so
//! this is repeated until nothing changes.
//!
//! Cost: O(s (s + p)) a round for s segments and p points of one triangle; few rounds.

use glam::DVec2;

/// Most points of one triangle, and so at most twice as many pieces: a point is looked for in all
/// pieces of a face, and each costs at least one element.
pub(super) const MOST_POINTS: usize = 128;

/// Rounds of snapping. Two or three settle what scenes hold; what does not settle is given up.
const ROUNDS: usize = 16;

/// A triangle and the segments on it.
pub(super) struct Arrangement {
    /// The triangle's corners, then the others; no two within the tolerance of each other.
    pub points: Vec<DVec2>,
    /// Pairs of points, the lower first, in order. They meet at points only.
    pub edges: Vec<(u32, u32)>,
}

/// Snaps segments that lie in a counter-clockwise triangle; `None` when there are too many points
/// or snapping does not settle.
pub(super) fn arrange(
    corners: &[DVec2; 3],
    segments: &[[DVec2; 2]],
    tolerance: f64,
) -> Option<Arrangement> {
    let mut a = Arrangement { points: corners.to_vec(), edges: vec![] };
    // Ends on the boundary first: they must stay there, others snap to them.
    let inside = |x: &DVec2| boundary_distance(corners, *x).0 > tolerance;
    for on_boundary in [true, false] {
        for &x in segments.iter().flatten().filter(|x| inside(x) != on_boundary) {
            a.point(x, tolerance);
            if a.points.len() > MOST_POINTS {
                return None;
            }
        }
    }
    a.edges =
        segments.iter().map(|s| (a.point(s[0], tolerance), a.point(s[1], tolerance))).collect();
    for _ in 0..ROUNDS {
        a.tidy();
        let before = (a.points.len(), a.edges.clone());
        a.cut_at_points(tolerance);
        a.tidy();
        a.add_crossings(tolerance);
        if a.points.len() > MOST_POINTS {
            return None;
        }
        if before == (a.points.len(), a.edges.clone()) {
            return Some(a);
        }
    }
    None
}

impl Arrangement {
    /// The point at `x`: the nearest within the tolerance, or a new one, on the boundary when
    /// within the tolerance of that.
    fn point(&mut self, x: DVec2, tolerance: f64) -> u32 {
        let nearest = |points: &[DVec2], x: DVec2| {
            let near = points.iter().enumerate().map(|(i, p)| (p.distance(x), i));
            near.filter(|n| n.0 <= tolerance).min_by(|a, b| a.0.total_cmp(&b.0)).map(|n| n.1 as u32)
        };
        if let Some(known) = nearest(&self.points, x) {
            return known;
        }
        let corners = [self.points[0], self.points[1], self.points[2]];
        let (distance, foot) = boundary_distance(&corners, x);
        let x = if distance <= tolerance { foot } else { x };
        nearest(&self.points, x).unwrap_or_else(|| {
            self.points.push(x);
            self.points.len() as u32 - 1
        })
    }

    fn tidy(&mut self) {
        self.edges.iter_mut().for_each(|e| *e = (e.0.min(e.1), e.0.max(e.1)));
        self.edges.retain(|e| e.0 != e.1);
        self.edges.sort_unstable();
        self.edges.dedup();
    }

    /// Leads every edge through the points that lie on it.
    fn cut_at_points(&mut self, tolerance: f64) {
        let mut cut = vec![];
        for &(i, j) in &self.edges {
            let (p, q) = (self.points[i as usize], self.points[j as usize]);
            let (along, length) = ((q - p).normalize(), p.distance(q));
            let mut on: Vec<(f64, u32)> = vec![];
            for (k, &x) in self.points.iter().enumerate() {
                let (s, off) = ((x - p).dot(along), (x - p).perp_dot(along));
                if s > 0.0 && s < length && off.abs() <= tolerance {
                    on.push((s, k as u32));
                }
            }
            // The ends themselves are found there too, by rounding.
            on.retain(|&(_, k)| k != i && k != j);
            on.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut from = i;
            for (_, k) in on.into_iter().chain([(length, j)]) {
                cut.push((from, k));
                from = k;
            }
        }
        self.edges = cut;
    }

    /// Adds a point where two edges cross; the next round cuts them there.
    fn add_crossings(&mut self, tolerance: f64) {
        for m in 0..self.edges.len() {
            for n in 0..m {
                let (e, f) = (self.edges[m], self.edges[n]);
                if e.0 == f.0 || e.0 == f.1 || e.1 == f.0 || e.1 == f.1 {
                    continue;
                }
                let [a, b, c, d] = [e.0, e.1, f.0, f.1].map(|i| self.points[i as usize]);
                if let Some(x) = crossing(a, b, c, d) {
                    self.point(x, tolerance);
                    if self.points.len() > MOST_POINTS {
                        return;
                    }
                }
            }
        }
    }
}

/// Where the open segments ab and cd cross.
fn crossing(a: DVec2, b: DVec2, c: DVec2, d: DVec2) -> Option<DVec2> {
    let (oc, od) = ((b - a).perp_dot(c - a), (b - a).perp_dot(d - a));
    let (oa, ob) = ((d - c).perp_dot(a - c), (d - c).perp_dot(b - c));
    (oc * od < 0.0 && oa * ob < 0.0).then(|| c + (d - c) * (oc / (oc - od)))
}

/// Distance from `x` to the nearest edge of a triangle, and the foot there.
fn boundary_distance(t: &[DVec2; 3], x: DVec2) -> (f64, DVec2) {
    let mut best = (f64::INFINITY, x);
    for k in 0..3 {
        let (a, b) = (t[k], t[(k + 1) % 3]);
        let s = ((x - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        let foot = a + s * (b - a);
        if foot.distance(x) < best.0 {
            best = (foot.distance(x), foot);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    const T: [DVec2; 3] = [DVec2::ZERO, DVec2::new(4.0, 0.0), DVec2::new(0.0, 4.0)];

    fn of(segments: &[[(f64, f64); 2]]) -> Arrangement {
        let segments: Vec<_> = segments.iter().map(|s| s.map(|(x, y)| DVec2::new(x, y))).collect();
        arrange(&T, &segments, 1e-6).unwrap()
    }

    #[test]
    fn crossings_become_points() {
        let a = of(&[[(0.5, 1.0), (1.5, 1.0)], [(1.0, 0.5), (1.0, 1.5)]]);
        assert_eq!((a.points.len(), a.edges.len()), (3 + 5, 4));
        assert_eq!(a.points[7], DVec2::ONE);
    }

    #[test]
    fn almost_equal_segments_become_one() {
        let a = of(&[
            [(0.5, 1.0), (1.5, 1.0)],
            [(1.0, 1.0 + 3e-7), (2.0, 1.0 - 3e-7)],
            [(2.0, 1.0), (0.5, 1.0 + 3e-7)],
        ]);
        assert_eq!((a.points.len(), a.edges.len()), (3 + 4, 3));
    }

    #[test]
    fn ends_snap_to_the_boundary_and_the_corners() {
        let a = of(&[[(1.0, 3e-7), (1.0, 1.0)], [(4e-7, 4e-7), (1.0, 1.0)]]);
        assert_eq!(a.points.len(), 3 + 2);
        assert!(a.points.contains(&DVec2::X));
        assert_eq!(a.edges.len(), 2);
        assert_eq!(a.edges[0].0, 0);
    }

    #[test]
    fn too_much_is_given_up() {
        let line = |k: usize| {
            let at = 0.1 + 0.01 * k as f64;
            [
                [DVec2::new(at, 0.05), DVec2::new(at, 1.9)],
                [DVec2::new(0.05, at), DVec2::new(1.9, at)],
            ]
        };
        let segments: Vec<_> = (0..40).flat_map(line).collect();
        assert!(arrange(&T, &segments, 1e-6).is_none());
    }
}
