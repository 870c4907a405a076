//! Views: what a camera sees of a solved scene.
//!
//! Each pixel is sampled on a regular grid, the same for every pixel and every run. A sample sees
//! the nearest face; sides that do not radiate are black, and so is what lies beyond the scene.
//! Radiance is (E + rho H)/pi with E and rho averaged over the sample's footprint (so textures are
//! filtered, not point-sampled) and H either interpolated between vertices or gathered.

mod camera_rays;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::error::Result;
use crate::mesh::Face;
use crate::monitor::Monitor;
use crate::operator::walk::Walker;
use crate::reconstruct::{Surface, VertexIrradiance};
use crate::scene::{self, Camera, Scene};
use crate::solve::Light;

pub use camera_rays::{CameraRays, Ray};

/// What is drawn, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples along each side of a pixel, at least 1.
    pub samples: u32,
    /// Whether irradiance is gathered with exact visibility, once for each face in a pixel, instead
    /// of interpolated between the vertices of the elements.
    pub gather: bool,
}

/// Radiance of each pixel, W/(m^2 sr), row by row from the top left.
pub fn render(
    scene: &Scene,
    light: &Light,
    camera: &Camera,
    options: &RenderOptions,
    monitor: &Monitor,
) -> Result<Vec<[f32; 3]>> {
    let surface = Surface::new(scene, &light.mesh);
    let painter = Painter {
        scene,
        light,
        surface: &surface,
        rays: CameraRays::new(camera, options.width, options.height, options.samples.max(1)),
        vertices: VertexIrradiance::new(&light.mesh, &light.solution.irradiance),
        gather: options.gather,
    };
    let stage = monitor.stage("render", u64::from(options.height));
    let rows: Vec<Vec<[f32; 3]>> = (0..options.height)
        .into_par_iter()
        .map_init(Walker::default, |walker, y| {
            // Asked at every pixel: a wide row of gathered samples takes minutes.
            let pixel = |x| monitor.check().map(|()| painter.pixel(walker, x, y));
            let row = (0..options.width).map(pixel).collect::<Result<_>>()?;
            stage.advance(1)?;
            Ok(row)
        })
        .collect::<Result<_>>()?;
    Ok(rows.concat())
}

struct Painter<'a> {
    scene: &'a Scene,
    light: &'a Light,
    surface: &'a Surface<'a>,
    rays: CameraRays,
    vertices: VertexIrradiance,
    gather: bool,
}

/// All samples of one pixel that see one face.
struct Patch {
    face: u32,
    /// Sum of their points in the face's plane.
    place: DVec2,
    count: f64,
    /// Sums of exitance, reflectance and (interpolated) radiosity.
    exitance: DVec3,
    reflectance: DVec3,
    radiosity: DVec3,
}

impl Painter<'_> {
    fn pixel(&self, walker: &mut Walker, x: u32, y: u32) -> [f32; 3] {
        let mut patches: Vec<Patch> = vec![];
        let across = self.rays.samples;
        for j in 0..across {
            for i in 0..across {
                if let Some(sample) = self.sample(self.rays.sample(x, y, i, j)) {
                    match patches.iter_mut().find(|p| p.face == sample.face) {
                        Some(patch) => patch.join(&sample),
                        None => patches.push(sample),
                    }
                }
            }
        }
        let mut sum = DVec3::ZERO;
        for patch in &patches {
            if self.gather && patch.reflectance != DVec3::ZERO {
                // A face is convex: the mean of points on it lies on it.
                let frame = &self.light.mesh.faces[patch.face as usize].frame;
                let point = frame.lift(patch.place / patch.count);
                let irradiance = self.light.irradiance(walker, point, frame.n);
                sum += patch.exitance + patch.reflectance * irradiance;
            } else {
                sum += patch.radiosity;
            }
        }
        let radiance = sum / (f64::from(across * across) * std::f64::consts::PI);
        radiance.as_vec3().to_array()
    }

    /// What one ray sees; `None` for what is black or beyond the scene.
    fn sample(&self, ray: Ray) -> Option<Patch> {
        let met = self.surface.cast(ray.origin, ray.direction)?;
        let index = met.face?;
        let mesh = &self.light.mesh;
        let face = &mesh.faces[index as usize];
        let place = face.frame.project(ray.origin + met.t * ray.direction);
        let footprint = footprint(face, &ray, place);
        let triangle = met.triangle as usize;
        let exitance = scene::exitance(self.scene, triangle, &footprint);
        let reflectance = scene::reflectance(self.scene, triangle, &footprint);
        let mut radiosity = exitance;
        if !self.gather {
            let element = mesh.locate(index as usize, place);
            radiosity += reflectance * self.vertices.at(mesh, element, place);
        }
        Some(Patch { face: index, place, count: 1.0, exitance, reflectance, radiosity })
    }
}

impl Patch {
    fn join(&mut self, other: &Patch) {
        self.place += other.place;
        self.count += other.count;
        self.exitance += other.exitance;
        self.reflectance += other.reflectance;
        self.radiosity += other.radiosity;
    }
}

/// Corners of a triangle of the size of the ray's footprint on its face, centred where the ray
/// meets it, as weights of the corners of the input triangle.
fn footprint(face: &Face, ray: &Ray, place: DVec2) -> [DVec3; 3] {
    let frame = &face.frame;
    let meet = |origin: DVec3, direction: DVec3| {
        let t = -frame.height(origin) / direction.dot(frame.n);
        (t > 0.0 && t.is_finite()).then(|| frame.project(origin + t * direction))
    };
    let right = meet(ray.right.0, ray.right.1).map_or(DVec2::ZERO, |p| p - place);
    let down = meet(ray.down.0, ray.down.1).map_or(DVec2::ZERO, |p| p - place);
    [-0.5 * right - 0.5 * down, right - 0.5 * down, down - 0.5 * right]
        .map(|offset| face.triangle_weights(place + offset))
}
