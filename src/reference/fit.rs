//! Power laws by least squares.

/// Exponent p of the least-squares fit of ln y = ln c + p ln x; `None` for fewer than two
/// different x, or anything that has no logarithm.
pub fn exponent(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    let (sx, sy) = logs.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
    let (mx, my) = (sx / n, sy / n);
    let (above, below) = logs
        .iter()
        .fold((0.0, 0.0), |(a, b), (x, y)| (a + (x - mx) * (y - my), b + (x - mx) * (x - mx)));
    let p = above / below;
    (logs.len() >= 2 && p.is_finite()).then_some(p)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_exponent_of_a_power_law() {
        let points: Vec<(f64, f64)> =
            (1..6).map(|k| (k as f64, 3.0 * (k as f64).powf(1.7))).collect();
        assert!((exponent(&points).unwrap() - 1.7).abs() < 1e-12);
        assert_eq!(exponent(&[(2.0, 1.0)]), None);
        assert_eq!(exponent(&[(2.0, 1.0), (2.0, 3.0)]), None);
    }

    #[test]
    fn the_papers_gray_field_grows_like_its_root() {
        // Figure 6.1: theta = 0.519 from the values for n = 160 to 163840.
        let points: Vec<(f64, f64)> = super::super::printed::SIZES[2..]
            .iter()
            .zip(&super::super::printed::GRAY[2..])
            .map(|(n, g)| (*n as f64, *g as f64))
            .collect();
        assert!((exponent(&points).unwrap() - 0.519).abs() < 0.001);
    }
}
