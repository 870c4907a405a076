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
//!
//! Where what emits has few faces, what would arrive if nothing stood in between is known in closed
//! form, and samples tell but the share of it that arrives: that is known exactly wherever nothing,
//! or everything, is in shadow.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::bundles::RayScene;
use super::hemisphere::{flips, in_square};
use super::spread::{Shares, on_triangle};
use super::walk::Walker;
use crate::geometry::polygon::Linear;
use crate::geometry::{COINCIDENCE, Frame, Pieces, triangle_area};
use crate::kernel::{self, Precision, View};
use crate::mesh::Mesh;
use crate::scene::{self, Scene};

/// All that emits.
pub struct Lamps {
    lamps: Vec<Lamp>,
    /// Planes that they lie in, where they are few.
    planes: Vec<Plane>,
    /// Of each face of the mesh its lamp.
    of_face: Vec<Option<u32>>,
    shares: Shares,
    /// One over the power of all, 1/W.
    density: f64,
    /// Whether no texture varies what a face emits.
    even: bool,
    /// Largest coordinate of the scene, metres.
    magnitude: f64,
}

/// What is found of emitted light, W/m^2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lit {
    /// By samples that see what emits.
    pub seen: DVec3,
    /// By all samples, as if nothing stood in between: only where [`Lamps::are_few`].
    pub all: DVec3,
}

impl std::ops::AddAssign for Lit {
    fn add_assign(&mut self, more: Lit) {
        self.seen += more.seen;
        self.all += more.all;
    }
}

/// With more faces that emit than these it does not pay to know the unshadowed light.
const FEW: usize = 32;

/// How many samples of each kind there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Samples {
    /// Points of what emits.
    pub points: u32,
    /// Rays into the hemisphere.
    pub rays: u32,
}

/// Where light is gathered, and by which points and directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Position, metres.
    pub point: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Flips of the bits of points and directions ([`super::hemisphere`]).
    pub flips: [u32; 2],
}

impl Place {
    /// With directions of its own.
    pub fn new(point: DVec3, normal: DVec3) -> Place {
        Place { point, normal, flips: flips(point) }
    }
}

/// A face that emits.
struct Lamp {
    corners: [DVec3; 3],
    frame: Frame,
    flat: [DVec2; 3],
    /// Exitance, W/m^2.
    exitance: DVec3,
}

/// A plane with lamps that radiate to one side of it.
struct Plane {
    frame: Frame,
    /// Numbers of lamps with their sides in the plane: a point is inside where all are positive.
    lamps: Vec<(u32, [Linear; 3])>,
}

impl Lamps {
    /// All faces of a mesh that emit; textures are averaged over each.
    pub fn new(scene: &Scene, mesh: &Mesh) -> Lamps {
        let (mut lamps, mut powers) = (vec![], vec![]);
        let (mut of_face, mut even) = (vec![], true);
        for face in &mesh.faces {
            let whole = face.corners.map(|x| face.triangle_weights(x));
            let e = scene::exitance(scene, face.triangle as usize, &whole);
            let power = triangle_area(&face.corners) * e.max_element();
            of_face.push((power > 0.0).then_some(lamps.len() as u32));
            if power > 0.0 {
                let material = scene.triangles[face.triangle as usize].material as usize;
                even &= scene.materials[material].radiance_texture.is_none();
                powers.push(power);
                let corners = face.corners.map(|x| face.frame.lift(x));
                let (frame, flat) = (face.frame, face.corners);
                lamps.push(Lamp { corners, frame, flat, exitance: e });
            }
        }
        let (shares, sum) = Shares::of(powers);
        let magnitude = mesh.magnitude;
        let planes = if lamps.len() <= FEW { planes(&lamps, magnitude) } else { vec![] };
        Lamps { lamps, planes, of_face, shares, density: 1.0 / sum, even, magnitude }
    }

    /// Whether each face emits evenly: otherwise what samples find is a mean over it.
    pub fn are_even(&self) -> bool {
        self.even
    }

