//! Averages over a piece of surface of what a material multiplies there.
//!
//! The reflectance at a point is factor x texture x vertex colour x (1 - metallic x its texture),
//! the exitance pi x radiance x texture. Elements need the *area average of the product*, so that
//! light is neither made nor lost by the mesh. Without textures the product is linear and its
//! average is its value at the centroid, exactly.
//!
//! With textures the footprint is bisected along its longest edge, measured in texels, until every
//! part is at most one texel long (half a texel where that is cheap); each part is integrated by
//! the three-point rule of degree 2, which is exact where the texture times the vertex colours is
//! of that degree. A footprint that would need more than [`PARTS`] parts reads a coarser level of the
//! texture's pyramid, whose texels are exact averages: what is lost is only at the footprint's
//! rim, of a width of about 1/40 of its size. For a product of two textures more parts are
//! allowed, since averages of each would lose how they go together. Texels that are squares of one
//! colour (`nearest`) are resolved to an eighth of a texel.
//!
//! Sums have a fixed order: the result is the same bit for bit every time.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::limits::MAX_REFLECTANCE;
use super::texture::{Texture, Wrap};
use super::{Scene, TextureUse, Triangle};

/// About how many parts a footprint is cut into at most, for one texture.
const PARTS: f64 = 4096.0;

/// About how many for a product of two textures.
const PARTS_OF_PRODUCT: f64 = 32_768.0;

/// Parts to an edge of a texel, where there are few enough texels: the interpolation has kinks at
/// the lines between texel centres, which the rule does not know of.
const SMOOTH: f64 = 2.0;

/// The same for a texel that is a square of one colour.
const SHARP: f64 = 8.0;

/// Image coordinates beyond this hold no position in the image: 2^30 repeats, where steps of f64 are a
/// 32nd of an eighth of a texel of the largest image. They count as zero.
const FARTHEST: f64 = 1_073_741_824.0;

/// Parts with a smaller share of the footprint are not cut further, however long they seem to be: far
/// below what [`PARTS_OF_PRODUCT`] makes, reached only where rounding hides how long they are.
const SMALLEST_SHARE: f64 = 1.0 / 1_048_576.0;

/// Mean reflectance, in [0, [`MAX_REFLECTANCE`]], of the part of a triangle whose corners are
/// given by barycentric coordinates with respect to its vertices.
///
/// # Panics
///
/// If there is no such triangle, or its material is not in the scene.
pub fn reflectance(scene: &Scene, triangle: usize, footprint: &[DVec3; 3]) -> DVec3 {
    let triangle = &scene.triangles[triangle];
    let material = &scene.materials[triangle.material as usize];
    let white = triangle.colour == [DVec3::ONE; 3];
    let colour = |b: DVec3| {
        let c = &triangle.colour;
        if white { DVec3::ONE } else { c[0] * b.x + c[1] * b.y + c[2] * b.z }
    };
    let base = Layer::of(scene, triangle, &material.reflectance_texture);
    let metal =
        Layer::of(scene, triangle, &material.metallic_texture).filter(|_| material.metallic != 0.0);
    let mean = match (base, metal) {
        (None, None) => colour(centroid(footprint)) * (1.0 - material.metallic),
        (Some(base), None) => {
            let sum = average([base], footprint, |b, [base]| colour(b) * base);
            sum * (1.0 - material.metallic)
        }
        (None, Some(metal)) => average([metal], footprint, |b, [metal]| {
            colour(b) * (1.0 - material.metallic * metal.z)
        }),
        (Some(base), Some(metal)) => average([base, metal], footprint, |b, [base, metal]| {
            colour(b) * base * (1.0 - material.metallic * metal.z)
        }),
    };
    (material.reflectance * mean).clamp(DVec3::ZERO, DVec3::splat(MAX_REFLECTANCE))
}

/// Mean emitted exitance, pi x radiance, W/m^2, of the part of a triangle whose corners are given
/// by barycentric coordinates with respect to its vertices.
///
/// # Panics
///
/// If there is no such triangle, or its material is not in the scene.
pub fn exitance(scene: &Scene, triangle: usize, footprint: &[DVec3; 3]) -> DVec3 {
    let triangle = &scene.triangles[triangle];
    let material = &scene.materials[triangle.material as usize];
    if material.radiance == DVec3::ZERO {
        return DVec3::ZERO;
    }
    let factor = match Layer::of(scene, triangle, &material.radiance_texture) {
        None => DVec3::ONE,
        Some(layer) => average([layer], footprint, |_, [value]| value),
    };
    material.radiance * factor * PI
}

