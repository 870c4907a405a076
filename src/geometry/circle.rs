//! Smallest enclosing circles of triangles: A(tau) and R(tau) of AC section 2.

use glam::DVec2;

/// Centre and radius of the smallest circle that contains triangle `t`.
///
/// For a right or obtuse triangle it is the circle on the longest side, otherwise the
/// circumscribed circle. Degenerate triangles get the circle on their longest side.
pub fn smallest_enclosing(t: &[DVec2; 3]) -> (DVec2, f64) {
    for i in 0..3 {
        let (apex, p, q) = (t[i], t[(i + 1) % 3], t[(i + 2) % 3]);
        if (p - apex).dot(q - apex) <= 0.0 {
            return (0.5 * (p + q), 0.5 * p.distance(q));
        }
    }
    let (b, c) = (t[1] - t[0], t[2] - t[0]);
    let twice = 2.0 * b.perp_dot(c);
    let (bb, cc) = (b.length_squared(), c.length_squared());
    let centre = DVec2::new(c.y * bb - b.y * cc, b.x * cc - c.x * bb) / twice;
    (t[0] + centre, centre.length())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encloses_and_touches() {
        let cases = [
            [DVec2::ZERO, DVec2::X, DVec2::Y],
            [DVec2::ZERO, DVec2::X, DVec2::new(0.5, 0.1)],
            [DVec2::ZERO, DVec2::X, DVec2::new(0.45, 0.9)],
            [DVec2::ZERO, DVec2::X, DVec2::new(3.0, 0.0)],
        ];
        for t in cases {
            let (centre, radius) = smallest_enclosing(&t);
            let distances = t.map(|p| p.distance(centre));
            assert!(distances.iter().all(|&d| d <= radius * (1.0 + 1e-14)), "{t:?}");
            let touching = distances.iter().filter(|&&d| (d - radius).abs() < 1e-14).count();
            assert!(touching >= 2, "{t:?}");
        }
    }
}
