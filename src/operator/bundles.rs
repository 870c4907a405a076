//! Irradiance from bundles of rays: for scenes of so many small faces that each sees little of the
//! hemisphere.
//!
//! With directions spread like cos/pi the irradiance is the mean of the radiosities that n rays
//! meet,
//!
//! ```text
//! H(P) = 1/n sum_k u(x(P, d_k))
//! ```
//!
//! which is off by about u_C sqrt(F_C)/n^(3/4) for each thing of radiosity u_C that fills the share
//! F_C of the hemisphere: very little for many small things alike, too much for few bright ones.
//! Lamps are left to exact gathering. Directions depend on the point alone ([`super::hemisphere`]),
//! so that all channels and all solutions meet the same faces, and so does every run.

use glam::DVec3;
use rayon::prelude::*;

use super::hemisphere::{direction, flips};
use super::lamps::{Lamps, Samples};
use super::patches::{Patches, Spot};
use super::walk::Walker;
use crate::error::{Error, Result};
use crate::geometry::{COINCIDENCE, Frame, RayTree};
use crate::mesh::Mesh;
use crate::monitor::Monitor;
use crate::scene::Scene;

/// A spot is buried if more than this share of its rays meet sides that do not radiate: the inside
/// of what stands on it.
const BURIED: f64 = 0.5;

/// Of a distance, roundings of points that were computed.
const ROUNDINGS: f64 = 1e-12;

/// What rays meet.
pub struct RayScene {
    tree: RayTree,
    /// Front and back face of each triangle, where it radiates.
    sides: Vec<[Option<u32>; 2]>,
    /// Nothing nearer than this is met, metres.
    beyond: f64,
}

/// What one ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Met {
    Nothing,
    /// A side that does not radiate.
    Black,
    /// A patch, on a face at a distance (squared), at a cosine.
    Patch {
        number: u32,
        face: u32,
        square: f64,
        cosine: f64,
    },
}

impl RayScene {
    /// Prepares a meshed scene.
    pub fn new(scene: &Scene, mesh: &Mesh) -> RayScene {
        let mut sides = vec![[None; 2]; scene.triangles.len()];
        for (i, face) in mesh.faces.iter().enumerate() {
            sides[face.triangle as usize][usize::from(face.back)] = Some(i as u32);
        }
        let triangles: Vec<[DVec3; 3]> = scene.triangles.iter().map(|t| t.vertices).collect();
        let tree = RayTree::build(&triangles, |i, back| sides[i][usize::from(back)].is_some());
        RayScene { tree, sides, beyond: COINCIDENCE * mesh.magnitude }
    }

    /// Whether anything stands between two points; sides that touch either do not count.
    pub fn is_blocked(&self, walker: &mut Walker, from: DVec3, to: DVec3) -> bool {
        let along = to - from;
        let length = along.length();
        let hit = self.tree.nearest(from, along / length, self.beyond, &mut walker.boxes);
        hit.is_some_and(|hit| hit.t < length * (1.0 - ROUNDINGS) - self.beyond)
    }

    fn cast(
        &self,
        walker: &mut Walker,
        mesh: &Mesh,
        patches: &Patches,
        origin: DVec3,
        direction: DVec3,
    ) -> Met {
        let hit = self.tree.nearest(origin, direction, self.beyond, &mut walker.boxes);
        let Some(hit) = hit else { return Met::Nothing };
        match self.sides[hit.triangle as usize][usize::from(hit.back)] {
            None => Met::Black,
            Some(face) => {
                let frame = &mesh.faces[face as usize].frame;
                let x = frame.project(origin + hit.t * direction);
                Met::Patch {
                    number: patches.at(face, x) as u32,
                    face,
                    square: hit.t * hit.t,
                    cosine: -direction.dot(frame.n),
                }
            }
        }
    }
}

