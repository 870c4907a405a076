//! The clustered operator of Hackbusch & Nowak (1989) for the occluded radiosity equation, AC
//! section 3: exact integrals over the near and the gray field, Taylor polynomials of the kernel
//! over the far field.
//!
//! For each node the members of its minimal admissible covering are listed once. Lists and exact
//! coefficients do not depend on the order of the polynomials, so one operator serves all orders.
//! What memory does not allow to be kept is found again in every product.

use std::mem::size_of;

use glam::DVec3;
use rayon::prelude::*;

use super::walk::{Counts, Scope, Seen, Stage, Walker, exact_entry};
use crate::error::{Error, Result};
use crate::far::{ClusterMoments, MOST_ORDER, far_sum};
use crate::geometry::Pieces;
use crate::kernel::View;
use crate::monitor::Monitor;

/// Rows that one task builds.
const ROWS_PER_TASK: usize = 64;

/// What is kept between products.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kept {
    /// Exact coefficients and lists of far clusters.
    All,
    /// Exact coefficients; far clusters are found again in every product.
    Exact,
}

/// How the surface is clustered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClusteredOptions {
    /// Admissibility R(tau) <= eta |P - A(tau)|; in (0, 1).
    pub eta: f64,
    /// Order m of the Taylor polynomials: total degree m - 1; 1 to [`MOST_ORDER`].
    pub order: usize,
}

impl ClusteredOptions {
    /// The options, checked.
    pub fn new(eta: f64, order: usize) -> Result<ClusteredOptions> {
        if !(eta > 0.0 && eta < 1.0) {
            return Err(Error::Usage(format!("eta is {eta}: it must lie between 0 and 1")));
        }
        if !(1..=MOST_ORDER).contains(&order) {
            return Err(Error::Usage(format!(
                "the order is {order}: it must lie between 1 and {MOST_ORDER}"
            )));
        }
        Ok(ClusteredOptions { eta, order })
    }
}

/// Sizes of the three fields, over all nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FieldSizes {
    /// Largest number of gray elements of a node: sigma_G of AC section 6.
    pub gray: u64,
    /// Largest number of near elements: sigma_N.
    pub near: u64,
    /// Largest number of far clusters: sigma_F.
    pub far: u64,
}

impl FieldSizes {
    fn or_larger(self, other: FieldSizes) -> FieldSizes {
        FieldSizes {
            gray: self.gray.max(other.gray),
            near: self.near.max(other.near),
            far: self.far.max(other.far),
        }
    }
}

/// The covering of every node, and its exact coefficients.
pub struct ClusteredOperator<'a> {
    stage: Stage<'a>,
    /// Eta and the order that [`ClusteredOperator::apply`] uses.
    pub options: ClusteredOptions,
    /// What is kept.
    pub kept: Kept,
    chunks: Vec<Chunk>,
    /// What was met on the way.
    pub counts: Counts,
    /// Largest fields.
    pub sizes: FieldSizes,
}

/// Lists of consecutive rows.
#[derive(Default)]
struct Chunk {
    /// For each row the ends of its runs and of its exact entries.
    rows: Vec<(u32, u32)>,
    /// Far clusters of one face: the face, and the end of its clusters in `far`.
    runs: Vec<(u32, u32)>,
    far: Vec<u32>,
    elements: Vec<u32>,
    coefficients: Vec<f64>,
    counts: Counts,
    sizes: FieldSizes,
}

/// Numbers of far clusters and exact elements of an average node, from at most 256 sampled nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldForecast {
    /// Far clusters a node.
    pub far: f64,
    /// Near and gray elements a node.
    pub exact: f64,
    nodes: f64,
    per_exact: f64,
}

impl FieldForecast {
    /// Bytes of what `kept` keeps.
    pub fn bytes(&self, kept: Kept) -> u64 {
        let far = match kept {
            Kept::All => self.far * size_of::<u32>() as f64,
            Kept::Exact => 0.0,
        };
        (self.nodes * (far + self.exact * self.per_exact)) as u64
    }
}

