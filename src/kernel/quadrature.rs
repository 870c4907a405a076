//! Gauss rules for polygons that are far away compared with their size.
//!
//! The polygon is cut into a fan of triangles; each takes a tensor Gauss rule on the unit simplex
//! by the collapsing map (s, t) -> (s (1 - t), s t), whose Jacobian s is kept in the weights.

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
            let (nodes, weights) = gauss::legendre(n);
            let mut rule = Rule { x: vec![], y: vec![], weight: vec![] };
            for (s, ws) in nodes.iter().zip(&weights) {
                for (t, wt) in nodes.iter().zip(&weights) {
                    rule.x.push(s * (1.0 - t));
                    rule.y.push(s * t);
                    rule.weight.push(ws * wt * s);
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

/// The rule with `points` points a direction (1 to 16), exact to degree 2 points - 2.
pub fn rule(points: usize) -> &'static Rule {
    &RULES[points.clamp(1, MOST_POINTS)]
}

/// Points a direction that reach 1e-12 for a polygon of radius `ratio` times its distance.
pub fn points_for(ratio: f64) -> usize {
    const LADDER: [(f64, usize); 5] =
        [(0.125, 11), (0.0625, 8), (0.03125, 6), (0.015, 5), (0.002, 4)];
    LADDER.iter().find(|(above, _)| ratio > *above).map_or(3, |(_, n)| *n)
}

/// Largest ratio of radius to distance at which `points` points a direction keep errors below
/// `bound` times area/distance^2; at most 0.7.
///
/// Errors of n points are below 0.6 (0.35 ratio^2)^(n - 1): 0.58 is the most that a search for the
/// worst triangles and receivers found, at ratio 0.7 (a test tries thousands). The integrand's poles
/// lie at a distance 1/ratio, so that each point more gains the square of the ratio.
pub fn ratio_for(points: usize, bound: f64) -> f64 {
    if points == 1 {
        return if bound >= 0.6 { 0.7 } else { 0.0 };
    }
    ((bound / 0.6).powf(1.0 / (points - 1) as f64) / 0.35).sqrt().min(0.7)
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
