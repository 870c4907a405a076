//! Interpolation on triangles: the far field between clusters.
//!
//! Both sides of a pair of clusters carry polynomials of total degree p - 1 ("order p") through
//! N = p (p + 1)/2 nodes. With Lagrange polynomials l_i on the receiving cluster and m_j on the
//! source,
//!
//! int_source u(Q) G(P, Q) dS ~ sum_i l_i(P) sum_j G(x_i, y_j) M_j,   M_j = int u m_j dS
//!
//! (Hackbusch & Boerm 2002, H^2-matrices by interpolation). Everything on one cluster is written
//! in barycentric weights, so that the matrices which move moments up and values down are the same
//! for all clusters of all shapes: they exist once, as templates, for each order.

use glam::{DVec2, DVec3};

use crate::kernel::quadrature::rule;
use crate::mesh::{Basis, barycentric, child};

/// Lowest order.
pub const LEAST_ORDER: usize = 2;

/// Highest order that is offered.
pub const MOST_INTERPOLATION_ORDER: usize = 14;

/// Clusters of at most this many levels take their moments straight from the elements.
pub const DIRECT_LEVELS: u32 = 3;

/// The triangle in whose plane coordinates x, y are the weights of the first two corners.
const REFERENCE: [DVec2; 3] = [DVec2::X, DVec2::Y, DVec2::ZERO];

/// Nodes and templates of one order.
pub struct Interpolation {
    /// Order p: total degree p - 1.
    pub order: usize,
    /// Barycentric weights of the nodes.
    pub nodes: Vec<DVec3>,
    /// For each child the values of the parent's Lagrange polynomials at the child's nodes:
    /// `[k][j * N + i]` is l_i at node j.
    children: [Vec<f64>; 4],
    /// Integrals of the elements' basis functions times l_i over a cluster of unit area, for
    /// clusters of 0, 1, ... levels: `[levels][column * N + i]`.
    moments: Vec<Vec<f64>>,
    /// Values of l_i at the collocation nodes, in the same layout.
    values: Vec<Vec<f64>>,
}

impl Interpolation {
    /// Templates of order `order` (from [`LEAST_ORDER`] to [`MOST_INTERPOLATION_ORDER`]) for
    /// elements of `basis`.
    pub fn new(order: usize, basis: Basis) -> Interpolation {
        let order = order.clamp(LEAST_ORDER, MOST_INTERPOLATION_ORDER);
        let nodes = nodes(order);
        let n = nodes.len();
        let inverse = inverse_vandermonde(&nodes, order);
        let lagrange = |w: DVec3| {
            let mut phi = vec![0.0; n];
            orthogonal(order, DVec2::new(w.x, w.y), &mut phi);
            let value = |i: usize| (0..n).map(|k| phi[k] * inverse[k * n + i]).sum::<f64>();
            (0..n).map(value).collect::<Vec<f64>>()
        };
        let within = |t: &[DVec2; 3], w: DVec3| {
            barycentric(&REFERENCE, w.x * t[0] + w.y * t[1] + w.z * t[2])
        };
        let children = std::array::from_fn(|k| {
            let t = child(&REFERENCE, k);
            nodes.iter().flat_map(|&w| lagrange(within(&t, w))).collect()
        });
        let (mut moments, mut values) = (vec![], vec![]);
        let mut elements = vec![REFERENCE];
        // Exact for a linear function times a polynomial of degree p - 1.
        let rule = rule(order / 2 + 1);
        for level in 0..=DIRECT_LEVELS {
            let area = 0.25f64.powi(level as i32);
            let columns = elements.len() * basis.nodes();
            let (mut integrals, mut at_nodes) = (vec![0.0; columns * n], vec![]);
            for (e, t) in elements.iter().enumerate() {
                for ((&x, &y), &weight) in rule.x.iter().zip(&rule.y).zip(&rule.weight) {
                    let w = DVec3::new(x, y, 1.0 - x - y);
                    let (phi, l) = (basis.values(w), lagrange(within(t, w)));
                    for (k, phi) in phi.iter().take(basis.nodes()).enumerate() {
                        let column = &mut integrals[(e * basis.nodes() + k) * n..][..n];
                        let factor = 2.0 * area * weight * phi;
                        column.iter_mut().zip(&l).for_each(|(sum, l)| *sum += factor * l);
                    }
                }
                for k in 0..basis.nodes() {
                    at_nodes.extend(lagrange(within(t, basis.node(k))));
                }
            }
            moments.push(integrals);
            values.push(at_nodes);
            elements = elements.iter().flat_map(|t| (0..4).map(move |k| child(t, k))).collect();
        }
        Interpolation { order, nodes, children, moments, values }
    }

    /// Number N of nodes.
    pub fn count(&self) -> usize {
        self.nodes.len()
    }

