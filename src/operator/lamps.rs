//! Emitted light by points on what emits: for receivers so many that exact integrals cost too much.
//!
//! Two kinds of samples are good at different things: points spread over all that emits like its
//! power p = E/P find what is small and far, rays spread over the hemisphere like cos/pi what is
//! near. Both together, each weighed by how likely it and the other kind were to find that point
//! (the balance heuristic, Veach & Guibas 1995), are good at both:
//!
//! ```text
//! H(P) = sum over all samples k of E(x_k) g_k / (n_points p(x_k) + n_rays g_k),   g = G(P, x)/pi
//! ```
//!
//! where g is the density, over the surface, of the points that rays meet.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::bundles::RayScene;
use super::hemisphere::{flips, in_square};
use super::walk::Walker;
use crate::mesh::{Mesh, barycentric};
use crate::scene::{self, Scene};

/// All that emits.
pub struct Lamps {
    lamps: Vec<Lamp>,
    /// Of each face of the mesh its lamp.
    of_face: Vec<Option<u32>>,
    /// Power of all lamps up to and with each, as a share of the whole.
    until: Vec<f64>,
    /// One over the power of all, 1/W.
    density: f64,
}

/// How many samples of each kind there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Samples {
    /// Points of what emits.
    pub points: u32,
    /// Rays into the hemisphere.
    pub rays: u32,
}

/// A face that emits.
struct Lamp {
    corners: [DVec3; 3],
    normal: DVec3,
    /// Exitance, W/m^2.
    exitance: DVec3,
}

impl Lamps {
    /// All faces of a mesh that emit; textures are averaged over each.
    pub fn new(scene: &Scene, mesh: &Mesh) -> Lamps {
        let (mut lamps, mut until, mut sum) = (vec![], vec![], 0.0);
        let mut of_face = vec![];
        for face in &mesh.faces {
            let whole = face.corners.map(|x| barycentric(&face.corners, x));
            let whole = if face.back { whole.map(|w| DVec3::new(w.x, w.z, w.y)) } else { whole };
            let e = scene::exitance(scene, face.triangle as usize, &whole);
            let [a, b, c] = face.corners;
            let power = 0.5 * (b - a).perp_dot(c - a) * e.max_element();
            of_face.push((power > 0.0).then_some(lamps.len() as u32));
            if power > 0.0 {
                sum += power;
                until.push(sum);
                let corners = face.corners.map(|x| face.frame.lift(x));
                lamps.push(Lamp { corners, normal: face.frame.n, exitance: e });
            }
        }
        until.iter_mut().for_each(|u| *u /= sum);
        Lamps { lamps, of_face, until, density: 1.0 / sum }
    }

    /// What a ray that met a face adds to the irradiance where it came from, from the distance
    /// `square` (squared) at cosines whose product is `cosines`.
    pub fn met(&self, face: u32, square: f64, cosines: f64, samples: Samples) -> DVec3 {
        match self.of_face[face as usize] {
            Some(lamp) => self.weighed(&self.lamps[lamp as usize], square, cosines, samples),
            None => DVec3::ZERO,
        }
    }

    fn weighed(&self, lamp: &Lamp, square: f64, cosines: f64, samples: Samples) -> DVec3 {
        let of_rays = cosines / (PI * square);
        let of_points = self.density * lamp.exitance.max_element();
        let both = f64::from(samples.points) * of_points + f64::from(samples.rays) * of_rays;
        of_rays / both * lamp.exitance
    }

    /// What points of all that emits add to the irradiance at a point with a unit normal.
    pub fn by_points(
        &self,
        walker: &mut Walker,
        rays: &RayScene,
        (point, normal): (DVec3, DVec3),
        samples: Samples,
    ) -> DVec3 {
        if self.lamps.is_empty() {
            return DVec3::ZERO;
        }
        let flips = flips(point);
        let mut sum = DVec3::ZERO;
        for k in 0..samples.points {
            let x = in_square(k, flips);
            let place = self.until.partition_point(|&u| u <= x.x).min(self.lamps.len() - 1);
            let lamp = &self.lamps[place];
            let begin = if place == 0 { 0.0 } else { self.until[place - 1] };
            let along = ((x.x - begin) / (self.until[place] - begin)).clamp(0.0, 1.0);
            let at = on_triangle(&lamp.corners, DVec2::new(along, x.y));
            let between = at - point;
            let square = between.length_squared();
            let cosines = between.dot(normal) * -between.dot(lamp.normal);
            if between.dot(normal) > 0.0 && cosines > 0.0 && !rays.is_blocked(walker, point, at) {
                sum += self.weighed(lamp, square, cosines / square, samples);
            }
        }
        sum
    }
}

/// The point of a triangle that belongs to a point of the unit square, evenly by area.
fn on_triangle([a, b, c]: &[DVec3; 3], x: DVec2) -> DVec3 {
    let root = x.x.sqrt();
    *a + root * (1.0 - x.y) * (*b - *a) + root * x.y * (*c - *a)
}
