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
    expand_inline(view, centre, order, out);
}

/// [`expand`], to be compiled anew for each constant order.
#[inline(always)]
fn expand_inline(view: &View, centre: DVec2, order: usize, out: &mut [f64]) {
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

/// Adds d sum kappa_ij M_ij to `sum`: the far field of one cluster, for C channels.
pub fn far_sum<const C: usize>(
    order: usize,
    view: &View,
    centre: DVec2,
    moments: &[[f64; C]],
    sum: &mut [f64; C],
) {
    match order {
        1 => fixed::<1, C>(view, centre, moments, sum),
        2 => fixed::<2, C>(view, centre, moments, sum),
        3 => fixed::<3, C>(view, centre, moments, sum),
        4 => fixed::<4, C>(view, centre, moments, sum),
        5 => fixed::<5, C>(view, centre, moments, sum),
        6 => fixed::<6, C>(view, centre, moments, sum),
        _ => {
            let mut kappa = [0.0; count(MOST_ORDER)];
            expand(view, centre, order, &mut kappa);
            add(view.d, &kappa[..count(order)], moments, sum);
        }
    }
}

/// [`far_sum`] with a constant order: loops of known length unroll.
fn fixed<const M: usize, const C: usize>(
    view: &View,
    centre: DVec2,
    moments: &[[f64; C]],
    sum: &mut [f64; C],
) {
    let mut kappa = [0.0; count(6)];
    expand_inline(view, centre, M, &mut kappa);
    add(view.d, &kappa[..count(M)], moments, sum);
}

#[inline(always)]
fn add<const C: usize>(d: f64, kappa: &[f64], moments: &[[f64; C]], sum: &mut [f64; C]) {
    let mut total = [0.0; C];
    for (k, m) in kappa.iter().zip(moments) {
        for (t, m) in total.iter_mut().zip(m) {
            *t += k * m;
        }
    }
    for (s, t) in sum.iter_mut().zip(total) {
        *s += d * t;
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
}
