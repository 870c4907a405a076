//! Lightmaps: the irradiance of every texel of an atlas.

use glam::{DVec2, DVec3, Vec3};

use super::atlas::{Atlas, BakeCounts, Lightmap};
use super::buried::buried;
use super::gutter::{continued, dilate};
use super::texels::{Accuracy, Laid, Sheet};
use crate::error::Result;
use crate::mesh::barycentric;
use crate::monitor::Monitor;
use crate::reconstruct::Surface;
use crate::reconstruct::irradiance::{Part, irradiances_of};
use crate::scene::{Notice, Scene};
use crate::solve::Light;

/// How lightmaps are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightmapOptions {
    /// Error of the mean over a texel at which it is sampled more often, in units of the tolerance of
    /// the light times its mean irradiance. Few texels reach it, most are far below.
    pub bend: f64,
    /// Most samples along the side of a texel.
    pub finest: u32,
}

impl Default for LightmapOptions {
    fn default() -> Self {
        LightmapOptions { bend: 0.5, finest: 8 }
    }
}

/// Tolerance of light that was not made to one.
const USUAL: f64 = 1e-2;

/// Bakes the light of a scene onto the pages of an atlas of the same scene.
///
/// A texel's value is the mean of the irradiance (W/m^2) over the part of it that the fronts of
/// triangles cover, in area of the surface; what is buried under other things does not count. Texels
/// without a value of their own continue their neighbours (see `gutter`). The backs of two-sided
/// triangles have no texels: an object whose backs are brighter than its fronts gets a notice.
pub fn bake_lightmaps(
    scene: &Scene,
    light: &Light,
    atlas: &Atlas,
    options: &LightmapOptions,
    monitor: &Monitor,
) -> Result<(Vec<Lightmap>, BakeCounts)> {
    let surface = Surface::new(scene, &light.mesh);
    let (mean, tolerance) = match light.apart() {
        Some(source) => (source.estimate.mean.max_element(), source.tolerance),
        None => (mean_irradiance(light), USUAL),
    };
    let allowed = options.bend * tolerance * mean;
    let accuracy = Accuracy { allowed, finest: options.finest };
    let asked: Vec<bool> = light
        .mesh
        .roots
        .iter()
        .map(|root| {
            let face = &light.mesh.faces[root.face as usize];
            !face.back && atlas.page[face.triangle as usize].is_some()
        })
        .collect();
    let buried = buried(&surface, light, &asked, mean, monitor)?;
    let mut counts = BakeCounts {
        buried: buried.iter().filter(|b| **b).count() as u64,
        notices: brighter_backs(scene, light, atlas),
        ..BakeCounts::default()
    };
    let mut maps = Vec::with_capacity(atlas.pages.len());
    for (number, page) in atlas.pages.iter().enumerate() {
        let number = number as u32;
        let laid = laid(light, atlas, number, &asked, &buried);
        let sheet = Sheet::new(page.width, page.height, &laid);
        let (mut direct, own, refined) = sheet.part(light, Part::Direct, accuracy, monitor)?;
        counts.irradiance.direct += own;
        counts.refined += refined;
        let (mut indirect, own, refined) = sheet.part(light, Part::Indirect, accuracy, monitor)?;
        counts.irradiance.indirect += own;
        counts.refined += refined;
        counts.covered += sheet.covered.iter().filter(|c| **c > 0.0).count() as u64;
        let mut has_value: Vec<bool> = sheet.covered.iter().map(|&c| c > 0.0).collect();
        let on = continued(scene, light, &surface, atlas, number, &sheet.covered, &buried);
        for (part, layer) in [(Part::Direct, &mut direct), (Part::Indirect, &mut indirect)] {
            let (values, _) = irradiances_of(light, part, &on.asked, monitor)?;
            for (value, texel) in values.iter().flatten().zip(on.texels.iter().flatten()) {
                layer[*texel as usize] = value.max(DVec3::ZERO).as_vec3();
                has_value[*texel as usize] = true;
            }
        }
        dilate(page.width, page.height, &mut has_value, [&mut direct, &mut indirect]);
        maps.push(Lightmap {
            width: page.width,
            height: page.height,
            direct,
            indirect,
            covered: sheet.covered,
        });
    }
    Ok((maps, counts))
}

