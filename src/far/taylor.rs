//! Taylor coefficients of the kernel about a cluster's centre.

use glam::DVec2;

use super::MOST_ORDER;
use crate::kernel::View;

/// How many coefficients a polynomial of total degree below `order` in two variables has.
pub const fn count(order: usize) -> usize {
    order * (order + 1) / 2
}

/// Taylor coefficients kappa_ij, i + j < order, of (nP.r)/|r|^4 at the plane point `centre`, written
/// to `out` degree by degree: (0,0), (1,0), (0,1), (2,0), (1,1), (0,2), ...
///
/// With xi = x - A, r0 = A - foot and s0 = |r0|^2 + d^2, |r|^2 = s0 + 2 r0.xi + |xi|^2. Euler's
/// identity for the parts f_k of degree k of |r|^-4 gives
///
/// k s0 f_k = -2 (k + 1) (r0.xi) f_(k-1) - (k + 2) |xi|^2 f_(k-2),   f_0 = s0^-2,
///
/// and the numerator a.r0 - c d + a.xi multiplies that: O(m^2) work in all.
pub fn expand(view: &View, centre: DVec2, order: usize, out: &mut [f64]) {
    let r0 = centre - view.foot;
    let s0 = r0.length_squared() + view.d * view.d;
    let inverse = 1.0 / s0;
    let n0 = view.a.dot(r0) - view.c * view.d;
    let a = view.a;
    // Parts of degree k, k - 1 and k - 2; entry j belongs to xi_1^(k-j) xi_2^j.
    let mut parts = [[0.0; MOST_ORDER]; 3];
    parts[0][0] = inverse * inverse;
    out[0] = n0 * parts[0][0];
    let mut begin = 1;
    for k in 1..order {
        let (now, one, two) = (k % 3, (k + 2) % 3, (k + 1) % 3);
        let scale = inverse / k as f64;
        let (p, q) = (-2.0 * (k + 1) as f64 * scale, -((k + 2) as f64) * scale);
        for j in 0..=k {
            let mut value = 0.0;
            if j < k {
                value += p * r0.x * parts[one][j];
            }
            if j > 0 {
                value += p * r0.y * parts[one][j - 1];
            }
            if j + 2 <= k {
                value += q * parts[two][j];
            }
            if j >= 2 {
                value += q * parts[two][j - 2];
            }
            parts[now][j] = value;
            let mut kernel = n0 * value;
            if j < k {
                kernel += a.x * parts[one][j];
            }
            if j > 0 {
                kernel += a.y * parts[one][j - 1];
            }
            out[begin + j] = kernel;
        }
        begin += k + 1;
    }
}

/// Clusters that are expanded together: siblings come in fours, and runs of lists in multiples.
const LANES: usize = 4;

/// Adds d sum kappa_ij M_ij to `sum`, for C channels and for clusters of one plane that follow each
/// other: their centres, and their moments (count(order) each).
///
/// Clusters are taken `LANES` at a time, with the recurrence of [`expand`] in each lane; the sum
/// runs in a fixed order, cluster by cluster within a coefficient.
pub fn far_sum<const C: usize>(
    order: usize,
    view: &View,
    centres: &[DVec2],
    moments: &[[f64; C]],
    sum: &mut [f64; C],
) {
    let n = count(order);
    for (centres, moments) in centres.chunks(LANES).zip(moments.chunks(LANES * n)) {
        match order {
            1 => lanes::<1, C>(view, centres, moments, sum),
            2 => lanes::<2, C>(view, centres, moments, sum),
            3 => lanes::<3, C>(view, centres, moments, sum),
            4 => lanes::<4, C>(view, centres, moments, sum),
            5 => lanes::<5, C>(view, centres, moments, sum),
            6 => lanes::<6, C>(view, centres, moments, sum),
            7 => lanes::<7, C>(view, centres, moments, sum),
            8 => lanes::<8, C>(view, centres, moments, sum),
            _ => one_by_one(order, view, centres, moments, sum),
        }
    }
}

/// High orders, in no hurry.
fn one_by_one<const C: usize>(
    order: usize,
    view: &View,
    centres: &[DVec2],
    moments: &[[f64; C]],
    sum: &mut [f64; C],
) {
    let mut kappa = [0.0; count(MOST_ORDER)];
    for (centre, moments) in centres.iter().zip(moments.chunks(count(order))) {
        expand(view, *centre, order, &mut kappa);
        for (k, m) in kappa.iter().zip(moments) {
            for (s, m) in sum.iter_mut().zip(m) {
                *s += view.d * k * m;
            }
        }
    }
}

