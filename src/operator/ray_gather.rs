//! Irradiance at any point from as many rays as it takes.
//!
//! Rays into the hemisphere find what patches reflect ([`super::bundles`]), and with points of what
//! emits they find that ([`super::lamps`]). Eight parts of them, each as evenly spread as the whole, tell
//! how far off they are.

use glam::DVec3;

use super::bundles::{Met, RayScene};
use super::hemisphere::{direction, flips};
use super::lamps::{Lamps, Lit, Samples};
use super::patches::Patches;
use super::walk::Walker;
use crate::geometry::Frame;
use crate::mesh::Mesh;

/// What patches radiate, ready for gathering.
pub struct RayRadiant {
    /// Radiosity of each patch, W/m^2.
    pub radiosity: Vec<DVec3>,
    /// The patches.
    pub patches: Patches,
}

/// What is gathered.
#[derive(Clone, Copy)]
pub struct Sources<'a> {
    /// Light that patches reflect.
    pub reflected: Option<&'a RayRadiant>,
    /// Light that is emitted.
    pub emitted: Option<&'a Lamps>,
}

/// Rays that are cast before it is known whether they suffice, and at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RayCounts {
    /// A power of two, 8 or more.
    pub least: u32,
    /// At most so many: a power of two.
    pub most: u32,
}

/// Irradiance that rays estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimated {
    /// Irradiance, W/m^2.
    pub irradiance: DVec3,
    /// About how far it is off: from the deviations of parts.
    pub spread: DVec3,
}

impl Estimated {
    /// Whether rays sufficed for a spread of at most so much.
    pub fn is_within(&self, allowed: f64) -> bool {
        self.spread.max_element() <= OF_HALF * allowed
    }

    /// Irradiance that is known.
    pub fn exactly(irradiance: DVec3) -> Estimated {
        Estimated { irradiance, spread: DVec3::ZERO }
    }
}

/// Parts of the rays whose deviations are looked at.
const PARTS: usize = 8;

/// Nets of an eighth of the points each are off by 8^(3/4) times what they are off by together, and
/// nets of half the points by 2^(3/4) times.
const OF_PART: f64 = 4.756_828_460_010_884;
const OF_HALF: f64 = 1.681_792_830_507_429;

/// One ray and one point of what emits, over and over.
const EACH: Samples = Samples { points: 1, rays: 1 };

impl Sources<'_> {
    /// Irradiance at a point with a unit normal from as many rays (and points of what emits) as it
    /// takes for a spread of at most `allowed` (W/m^2) in each channel.
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
        let few = self.emitted.filter(|lamps| lamps.are_few());
        let unshadowed = few.map(|lamps| lamps.unshadowed(point, normal));
        let block = counts.least / PARTS as u32;
        let mut sums: Vec<Sum> = vec![];
        let mut before = DVec3::ZERO;
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
                        sum.reflected += radiant.radiosity[radiant.patches.at(face, x)];
                    }
                    if let Some(lamps) = self.emitted {
                        sum.lit.seen += lamps.met(face, square, cosine * towards.dot(normal), EACH);
                    }
                }
            }
            if let Some(lamps) = self.emitted {
                let which = (first, block);
                sum.lit += lamps.by_points(walker, scene, (point, normal), which, EACH);
            }
            sums.push(sum);
            if sums.len() >= PARTS && sums.len().is_power_of_two() {
                let rays = sums.len() as u32 * block;
                let irradiance = mean(&sums, rays, unshadowed);
                let parts = sums.chunks(sums.len() / PARTS);
                let squares: DVec3 = parts
                    .map(|own| mean(own, rays / PARTS as u32, unshadowed) - irradiance)
                    .map(|off| off * off)
                    .sum();
                let own = (squares / (PARTS - 1) as f64).map(f64::sqrt) / OF_PART;
                // What ends it is small by chance at times: half as many rays told more.
                let spread = own.max(before / OF_HALF);
                if own.max_element() <= allowed || rays >= counts.most {
                    return Estimated { irradiance, spread };
                }
                before = own;
            }
        }
    }
}

/// What some rays, and as many points of what emits, find.
#[derive(Clone, Copy, Default)]
struct Sum {
    reflected: DVec3,
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
