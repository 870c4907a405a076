//! A binary tree over faces, with boxes and normal cones.

use glam::DVec3;

use crate::geometry::Bounds;
use crate::mesh::Mesh;

/// What a branch holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Two branches, by number.
    Branches(u32, u32),
    /// Faces, a range of [`SpatialTree::order`].
    Faces(u32, u32),
}

/// A node of the tree.
#[derive(Clone, Copy, Debug)]
pub struct Branch {
    /// Box of the faces below.
    pub bounds: Bounds,
    /// Axis of the cone that holds all their normals.
    pub axis: DVec3,
    /// Sine of half the cone's opening; at least 1 when the cone holds no plane's worth.
    pub spread: f64,
    /// What lies below.
    pub content: Content,
}

/// Tree over the faces of a mesh; branch 0 is the root.
pub struct SpatialTree {
    /// Branches, parents before children; empty for an empty mesh.
    pub branches: Vec<Branch>,
    /// Faces in the order of the tree.
    pub order: Vec<u32>,
}

/// Faces a leaf.
const LEAF: usize = 4;

impl SpatialTree {
    /// Builds the tree by halving the longest axis of the faces' centres at the median.
    pub fn build(mesh: &Mesh) -> SpatialTree {
        let bounds: Vec<Bounds> = mesh
            .faces
            .iter()
            .map(|f| f.corners.iter().fold(Bounds::EMPTY, |b, &c| b.with(f.frame.lift(c))))
            .collect();
        let mut tree =
            SpatialTree { branches: vec![], order: (0..mesh.faces.len() as u32).collect() };
        if !mesh.faces.is_empty() {
            tree.split(mesh, &bounds, 0, mesh.faces.len());
        }
        tree
    }

    fn split(&mut self, mesh: &Mesh, bounds: &[Bounds], begin: usize, end: usize) -> u32 {
        let faces = &mut self.order[begin..end];
        let all = faces.iter().fold(Bounds::EMPTY, |b, &f| b.union(bounds[f as usize]));
        let normal = |f: u32| mesh.faces[f as usize].frame.n;
        let mean: DVec3 = faces.iter().map(|&f| normal(f)).sum();
        let axis = mean.try_normalize().unwrap_or(DVec3::Z);
        let least = faces.iter().map(|&f| normal(f).dot(axis)).fold(1.0, f64::min);
        // A cone of more than a half space bounds nothing.
        let spread = if least > 0.0 { (1.0 - least * least).max(0.0).sqrt() } else { 2.0 };
        let number = self.branches.len() as u32;
        let content = Content::Faces(begin as u32, end as u32);
        let branch = Branch { bounds: all, axis, spread, content };
        self.branches.push(branch);
        if end - begin > LEAF {
            let centres =
                faces.iter().fold(Bounds::EMPTY, |b, &f| b.with(bounds[f as usize].centre()));
            let size = centres.max - centres.min;
            let k = if size.x >= size.y && size.x >= size.z {
                0
            } else if size.y >= size.z {
                1
            } else {
                2
            };
            faces.sort_unstable_by(|&a, &b| {
                let key = |f: u32| bounds[f as usize].centre()[k];
                key(a).total_cmp(&key(b)).then(a.cmp(&b))
            });
            let middle = (begin + end) / 2;
            let left = self.split(mesh, bounds, begin, middle);
            let right = self.split(mesh, bounds, middle, end);
            self.branches[number as usize].content = Content::Branches(left, right);
        }
        number
    }

    /// Calls `found` with every face that is not certainly turned away from `point`, or below its
    /// horizon, in ascending order.
    pub fn facing(
        &self,
        point: DVec3,
        normal: DVec3,
        tolerance: f64,
        found: &mut Vec<u32>,
        stack: &mut Vec<u32>,
    ) {
        found.clear();
        stack.clear();
        if !self.branches.is_empty() {
            stack.push(0);
        }
        while let Some(number) = stack.pop() {
            let branch = &self.branches[number as usize];
            if branch.bounds.support(normal) - normal.dot(point) <= tolerance
                || turned_away(branch, point)
            {
                continue;
            }
            match branch.content {
                Content::Branches(left, right) => stack.extend([right, left]),
                Content::Faces(begin, end) => {
                    found.extend(&self.order[begin as usize..end as usize]);
                }
            }
        }
        found.sort_unstable();
    }
}

/// Whether no face of a branch can have `point` in front of it.
///
/// With the box in a ball of radius r about its centre c and all normals within an angle phi of
/// the axis: n.(P - x) <= |P - c| cos(angle to the axis - phi) + r < 0 for all of them, where the
/// angle to the axis is beyond 90 degrees plus phi.
fn turned_away(branch: &Branch, point: DVec3) -> bool {
    if branch.spread > 1.0 {
        return false;
    }
    let to = point - branch.bounds.centre();
    let r = 0.5 * (branch.bounds.max - branch.bounds.min).length();
    let along = to.dot(branch.axis);
    let across = (to.length_squared() - along * along).max(0.0).sqrt();
    let cosine = (1.0 - branch.spread * branch.spread).max(0.0).sqrt();
    // Largest n.to over the cone: rotate the axis towards `to` by phi, unless `to` is inside.
    let largest = along * cosine + across * branch.spread;
    along < 0.0 && largest < -r * (1.0 + 1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cones_only_reject_what_is_turned_away() {
        let mut state = 1u64;
        let mut unit = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
        };
        let mut rejected = 0;
        for _ in 0..20_000 {
            let axis = DVec3::new(unit(), unit(), unit()).normalize();
            let spread = unit().abs() * 0.99;
            let bounds = Bounds::of(&[
                DVec3::new(unit(), unit(), unit()),
                DVec3::new(unit(), unit(), unit()),
            ]);
            let branch = Branch { bounds, axis, spread, content: Content::Faces(0, 0) };
            let point = 4.0 * DVec3::new(unit(), unit(), unit());
            if !turned_away(&branch, point) {
                continue;
            }
            rejected += 1;
            for _ in 0..20 {
                let side = DVec3::new(unit(), unit(), unit()).cross(axis).normalize();
                let phi = spread.asin() * unit();
                let n = phi.cos() * axis + phi.sin() * side;
                let t = DVec3::new(unit(), unit(), unit()) * 0.5 + 0.5;
                let x = bounds.min + t * (bounds.max - bounds.min);
                assert!(n.dot(point - x) <= 0.0);
            }
        }
        assert!(rejected > 2000, "{rejected}");
    }
}
