//! Linear fits: the values of a piecewise polynomial on a cluster of any size, as three numbers.
//!
//! The fit of u on tau is its best approximation by a linear function in L2(tau), given by its
//! values at the three interior nodes of tau. With alpha = 1/6 these are the points of a rule that
//! is exact to degree 2, so that the basis is orthogonal, and the fit of a cluster follows from
//! the fits of its four children without solving anything.

use std::sync::LazyLock;

use glam::DVec2;
use rayon::prelude::*;

use super::Clusters;
use crate::mesh::{Basis, Mesh, barycentric, child};

/// Values at the interior nodes, for C channels.
pub type Fit<const C: usize> = [[f64; C]; 3];

/// Values of the parent's basis functions at the nodes of each child: `[k][j][i]` is function i at
/// node j of child k.
static PARENT_AT_CHILD: LazyLock<[[[f64; 3]; 3]; 4]> = LazyLock::new(|| {
    let reference = [DVec2::X, DVec2::Y, DVec2::ZERO];
    std::array::from_fn(|k| {
        let t = child(&reference, k);
        std::array::from_fn(|j| {
            let w = Basis::Linear.node(j);
            let x = w.x * t[0] + w.y * t[1] + w.z * t[2];
            Basis::Linear.values(barycentric(&reference, x))
        })
    })
});

/// The fits of all clusters to the piecewise polynomial with node values `u`.
pub fn fits<const C: usize>(mesh: &Mesh, clusters: &Clusters, u: &[[f64; C]]) -> Vec<Fit<C>> {
    bottom_up(mesh, clusters, [[0.0; C]; 3], |e| on_element(mesh.basis, u, e), join)
}

/// How far a fit is from what it stands for; of the channels the largest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// A bound on |u minus its fit| anywhere on the cluster.
    pub largest: f64,
    /// Root mean square over the cluster; the mean of |u minus its fit| is no larger.
    pub mean: f64,
}

impl Deviation {
    /// Of a cluster of which nothing is known.
    pub const UNKNOWN: Deviation = Deviation { largest: f64::INFINITY, mean: f64::INFINITY };

    /// A bound on the error of the irradiance at a point, |1/pi int (u - fit) G V|: with the largest
    /// deviation times the form factor (at most 1), or with the mean times area times the largest G.
    ///
    /// `factor` is a bound on area times G over pi anywhere on the cluster.
    pub fn error(&self, factor: f64) -> f64 {
        let by_mean = if factor.is_finite() { self.mean * factor } else { f64::INFINITY };
        by_mean.min(self.largest * factor.min(1.0))
    }

    /// The larger of both, each.
    pub fn or_larger(self, other: Deviation) -> Deviation {
        Deviation { largest: self.largest.max(other.largest), mean: self.mean.max(other.mean) }
    }
}

/// For each cluster the deviation of u from its fit.
///
/// A fit is off by at most what its children's fits are off, and its own difference from them.
pub fn deviations<const C: usize>(
    mesh: &Mesh,
    clusters: &Clusters,
    u: &[[f64; C]],
) -> Vec<Deviation> {
    let zero = ([[0.0; C]; 3], [(0.0, 0.0); C]);
    let all = bottom_up(
        mesh,
        clusters,
        zero,
        |e| (on_element(mesh.basis, u, e), [(0.0, 0.0); C]),
        |four| {
            let fit = join(&four.map(|(fit, _)| fit));
            let mut off_by = [(0.0f64, 0.0); C];
            for ((own, below), at) in four.iter().zip(PARENT_AT_CHILD.iter()) {
                for c in 0..C {
                    // The difference is linear on the child: largest at a corner, and the nodes
                    // integrate its square.
                    let fitted = at.map(|at| (0..3).map(|i| at[i] * fit[i][c]).sum::<f64>());
                    let off = [0, 1, 2].map(|j| own[j][c] - fitted[j]);
                    let sum = off[0] + off[1] + off[2];
                    // Interior nodes at 1/6: a corner has twice its node's value less the mean.
                    let corner = off.map(|off| (2.0 * off - sum / 3.0).abs());
                    let added = corner.into_iter().fold(0.0, f64::max);
                    let square = off.iter().map(|off| off * off).sum::<f64>() / 3.0;
                    let (largest, squares) = &mut off_by[c];
                    *largest = largest.max(below[c].0 + added);
                    *squares += 0.25 * (below[c].1 + square);
                }
            }
            (fit, off_by)
        },
    );
    let most = |values: [f64; C]| values.into_iter().fold(0.0, f64::max);
    all.iter()
        .map(|(_, off_by)| Deviation {
            largest: most(off_by.map(|o| o.0)),
            mean: most(off_by.map(|o| o.1)).sqrt(),
        })
        .collect()
}

fn on_element<const C: usize>(basis: Basis, u: &[[f64; C]], element: usize) -> Fit<C> {
    match basis {
        Basis::Constant => [u[element]; 3],
        Basis::Linear => [u[3 * element], u[3 * element + 1], u[3 * element + 2]],
    }
}

