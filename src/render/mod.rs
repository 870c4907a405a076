//! Views: what a camera sees of a solved scene.
//!
//! Each pixel is sampled on a regular grid, the same for every pixel and every run. A sample sees
//! the nearest face; sides that do not radiate are black, and so is what lies beyond the scene.
//! Radiance is (E + rho H)/pi with E and rho averaged over the sample's footprint (so textures are
//! filtered, not point-sampled) and H either interpolated between vertices or gathered, once for each
//! root in a pixel.

mod camera_rays;

use std::ops::Range;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::error::Result;
use crate::mesh::Face;
use crate::monitor::Monitor;
use crate::reconstruct::fill::RootPoints;
use crate::reconstruct::irradiance::{
    IrradianceCounts, Look, Shown, changes, irradiances_shown, look,
};
use crate::reconstruct::{Surface, VertexIrradiance};
use crate::scene::{self, Camera, Scene};
use crate::solve::Light;

pub use camera_rays::{CameraRays, Ray};

/// About how many pixels are gathered together: what lies between is filled in, and is held in
/// memory.
const BAND: usize = 1 << 21;

/// So many pixels each way tell how bright a picture is, and how many rays it takes.
const LOOKED: f64 = 20.0;

/// Irradiance may be more times as far off where surfaces reflect less than is usual in the picture, but
/// at most so many: it would be seen on dark ones as well.
const MOST_SLACK: f64 = 3.0;

/// What is drawn, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples along each side of a pixel, at least 1.
    pub samples: u32,
    /// Whether irradiance is gathered with exact visibility instead of interpolated between the
    /// vertices of the elements. Light that was made to a tolerance is always gathered.
    pub gather: bool,
}

/// How much was gathered for a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gathered {
    /// Points, and what they are off by.
    pub counts: IrradianceCounts,
    /// The mean irradiance that this is allowed relative to, W/m^2: that of the surface, or, where light
    /// is gathered by rays and the picture is brighter, of what it shows.
    pub against: DVec3,
}

impl Gathered {
    /// Root mean square error of the irradiance by filling in and rays, relative to
    /// [`Gathered::against`]; by rays, where surfaces reflect less than is usual, counted for as much
    /// less, a third at least.
    pub fn error(&self) -> f64 {
        self.counts.error(self.against)
    }
}

/// Radiance of each pixel, W/(m^2 sr), row by row from the top left; and how much was gathered for
/// it.
pub fn render(
    scene: &Scene,
    light: &Light,
    camera: &Camera,
    options: &RenderOptions,
    monitor: &Monitor,
) -> Result<(Vec<[f32; 3]>, Gathered)> {
    let surface = Surface::new(scene, &light.mesh);
    let mut painter = Painter::new(scene, light, camera, options, &surface);
    if options.gather || light.apart().is_some() {
        let mean = light.apart().map_or(DVec3::ZERO, |source| source.estimate.mean);
        let look = painter.look(options, monitor)?;
        let mut counts = IrradianceCounts::default();
        let pixels = painter.gathered(
            options,
            |asked, reflectances| {
                let shown = Shown { look, slack: slack(asked, reflectances) };
                let (values, own) = irradiances_shown(light, asked, &shown, monitor)?;
                counts += own;
                Ok(values)
            },
            |patch| patch.reflectance != DVec3::ZERO,
            |patch, irradiance| {
                (patch.exitance + patch.reflectance * irradiance) / std::f64::consts::PI
            },
            monitor,
        )?;
        return Ok((pixels, Gathered { counts, against: look.brighter * mean }));
    }
    painter.vertices = Some(VertexIrradiance::new(&light.mesh, &light.solution.irradiance));
    let stage = monitor.stage("render", u64::from(options.height));
    let share = f64::from(painter.rays.samples.pow(2)) * std::f64::consts::PI;
    let rows: Vec<Vec<[f32; 3]>> = (0..options.height)
        .into_par_iter()
        .map(|y| {
            let pixel = |x| {
                let sum: DVec3 = painter.patches(x, y).iter().map(|p| p.radiosity).sum();
                (sum / share).as_vec3().to_array()
            };
            let row = (0..options.width).map(pixel).collect();
            stage.advance(1)?;
            Ok(row)
        })
        .collect::<Result<_>>()?;
    Ok((rows.concat(), Gathered::default()))
}