fn centroid(footprint: &[DVec3; 3]) -> DVec3 {
    (footprint[0] + footprint[1] + footprint[2]) / 3.0
}

/// A texture as seen from one triangle.
struct Layer<'a> {
    texture: &'a Texture,
    /// Image coordinates of the triangle's vertices.
    uv: [DVec2; 3],
    wrap: [Wrap; 2],
    nearest: bool,
    /// Level of the pyramid to read.
    level: usize,
    /// Parts to a unit of image coordinates, across and down.
    density: DVec2,
}

impl<'a> Layer<'a> {
    /// The layer, or none if there is no texture.
    fn of(scene: &'a Scene, triangle: &Triangle, used: &Option<TextureUse>) -> Option<Self> {
        let used = used.as_ref()?;
        let texture = scene.textures.get(used.texture)?;
        let mut uv = triangle.uv.get(used.set)?.map(|uv| used.apply(uv));
        if !uv.iter().all(|x| x.abs().max_element() < FARTHEST) {
            uv = [DVec2::ZERO; 3];
        }
        let size = DVec2::new(f64::from(texture.width), f64::from(texture.height));
        Some(Layer { texture, uv, wrap: used.wrap, nearest: used.nearest, level: 0, density: size })
    }

    fn at(&self, b: DVec3) -> DVec2 {
        self.uv[0] * b.x + self.uv[1] * b.y + self.uv[2] * b.z
    }

    fn value(&self, b: DVec3) -> DVec3 {
        self.texture.sample(self.at(b), self.level, self.wrap, self.nearest)
    }

    /// Squared length of a barycentric step, in parts.
    fn length_squared(&self, step: DVec3) -> f64 {
        (self.at(step) * self.density).length_squared()
    }

    /// About how many parts of at most unit length the footprint has.
    fn parts(&self, footprint: &[DVec3; 3]) -> f64 {
        let [a, b, c] = footprint.map(|p| self.at(p) * self.density);
        let area = 0.5 * (b - a).perp_dot(c - a).abs();
        let edge = (b - a).length().max((c - b).length()).max((a - c).length());
        4.0 * area + 2.0 * edge
    }

    /// Goes to finer parts, or to coarser levels, until the footprint has at most so many parts.
    /// Beyond the last level, of one texel, only the parts go on growing.
    fn settle(&mut self, footprint: &[DVec3; 3], most: f64) {
        let finer = if self.nearest { SHARP } else { SMOOTH };
        if self.parts(footprint) * finer * finer <= most {
            self.density *= finer;
        }
        while self.parts(footprint) > most {
            self.level += 1;
            self.density *= 0.5;
        }
        self.level = self.level.min(self.texture.levels() - 1);
    }
}

/// Mean over the footprint of `product`, which is given barycentric coordinates and the value of
/// each layer there.
fn average<const N: usize>(
    mut layers: [Layer; N],
    footprint: &[DVec3; 3],
    product: impl Fn(DVec3, [DVec3; N]) -> DVec3,
) -> DVec3 {
    let most = if N > 1 { PARTS_OF_PRODUCT } else { PARTS };
    for layer in &mut layers {
        if !layer.parts(footprint).is_finite() {
            // Coordinates so large that differences overflow hold no position in the image.
            layer.uv = [DVec2::ZERO; 3];
        }
        layer.settle(footprint, most);
    }
    let length_squared =
        |step: DVec3| layers.iter().map(|l| l.length_squared(step)).fold(0.0, f64::max);
    let mut sum = DVec3::ZERO;
    let mut parts = vec![(*footprint, 1.0)];
    while let Some(([a, b, c], share)) = parts.pop() {
        let edges = [length_squared(b - a), length_squared(c - b), length_squared(a - c)];
        let longest = edges[0].max(edges[1]).max(edges[2]);
        if longest > 1.0 && share > SMALLEST_SHARE {
            // Turn the corners so that the longest edge is the first.
            let [a, b, c] = match edges {
                [e, _, _] if e == longest => [a, b, c],
                [_, e, _] if e == longest => [b, c, a],
                _ => [c, a, b],
            };
            let middle = 0.5 * (a + b);
            parts.push(([middle, b, c], 0.5 * share));
            parts.push(([a, middle, c], 0.5 * share));
            continue;
        }
        let mut part = DVec3::ZERO;
        for corner in [a, b, c] {
            let point = 0.5 * corner + (a + b + c) / 6.0;
            part += product(point, std::array::from_fn(|i| layers[i].value(point)));
        }
        sum += part * (share / 3.0);
    }
    sum
}
