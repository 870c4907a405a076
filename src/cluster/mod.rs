//! The cluster tree: quadtrees below each root, a spatial tree of faces above them.
//!
//! A *cluster* is a triangle of some level of a root's refinement, AC section 3: the elements of
//! the final mesh are the clusters of the deepest level. It lies in one plane. A(tau) and R(tau) are
//! the centre and radius of its smallest enclosing circle. Clusters of a root are numbered level by
//! level, so that the children of number k of a level are numbers 4k .. 4k + 3 of the next.
//!
//! Above the faces stands a binary tree of any orientation, with boxes and normal cones
//! ([`Branch`]): whole parts of a scene that face away from a point are passed over at once.

pub mod adaptive;
pub mod fit;
mod spatial;

use glam::DVec2;
use rayon::prelude::*;

use crate::geometry::circle::smallest_enclosing;
use crate::mesh::{Mesh, Root, child};

pub use spatial::{Branch, Content, SpatialTree};

/// All clusters of a mesh.
pub struct Clusters {
    /// Number of the first cluster of each root, and the number of clusters at the end.
    pub first: Vec<u32>,
    /// A(tau) of each cluster, in the plane of its face.
    pub centre: Vec<DVec2>,
    /// R of each root; a cluster `depth` levels below has R / 2^depth.
    pub root_radius: Vec<f64>,
    /// The tree above.
    pub faces: SpatialTree,
}

impl Clusters {
    /// Builds the tree of a mesh.
    pub fn build(mesh: &Mesh) -> Clusters {
        let of_root = |root: &Root| {
            let mut centre = Vec::with_capacity(Self::before(root.level + 1) as usize);
            let mut level = vec![root.corners];
            for depth in 0..=root.level {
                centre.extend(level.iter().map(|t| smallest_enclosing(t).0));
                if depth < root.level {
                    level = level.iter().flat_map(|t| (0..4).map(move |k| child(t, k))).collect();
                }
            }
            (centre, smallest_enclosing(&root.corners).1)
        };
        let roots: Vec<(Vec<DVec2>, f64)> = mesh.roots.par_iter().map(of_root).collect();
        let root_radius = roots.iter().map(|root| root.1).collect();
        let (mut first, mut centre) = (vec![0], vec![]);
        for (own, _) in roots {
            centre.extend(own);
            first.push(centre.len() as u32);
        }
        Clusters { first, centre, root_radius, faces: SpatialTree::build(mesh) }
    }

    /// Number of cluster `index` (counting along the quadtree's order) at `depth` below `root`.
    pub fn number(&self, root: usize, depth: u32, index: u32) -> u32 {
        self.first[root] + Self::before(depth) + index
    }

    /// How many clusters of a root lie above `depth`.
    pub fn before(depth: u32) -> u32 {
        ((1u64 << (2 * depth)) / 3) as u32
    }

    /// The root of a cluster.
    pub fn root_of(&self, cluster: u32) -> usize {
        self.first.partition_point(|&f| f <= cluster) - 1
    }

    /// How many clusters there are.
    pub fn len(&self) -> usize {
        self.centre.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.centre.is_empty()
    }
}

/// Admissibility of AC (3.3): R(tau) <= eta |P - A(tau)|.
///
/// `distance_squared` is |P - A(tau)|^2. The comparison leaves a slack of a few roundings: on
/// regular meshes equality is common, and means admissible.
pub fn admissible(radius: f64, eta: f64, distance_squared: f64) -> bool {
    radius * radius <= eta * eta * distance_squared * (1.0 + 1e-13)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Basis, MeshOptions, Refinement, build};
    use crate::scene::{Material, Object, Scene, Triangle};
    use glam::DVec3;

    #[test]
    fn numbering_centres_and_radii_agree_with_the_mesh() {
        let vertices = [DVec3::ZERO, DVec3::new(3.0, 0.2, 0.0), DVec3::new(0.5, 2.0, 1.0)];
        let triangle = Triangle {
            vertices,
            uv: [[DVec2::ZERO; 3]; 2],
            colour: [DVec3::ONE; 3],
            material: 0,
            object: 0,
        };
        let scene = Scene {
            triangles: vec![triangle.clone(), triangle],
            materials: vec![Material::plain("m", DVec3::splat(0.5))],
            objects: vec![Object { name: "o".into() }],
            ..Scene::default()
        };
        let refinement = Refinement::Levels(3);
        let mesh = build(&scene, &MeshOptions { basis: Basis::Constant, refinement }).unwrap();
        let clusters = Clusters::build(&mesh);
        assert_eq!(clusters.len(), 2 * (1 + 4 + 16 + 64));
        for (element, corners) in mesh.element_corners.iter().enumerate() {
            let root = mesh.element_root[element] as usize;
            let index = element as u32 - mesh.roots[root].first;
            for depth in 0..=3 {
                let number = clusters.number(root, depth, index >> (2 * (3 - depth)));
                assert_eq!(clusters.root_of(number), root);
                let radius = clusters.root_radius[root] / f64::from(1u32 << depth);
                let centre = clusters.centre[number as usize];
                assert!(corners.iter().all(|c| c.distance(centre) <= radius * (1.0 + 1e-12)));
            }
        }
    }
}
