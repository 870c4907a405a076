//! Convex bodies: occluders that cast one shadow together.
//!
//! Seen from outside, the faces of a convex body that are turned towards the observer shade what lies in
//! the cone over the body's silhouette and beyond all of their planes: a ray meets the body where it
//! crosses the last of these planes. That is one convex shadow instead of one for each face. The body may
//! be open where nobody looks in: a block without a bottom that stands on a floor.

use std::collections::HashMap;

use glam::DVec3;

use super::Occluders;
use crate::geometry::Frame;

/// No body, no face.
pub(super) const NONE: u32 = u32::MAX;

/// Bodies of more faces are left as they are: their faces are small.
pub(super) const MOST_FACES: usize = 32;

/// Some of the faces of the convex hull of their corners.
pub(super) struct Body {
    /// The faces, occluders by number.
    pub faces: Vec<Face>,
    /// All corners, metres.
    pub corners: Vec<DVec3>,
    /// Planes of the hull's other faces: a point and the outward unit normal.
    pub missing: Vec<(DVec3, DVec3)>,
}

/// A face of a body.
pub(super) struct Face {
    /// Its occluder.
    pub occluder: u32,
    /// 1 if the occluder's normal points outward, -1 if inward.
    pub outward: f64,
    /// Beyond the edge from each corner to the next: places in [`Body::faces`], or [`NONE`].
    pub beyond: Vec<u32>,
}

/// The convex bodies among the occluders that share edges, and by occluder the number of its body.
pub(super) fn find(occluders: &Occluders) -> (Vec<Body>, Vec<u32>) {
    let mut ids = HashMap::new();
    let loops: Vec<Vec<u32>> = (0..occluders.len())
        .map(|i| {
            let id = |&x: &DVec3| {
                let key = (x + 0.0).to_array().map(f64::to_bits);
                let next = ids.len() as u32;
                *ids.entry(key).or_insert(next)
            };
            occluders.corners(i).iter().map(id).collect()
        })
        .collect();
    let mut at_edge: HashMap<(u32, u32), Vec<u32>> = HashMap::new();
    for (face, corners) in loops.iter().enumerate() {
        for edge in edges(corners) {
            at_edge.entry(edge).or_default().push(face as u32);
        }
    }
    let mut body_of = vec![NONE; loops.len()];
    let mut seen = vec![false; loops.len()];
    let mut bodies = vec![];
    for first in 0..loops.len() {
        if seen[first] {
            continue;
        }
        // All that hangs together.
        seen[first] = true;
        let mut faces = vec![first as u32];
        let mut next = 0;
        while next < faces.len() {
            for edge in edges(&loops[faces[next] as usize]) {
                for &other in &at_edge[&edge] {
                    if !std::mem::replace(&mut seen[other as usize], true) {
                        faces.push(other);
                    }
                }
            }
            next += 1;
        }
        faces.sort_unstable();
        if let Some(body) = body(occluders, &faces, &loops, &at_edge) {
            faces.iter().for_each(|&face| body_of[face as usize] = bodies.len() as u32);
            bodies.push(body);
        }
    }
    (bodies, body_of)
}

/// The edges of a loop, each the same in both directions.
fn edges(corners: &[u32]) -> impl Iterator<Item = (u32, u32)> {
    (0..corners.len()).map(|i| {
        let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
        (a.min(b), a.max(b))
    })
}

/// The body that some faces make, if they are part of the surface of their convex hull, and each hole
/// is flat.
fn body(
    occluders: &Occluders,
    faces: &[u32],
    loops: &[Vec<u32>],
    at_edge: &HashMap<(u32, u32), Vec<u32>>,
) -> Option<Body> {
    if !(3..=MOST_FACES).contains(&faces.len()) {
        return None;
    }
    let tolerance = 0.5 * occluders.coincidence();
    let mut place: HashMap<u32, DVec3> = HashMap::new();
    for &face in faces {
        let corners = occluders.corners(face as usize);
        place.extend(loops[face as usize].iter().copied().zip(corners.iter().copied()));
    }
    let mut numbers: Vec<u32> = place.keys().copied().collect();
    numbers.sort_unstable();
    let corners: Vec<DVec3> = numbers.iter().map(|id| place[id]).collect();
    // The side of a plane on which nothing is; 0 if something is on both, or nothing on either.
    let free_side = |(on, n): (DVec3, DVec3)| {
        let height = |x: &DVec3| (*x - on).dot(n);
        let most = corners.iter().map(height).fold(f64::NEG_INFINITY, f64::max);
        let least = corners.iter().map(height).fold(f64::INFINITY, f64::min);
        f64::from(i8::from(most <= tolerance) - i8::from(least >= -tolerance))
    };
    let mut parts = vec![];
    let mut rim: Vec<(u32, u32)> = vec![];
    for &face in faces {
        let outward = free_side(occluders.plane(face as usize));
        if outward == 0.0 {
            return None;
        }
        let mut beyond = vec![];
        for edge in edges(&loops[face as usize]) {
            match at_edge[&edge][..] {
                [_] => {
                    rim.push(edge);
                    beyond.push(NONE);
                }
                [a, b] if a != b => {
                    let other = if a == face { b } else { a };
                    beyond.push(faces.binary_search(&other).ok()? as u32);
                }
                _ => return None,
            }
        }
        parts.push(Face { occluder: face, outward, beyond });
    }
    let mut missing = vec![];
    while let Some(edge) = rim.pop() {
        // All edges of the rim that hang together with this one.
        let mut hole = vec![edge.0, edge.1];
        while let Some(k) = rim.iter().position(|e| hole.contains(&e.0) || hole.contains(&e.1)) {
            let (a, b) = rim.swap_remove(k);
            hole.extend([a, b]);
        }
        let around: Vec<DVec3> = hole.iter().map(|id| place[id]).collect();
        let (on, n) = plane_through(&around)?;
        let flat = around.iter().all(|&x| (x - on).dot(n).abs() <= tolerance);
        let outward = free_side((on, n));
        if !flat || outward == 0.0 {
            return None;
        }
        missing.push((on, outward * n));
    }
    Some(Body { faces: parts, corners, missing })
}

/// A point and a unit normal of the plane through three points that are far apart.
fn plane_through(points: &[DVec3]) -> Option<(DVec3, DVec3)> {
    let farthest = |size: &dyn Fn(DVec3) -> f64| {
        points.iter().copied().max_by(|&x, &y| size(x).total_cmp(&size(y)))
    };
    let first = *points.first()?;
    let a = farthest(&|x| x.distance_squared(first))?;
    let b = farthest(&|x| x.distance_squared(a))?;
    let c = farthest(&|x| (x - a).cross(b - a).length_squared())?;
    Frame::of_triangle(&[a, b, c]).map(|frame| (frame.origin, frame.n))
}
