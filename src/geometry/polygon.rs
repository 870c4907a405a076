//! Convex polygons in a plane, and their cutting by linear functions.
//!
//! Polygons are slices of corners, counter-clockwise. Many pieces live in one [`Pieces`] arena, so
//! that cutting allocates nothing once the arena has grown.

use glam::DVec2;

/// A linear function on a plane with a bound on its rounding error: f(x) = g . x + c.
///
/// Values of size at most `uncertainty` count as zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    /// Gradient.
    pub g: DVec2,
    /// Value at the origin.
    pub c: f64,
    /// Values no larger than this in size count as zero.
    pub uncertainty: f64,
}

impl Linear {
    /// Value at `x`, with uncertain values replaced by zero.
    pub fn at(&self, x: DVec2) -> f64 {
        let value = self.g.dot(x) + self.c;
        if value.abs() <= self.uncertainty { 0.0 } else { value }
    }

    /// The least and the largest value at the corners of `polygon`, however uncertain.
    #[inline]
    pub fn range(&self, polygon: &[DVec2]) -> (f64, f64) {
        let value = |x: DVec2| self.g.dot(x) + self.c;
        match *polygon {
            // Most polygons are triangles.
            [a, b, c] => {
                let (a, b, c) = (value(a), value(b), value(c));
                (a.min(b).min(c), a.max(b).max(c))
            }
            _ => polygon.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), &x| {
                (least.min(value(x)), most.max(value(x)))
            }),
        }
    }

    /// The values at the corners of a convex `polygon`, with at most one zero on either way from the
    /// largest to the least where both signs occur: the two parts that [`Pieces::push_part`] makes of them
    /// then have one straight cut in common.
    ///
    /// Where more corners than one are near to the line, whether it ends at one or another of them is a
    /// matter of roundings; but the cut from one on one side is not that to another one on the other.
    pub fn cut(&self, polygon: &[DVec2], values: &mut Vec<f64>) {
        values.clear();
        values.extend(polygon.iter().map(|&x| self.at(x)));
        let any = |of: fn(&f64) -> bool| values.iter().any(of);
        if !any(|&v| v == 0.0) || !any(|&v| v > 0.0) || !any(|&v| v < 0.0) {
            return;
        }
        let n = polygon.len();
        let raw = |i: usize| self.g.dot(polygon[i]) + self.c;
        let by_value = |&i: &usize, &j: &usize| raw(i).total_cmp(&raw(j));
        let (Some(top), Some(bottom)) = ((0..n).max_by(by_value), (0..n).min_by(by_value)) else {
            return;
        };
        let least = self.uncertainty.max(f64::MIN_POSITIVE);
        // The polygon is above the line down to the corner that the cut begins at, or passes before.
        for step in [1, n - 1] {
            let from_top = |k: usize| (top + k * step) % n;
            let way = (1..n).take_while(|&k| from_top(k) != bottom).count();
            let first = (1..=way).find(|&k| values[from_top(k)] < 0.0).unwrap_or(way + 1);
            let run = (1..first).rev().take_while(|&k| values[from_top(k)] == 0.0);
            let nearest =
                run.min_by(|&i, &j| raw(from_top(i)).abs().total_cmp(&raw(from_top(j)).abs()));
            for k in 1..=way {
                let value = &mut values[from_top(k)];
                match nearest {
                    Some(zero) if k == zero => *value = 0.0,
                    Some(zero) if k > zero => *value = value.min(-least),
                    None if k >= first => *value = value.min(-least),
                    _ => *value = value.max(least),
                }
            }
        }
    }

    /// Whether no point of `polygon` has a (certainly) positive value.
    #[inline]
    pub fn nowhere_positive(&self, polygon: &[DVec2]) -> bool {
        self.range(polygon).1 <= self.uncertainty
    }

    /// Whether no point of `polygon` has a (certainly) negative value.
    #[inline]
    pub fn nowhere_negative(&self, polygon: &[DVec2]) -> bool {
        self.range(polygon).0 >= -self.uncertainty
    }
}

/// Twice the signed area, positive for counter-clockwise polygons.
pub fn twice_area(polygon: &[DVec2]) -> f64 {
    let Some((&first, rest)) = polygon.split_first() else { return 0.0 };
    rest.windows(2).map(|w| (w[0] - first).perp_dot(w[1] - first)).sum()
}

/// Area of a triangle, positive for counter-clockwise ones.
pub fn triangle_area([a, b, c]: &[DVec2; 3]) -> f64 {
    0.5 * (b - a).perp_dot(c - a)
}

/// A list of convex polygons, stored end to end.
#[derive(Clone, Debug, Default)]
pub struct Pieces {
    corners: Vec<DVec2>,
    ends: Vec<usize>,
}