    /// Adds to the moments of a cluster `levels` above its elements, of the given area, what the
    /// node values `u` of the elements below contribute.
    pub fn add_moments<const C: usize>(
        &self,
        levels: u32,
        area: f64,
        u: &[[f64; C]],
        moments: &mut [[f64; C]],
    ) {
        let n = self.count();
        for (u, column) in u.iter().zip(self.moments[levels as usize].chunks_exact(n)) {
            let u = u.map(|u| area * u);
            for (m, l) in moments.iter_mut().zip(column) {
                for (m, u) in m.iter_mut().zip(u) {
                    *m += l * u;
                }
            }
        }
    }

    /// Adds to a parent's moments those of its child `k`.
    pub fn add_child<const C: usize>(&self, k: usize, child: &[[f64; C]], parent: &mut [[f64; C]]) {
        let n = self.count();
        for (m, l) in child.iter().zip(self.children[k].chunks_exact(n)) {
            for (parent, l) in parent.iter_mut().zip(l) {
                for (p, m) in parent.iter_mut().zip(m) {
                    *p += l * m;
                }
            }
        }
    }

    /// Adds to the values at the nodes of child `k` the polynomial with the parent's values.
    pub fn add_parent<const C: usize>(
        &self,
        k: usize,
        parent: &[[f64; C]],
        child: &mut [[f64; C]],
    ) {
        let n = self.count();
        for (value, l) in child.iter_mut().zip(self.children[k].chunks_exact(n)) {
            add_dot(l, parent, value);
        }
    }

    /// Adds to `out`, at the collocation nodes of the elements `levels` below a cluster, the
    /// polynomial with values `local` at the cluster's nodes.
    pub fn add_values<const C: usize>(
        &self,
        levels: u32,
        local: &[[f64; C]],
        out: &mut [[f64; C]],
    ) {
        let n = self.count();
        for (out, l) in out.iter_mut().zip(self.values[levels as usize].chunks_exact(n)) {
            add_dot(l, local, out);
        }
    }
}

fn add_dot<const C: usize>(l: &[f64], values: &[[f64; C]], out: &mut [f64; C]) {
    let mut sum = [0.0; C];
    for (l, value) in l.iter().zip(values) {
        for (s, v) in sum.iter_mut().zip(value) {
            *s += l * v;
        }
    }
    out.iter_mut().zip(sum).for_each(|(o, s)| *o += s);
}

/// The grid of Blyth & Pozrikidis (2006) on Chebyshev's extrema: Lebesgue constants grow slowly.
fn nodes(order: usize) -> Vec<DVec3> {
    let m = order - 1;
    let v = |i: usize| 0.5 - 0.5 * (std::f64::consts::PI * i as f64 / m as f64).cos();
    (0..=m)
        .flat_map(|i| (0..=m - i).map(move |j| (i, j, m - i - j)))
        .map(|(i, j, k)| {
            let third = |a: usize, b: usize, c: usize| (1.0 + 2.0 * v(a) - v(b) - v(c)) / 3.0;
            DVec3::new(third(i, j, k), third(j, k, i), third(k, i, j))
        })
        .collect()
}

/// Dubiner's polynomials of total degree below `order`, orthonormal on the triangle
/// {x, y >= 0, x + y <= 1}, at a point.
fn orthogonal(order: usize, at: DVec2, out: &mut [f64]) {
    let (x, y) = (at.x, at.y);
    let (along, across) = (2.0 * x + y - 1.0, 1.0 - y);
    let (mut q, mut before) = (1.0, 0.0);
    let mut index = 0;
    for i in 0..order {
        // Jacobi's polynomials with weight (1 - b)^(2i + 1), b = 2y - 1.
        let (alpha, b) = ((2 * i + 1) as f64, 2.0 * y - 1.0);
        let (mut p, mut last) = (1.0, 0.0);
        for j in 0..order - i {
            out[index] = q * p * (2.0 * alpha * (i + j + 1) as f64).sqrt();
            index += 1;
            let k = j as f64;
            let next = if j == 0 {
                0.5 * ((alpha + 2.0) * b + alpha)
            } else {
                let s = 2.0 * k + alpha;
                let c = 2.0 * (k + 1.0) * (k + alpha + 1.0) * s;
                let first = (s + 1.0) * ((s + 2.0) * s * b + alpha * alpha);
                (first * p - 2.0 * (k + alpha) * k * (s + 2.0) * last) / c
            };
            (p, last) = (next, p);
        }
        let k = i as f64;
        let next = ((2.0 * k + 1.0) * along * q - k * across * across * before) / (k + 1.0);
        (q, before) = (next, q);
    }
}

