//! Points spread over triangles in proportion to what these radiate.

use glam::{DVec2, DVec3};

/// Shares of a whole, to choose by.
#[derive(Clone, Debug, Default)]
pub struct Shares {
    /// The sum of all up to and with each, over that of all.
    until: Vec<f64>,
}

impl Shares {
    /// Of positive numbers; with their sum.
    pub fn of(each: impl IntoIterator<Item = f64>) -> (Shares, f64) {
        let mut sum = 0.0;
        let add = |x| {
            sum += x;
            sum
        };
        let mut until: Vec<f64> = each.into_iter().map(add).collect();
        until.iter_mut().for_each(|u| *u /= sum);
        (Shares { until }, sum)
    }

    /// The number that a point of the unit square falls to, and where it lies in the strip of that
    /// number as a point of the unit square again. There must be one.
    pub fn choose(&self, x: DVec2) -> (usize, DVec2) {
        let number = self.until.partition_point(|&u| u <= x.x).min(self.until.len() - 1);
        let begin = if number == 0 { 0.0 } else { self.until[number - 1] };
        let along = ((x.x - begin) / (self.until[number] - begin)).clamp(0.0, 1.0);
        (number, DVec2::new(along, x.y))
    }
}

/// Weights of the corners of a triangle at the point that belongs to a point of the unit square,
/// evenly by area (Turk 1990).
pub fn on_triangle(x: DVec2) -> DVec3 {
    let root = x.x.sqrt();
    DVec3::new(1.0 - root, root * (1.0 - x.y), root * x.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_are_as_wide_as_their_shares() {
        let (shares, sum) = Shares::of([1.0, 3.0, 4.0]);
        assert_eq!(sum, 8.0);
        assert_eq!(shares.choose(DVec2::new(0.0625, 0.3)), (0, DVec2::new(0.5, 0.3)));
        assert_eq!(shares.choose(DVec2::new(0.125, 0.3)), (1, DVec2::new(0.0, 0.3)));
        assert_eq!(shares.choose(DVec2::new(0.875, 0.3)), (2, DVec2::new(0.75, 0.3)));
    }

    #[test]
    fn points_are_even_over_a_triangle() {
        // Second moments of the weights: 1/6 and 1/12.
        let n = 64;
        let mut sums = [DVec3::ZERO; 2];
        for i in 0..n * n {
            let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
            let w = on_triangle(DVec2::new(at(i / n), at(i % n)));
            assert!((w.element_sum() - 1.0).abs() < 1e-15 && w.min_element() >= 0.0);
            sums[0] += w * w;
            sums[1] += w * DVec3::new(w.y, w.z, w.x);
        }
        let [squares, products] = sums.map(|sum| sum / f64::from(n * n));
        assert!((squares - DVec3::splat(1.0 / 6.0)).length() < 1e-3, "{squares}");
        assert!((products - DVec3::splat(1.0 / 12.0)).length() < 1e-3, "{products}");
    }
}