impl Pieces {
    /// Removes all pieces; keeps the memory.
    pub fn clear(&mut self) {
        self.corners.clear();
        self.ends.clear();
    }

    /// How many pieces there are.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The corners of piece `i`.
    pub fn get(&self, i: usize) -> &[DVec2] {
        let begin = if i == 0 { 0 } else { self.ends[i - 1] };
        &self.corners[begin..self.ends[i]]
    }

    /// All pieces in order.
    pub fn iter(&self) -> impl Iterator<Item = &[DVec2]> {
        (0..self.len()).map(|i| self.get(i))
    }

    /// Adds a piece.
    pub fn push(&mut self, polygon: &[DVec2]) {
        self.corners.extend_from_slice(polygon);
        self.ends.push(self.corners.len());
    }

    /// Adds the part of convex `polygon` where `f >= 0`; returns whether there was any.
    ///
    /// A part without a corner of certainly positive value has no area and is not added.
    pub fn push_clipped(&mut self, polygon: &[DVec2], f: &Linear) -> bool {
        self.push_where(polygon, |i| f.at(polygon[i]))
    }

    /// The same where a linear function, of which the corners' `values` are known ([`Linear::cut`]), is at
    /// least zero times `sign` (1 or -1): the two signs give two parts that have just the cut in common.
    pub fn push_part(&mut self, polygon: &[DVec2], values: &[f64], sign: f64) -> bool {
        self.push_where(polygon, |i| sign * values[i])
    }

    #[inline]
    fn push_where(&mut self, polygon: &[DVec2], value_at: impl Fn(usize) -> f64) -> bool {
        let begin = self.corners.len();
        let mut any_positive = false;
        let Some(&last) = polygon.last() else { return false };
        let (mut previous, mut previous_value) = (last, value_at(polygon.len() - 1));
        for (i, &corner) in polygon.iter().enumerate() {
            let value = value_at(i);
            any_positive |= value > 0.0;
            if value * previous_value < 0.0 {
                // The same expression for both orders of the end points, so that the two parts of
                // a cut polygon, and the two sides of a shared edge, get the same new corner.
                let (p, fp, q, fq) = if value > 0.0 {
                    (corner, value, previous, previous_value)
                } else {
                    (previous, previous_value, corner, value)
                };
                self.corners.push(p + (q - p) * (fp / (fp - fq)));
            }
            if value >= 0.0 {
                self.corners.push(corner);
            }
            (previous, previous_value) = (corner, value);
        }
        if any_positive && self.corners.len() - begin >= 3 {
            self.ends.push(self.corners.len());
            true
        } else {
            self.corners.truncate(begin);
            false
        }
    }

    /// Removes every piece from number `count` on.
    pub fn truncate(&mut self, count: usize) {
        self.ends.truncate(count);
        self.corners.truncate(self.ends.last().copied().unwrap_or(0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_keeps_the_area() {
        let square = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        for (angle, c) in [(0.1f64, -0.3), (1.0, -0.9), (2.5, 0.2), (0.0, -1.0), (0.0, 0.5)] {
            let f = Linear { g: DVec2::from_angle(angle), c, uncertainty: 1e-15 };
            let mut pieces = Pieces::default();
            let mut values = vec![];
            f.cut(&square, &mut values);
            pieces.push_part(&square, &values, 1.0);
            pieces.push_part(&square, &values, -1.0);
            let area: f64 = pieces.iter().map(twice_area).sum();
            assert!((area - 2.0).abs() < 1e-15, "{angle} {c}");
        }
    }

    /// Lines beside an edge, or through several corners as far as is known: the parts did overlap.
    #[test]
    fn an_uncertain_cut_keeps_the_area() {
        let octagon: Vec<DVec2> =
            (0..8).map(|k| DVec2::from_angle(std::f64::consts::TAU * k as f64 / 8.0)).collect();
        let mut cut = 0;
        for k in 0..400 {
            let k = f64::from(k);
            let g = DVec2::from_angle(2.4 * k);
            let f = Linear { g, c: (1.7 * k).sin(), uncertainty: 0.4 * (0.9 * k).cos().abs() };
            let (mut pieces, mut values) = (Pieces::default(), vec![]);
            f.cut(&octagon, &mut values);
            pieces.push_part(&octagon, &values, 1.0);
            pieces.push_part(&octagon, &values, -1.0);
            cut += usize::from(pieces.len() == 2 && values.contains(&0.0));
            let area: f64 = pieces.iter().map(twice_area).sum();
            assert!((area - twice_area(&octagon)).abs() < 1e-14, "{k}: {values:?}");
        }
        assert!(cut > 50, "{cut}");
    }
}
