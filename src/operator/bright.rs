//! Points on what reflects most: for scenes where few cells of patches radiate much.
//!
//! The mean over the surface of the squared error of n rays is about
//!
//! ```text
//! <e^2> = 1/n <u^2>,   <u^2> = 1/S sum_C A_C u_C^2
//! ```
//!
//! since by reciprocity the mean over all points of the share F_C of the hemisphere that a cell fills
//! is no more than A_C/S. Where a few bright cells (next to a small lamp) make most of <u^2>, points
//! are spread over these like their radiosity, as they are over lamps ([`super::lamps`]), and both kinds
//! of samples are weighed by how likely each was to find that point (Veach & Guibas 1995). Which cells
//! are bright follows from the least of what is left: a point out of the power P_B of the bright ones
//! is off by about P_B/S as well.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::bundles::RayScene;
use super::hemisphere::{flips_for, in_square};
use super::lamps::Place;
use super::patches::Patches;
use super::spread::{Shares, on_triangle};
use super::walk::Walker;
use crate::geometry::polygon::twice_area;
use crate::mesh::Mesh;
use crate::scene::Scene;

/// The bright cells; none where rays alone do better.
#[derive(Clone, Default)]
pub struct Bright {
    pieces: Vec<Piece>,
    shares: Shares,
    /// Of each cell the density of points there, 1/m^2; empty where no cell is bright.
    density: Vec<f64>,
}

/// A triangle of a bright cell.
#[derive(Clone, Copy)]
struct Piece {
    cell: u32,
    face: u32,
    corners: [DVec2; 3],
}

/// A point of a bright cell as it is seen from elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Its face.
    pub face: u32,
    /// The point in its plane.
    pub x: DVec2,
    /// Distance squared, m^2.
    pub square: f64,
    /// Between the way there and the face's normal.
    pub cosine: f64,
    /// What its radiosity counts, as if there were one ray and one point.
    pub weight: f64,
}

/// What points leave, squared, over (P_B/S)^2: how much the kernel varies between places.
const OF_POINTS: f64 = 4.0;

/// A point costs about as much as a ray: it has to leave less than this of what rays alone do.
const WORTH: f64 = 0.25;

/// Points have flips of their own.
const OF_FLIPS: u64 = 1 << 40;

impl Bright {
    /// The bright ones among the cells of patches, by their radiosities (W/m^2).
    pub fn new(scene: &Scene, mesh: &Mesh, patches: &Patches, radiosity: &[DVec3]) -> Bright {
        let cells = patches.count_of_cells();
        let radiates = |cell: usize| radiosity[cell].max_element().max(0.0);
        let Some(least) = threshold(&patches.area, &radiates) else {
            return Bright::default();
        };
        let mut bright = Bright { density: vec![0.0; cells], ..Bright::default() };
        let mut powers = vec![];
        for patch in 0..patches.len() {
            if !patches.cells(patch).any(|cell| radiates(cell) >= least) {
                continue;
            }
            for (cell, face, polygon) in patches.polygons(scene, mesh, patch) {
                if radiates(cell) < least {
                    continue;
                }
                bright.density[cell] = radiates(cell);
                for k in 1..polygon.len() - 1 {
                    let corners = [polygon[0], polygon[k], polygon[k + 1]];
                    powers.push(radiates(cell) * 0.5 * twice_area(&corners));
                    bright.pieces.push(Piece { cell: cell as u32, face, corners });
                }
            }
        }
        let (shares, sum) = Shares::of(powers);
        bright.density.iter_mut().for_each(|d| *d /= sum);
        Bright { shares, ..bright }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Whether a cell is bright.
    pub fn has(&self, cell: usize) -> bool {
        self.density.get(cell).is_some_and(|&density| density > 0.0)
    }

    /// What a ray counts that met a cell from a distance `square` (squared) at cosines whose product
    /// is `cosines`, where one point goes with each ray.
    pub fn weight_of_ray(&self, cell: usize, square: f64, cosines: f64) -> f64 {
        match self.density.get(cell) {
            Some(&density) if density > 0.0 => balanced(cosines / (PI * square), density),
            _ => 1.0,
        }
    }

    /// How many of so many points are in a square metre of a cell, on average.
    pub fn points_in(&self, cell: usize, count: u32) -> f64 {
        self.density.get(cell).map_or(0.0, |density| density * f64::from(count))
    }

    /// Point number `k` of bright cells, if it is seen from a place.
    pub fn point(
        &self,
        (scene, mesh): (&RayScene, &Mesh),
        walker: &mut Walker,
        place: Place,
        k: u32,
    ) -> Option<Point> {
        let Place { point, normal, flips } = place;
        let (number, at) = self.shares.choose(in_square(k, flips_for(flips, OF_FLIPS)));
        let Piece { cell, face, corners: [a, b, c] } = self.pieces[number];
        let w = on_triangle(at);
        let x = w.x * a + w.y * b + w.z * c;
        let frame = &mesh.faces[face as usize].frame;
        let to = frame.lift(x);
        let between = to - point;
        let square = between.length_squared();
        let (here, there) = (between.dot(normal), -between.dot(frame.n));
        if here <= 0.0 || there <= 0.0 || scene.is_blocked(walker, point, to) {
            return None;
        }
        let of_rays = here * there / (PI * square * square);
        let weight = balanced(of_rays, self.density[cell as usize]);
        Some(Point { face, x, square, cosine: there / square.sqrt(), weight })
    }
}

/// What a sample counts that rays and points find with such densities: the balance heuristic.
fn balanced(of_rays: f64, of_points: f64) -> f64 {
    of_rays / (of_rays + of_points)
}

/// The least radiosity that is bright, where points are worth their time.
fn threshold(area: &[f64], radiates: &dyn Fn(usize) -> f64) -> Option<f64> {
    let mut order: Vec<usize> = (0..area.len()).filter(|&cell| radiates(cell) > 0.0).collect();
    order.sort_by(|&a, &b| radiates(b).total_cmp(&radiates(a)).then(a.cmp(&b)));
    let surface: f64 = area.iter().sum();
    let all: f64 =
        order.iter().map(|&cell| area[cell] * radiates(cell).powi(2)).sum::<f64>() / surface;
    let (mut rest, mut power) = (all, 0.0);
    let mut best = (WORTH * all, None);
    for cell in order {
        rest -= area[cell] * radiates(cell).powi(2) / surface;
        power += area[cell] * radiates(cell) / surface;
        let left = rest + OF_POINTS * power * power;
        if left < best.0 {
            best = (left, Some(radiates(cell)));
        }
    }
    best.1
}
