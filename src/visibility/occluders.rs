//! The blockers of light: convex polygons merged from coplanar triangles, in a box tree.

use std::collections::HashMap;

use glam::DVec3;

use super::bodies::{self, Body};
use crate::geometry::{Bounds, BoxTree, COINCIDENCE, Frame};

/// All occluders of a scene.
pub struct Occluders {
    corners: Vec<DVec3>,
    ends: Vec<usize>,
    planes: Vec<(DVec3, DVec3)>,
    /// Triangles of the input that each occluder covers, end to end.
    members: Vec<u32>,
    member_ends: Vec<usize>,
    /// Convex bodies, and by occluder the body that it is a face of.
    pub(super) bodies: Vec<Body>,
    pub(super) body_of: Vec<u32>,
    pub(super) tree: BoxTree,
    /// Largest coordinate of the scene in size; what roundings are relative to.
    pub magnitude: f64,
}

impl Occluders {
    /// Occluders of a list of triangles with area.
    ///
    /// Triangles with the same corners (the two sides of a plate) become one. Triangles in one
    /// plane that share an edge are joined while the result is convex (Hertel & Mehlhorn 1983):
    /// fewer cuts later, the same set of points.
    pub fn build(triangles: &[[DVec3; 3]]) -> Occluders {
        let magnitude =
            triangles.iter().flatten().map(|x| x.abs().max_element()).fold(0.0, f64::max);
        let merged = merge(triangles, COINCIDENCE * magnitude);
        let mut occluders = Occluders {
            corners: vec![],
            ends: vec![],
            planes: vec![],
            members: vec![],
            member_ends: vec![],
            bodies: vec![],
            body_of: vec![],
            tree: BoxTree::build(&[]),
            magnitude,
        };
        let mut boxes = vec![];
        for polygon in merged {
            boxes.push(Bounds::of(&polygon.corners));
            occluders.planes.push(polygon.plane);
            occluders.corners.extend(polygon.corners);
            occluders.ends.push(occluders.corners.len());
            occluders.members.extend(polygon.members);
            occluders.member_ends.push(occluders.members.len());
        }
        occluders.tree = BoxTree::build(&boxes);
        (occluders.bodies, occluders.body_of) = bodies::find(&occluders);
        occluders
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Corners of occluder `i`, in order around its normal.
    pub fn corners(&self, i: usize) -> &[DVec3] {
        let begin = if i == 0 { 0 } else { self.ends[i - 1] };
        &self.corners[begin..self.ends[i]]
    }

    /// A point and the unit normal of the plane of occluder `i`.
    pub fn plane(&self, i: usize) -> (DVec3, DVec3) {
        self.planes[i]
    }

    /// Indices of the triangles that occluder `i` was joined from.
    pub fn members(&self, i: usize) -> &[u32] {
        let begin = if i == 0 { 0 } else { self.member_ends[i - 1] };
        &self.members[begin..self.member_ends[i]]
    }

    /// A coordinate's uncertainty, in metres.
    pub fn coincidence(&self) -> f64 {
        COINCIDENCE * self.magnitude
    }
}

struct Merged {
    corners: Vec<DVec3>,
    plane: (DVec3, DVec3),
    members: Vec<u32>,
}

/// Joins coplanar neighbours into convex polygons: those all of whose points one plane holds to half
/// of `tolerance`.
fn merge(triangles: &[[DVec3; 3]], tolerance: f64) -> Vec<Merged> {
    let key = |x: DVec3| (x + 0.0).to_array().map(f64::to_bits);
    let mut ids = HashMap::new();
    let mut points: Vec<DVec3> = vec![];
    let mut seen = HashMap::new();
    // Polygons as loops of point ids; a loop that was joined to another is left empty.
    let mut loops: Vec<Vec<u32>> = vec![];
    let mut members: Vec<Vec<u32>> = vec![];
    let mut frames: Vec<Frame> = vec![];
    for (index, triangle) in triangles.iter().enumerate() {
        let Some(frame) = Frame::of_triangle(triangle) else { continue };
        let corners = triangle.map(|x| {
            *ids.entry(key(x)).or_insert_with(|| {
                points.push(x);
                points.len() as u32 - 1
            })
        });
        let mut sorted = corners;
        sorted.sort_unstable();
        if let Some(&twin) = seen.get(&sorted) {
            let list: &mut Vec<u32> = &mut members[twin];
            list.push(index as u32);
            continue;
        }
        seen.insert(sorted, loops.len());
        loops.push(corners.to_vec());
        members.push(vec![index as u32]);
        frames.push(frame);
    }

    let mut sides: HashMap<(u32, u32), Vec<usize>> = HashMap::new();
    for (i, corners) in loops.iter().enumerate() {
        for k in 0..3 {
            sides.entry((corners[k], corners[(k + 1) % 3])).or_default().push(i);
        }
    }
    // Edges between exactly two triangles that turn the same way, longest first: diagonals go
    // before the short edges of slivers. Ties by index keep the order fixed.
    let mut shared: Vec<(f64, usize, usize, u32, u32)> = vec![];
    for (&(a, b), left) in &sides {
        if let (true, [p], Some([q])) = (a < b, &left[..], sides.get(&(b, a)).map(|v| &v[..])) {
            shared.push((points[a as usize].distance_squared(points[b as usize]), *p, *q, a, b));
        }
    }
    shared
        .sort_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2, x.3, x.4).cmp(&(y.1, y.2, y.3, y.4))));

    let mut owner: Vec<usize> = (0..loops.len()).collect();
    let find = |owner: &[usize], mut i: usize| {
        while owner[i] != i {
            i = owner[i];
        }
        i
    };
    for (_, p, q, a, b) in shared {
        let (p, q) = (find(&owner, p), find(&owner, q));
        if p == q {
            continue;
        }
        // Roundings tilt the planes of triangles wider than 1e-12 of the scene by less than 1e-3.
        if frames[p].n.distance(frames[q].n) > 1e-3 {
            continue;
        }
        let Some(joined) = join(&loops[p], &loops[q], a, b, &points, &frames[p], tolerance) else {
            continue;
        };
        // One half of the tolerance for the corners, one for what is compared with them.
        let Some(frame) = widest_frame(&joined, &points, frames[p].n) else { continue };
        if joined.iter().all(|&x| frame.height(points[x as usize]).abs() <= 0.5 * tolerance) {
            frames[p] = frame;
            loops[p] = joined;
            loops[q] = vec![];
            let moved = std::mem::take(&mut members[q]);
            members[p].extend(moved);
            owner[q] = p;
        }
    }
    loops
        .into_iter()
        .zip(members)
        .zip(frames)
        .filter(|((corners, _), _)| !corners.is_empty())
        .map(|((corners, mut members), frame)| {
            members.sort_unstable();
            let turning = corners_of(&corners, &points, &frame, tolerance).unwrap_or(corners);
            let corners = turning.iter().map(|&i| points[i as usize]).collect();
            Merged { corners, plane: (frame.origin, frame.n), members }
        })
        .collect()
}

