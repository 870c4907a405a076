//! The imaginary part of the dilogarithm Li2 in the closed unit disc.
//!
//! With u = -ln(1 - z), Li2(z) = u - u^2/4 + sum_k B_2k u^(2k+1)/(2k+1)!, convergent for |u| < 2 pi
//! ('t Hooft & Veltman 1979, appendix A). For Re z > 1/2 the reflection
//! Li2(z) = pi^2/6 - ln z ln(1-z) - Li2(1-z) comes first, so that |u| <= pi/3 everywhere and ten
//! terms reach full precision.

/// B_2k / (2k+1)! for k = 1, 2, ...
const COEFFICIENTS: [f64; 10] = [
    2.777_777_777_777_778e-2,
    -2.777_777_777_777_778e-4,
    4.724_111_866_969_01e-6,
    -9.185_773_074_661_964e-8,
    1.897_886_998_897_1e-9,
    -4.064_761_645_144_225_6e-11,
    8.921_691_020_456_452e-13,
    -1.993_929_586_072_107_4e-14,
    4.518_980_029_619_918e-16,
    -1.035_651_761_218_124_7e-17,
];

/// Im Li2(x + iy) for |x + iy| <= 1.
pub fn im_li2(x: f64, y: f64) -> f64 {
    if y == 0.0 {
        return 0.0;
    }
    // ln(1 - z)
    let (lx, ly) = (0.5 * ((1.0 - x) * (1.0 - x) + y * y).ln(), (-y).atan2(1.0 - x));
    if x <= 0.5 {
        return series(-lx, -ly);
    }
    // ln z; its modulus is at most 1 and at least 1/2 here.
    let (zx, zy) = (0.5 * (x * x + y * y).ln(), y.atan2(x));
    -(zx * ly + zy * lx) - series(-zx, -zy)
}

/// Im of u - u^2/4 + sum B_2k u^(2k+1)/(2k+1)! at u = x + iy.
fn series(x: f64, y: f64) -> f64 {
    let (sx, sy) = (x * x - y * y, 2.0 * x * y);
    // Horner in u^2: p = sum B_2k/(2k+1)! (u^2)^(k-1)
    let (mut px, mut py) = (0.0, 0.0);
    for c in COEFFICIENTS.iter().rev() {
        (px, py) = (px * sx - py * sy + c, px * sy + py * sx);
    }
    // u (1 + u^2 p) - u^2/4
    let (qx, qy) = (1.0 + sx * px - sy * py, sx * py + sy * px);
    x * qy + y * qx - 0.25 * sy
}

/// Clausen's function Cl2(phi) = Im Li2(exp(i phi)).
pub fn clausen(cos_phi: f64, sin_phi: f64) -> f64 {
    im_li2(cos_phi, sin_phi)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// The defining series at r exp(i phi), for r < 1, smallest terms first.
    fn direct(r: f64, phi: f64) -> f64 {
        (1..20_000).rev().map(|k| r.powi(k) * (k as f64 * phi).sin() / (k as f64).powi(2)).sum()
    }

    #[test]
    fn agrees_with_the_defining_series() {
        for i in 0..60 {
            for r in [1e-9, 1e-3, 0.3, 0.7, 0.9, 0.99, 0.998] {
                let phi = PI * (i as f64 + 0.5) / 30.0;
                let (x, y) = (r * phi.cos(), r * phi.sin());
                let (got, want) = (im_li2(x, y), direct(r, phi));
                assert!(
                    (got - want).abs() <= 4e-16 + 2e-15 * want.abs(),
                    "{r} {phi}: {got} {want}"
                );
            }
        }
    }

    #[test]
    fn known_values_on_the_circle() {
        // Catalan's constant Cl2(pi/2), and the maximum Cl2(pi/3).
        assert!((clausen(0.0, 1.0) - 0.915_965_594_177_219).abs() < 4e-16);
        let (s, c) = (PI / 3.0).sin_cos();
        assert!((clausen(c, s) - 1.014_941_606_409_653_6).abs() < 4e-16);
    }
}
