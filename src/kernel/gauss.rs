//! Gauss rules on [0, 1].

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
            let (p, previous) = at_order(n, x);
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

/// Nodes and weights of the `n`-point Gauss-Jacobi rule on [0, 1] with weight x, exact to degree
/// 2n - 1: the integral of x f(x) is the sum of w f(x_i).
///
/// These are the points of the Radau rule of n + 1 points but the one at 0, where x f(x) vanishes: the
/// roots of q = P_n + P_(n+1), with weights (1 + x)/((1 - x) q'^2) (Davis & Rabinowitz, section 2.7).
pub fn jacobi(n: usize) -> (Vec<f64>, Vec<f64>) {
    let (mut nodes, mut weights) = (vec![0.5; n], vec![0.5; n]);
    for i in 0..n {
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 1.0)).cos();
        // The slope of q, times x^2 - 1.
        let mut slope = 1.0;
        for _ in 0..100 {
            let ((p, previous), (next, _)) = (at_order(n, x), at_order(n + 1, x));
            slope = n as f64 * (x * p - previous) + (n as f64 + 1.0) * (x * next - p);
            let step = (p + next) * (x * x - 1.0) / slope;
            x -= step;
            if step.abs() <= f64::EPSILON {
                break;
            }
        }
        nodes[n - 1 - i] = 0.5 + 0.5 * x;
        weights[n - 1 - i] = (1.0 + x).powi(3) * (1.0 - x) / (slope * slope);
    }
    (nodes, weights)
}

/// The Legendre polynomials of order `n` and `n` - 1 at `x`.
fn at_order(n: usize, x: f64) -> (f64, f64) {
    let (mut p, mut previous) = (1.0, 0.0);
    for k in 0..n {
        let k = k as f64;
        (p, previous) = (((2.0 * k + 1.0) * x * p - k * previous) / (k + 1.0), p);
    }
    (p, previous)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_for_polynomials_times_x() {
        for n in 1..=40 {
            let (nodes, weights) = jacobi(n);
            assert!(nodes.is_sorted() && nodes[0] > 0.0 && nodes[n - 1] < 1.0);
            for degree in 0..2 * n {
                let sum: f64 =
                    nodes.iter().zip(&weights).map(|(x, w)| w * x.powi(degree as i32)).sum();
                assert!((sum * (degree + 2) as f64 - 1.0).abs() < 4e-14, "{n} {degree} {sum}");
            }
        }
    }

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
