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

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::hemisphere::{direction, flips, near_ones_together};
use super::lamps::{Lamps, Place, Samples};
use super::patches::{CELLS, Patches, SPOTS, Spot};
use super::ray_gather::RayRadiant;
use super::walk::Walker;
use crate::error::{Error, Result};
use crate::geometry::{COINCIDENCE, RayTree};
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
    /// Orders of 2^k rays.
    orders: Vec<Vec<u32>>,
}

/// Rays are put in order by blocks of at most two to this power.
const BLOCK_POWER: u32 = 10;

/// What one ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Met {
    /// It leaves the scene.
    Nothing,
    /// A side that does not radiate.
    Black,
    /// A face, at a point in its plane and a distance (squared), at a cosine.
    Face {
        /// The face.
        face: u32,
        /// The point in its plane.
        x: DVec2,
        /// Distance squared, m^2.
        square: f64,
        /// Between the ray and the face's normal.
        cosine: f64,
    },
}

impl RayScene {
    /// Prepares a meshed scene.
    pub fn new(scene: &Scene, mesh: &Mesh) -> RayScene {
        let sides = mesh.sides(scene.triangles.len());
        let triangles: Vec<[DVec3; 3]> = scene.triangles.iter().map(|t| t.vertices).collect();
        let tree = RayTree::build(&triangles, |i, back| sides[i][usize::from(back)].is_some());
        let orders = (0..=BLOCK_POWER).map(near_ones_together).collect();
        RayScene { tree, sides, beyond: COINCIDENCE * mesh.magnitude, orders }
    }

    /// Numbers from `first` on of `count` rays, a power of two, near ones one after the other; `first`
    /// is a multiple of `count`.
    pub fn in_order(&self, first: u32, count: u32) -> impl Iterator<Item = u32> {
        let order = &self.orders[count.trailing_zeros().min(BLOCK_POWER) as usize];
        let block = order.len() as u32;
        (0..count / block).flat_map(move |k| order.iter().map(move |o| first + k * block + o))
    }

    /// Whether anything stands between two points; sides that touch either do not count.
    pub fn is_blocked(&self, walker: &mut Walker, from: DVec3, to: DVec3) -> bool {
        let along = to - from;
        let length = along.length();
        let range = self.beyond..length * (1.0 - ROUNDINGS) - self.beyond;
        self.tree.is_blocked(from, along / length, range, &mut walker.boxes)
    }

    /// What a ray meets first; sides that touch its origin do not count.
    pub fn cast(&self, walker: &mut Walker, mesh: &Mesh, origin: DVec3, direction: DVec3) -> Met {
        let hit = self.tree.nearest(origin, direction, self.beyond, &mut walker.boxes);
        let Some(hit) = hit else { return Met::Nothing };
        match self.sides[hit.triangle as usize][usize::from(hit.back)] {
            None => Met::Black,
            Some(face) => {
                let frame = &mesh.faces[face as usize].frame;
                Met::Face {
                    face,
                    x: frame.project(origin + hit.t * direction),
                    square: hit.t * hit.t,
                    cosine: -direction.dot(frame.n),
                }
            }
        }
    }
}

/// Rows of an operator on cells of patches: irradiance of each is a mean of the radiosities of
/// cells that rays from its spots meet.
#[derive(Default)]
pub struct Rows {
    /// Cell and weight, and where those of each row are.
    entries: Vec<(u32, f32)>,
    ranges: Vec<Range<usize>>,
    /// Whether all spots of a cell are under something: they do not count.
    buried: Vec<bool>,
    /// Share of the rays of each cell that meet something that radiates.
    met: Vec<f32>,
    /// Emitted light that arrives at each cell, W/m^2.
    pub direct: Vec<[f64; 3]>,
}

