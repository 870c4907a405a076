//! Known solutions, and the emissivity that makes them solutions: AC (6.8), (5.2) and (6.7).

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::surface::{A, B, Piece, Surface};
use crate::error::Result;
use crate::geometry::polygon::Linear;
use crate::geometry::{Frame, Pieces};
use crate::kernel::{View, gauss};
use crate::mesh::Basis;
use crate::operator::walk::{Walker, gather};
use crate::visibility::{Coverage, Observer, Shadows};

/// Reflectivity of all experiments of section 6.
pub const RHO: f64 = 0.1;

/// A solution given in advance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solution {
    /// (6.8): 1 on S1, 0 elsewhere. Collocation reproduces it.
    Indicator,
    /// (5.2): on S1 exp(-gamma (2B-x)(2B-y)) [(x/A)^2 + (y/A)^3] [(2B-x)+ (2B-y)+]^beta, 1 on S2,
    /// S3 and S4, 0 on S5.
    Kinked {
        /// Exponent of the kink (1: continuous with a bounded, discontinuous gradient).
        beta: f64,
        /// Decay away from the shadow line.
        gamma: f64,
    },
}

impl Solution {
    /// (5.2) as in Tables 6.8 to 6.11.
    pub const PAPER: Solution = Solution::Kinked { beta: 1.0, gamma: 1.5 };

    /// u at a point of a piece.
    pub fn at(self, piece: Piece, x: DVec3) -> f64 {
        match (self, piece) {
            (Solution::Indicator, 0) => 1.0,
            (Solution::Indicator, _) | (Solution::Kinked { .. }, 4) => 0.0,
            (Solution::Kinked { .. }, 1..=3) => 1.0,
            (Solution::Kinked { beta, gamma }, _) => {
                let (p, q) = (2.0 * B - x.x, 2.0 * B - x.y);
                if p <= 0.0 || q <= 0.0 {
                    return 0.0;
                }
                let bend = (x.x / A).powi(2) + (x.y / A).powi(3);
                (-gamma * p * q).exp() * bend * (p * q).powf(beta)
            }
        }
    }

    /// u at the nodes of a refined surface.
    pub fn at_nodes(self, surface: &Surface) -> Vec<f64> {
        let nodes = surface.mesh.basis.nodes();
        (0..surface.mesh.nodes())
            .map(|i| self.at(surface.piece(i / nodes), surface.mesh.node(i).0))
            .collect()
    }

    /// E = u - rho/pi int u G V at the nodes, (6.7), to 1e-13.
    ///
    /// Where u is constant on a piece the integral is a closed form over what is visible of it. The
    /// part of S1 where (5.2) varies is [0, 2B]^2, cut by shadows into convex pieces on which u G is
    /// smooth; see [`integrate`].
    pub fn emissivity(self, surface: &Surface) -> Result<Vec<f64>> {
        let coarse = Surface::new(Basis::Constant, 0)?;
        let constant: Vec<DVec3> = (0..coarse.mesh.elements())
            .map(|e| match (self, coarse.piece(e)) {
                (Solution::Kinked { .. }, 0) => DVec3::ZERO,
                (_, piece) => DVec3::splat(self.at(piece, DVec3::ZERO)),
            })
            .collect();
        let floor = coarse.mesh.faces[0].frame;
        let u = self.at_nodes(surface);
        Ok((0..surface.mesh.nodes())
            .into_par_iter()
            .map_init(<(Walker, Sight)>::default, |(walker, sight), i| {
                let (point, normal) = surface.mesh.node(i);
                let mut h = gather(walker, coarse.stage(), &constant, point, normal).x;
                if let Solution::Kinked { beta, .. } = self {
                    h += sight.varying_part(self, beta, &coarse, &floor, point, normal)
                        / std::f64::consts::PI;
                }
                u[i] - RHO * h
            })
            .collect())
    }
}

/// Memory for looking at the part of S1 where u varies.
#[derive(Default)]
struct Sight {
    shadows: Shadows,
    active: Vec<u32>,
    clip: Pieces,
}

impl Sight {
    /// int u G V over [0, 2B]^2 of S1.
    fn varying_part(
        &mut self,
        solution: Solution,
        beta: f64,
        coarse: &Surface,
        floor: &Frame,
        point: DVec3,
        normal: DVec3,
    ) -> f64 {
        let view = View::new(floor, point, normal);
        let occluders = &coarse.occluders;
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
            .map(|(x, y)| floor.project(DVec3::new(x, y, 0.0) * 2.0 * B));
        let horizon: Linear = view.horizon(occluders.magnitude);
        if view.d <= occluders.coincidence() || horizon.nowhere_positive(&corners) {
            return 0.0;
        }
        self.clip.clear();
        self.clip.push_clipped(&corners, &horizon);
        let observer = Observer { occluders, point, normal };
        self.shadows.look_from(&observer);
        let above = self.clip.get(0).to_vec();
        self.active.clear();
        self.shadows.find(&observer, floor, &above, &mut self.active);
        let to = self.active.len();
        if to > 0 && self.shadows.narrow(&above, &mut self.active, 0) == Coverage::Hidden {
            return 0.0;
        }
        let integrand = |x: DVec2| solution.at(0, floor.lift(x)) * view.g(x);
        let pieces = self.shadows.visible(&above, &self.active[to..]);
        pieces.iter().map(|piece| integrate(piece, beta, &integrand)).sum()
    }
}