/// The plane of a flat convex loop, with a normal on the side of `n`: through three points far
/// apart, so that it is not tilted as the plane of one thin triangle of many may be.
fn widest_frame(loop_ids: &[u32], points: &[DVec3], n: DVec3) -> Option<Frame> {
    let place = |&i: &u32| points[i as usize];
    let farthest = |size: &dyn Fn(DVec3) -> f64| {
        loop_ids.iter().map(place).max_by(|&x, &y| size(x).total_cmp(&size(y)))
    };
    let first = place(loop_ids.first()?);
    let a = farthest(&|x| x.distance_squared(first))?;
    let b = farthest(&|x| x.distance_squared(a))?;
    let c = farthest(&|x| (x - a).cross(b - a).length_squared())?;
    let frame = Frame::of_triangle(&[a, b, c])?;
    if frame.n.dot(n) > 0.0 { Some(frame) } else { Frame::of_triangle(&[a, c, b]) }
}

/// The union of two convex loops over their common edge a -> b (b -> a in the second), if convex.
/// Points at which it runs straight on stay: a neighbour may begin there.
fn join(
    p: &[u32],
    q: &[u32],
    a: u32,
    b: u32,
    points: &[DVec3],
    frame: &Frame,
    tolerance: f64,
) -> Option<Vec<u32>> {
    let at = |l: &[u32], x: u32| l.iter().position(|&y| y == x);
    let (ia, ib) = (at(p, a)?, at(p, b)?);
    let (jb, ja) = (at(q, b)?, at(q, a)?);
    if (ia + 1) % p.len() != ib || (jb + 1) % q.len() != ja {
        return None;
    }
    // b ... a around p, then what follows a in q up to before b.
    let mut loop_ids: Vec<u32> = (0..p.len()).map(|k| p[(ib + k) % p.len()]).collect();
    loop_ids.extend((1..q.len() - 1).map(|k| q[(ja + k) % q.len()]));
    // Where the loops had more than this edge in common, the path goes out and back: cut it off.
    while let Some(k) = (0..loop_ids.len()).find(|&k| {
        let n = loop_ids.len();
        loop_ids[(k + n - 1) % n] == loop_ids[(k + 1) % n]
    }) {
        let n = loop_ids.len();
        if n < 5 {
            return None;
        }
        // The tip, and one of the two equal points beside it.
        let drop = [k, (k + 1) % n];
        loop_ids = (0..n).filter(|i| !drop.contains(i)).map(|i| loop_ids[i]).collect();
    }
    corners_of(&loop_ids, points, frame, tolerance).map(|_| loop_ids)
}