/// The estimated error of the irradiance at each pixel, relative to its mean over the surface, for
/// light that was made to a tolerance: infinite where there was but one mesh, or for other light.
pub fn error_map(
    scene: &Scene,
    light: &Light,
    camera: &Camera,
    options: &RenderOptions,
    monitor: &Monitor,
) -> Result<Vec<[f32; 3]>> {
    let surface = Surface::new(scene, &light.mesh);
    let painter = Painter::new(scene, light, camera, options, &surface);
    let known = light.apart().filter(|source| source.coarser.is_some());
    let Some(estimate) = known.map(|source| source.estimate) else {
        return Ok(vec![[f32::INFINITY; 3]; options.width as usize * options.height as usize]);
    };
    let mean = estimate.mean;
    let scale = DVec3::select(mean.cmpgt(DVec3::ZERO), estimate.of_change / mean, DVec3::ZERO);
    painter.gathered(
        options,
        |asked, _| changes(light, asked, monitor),
        |_| true,
        |patch, change| patch.count * scale * change,
        monitor,
    )
}

/// How many times as far off irradiance may be on roots that reflect so much: what errors of it do to the
/// picture is to be the same everywhere. Relative to the root mean square over all points.
fn slack(asked: &[RootPoints], reflectances: &[f64]) -> Vec<f64> {
    let count = |own: &RootPoints| own.points.len() as f64;
    let all: f64 = asked.iter().map(count).sum();
    let squares = asked.iter().zip(reflectances).map(|(own, rho)| count(own) * rho * rho);
    let usual = (squares.sum::<f64>() / all).sqrt();
    reflectances.iter().map(|rho| (usual / rho).clamp(1.0, MOST_SLACK)).collect()
}

struct Painter<'a> {
    scene: &'a Scene,
    light: &'a Light,
    surface: &'a Surface<'a>,
    rays: CameraRays,
    /// Where irradiance is interpolated.
    vertices: Option<VertexIrradiance>,
}

/// All samples of one pixel that see one root.
struct Patch {
    root: u32,
    /// Sum of their points in the face's plane.
    place: DVec2,
    count: f64,
    /// Sums of exitance, reflectance and (interpolated) radiosity.
    exitance: DVec3,
    reflectance: DVec3,
    radiosity: DVec3,
}