/// Rows of an operator on patches: irradiance at each spot is a mean of the radiosities of patches.
pub struct Rows {
    /// Patch and weight, one row after the other, and where each row ends.
    entries: Vec<(u32, f32)>,
    ends: Vec<usize>,
    /// Whether a spot is under something: it does not count.
    buried: Vec<bool>,
    /// Emitted light that arrives at each spot, W/m^2.
    pub direct: Vec<[f64; 3]>,
}

impl Rows {
    /// Casts rays from each spot, and looks at points of `lamps`.
    ///
    /// # Errors
    ///
    /// [`Error::Memory`] above `max_memory` bytes; those of the monitor.
    pub fn cast(
        scene: &RayScene,
        mesh: &Mesh,
        patches: &Patches,
        (lamps, samples): (&Lamps, Samples),
        max_memory: u64,
        monitor: &Monitor,
    ) -> Result<Rows> {
        let spots = patches.spots();
        let stage = monitor.stage("rays", spots.len() as u64);
        let mut rows = Rows { entries: vec![], ends: vec![], buried: vec![], direct: vec![] };
        // In blocks, so that memory is known before it is too much.
        for block in spots.chunks(BLOCK) {
            let found: Vec<Option<Row>> = block
                .par_iter()
                .map_init(Walker::default, |walker, spot| {
                    stage.advance(1)?;
                    Ok(row(scene, mesh, patches, (lamps, samples), walker, spot))
                })
                .collect::<Result<_>>()?;
            for own in found {
                rows.buried.push(own.is_none());
                let own = own.unwrap_or_default();
                rows.entries.extend(own.entries);
                rows.ends.push(rows.entries.len());
                rows.direct.push(own.direct.to_array());
            }
            let share = rows.ends.len() as f64 / spots.len() as f64;
            let needed = (rows.bytes() as f64 / share) as u64;
            if needed > max_memory {
                return Err(Error::Memory {
                    what: format!("the rays of {} patches", patches.len()),
                    needed,
                    allowed: max_memory,
                    remedy: "choose a larger --tolerance, or raise --max-memory".into(),
                });
            }
        }
        Ok(rows)
    }

    /// Irradiance at each spot from radiosities `u` of patches, for C channels.
    pub fn at_spots<const C: usize>(&self, u: &[[f64; C]]) -> Vec<[f64; C]> {
        (0..self.ends.len())
            .into_par_iter()
            .with_min_len(64)
            .map(|row| {
                let begin = if row == 0 { 0 } else { self.ends[row - 1] };
                let mut sum = [0.0; C];
                for &(patch, weight) in &self.entries[begin..self.ends[row]] {
                    let u = &u[patch as usize];
                    (0..C).for_each(|c| sum[c] += f64::from(weight) * u[c]);
                }
                sum
            })
            .collect()
    }

    /// Means over the spots of each patch that are not buried; zero where all are.
    pub fn means<const C: usize>(&self, patches: &Patches, at: &[[f64; C]]) -> Vec<[f64; C]> {
        let mean = |patch: usize| {
            let (mut sum, mut count) = ([0.0; C], 0.0f64);
            for spot in patches.range(patch).filter(|&spot| !self.buried[spot]) {
                (0..C).for_each(|c| sum[c] += at[spot][c]);
                count += 1.0;
            }
            sum.map(|s| s / count.max(1.0))
        };
        (0..patches.len()).into_par_iter().with_min_len(64).map(mean).collect()
    }

    /// Whether a spot is under something.
    pub fn is_buried(&self, spot: usize) -> bool {
        self.buried[spot]
    }

    /// Smallest and largest share of the rays of a spot that meet something that radiates; of spots
    /// that are not buried.
    pub fn sums(&self) -> (f64, f64) {
        let mut begin = 0;
        let mut all = (1.0f64, 0.0f64);
        for (&end, buried) in self.ends.iter().zip(&self.buried) {
            let sum: f64 = self.entries[begin..end].iter().map(|e| f64::from(e.1)).sum();
            begin = end;
            if !buried {
                all = (all.0.min(sum), all.1.max(sum));
            }
        }
        all
    }

