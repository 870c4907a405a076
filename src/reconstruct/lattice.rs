//! Fifteen values on a triangle, and the polynomials through them.
//!
//! The nodes are those of all barycentric coordinates that are multiples of a quarter: corners and
//! midpoints of a triangle, then those of its four children. Through the first six there is a quadratic;
//! through the six of each child another, with an eighth of its error where light is smooth; through
//! all fifteen a polynomial of degree four.

use std::sync::LazyLock;

use glam::{DVec2, DVec3};

use crate::mesh::{barycentric, child};

/// Values at the corners, then at the midpoints of the sides opposite to them.
pub type Six = [DVec3; 6];

/// The nine nodes of the children that are not the parent's.
pub const NINE: [DVec3; 9] = [
    // On the sides a-b, b-c, c-a: the quarter points, after the first corner, before the second.
    DVec3::new(0.75, 0.25, 0.0),
    DVec3::new(0.25, 0.75, 0.0),
    DVec3::new(0.0, 0.75, 0.25),
    DVec3::new(0.0, 0.25, 0.75),
    DVec3::new(0.25, 0.0, 0.75),
    DVec3::new(0.75, 0.0, 0.25),
    // Of the sides of the inner triangle: beside a, b, c.
    DVec3::new(0.5, 0.25, 0.25),
    DVec3::new(0.25, 0.5, 0.25),
    DVec3::new(0.25, 0.25, 0.5),
];

/// Their places in a triangle, as midpoints: the same bits from both triangles at a side.
pub fn nine_nodes(&[a, b, c]: &[DVec2; 3]) -> [DVec2; 9] {
    let middle = |x: DVec2, y: DVec2| 0.5 * (x + y);
    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
    [
        middle(a, ab),
        middle(ab, b),
        middle(b, bc),
        middle(bc, c),
        middle(c, ca),
        middle(ca, a),
        middle(ab, ca),
        middle(ab, bc),
        middle(bc, ca),
    ]
}

/// The child that a point lies in, or nearest to.
pub fn part_of(corners: &[DVec2; 3], x: DVec2) -> usize {
    barycentric(corners, x).to_array().iter().position(|&w| w >= 0.5).unwrap_or(3)
}

/// The quadratic through six values at barycentric weights w.
pub fn quadratic(six: &Six, w: DVec3) -> DVec3 {
    let corner = |w: f64| w * (2.0 * w - 1.0);
    corner(w.x) * six[0]
        + corner(w.y) * six[1]
        + corner(w.z) * six[2]
        + 4.0 * (w.y * w.z * six[3] + w.z * w.x * six[4] + w.x * w.y * six[5])
}

/// Values at all fifteen nodes: the six, then those of [`NINE`].
#[derive(Clone, Copy, Debug)]
pub struct Fifteen([DVec3; 15]);

impl Fifteen {
    /// Values at the nodes of the triangle, and at the others.
    pub fn new(six: &Six, nine: &[DVec3; 9]) -> Fifteen {
        Fifteen(std::array::from_fn(|k| if k < 6 { six[k] } else { nine[k - 6] }))
    }

    /// The six values of each child as [`child`] numbers them and their corners: [a, ab, ca],
    /// [ab, b, bc], [ca, bc, c], [bc, ca, ab].
    pub fn children(&self) -> [Six; 4] {
        let [a, b, c, bc, ca, ab, rest @ ..] = self.0;
        let [a_ab, ab_b, b_bc, bc_c, c_ca, ca_a, by_a, by_b, by_c] = rest;
        [
            [a, ab, ca, by_a, ca_a, a_ab],
            [ab, b, bc, b_bc, by_b, ab_b],
            [ca, bc, c, bc_c, c_ca, by_c],
            [bc, ca, ab, by_a, by_b, by_c],
        ]
    }

    /// The polynomial of degree four through all values, at barycentric weights w.
    pub fn quartic(&self, w: DVec3) -> DVec3 {
        let weights = quartic_weights(w);
        self.0.iter().zip(weights).map(|(value, l)| l * *value).sum()
    }

    /// By how much that and the children's quadratics differ: mean square over the triangle, and the
    /// most of any channel, at the points of a rule of degree two on each child.
    pub fn difference(&self) -> (DVec3, f64) {
        let (mut squares, mut most) = (DVec3::ZERO, 0.0f64);
        for weights in DIFFERENCES.iter() {
            let off: DVec3 = self.0.iter().zip(weights).map(|(value, l)| *l * *value).sum();
            squares += off * off / DIFFERENCES.len() as f64;
            most = most.max(off.abs().max_element());
        }
        (squares, most)
    }
}