impl<'a> Painter<'a> {
    fn new(
        scene: &'a Scene,
        light: &'a Light,
        camera: &Camera,
        options: &RenderOptions,
        surface: &'a Surface<'a>,
    ) -> Painter<'a> {
        let rays = CameraRays::new(camera, options.width, options.height, options.samples.max(1));
        Painter { scene, light, surface, rays, vertices: None }
    }

    /// Pixels as sums over their patches of what `compose` makes of a patch and of the value that
    /// `gather` (points by root, largest reflectance in the patches of each) finds in the middle of it
    /// (where `wants` it: zero elsewhere).
    fn gathered(
        &self,
        options: &RenderOptions,
        mut gather: impl FnMut(&[RootPoints], &[f64]) -> Result<Vec<Vec<DVec3>>>,
        wants: impl Fn(&Patch) -> bool,
        compose: impl Fn(&Patch, DVec3) -> DVec3,
        monitor: &Monitor,
    ) -> Result<Vec<[f32; 3]>> {
        let samples = self.rays.samples.pow(2);
        let rows_at_once = (BAND as u32 / options.width.max(1)).max(1);
        let mut pixels = vec![];
        for first in (0..options.height).step_by(rows_at_once as usize) {
            let rows = first..(first + rows_at_once).min(options.height);
            let (patches, ends) = self.band(rows, options.width, monitor)?;
            let mut asked: Vec<RootPoints> = vec![];
            let mut reflectances: Vec<f64> = vec![];
            let mut group = vec![None; self.light.mesh.roots.len()];
            // Where the value of each patch will be.
            let places: Vec<Option<(usize, usize)>> = patches
                .iter()
                .map(|patch| {
                    wants(patch).then(|| {
                        let own = *group[patch.root as usize].get_or_insert_with(|| {
                            asked.push(RootPoints { root: patch.root, points: vec![] });
                            reflectances.push(0.0);
                            asked.len() - 1
                        });
                        let reflectance = patch.reflectance.max_element() / patch.count;
                        reflectances[own] = reflectances[own].max(reflectance);
                        // A root is convex: the mean of points on it lies on it.
                        asked[own].points.push(patch.place / patch.count);
                        (own, asked[own].points.len() - 1)
                    })
                })
                .collect();
            let values = gather(&asked, &reflectances)?;
            let mut begin = 0;
            for end in ends {
                let sum: DVec3 = (begin..end)
                    .map(|k| {
                        let value = places[k].map_or(DVec3::ZERO, |(own, k)| values[own][k]);
                        compose(&patches[k], value)
                    })
                    .sum();
                pixels.push((sum / f64::from(samples)).as_vec3().to_array());
                begin = end;
            }
        }
        Ok(pixels)
    }

    /// What some pixels tell of the picture, where light is gathered by rays.
    fn look(&self, options: &RenderOptions, monitor: &Monitor) -> Result<Look> {
        if self.light.apart().is_none_or(|source| source.rays.is_none()) {
            return Ok(Look::default());
        }
        let (mut asked, mut weights, mut reflectances) = (vec![], vec![], vec![]);
        let middle = |k: u32, size: u32| ((f64::from(k) + 0.5) * f64::from(size) / LOOKED) as u32;
        for k in 0..(LOOKED * LOOKED) as u32 {
            let (i, j) = (k % LOOKED as u32, k / LOOKED as u32);
            let (x, y) = (middle(i, options.width), middle(j, options.height));
            for patch in self.patches(x, y).iter().filter(|p| p.reflectance != DVec3::ZERO) {
                let points = vec![patch.place / patch.count];
                asked.push(RootPoints { root: patch.root, points });
                weights.push(patch.count);
                reflectances.push(patch.reflectance.max_element() / patch.count);
            }
        }
        look(self.light, &asked, &weights, &slack(&asked, &reflectances), monitor)
    }

    /// The patches of the pixels of some rows, and where those of each pixel end.
    fn band(
        &self,
        rows: Range<u32>,
        width: u32,
        monitor: &Monitor,
    ) -> Result<(Vec<Patch>, Vec<usize>)> {
        let stage = monitor.stage("look", u64::from(rows.end - rows.start));
        let found: Vec<Vec<Vec<Patch>>> = rows
            .into_par_iter()
            .map(|y| {
                stage.advance(1)?;
                Ok((0..width).map(|x| self.patches(x, y)).collect())
            })
            .collect::<Result<_>>()?;
        let (mut patches, mut ends) = (vec![], vec![]);
        for pixel in found.into_iter().flatten() {
            patches.extend(pixel);
            ends.push(patches.len());
        }
        Ok((patches, ends))
    }

    /// What the samples of a pixel see.
    fn patches(&self, x: u32, y: u32) -> Vec<Patch> {
        let mut patches: Vec<Patch> = vec![];
        let across = self.rays.samples;
        for j in 0..across {
            for i in 0..across {
                if let Some(sample) = self.sample(self.rays.sample(x, y, i, j)) {
                    match patches.iter_mut().find(|p| p.root == sample.root) {
                        Some(patch) => patch.join(&sample),
                        None => patches.push(sample),
                    }
                }
            }
        }
        patches
    }

    /// What one ray sees; `None` for what is black or beyond the scene.
    fn sample(&self, ray: Ray) -> Option<Patch> {
        let met = self.surface.cast(ray.origin, ray.direction)?;
        let index = met.face?;
        let mesh = &self.light.mesh;
        let face = &mesh.faces[index as usize];
        let place = face.frame.project(ray.origin + met.t * ray.direction);
        let root = mesh.root_at(index as usize, place);
        let footprint = footprint(face, &ray, place);
        let triangle = met.triangle as usize;
        let exitance = scene::exitance(self.scene, triangle, &footprint);
        let reflectance = scene::reflectance(self.scene, triangle, &footprint);
        let mut radiosity = exitance;
        if let Some(vertices) = &self.vertices {
            radiosity += reflectance * vertices.at(mesh, mesh.locate_in(root, place), place);
        }
        let root = root as u32;
        Some(Patch { root, place, count: 1.0, exitance, reflectance, radiosity })
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
