//! Irradiance of texels: means over the parts that the surface covers.
//!
//! The mean of irradiance over a texel is the sum over the roots in it of area times the value at the
//! centroid of what the root has of the texel: right for light that is linear there. Where the values
//! of neighbours bend by more than the tolerance allows, the texel is cut into 2 x 2 squares, and
//! into twice as many along each side as long as that changes its mean too much. Direct light, which
//! has the shadow edges, and reflected light are refined each for itself.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::raster::{parts, parts_of_texel};
use crate::error::Result;
use crate::mesh::barycentric;
use crate::monitor::Monitor;
use crate::reconstruct::fill::{FillCounts, RootPoints};
use crate::reconstruct::irradiance::{Part, irradiances_of};
use crate::solve::Light;

/// About how many points are gathered together: what lies between is filled in, and is held in
/// memory.
const AT_ONCE: u64 = 1 << 20;

/// Second differences of neighbours over the error of a texel's value at its centre: 24 for smooth
/// light, 8 for the edge of a penumbra, and 2 for a jump, which is seldom (contacts cut texels).
const OF_BEND: f64 = 8.0;

/// A root that has texels.
pub(super) struct Laid {
    pub root: u32,
    /// Corners on the page, in texels.
    pub texels: [DVec2; 3],
    /// Corners in the plane of its face.
    pub corners: [DVec2; 3],
    /// Square metres a texel.
    pub scale: f64,
}

impl Laid {
    /// The point of the root's plane at a place on the page.
    fn point(&self, place: DVec2) -> DVec2 {
        let w = barycentric(&self.texels, place).max(DVec3::ZERO);
        let w = w / w.element_sum();
        w.x * self.corners[0] + w.y * self.corners[1] + w.z * self.corners[2]
    }
}

/// How good texels are to be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Accuracy {
    /// Error that the mean over a texel may have, W/m^2.
    pub allowed: f64,
    /// Most squares along the side of a texel.
    pub finest: u32,
}

/// One page while it is being made.
pub(super) struct Sheet<'a> {
    pub width: u32,
    pub height: u32,
    pub roots: &'a [Laid],
    /// The share of each texel that is covered.
    pub covered: Vec<f32>,
}

