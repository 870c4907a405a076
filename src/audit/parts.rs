//! Connected parts of objects: triangles of one object that share corners.
//!
//! Files often have one object for many things, and then only their parts can be told apart.

use std::collections::HashMap;

use crate::geometry::Bounds;
use crate::scene::{Scene, corner_numbers};

/// Parts, numbered in the order of their first triangles.
pub(super) struct Parts {
    /// Part of each triangle.
    pub of: Vec<u32>,
    /// Object of each part.
    pub objects: Vec<u32>,
    /// Longest side of the box of each part, metres.
    pub extents: Vec<f64>,
}

impl Parts {
    /// Finds all parts of a scene.
    pub(super) fn find(scene: &Scene) -> Parts {
        let triangles = &scene.triangles;
        let mut parents: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut first = HashMap::new();
        for (i, (triangle, corners)) in triangles.iter().zip(corner_numbers(triangles)).enumerate()
        {
            for corner in corners {
                let other = *first.entry((triangle.object, corner)).or_insert(i as u32);
                let (a, b) = (root(&mut parents, i as u32), root(&mut parents, other));
                // The lower number stays, so that a root is its part's first triangle.
                parents[a.max(b) as usize] = a.min(b);
            }
        }
        let mut parts = Parts { of: vec![], objects: vec![], extents: vec![] };
        let mut boxes: Vec<Bounds> = vec![];
        for (i, triangle) in triangles.iter().enumerate() {
            let root = root(&mut parents, i as u32) as usize;
            let own = Bounds::of(&triangle.vertices);
            let part = if root == i {
                parts.objects.push(triangle.object);
                boxes.push(own);
                parts.objects.len() as u32 - 1
            } else {
                parts.of[root]
            };
            boxes[part as usize] = boxes[part as usize].union(own);
            parts.of.push(part);
        }
        parts.extents = boxes.iter().map(|b| b.extent()).collect();
        parts
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.objects.len()
    }

    /// The parts of each of so many objects.
    pub(super) fn of_objects(&self, objects: usize) -> Vec<Vec<usize>> {
        let mut members = vec![vec![]; objects];
        for (part, &object) in self.objects.iter().enumerate() {
            if let Some(own) = members.get_mut(object as usize) {
                own.push(part);
            }
        }
        members
    }
}

/// The root of an entry; paths are halved on the way.
fn root(parents: &mut [u32], mut i: u32) -> u32 {
    while parents[i as usize] != i {
        parents[i as usize] = parents[parents[i as usize] as usize];
        i = parents[i as usize];
    }
    i
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Object, Triangle};
    use glam::{DVec2, DVec3};

    #[test]
    fn common_corners_connect_within_an_object() {
        let strip = |x: f64, object| {
            let p = |i: usize| DVec3::new(x + (i / 2) as f64, (i % 2) as f64, 0.0);
            // From its ends inwards.
            [0, 3, 1, 2].map(|k| Triangle {
                vertices: [p(k), p(k + 1), p(k + 2)],
                uv: [[DVec2::ZERO; 3]; 2],
                colour: [DVec3::ONE; 3],
                material: 0,
                object,
            })
        };
        // The second and the third strip share an edge, but are different objects.
        let triangles = [strip(10.0, 0), strip(0.0, 0), strip(2.0, 1)].concat();
        let objects = vec![Object { name: "a".into() }, Object { name: "b".into() }];
        let parts = Parts::find(&Scene { triangles, objects, ..Scene::default() });
        assert_eq!(parts.of, [0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2]);
        assert_eq!((parts.len(), &parts.objects[..]), (3, &[0, 0, 1][..]));
        assert_eq!(parts.extents, [2.0; 3]);
    }
}
