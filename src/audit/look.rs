//! What rays from a point meet: a count for each part of the scene, by the side that was met.

use glam::DVec3;
use rayon::prelude::*;

use super::parts::Parts;
use super::points::Point;
use crate::error::Result;
use crate::geometry::{Bounds, COINCIDENCE, Frame, RayHit, RayTree};
use crate::monitor::Monitor;
use crate::operator::hemisphere::{direction, flips};
use crate::scene::Scene;

/// What is met within this share of the size of a point's own part is near: a wall behind a picture,
/// a ceiling above a lamp. Seen from the middle of a side so near a surface fills all but a hundredth
/// of the hemisphere, and what is beyond it can hardly be seen.
pub(super) const NEAR: f64 = 0.05;

/// Reflections of a path that looks for light.
const BOUNCES: usize = 8;

/// Most faces that are passed in looking for one on the other side of a plate: more do not lie on
/// each other in files that people make.
const MOST_TWINS: usize = 8;

/// Rays of one point that met the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Met {
    pub part: u32,
    /// Whether it was a side that does not radiate.
    pub black: bool,
    /// Whether it was nearer than [`NEAR`].
    pub near: bool,
    /// Whether the triangle reflects anything.
    pub reflects: bool,
    /// How many rays.
    pub count: u32,
}

/// What the rays of a point met.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Look {
    /// By its side.
    pub front: Vec<Met>,
    /// Numbers of the rays that met nothing.
    pub escaped: Vec<u32>,
    /// From the back of a one-sided triangle, unless another face lies on it there.
    pub behind: Option<Vec<Met>>,
    /// A triangle of another part that faces this one within the contact distance, and how far it is
    /// away, metres.
    pub gap: Option<(u32, f64)>,
}

impl Look {
    /// Rays that met what is `wanted`.
    pub(super) fn count(&self, wanted: impl Fn(&Met) -> bool) -> u32 {
        self.front.iter().filter(|m| wanted(m)).map(|m| m.count).sum()
    }
}

/// Casts rays.
pub(super) struct Looker<'a> {
    scene: &'a Scene,
    parts: &'a Parts,
    reflects: &'a [bool],
    tree: RayTree,
    /// Rays begin so far above their surface: roundings of a point, metres.
    lift: f64,
    /// Faces within this distance touch, metres.
    contact: f64,
}