/// Integral over a convex polygon inside [0, 2B]^2 of a function that is smooth but for powers
/// beta of the distances from x = 2B and from y = 2B.
///
/// The polygon is cut into slabs at the x of its corners; in a slab y runs between two lines. Each
/// interval is cut into panels no longer than 1 (the distance of S1 from what sees it, so that G's
/// poles stay away), with 16 Gauss points each; the substitution t^q flattens the singular end.
/// (S1's frame has the coordinate axes, so plane coordinates are x and y.)
pub fn integrate(polygon: &[DVec2], beta: f64, f: &dyn Fn(DVec2) -> f64) -> f64 {
    let mut cuts: Vec<f64> = polygon.iter().map(|p| p.x).collect();
    cuts.sort_by(f64::total_cmp);
    let power = if beta.fract() == 0.0 {
        1
    } else if (2.0 * beta).fract() == 0.0 {
        2
    } else {
        8
    };
    let mut sum = 0.0;
    for pair in cuts.windows(2) {
        if pair[1] - pair[0] <= 1e-14 * A {
            continue;
        }
        sum += panels(pair[0], pair[1], power, |x| {
            let (low, high) = crossing(polygon, x);
            panels(low, high, power, |y| f(DVec2::new(x, y)))
        });
    }
    sum
}

/// The interval of y in which the line of constant x meets a convex polygon.
fn crossing(polygon: &[DVec2], x: f64) -> (f64, f64) {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for i in 0..polygon.len() {
        let (p, q) = (polygon[i], polygon[(i + 1) % polygon.len()]);
        if (p.x - x) * (q.x - x) <= 0.0 && p.x != q.x {
            let y = p.y + (x - p.x) / (q.x - p.x) * (q.y - p.y);
            (low, high) = (low.min(y), high.max(y));
        }
    }
    (low, high)
}

/// Composite Gauss rule on [low, high] within [0, 2B]; the panel at 2B is mapped by t^power.
fn panels(low: f64, high: f64, power: i32, f: impl Fn(f64) -> f64) -> f64 {
    let length = high - low;
    if length.is_nan() || length <= 0.0 {
        return 0.0;
    }
    let (nodes, weights) = &*RULE;
    let count = length.ceil().max(1.0);
    let size = length / count;
    let singular = power > 1 && (2.0 * B - high).abs() <= 1e-12 * A;
    let mut sum = 0.0;
    for panel in 0..count as usize {
        let last = panel + 1 == count as usize;
        let begin = low + size * panel as f64;
        let mut part = 0.0;
        for (t, w) in nodes.iter().zip(weights) {
            if singular && last {
                let slope = f64::from(power) * t.powi(power - 1);
                part += w * slope * f(high - size * t.powi(power));
            } else {
                part += w * f(begin + size * t);
            }
        }
        sum += size * part;
    }
    sum
}

static RULE: std::sync::LazyLock<(Vec<f64>, Vec<f64>)> =
    std::sync::LazyLock::new(|| gauss::legendre(16));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quadrature_meets_known_integrals() {
        let square =
            [(1.0, 0.5), (4.0, 0.5), (4.0, 4.0), (1.0, 4.0)].map(|(x, y)| DVec2::new(x, y));
        let triangle = [(0.0, 0.0), (4.0, 1.0), (2.0, 4.0)].map(|(x, y)| DVec2::new(x, y));
        for beta in [0.5, 1.0, 1.5, 0.3, 2.0] {
            let f = |x: DVec2| ((4.0 - x.x) * (4.0 - x.y)).powf(beta);
            let one = |l: f64| l.powf(beta + 1.0) / (beta + 1.0);
            let want = one(3.0) * one(3.5);
            let got = integrate(&square, beta, &f);
            assert!((got / want - 1.0).abs() < 1e-12, "{beta}: {got} {want}");
        }
        let area = integrate(&triangle, 1.0, &|_| 1.0);
        assert!((area - 7.0).abs() < 1e-13, "{area}");
    }

    #[test]
    fn the_emissivity_does_not_depend_on_the_panels() {
        // The same integral over the whole of [0, 2B]^2 and over parts with other corners, and so
        // with other slabs and panels, seen from the places on S2, S4 and S5 that are worst.
        let floor = Frame::new(DVec3::ZERO, DVec3::Z);
        let p = |x: f64, y: f64| DVec2::new(x, y);
        let whole = [p(0.0, 0.0), p(4.0, 0.0), p(4.0, 4.0), p(0.0, 4.0)];
        let hub = p(1.37, 2.71);
        let triangles = (0..4).map(|k| vec![hub, whole[k], whole[(k + 1) % 4]]).collect::<Vec<_>>();
        let rectangles = (0..4).map(|k| {
            let (low, high) = (hub.min(whole[k]), hub.max(whole[k]));
            vec![low, p(high.x, low.y), high, p(low.x, high.y)]
        });
        let rectangles = rectangles.collect::<Vec<_>>();
        let places = [
            (DVec3::new(1.99, 1.99, 1.0), DVec3::NEG_Z),
            (DVec3::new(0.01, 0.99, 2.0), DVec3::NEG_Z),
            (DVec3::new(3.9, 5.0, 0.01), DVec3::NEG_Y),
        ];
        for (point, normal) in places {
            let view = View::new(&floor, point, normal);
            for beta in [1.0, 0.5, 2.0] {
                let solution = Solution::Kinked { beta, gamma: 1.5 };
                let f = |x: DVec2| solution.at(0, floor.lift(x)) * view.g(x);
                let once = integrate(&whole, beta, &f);
                let sum = |parts: &[Vec<DVec2>]| -> f64 {
                    parts.iter().map(|part| integrate(part, beta, &f)).sum()
                };
                // Shadows of the plate cut rectangles; slanted sides are only for whole powers.
                let other = if beta.fract() == 0.0 { sum(&triangles) } else { sum(&rectangles) };
                assert!((once - other).abs() < 1e-13, "{point} {beta}: {once} {other}");
                assert!((once - sum(&rectangles)).abs() < 1e-13, "{point} {beta}");
            }
        }
    }
}
