//! Irradiance at any point from as many rays as it takes.
//!
//! Rays into the hemisphere find what patches reflect ([`super::bundles`]), and with points of what
//! emits they find that ([`super::lamps`]). Eight parts of them, each as evenly spread as the whole, tell
//! how far off they are.
//!
//! Cells of patches radiate unevenly: one that lies partly under a cupboard is bright and dark.
//! Far off that does not matter, since rays meet many cells. Where so many rays of one bundle would
//! meet the same cell that its unevenness counts for more than the noise of a path, they
//! do not take its mean: each goes on from where it met the cell, with one ray and one point of what emits.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::bright::{Bright, Point};
use super::bundles::{Met, RayScene};
use super::hemisphere::{direction, flips_for};
use super::lamps::{Lamps, Lit, Place, Samples};
use super::patches::Patches;
use super::walk::Walker;
use crate::geometry::Frame;
use crate::mesh::Mesh;
use crate::scene::Scene;

/// What patches radiate, ready for gathering.
pub struct RayRadiant {
    /// Radiosity of each cell of the patches, W/m^2.
    pub radiosity: Vec<DVec3>,
    /// The patches.
    pub patches: Patches,
    /// Area of each cell over pi, m^2, times the square of the share of its patch's largest
    /// radiosity by which light was found to vary there.
    pub unevenness: Vec<f64>,
    /// Cells that points are spread over as well.
    pub bright: Bright,
    /// Mean power of a cell, W.
    mean_power: f64,
}

impl RayRadiant {
    /// Radiosities of cells, and what is known of how these vary.
    pub fn new(
        (scene, mesh): (&Scene, &Mesh),
        radiosity: Vec<DVec3>,
        patches: Patches,
    ) -> RayRadiant {
        let unevenness = (0..patches.len())
            .flat_map(|patch| {
                let [least, most] = patches.found[patch];
                let all = most.max_element();
                let varies = if all > 0.0 { (most - least).max_element() / all } else { 0.0 };
                let area = &patches.area;
                patches.cells(patch).map(move |cell| varies * varies * area[cell] / PI)
            })
            .collect();
        let bright = Bright::new(scene, mesh, &patches, &radiosity);
        let powers = patches.area.iter().zip(&radiosity).map(|(area, u)| area * u.max_element());
        let mean_power = powers.sum::<f64>() / radiosity.len().max(1) as f64;
        RayRadiant { radiosity, patches, unevenness, bright, mean_power }
    }

    /// What a ray counts that met a point of a face from a distance `square` (squared) at cosines
    /// whose product is `cosines`: points may find it as well.
    pub fn weight_of_ray(&self, face: u32, x: DVec2, square: f64, cosines: f64) -> f64 {
        if self.bright.is_empty() {
            return 1.0;
        }
        self.bright.weight_of_ray(self.patches.at(face, x), square, cosines)
    }

    /// The power of an area (m^2) that radiates like a cell, in units of the mean power of a cell.
    pub fn power(&self, cell: usize, area: f64) -> f64 {
        let power = area * self.radiosity[cell].max_element();
        if self.mean_power > 0.0 { power / self.mean_power } else { 0.0 }
    }

    /// Whether the mean of a cell will do for a ray that met it at a distance (squared) at a cosine,
    /// one of so many.
    fn is_even(&self, cell: usize, square: f64, cosine: f64, rays: u32) -> bool {
        // About so many rays meet the cell; it fills no more than the hemisphere.
        let varies = self.unevenness[cell];
        let area = self.patches.area[cell];
        let met = (varies * cosine / square).min(varies * PI / area) * f64::from(rays);
        let points = varies * PI * self.bright.points_in(cell, rays);
        met + points <= EVEN
    }
}

/// What is gathered.
#[derive(Clone, Copy)]
pub struct Sources<'a> {
    /// Light that patches reflect.
    pub reflected: Option<&'a RayRadiant>,
    /// The same as it was known before, to be compared along the same rays.
    pub before: Option<&'a RayRadiant>,
    /// Light that is emitted.
    pub emitted: Option<&'a Lamps>,
    /// All that emits: it lights what reflects.
    pub lamps: &'a Lamps,
}

/// Rays that are cast before it is known whether they suffice, and at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RayCounts {
    /// A power of two, 8 or more.
    pub least: u32,
    /// At most so many: a power of two.
    pub most: u32,
}

/// How far off what rays estimate may be, W/m^2: the larger of two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Enough {
    /// Whatever it takes.
    pub spread: f64,
    /// Times the square root of the number of rays. Of all ways to cast so many rays for many points
    /// this leaves the least sum of squared errors: with an error of s/sqrt(n) from n rays, the square
    /// of it falls by s^2/n^2 with each further ray, which is the same everywhere for n in proportion
    /// to s.
    pub per_root: f64,
}

impl Enough {
    /// So much, whatever it takes.
    pub fn of(spread: f64) -> Enough {
        Enough { spread, per_root: 0.0 }
    }

    /// So much by the square root of the number of rays.
    pub fn by_root(per_root: f64) -> Enough {
        Enough { spread: 0.0, per_root }
    }