impl Lightmap {
    /// Irradiance of every texel, direct and indirect.
    pub fn total(&self) -> impl Iterator<Item = Vec3> {
        self.direct.iter().zip(&self.indirect).map(|(a, b)| *a + *b)
    }
}

/// The roots on a page that have texels.
fn laid(light: &Light, atlas: &Atlas, page: u32, asked: &[bool], buried: &[bool]) -> Vec<Laid> {
    let size = atlas.pages[page as usize];
    let texels = DVec2::new(f64::from(size.width), f64::from(size.height));
    let mesh = &light.mesh;
    let on_page = |root: usize| {
        let face = &mesh.faces[mesh.roots[root].face as usize];
        let triangle = face.triangle as usize;
        if !asked[root] || buried[root] || atlas.page[triangle] != Some(page) {
            return None;
        }
        let uv = atlas.uv[triangle].map(|x| x * texels);
        let corners = mesh.roots[root].corners;
        let at = |x: DVec2| {
            // Corners of the face are exact.
            match face.corners.iter().position(|c| *c == x) {
                Some(k) => uv[k],
                None => {
                    let w = barycentric(&face.corners, x);
                    w.x * uv[0] + w.y * uv[1] + w.z * uv[2]
                }
            }
        };
        let twice = |t: &[DVec2; 3]| (t[1] - t[0]).perp_dot(t[2] - t[0]).abs();
        let scale = twice(&face.corners) / twice(&uv);
        scale.is_finite().then(|| Laid {
            root: root as u32,
            texels: corners.map(at),
            corners,
            scale,
        })
    };
    (0..mesh.roots.len()).filter_map(on_page).collect()
}

/// Mean irradiance over the surface, of the channels the largest, W/m^2.
fn mean_irradiance(light: &Light) -> f64 {
    let (mut sum, mut area) = (DVec3::ZERO, 0.0);
    for element in 0..light.mesh.elements() {
        let own = light.mesh.area(element);
        sum += own * element_irradiance(light, element);
        area += own;
    }
    if area > 0.0 { (sum / area).max_element() } else { 0.0 }
}

fn element_irradiance(light: &Light, element: usize) -> DVec3 {
    let nodes = light.mesh.basis.nodes();
    let own = &light.solution.irradiance[nodes * element..nodes * (element + 1)];
    own.iter().sum::<DVec3>() / nodes as f64
}

/// Objects whose backs get more light than their fronts, which alone are baked.
fn brighter_backs(scene: &Scene, light: &Light, atlas: &Atlas) -> Vec<Notice> {
    let mut power = vec![[0.0; 2]; scene.objects.len()];
    for element in 0..light.mesh.elements() {
        let face = light.mesh.face_of(element);
        let triangle = face.triangle as usize;
        let two_sided = scene.materials[scene.triangles[triangle].material as usize].two_sided;
        if two_sided && atlas.page[triangle].is_some() {
            power[scene.triangles[triangle].object as usize][usize::from(face.back)] +=
                light.mesh.area(element) * element_irradiance(light, element).element_sum();
        }
    }
    let brighter = power.iter().zip(&scene.objects).filter(|(p, _)| p[1] > p[0]);
    let notice = |(_, object): (_, &crate::scene::Object)| Notice {
        about: format!("object \"{}\"", object.name),
        text:
            "its backs get more light than its fronts, and only fronts are baked: turn its faces \
               around, or give it thickness"
                .into(),
        count: 1,
    };
    brighter.map(notice).collect()
}