/// [`far_sum`] of at most [`LANES`] clusters with constant order M.
fn lanes<const M: usize, const C: usize>(
    view: &View,
    centres: &[DVec2],
    moments: &[[f64; C]],
    sum: &mut [f64; C],
) {
    type Lane = [f64; LANES];
    let n = count(M);
    // Lanes beyond the last cluster repeat the first; their moments are never read.
    let (mut x, mut y): (Lane, Lane) = ([0.0; LANES], [0.0; LANES]);
    for l in 0..LANES {
        let r0 = centres[if l < centres.len() { l } else { 0 }] - view.foot;
        (x[l], y[l]) = (r0.x, r0.y);
    }
    let inverse: Lane =
        std::array::from_fn(|l| 1.0 / (x[l] * x[l] + y[l] * y[l] + view.d * view.d));
    let (a, cd) = (view.a, view.c * view.d);
    let n0: Lane = std::array::from_fn(|l| a.x * x[l] + a.y * y[l] - cd);
    let mut total = [0.0; C];
    let mut dot = |index: usize, kappa: &Lane| {
        for (kappa, m) in kappa.iter().zip(moments.chunks_exact(n)) {
            for (t, m) in total.iter_mut().zip(&m[index]) {
                *t += kappa * m;
            }
        }
    };
    let mut two: [Lane; M] = [[0.0; LANES]; M];
    let mut one: [Lane; M] = [[0.0; LANES]; M];
    let mut now: [Lane; M] = [[0.0; LANES]; M];
    one[0] = std::array::from_fn(|l| inverse[l] * inverse[l]);
    dot(0, &std::array::from_fn(|l| n0[l] * one[0][l]));
    let mut begin = 1;
    for k in 1..M {
        let (p, q) = (-2.0 * (k + 1) as f64 / k as f64, -((k + 2) as f64) / k as f64);
        let px: Lane = std::array::from_fn(|l| p * inverse[l] * x[l]);
        let py: Lane = std::array::from_fn(|l| p * inverse[l] * y[l]);
        let qs: Lane = std::array::from_fn(|l| q * inverse[l]);
        for j in 0..=k {
            let mut value: Lane = [0.0; LANES];
            let mut kernel: Lane = [0.0; LANES];
            if j < k {
                let part = &one[j];
                for l in 0..LANES {
                    value[l] += px[l] * part[l];
                    kernel[l] += a.x * part[l];
                }
            }
            if j > 0 {
                let part = &one[j - 1];
                for l in 0..LANES {
                    value[l] += py[l] * part[l];
                    kernel[l] += a.y * part[l];
                }
            }
            if j + 2 <= k {
                let part = &two[j];
                for l in 0..LANES {
                    value[l] += qs[l] * part[l];
                }
            }
            if j >= 2 {
                let part = &two[j - 2];
                for l in 0..LANES {
                    value[l] += qs[l] * part[l];
                }
            }
            for l in 0..LANES {
                kernel[l] += n0[l] * value[l];
            }
            dot(begin + j, &kernel);
            now[j] = value;
        }
        begin += k + 1;
        (two, one, now) = (one, now, two);
    }
    for (s, t) in sum.iter_mut().zip(total) {
        *s += view.d * t;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Frame;
    use glam::DVec3;

    #[test]
    fn the_polynomial_approaches_the_kernel_at_its_order() {
        let frame = Frame::new(DVec3::ZERO, DVec3::Z);
        let view = View::new(&frame, DVec3::new(0.4, -1.1, 0.9), DVec3::new(0.3, 0.8, -0.5));
        let centre = DVec2::new(1.3, 0.7);
        let direction = DVec2::new(0.6, 0.8);
        for order in 1..=12 {
            let mut kappa = vec![0.0; count(order)];
            expand(&view, centre, order, &mut kappa);
            let error = |h: f64| {
                let xi = h * direction;
                let mut sum = 0.0;
                let mut index = 0;
                for k in 0..order {
                    for j in 0..=k {
                        sum += kappa[index] * xi.x.powi((k - j) as i32) * xi.y.powi(j as i32);
                        index += 1;
                    }
                }
                (view.d * sum - view.g(centre + xi)).abs()
            };
            // Large enough that the error of order 12 stays above the roundings.
            let rate = (error(0.4) / error(0.2)).log2();
            // Degree m - 1, so the error falls like h^m (or better, where a term vanishes).
            assert!(rate > order as f64 - 0.5 && rate < order as f64 + 2.0, "{order}: {rate}");
        }
    }

    #[test]
    fn lanes_agree_with_one_at_a_time() {
        let frame = Frame::new(DVec3::ZERO, DVec3::Z);
        let view = View::new(&frame, DVec3::new(0.4, -1.1, 0.9), DVec3::new(0.3, 0.8, -0.5));
        let centres: Vec<DVec2> = (0..13).map(|i| DVec2::new(i as f64 * 0.2, 0.1)).collect();
        for order in 1..=8 {
            let moments: Vec<[f64; 2]> =
                (0..13 * count(order)).map(|i| [(i as f64).sin(), (i as f64).cos()]).collect();
            let (mut fast, mut slow) = ([0.0; 2], [0.0; 2]);
            far_sum(order, &view, &centres, &moments, &mut fast);
            one_by_one(order, &view, &centres, &moments, &mut slow);
            for (a, b) in fast.iter().zip(slow) {
                assert!((a - b).abs() < 1e-12 * (1.0 + b.abs()), "{order}: {a} {b}");
            }
        }
    }
}