    /// So many times as much.
    pub fn times(self, more: f64) -> Enough {
        Enough { spread: more * self.spread, per_root: more * self.per_root }
    }

    fn after(&self, rays: u32) -> f64 {
        self.spread.max(self.per_root * f64::from(rays).sqrt())
    }
}

/// Irradiance that rays estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimated {
    /// Irradiance, W/m^2.
    pub irradiance: DVec3,
    /// About how far it is off: from the deviations of parts.
    pub spread: DVec3,
    /// What it is more than it would be with [`Sources::before`] by the same rays.
    pub change: DVec3,
    /// How many rays there were; none where it is known.
    pub rays: u32,
}

impl Estimated {
    /// Whether so many rays sufficed, or almost.
    pub fn is_within(&self, enough: Enough, rays: u32) -> bool {
        self.spread.max_element() <= OF_HALF * enough.after(rays)
    }

    /// The spread times the square root of the number of rays, W/m^2: about the same for any number.
    pub fn roughness(&self) -> f64 {
        self.spread.max_element() * f64::from(self.rays).sqrt()
    }

    /// Irradiance that is known.
    pub fn exactly(irradiance: DVec3) -> Estimated {
        Estimated { irradiance, ..Estimated::default() }
    }
}

/// Whether so many blocks of rays are looked at: 1, 2, 3, 4, 6, 8, 12, ... in each part.
fn is_looked_at(blocks: usize) -> bool {
    let each = blocks / PARTS;
    let is_step =
        each.is_power_of_two() || (each.is_multiple_of(3) && (each / 3).is_power_of_two());
    blocks.is_multiple_of(PARTS) && is_step
}

/// Parts of the rays whose deviations are looked at.
const PARTS: usize = 8;

/// What nets of an eighth of the points each are off by, and nets of half of them, over what they are
/// off by together: as if they had nothing to do with each other. For smooth light it would be the
/// power 3/4 of their number, but cells of clutter are not smooth: measured in a kitchen, that
/// promised half of the true error.
const OF_PART: f64 = 2.0 * std::f64::consts::SQRT_2;
const OF_HALF: f64 = std::f64::consts::SQRT_2;

/// Rays go on where the square of what a cell's light varies by, relative, times the number of those
/// that meet it is more than this. With 4 pictures take a tenth less, but an arcade is solved a fifth worse.
const EVEN: f64 = 1.0;

/// Flips of the ways on from points.
const OF_POINTS: u64 = 1 << 41;

/// Ways that a ray goes on, at most.
const MOST_BOUNCES: u64 = 8;

/// One ray and one point of what emits, over and over.
const EACH: Samples = Samples { points: 1, rays: 1 };

impl<'a> Sources<'a> {
    /// Reflected light alone.
    pub fn reflected(radiant: &'a RayRadiant, lamps: &'a Lamps) -> Sources<'a> {
        Sources { reflected: Some(radiant), before: None, emitted: None, lamps }
    }
}

impl Sources<'_> {
    /// Irradiance at a point with a unit normal from as many rays (and points of what emits) as it
    /// takes for a spread that is `enough` in each channel.
    pub fn gather(
        &self,
        walker: &mut Walker,
        (scene, mesh): (&RayScene, &Mesh),
        place: Place,
        enough: Enough,
        counts: RayCounts,
    ) -> Estimated {
        let Place { point, normal, flips } = place;
        let frame = Frame::new(point, normal);
        let few = self.emitted.filter(|lamps| lamps.are_few());
        let unshadowed = few.map(|lamps| lamps.unshadowed(point, normal));
        let block = counts.least / PARTS as u32;
        let mut sums: Vec<Sum> = vec![];
        let mut before = (DVec3::ZERO, 0);
        loop {
            let first = sums.len() as u32 * block;
            let mut sum = Sum::default();
            for k in scene.in_order(first, block) {
                let towards = direction(&frame, k, flips);
                if let Some(lamps) = few {
                    sum.lit.all += lamps.along(point, towards, towards.dot(normal), EACH);
                }
                if let Met::Face { face, x, square, cosine } =
                    scene.cast(walker, mesh, point, towards)
                {
                    if let Some(radiant) = self.reflected {
                        let start = (face, x, square, cosine);
                        let rays = counts.least;
                        let (found, change) =
                            self.along(radiant, walker, (scene, mesh), start, (k, rays, flips));
                        let cosines = cosine * towards.dot(normal);
                        let weight = radiant.weight_of_ray(face, x, square, cosines);
                        sum.reflected += weight * found;
                        sum.change += weight * change;
                    }
                    if let Some(lamps) = self.emitted {
                        let cosines = cosine * towards.dot(normal);
                        sum.lit.seen += lamps.met(face, square, cosines, EACH);
                    }
                }
            }
            if let Some(radiant) = self.reflected.filter(|radiant| !radiant.bright.is_empty()) {
                for k in scene.in_order(first, block) {
                    if let Some(seen) = radiant.bright.point((scene, mesh), walker, place, k) {
                        let Point { face, x, square, cosine, weight } = seen;
                        let (start, rays) = ((face, x, square, cosine), counts.least);
                        let which = (k, rays, flips_for(flips, OF_POINTS));
                        let (found, change) =
                            self.along(radiant, walker, (scene, mesh), start, which);
                        sum.reflected += weight * found;
                        sum.change += weight * change;
                    }
                }
            }
            if let Some(lamps) = self.emitted {
                let which = (first, block);
                sum.lit += lamps.by_points(walker, scene, place, which, EACH);
            }
            sums.push(sum);
            if is_looked_at(sums.len()) {
                let rays = sums.len() as u32 * block;
                let irradiance = mean(&sums, rays, unshadowed);
                let parts = sums.chunks(sums.len() / PARTS);
                let squares: DVec3 = parts
                    .map(|own| mean(own, rays / PARTS as u32, unshadowed) - irradiance)
                    .map(|off| off * off)
                    .sum();
                let own = (squares / (PARTS - 1) as f64).map(f64::sqrt) / OF_PART;
                // What ends it is small by chance at times: what fewer rays told counts as well.
                let spread = own.max(before.0 * (f64::from(before.1) / f64::from(rays)).sqrt());
                if spread.max_element() <= enough.after(rays) || rays >= counts.most {
                    let change: DVec3 = sums.iter().map(|own| own.change).sum();
                    let change = change / f64::from(rays);
                    return Estimated { irradiance, spread, change, rays };
                }
                before = (own, rays);
            }
        }
    }
}

