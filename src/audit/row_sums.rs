//! Exact sums of rows: 1/pi int G V, the share of a point's hemisphere that radiating sides fill.
//!
//! It is at most 1, and exactly 1 where all that a point sees radiates. More than 1 means that
//! surfaces are counted twice: they lie on each other, and were not resolved when the file was read.
//! Light would grow there with each reflection. Rays cannot show this; exact visibility does, and
//! costs up to seconds a point. Points are taken until that work is done.

use std::collections::BTreeMap;

use glam::DVec3;
use rayon::prelude::*;

use super::Surveyed;
use super::finding::{Finding, Kind, Severity};
use crate::cluster::Clusters;
use crate::error::Result;
use crate::mesh::{self, Basis, Contacts, MeshOptions, Refinement};
use crate::monitor::Monitor;
use crate::operator::{Counts, Stage, Walker, gather};
use crate::visibility::Occluders;

/// A sum above this is a finding: far above roundings, far below what matters.
const MOST: f64 = 1.0 + 1e-6;

/// Work that is done at most, but for the last points: [`work`], about three seconds of one core.
const WORK: u64 = 3_000_000;

/// Most points.
const MOST_POINTS: usize = 256;

/// With more faces than this even one point would take too long, and none is looked at.
const MOST_FACES: usize = 150_000;

/// Row sums at some points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowSums {
    /// Points at which they were computed; none in scenes of very many faces.
    pub points: usize,
    /// Smallest and largest; 0 without points.
    pub least: f64,
    /// See `least`.
    pub largest: f64,
}

/// Row sums, what was cut at contacts, and findings.
pub(super) fn find(
    survey: &Surveyed,
    monitor: &Monitor,
) -> Result<(RowSums, Contacts, Vec<Finding>)> {
    let scene = survey.scene;
    let options = MeshOptions { basis: Basis::Constant, refinement: Refinement::Levels(0) };
    let mesh = mesh::build(scene, &options)?;
    let triangles: Vec<[DVec3; 3]> = scene.triangles.iter().map(|t| t.vertices).collect();
    let occluders = Occluders::build(&triangles);
    let clusters = Clusters::build(&mesh);
    let stage = Stage { mesh: &mesh, clusters: &clusters, occluders: &occluders };
    let order = if mesh.faces.len() > MOST_FACES { vec![] } else { order(survey) };
    let sums = sums(survey, stage, &order, monitor)?;
    let all = || sums.iter().copied();
    let found = RowSums {
        points: sums.len(),
        least: all().reduce(f64::min).unwrap_or(0.0),
        largest: all().reduce(f64::max).unwrap_or(0.0),
    };
    Ok((found, mesh.contacts, findings(survey, &order, &sums)))
}

/// Points that see something that radiates, each beginning of the list spread over all of them.
fn order(survey: &Surveyed) -> Vec<usize> {
    let sees = |i: &usize| survey.looks[*i].count(|m| !m.black) > 0;
    let mut order: Vec<usize> = (0..survey.points.len()).filter(sees).collect();
    let mut places: Vec<(u32, usize)> =
        order.iter().enumerate().map(|(k, &i)| ((k as u32).wrapping_mul(0x9e37_79b9), i)).collect();
    // Multiples of the golden ratio are spread evenly: their first ones over the whole list.
    places.sort_unstable();
    order = places.into_iter().map(|(_, i)| i).collect();
    order.truncate(MOST_POINTS);
    order
}

/// Sums at the first points of a list.
fn sums(survey: &Surveyed, stage: Stage, order: &[usize], monitor: &Monitor) -> Result<Vec<f64>> {
    let ones = vec![DVec3::ONE; stage.mesh.elements()];
    let progress = monitor.stage("row sums", order.len() as u64);
    let (mut sums, mut done) = (vec![], 0);
    let mut next = 1;
    while sums.len() < order.len() {
        let block = &order[sums.len()..(sums.len() + next).min(order.len())];
        let found: Vec<(f64, u64)> = block
            .par_iter()
            .map_init(Walker::default, |walker, &i| {
                progress.advance(1)?;
                walker.counts = Counts::default();
                let point = &survey.points[i];
                let sum = gather(walker, stage, &ones, point.position, point.normal).x;
                Ok((sum, work(&walker.counts)))
            })
            .collect::<Result<_>>()?;
        for (sum, own) in found {
            sums.push(sum);
            done += own;
        }
        // Twice as many as before, if there is work left for them.
        let each = (done / sums.len() as u64).max(1);
        next = (2 * next).min((WORK.saturating_sub(done) / each) as usize);
        if next == 0 {
            break;
        }
    }
    Ok(sums)
}

/// About how many microseconds a point took: what is clear is quick, what is clipped is slow. Measured
/// on scenes of 40 and of 57,000 triangles, right to a factor of three.
fn work(counts: &Counts) -> u64 {
    counts.faces_clear + counts.near + 30 * (counts.faces_shaded + counts.gray)
}

fn findings(survey: &Surveyed, order: &[usize], sums: &[f64]) -> Vec<Finding> {
    // By object: how many points, the largest sum and its place.
    let mut worst: BTreeMap<u32, (usize, f64, DVec3)> = BTreeMap::new();
    for (&i, &sum) in order.iter().zip(sums).filter(|(_, sum)| **sum > MOST) {
        let point = &survey.points[i];
        let own = worst.entry(survey.parts.objects[point.part as usize]).or_insert((
            0,
            0.0,
            point.position,
        ));
        own.0 += 1;
        if sum > own.1 {
            (own.1, own.2) = (sum, point.position);
        }
    }
    let finding = |(object, (points, sum, at)): (u32, (usize, f64, DVec3))| {
        let text = format!(
            "{points} of the {} points looked at see more than their hemisphere, up to {sum:.6} of it: \
             surfaces are counted twice",
            sums.len()
        );
        Finding::new(Severity::Error, Kind::RowSum, survey.object(object), text).at(at).remedy(
            "look for faces that lie on each other in what is seen from here, and delete one",
        )
    };
    worst.into_iter().map(finding).collect()
}
