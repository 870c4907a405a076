//! What the surface under each texel reflects and emits.
//!
//! Of each texel the part of it that each triangle covers is cut out as a polygon (`raster`), and
//! reflectance and exitance are averaged over all parts by their area: the same averages as of elements
//! and pixels ([`crate::scene::reflectance`]). Texels that nothing covers take over what the nearest
//! ones have (in steps across edges of texels; of equally near ones the first row by row), so that
//! interpolation across the edge of a chart finds its own colour.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::atlas::Atlas;
use super::raster::parts;
use crate::error::Result;
use crate::mesh::barycentric;
use crate::monitor::Monitor;
use crate::scene::{self, Scene};

/// Rows that one task averages.
const BAND: u32 = 32;

/// Reflectance and exitance by texel, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceMap {
    /// Reflectance.
    pub reflectance: Vec<Vec3>,
    /// Exitance, W/m^2.
    pub exitance: Vec<Vec3>,
    /// Whether any surface covers the texel.
    pub covered: Vec<bool>,
}

/// Looks at the surface under each texel of page `page`.
pub fn surface_map(
    scene: &Scene,
    atlas: &Atlas,
    page: u32,
    monitor: &Monitor,
) -> Result<SurfaceMap> {
    let size = atlas.pages[page as usize];
    let bands = size.height.div_ceil(BAND);
    let scale = DVec2::new(f64::from(size.width), f64::from(size.height));
    let mut own: Vec<Vec<Placed>> = vec![vec![]; bands as usize];
    for (index, _) in atlas.page.iter().enumerate().filter(|(_, p)| **p == Some(page)) {
        let placed = Placed::new(scene, index, atlas.uv[index].map(|uv| uv * scale));
        let rows = rows_of(&placed.corners, size.height);
        for band in rows.0 / BAND..rows.1.div_ceil(BAND) {
            own[band as usize].push(placed);
        }
    }
    let stage = monitor.stage("colour", u64::from(bands));
    let texels: Vec<Vec<Sum>> = own
        .into_par_iter()
        .enumerate()
        .map(|(band, triangles)| {
            let first = band as u32 * BAND;
            let rows = (first, (first + BAND).min(size.height));
            let mut sums = vec![Sum::default(); ((rows.1 - rows.0) * size.width) as usize];
            for triangle in &triangles {
                triangle.add(scene, rows, size.width, &mut sums);
            }
            stage.advance(1)?;
            Ok(sums)
        })
        .collect::<Result<_>>()?;
    let mut map = SurfaceMap { reflectance: vec![], exitance: vec![], covered: vec![] };
    for sum in texels.into_iter().flatten() {
        let mean = |v: DVec3| if sum.area > 0.0 { (v / sum.area).as_vec3() } else { Vec3::ZERO };
        map.reflectance.push(mean(sum.reflectance));
        map.exitance.push(mean(sum.exitance));
        map.covered.push(sum.area > 0.0);
    }
    map.spread(size.width as usize, size.height as usize);
    Ok(map)
}

impl SurfaceMap {
    /// Gives texels that nothing covers what the nearest ones have.
    fn spread(&mut self, width: usize, height: usize) {
        let mut known = self.covered.clone();
        let mut front: Vec<usize> = (0..known.len()).filter(|&i| known[i]).collect();
        while !front.is_empty() {
            let mut next = vec![];
            for i in front {
                let (x, y) = (i % width, i / width);
                let beside = [
                    (x > 0).then(|| i - 1),
                    (x + 1 < width).then_some(i + 1),
                    (y > 0).then(|| i - width),
                    (y + 1 < height).then_some(i + width),
                ];
                for j in beside.into_iter().flatten() {
                    if !known[j] {
                        known[j] = true;
                        self.reflectance[j] = self.reflectance[i];
                        self.exitance[j] = self.exitance[i];
                        next.push(j);
                    }
                }
            }
            front = next;
        }
    }
}

#[derive(Clone, Copy, Default)]
struct Sum {
    /// Square texels.
    area: f64,
    reflectance: DVec3,
    exitance: DVec3,
}

/// A triangle on a page.
#[derive(Clone, Copy)]
struct Placed {
    triangle: usize,
    /// Corners in texels.
    corners: [DVec2; 3],
    /// Reflectance and exitance where they are the same everywhere.
    same: Option<(DVec3, DVec3)>,
}

/// The rows that a triangle may cover: from the first to before the second.
fn rows_of(corners: &[DVec2; 3], height: u32) -> (u32, u32) {
    let (low, high) = range(corners.iter().map(|c| c.y));
    let first = low.floor().clamp(0.0, f64::from(height)) as u32;
    (first, high.ceil().clamp(f64::from(first), f64::from(height)) as u32)
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
}

