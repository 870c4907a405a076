//! Finding the surface: along a ray, or at a point.

use std::cell::Cell;

use glam::{DVec2, DVec3};

use crate::geometry::{Bounds, BoxTree, ray};
use crate::mesh::{Mesh, barycentric};
use crate::scene::Scene;

/// Triangles and faces in a tree.
pub struct Surface<'a> {
    scene: &'a Scene,
    mesh: &'a Mesh,
    tree: BoxTree,
    /// Front and back face of each triangle, where it radiates.
    sides: Vec<[Option<u32>; 2]>,
}

/// Where a ray meets the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    /// Distance in units of the ray's direction.
    pub t: f64,
    /// The triangle.
    pub triangle: u32,
    /// The face whose side was met; `None` for a side that does not radiate.
    pub face: Option<u32>,
}

/// A point on a radiating face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// The face.
    pub face: u32,
    /// The point in the face's plane.
    pub x: DVec2,
    /// Signed distance of the point asked for from the plane, metres.
    pub height: f64,
}

impl<'a> Surface<'a> {
    /// Prepares a meshed scene.
    pub fn new(scene: &'a Scene, mesh: &'a Mesh) -> Surface<'a> {
        let boxes: Vec<Bounds> = scene.triangles.iter().map(|t| Bounds::of(&t.vertices)).collect();
        let sides = mesh.sides(scene.triangles.len());
        Surface { scene, mesh, tree: BoxTree::build(&boxes), sides }
    }

    /// The nearest thing that a ray meets.
    ///
    /// Of coincident faces (distances equal but for roundings) a side that radiates towards the
    /// ray is taken before one that does not, then the lower triangle number.
    pub fn cast(&self, origin: DVec3, direction: DVec3) -> Option<Met> {
        let mut best: Option<Met> = None;
        self.tree.cast(origin, direction, f64::INFINITY, |index, end| {
            let vertices = &self.scene.triangles[index].vertices;
            let Some(hit) = ray::intersect(origin, direction, vertices) else { return end };
            if hit.t <= 0.0 {
                return end;
            }
            let normal = (vertices[1] - vertices[0]).cross(vertices[2] - vertices[0]);
            let side = usize::from(direction.dot(normal) > 0.0);
            let met = Met { t: hit.t, triangle: index as u32, face: self.sides[index][side] };
            let wins = best.is_none_or(|b| {
                // Roundings of t, in units of t.
                const SAME: f64 = 1e-12;
                if (met.t - b.t).abs() <= SAME * b.t {
                    (met.face.is_none(), met.triangle) < (b.face.is_none(), b.triangle)
                } else {
                    met.t < b.t
                }
            });
            if wins {
                best = Some(met);
            }
            // A little beyond the best, so that its coincident twins are seen too.
            best.map_or(end, |b| b.t * (1.0 + 1e-11))
        });
        best
    }

    /// The radiating face at a point, within `tolerance` (metres) of it and facing `normal`'s way.
    ///
    /// Of several, the one that faces it best, then the nearest, then the first.
    pub fn at(&self, point: DVec3, normal: DVec3, tolerance: f64) -> Option<Foot> {
        let near = Bounds { min: point, max: point }.grown(tolerance);
        let mut candidates = vec![];
        self.tree.visit(|b| b.meets(near), |i| candidates.push(i));
        candidates.sort_unstable();
        let mut best: Option<(f64, f64, Foot)> = None;
        for face in candidates.iter().flat_map(|&i| self.sides[i]).flatten() {
            let f = &self.mesh.faces[face as usize];
            let facing = f.frame.n.dot(normal);
            let (x, height) = (f.frame.project(point), f.frame.height(point));
            let distance = distance_to(&f.corners, x).hypot(height);
            if facing <= 0.0 || distance > tolerance {
                continue;
            }
            // Facing is compared coarsely: coplanar neighbours differ in it by roundings.
            let rank = ((1e6 * facing).round(), -distance);
            if best.is_none_or(|(a, b, _)| rank > (a, b)) {
                best = Some((rank.0, rank.1, Foot { face, x, height }));
            }
        }
        best.map(|(_, _, foot)| foot)
    }

    /// Whether a radiating face, not of triangle `but`, lies on a point within `tolerance` (metres)
    /// and faces against `normal`.
    pub fn is_faced(&self, point: DVec3, normal: DVec3, tolerance: f64, but: u32) -> bool {
        // Faces that touch are parallel but for their roundings over their size.
        const AGAINST: f64 = -0.999;
        let near = Bounds { min: point, max: point }.grown(tolerance);
        let found = Cell::new(false);
        self.tree.visit(
            |b| !found.get() && b.meets(near),
            |i| {
                let covers = i as u32 != but
                    && self.sides[i].into_iter().flatten().any(|face| {
                        let f = &self.mesh.faces[face as usize];
                        let (x, height) = (f.frame.project(point), f.frame.height(point));
                        f.frame.n.dot(normal) < AGAINST
                            && distance_to(&f.corners, x).hypot(height) <= tolerance
                    });
                found.set(found.get() || covers);
            },
        );
        found.get()
    }
}

/// Distance in the plane from a point to a triangle, 0 inside.
fn distance_to(t: &[DVec2; 3], x: DVec2) -> f64 {
    if barycentric(t, x).min_element() >= 0.0 {
        return 0.0;
    }
    let segment = |p: DVec2, q: DVec2| {
        let along = q - p;
        let s = ((x - p).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        x.distance(p + s * along)
    };
    segment(t[0], t[1]).min(segment(t[1], t[2])).min(segment(t[2], t[0]))
}
