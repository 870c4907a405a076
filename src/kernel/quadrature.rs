//! Gauss rules for polygons that are far away compared with their size.
//!
//! The polygon is cut into a fan of triangles; each takes a tensor Gauss rule on the unit simplex
//! by the collapsing map (s, t) -> (s (1 - t), s t), whose Jacobian s is the weight of the rule in s.

use std::sync::LazyLock;

use glam::DVec2;

use super::gauss;
use super::{Moments, View};

/// Largest number of points a direction.
const MOST_POINTS: usize = 16;

/// Points that are summed side by side.
const LANES: usize = 4;

/// One rule on the unit simplex {x, y >= 0, x + y <= 1}, weights summing to 1/2. Points of weight
/// zero fill it up to a multiple of four.
pub struct Rule {
    /// First coordinates.
    pub x: Vec<f64>,
    /// Second coordinates.
    pub y: Vec<f64>,
    /// Weights.
    pub weight: Vec<f64>,
}

static RULES: LazyLock<Vec<Rule>> = LazyLock::new(|| {
    (0..=MOST_POINTS)
        .map(|n| {
            let (along, across) = (gauss::jacobi(n), gauss::legendre(n));
            let mut rule = Rule { x: vec![], y: vec![], weight: vec![] };
            for (s, ws) in along.0.iter().zip(&along.1) {
                for (t, wt) in across.0.iter().zip(&across.1) {
                    rule.x.push(s * (1.0 - t));
                    rule.y.push(s * t);
                    rule.weight.push(ws * wt);
                }
            }
            while !rule.weight.len().is_multiple_of(LANES) {
                rule.x.push(0.0);
                rule.y.push(0.0);
                rule.weight.push(0.0);
            }
            rule
        })
        .collect()
});

/// The rule with `points` points a direction (1 to 16), exact to degree 2 points - 1.
pub fn rule(points: usize) -> &'static Rule {
    &RULES[points.clamp(1, MOST_POINTS)]
}

/// Points a direction that reach 1e-12 for a polygon of radius `ratio` times its distance.
pub fn points_for(ratio: f64) -> usize {
    const LADDER: [(f64, usize); 4] = [(0.125, 9), (0.0625, 7), (0.02, 5), (0.004, 4)];
    LADDER.iter().find(|(above, _)| ratio > *above).map_or(3, |(_, n)| *n)
}

/// Largest ratio of radius to distance at which `points` points a direction keep errors below
/// `bound` times area/distance^2; at most 0.7.
///
/// With rho = ratio/(1 + sqrt(1 - ratio^2)) errors of n points are below 0.8 rho^(2n - 1): on a line through
/// a polygon of radius 1 the integrand's poles are 1/ratio away from the middle, so that 1/rho is the size
/// (sum of semi-axes) of the largest ellipse about it in which it is analytic (Davis & Rabinowitz, section
/// 4.6), and rules of n points see 2n - 1 of the coefficients, one of which the first moment takes. A
/// search for the worst triangles and receivers found up to 0.75 rho^(2n - 1) for ratios of 0.01 to 0.7 and
/// 1 to 8 points (a test tries thousands).
pub fn ratio_for(points: usize, bound: f64) -> f64 {
    let rho = (bound / 0.8).min(1.0).powf(1.0 / (2 * points - 1) as f64);
    (2.0 * rho / (1.0 + rho * rho)).min(0.7)
}

/// Integrals over a convex polygon with `points` Gauss points a direction and triangle (1 to 16).
pub fn moments(view: &View, polygon: &[DVec2], about: DVec2, points: usize) -> Moments {
    let rule = rule(points);
    let mut sum = Moments::default();
    let origin = polygon[0];
    let d2 = view.d * view.d;
    for pair in polygon[1..].windows(2) {
        let (e1, e2) = (pair[0] - origin, pair[1] - origin);
        let shift = origin - view.foot;
        let (mut m0, mut mx, mut my) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        let points = rule.x.as_chunks::<LANES>().0.iter();
        let points = points.zip(rule.y.as_chunks::<LANES>().0);
        for ((x, y), w) in points.zip(rule.weight.as_chunks::<LANES>().0) {
            for l in 0..LANES {
                let (ox, oy) = (x[l] * e1.x + y[l] * e2.x, x[l] * e1.y + y[l] * e2.y);
                let (rx, ry) = (shift.x + ox, shift.y + oy);
                let s = rx * rx + ry * ry + d2;
                let g = w[l] * (view.a.x * rx + view.a.y * ry - view.c * view.d) / (s * s);
                m0[l] += g;
                mx[l] += g * ox;
                my[l] += g * oy;
            }
        }
        let sum_of = |m: [f64; LANES]| (m[0] + m[1]) + (m[2] + m[3]);
        let (m0, mx, my) = (sum_of(m0), sum_of(mx), sum_of(my));
        let scale = view.d * e1.perp_dot(e2);
        // First moments about the fan's own corner, then moved: no cancellation.
        sum.zeroth += scale * m0;
        sum.first += scale * (DVec2::new(mx, my) + m0 * (origin - about));
    }
    sum
}
