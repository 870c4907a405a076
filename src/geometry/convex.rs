//! Convex polygons in space that remember where in a triangle their corners are.
//!
//! Corners carry barycentric weights of the triangle that they are cut from, so that whatever
//! varies linearly over it can be had at the corners of its parts. Everything is done in space, not
//! in the frame of one triangle: neighbours that are cut by the same plane get the same new corner
//! on their common edge, bit for bit.

use glam::DVec3;

/// A corner of a part of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Its place.
    pub x: DVec3,
    /// Weights of the triangle's corners there; their sum is 1.
    pub weights: DVec3,
}

/// The corners of a whole triangle.
pub fn whole(t: &[DVec3; 3]) -> Vec<Corner> {
    t.iter().zip(DVec3::AXES).map(|(&x, weights)| Corner { x, weights }).collect()
}

/// Cuts a convex polygon in two parts, where `f` is positive and where it is negative.
///
/// `f` is linear. Values of at most `on` in size count as zero: no corner is made where one is that
/// near to the line already, and a part that reaches no farther than `on` to its side is left to
/// the other. The two parts always make up the polygon, and have only the cut in common.
pub fn split(polygon: &[Corner], f: impl Fn(DVec3) -> f64, on: f64) -> [Vec<Corner>; 2] {
    let n = polygon.len();
    let value: Vec<f64> = polygon.iter().map(|c| f(c.x)).collect();
    let Some(top) = (0..n).max_by(|&i, &j| value[i].total_cmp(&value[j])) else {
        return [vec![], vec![]];
    };
    if value[top] <= on {
        return [vec![], polygon.to_vec()];
    }
    // Counted from the top, values fall below zero at `first` and rise above after `last`.
    let at = |k: usize| (top + k) % n;
    let below = |&k: &usize| value[at(k)] < -on;
    let (Some(first), Some(last)) = ((1..n).find(below), (1..n).rev().find(below)) else {
        return [polygon.to_vec(), vec![]];
    };
    let end = |range: std::ops::Range<usize>, from: usize, to: usize| -> (usize, Option<Corner>) {
        let near = range.min_by(|&i, &j| value[at(i)].abs().total_cmp(&value[at(j)].abs()));
        match near {
            Some(k) => (k, None),
            // Neither counts as zero: the quotient is good, and the same for both directions.
            None => {
                let (p, q) = (polygon[at(from)], polygon[at(to)]);
                let t = value[at(from)] / (value[at(from)] - value[at(to)]);
                let between = |a: DVec3, b: DVec3| a + (b - a) * t;
                let x = between(p.x, q.x);
                (from, Some(Corner { x, weights: between(p.weights, q.weights) }))
            }
        }
    };
    // The runs of corners that count as zero, before `first` and after `last`: one of them is an
    // end of the cut.
    let zeros_before = (1..first).rev().take_while(|&k| value[at(k)] <= on).count();
    let zeros_after = (last + 1..n).take_while(|&k| value[at(k)] <= on).count();
    let (down, entry) = end(first - zeros_before..first, first - 1, first);
    let (up, exit) = end(last + 1..last + 1 + zeros_after, last + 1, last);
    // With a new corner the last positive one is `down`, or the first positive one is `up`.
    let mut positive: Vec<Corner> = (0..=down).map(|k| polygon[at(k)]).collect();
    positive.extend(entry);
    positive.extend(exit);
    positive.extend((up..n).map(|k| polygon[at(k)]));
    let mut negative: Vec<Corner> = vec![];
    negative.extend(entry);
    let begin = if entry.is_some() { down + 1 } else { down };
    let finish = if exit.is_some() { up - 1 } else { up };
    negative.extend((begin..=finish).map(|k| polygon[at(k)]));
    negative.extend(exit);
    [positive, negative]
}

/// Height over the longest edge of a triangle.
pub fn height(t: &[DVec3; 3]) -> f64 {
    let [a, b, c] = *t;
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    if longest > 0.0 { (b - a).cross(c - a).length() / longest } else { 0.0 }
}

