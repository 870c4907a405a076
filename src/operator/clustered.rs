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

use super::walk::{Counts, Rule, Scope, Seen, Stage, Walker, exact_entry};
use crate::error::{Error, Result};
use crate::far::{ClusterMoments, MOST_ORDER, far_sum};
use crate::geometry::Pieces;
use crate::kernel::{Precision, View};
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

/// Far clusters, face by face.
///
/// The walk meets the clusters of a level in the order of their numbers, so that most of them
/// continue a run: what is stored is the first of a run and how many there are.
#[derive(Default)]
struct FarList {
    /// A face, and the end of its runs.
    faces: Vec<(u32, u32)>,
    /// First cluster, and how many.
    runs: Vec<(u32, u32)>,
}

impl FarList {
    fn clear(&mut self) {
        self.faces.clear();
        self.runs.clear();
    }

    /// Adds a cluster of `face`; faces before number `row` of the list belong to other rows.
    fn push(&mut self, row: usize, face: u32, cluster: u32) {
        let same_face = self.faces[row..].last().is_some_and(|last| last.0 == face);
        match self.runs.last_mut() {
            Some(run) if same_face && run.0 + run.1 == cluster => run.1 += 1,
            _ => self.runs.push((cluster, 1)),
        }
        let end = self.runs.len() as u32;
        match self.faces.last_mut() {
            Some(last) if same_face => last.1 = end,
            _ => self.faces.push((face, end)),
        }
    }

    fn bytes(&self) -> usize {
        size_of::<(u32, u32)>() * (self.faces.len() + self.runs.len())
    }
}

/// Lists of consecutive rows.
#[derive(Default)]
struct Chunk {
    /// For each row the ends of its faces with far clusters and of its exact entries.
    rows: Vec<(u32, u32)>,
    far: FarList,
    elements: Vec<u32>,
    coefficients: Vec<f64>,
    counts: Counts,
    sizes: FieldSizes,
}

