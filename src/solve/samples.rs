//! Points spread over a surface, at which errors are estimated.
//!
//! Errors gather along the rims of roots, where faces meet and light has singular derivatives: a
//! hundredth of the area may hold most of the mean square. So the points are drawn from bands: each
//! triangle is split by two smaller ones with the same centroid, and each band of all triangles
//! together gets its share of the points, weighed by its area.

use glam::{DVec2, DVec3};

use super::direct::surface_area;
use crate::geometry::triangle_area;
use crate::mesh::Mesh;

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Position, metres.
    pub point: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Share of the surface that it stands for.
    pub weight: f64,
    /// Whether it is beside an edge of its root.
    pub at_rim: bool,
}

/// Bands by the least barycentric weight of their points, and how many points each has.
const BANDS: [(f64, f64, usize); 3] =
    [(0.03, 1.0 / 3.0, 400), (0.004, 0.03, 250), (0.0, 0.004, 150)];

/// Steps of the additive sequence that fills a square most evenly (powers of the inverse of the
/// plastic number).
const STEPS: DVec2 = DVec2::new(0.754_877_666_246_692_7, 0.569_840_290_998_053_3);

/// Points of all bands; their weights sum to one (but for bands so narrow that they have no points).
pub fn samples(mesh: &Mesh) -> Vec<Sample> {
    let total = surface_area(mesh);
    let mut samples = vec![];
    for (band, (least, most, count)) in BANDS.into_iter().enumerate() {
        // Similar triangles: scales of their sides about the centroid.
        let (outer, inner) = (1.0 - 3.0 * least, 1.0 - 3.0 * most);
        let weight = (outer * outer - inner * inner) / count as f64;
        let (mut before, mut made) = (0.0, 0);
        for root in &mesh.roots {
            let t = &root.corners;
            let area = triangle_area(t);
            let after = before + area * count as f64 / total;
            let middle = (t[0] + t[1] + t[2]) / 3.0;
            let frame = &mesh.faces[root.face as usize].frame;
            while f64::from(made) + 0.5 < after {
                let s = (0.5 + f64::from(made) * STEPS.x).fract();
                let along = 3.0 * (0.5 + f64::from(made) * STEPS.y).fract();
                // Evenly by area: squares of scales, and the three sides alike.
                let scale = (inner * inner + s * (outer * outer - inner * inner)).sqrt();
                let side = along as usize % 3;
                let on_side = t[side].lerp(t[(side + 1) % 3], along.fract());
                let point = frame.lift(middle + scale * (on_side - middle));
                samples.push(Sample { point, normal: frame.n, weight, at_rim: band > 0 });
                made += 1;
            }
            before = after;
        }
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Basis, MeshOptions, Refinement, build};
    use crate::scene::{Material, Object, Scene, Triangle};

    #[test]
    fn weighted_sums_are_means_over_the_surface() {
        let corners = [
            [DVec3::ZERO, DVec3::X, DVec3::Y],
            [DVec3::new(1.0, 1.0, 0.0), DVec3::Y, DVec3::X],
            [DVec3::Z, DVec3::new(3.0, 0.0, 1.0), DVec3::new(0.0, 1.0, 1.0)],
        ];
        let triangle = |vertices| Triangle {
            vertices,
            uv: [[DVec2::ZERO; 3]; 2],
            colour: [DVec3::ONE; 3],
            material: 0,
            object: 0,
        };
        let scene = Scene {
            triangles: corners.map(triangle).to_vec(),
            materials: vec![Material::plain("m", DVec3::splat(0.5))],
            objects: vec![Object { name: "o".into() }],
            ..Scene::default()
        };
        let options = MeshOptions { basis: Basis::Linear, refinement: Refinement::Levels(0) };
        let mesh = build(&scene, &options).unwrap();
        let samples = samples(&mesh);
        let mean = |f: &dyn Fn(DVec3) -> f64| -> f64 {
            samples.iter().map(|s| s.weight * f(s.point)).sum()
        };
        // A unit square at z = 0 and a triangle of area 3/2 at z = 1.
        assert!((mean(&|_| 1.0) - 1.0).abs() < 0.02);
        assert!((mean(&|p| p.z) - 0.6).abs() < 0.02);
        assert!((mean(&|p| p.x * p.x) - (1.0 / 3.0 + 1.5 * 1.5) / 2.5).abs() < 0.03);
        // A strip of a thousandth along the square's rim.
        let strip = |p: DVec3| f64::from(u8::from(p.z == 0.0 && p.y < 1e-3));
        let share = mean(&strip) / 4e-4;
        assert!((0.5..2.0).contains(&share), "{share}");
    }
}