impl Rows {
    /// Casts rays from the spots of each cell, and looks at points of `lamps` and of what is bright of
    /// the patches `before`. Spots of patches that have none in the open, but are seen, are moved to
    /// where they are seen.
    ///
    /// # Errors
    ///
    /// [`Error::Memory`] above `max_memory` bytes; those of the monitor.
    pub fn cast(
        scene: (&RayScene, &Scene),
        mesh: &Mesh,
        patches: &mut Patches,
        before: Option<&RayRadiant>,
        (lamps, samples): (&Lamps, Samples),
        max_memory: u64,
        monitor: &Monitor,
    ) -> Result<Rows> {
        let count = patches.count_of_cells();
        let stage = monitor.stage("rays", count as u64);
        let mut rows = Rows::default();
        let bright = before.filter(|before| !before.bright.is_empty());
        // In blocks, so that memory is known before it is too much.
        for begin in (0..count).step_by(BLOCK) {
            let found: Vec<Option<Row>> = (begin..(begin + BLOCK).min(count))
                .into_par_iter()
                .map_init(Walker::default, |walker, cell| {
                    stage.advance(1)?;
                    Ok(row(scene, mesh, patches, bright, (lamps, samples), walker, cell))
                })
                .collect::<Result<_>>()?;
            for own in found {
                rows.buried.push(own.is_none());
                let own = own.unwrap_or_default();
                rows.direct.push(own.direct.to_array());
                rows.met.push(own.met);
                let begin = rows.entries.len();
                rows.entries.extend(own.entries);
                rows.ranges.push(begin..rows.entries.len());
            }
            let share = rows.ranges.len() as f64 / count as f64;
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
        let lost = rows.lost(patches);
        if lost.contains(&true) {
            let moved = rows.put_where_seen(scene.0, mesh, patches, samples, &lost);
            let again: Vec<(usize, Option<Row>)> = moved
                .into_par_iter()
                .map_init(Walker::default, |walker, cell| {
                    (cell, row(scene, mesh, patches, bright, (lamps, samples), walker, cell))
                })
                .collect();
            for (cell, own) in again {
                let Some(own) = own else { continue };
                let begin = rows.entries.len();
                rows.entries.extend(own.entries);
                rows.ranges[cell] = begin..rows.entries.len();
                rows.direct[cell] = own.direct.to_array();
                rows.met[cell] = own.met;
                rows.buried[cell] = false;
            }
        }
        Ok(rows)
    }

    /// Patches all spots of which are buried.
    fn lost(&self, patches: &Patches) -> Vec<bool> {
        let buried = |patch| patches.cells(patch).all(|cell| self.buried[cell]);
        (0..patches.len()).map(buried).collect()
    }

    /// Moves the spots of patches that are `lost` to where rays of others meet them, and tells whose
    /// were moved.
    fn put_where_seen(
        &self,
        scene: &RayScene,
        mesh: &Mesh,
        patches: &mut Patches,
        samples: Samples,
        lost: &[bool],
    ) -> Vec<usize> {
        // The patch of each cell of those.
        let mut owner = vec![None; patches.count_of_cells()];
        for patch in (0..patches.len()).filter(|&p| lost[p]) {
            owner[patches.cells(patch)].fill(Some(patch as u32));
        }
        let meets = |row: &usize| {
            let own = &self.entries[self.ranges[*row].clone()];
            own.iter().any(|&(cell, _)| owner[cell as usize].is_some())
        };
        let known: &Patches = patches;
        let met: Vec<Vec<(u32, Spot)>> = (0..self.ranges.len())
            .into_par_iter()
            .filter(meets)
            .map_init(Walker::default, |walker, row| {
                let mut hits = vec![];
                cast_from(scene, mesh, known.spots(row), samples, walker, |_, _, met| {
                    if let Met::Face { face, x, .. } = met
                        && let Some(patch) = owner[known.at(face, x)]
                    {
                        hits.push((patch, Spot { face, x }));
                    }
                });
                hits
            })
            .collect();
        let mut found: BTreeMap<u32, Vec<Spot>> = BTreeMap::new();
        for (patch, spot) in met.into_iter().flatten() {
            let own = found.entry(patch).or_default();
            if own.len() < CELLS * SPOTS {
                own.push(spot);
            }
        }
        let mut moved = vec![];
        for (patch, spots) in found {
            patches.put_spots(patch as usize, &spots);
            moved.extend(patches.cells(patch as usize));
        }
        moved
    }

    /// Irradiance of each cell by its spots from radiosities `u` of cells, for C channels.
    pub fn at_cells<const C: usize>(&self, u: &[[f64; C]]) -> Vec<[f64; C]> {
        self.ranges
            .par_iter()
            .with_min_len(64)
            .map(|range| {
                let mut sum = [0.0; C];
                for &(cell, weight) in &self.entries[range.clone()] {
                    let u = &u[cell as usize];
                    (0..C).for_each(|c| sum[c] += f64::from(weight) * u[c]);
                }
                sum
            })
            .collect()
    }

    /// What cells have where rows say `at`: those that are buried the mean of others of their patch;
    /// zero where all are.
    pub fn of_cells<const C: usize>(
        &self,
        patches: &Patches,
        mut at: Vec<[f64; C]>,
    ) -> Vec<[f64; C]> {
        for patch in 0..patches.len() {
            let cells = patches.cells(patch);
            if !self.buried[cells.clone()].contains(&true) {
                continue;
            }
            let (mut sum, mut area) = ([0.0; C], 0.0);
            for cell in cells.clone().filter(|&cell| !self.buried[cell]) {
                (0..C).for_each(|c| sum[c] += patches.area[cell] * at[cell][c]);
                area += patches.area[cell];
            }
            for cell in cells.filter(|&cell| self.buried[cell]) {
                at[cell] = sum.map(|s| if area > 0.0 { s / area } else { 0.0 });
            }
        }
        at
    }

    /// Whether a cell is under something.
    pub fn is_buried(&self, cell: usize) -> bool {
        self.buried[cell]
    }

    /// Smallest and largest share of the rays of a cell that meet something that radiates; of cells
    /// that are not buried.
    pub fn sums(&self) -> (f64, f64) {
        let mut all = (1.0f64, 0.0f64);
        for (&met, _) in self.met.iter().zip(&self.buried).filter(|(_, buried)| !**buried) {
            all = (all.0.min(f64::from(met)), all.1.max(f64::from(met)));
        }
        all
    }

    /// Pairs of a spot and a cell that are stored.
    pub fn entries(&self) -> usize {
        self.entries.len()
    }

    /// Bytes that are stored.
    pub fn bytes(&self) -> usize {
        size_of::<(u32, f32)>() * self.entries.len() + size_of::<Range<usize>>() * self.ranges.len()
    }
}

/// Cells whose rays are cast before memory is looked at.
const BLOCK: usize = 16_384;

/// Where there are bright cells, these and those of more power than the mean look at more rays and points,
/// from as many more spots: what they are off by counts for much, close by or everywhere.
const OF_BRIGHT: f64 = 8.0;
const MOST_TIMES: f64 = 64.0;

/// Rays from a spot, at least.
const FROM_EACH: u32 = 4;

/// Casts rays from some spots, each about as evenly spread as all of them: `with` gets the number of
/// the spot and the direction.
fn cast_from(
    scene: &RayScene,
    mesh: &Mesh,
    spots: &[Spot],
    samples: Samples,
    walker: &mut Walker,
    mut with: impl FnMut(usize, DVec3, Met),
) {
    let count = (samples.rays / FROM_EACH).clamp(1, spots.len() as u32);
    let each = samples.rays / count;
    let mut own = None;
    for number in 0..count {
        let spot = &spots[number as usize];
        let frame = &mesh.faces[spot.face as usize].frame;
        let origin = frame.lift(spot.x);
        let flips = *own.get_or_insert_with(|| flips(origin));
        for k in scene.in_order(number * each, each) {
            let towards = direction(frame, k, flips);
            with(number as usize, towards, scene.cast(walker, mesh, origin, towards));
        }
    }
}

/// What one cell sees.
#[derive(Default)]
struct Row {
    entries: Vec<(u32, f32)>,
    met: f32,
    direct: DVec3,
}

/// What one spot sees.
#[derive(Clone, Default)]
struct Seen {
    /// Cells that rays and points found, and what these count.
    cells: Vec<(u32, f64)>,
    met: u32,
    rays: u32,
    black: u32,
    direct: DVec3,
}

/// The row of a cell; none where all its spots are buried.
fn row(
    scene: (&RayScene, &Scene),
    mesh: &Mesh,
    patches: &Patches,
    before: Option<&RayRadiant>,
    (lamps, samples): (&Lamps, Samples),
    walker: &mut Walker,
    cell: usize,
) -> Option<Row> {
    let (mut spots, mut samples) = (Cow::Borrowed(patches.spots(cell)), samples);
    let times = before.map_or(1.0, |known| {
        let Spot { face, x } = spots[0];
        let there = known.patches.at(face, x);
        let least = if known.bright.has(there) { OF_BRIGHT } else { 1.0 };
        known.power(there, patches.area[cell]).clamp(least, MOST_TIMES)
    });
    if times >= 2.0 {
        let times = 1 << times.log2() as u32;
        spots = Cow::Owned(patches.more_spots(scene.1, mesh, cell, times as usize));
        samples = Samples { points: times * samples.points, rays: times * samples.rays };
    }
    let scene = scene.0;
    let mut seen = vec![];
    cast_from(scene, mesh, &spots, samples, walker, |number, towards, met| {
        seen.resize(number + 1, Seen::default());
        let own = &mut seen[number];
        own.rays += 1;
        match met {
            Met::Face { face, x, square, cosine } => {
                let cosines = cosine * towards.dot(mesh.faces[spots[number].face as usize].frame.n);
                let weight = before.map_or(1.0, |b| b.weight_of_ray(face, x, square, cosines));
                own.cells.push((patches.at(face, x) as u32, weight));
                own.met += 1;
                own.direct += lamps.met(face, square, cosines, samples);
            }
            Met::Black => own.black += 1,
            Met::Nothing => {}
        }
    });
    let each = samples.points / seen.len() as u32;
    let (mut all, mut direct, mut rays, mut met) = (vec![], DVec3::ZERO, 0, 0);
    for (number, own) in seen.into_iter().enumerate() {
        if f64::from(own.black) > BURIED * f64::from(own.rays) {
            continue;
        }
        let frame = &mesh.faces[spots[number].face as usize].frame;
        let place = Place::new(frame.lift(spots[number].x), frame.n);
        let which = (number as u32 * each, each);
        direct += own.direct + lamps.by_points(walker, scene, place, which, samples).seen;
        all.extend(own.cells);
        (rays, met) = (rays + own.rays, met + own.met);
        for k in before.iter().flat_map(|_| scene.in_order(number as u32 * own.rays, own.rays)) {
            let bright = before.and_then(|b| b.bright.point((scene, mesh), walker, place, k));
            all.extend(bright.map(|seen| (patches.at(seen.face, seen.x) as u32, seen.weight)));
        }
    }
    if rays == 0 {
        return None;
    }
    all.sort_by_key(|found| found.0);
    let rays = f64::from(rays);
    let share = |same: &[(u32, f64)]| same.iter().map(|found| found.1).sum::<f64>() / rays;
    let same = all.chunk_by(|a, b| a.0 == b.0);
    let entries = same.map(|same| (same[0].0, share(same) as f32)).collect();
    let met = (f64::from(met) / rays) as f32;
    Some(Row { entries, met, direct: direct * f64::from(samples.rays) / rays })
}
