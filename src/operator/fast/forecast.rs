//! What a fast operator would take, from a sample of its rows.

use rayon::prelude::*;

use super::{Demand, FastOperator, FastOptions};
use crate::monitor::Monitor;
use crate::operator::walk::Stage;

/// Receiving roots that are sampled.
const SAMPLES: usize = 12;

/// Curvature that radiosity is supposed to have: it departs from linear on a cluster of radius R in
/// a scene of size S by this times (R/S)^2 of the largest irradiance.
const CURVATURE: f64 = 0.5;

/// Forecast of the bytes: a few roots receive, from a surface whose radiosity is supposed to vary
/// once over the scene. Shadow lines take more, flat light less.
pub fn bytes(stage: Stage, options: &FastOptions) -> u64 {
    let Stage { mesh, clusters, .. } = stage;
    let size = mesh.bounds.extent();
    let mut deviation = vec![0.0; clusters.len()];
    for (root, r) in mesh.roots.iter().enumerate() {
        for depth in 0..=r.level {
            let radius = clusters.root_radius[root] / f64::from(1u32 << depth);
            let off = CURVATURE * (radius / size).powi(2);
            let first = clusters.number(root, depth, 0) as usize;
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
