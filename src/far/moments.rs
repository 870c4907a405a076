//! Moments of the radiosity over clusters, bottom up.

use glam::DVec2;
use rayon::prelude::*;

use super::{MOST_ORDER, count};
use crate::cluster::Clusters;
use crate::kernel::quadrature::rule;
use crate::mesh::{ALPHA, Basis, Mesh};

/// M_ij(tau) = int_tau u (x - A(tau))^(i, j) dS for every cluster, for C channels at once.
///
/// Layout: `values[(cluster * count(order) + index)]`, index as in [`super::expand`].
pub struct ClusterMoments<const C: usize> {
    /// Order m of the polynomials.
    pub order: usize,
    values: Vec<[f64; C]>,
}

impl<const C: usize> ClusterMoments<C> {
    /// Memory for the moments of a tree.
    pub fn new(clusters: &Clusters, order: usize) -> Self {
        ClusterMoments { order, values: vec![[0.0; C]; clusters.len() * count(order)] }
    }

    /// The moments of `many` clusters from number `first` on.
    pub fn of(&self, first: u32, many: u32) -> &[[f64; C]] {
        let n = count(self.order);
        &self.values[first as usize * n..][..many as usize * n]
    }

    /// Computes all moments of the piecewise polynomial with node values `u`: elements first, then
    /// each cluster from its children by moving their centres to its own.
    pub fn compute(&mut self, mesh: &Mesh, clusters: &Clusters, u: &[[f64; C]]) {
        let (order, n) = (self.order, count(self.order));
        let nodes = mesh.basis.nodes();
        // Each root owns a stretch of the values: roots are independent.
        let mut stretches = vec![];
        let mut rest = &mut self.values[..];
        for root in 0..mesh.roots.len() {
            let size = (clusters.first[root + 1] - clusters.first[root]) as usize * n;
            let (mine, others) = rest.split_at_mut(size);
            stretches.push(mine);
            rest = others;
        }
        stretches.into_par_iter().enumerate().for_each(|(index, values)| {
            let root = &mesh.roots[index];
            let centre = &clusters.centre[clusters.first[index] as usize..];
            let leaves = Clusters::before(root.level) as usize;
            let (above, bottom) = values.split_at_mut(leaves * n);
            bottom.par_chunks_mut(n).enumerate().for_each(|(k, out)| {
                let element = root.first as usize + k;
                let corners = &mesh.element_corners[element];
                let here = &u[element * nodes..][..nodes];
                element_moments(corners, centre[leaves + k], mesh.basis, here, order, out);
            });
            let mut below: &mut [[f64; C]] = bottom;
            let mut above = above;
            for depth in (0..root.level).rev() {
                let first = Clusters::before(depth) as usize;
                let (higher, level) = above.split_at_mut(first * n);
                let children = Clusters::before(depth + 1) as usize;
                level.par_chunks_mut(n).enumerate().for_each(|(k, out)| {
                    out.fill([0.0; C]);
                    for c in 4 * k..4 * k + 4 {
                        let shift = centre[children + c] - centre[first + k];
                        add_shifted(&below[c * n..][..n], shift, order, out);
                    }
                });
                below = level;
                above = higher;
            }
        });
    }
}

/// Adds moments about A' to moments about A = A' - shift: (x - A)^(i,j) by the binomial theorem.
fn add_shifted<const C: usize>(from: &[[f64; C]], shift: DVec2, order: usize, to: &mut [[f64; C]]) {
    let (px, py) = (powers(shift.x, order), powers(shift.y, order));
    let place = |i: usize, j: usize| count(i + j) + j;
    for k in 0..order {
        for j in 0..=k {
            let i = k - j;
            let mut sum = [0.0; C];
            for p in 0..=i {
                for q in 0..=j {
                    let factor = BINOMIAL[i][p] * BINOMIAL[j][q] * px[i - p] * py[j - q];
                    for (s, m) in sum.iter_mut().zip(&from[place(p, q)]) {
                        *s += factor * m;
                    }
                }
            }
            for (t, s) in to[place(i, j)].iter_mut().zip(sum) {
                *t += s;
            }
        }
    }
}

fn powers(x: f64, order: usize) -> [f64; MOST_ORDER] {
    let mut p = [1.0; MOST_ORDER];
    for k in 1..order {
        p[k] = p[k - 1] * x;
    }
    p
}