/// The corners at which a loop turns, if it never turns right by more than `tolerance` allows.
///
/// Turns are those from the last corner kept: of many small turns, each of them nothing, none would
/// be left.
fn corners_of(
    loop_ids: &[u32],
    points: &[DVec3],
    frame: &Frame,
    tolerance: f64,
) -> Option<Vec<u32>> {
    let n = loop_ids.len();
    let place: Vec<_> = loop_ids.iter().map(|&i| frame.project(points[i as usize])).collect();
    // What is farthest from any point is a corner.
    let far = |k: &usize| place[*k].distance_squared(place[0]);
    let start = (0..n).max_by(|a, b| far(a).total_cmp(&far(b)))?;
    let mut kept = vec![loop_ids[start]];
    let mut before = place[start];
    for step in 1..n {
        let k = (start + step) % n;
        let (here, after) = (place[k], place[(k + 1) % n]);
        let (to, from) = (here - before, after - here);
        let turn = to.perp_dot(from);
        let noise = tolerance * (to.length() + from.length());
        if turn < -noise || (turn <= noise && to.dot(from) < 0.0) {
            return None;
        }
        if turn > noise {
            kept.push(loop_ids[k]);
            before = here;
        }
    }
    (kept.len() >= 3).then_some(kept)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fan_of_triangles_becomes_its_outline() {
        let rim: Vec<DVec3> = (0..8)
            .map(|k| {
                let (s, c) = (std::f64::consts::TAU * k as f64 / 8.0).sin_cos();
                DVec3::new(c, s, 0.5)
            })
            .collect();
        let fan: Vec<[DVec3; 3]> =
            (0..8).map(|k| [DVec3::new(0.0, 0.0, 0.5), rim[k], rim[(k + 1) % 8]]).collect();
        let occluders = Occluders::build(&fan);
        assert_eq!(occluders.len(), 1);
        assert_eq!(occluders.corners(0).len(), 8);
        assert_eq!(occluders.members(0), [0, 1, 2, 3, 4, 5, 6, 7]);
    }

    #[test]
    fn both_sides_of_a_plate_are_one_and_an_l_stays_two() {
        let p = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        let square = [[p(0., 0.), p(1., 0.), p(1., 1.)], [p(0., 0.), p(1., 1.), p(0., 1.)]];
        let under = square.map(|t| [t[0], t[2], t[1]]);
        let plate: Vec<_> = square.into_iter().chain(under).collect();
        assert_eq!(Occluders::build(&plate).len(), 1);
        let mut l = square.to_vec();
        l.extend([[p(1., 0.), p(2., 0.), p(1., 1.)]]);
        assert_eq!(Occluders::build(&l).len(), 1);
        l.extend([[p(0., 1.), p(0.5, 1.), p(0., 2.)]]);
        assert_eq!(Occluders::build(&l).len(), 2);
    }

    #[test]
    fn a_bend_is_not_lost_in_a_short_edge() {
        let p = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        let (bend, short) = (0.01f64, 1e-13);
        let (a, b, c) = (p(0.0, 0.5), p(-1.0, 0.0), p(0.0, 0.0));
        let (near, d) =
            (short * p(bend.cos(), bend.sin()), p((2.0 * bend).cos(), (2.0 * bend).sin()));
        let occluders = Occluders::build(&[[a, b, c], [a, c, near], [a, near, d]]);
        assert_eq!(occluders.len(), 1);
        assert_eq!(occluders.corners(0).len(), 4);
    }
}