/// Forecasts the fields by covering sampled nodes.
pub fn forecast(stage: Stage, eta: f64) -> FieldForecast {
    let nodes = stage.mesh.nodes();
    let step = (nodes / 256).max(1);
    let sampled: Vec<usize> = (step / 2..nodes).step_by(step).collect();
    let found: Vec<(u64, u64)> = sampled
        .par_iter()
        .map_init(Walker::default, |walker, &node| {
            walker.counts = Counts::default();
            let (point, normal) = stage.mesh.node(node);
            walker.cover(stage, point, normal, eta, |_, _| {});
            (walker.counts.far, walker.counts.near + walker.counts.gray)
        })
        .collect();
    let mean = |f: fn(&(u64, u64)) -> u64| {
        found.iter().map(f).sum::<u64>() as f64 / found.len().max(1) as f64
    };
    FieldForecast {
        far: mean(|c| c.0),
        exact: mean(|c| c.1),
        nodes: nodes as f64,
        per_exact: (size_of::<u32>() + stage.mesh.basis.nodes() * size_of::<f64>()) as f64,
    }
}

/// Counts the largest fields of all nodes, without any integral.
pub fn field_sizes(stage: Stage, eta: f64, monitor: &Monitor) -> Result<FieldSizes> {
    let nodes = stage.mesh.nodes();
    let progress = monitor.stage("count", nodes as u64);
    let starts: Vec<usize> = (0..nodes).step_by(ROWS_PER_TASK).collect();
    starts
        .par_iter()
        .map_init(Walker::default, |walker, &start| {
            let end = (start + ROWS_PER_TASK).min(nodes);
            progress.advance((end - start) as u64)?;
            let mut sizes = FieldSizes::default();
            for node in start..end {
                walker.counts = Counts::default();
                let (point, normal) = stage.mesh.node(node);
                walker.cover(stage, point, normal, eta, |_, _| {});
                sizes = sizes.or_larger(sizes_of(&walker.counts));
            }
            Ok(sizes)
        })
        .try_reduce(FieldSizes::default, |a, b| Ok(a.or_larger(b)))
}

fn sizes_of(counts: &Counts) -> FieldSizes {
    FieldSizes { gray: counts.gray, near: counts.near, far: counts.far }
}

