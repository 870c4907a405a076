//! Texels around charts, which filtering takes in.
//!
//! Where a flat or smooth surface goes on beyond the edge of a chart (in another chart or in another
//! object) the texels beside the edge get the light of what goes on, so that both sides of the seam
//! show the same. All other texels continue what is beside them, ring by ring, until the page is
//! full: no filter and no smaller version of the page takes in black.

use std::collections::HashMap;

use glam::{DVec2, DVec3, Vec3};

use super::atlas::Atlas;
use super::charts::CREASE;
use crate::mesh::barycentric;
use crate::reconstruct::Surface;
use crate::reconstruct::fill::RootPoints;
use crate::scene::Scene;
use crate::solve::Light;

/// Bilinear filtering takes in texels whose centres are at most this far from the edge (texels), and
/// across a corner.
const REACH: f64 = 1.5;

/// Places on the surface whose light goes into texels that no surface covers.
pub(super) struct Continued {
    /// Points by root.
    pub asked: Vec<RootPoints>,
    /// Of each point its texel.
    pub texels: Vec<Vec<u32>>,
}

/// Finds what goes on beyond the edges of the triangles of a page.
pub(super) fn continued(
    scene: &Scene,
    light: &Light,
    surface: &Surface,
    atlas: &Atlas,
    page: u32,
    covered: &[f32],
    buried: &[bool],
) -> Continued {
    let size = atlas.pages[page as usize];
    let texels = DVec2::new(f64::from(size.width), f64::from(size.height));
    let touching = light.mesh.contact;
    let mates = mates(scene);
    // Of each texel the nearest place that was found, and how far the edge is.
    let mut best: HashMap<u32, (f64, u32, DVec2)> = HashMap::new();
    for (i, _) in atlas.page.iter().enumerate().filter(|(_, p)| **p == Some(page)) {
        let vertices = &scene.triangles[i].vertices;
        let uv = atlas.uv[i].map(|x| x * texels);
        let n = scene.triangle_normal_and_area(i).0;
        if n == DVec3::ZERO {
            continue;
        }
        let turn = (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]).signum();
        for k in 0..3 {
            let (from, to) = (uv[k], uv[(k + 1) % 3]);
            let Some(along) = (to - from).try_normalize() else { continue };
            let mate = mates.get(&key(vertices[(k + 1) % 3], vertices[k])).copied().flatten();
            let beyond = match mate {
                Some((j, m)) => {
                    let other = &atlas.uv[j as usize].map(|x| x * texels);
                    let same = atlas.page[j as usize] == Some(page)
                        && other[m as usize].distance(to) < SAME
                        && other[(m as usize + 1) % 3].distance(from) < SAME;
                    let normal = scene.triangle_normal_and_area(j as usize).0;
                    if same || normal.distance(n) > CREASE {
                        continue;
                    }
                    normal
                }
                None => n,
            };
            let outward = -turn * along.perp();
            let length = from.distance(to);
            let low = from.min(to) - REACH;
            let high = from.max(to) + REACH;
            let (low, high) = (low.max(DVec2::ZERO).as_uvec2(), high.min(texels).ceil().as_uvec2());
            for row in low.y..high.y {
                // Along the row both places below change evenly.
                let start = DVec2::new(0.5, f64::from(row) + 0.5) - from;
                let (near, far) = within(start.dot(outward), outward.x, 0.0, REACH);
                let (left, right) = within(start.dot(along), along.x, -REACH, length + REACH);
                let first = near.max(left).max(f64::from(low.x)).floor() as u32;
                let last = (far.min(right) + 1.0).clamp(0.0, f64::from(high.x)).ceil() as u32;
                for column in first..last {
                    let texel = row * size.width + column;
                    if covered[texel as usize] > 0.0 {
                        continue;
                    }
                    let centre = DVec2::new(f64::from(column) + 0.5, f64::from(row) + 0.5);
                    let (s, out) = ((centre - from).dot(along), (centre - from).dot(outward));
                    let aside = (-s).max(s - length).max(0.0);
                    if !(0.0..=REACH).contains(&out) || aside > REACH {
                        continue;
                    }
                    let far = out.hypot(aside);
                    if best.get(&texel).is_some_and(|b| b.0 <= far) {
                        continue;
                    }
                    // The same distance beyond the edge, in the plane of what is there.
                    let lift = |x: DVec2| {
                        let w = barycentric(&uv, x);
                        w.x * vertices[0] + w.y * vertices[1] + w.z * vertices[2]
                    };
                    let foot = centre - out * outward;
                    let edge = vertices[(k + 1) % 3] - vertices[k];
                    let step = lift(centre) - lift(foot);
                    let turned = turned(step, edge, n, beyond);
                    let (inside, outside) = (lift(foot - out * outward), lift(foot) + turned);
                    let above = (inside + 4.0 * touching * n, outside + 4.0 * touching * beyond);
                    let blocked =
                        surface.cast(above.0, above.1 - above.0).is_some_and(|met| met.t < 1.0);
                    if blocked {
                        continue;
                    }
                    let Some(place) = surface.at(outside, beyond, touching) else { continue };
                    if light.mesh.faces[place.face as usize].frame.n.distance(beyond) > COPLANAR {
                        continue;
                    }
                    let root = light.mesh.root_at(place.face as usize, place.x);
                    if !buried[root] {
                        best.insert(texel, (far, root as u32, place.x));
                    }
                }
            }
        }
    }
    let mut found: Vec<(u32, u32, DVec2)> =
        best.into_iter().map(|(texel, (_, root, x))| (root, texel, x)).collect();
    found.sort_unstable_by_key(|&(root, texel, _)| (root, texel));
    let mut continued = Continued { asked: vec![], texels: vec![] };
    for own in found.chunk_by(|a, b| a.0 == b.0) {
        let points = own.iter().map(|f| f.2).collect();
        continued.asked.push(RootPoints { root: own[0].0, points });
        continued.texels.push(own.iter().map(|f| f.1).collect());
    }
    continued
}