    /// Whether they are so few that [`Lamps::unshadowed`] is worth its time.
    pub fn are_few(&self) -> bool {
        self.lamps.len() <= FEW
    }

    /// Irradiance at a point with a unit normal if nothing stood in between, W/m^2.
    pub fn unshadowed(&self, point: DVec3, normal: DVec3) -> DVec3 {
        let mut scratch = Pieces::default();
        let mut sum = DVec3::ZERO;
        for lamp in &self.lamps {
            let view = View::new(&lamp.frame, point, normal);
            if view.d > COINCIDENCE * self.magnitude {
                let horizon = view.horizon(self.magnitude);
                let (flat, exact) = (&lamp.flat, &Precision::EXACT);
                let found =
                    kernel::moments_above(&view, flat, flat[0], &horizon, exact, &mut scratch);
                sum += found.zeroth / PI * lamp.exitance;
            }
        }
        sum
    }

    /// All that a ray from a point would meet of what emits if nothing stood in between, where these
    /// are few; as [`Lamps::met`].
    pub fn along(&self, point: DVec3, direction: DVec3, cosine: f64, samples: Samples) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for plane in &self.planes {
            let (from, height) = (-direction.dot(plane.frame.n), plane.frame.height(point));
            if from <= 0.0 || height <= COINCIDENCE * self.magnitude {
                continue;
            }
            let t = height / from;
            let x = plane.frame.project(point + t * direction);
            for (lamp, sides) in &plane.lamps {
                if sides.iter().all(|side| side.at(x) >= 0.0) {
                    let lamp = &self.lamps[*lamp as usize];
                    sum += self.weighed(lamp, t * t, cosine * from, samples);
                }
            }
        }
        sum
    }

    /// How many faces emit.
    pub fn len(&self) -> usize {
        self.lamps.len()
    }

    /// Whether none does.
    pub fn is_empty(&self) -> bool {
        self.lamps.is_empty()
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

    /// What `count` points of all that emits, from number `first` on, add to the irradiance at a
    /// point with a unit normal.
    pub fn by_points(
        &self,
        walker: &mut Walker,
        rays: &RayScene,
        Place { point, normal, flips }: Place,
        (first, count): (u32, u32),
        samples: Samples,
    ) -> Lit {
        if self.is_empty() {
            return Lit::default();
        }
        let mut sum = Lit::default();
        for k in rays.in_order(first, count) {
            let (number, x) = self.shares.choose(in_square(k, flips));
            let lamp = &self.lamps[number];
            let w = on_triangle(x);
            let at = w.x * lamp.corners[0] + w.y * lamp.corners[1] + w.z * lamp.corners[2];
            let between = at - point;
            let square = between.length_squared();
            let cosines = between.dot(normal) * -between.dot(lamp.frame.n);
            if between.dot(normal) > 0.0 && cosines > 0.0 {
                let own = self.weighed(lamp, square, cosines / square, samples);
                sum.all += own;
                if !rays.is_blocked(walker, point, at) {
                    sum.seen += own;
                }
            }
        }
        sum
    }
}

/// The planes of lamps.
fn planes(lamps: &[Lamp], magnitude: f64) -> Vec<Plane> {
    let mut planes: Vec<Plane> = vec![];
    for (number, lamp) in lamps.iter().enumerate() {
        let holds = |plane: &Plane| {
            let off = |p: &DVec3| plane.frame.height(*p).abs();
            lamp.frame.n.dot(plane.frame.n) > 0.0
                && lamp.corners.iter().all(|p| off(p) <= COINCIDENCE * magnitude)
        };
        let place = planes.iter().position(holds).unwrap_or_else(|| {
            planes.push(Plane { frame: lamp.frame, lamps: vec![] });
            planes.len() - 1
        });
        let own = &mut planes[place];
        let flat = lamp.corners.map(|p| own.frame.project(p));
        let sides = std::array::from_fn(|k| {
            let (a, b) = (flat[k], flat[(k + 1) % 3]);
            let g = (b - a).perp();
            Linear { g, c: -g.dot(a), uncertainty: 0.0 }
        });
        own.lamps.push((number as u32, sides));
    }
    planes
}