impl Sources<'_> {
    /// The radiosity that ray `number` of a bundle of `rays` finds where it met a face (at a point, a
    /// distance squared and a cosine): that of the cell, or, where that is too uneven, of the point.
    /// And what it is more than before.
    fn along(
        &self,
        radiant: &RayRadiant,
        walker: &mut Walker,
        (scene, mesh): (&RayScene, &Mesh),
        (mut face, mut x, mut square, mut cosine): (u32, DVec2, f64, f64),
        (number, rays, flips): (u32, u32, [u32; 2]),
    ) -> (DVec3, DVec3) {
        let (mut sum, mut weight, mut change) = (DVec3::ZERO, DVec3::ONE, DVec3::ZERO);
        for bounce in 0u64.. {
            let cell = radiant.patches.at(face, x);
            if bounce == MOST_BOUNCES || radiant.is_even(cell, square, cosine, rays) {
                let (own, more) = self.of_cell(radiant, cell, (face, x));
                sum += weight * own;
                change += weight * more;
                break;
            }
            weight *= radiant.patches.reflectance[cell];
            let own = &mesh.faces[face as usize].frame;
            let (point, normal) = (own.lift(x), own.n);
            let flips = flips_for(flips, u64::from(number) << 8 | bounce);
            let place = Place { point, normal, flips };
            let lit = self.lamps.by_points(walker, scene, place, (number, 1), EACH);
            sum += weight * lit.seen;
            if !radiant.bright.is_empty()
                && let Some(seen) = radiant.bright.point((scene, mesh), walker, place, number)
            {
                let cell = radiant.patches.at(seen.face, seen.x);
                let (own, more) = self.of_cell(radiant, cell, (seen.face, seen.x));
                sum += weight * seen.weight * own;
                change += weight * seen.weight * more;
            }
            let towards = direction(own, number, flips);
            let Met::Face { face: next, x: at, square: far, cosine: from } =
                scene.cast(walker, mesh, point, towards)
            else {
                break;
            };
            let cosines = from * towards.dot(normal);
            sum += weight * self.lamps.met(next, far, cosines, EACH);
            weight *= radiant.weight_of_ray(next, at, far, cosines);
            (face, x, square, cosine) = (next, at, far, from);
        }
        (sum, change)
    }
}

impl Sources<'_> {
    /// The mean radiosity of a cell, and what it is more than before at a point of it.
    fn of_cell(
        &self,
        radiant: &RayRadiant,
        cell: usize,
        (face, x): (u32, DVec2),
    ) -> (DVec3, DVec3) {
        let own = radiant.radiosity[cell];
        let change = |before: &RayRadiant| own - before.radiosity[before.patches.at(face, x)];
        (own, self.before.map_or(DVec3::ZERO, change))
    }
}

/// What some rays, and as many points of what emits, find.
#[derive(Clone, Copy, Default)]
struct Sum {
    reflected: DVec3,
    change: DVec3,
    lit: Lit,
}

/// Irradiance from some sums over `rays` rays in all; what is `unshadowed` tells more than samples do.
fn mean(sums: &[Sum], rays: u32, unshadowed: Option<DVec3>) -> DVec3 {
    let mut sum = Sum::default();
    for own in sums {
        sum.reflected += own.reflected;
        sum.lit += own.lit;
    }
    let Lit { seen, all } = sum.lit;
    let rays = f64::from(rays);
    let lit = match unshadowed {
        Some(known) => DVec3::select(all.cmpgt(DVec3::ZERO), known * seen / all, seen / rays),
        None => seen / rays,
    };
    sum.reflected / rays + lit
}
