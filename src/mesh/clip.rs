//! Segments and a triangle, within a tolerance.

use glam::DVec2;

/// Smallest height of a triangle.
pub(super) fn height(t: &[DVec2; 3]) -> f64 {
    let longest = (0..3).map(|k| t[k].distance(t[(k + 1) % 3])).fold(0.0, f64::max);
    (t[1] - t[0]).perp_dot(t[2] - t[0]) / longest
}

/// Inward unit normal of edge `k` of a counter-clockwise triangle.
fn inward(t: &[DVec2; 3], k: usize) -> DVec2 {
    (t[(k + 1) % 3] - t[k]).perp().normalize()
}

/// Whether `x` lies on the line of edge `k`, within the tolerance.
pub(super) fn beside(t: &[DVec2; 3], k: usize, x: DVec2, tolerance: f64) -> bool {
    (x - t[k]).dot(inward(t, k)).abs() <= tolerance
}

/// The part of a segment in a counter-clockwise triangle.
///
/// Distances from an edge of at most the tolerance count as zero, and such an end is moved onto
/// the edge: both triangles beside a shared edge then see a line that runs up to it end in the same
/// point. `None` when no more than the tolerance is left.
pub(super) fn clip(p: DVec2, q: DVec2, t: &[DVec2; 3], tolerance: f64) -> Option<[DVec2; 2]> {
    let (mut p, mut q) = (p, q);
    for k in 0..3 {
        let n = inward(t, k);
        let distance = |x: DVec2| {
            let d = (x - t[k]).dot(n);
            if d.abs() <= tolerance { 0.0 } else { d }
        };
        let (dp, dq) = (distance(p), distance(q));
        if dp.min(dq) < 0.0 && dp.max(dq) <= 0.0 {
            return None;
        }
        let onto = |x: DVec2| x - n * (x - t[k]).dot(n);
        let cross = p + (q - p) * (dp / (dp - dq));
        let (from, to) = (p, q);
        p = if dp == 0.0 {
            onto(from)
        } else if dp < 0.0 {
            cross
        } else {
            from
        };
        q = if dq == 0.0 {
            onto(to)
        } else if dq < 0.0 {
            cross
        } else {
            to
        };
    }
    (p.distance(q) > tolerance).then_some([p, q])
}

#[cfg(test)]
mod tests {
    use super::*;

    const T: [DVec2; 3] = [DVec2::ZERO, DVec2::X, DVec2::Y];
    const TOLERANCE: f64 = 1e-6;

    #[test]
    fn a_segment_is_clipped() {
        let at = DVec2::new;
        let cases = [
            (at(-1.0, 0.25), at(2.0, 0.25), Some([at(0.0, 0.25), at(0.75, 0.25)])),
            (at(0.125, 0.25), at(0.25, 0.25), Some([at(0.125, 0.25), at(0.25, 0.25)])),
            (at(0.25, -5e-7), at(0.25, 0.5), Some([at(0.25, 0.0), at(0.25, 0.5)])),
            (at(0.25, -5e-7), at(0.5, 5e-7), Some([at(0.25, 0.0), at(0.5, 0.0)])),
            (at(0.25, -1.0), at(0.25, 5e-7), None),
            (at(-1.0, 1.0), at(1.0, -1.0), None),
            (at(-1.0, 0.5), at(0.5, -1.0), None),
            (at(2.0, 2.0), at(3.0, 0.0), None),
        ];
        for (p, q, want) in cases {
            let got = clip(p, q, &T, TOLERANCE);
            match (got, want) {
                (Some([a, b]), Some([c, d])) => {
                    assert!(a.distance(c) < 1e-15 && b.distance(d) < 1e-15, "{p} {q}: {got:?}");
                }
                _ => assert_eq!(got, want, "{p} {q}"),
            }
        }
    }
}