impl<'a> Looker<'a> {
    /// Prepares a scene; `reflects` tells which triangles reflect anything.
    pub(super) fn new(scene: &'a Scene, parts: &'a Parts, reflects: &'a [bool]) -> Looker<'a> {
        let triangles: Vec<[DVec3; 3]> = scene.triangles.iter().map(|t| t.vertices).collect();
        let bounds = triangles.iter().fold(Bounds::EMPTY, |b, t| b.union(Bounds::of(t)));
        let magnitude = bounds.magnitude();
        let tree = RayTree::build(&triangles, |i, back| !back || is_two_sided(scene, i as u32));
        let (lift, contact) = (COINCIDENCE * magnitude, scene.contact_distance());
        Looker { scene, parts, reflects, tree, lift, contact }
    }

    /// What `rays` rays from each point meet.
    pub(super) fn look(&self, points: &[Point], rays: u32, monitor: &Monitor) -> Result<Vec<Look>> {
        let stage = monitor.stage("audit", points.len() as u64);
        points
            .par_iter()
            .map_init(Vec::new, |stack, point| {
                stage.advance(1)?;
                Ok(self.look_from(point, rays, stack))
            })
            .collect()
    }

    fn look_from(&self, point: &Point, rays: u32, stack: &mut Vec<(u32, f32)>) -> Look {
        let mut look = Look::default();
        look.front = self.cast(point, point.normal, rays, stack, |k, towards, hit| {
            let Some(hit) = hit else { return look.escaped.push(k) };
            let other = self.parts.of[hit.triangle as usize] != point.part;
            // At most twice as far as it is high, so that it is no wall beside the point.
            if other && !self.is_black(hit) && hit.t <= 2.0 * self.contact {
                let height = hit.t * towards.dot(point.normal);
                if look.gap.is_none_or(|(_, least)| height < least) {
                    look.gap = Some((hit.triangle, height));
                }
            }
        });
        if !is_two_sided(self.scene, point.triangle) && !self.has_twin(point, stack) {
            look.behind = Some(self.cast(point, -point.normal, rays, stack, |_, _, _| {}));
        }
        look
    }

    /// Casts rays from a point about a unit normal, calls `each` with the number and the direction of
    /// a ray and what it hit, and counts what was met.
    fn cast(
        &self,
        point: &Point,
        normal: DVec3,
        rays: u32,
        stack: &mut Vec<(u32, f32)>,
        mut each: impl FnMut(u32, DVec3, Option<RayHit>),
    ) -> Vec<Met> {
        let frame = Frame::new(point.position, normal);
        let (origin, flips) = (point.position + self.lift * normal, flips(point.position));
        let near = NEAR * self.parts.extents[point.part as usize];
        let mut met: Vec<Met> = vec![];
        for k in 0..rays {
            let towards = direction(&frame, k, flips);
            let hit = self.tree.nearest(origin, towards, 0.0, stack);
            each(k, towards, hit);
            met.extend(hit.map(|hit| Met {
                part: self.parts.of[hit.triangle as usize],
                black: self.is_black(hit),
                near: hit.t < near,
                reflects: self.reflects[hit.triangle as usize],
                count: 1,
            }));
        }
        met.sort_unstable();
        let same = met.chunk_by(|a, b| a == b);
        same.map(|same| Met { count: same.len() as u32, ..same[0] }).collect()
    }

    /// Whether path number `k` from a point, by its side or its back, comes within [`BOUNCES`]
    /// reflections to a triangle of another part that is `bright`; without any, out of the scene.
    pub(super) fn comes_to_light(
        &self,
        point: &Point,
        behind: bool,
        k: u32,
        bright: Option<&[bool]>,
        stack: &mut Vec<(u32, f32)>,
    ) -> bool {
        let mut position = point.position;
        let mut normal = if behind { -point.normal } else { point.normal };
        for _ in 0..BOUNCES {
            let origin = position + self.lift * normal;
            let towards = direction(&Frame::new(position, normal), k, flips(position));
            let Some(hit) = self.tree.nearest(origin, towards, 0.0, stack) else {
                return bright.is_none();
            };
            let triangle = hit.triangle as usize;
            if self.is_black(hit) {
                return false;
            }
            let other = self.parts.of[triangle] != point.part;
            if other && bright.is_some_and(|bright| bright[triangle]) {
                return true;
            }
            let plane = Frame::of_triangle(&self.scene.triangles[triangle].vertices);
            let Some(plane) = plane.filter(|_| self.reflects[triangle]) else { return false };
            position = origin + hit.t * towards;
            normal = if hit.back { -plane.n } else { plane.n };
        }
        false
    }

    fn is_black(&self, hit: RayHit) -> bool {
        hit.back && !is_two_sided(self.scene, hit.triangle)
    }

    /// Whether another face lies on the back of a point's face and is seen from there instead: the
    /// other side of a plate that is made of two sheets.
    fn has_twin(&self, point: &Point, stack: &mut Vec<(u32, f32)>) -> bool {
        // Along the normal, from a little behind the face to a little before it.
        let origin = point.position - 2.0 * self.contact * point.normal;
        let mut beyond = self.contact;
        for _ in 0..MOST_TWINS {
            let hit = self.tree.nearest(origin, point.normal, beyond, stack);
            let Some(hit) = hit.filter(|hit| hit.t <= 3.0 * self.contact) else { return false };
            if hit.triangle != point.triangle && !self.is_black(hit) {
                return true;
            }
            beyond = hit.t;
        }
        false
    }
}

fn is_two_sided(scene: &Scene, triangle: u32) -> bool {
    scene.materials[scene.triangles[triangle as usize].material as usize].two_sided
}

/// Direction number `k` of those in which rays went from a point.
pub(super) fn direction_of(point: &Point, k: u32) -> DVec3 {
    direction(&Frame::new(point.position, point.normal), k, flips(point.position))
}
