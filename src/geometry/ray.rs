//! Watertight intersection of a ray with a triangle, decided in f64.
//!
//! Signs of three scalar triple products of the corners relative to the ray's origin decide, with
//! the same expression for an edge in both triangles that share it: a ray through a shared edge
//! or corner hits at least one of them (Kensler & Shirley 2006; Woop, Benthin & Wald 2013 for the
//! argument).

use glam::DVec3;

/// A hit: distance in units of the ray's direction, and weights of the corners (sum 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// x = origin + t direction.
    pub t: f64,
    /// Barycentric coordinates.
    pub weights: DVec3,
}

/// Where the ray meets the closed triangle; both sides count, parallel rays miss.
pub fn intersect(origin: DVec3, direction: DVec3, triangle: &[DVec3; 3]) -> Option<Hit> {
    let [a, b, c] = triangle.map(|x| x - origin);
    let edge = |p: DVec3, q: DVec3| {
        // p x q and q x p must be exact opposites: they are, product by product.
        direction.dot(p.cross(q))
    };
    let (u, v, w) = (edge(c, b), edge(a, c), edge(b, a));
    let mixed = (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0);
    let sum = u + v + w;
    if mixed || sum == 0.0 {
        return None;
    }
    let weights = DVec3::new(u, v, w) / sum;
    let point = weights.x * a + weights.y * b + weights.z * c;
    let t = point.dot(direction) / direction.length_squared();
    t.is_finite().then_some(Hit { t, weights })
}
