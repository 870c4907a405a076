//! What a fast operator would take, from a sample of its rows.

use rayon::prelude::*;

use super::{Demand, FastOperator, FastOptions};
use crate::cluster::Clusters;
use crate::cluster::fit::Deviation;
use crate::monitor::Monitor;
use crate::operator::exact;
use crate::operator::walk::Stage;

/// Receiving roots that are sampled.
const SAMPLES: usize = 12;

/// From more roots than this samples would take long.
const MOST_ROOTS: usize = 2000;

/// Bytes of a link: the number of a cluster, three coefficients.
const LINK_BYTES: f64 = 16.0;

/// The sample is taken on a mesh that is coarsened to about this many elements.
const ELEMENTS: usize = 4000;

/// Bytes grow like n^q with this q: between 0.5 and 0.8 has been seen.
const GROWTH: f64 = 0.75;

/// Curvature that radiosity is supposed to have: it departs from linear on a cluster of radius R in
/// a scene of size S by this times (R/S)^2 of the largest irradiance.
const CURVATURE: f64 = 0.5;

/// Forecast of the bytes: a few roots receive, from a surface whose radiosity is supposed to vary
/// once over the scene. Shadow lines take more, flat light less.
pub fn bytes(stage: Stage, options: &FastOptions) -> u64 {
    let elements = stage.mesh.elements();
    let levels = ((elements as f64 / ELEMENTS as f64).log2() / 2.0).ceil().max(0.0) as u32;
    if levels == 0 {
        return sampled(stage, options);
    }
    let Ok(mesh) = stage.mesh.coarsened(levels) else { return u64::MAX };
    let clusters = Clusters::build(&mesh);
    let coarse = Stage { mesh: &mesh, clusters: &clusters, ..stage };
    let growth = (elements as f64 / mesh.elements() as f64).powf(GROWTH);
    (sampled(coarse, options) as f64 * growth) as u64
}

fn sampled(stage: Stage, options: &FastOptions) -> u64 {
    if stage.mesh.roots.len() > MOST_ROOTS {
        // Hardly any clusters: about the entries of the exact operator, in less memory each.
        let exact = exact::forecast(stage.mesh, stage.occluders);
        return (exact.nodes as f64 * exact.elements_per_row * LINK_BYTES) as u64;
    }
    let Stage { mesh, clusters, .. } = stage;
    let size = mesh.bounds.extent();
    let mut deviation = vec![Deviation::UNKNOWN; clusters.len()];
    for (root, r) in mesh.roots.iter().enumerate() {
        for depth in 0..=r.level {
            let radius = clusters.root_radius[root] / f64::from(1u32 << depth);
            let off = CURVATURE * (radius / size).powi(2);
            let first = clusters.number(root, depth, 0) as usize;
            let off = Deviation { largest: 2.0 * off, mean: off };
            deviation[first..][..1 << (2 * depth)].fill(off);
        }
    }
    let all = vec![true; mesh.roots.len()];
    let step = mesh.roots.len().div_ceil(SAMPLES).max(1);
    let sampled: Vec<usize> = (step / 2..mesh.roots.len()).step_by(step).collect();
    let found: Vec<(u64, u64)> = sampled
        .par_iter()
        .map(|&root| {
            let mut receives = vec![false; mesh.roots.len()];
            receives[root] = true;
            let demand = Demand::new(options, &deviation, 1.0, &all, &receives);
            let elements = 1u64 << (2 * mesh.roots[root].level);
            match FastOperator::build(stage, &demand, u64::MAX, &Monitor::silent()) {
                Ok(operator) => (elements, operator.bytes() as u64),
                Err(_) => (elements, 0),
            }
        })
        .collect();
    let (elements, bytes) = found.iter().fold((0, 0), |(e, b), (x, y)| (e + x, b + y));
    (bytes as f64 * mesh.elements() as f64 / elements.max(1) as f64) as u64
}