/// What an average node needs, from at most 256 sampled nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldForecast {
    /// Bytes of the list of far clusters of a node.
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
            Kept::All => self.far,
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
            let mut list = FarList::default();
            walker.cover(stage, point, normal, Rule::Far(eta), |scope, seen| {
                if let Seen::Far(cluster) = seen {
                    list.push(0, scope.index, cluster);
                }
            });
            (list.bytes() as u64, walker.counts.near + walker.counts.gray)
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
                walker.cover(stage, point, normal, Rule::Far(eta), |_, _| {});
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
            c.far.bytes() + 8 * (c.rows.len() + c.coefficients.len()) + 4 * c.elements.len()
        };
        self.chunks.iter().map(of).sum()
    }

    /// out = A u for C channels, with the operator's own order.
    pub fn apply<const C: usize>(&self, u: &[[f64; C]], out: &mut [[f64; C]]) {
        self.apply_channels(self.options.order, u, out);
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
        let n = mesh.basis.nodes();
        self.chunks.par_iter().zip(out.par_chunks_mut(ROWS_PER_TASK)).enumerate().for_each_init(
            <(Walker, FarList)>::default,
            |(walker, found), (index, (chunk, out))| {
                let (mut face, mut run, mut entry) = (0, 0, 0);
                let rows = out.iter_mut().zip(&chunk.rows).enumerate();
                for (k, (out, &(faces_end, entries_end))) in rows {
                    let (point, normal) = mesh.node(index * ROWS_PER_TASK + k);
                    let (list, range) = match self.kept {
                        Kept::All => (&chunk.far, face..faces_end as usize),
                        Kept::Exact => {
                            found.clear();
                            run = 0;
                            let eta = self.options.eta;
                            walker.cover(
                                self.stage,
                                point,
                                normal,
                                Rule::Far(eta),
                                |scope, seen| {
                                    if let Seen::Far(cluster) = seen {
                                        found.push(0, scope.index, cluster);
                                    }
                                },
                            );
                            (&*found, 0..found.faces.len())
                        }
                    };
                    let mut sum = [0.0; C];
                    for &(number, end) in &list.faces[range] {
                        let runs = &list.runs[run..end as usize];
                        add_far(self.stage, moments, number, runs, (point, normal), &mut sum);
                        run = end as usize;
                    }
                    face = faces_end as usize;
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

/// Adds the far field of runs of clusters of one face, as a point with a normal sees them.
fn add_far<const C: usize>(
    stage: Stage,
    moments: &ClusterMoments<C>,
    face: u32,
    runs: &[(u32, u32)],
    (point, normal): (DVec3, DVec3),
    sum: &mut [f64; C],
) {
    let view = View::new(&stage.mesh.faces[face as usize].frame, point, normal);
    for &(first, many) in runs {
        let centres = &stage.clusters.centre[first as usize..][..many as usize];
        far_sum(moments.order, &view, centres, moments.of(first, many), sum);
    }
}

/// A solution ready for gathering with the clustering of an operator.
pub struct ClusteredSource {
    options: ClusteredOptions,
    moments: ClusterMoments<3>,
    values: Vec<[f64; 3]>,
}

impl ClusteredSource {
    /// Computes the moments of the piecewise polynomial with node values `values`.
    pub fn new(stage: Stage, options: ClusteredOptions, values: &[DVec3]) -> ClusteredSource {
        let values: Vec<[f64; 3]> = values.iter().map(|u| u.to_array()).collect();
        let mut moments = ClusterMoments::new(stage.clusters, options.order);
        moments.compute(stage.mesh, stage.clusters, &values);
        ClusteredSource { options, moments, values }
    }

    /// Irradiance H = 1/pi int u G V at a point with the given unit normal: exact from near and
    /// gray elements, by Taylor polynomials from far clusters.
    pub fn gather(&self, walker: &mut Walker, stage: Stage, point: DVec3, normal: DVec3) -> DVec3 {
        let basis = stage.mesh.basis;
        let (mut clip, mut far) = (Pieces::default(), FarList::default());
        let mut sum = [0.0; 3];
        walker.cover(stage, point, normal, Rule::Far(self.options.eta), |scope, seen| {
            if let Seen::Far(cluster) = seen {
                far.push(0, scope.index, cluster);
            } else if let Some((element, c)) =
                exact_entry(scope, seen, basis, &Precision::EXACT, &mut clip)
            {
                let values = &self.values[element as usize * basis.nodes()..];
                for (c, value) in c.iter().zip(&values[..basis.nodes()]) {
                    for (s, v) in sum.iter_mut().zip(value) {
                        *s += c * v;
                    }
                }
            }
        });
        let mut run = 0;
        for &(face, end) in &far.faces {
            let runs = &far.runs[run..end as usize];
            add_far(stage, &self.moments, face, runs, (point, normal), &mut sum);
            run = end as usize;
        }
        DVec3::from_array(sum) / std::f64::consts::PI
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
        let row = chunk.far.faces.len();
        walker.cover(stage, point, normal, Rule::Far(eta), |scope: &Scope, seen| {
            if let Seen::Far(cluster) = seen {
                if kept == Kept::All {
                    chunk.far.push(row, scope.index, cluster);
                }
            } else if let Some((element, c)) =
                exact_entry(scope, seen, basis, &Precision::EXACT, clip)
            {
                chunk.elements.push(element);
                chunk.coefficients.extend_from_slice(&c[..basis.nodes()]);
            }
        });
        chunk.rows.push((chunk.far.faces.len() as u32, chunk.elements.len() as u32));
        chunk.counts += walker.counts;
        chunk.sizes = chunk.sizes.or_larger(sizes_of(&walker.counts));
    }
    chunk.far.faces.shrink_to_fit();
    chunk.far.runs.shrink_to_fit();
    chunk.elements.shrink_to_fit();
    chunk.coefficients.shrink_to_fit();
    chunk
}