/// Binomial coefficients below [`MOST_ORDER`].
const BINOMIAL: [[f64; MOST_ORDER]; MOST_ORDER] = {
    let mut table = [[0.0; MOST_ORDER]; MOST_ORDER];
    let mut n = 0;
    while n < MOST_ORDER {
        table[n][0] = 1.0;
        let mut k = 1;
        while k <= n {
            table[n][k] = table[n - 1][k - 1] + if k < n { table[n - 1][k] } else { 0.0 };
            k += 1;
        }
        n += 1;
    }
    table
};

/// Moments of one element about `centre`, by a Gauss rule that is exact for them: u is linear and
/// the monomials have degree below `order`.
fn element_moments<const C: usize>(
    corners: &[DVec2; 3],
    centre: DVec2,
    basis: Basis,
    u: &[[f64; C]],
    order: usize,
    out: &mut [[f64; C]],
) {
    let [v1, v2, v3] = *corners;
    let (e1, e2, r) = (v2 - v1, v3 - v1, v1 - centre);
    let twice = e1.perp_dot(e2);
    // u = linear[0] + s linear[1] + t linear[2] at v1 + s e1 + t e2.
    let mut linear = [[0.0; C]; 3];
    for c in 0..C {
        match basis {
            Basis::Constant => linear[0][c] = u[0][c],
            Basis::Linear => {
                // Nodes 0, 1, 2 lie near v3, v2, v1.
                let sum = u[0][c] + u[1][c] + u[2][c];
                let corner = |near: f64| (near - ALPHA * sum) / (1.0 - 3.0 * ALPHA);
                let (at1, at2, at3) = (corner(u[2][c]), corner(u[1][c]), corner(u[0][c]));
                (linear[0][c], linear[1][c], linear[2][c]) = (at1, at2 - at1, at3 - at1);
            }
        }
    }
    out.fill([0.0; C]);
    // n points a direction are exact to degree 2n - 2 with the collapsed weight.
    let rule = rule(order / 2 + 1);
    for ((&s, &t), &w) in rule.x.iter().zip(&rule.y).zip(&rule.weight) {
        let x = r + s * e1 + t * e2;
        let value: [f64; C] = std::array::from_fn(|c| {
            twice * w * (linear[0][c] + s * linear[1][c] + t * linear[2][c])
        });
        let (px, py) = (powers(x.x, order), powers(x.y, order));
        let mut index = 0;
        for k in 0..order {
            for j in 0..=k {
                let monomial = px[k - j] * py[j];
                for (o, v) in out[index].iter_mut().zip(value) {
                    *o += monomial * v;
                }
                index += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_move_with_their_centre() {
        let corners = [DVec2::new(0.2, 0.1), DVec2::new(1.4, 0.3), DVec2::new(0.5, 1.2)];
        let u = [[1.0, 0.3], [2.0, -0.4], [0.5, 0.9]];
        for order in 1..=10 {
            let at = |centre: DVec2| {
                let mut out = vec![[0.0; 2]; count(order)];
                element_moments(&corners, centre, Basis::Linear, &u, order, &mut out);
                out
            };
            let (from, to) = (DVec2::new(0.6, 0.5), DVec2::new(-0.3, 0.9));
            let mut moved = vec![[0.0; 2]; count(order)];
            add_shifted(&at(from), from - to, order, &mut moved);
            for (a, b) in moved.iter().flatten().zip(at(to).iter().flatten()) {
                assert!((a - b).abs() < 1e-13 * (1.0 + b.abs()), "order {order}: {a} {b}");
            }
        }
    }

    #[test]
    fn the_rule_is_exact_for_what_it_integrates() {
        // int over the unit simplex of s^p t^q = p! q!/(p + q + 2)!, the centre at the origin.
        let corners = [DVec2::ZERO, DVec2::X, DVec2::Y];
        let factorial = |n: usize| (1..=n).map(|k| k as f64).product::<f64>();
        for order in 1..=MOST_ORDER {
            let mut out = vec![[0.0]; count(order)];
            element_moments(&corners, DVec2::ZERO, Basis::Constant, &[[1.0]], order, &mut out);
            for k in 0..order {
                for j in 0..=k {
                    let want = factorial(k - j) * factorial(j) / factorial(k + 2);
                    assert!((out[count(k) + j][0] / want - 1.0).abs() < 1e-12, "{order} {k} {j}");
                }
            }
        }
    }
}