/// Lagrange's polynomials of the fifteen nodes at barycentric weights w: products of
/// 4w (4w - 1) ... / 1 / 2 ... in each coordinate.
fn quartic_weights(w: DVec3) -> [f64; 15] {
    let powers = |w: f64| {
        let t = 4.0 * w;
        let two = t * (t - 1.0) / 2.0;
        let three = two * (t - 2.0) / 3.0;
        [1.0, t, two, three, three * (t - 3.0) / 4.0]
    };
    let (x, y, z) = (powers(w.x), powers(w.y), powers(w.z));
    [
        x[4],
        y[4],
        z[4],
        y[2] * z[2],
        x[2] * z[2],
        x[2] * y[2],
        x[3] * y[1],
        x[1] * y[3],
        y[3] * z[1],
        y[1] * z[3],
        x[1] * z[3],
        x[3] * z[1],
        x[2] * y[1] * z[1],
        x[1] * y[2] * z[1],
        x[1] * y[1] * z[2],
    ]
}

/// What [`Fifteen::difference`] is at its points, by value.
static DIFFERENCES: LazyLock<[[f64; 15]; 12]> = LazyLock::new(|| {
    // Barycentric coordinates are affine: children of a triangle in the plane of two of them.
    let whole = [DVec2::X, DVec2::Y, DVec2::ZERO];
    let weights = |x: DVec2| barycentric(&whole, x);
    let unit =
        |node| Fifteen(std::array::from_fn(|k| if k == node { DVec3::ONE } else { DVec3::ZERO }));
    std::array::from_fn(|point| {
        let part = child(&whole, point / 3);
        let mut inner = DVec3::splat(1.0 / 6.0);
        inner[point % 3] = 2.0 / 3.0;
        let x = inner.x * part[0] + inner.y * part[1] + inner.z * part[2];
        std::array::from_fn(|node| {
            let values = unit(node);
            let fine = quadratic(&values.children()[point / 3], inner);
            (values.quartic(weights(x)) - fine).x
        })
    })
});

#[cfg(test)]
mod tests {
    use super::*;

    const T: [DVec2; 3] = [DVec2::ZERO, DVec2::new(2.0, 0.3), DVec2::new(0.4, 1.5)];

    fn at_nodes(f: impl Fn(DVec2) -> f64) -> Fifteen {
        let [a, b, c] = T;
        let value = |x| DVec3::splat(f(x));
        let six = [a, b, c, 0.5 * (b + c), 0.5 * (c + a), 0.5 * (a + b)].map(value);
        Fifteen::new(&six, &nine_nodes(&T).map(value))
    }

    fn inside() -> impl Iterator<Item = (DVec2, DVec3)> {
        (0..100).map(|k| {
            let (u, v) = (f64::from(k % 10) / 18.0, f64::from(k / 10) / 18.0);
            let x = T[0] + u * (T[1] - T[0]) + v * (T[2] - T[0]);
            (x, barycentric(&T, x))
        })
    }

    #[test]
    fn weights_and_places_of_the_nine_are_the_same() {
        for (w, x) in NINE.iter().zip(nine_nodes(&T)) {
            assert!((barycentric(&T, x) - *w).abs().max_element() < 1e-15, "{w} {x}");
        }
    }

    #[test]
    fn polynomials_are_reproduced() {
        let f = |x: DVec2| {
            1.0 - x.x + 0.3 * x.x.powi(3) * x.y - x.y.powi(4) + 0.7 * (x.x * x.y).powi(2)
        };
        let values = at_nodes(f);
        for (x, w) in inside() {
            assert!((values.quartic(w).x - f(x)).abs() < 1e-13);
        }
        let g = |x: DVec2| 1.0 - x.x + 0.3 * x.x * x.y - x.y * x.y;
        let values = at_nodes(g);
        let (six, four) = (std::array::from_fn(|k| values.0[k]), values.children());
        for (x, w) in inside() {
            let k = part_of(&T, x);
            let own = quadratic(&four[k], barycentric(&child(&T, k), x));
            assert!((own.x - g(x)).abs() < 1e-14 && (quadratic(&six, w).x - g(x)).abs() < 1e-14);
        }
        assert!(values.difference().1 < 1e-14);
    }

    #[test]
    fn the_difference_bounds_the_error_of_the_quartic() {
        let cases: [(&str, &dyn Fn(DVec2) -> f64); 4] = [
            ("smooth", &|x| (1.3 * x.x).sin() * (0.8 * x.y).exp()),
            ("kink", &|x| (x.x + 0.3 * x.y - 0.9).max(0.0)),
            ("crease", &|x| x.y.max(1e-9) * x.y.max(1e-9).ln()),
            ("peak", &|x| 1.0 / (0.1 + (x - DVec2::new(0.6, 0.4)).length_squared())),
        ];
        for (name, f) in cases {
            let values = at_nodes(f);
            let (squares, most) = values.difference();
            let errors: Vec<f64> = inside().map(|(x, w)| values.quartic(w).x - f(x)).collect();
            let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
            let largest = errors.iter().fold(0.0, |m: f64, e| m.max(e.abs()));
            println!("{name}: {rms:.2e} of {:.2e}, {largest:.2e} of {most:.2e}", squares.x.sqrt());
            assert!(rms < 1.4 * squares.x.sqrt() && largest < 2.5 * most, "{name}");
        }
    }
}