/// Mean square difference between the fit of a cluster and the fits of its children, per channel.
pub fn mismatch<const C: usize>(fit: &Fit<C>, children: &[Fit<C>; 4]) -> [f64; C] {
    let mut mean = [0.0; C];
    for (own, at) in children.iter().zip(PARENT_AT_CHILD.iter()) {
        for (value, at) in own.iter().zip(at) {
            for c in 0..C {
                let fitted: f64 = (0..3).map(|i| at[i] * fit[i][c]).sum();
                mean[c] += (value[c] - fitted).powi(2) / 12.0;
            }
        }
    }
    mean
}

/// The linear function with node values `fit`, at the nodes of a cluster's four children.
pub fn split<const C: usize>(fit: &Fit<C>) -> [Fit<C>; 4] {
    PARENT_AT_CHILD
        .map(|at| at.map(|at| std::array::from_fn(|c| (0..3).map(|i| at[i] * fit[i][c]).sum())))
}

/// The fit of a cluster to the fits of its children.
pub fn join<const C: usize>(children: &[Fit<C>; 4]) -> Fit<C> {
    let mut fit = [[0.0; C]; 3];
    for (own, at) in children.iter().zip(PARENT_AT_CHILD.iter()) {
        for (value, phi) in own.iter().zip(at) {
            for (f, phi) in fit.iter_mut().zip(phi) {
                for (f, v) in f.iter_mut().zip(value) {
                    *f += 0.25 * phi * v;
                }
            }
        }
    }
    fit
}

/// Something for every cluster: of each element, then of each cluster from its four children.
fn bottom_up<T: Copy + Send + Sync>(
    mesh: &Mesh,
    clusters: &Clusters,
    zero: T,
    leaf: impl Fn(usize) -> T + Sync,
    join: impl Fn(&[T; 4]) -> T + Sync,
) -> Vec<T> {
    let mut all = vec![zero; clusters.len()];
    let mut stretches = vec![];
    let mut rest = &mut all[..];
    for root in 0..mesh.roots.len() {
        let size = (clusters.first[root + 1] - clusters.first[root]) as usize;
        let (mine, others) = rest.split_at_mut(size);
        stretches.push(mine);
        rest = others;
    }
    stretches.into_par_iter().enumerate().for_each(|(index, values)| {
        let root = &mesh.roots[index];
        let (mut above, mut below) = values.split_at_mut(Clusters::before(root.level) as usize);
        for (k, value) in below.iter_mut().enumerate() {
            *value = leaf(root.first as usize + k);
        }
        for depth in (0..root.level).rev() {
            let (higher, level) = above.split_at_mut(Clusters::before(depth) as usize);
            for (value, four) in level.iter_mut().zip(below.as_chunks::<4>().0) {
                *value = join(four);
            }
            (above, below) = (higher, level);
        }
    });
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{MeshOptions, Refinement, build};
    use crate::scene::{Material, Object, Scene, Triangle};
    use glam::DVec3;

    fn mesh(level: u32) -> Mesh {
        let vertices = [DVec3::ZERO, DVec3::new(3.0, 0.2, 0.0), DVec3::new(0.5, 2.0, 1.0)];
        let triangle = Triangle {
            vertices,
            uv: [[DVec2::ZERO; 3]; 2],
            colour: [DVec3::ONE; 3],
            material: 0,
            object: 0,
        };
        let scene = Scene {
            triangles: vec![triangle],
            materials: vec![Material::plain("m", DVec3::splat(0.5))],
            objects: vec![Object { name: "o".into() }],
            ..Scene::default()
        };
        let refinement = Refinement::Levels(level);
        build(&scene, &MeshOptions { basis: Basis::Linear, refinement }).unwrap()
    }

    #[test]
    fn linear_functions_are_their_own_fits() {
        let mesh = mesh(3);
        let clusters = Clusters::build(&mesh);
        let f = |x: DVec3| [1.0 + 2.0 * x.x - x.y, x.z];
        let u: Vec<_> = (0..mesh.nodes()).map(|i| f(mesh.node(i).0)).collect();
        let fits = fits(&mesh, &clusters, &u);
        let (frame, root) = (&mesh.faces[0].frame, mesh.roots[0].corners);
        for (j, got) in fits[0].iter().enumerate() {
            let w = Basis::Linear.node(j);
            let want = f(frame.lift(w.x * root[0] + w.y * root[1] + w.z * root[2]));
            assert!((got[0] - want[0]).abs() < 1e-14 && (got[1] - want[1]).abs() < 1e-14);
        }
        assert!(
            deviations(&mesh, &clusters, &u).iter().all(|d| d.largest < 1e-13 && d.mean < 1e-14)
        );
    }

    #[test]
    fn deviations_of_a_quadratic_fall_by_four_a_level() {
        let mesh = mesh(6);
        let clusters = Clusters::build(&mesh);
        let u: Vec<_> = (0..mesh.nodes()).map(|i| [mesh.node(i).0.x.powi(2)]).collect();
        let deviations = deviations(&mesh, &clusters, &u);
        for depth in 0..3 {
            let at = |depth| deviations[clusters.number(0, depth, 0) as usize];
            for ratio in
                [at(depth).mean / at(depth + 1).mean, at(depth).largest / at(depth + 1).largest]
            {
                assert!((ratio - 4.0).abs() < 0.3, "{ratio}");
            }
            assert!(at(depth).mean < at(depth).largest);
        }
        let of_element = deviations[clusters.number(0, 6, 5) as usize];
        assert_eq!(of_element, Deviation { largest: 0.0, mean: 0.0 });
    }
}
