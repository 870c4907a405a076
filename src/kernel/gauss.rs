//! Gauss-Legendre rules on [0, 1].

/// Nodes and weights of the `n`-point Gauss-Legendre rule on [0, 1], exact to degree 2n - 1.
///
/// Newton's method on the Legendre polynomial from Tricomi's estimate of its roots (Davis &
/// Rabinowitz, Methods of Numerical Integration, section 2.7); good to a few units in the last
/// place for all n that are used here.
pub fn legendre(n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut nodes = vec![0.5; n];
    let mut weights = vec![1.0; n];
    for i in 0..n.div_ceil(2) {
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..100 {
            let (mut p, mut previous) = (1.0, 0.0);
            for k in 0..n {
                let k = k as f64;
                (p, previous) = (((2.0 * k + 1.0) * x * p - k * previous) / (k + 1.0), p);
            }
            slope = n as f64 * (x * p - previous) / (x * x - 1.0);
            let step = p / slope;
            x -= step;
            if step.abs() <= f64::EPSILON {
                break;
            }
        }
        let weight = 1.0 / ((1.0 - x * x) * slope * slope);
        (nodes[i], nodes[n - 1 - i]) = (0.5 - 0.5 * x, 0.5 + 0.5 * x);
        (weights[i], weights[n - 1 - i]) = (weight, weight);
    }
    (nodes, weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_for_polynomials() {
        for n in 1..=40 {
            let (nodes, weights) = legendre(n);
            for degree in 0..2 * n {
                let sum: f64 =
                    nodes.iter().zip(&weights).map(|(x, w)| w * x.powi(degree as i32)).sum();
                assert!((sum * (degree + 1) as f64 - 1.0).abs() < 4e-14, "{n} {degree} {sum}");
            }
        }
    }
}