/// Inverse of the matrix of [`orthogonal`] at the nodes: column i holds the coefficients of l_i.
fn inverse_vandermonde(nodes: &[DVec3], order: usize) -> Vec<f64> {
    let n = nodes.len();
    // Row j: the polynomials at node j; beside it the unit matrix. Gauss & Jordan, with pivots.
    let mut rows: Vec<Vec<f64>> = nodes
        .iter()
        .enumerate()
        .map(|(j, w)| {
            let mut row = vec![0.0; 2 * n];
            orthogonal(order, DVec2::new(w.x, w.y), &mut row[..n]);
            row[n + j] = 1.0;
            row
        })
        .collect();
    for k in 0..n {
        let size = |j: usize| rows[j][k].abs();
        let pivot = (k..n).fold(k, |a, j| if size(j) > size(a) { j } else { a });
        rows.swap(k, pivot);
        let scale = 1.0 / rows[k][k];
        rows[k].iter_mut().for_each(|x| *x *= scale);
        let chosen = rows[k].clone();
        for (j, row) in rows.iter_mut().enumerate() {
            let factor = row[k];
            if j != k && factor != 0.0 {
                row.iter_mut().zip(&chosen).for_each(|(x, c)| *x -= factor * c);
            }
        }
    }
    rows.iter().flat_map(|row| row[n..].iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polynomial(degree: usize, w: DVec3) -> f64 {
        (0..=degree)
            .map(|k| (0.3 + k as f64) * w.x.powi(k as i32) * w.y.powi((degree - k) as i32))
            .sum()
    }

    #[test]
    fn polynomials_are_reproduced_at_every_level() {
        for order in LEAST_ORDER..=MOST_INTERPOLATION_ORDER {
            for basis in [Basis::Constant, Basis::Linear] {
                let own = Interpolation::new(order, basis);
                let f = |w: &DVec3| [polynomial(order - 1, *w)];
                let local: Vec<[f64; 1]> = own.nodes.iter().map(f).collect();
                let size = local.iter().map(|v| v[0].abs()).fold(0.0, f64::max);
                for levels in 0..=DIRECT_LEVELS {
                    let mut elements = vec![REFERENCE];
                    for _ in 0..levels {
                        elements =
                            elements.iter().flat_map(|t| (0..4).map(|k| child(t, k))).collect();
                    }
                    let mut out = vec![[0.0]; elements.len() * basis.nodes()];
                    own.add_values(levels, &local, &mut out);
                    for (i, got) in out.iter().enumerate() {
                        let (t, w) = (elements[i / basis.nodes()], basis.node(i % basis.nodes()));
                        let x = w.x * t[0] + w.y * t[1] + w.z * t[2];
                        let want = polynomial(order - 1, barycentric(&REFERENCE, x));
                        assert!((got[0] - want).abs() < 1e-12 * size, "order {order}");
                    }
                }
                for k in 0..4 {
                    let t = child(&REFERENCE, k);
                    let mut below = vec![[0.0]; own.count()];
                    own.add_parent(k, &local, &mut below);
                    for (got, w) in below.iter().zip(&own.nodes) {
                        let x = w.x * t[0] + w.y * t[1] + w.z * t[2];
                        let want = polynomial(order - 1, barycentric(&REFERENCE, x));
                        assert!((got[0] - want).abs() < 1e-12 * size, "order {order}");
                    }
                }
            }
        }
    }

    #[test]
    fn moments_do_not_depend_on_the_way_up() {
        for order in [2, 5, 9, 14] {
            let own = Interpolation::new(order, Basis::Linear);
            let u: Vec<[f64; 2]> =
                (0..192).map(|i| [(i as f64).sin(), 1.0 + (0.1 * i as f64).cos()]).collect();
            let n = own.count();
            let mut direct = vec![[0.0; 2]; n];
            own.add_moments(3, 2.0, &u, &mut direct);
            let mut stepwise = vec![[0.0; 2]; n];
            for k in 0..4 {
                let mut below = vec![[0.0; 2]; n];
                own.add_moments(2, 0.5, &u[48 * k..][..48], &mut below);
                own.add_child(k, &below, &mut stepwise);
            }
            for (a, b) in direct.iter().flatten().zip(stepwise.iter().flatten()) {
                assert!((a - b).abs() < 1e-12, "order {order}: {a} {b}");
            }
            // The Lagrange polynomials sum to 1: the moments to the integral of u.
            let sum: f64 = direct.iter().map(|m| m[0]).sum();
            let want = 2.0 / 192.0 * u.iter().map(|u| u[0]).sum::<f64>();
            assert!((sum - want).abs() < 1e-12);
        }
    }

    #[test]
    fn interpolation_is_stable() {
        for order in LEAST_ORDER..=MOST_INTERPOLATION_ORDER {
            let own = Interpolation::new(order, Basis::Linear);
            let lebesgue = own.values[3]
                .chunks_exact(own.count())
                .map(|l| l.iter().map(|l| l.abs()).sum::<f64>())
                .fold(0.0, f64::max);
            assert!(lebesgue < 25.0, "order {order}: {lebesgue}");
        }
    }
}
