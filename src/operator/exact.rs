//! The exact operator: every coefficient computed, stored as sparse rows.

use std::mem::size_of;

use rayon::prelude::*;

use super::walk::{Counts, Stage, Walker};
use crate::error::{Error, Result};
use crate::mesh::Mesh;
use crate::monitor::{self, Monitor};
use crate::visibility::Occluders;

/// Rows that one task builds: enough to share its memory, few enough to share out evenly.
const ROWS_PER_TASK: usize = 32;

/// Sparse rows of exact coefficients int G V phi.
pub struct ExactOperator {
    chunks: Vec<Chunk>,
    nodes: usize,
    per_element: usize,
    /// What was met while the rows were built.
    pub counts: Counts,
}

/// Rows `ROWS_PER_TASK * i ..`: for each row a range of elements and their coefficients.
struct Chunk {
    ends: Vec<u32>,
    elements: Vec<u32>,
    coefficients: Vec<f64>,
    counts: Counts,
}

/// What the rows will take, before they are built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// Collocation nodes: rows.
    pub nodes: usize,
    /// Elements that a node faces, on average; an upper estimate of the entries of a row.
    pub elements_per_row: f64,
    /// Bytes of all rows.
    pub bytes: u64,
}

/// Forecasts the memory of the rows from the share of elements that sampled nodes face.
///
/// Hidden elements are counted although they take no memory: an upper estimate, exact for convex
/// rooms, but for the sampling (at most 512 nodes, evenly spaced).
pub fn forecast(mesh: &Mesh, occluders: &Occluders) -> Forecast {
    let nodes = mesh.nodes();
    let step = (nodes / 512).max(1);
    let sampled: Vec<usize> = (step / 2..nodes).step_by(step).collect();
    let tau = occluders.coincidence();
    let facing: Vec<u64> = sampled
        .par_iter()
        .map(|&node| {
            let (point, normal) = mesh.node(node);
            let faces = mesh.faces.iter().filter(|f| {
                f.frame.height(point) > tau
                    && f.corners.iter().any(|&c| (f.frame.lift(c) - point).dot(normal) > tau)
            });
            let roots = faces.flat_map(|f| &mesh.roots[f.roots.0 as usize..f.roots.1 as usize]);
            roots.map(|r| 1u64 << (2 * r.level)).sum()
        })
        .collect();
    let mean = facing.iter().sum::<u64>() as f64 / sampled.len().max(1) as f64;
    let entry = size_of::<u32>() + mesh.basis.nodes() * size_of::<f64>();
    let bytes = nodes as f64 * (mean * entry as f64 + size_of::<u32>() as f64);
    Forecast { nodes, elements_per_row: mean, bytes: bytes as u64 }
}

impl ExactOperator {
    /// Builds all rows, in parallel; the result does not depend on the number of threads.
    ///
    /// [`Error::Memory`] when the forecast exceeds `max_memory` bytes.
    pub fn build(stage: Stage, max_memory: u64, monitor: &Monitor) -> Result<ExactOperator> {
        let mesh = stage.mesh;
        let forecast = forecast(mesh, stage.occluders);
        if forecast.bytes > max_memory {
            return Err(Error::Memory {
                what: format!(
                    "the exact operator of {} elements ({} nodes)",
                    mesh.elements(),
                    forecast.nodes
                ),
                needed: forecast.bytes,
                allowed: max_memory,
                remedy: "choose larger elements (--max-edge, --subdivide), --basis constant, or \
                         raise --max-memory"
                    .into(),
            });
        }
        let nodes = mesh.nodes();
        let progress = monitor.stage("rows", nodes as u64);
        let starts: Vec<usize> = (0..nodes).step_by(ROWS_PER_TASK).collect();
        let chunks: Vec<Chunk> = starts
            .par_iter()
            .map_init(Walker::default, |walker, &start| {
                let rows = start..(start + ROWS_PER_TASK).min(nodes);
                chunk(walker, stage, rows, &progress)
            })
            .collect::<Result<_>>()?;
        let mut counts = Counts::default();
        chunks.iter().for_each(|c| counts += c.counts);
        Ok(ExactOperator { chunks, nodes, per_element: mesh.basis.nodes(), counts })
    }

    /// Entries stored: pairs of a node and an element.
    pub fn entries(&self) -> usize {
        self.chunks.iter().map(|c| c.elements.len()).sum()
    }

    /// Bytes stored.
    pub fn bytes(&self) -> usize {
        let rows = self.nodes * size_of::<u32>();
        rows + self.entries() * (size_of::<u32>() + self.per_element * size_of::<f64>())
    }

    /// out = A u for C channels at once; both have one entry a node.
    pub fn apply<const C: usize>(&self, u: &[[f64; C]], out: &mut [[f64; C]]) {
        let n = self.per_element;
        self.chunks.par_iter().zip(out.par_chunks_mut(ROWS_PER_TASK)).for_each(|(chunk, out)| {
            let mut begin = 0;
            for (&end, out) in chunk.ends.iter().zip(out) {
                let end = end as usize;
                let elements = &chunk.elements[begin..end];
                let coefficients = chunk.coefficients[begin * n..end * n].chunks_exact(n);
                let mut sum = [0.0; C];
                for (&element, c) in elements.iter().zip(coefficients) {
                    let values = &u[element as usize * n..][..n];
                    for (c, value) in c.iter().zip(values) {
                        for (s, v) in sum.iter_mut().zip(value) {
                            *s += c * v;
                        }
                    }
                }
                *out = sum;
                begin = end;
            }
        });
    }
}

fn chunk(
    walker: &mut Walker,
    stage: Stage,
    rows: std::ops::Range<usize>,
    progress: &monitor::Stage,
) -> Result<Chunk> {
    walker.counts = Counts::default();
    let n = stage.mesh.basis.nodes();
    let (mut ends, mut elements, mut coefficients) = (vec![], vec![], vec![]);
    for node in rows {
        progress.advance(1)?;
        let (point, normal) = stage.mesh.node(node);
        walker.row(stage, point, normal, |element, c| {
            elements.push(element);
            coefficients.extend_from_slice(&c[..n]);
        });
        ends.push(elements.len() as u32);
    }
    elements.shrink_to_fit();
    coefficients.shrink_to_fit();
    Ok(Chunk { ends, elements, coefficients, counts: walker.counts })
}