impl<'a> Sheet<'a> {
    /// A page with what covers it.
    pub fn new(width: u32, height: u32, roots: &'a [Laid]) -> Sheet<'a> {
        let mut covered = vec![0.0f32; width as usize * height as usize];
        for laid in roots {
            parts(&laid.texels, 0..height, width, |p| {
                covered[(p.row * width + p.column) as usize] += p.area as f32;
            });
        }
        covered.iter_mut().for_each(|c| *c = c.min(1.0));
        Sheet { width, height, roots, covered }
    }

    /// One part of the irradiance, and how many texels were sampled more than once.
    pub fn part(
        &self,
        light: &Light,
        part: Part,
        accuracy: Accuracy,
        monitor: &Monitor,
    ) -> Result<(Vec<Vec3>, FillCounts, u64)> {
        let mut values = vec![Vec3::ZERO; self.covered.len()];
        let mut counts = FillCounts::default();
        let all: Vec<bool> = self.covered.iter().map(|&c| c > 0.0).collect();
        let mut sampler = Sampler { sheet: self, light, part, monitor, counts: &mut counts };
        sampler.sample(&all, 1, |k, value| values[k] = value)?;
        let mut rough = self.bends(&values, accuracy.allowed);
        let refined = rough.iter().filter(|r| **r).count() as u64;
        let mut n = 2;
        while n <= accuracy.finest && rough.contains(&true) {
            let mut next = vec![false; rough.len()];
            let allowed = accuracy.allowed as f32;
            sampler.sample(&rough, n, |k, value| {
                next[k] = (value - values[k]).abs().max_element() > allowed;
                values[k] = value;
            })?;
            rough = next;
            n *= 2;
        }
        Ok((values, counts, refined))
    }

    /// The texels whose neighbours tell that their values may be off by more than is allowed.
    fn bends(&self, values: &[Vec3], allowed: f64) -> Vec<bool> {
        let (width, height) = (self.width as i64, self.height as i64);
        let value = |x: i64, y: i64| {
            let inside = (0..width).contains(&x) && (0..height).contains(&y);
            let k = (y * width + x) as usize;
            (inside && self.covered[k] > 0.0).then(|| values[k])
        };
        let limit = (OF_BEND * allowed) as f32;
        (0..values.len())
            .into_par_iter()
            .map(|k| {
                let (x, y) = (k as i64 % width, k as i64 / width);
                let Some(own) = value(x, y) else { return false };
                let along = |dx: i64, dy: i64| {
                    let at = |s: i64| value(x + s * dx, y + s * dy);
                    match (at(-1), at(1)) {
                        (Some(a), Some(b)) => a - 2.0 * own + b,
                        // On the border, the bend next to it; of two texels their difference.
                        (Some(a), None) => at(-2).map_or(own - a, |b| own - 2.0 * a + b),
                        (None, Some(a)) => at(2).map_or(own - a, |b| own - 2.0 * a + b),
                        (None, None) => Vec3::ZERO,
                    }
                };
                (along(1, 0).abs() + along(0, 1).abs()).max_element() > limit
            })
            .collect()
    }
}

/// What is sampled of one root at once.
struct Cells {
    asked: RootPoints,
    /// Of each point its texel and its area in square metres.
    shares: Vec<(u32, f64)>,
}

struct Sampler<'a, 'b> {
    sheet: &'a Sheet<'a>,
    light: &'a Light,
    part: Part,
    monitor: &'a Monitor<'b>,
    counts: &'a mut FillCounts,
}

impl Sampler<'_, '_> {
    /// Means over the texels that are wanted, each from n x n squares.
    fn sample(
        &mut self,
        wanted: &[bool],
        n: u32,
        mut found: impl FnMut(usize, Vec3),
    ) -> Result<()> {
        let (width, height) = (self.sheet.width, self.sheet.height);
        let mut begin = 0;
        while begin < height {
            let (mut end, mut points) = (begin, 0u64);
            while end < height && (points == 0 || points < AT_ONCE) {
                let row = &wanted[(end * width) as usize..((end + 1) * width) as usize];
                points += row.iter().filter(|w| **w).count() as u64 * u64::from(n * n);
                end += 1;
            }
            self.rows(begin..end, wanted, n, &mut found)?;
            begin = end;
        }
        Ok(())
    }

    fn rows(
        &mut self,
        rows: std::ops::Range<u32>,
        wanted: &[bool],
        n: u32,
        found: &mut impl FnMut(usize, Vec3),
    ) -> Result<()> {
        let width = self.sheet.width;
        let cells: Vec<Cells> = self
            .sheet
            .roots
            .par_iter()
            .filter_map(|laid| {
                let asked = RootPoints { root: laid.root, points: vec![] };
                let mut cells = Cells { asked, shares: vec![] };
                parts(&laid.texels, rows.clone(), width, |p| {
                    let texel = p.row * width + p.column;
                    if !wanted[texel as usize] {
                        return;
                    }
                    let mut add = |area: f64, centre: DVec2| {
                        cells.asked.points.push(laid.point(centre));
                        cells.shares.push((texel, area * laid.scale));
                    };
                    if n == 1 {
                        add(p.area, p.centre);
                    } else {
                        parts_of_texel(&laid.texels, (p.column, p.row), n, add);
                    }
                });
                (!cells.shares.is_empty()).then_some(cells)
            })
            .collect();
        let (asked, shares): (Vec<RootPoints>, Vec<Vec<(u32, f64)>>) =
            cells.into_iter().map(|c| (c.asked, c.shares)).unzip();
        let (values, counts) = irradiances_of(self.light, self.part, &asked, self.monitor)?;
        drop(asked);
        *self.counts += counts;
        let first = rows.start * width;
        let mut sums = vec![(DVec3::ZERO, 0.0); ((rows.end - rows.start) * width) as usize];
        for (values, shares) in values.iter().zip(&shares) {
            for (value, (texel, weight)) in values.iter().zip(shares) {
                let sum = &mut sums[(texel - first) as usize];
                sum.0 += *weight * *value;
                sum.1 += *weight;
            }
        }
        for (k, (sum, weight)) in sums.into_iter().enumerate() {
            if weight > 0.0 {
                // Filling in may reach a little below zero where it is dark.
                found(first as usize + k, (sum / weight).max(DVec3::ZERO).as_vec3());
            }
        }
        Ok(())
    }
}
