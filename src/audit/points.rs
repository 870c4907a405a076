//! Points spread over all sides that radiate, evenly by area within each part.

use glam::{DVec2, DVec3};

use super::parts::Parts;
use crate::geometry::Frame;
use crate::scene::Scene;

/// Points of all parts together, if each had a share of them by its area.
const POINTS: usize = 1024;

/// Points that each part has at least, and each part that emits.
const LEAST: usize = 4;
const LEAST_THAT_EMIT: usize = 16;

/// With more parts than this only objects are sure to have a point each; with more objects than this
/// nothing is, and the smallest go without.
const MOST_GROUPS: usize = 4096;

/// Rays of all points together.
const RAYS: usize = 1 << 20;

/// Rays from each point: a power of two in this range.
const LEAST_RAYS: usize = 64;
const MOST_RAYS: usize = 1024;

/// Steps of the additive sequence that fills a square most evenly (powers of the inverse of the
/// plastic number).
const STEPS: DVec2 = DVec2::new(0.754_877_666_246_692_7, 0.569_840_290_998_053_3);

/// A point of a side that radiates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    pub triangle: u32,
    /// Whether it is on the back of a two-sided triangle.
    pub back: bool,
    pub part: u32,
    /// Metres.
    pub position: DVec3,
    /// Unit normal of the side.
    pub normal: DVec3,
    /// Area of the sides that it stands for, square metres.
    pub area: f64,
}

/// A side that radiates.
struct Side {
    /// Group and whether it emits: points are spread over the sides that agree in both.
    stratum: (u32, bool),
    triangle: u32,
    back: bool,
    /// Unit normal.
    normal: DVec3,
    area: f64,
}

/// Rays from each of so many points.
pub(super) fn rays_from_each(points: usize) -> u32 {
    let each = (RAYS / points.max(1)).clamp(LEAST_RAYS, MOST_RAYS);
    1 << each.ilog2()
}

/// Spreads points over a scene; `exitance` tells which triangles emit.
pub(super) fn spread(scene: &Scene, parts: &Parts, exitance: &[f64]) -> Vec<Point> {
    let by_part = parts.len() <= MOST_GROUPS;
    let by_object = scene.objects.len() <= MOST_GROUPS;
    let sides = sides(scene, |i| {
        let group = if by_part {
            parts.of[i]
        } else if by_object {
            scene.triangles[i].object
        } else {
            0
        };
        Some((group, exitance[i] > 0.0))
    });
    let total: f64 = sides.iter().map(|side| side.area).sum();
    let mut points = vec![];
    for group in sides.chunk_by(|a, b| a.stratum == b.stratum) {
        let area: f64 = group.iter().map(|side| side.area).sum();
        let least = if group[0].stratum.1 { LEAST_THAT_EMIT } else { LEAST };
        let count = ((POINTS as f64 * area / total) as usize).max(least);
        fill(scene, parts, group, count, &mut points);
    }
    points
}

/// `count` points on the sides of each part that is `wanted`, or on its one-sided triangles alone; in
/// the order of parts.
pub(super) fn on_parts(
    scene: &Scene,
    parts: &Parts,
    wanted: &[bool],
    one_sided: bool,
    count: usize,
) -> Vec<Point> {
    let sides = sides(scene, |i| {
        let two_sided = scene.materials[scene.triangles[i].material as usize].two_sided;
        let part = parts.of[i];
        (wanted[part as usize] && !(one_sided && two_sided)).then_some((part, false))
    });
    let mut points = vec![];
    for group in sides.chunk_by(|a, b| a.stratum == b.stratum) {
        fill(scene, parts, group, count, &mut points);
    }
    points
}

/// Sides of the triangles that have a stratum, by strata.
fn sides(scene: &Scene, stratum: impl Fn(usize) -> Option<(u32, bool)>) -> Vec<Side> {
    let mut sides = vec![];
    for (i, triangle) in scene.triangles.iter().enumerate() {
        let Some(stratum) = stratum(i) else { continue };
        // The reader drops triangles without area.
        let Some(frame) = Frame::of_triangle(&triangle.vertices) else { continue };
        let (_, area) = triangle.normal_and_area();
        let two_sided = scene.materials[triangle.material as usize].two_sided;
        for back in [false, true].into_iter().take(1 + usize::from(two_sided)) {
            let normal = if back { -frame.n } else { frame.n };
            sides.push(Side { stratum, triangle: i as u32, back, normal, area });
        }
    }
    sides.sort_by_key(|side| (side.stratum, side.triangle, side.back));
    sides
}

