//! Coefficients at rest: rounded to f32 where the tolerance allows.

use std::mem::size_of;

use crate::cluster::fit::Fit;

/// Numbers in f32 or f64. Sums over them run in f64.
pub enum Numbers {
    /// Rounded: relative error 6e-8.
    Single(Box<[f32]>),
    /// As computed.
    Double(Box<[f64]>),
}

/// Far pairs of some receivers, and their matrices.
pub struct FarPairs {
    /// The pairs.
    pub pairs: Box<[FarPair]>,
    /// Columns of N numbers, one a node of the receiver: G between the nodes of both sides, or the
    /// integrals of G times the three basis functions of the source's fit.
    pub matrices: Numbers,
}

/// Two clusters that are far from each other.
#[derive(Clone, Copy)]
pub struct FarPair {
    /// Number of the receiving cluster.
    pub receiver: u32,
    /// Number of the radiating one.
    pub source: u32,
    /// Whether the source is represented by its fit, not by its moments.
    pub by_fit: bool,
    /// Its first column.
    pub column: u32,
}

/// Links of consecutive nodes.
pub struct Links {
    /// End of each node's links.
    pub ends: Box<[u32]>,
    /// Numbers of the clusters.
    pub clusters: Box<[u32]>,
    /// Three coefficients each.
    pub coefficients: Numbers,
}

impl Numbers {
    /// Keeps numbers, rounded when `single`.
    pub fn keep(values: &[f64], single: bool) -> Numbers {
        if single {
            Numbers::Single(values.iter().map(|&x| x as f32).collect())
        } else {
            Numbers::Double(values.into())
        }
    }

    /// Bytes taken.
    pub fn bytes(&self) -> usize {
        match self {
            Numbers::Single(list) => size_of::<f32>() * list.len(),
            Numbers::Double(list) => size_of::<f64>() * list.len(),
        }
    }
}

impl FarPairs {
    /// Bytes taken.
    pub fn bytes(&self) -> usize {
        self.matrices.bytes() + size_of::<FarPair>() * self.pairs.len()
    }

    /// Adds to `local` the columns from `column` on times `values`.
    pub fn add<const C: usize>(&self, column: u32, values: &[[f64; C]], local: &mut [[f64; C]]) {
        let from = column as usize * local.len();
        match &self.matrices {
            Numbers::Single(list) => add_columns(&list[from..], values, local),
            Numbers::Double(list) => add_columns(&list[from..], values, local),
        }
    }
}

fn add_columns<T: Copy + Into<f64>, const C: usize>(
    matrix: &[T],
    values: &[[f64; C]],
    local: &mut [[f64; C]],
) {
    for (column, value) in matrix.chunks_exact(local.len()).zip(values) {
        for (l, &g) in local.iter_mut().zip(column) {
            let g: f64 = g.into();
            for (l, v) in l.iter_mut().zip(value) {
                *l += g * v;
            }
        }
    }
}

impl Links {
    /// Bytes taken.
    pub fn bytes(&self) -> usize {
        4 * (self.ends.len() + self.clusters.len()) + self.coefficients.bytes()
    }

    /// Adds to `out`, one entry a node, the coefficients times the fits.
    pub fn add<const C: usize>(&self, fits: &[Fit<C>], out: &mut [[f64; C]]) {
        match &self.coefficients {
            Numbers::Single(list) => self.add_rows(list, fits, out),
            Numbers::Double(list) => self.add_rows(list, fits, out),
        }
    }

    fn add_rows<T: Copy + Into<f64>, const C: usize>(
        &self,
        coefficients: &[T],
        fits: &[Fit<C>],
        out: &mut [[f64; C]],
    ) {
        let coefficients = coefficients.as_chunks::<3>().0;
        let mut begin = 0;
        for (out, &end) in out.iter_mut().zip(&self.ends) {
            let end = end as usize;
            let mut sum = [0.0; C];
            for (&cluster, c) in self.clusters[begin..end].iter().zip(&coefficients[begin..end]) {
                for (value, &c) in fits[cluster as usize].iter().zip(c) {
                    let c: f64 = c.into();
                    for (s, v) in sum.iter_mut().zip(value) {
                        *s += c * v;
                    }
                }
            }
            out.iter_mut().zip(sum).for_each(|(o, s)| *o += s);
            begin = end;
        }
    }

    /// Calls `each` with the number of each link's cluster and its form factor.
    pub fn form_factors(&self, mut each: impl FnMut(u32, f64)) {
        let sum = |k: usize| match &self.coefficients {
            Numbers::Single(list) => list[3 * k..3 * k + 3].iter().map(|&c| f64::from(c)).sum(),
            Numbers::Double(list) => list[3 * k..3 * k + 3].iter().sum::<f64>(),
        };
        for (k, &cluster) in self.clusters.iter().enumerate() {
            each(cluster, sum(k) / std::f64::consts::PI);
        }
    }
}