impl<'a> ClusteredOperator<'a> {
    /// Covers all nodes and computes the exact coefficients, keeping what `max_memory` (bytes)
    /// allows; [`Error::Memory`] when the exact coefficients alone are too many.
    pub fn build(
        stage: Stage<'a>,
        options: ClusteredOptions,
        max_memory: u64,
        monitor: &Monitor,
    ) -> Result<ClusteredOperator<'a>> {
        let forecast = forecast(stage, options.eta);
        let kept = if forecast.bytes(Kept::All) <= max_memory { Kept::All } else { Kept::Exact };
        if forecast.bytes(kept) > max_memory {
            return Err(Error::Memory {
                what: format!("the clustered operator of {} elements", stage.mesh.elements()),
                needed: forecast.bytes(kept),
                allowed: max_memory,
                remedy:
                    "choose larger elements (--max-edge, --subdivide), a larger --eta, or raise \
                         --max-memory"
                        .into(),
            });
        }
        let nodes = stage.mesh.nodes();
        let progress = monitor.stage("rows", nodes as u64);
        let starts: Vec<usize> = (0..nodes).step_by(ROWS_PER_TASK).collect();
        let chunks: Vec<Chunk> = starts
            .par_iter()
            .map_init(Default::default, |(walker, clip), &start| {
                let rows = start..(start + ROWS_PER_TASK).min(nodes);
                progress.advance(rows.len() as u64)?;
                Ok(chunk(walker, clip, stage, options.eta, kept, rows))
            })
            .collect::<Result<_>>()?;
        let mut counts = Counts::default();
        let mut sizes = FieldSizes::default();
        for chunk in &chunks {
            counts += chunk.counts;
            sizes = sizes.or_larger(chunk.sizes);
        }
        Ok(ClusteredOperator { stage, options, kept, chunks, counts, sizes })
    }

    /// Exact entries stored: pairs of a node and a near or gray element.
    pub fn entries(&self) -> usize {
        self.chunks.iter().map(|c| c.elements.len()).sum()
    }

    /// Bytes stored.
    pub fn bytes(&self) -> usize {
        let of = |c: &Chunk| {
            8 * (c.rows.len() + c.runs.len() + c.coefficients.len())
                + 4 * (c.far.len() + c.elements.len())
        };
        self.chunks.iter().map(of).sum()
    }

    /// out = A u for three right-hand sides at once, with the operator's own order.
    pub fn apply(&self, u: &[DVec3], out: &mut [DVec3]) {
        let values: Vec<[f64; 3]> = u.iter().map(|u| u.to_array()).collect();
        let mut product = vec![[0.0; 3]; u.len()];
        self.apply_channels(self.options.order, &values, &mut product);
        out.iter_mut().zip(product).for_each(|(o, p)| *o = DVec3::from_array(p));
    }

    /// out = A u for C channels, with polynomials of any order.
    pub fn apply_channels<const C: usize>(
        &self,
        order: usize,
        u: &[[f64; C]],
        out: &mut [[f64; C]],
    ) {
        let Stage { mesh, clusters, .. } = self.stage;
        let mut moments = ClusterMoments::<C>::new(clusters, order);
        moments.compute(mesh, clusters, u);
        let moments = &moments;
        let add_far = |view: &View, cluster: u32, sum: &mut [f64; C]| {
            let centre = clusters.centre[cluster as usize];
            far_sum(order, view, centre, moments.of(cluster), sum);
        };
        let n = mesh.basis.nodes();
        self.chunks.par_iter().zip(out.par_chunks_mut(ROWS_PER_TASK)).enumerate().for_each_init(
            Walker::default,
            |walker, (index, (chunk, out))| {
                let (mut run, mut far, mut entry) = (0, 0, 0);
                for (k, (out, &(runs_end, entries_end))) in
                    out.iter_mut().zip(&chunk.rows).enumerate()
                {
                    let (point, normal) = mesh.node(index * ROWS_PER_TASK + k);
                    let mut sum = [0.0; C];
                    match self.kept {
                        Kept::All => {
                            for &(face, far_end) in &chunk.runs[run..runs_end as usize] {
                                let frame = &mesh.faces[face as usize].frame;
                                let view = View::new(frame, point, normal);
                                for &cluster in &chunk.far[far..far_end as usize] {
                                    add_far(&view, cluster, &mut sum);
                                }
                                far = far_end as usize;
                            }
                            run = runs_end as usize;
                        }
                        Kept::Exact => {
                            let eta = self.options.eta;
                            walker.cover(self.stage, point, normal, eta, |scope, seen| {
                                if let Seen::Far(cluster) = seen {
                                    add_far(&scope.view, cluster, &mut sum);
                                }
                            });
                        }
                    }
                    let end = entries_end as usize;
                    let coefficients = chunk.coefficients[entry * n..end * n].chunks_exact(n);
                    for (&element, c) in chunk.elements[entry..end].iter().zip(coefficients) {
                        for (c, value) in c.iter().zip(&u[element as usize * n..][..n]) {
                            for (s, v) in sum.iter_mut().zip(value) {
                                *s += c * v;
                            }
                        }
                    }
                    entry = end;
                    *out = sum;
                }
            },
        );
    }
}

fn chunk(
    walker: &mut Walker,
    clip: &mut Pieces,
    stage: Stage,
    eta: f64,
    kept: Kept,
    rows: std::ops::Range<usize>,
) -> Chunk {
    let basis = stage.mesh.basis;
    let mut chunk = Chunk::default();
    for node in rows {
        walker.counts = Counts::default();
        let (point, normal) = stage.mesh.node(node);
        let first_run = chunk.runs.len();
        walker.cover(stage, point, normal, eta, |scope: &Scope, seen| {
            if let Seen::Far(cluster) = seen {
                if kept == Kept::All {
                    let last = chunk.runs[first_run..].last();
                    if last.is_none_or(|&(face, _)| face != scope.index) {
                        chunk.runs.push((scope.index, 0));
                    }
                    chunk.far.push(cluster);
                    if let Some(run) = chunk.runs.last_mut() {
                        run.1 = chunk.far.len() as u32;
                    }
                }
            } else if let Some((element, c)) = exact_entry(scope, seen, basis, clip) {
                chunk.elements.push(element);
                chunk.coefficients.extend_from_slice(&c[..basis.nodes()]);
            }
        });
        chunk.rows.push((chunk.runs.len() as u32, chunk.elements.len() as u32));
        chunk.counts += walker.counts;
        chunk.sizes = chunk.sizes.or_larger(sizes_of(&walker.counts));
    }
    chunk.far.shrink_to_fit();
    chunk.elements.shrink_to_fit();
    chunk.coefficients.shrink_to_fit();
    chunk
}