/// Corners of neighbours nearer than this (texels) are one: roundings.
const SAME: f64 = 1e-3;

/// What goes on without a common edge must have the same normal, but for this (radians).
const COPLANAR: f64 = 1e-3;

/// A step across an edge, turned about it from the plane with normal `n` into that with normal `m`.
fn turned(step: DVec3, edge: DVec3, n: DVec3, m: DVec3) -> DVec3 {
    let Some(along) = edge.try_normalize() else { return step };
    let side = step.dot(along) * along;
    let length = (step - side).length();
    let sign = (step - side).dot(along.cross(n)).signum();
    match along.cross(m).try_normalize() {
        Some(across) if length > 0.0 => side + sign * length * across,
        _ => step,
    }
}

/// Where start + k slope is between two values: the least and the greatest k.
fn within(start: f64, slope: f64, least: f64, most: f64) -> (f64, f64) {
    if slope == 0.0 {
        let is_inside = (least..=most).contains(&start);
        return if is_inside { (f64::NEG_INFINITY, f64::INFINITY) } else { (0.0, -1.0) };
    }
    let (a, b) = ((least - start) / slope, (most - start) / slope);
    (a.min(b), a.max(b))
}

type Key = [[u64; 3]; 2];

fn key(a: DVec3, b: DVec3) -> Key {
    [a, b].map(|x| (x + 0.0).to_array().map(f64::to_bits))
}

/// Triangle and edge of every edge, from corner to corner; none where several have it.
fn mates(scene: &Scene) -> HashMap<Key, Option<(u32, u8)>> {
    let mut mates = HashMap::with_capacity(3 * scene.triangles.len());
    for (i, t) in scene.triangles.iter().enumerate() {
        for k in 0..3 {
            mates
                .entry(key(t.vertices[k], t.vertices[(k + 1) % 3]))
                .and_modify(|m| *m = None)
                .or_insert(Some((i as u32, k as u8)));
        }
    }
    mates
}

