//! The second set of texture coordinates that a file brings (TEXCOORD_1): can it hold a lightmap?
//!
//! It can when every triangle of an object has a place of its own: all corners in the unit square,
//! no triangle without area, no two that overlap by more than roundings. A file without a second set
//! has zeros there, and so no areas.

use glam::DVec2;
use rayon::prelude::*;

use super::overlap::overlapping;
use crate::geometry::polygon::twice_area;
use crate::scene::Scene;

/// Coordinates may leave the unit square by this much: roundings of f32 and of 16-bit integers.
const OUTSIDE: f64 = 1e-5;

/// Triangles overlap when their common part is wider than this, in units of the unit square: a
/// hundredth of a texel of a page of 4096. Narrower ones are roundings along common edges.
const OVERLAP: f64 = 2.5e-6;

/// Least height of a triangle over its longest edge, in units of the unit square: one of 64 bits has
/// no digits left below, and its texels could not be told from its neighbours'.
const FLAT: f64 = 1e-9;

/// What an object's second set of texture coordinates is like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SecondSet {
    /// Index into [`Scene::objects`].
    pub object: u32,
    /// Triangles of the object.
    pub triangles: usize,
    /// Triangles all of whose coordinates are zero: the file has none for them.
    pub missing: usize,
    /// Others without area.
    pub flat: usize,
    /// Triangles with a corner outside of the unit square.
    pub outside: usize,
    /// Triangles that overlap others of the object.
    pub overlapping: usize,
}

impl SecondSet {
    /// Whether it can hold a lightmap.
    pub fn is_valid(&self) -> bool {
        self.triangles > 0 && self.missing + self.flat + self.outside + self.overlapping == 0
    }
}

/// The second sets of all objects.
pub fn second_sets(scene: &Scene) -> Vec<SecondSet> {
    let mut members = vec![vec![]; scene.objects.len()];
    for (i, triangle) in scene.triangles.iter().enumerate() {
        if let Some(own) = members.get_mut(triangle.object as usize) {
            own.push(i as u32);
        }
    }
    members
        .into_par_iter()
        .enumerate()
        .map(|(object, members)| SecondSet { object: object as u32, ..look(scene, &members) })
        .collect()
}

/// What the second set is like, for some triangles.
pub(super) fn look(scene: &Scene, triangles: &[u32]) -> SecondSet {
    let uv = |i: u32| scene.triangles[i as usize].uv[1];
    let mut found = SecondSet { triangles: triangles.len(), ..SecondSet::default() };
    let mut proper = vec![];
    for &i in triangles {
        let corners = uv(i);
        let is_inside = |x: &DVec2| x.min_element() >= -OUTSIDE && x.max_element() <= 1.0 + OUTSIDE;
        if corners == [DVec2::ZERO; 3] {
            found.missing += 1;
        } else if !corners.iter().all(is_inside) {
            found.outside += 1;
        } else if is_flat(&corners) {
            found.flat += 1;
        } else {
            proper.push(corners);
        }
    }
    found.overlapping = overlapping(&proper, OVERLAP);
    found
}

fn is_flat(t: &[DVec2; 3]) -> bool {
    let longest = t[0].distance(t[1]).max(t[1].distance(t[2])).max(t[2].distance(t[0]));
    twice_area(t).abs() <= FLAT * longest
}