/// Adds `count` points, evenly by the area of some sides.
fn fill(scene: &Scene, parts: &Parts, sides: &[Side], count: usize, points: &mut Vec<Point>) {
    let area: f64 = sides.iter().map(|side| side.area).sum();
    let (mut before, mut made) = (0.0, 0);
    for (k, side) in sides.iter().enumerate() {
        let after = if k + 1 == sides.len() { f64::INFINITY } else { before + side.area };
        while made < count && (made as f64 + 0.5) / count as f64 * area < after {
            points.push(point(scene, parts, side, points.len(), area / count as f64));
            made += 1;
        }
        before = after;
    }
}

/// Point `number` of all, on a side.
fn point(scene: &Scene, parts: &Parts, side: &Side, number: usize, area: f64) -> Point {
    let [a, b, c] = scene.triangles[side.triangle as usize].vertices;
    let x = (DVec2::splat(0.5) + (number + 1) as f64 * STEPS).fract();
    // Evenly by area: the square is mapped to the triangle.
    let root = x.x.sqrt();
    let position = a + root * (1.0 - x.y) * (b - a) + root * x.y * (c - a);
    Point {
        triangle: side.triangle,
        back: side.back,
        part: parts.of[side.triangle as usize],
        position,
        normal: side.normal,
        area,
    }
}

/// Objects with triangles on which no point lies.
pub(super) fn objects_without(scene: &Scene, points: &[Point]) -> usize {
    // Objects that have triangles, less those that have points.
    let mut without = vec![false; scene.objects.len()];
    let mut mark = |object: u32, value| {
        if let Some(own) = without.get_mut(object as usize) {
            *own = value;
        }
    };
    scene.triangles.iter().for_each(|t| mark(t.object, true));
    points.iter().for_each(|p| mark(scene.triangles[p.triangle as usize].object, false));
    without.into_iter().filter(|&yes| yes).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Material, Object, Triangle};

    #[test]
    fn every_part_has_its_share() {
        let triangle = |size: f64, at: f64, material| Triangle {
            vertices: [DVec3::ZERO, size * DVec3::X, size * DVec3::Y].map(|p| p + at * DVec3::Z),
            uv: [[DVec2::ZERO; 3]; 2],
            colour: [DVec3::ONE; 3],
            material,
            object: 0,
        };
        let two_sided = Material { two_sided: true, ..Material::plain("m", DVec3::ONE) };
        let scene = Scene {
            triangles: vec![triangle(1.0, 0.0, 0), triangle(1e-3, 1.0, 0), triangle(1.0, 2.0, 1)],
            materials: vec![Material::plain("m", DVec3::ONE), two_sided],
            objects: vec![Object { name: "o".into() }],
            ..Scene::default()
        };
        let points = spread(&scene, &Parts::find(&scene), &[0.0, 1.0, 0.0]);
        let count = |part, back| points.iter().filter(|p| (p.part, p.back) == (part, back)).count();
        assert_eq!([count(0, false), count(2, false), count(2, true)], [341; 3]);
        assert_eq!(count(1, false), LEAST_THAT_EMIT);
        let sum: f64 = points.iter().map(|p| p.area).sum();
        assert!((sum - 1.5 - 5e-7).abs() < 1e-12);
        // Means over a triangle.
        let own: Vec<_> = points.iter().filter(|p| p.part == 0).collect();
        let mean = own.iter().map(|p| p.position).sum::<DVec3>() / own.len() as f64;
        assert!((mean - DVec3::new(1.0, 1.0, 0.0) / 3.0).length() < 5e-3, "{mean}");
        assert!(points.iter().all(|p| p.normal == if p.back { -DVec3::Z } else { DVec3::Z }));
        assert_eq!(objects_without(&scene, &points), 0);
        assert_eq!(
            (rays_from_each(3), rays_from_each(3000), rays_from_each(90_000)),
            (1024, 256, 64)
        );
    }
}