/// Gives all texels that have no value the mean of those around them that have, ring by ring.
pub(super) fn dilate(width: u32, height: u32, has_value: &mut [bool], layers: [&mut [Vec3]; 2]) {
    let [first, second] = layers;
    let around = |k: u32| {
        let (x, y) = (k % width, k / width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.flat_map(move |row| {
            let columns = x.saturating_sub(1)..(x + 2).min(width);
            columns.map(move |column| row * width + column)
        })
        .filter(move |&j| j != k)
    };
    let mut is_next = vec![false; has_value.len()];
    let mut ring: Vec<u32> = vec![];
    for k in 0..width * height {
        if !has_value[k as usize] && around(k).any(|j| has_value[j as usize]) {
            is_next[k as usize] = true;
            ring.push(k);
        }
    }
    while !ring.is_empty() {
        let means: Vec<(Vec3, Vec3)> = ring
            .iter()
            .map(|&k| {
                let (mut a, mut b, mut count) = (Vec3::ZERO, Vec3::ZERO, 0.0);
                for j in around(k).filter(|&j| has_value[j as usize]) {
                    a += first[j as usize];
                    b += second[j as usize];
                    count += 1.0;
                }
                (a / count, b / count)
            })
            .collect();
        for (&k, (a, b)) in ring.iter().zip(means) {
            (first[k as usize], second[k as usize]) = (a, b);
            has_value[k as usize] = true;
        }
        let mut next = vec![];
        for &k in &ring {
            for j in around(k) {
                if !has_value[j as usize] && !std::mem::replace(&mut is_next[j as usize], true) {
                    next.push(j);
                }
            }
        }
        ring = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_texel_gets_a_value_from_those_next_to_it() {
        let (width, height) = (9u32, 7u32);
        let mut values = vec![Vec3::ZERO; 63];
        let mut other = vec![Vec3::ZERO; 63];
        let mut has = vec![false; 63];
        for (k, v) in [(10, 1.0), (11, 3.0), (60, 8.0)] {
            (values[k], other[k], has[k]) = (Vec3::splat(v), Vec3::splat(-v), true);
        }
        dilate(width, height, &mut has, [&mut values, &mut other]);
        assert!(has.iter().all(|h| *h));
        assert!(values.iter().all(|v| (1.0..=8.0).contains(&v.x)));
        assert_eq!((values[10].x, values[1].x, values[9].x, values[62].x), (1.0, 2.0, 1.0, 8.0));
        assert!(values.iter().zip(&other).all(|(a, b)| *a == -*b));
        // A page without any value stays as it is.
        let mut none = vec![false; 4];
        let mut zeros = vec![Vec3::ZERO; 4];
        dilate(2, 2, &mut none, [&mut zeros, &mut [Vec3::ZERO; 4]]);
        assert_eq!(none, [false; 4]);
    }

    #[test]
    fn places_between_two_values() {
        assert_eq!(within(1.0, -0.5, 0.0, 2.0), (-2.0, 2.0));
        assert_eq!(within(1.0, 0.0, 0.0, 2.0), (f64::NEG_INFINITY, f64::INFINITY));
        let (a, b) = within(3.0, 0.0, 0.0, 2.0);
        assert!(a > b);
    }

    #[test]
    fn a_step_turns_about_its_edge() {
        let step = DVec3::new(0.3, -0.4, 0.0);
        assert!(turned(step, DVec3::X, DVec3::Z, DVec3::Z).distance(step) < 1e-15);
        let up = turned(step, DVec3::X, DVec3::Z, DVec3::Y);
        assert!(up.distance(DVec3::new(0.3, 0.0, 0.4)) < 1e-15, "{up}");
    }
}
