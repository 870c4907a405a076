//! Closed forms of the zeroth and first moment of G over a polygon.
//!
//! The zeroth moment is Lambert's formula (1760); the first follows from the same use of Stokes'
//! theorem and leaves one integral W = int dA / |r|^2, a sum of dilogarithms over the edges (the
//! linearly varying luminaire of Chen & Arvo 2000). For the edge from r1 to r2, tau is its unit
//! tangent, nu = tau x nQ its outward normal in the plane, e the signed distance of the foot from
//! its line (positive inside), t1 and t2 the ends along tau, h = sqrt(e^2 + d^2):
//!
//! L = atan2(h len, h^2 + t1 t2)/h, Lam = 1/2 ln(|r2|^2/|r1|^2)
//!
//! int G     = -1/2 sum L [d (a.nu) + c e]
//!
//! int G rho = d/2 { W a - sum nu [L (e a.nu - d c) + (a.tau) Lam] }
//!
//! No division by d or e occurs. Errors: 4e-15 in int G for polygons that are not far; far away
//! the terms cancel, see [`super::quadrature`].

use glam::DVec2;

use super::dilogarithm::{clausen, im_li2};
use super::{Moments, View};

/// Moments over a polygon (need not be convex), counter-clockwise, above the horizon, d > 0.
pub fn moments(view: &View, polygon: &[DVec2], about: DVec2) -> Moments {
    let View { foot, d, a, c } = *view;
    let mut twice_zeroth = 0.0;
    let mut edges = DVec2::ZERO;
    let mut w = 0.0;
    let oblique = a != DVec2::ZERO;
    let mut r1 = polygon[polygon.len() - 1] - foot;
    for &corner in polygon {
        let r2 = corner - foot;
        let edge = r2 - r1;
        let len2 = edge.length_squared();
        if len2 > 0.0 {
            let len = len2.sqrt();
            let tau = edge / len;
            let nu = DVec2::new(tau.y, -tau.x);
            let (s1, s2) = (r1.length_squared() + d * d, r2.length_squared() + d * d);
            // From the nearer end, and each end's own t: t1 + len would lose all digits of t2.
            let e = if s1 < s2 { r1.dot(nu) } else { r2.dot(nu) };
            let (t1, t2) = (r1.dot(tau), r2.dot(tau));
            let h2 = e * e + d * d;
            let h = h2.sqrt();
            let l = (h * len).atan2(h2 + t1 * t2) / h;
            let argument = len * (t1 + t2) / s1;
            let lam =
                if argument.abs() < 0.5 { 0.5 * argument.ln_1p() } else { 0.5 * (s2 / s1).ln() };
            let a_nu = a.dot(nu);
            twice_zeroth -= l * (d * a_nu + c * e);
            edges += nu * (l * (e * a_nu - d * c) + a.dot(tau) * lam);
            if oblique && e != 0.0 {
                w += wedge(e, t1, t2, d, h);
            }
        }
        r1 = r2;
    }
    let zeroth = 0.5 * twice_zeroth;
    let first = 0.5 * d * (w * a - edges);
    Moments { zeroth, first: first + zeroth * (foot - about) }
}

/// Integral of 1/|r|^2 over the triangle from the foot to an edge, signed by the side of the edge.
///
/// sgn(e) [w(theta2) - w(theta1)] with tan theta = t/|e|, q = (d/(h + |e|))^2 and
/// w = 1/2 { -theta ln q + Im Li2(-exp(2 i theta)) - Im Li2(-q exp(2 i theta)) }.
fn wedge(e: f64, t1: f64, t2: f64, d: f64, h: f64) -> f64 {
    let size = e.abs();
    let root = d / (h + size);
    let q = root * root;
    let minus_ln_q = 2.0 * (size / d).asinh();
    let turn = |t: f64| {
        let s = e * e + t * t;
        let (cos, sin) = ((e * e - t * t) / s, 2.0 * size * t / s);
        t.atan2(size) * minus_ln_q + clausen(-cos, -sin) - im_li2(-q * cos, -q * sin)
    };
    0.5 * e.signum() * (turn(t2) - turn(t1))
}