    /// Pairs of a spot and a patch that are stored.
    pub fn entries(&self) -> usize {
        self.entries.len()
    }

    /// Bytes that are stored.
    pub fn bytes(&self) -> usize {
        size_of::<(u32, f32)>() * self.entries.len() + size_of::<usize>() * self.ends.len()
    }
}

/// Spots whose rays are cast before memory is looked at.
const BLOCK: usize = 16_384;

/// What one spot sees.
#[derive(Default)]
struct Row {
    entries: Vec<(u32, f32)>,
    direct: DVec3,
}

/// The row of a spot; none where it is buried.
fn row(
    scene: &RayScene,
    mesh: &Mesh,
    patches: &Patches,
    (lamps, samples): (&Lamps, Samples),
    walker: &mut Walker,
    spot: &Spot,
) -> Option<Row> {
    let frame = &mesh.faces[spot.face as usize].frame;
    let origin = frame.lift(spot.x);
    let flips = flips(origin);
    let (mut all, mut black, mut direct) = (vec![], 0, DVec3::ZERO);
    for k in 0..samples.rays {
        let towards = direction(frame, k, flips);
        match scene.cast(walker, mesh, patches, origin, towards) {
            Met::Patch { number, face, square, cosine } => {
                all.push(number);
                direct += lamps.met(face, square, cosine * towards.dot(frame.n), samples);
            }
            Met::Black => black += 1,
            Met::Nothing => {}
        }
    }
    if f64::from(black) > BURIED * f64::from(samples.rays) {
        return None;
    }
    direct += lamps.by_points(walker, scene, (origin, frame.n), samples);
    all.sort_unstable();
    let weight = |count: usize| (count as f64 / f64::from(samples.rays)) as f32;
    let entries = all.chunk_by(|a, b| a == b).map(|same| (same[0], weight(same.len()))).collect();
    Some(Row { entries, direct })
}

/// What patches radiate, ready for gathering.
pub struct RayRadiant {
    /// Radiosity of each patch, W/m^2.
    pub radiosity: Vec<DVec3>,
    /// The patches.
    pub patches: Patches,
}

/// Rays that are cast before it is known whether they suffice, and at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RayCounts {
    /// A power of two.
    pub least: u32,
    /// At most so many: a power of two.
    pub most: u32,
}

/// Irradiance that rays estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimated {
    /// Irradiance, W/m^2.
    pub irradiance: DVec3,
    /// Half of the difference between the two halves of the rays: about how far it is off, rather
    /// more.
    pub spread: DVec3,
    /// Rays cast.
    pub rays: u32,
}

impl RayRadiant {
    /// Irradiance at a point with a unit normal from as many rays as it takes for a spread of at
    /// most `allowed` (W/m^2) in each channel.
    pub fn gather(
        &self,
        walker: &mut Walker,
        (scene, mesh): (&RayScene, &Mesh),
        (point, normal): (DVec3, DVec3),
        allowed: f64,
        counts: RayCounts,
    ) -> Estimated {
        let frame = Frame::new(point, normal);
        let flips = flips(point);
        let mut sums: Vec<DVec3> = vec![];
        let block = counts.least / 2;
        loop {
            let first = sums.len() as u32 * block;
            let mut sum = DVec3::ZERO;
            for k in first..first + block {
                let met =
                    scene.cast(walker, mesh, &self.patches, point, direction(&frame, k, flips));
                if let Met::Patch { number, .. } = met {
                    sum += self.radiosity[number as usize];
                }
            }
            sums.push(sum);
            if sums.len().is_power_of_two() && sums.len() > 1 {
                let rays = sums.len() as u32 * block;
                let half = sums.len() / 2;
                let [a, b] = [&sums[..half], &sums[half..]]
                    .map(|s| s.iter().sum::<DVec3>() / f64::from(rays / 2));
                let spread = 0.5 * (a - b).abs();
                if spread.max_element() <= allowed || rays >= counts.most {
                    return Estimated { irradiance: 0.5 * (a + b), spread, rays };
                }
            }
        }
    }
}