/// Cuts a convex polygon into triangles, corners by number, in the polygon's direction.
///
/// Of all triangulations it is the one whose worst triangle has the best shape (height over longest
/// edge): corners on a straight edge do not become triangles without area where that can be
/// avoided. Dynamic programming (Klincsek 1980) in the cube of the number of corners.
pub fn triangulate(polygon: &[Corner]) -> Vec<[usize; 3]> {
    let n = polygon.len();
    let shape = |t: [usize; 3]| {
        let [a, b, c] = t.map(|i| polygon[i].x);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        if longest > 0.0 { height(&[a, b, c]) / longest } else { 0.0 }
    };
    // The part from corner i to corner j: its worst shape, and the third corner over that chord.
    let mut best = vec![(f64::INFINITY, 0); n * n];
    for width in 2..n {
        for i in 0..n - width {
            let j = i + width;
            let worst = |m: usize| shape([i, m, j]).min(best[i * n + m].0).min(best[m * n + j].0);
            let candidates = (i + 1..j).map(|m| (worst(m), m));
            best[i * n + j] = candidates
                .reduce(|a, b| if b.0 > a.0 { b } else { a })
                .unwrap_or((f64::INFINITY, 0));
        }
    }
    let mut triangles = vec![];
    let mut parts = vec![(0, n.saturating_sub(1))];
    while let Some((i, j)) = parts.pop() {
        if j - i >= 2 {
            let m = best[i * n + j].1;
            triangles.push([i, m, j]);
            parts.extend([(m, j), (i, m)]);
        }
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(polygon: &[Corner]) -> f64 {
        let cross = |t: [usize; 3]| {
            let [a, b, c] = t.map(|i| polygon[i].x);
            0.5 * (b - a).cross(c - a).z
        };
        triangulate(polygon).into_iter().map(cross).sum()
    }

    #[test]
    fn parts_make_up_the_whole() {
        let t = [DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::new(1.0, 3.0, 0.0)];
        let mut parts = vec![whole(&t)];
        for k in 0..40 {
            let g = DVec3::new((1.7 * f64::from(k)).cos(), (1.7 * f64::from(k)).sin(), 0.0);
            let f = |x: DVec3| (x - DVec3::new(1.6, 1.0 + 0.01 * f64::from(k), 0.0)).dot(g);
            // A wide tolerance, so that it bites.
            parts = parts.iter().flat_map(|p| split(p, f, 0.03)).collect();
            parts.retain(|p| !p.is_empty());
            let areas: Vec<f64> = parts.iter().map(|p| area(p)).collect();
            assert!((areas.iter().sum::<f64>() - 6.0).abs() < 1e-12);
            assert!(areas.iter().all(|&a| a > -1e-15));
        }
        assert!(parts.len() > 50, "{}", parts.len());
        for corner in parts.iter().flatten() {
            let w = corner.weights;
            assert!((w.element_sum() - 1.0).abs() < 1e-14 && w.min_element() > -1e-14);
            assert!((w.x * t[0] + w.y * t[1] + w.z * t[2]).distance(corner.x) < 1e-14);
        }
    }

    #[test]
    fn a_line_beside_an_edge_cuts_nothing() {
        let t = whole(&[DVec3::ZERO, DVec3::X, DVec3::Y]);
        let [inside, outside] = split(&t, |x| x.y + 1e-9, 1e-6);
        assert_eq!((inside.len(), outside.len()), (3, 0));
        let [inside, outside] = split(&t, |x| -x.y + 1e-9, 1e-6);
        assert_eq!((inside.len(), outside.len()), (0, 3));
    }

    #[test]
    fn both_sides_of_an_edge_get_the_same_corner() {
        let (a, b) = (DVec3::new(0.1, 0.7, 0.3), DVec3::new(0.9, -0.2, 0.77));
        let f = |x: DVec3| (x - DVec3::new(0.45, 0.1, 0.4)).dot(DVec3::new(0.8, -0.3, 0.5));
        let cuts = [[a, b, DVec3::Z], [b, a, DVec3::ONE]].map(|t| {
            let [positive, _] = split(&whole(&t), f, 1e-9);
            let on = |c: &&Corner| f(c.x).abs() < 1e-15 && (c.x - a).cross(b - a).length() < 1e-15;
            positive.iter().find(on).unwrap().x
        });
        assert_eq!(cuts[0], cuts[1]);
    }

    #[test]
    fn straight_corners_do_not_make_flat_triangles() {
        let at = |x: f64, y: f64| Corner { x: DVec3::new(x, y, 0.0), weights: DVec3::X };
        let polygon = [at(0., 0.), at(1., 0.), at(2., 0.), at(1., 1.), at(0., 2.), at(0., 1.)];
        let triangles = triangulate(&polygon);
        assert_eq!(triangles.len(), 4);
        assert!(triangles.iter().all(|t| height(&t.map(|i| polygon[i].x)) > 0.4));
    }
}