impl Placed {
    fn new(scene: &Scene, index: usize, corners: [DVec2; 3]) -> Placed {
        let triangle = &scene.triangles[index];
        let material = &scene.materials[triangle.material as usize];
        let plain = triangle.colour == [DVec3::ONE; 3]
            && material.reflectance_texture.is_none()
            && material.metallic_texture.is_none()
            && material.radiance_texture.is_none();
        let whole = [DVec3::X, DVec3::Y, DVec3::Z];
        let same = plain.then(|| {
            (scene::reflectance(scene, index, &whole), scene::exitance(scene, index, &whole))
        });
        Placed { triangle: index, corners, same }
    }

    /// Adds its parts in some rows.
    fn add(&self, scene: &Scene, rows: (u32, u32), width: u32, sums: &mut [Sum]) {
        parts(&self.corners, rows.0..rows.1, width, |part| {
            let (reflectance, exitance) = self.same.unwrap_or_else(|| {
                // A triangle of the size of the part, around its centroid.
                let size = (2.0 * part.area).sqrt();
                let around = [[-1.0, -1.0], [2.0, -1.0], [-1.0, 2.0]].map(DVec2::from);
                let footprint = around.map(|d| {
                    let w = barycentric(&self.corners, part.centre + size / 3.0 * d);
                    // Not beyond the triangle, where its colours end.
                    let w = w.max(DVec3::ZERO);
                    w / w.element_sum()
                });
                (
                    scene::reflectance(scene, self.triangle, &footprint),
                    scene::exitance(scene, self.triangle, &footprint),
                )
            });
            let sum = &mut sums[((part.row - rows.0) * width + part.column) as usize];
            sum.area += part.area;
            sum.reflectance += part.area * reflectance;
            sum.exitance += part.area * exitance;
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::atlas::Page;
    use super::*;
    use crate::scene::{Material, Triangle};

    /// A square over part of a page, its lower half of another colour.
    fn scene_and_atlas() -> (Scene, Atlas) {
        let corners = [DVec2::new(0.1, 0.2), DVec2::new(0.7, 0.2), DVec2::new(0.7, 0.9)];
        let others = [DVec2::new(0.1, 0.2), DVec2::new(0.7, 0.9), DVec2::new(0.1, 0.9)];
        let triangle = |uv: [DVec2; 3], material| Triangle {
            vertices: uv.map(|p| p.extend(0.0)),
            uv: [[DVec2::ZERO; 3]; 2],
            colour: [DVec3::ONE; 3],
            material,
            object: 0,
        };
        let mut lamp = Material::plain("b", DVec3::splat(0.25));
        lamp.radiance = DVec3::X;
        let scene = Scene {
            triangles: vec![triangle(corners, 0), triangle(others, 1)],
            materials: vec![Material::plain("a", DVec3::new(0.5, 0.0, 1.0)), lamp],
            ..Scene::default()
        };
        let atlas = Atlas {
            pages: vec![Page { width: 50, height: 70 }],
            page: vec![Some(0); 2],
            uv: vec![corners, others],
            ..Atlas::default()
        };
        (scene, atlas)
    }

    #[test]
    fn sums_over_texels_are_those_over_the_surface() {
        let (scene, atlas) = scene_and_atlas();
        let map = surface_map(&scene, &atlas, 0, &Monitor::silent()).unwrap();
        let at = |x: f64, y: f64| (y * 70.0) as usize * 50 + (x * 50.0) as usize;
        assert_eq!(map.reflectance[at(0.6, 0.3)], Vec3::new(0.5, 0.0, 0.999));
        assert_eq!(map.exitance[at(0.6, 0.3)], Vec3::ZERO);
        assert_eq!(map.reflectance[at(0.2, 0.8)], Vec3::splat(0.25));
        assert!((map.exitance[at(0.2, 0.8)].x - std::f32::consts::PI).abs() < 1e-6);
        // On the diagonal both have a share.
        let mixed = map.exitance[at(0.41, 0.551)].x;
        assert!(mixed > 0.1 && mixed < 3.0, "{mixed}");
        // Outside, the nearest.
        assert!(!map.covered[at(0.9, 0.3)]);
        assert_eq!(map.reflectance[at(0.9, 0.3)], Vec3::new(0.5, 0.0, 0.999));
        let count = map.covered.iter().filter(|c| **c).count();
        // 0.1 to 0.7 of 50 are texels 5 to 34, 0.2 to 0.9 of 70 are 14 to 62.
        assert_eq!(count, 30 * 49);
    }
}
