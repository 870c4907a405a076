//! Well-shaped pieces: points added to a cut triangle until angles are not small.
//!
//! Refinement in the manner of Ruppert 1995 ("A Delaunay refinement algorithm for quality
//! 2-dimensional mesh generation"): a segment whose diametral circle holds a point is halved; the
//! centre of the circumscribed circle of a thin piece is added unless it lies in the diametral
//! circle of a segment, which is halved instead. Done in rounds, all pieces at once, each round a
//! new triangulation.
//!
//! No point is added nearer than [`NEAREST`] to another one, so it ends whatever the angles
//! between the segments are; what would need nearer points keeps its shape. Uniform refinement
//! keeps angles, so the shape of the pieces is the shape of the elements.
//!
//! The neighbours of the triangle do not know of the points on its boundary.

use std::collections::BTreeSet;

use glam::DVec2;

use super::arrangement::MOST_POINTS;
use super::pieces::{Cut, sorted};

/// Least angle that pieces should have: its sine. Ruppert's bound is 20.7 degrees.
const LEAST_SINE: f64 = 0.342_020_143_325_668_7;

/// Added points keep this distance from all others, in units of the triangle's longest edge.
const NEAREST: f64 = 1.0 / 40.0;

/// Most rounds; each is one triangulation. Few scenes need half of them.
const ROUNDS: usize = 16;

/// Adds points until the pieces are well-shaped, as far as that goes.
pub(super) fn improve(cut: &mut Cut) {
    for _ in 0..ROUNDS {
        let before = cut.clone();
        add_points(cut);
        if cut.points.len() == before.points.len() {
            return;
        }
        if cut.triangulate().is_none() {
            *cut = before;
            return;
        }
    }
}

/// One round.
fn add_points(cut: &mut Cut) {
    let segments = cut.segments();
    let mut halved = BTreeSet::new();
    for piece in &cut.pieces {
        for k in 0..3 {
            let edge = sorted(piece[k], piece[(k + 1) % 3]);
            let apex = cut.points[piece[(k + 2) % 3] as usize];
            if segments.contains(&edge) && encroaches(cut, edge, apex) {
                halved.insert(edge);
            }
        }
    }
    let mut thin: Vec<(f64, DVec2)> =
        cut.pieces.iter().filter_map(|p| thin(cut, &segments, *p)).collect();
    // The largest first: they are seen best, should there be too many.
    thin.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut centres = vec![];
    for (_, centre) in thin {
        let near: Vec<_> = segments.iter().filter(|&&s| encroaches(cut, s, centre)).collect();
        if near.is_empty() {
            if inside(cut, centre) {
                centres.push(centre);
            }
        } else {
            halved.extend(near);
        }
    }
    for edge in halved {
        let middle = 0.5 * (cut.points[edge.0 as usize] + cut.points[edge.1 as usize]);
        if has_room(cut, middle) {
            cut.split(edge);
        }
    }
    for centre in centres {
        if has_room(cut, centre) {
            cut.points.push(centre);
        }
    }
}

fn has_room(cut: &Cut, x: DVec2) -> bool {
    let least = NEAREST * cut.size;
    cut.points.len() < MOST_POINTS && cut.points.iter().all(|p| p.distance(x) >= least)
}

/// Whether `x` lies in the open circle that has the segment as its diameter.
fn encroaches(cut: &Cut, (a, b): (u32, u32), x: DVec2) -> bool {
    let (a, b) = (cut.points[a as usize], cut.points[b as usize]);
    // A right angle but for roundings does not.
    (a - x).dot(b - x) < -1e-9 * a.distance_squared(b)
}

/// Whether `x` lies in the triangle that is cut.
fn inside(cut: &Cut, x: DVec2) -> bool {
    let p = &cut.points;
    (0..3).all(|k| (p[(k + 1) % 3] - p[k]).perp_dot(x - p[k]) > 0.0)
}

/// Radius and centre of the circumscribed circle of a piece with a small angle that is not an angle
/// between segments.
fn thin(cut: &Cut, segments: &BTreeSet<(u32, u32)>, piece: [u32; 3]) -> Option<(f64, DVec2)> {
    let t = piece.map(|i| cut.points[i as usize]);
    let length = |k: usize| t[(k + 1) % 3].distance(t[(k + 2) % 3]);
    // The corner opposite of the shortest edge has the smallest angle.
    let k = (0..3).min_by(|&i, &j| length(i).total_cmp(&length(j))).unwrap_or(0);
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let twice = (t[1] - t[0]).perp_dot(t[2] - t[0]);
    if twice >= LEAST_SINE * length(i) * length(j) {
        return None;
    }
    if [i, j].iter().all(|&m| segments.contains(&sorted(piece[k], piece[m]))) {
        return None;
    }
    let (b, c) = (t[i] - t[k], t[j] - t[k]);
    let centre = DVec2::new(
        c.y * b.length_squared() - b.y * c.length_squared(),
        b.x * c.length_squared() - c.x * b.length_squared(),
    ) / (2.0 * b.perp_dot(c));
    centre.is_finite().then(|| (centre.length(), t[k] + centre))
}

#[cfg(test)]
mod tests {
    use super::super::arrangement::arrange;
    use super::super::pieces::cut_along;
    use super::*;

    const TOLERANCE: f64 = 1e-6;

    fn area(cut: &Cut) -> f64 {
        let p = |i: u32| cut.points[i as usize];
        cut.pieces.iter().map(|&[a, b, c]| 0.5 * (p(b) - p(a)).perp_dot(p(c) - p(a))).sum()
    }

    fn least_angle(cut: &Cut) -> f64 {
        let angle = |t: &[u32; 3], k: usize| {
            let [a, b, c] = [0, 1, 2].map(|m| cut.points[t[(k + m) % 3] as usize]);
            (b - a).angle_to(c - a).abs().to_degrees()
        };
        let angles = cut.pieces.iter().flat_map(|t| (0..3).map(move |k| angle(t, k)));
        angles.fold(180.0, f64::min)
    }

    #[test]
    fn a_footprint_gets_well_shaped_pieces() {
        let t = [DVec2::ZERO, DVec2::X, DVec2::ONE];
        let at = |x: f64, y: f64| {
            DVec2::new(0.65, 0.35) + DVec2::from_angle(0.3).rotate(DVec2::new(x, y))
        };
        let corners = [at(-0.1, -0.1), at(0.1, -0.1), at(0.1, 0.1), at(-0.1, 0.1)];
        let segments: Vec<_> = (0..4).map(|k| [corners[k], corners[(k + 1) % 4]]).collect();
        let mut cut = cut_along(arrange(&t, &segments, TOLERANCE).unwrap(), TOLERANCE).unwrap();
        assert!(least_angle(&cut) < 15.0);
        improve(&mut cut);
        assert!(least_angle(&cut) > 20.0, "{}", least_angle(&cut));
        assert!(cut.pieces.len() < 60, "{}", cut.pieces.len());
        assert!((area(&cut) - 0.5).abs() < 1e-14);
    }

    /// Segments on a small grid, where they often meet, overlap and run along the boundary.
    #[test]
    fn whatever_is_cut_keeps_its_area() {
        let t = [DVec2::ZERO, DVec2::new(8.0, 0.0), DVec2::new(0.0, 8.0)];
        let mut state = 1u64;
        let mut below = |n: u64| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) % n
        };
        let mut cuts = 0;
        for round in 0..400 {
            let mut point = || {
                let x = below(9);
                let y = below(9 - x);
                // Moved by less than the tolerance.
                DVec2::new(x as f64, y as f64)
                    + 1e-7 * DVec2::new(below(7) as f64, -(below(7) as f64))
            };
            let segments: Vec<_> = (0..1 + round % 12).map(|_| [point(), point()]).collect();
            let Some(arrangement) = arrange(&t, &segments, TOLERANCE) else { continue };
            let mut cut = cut_along(arrangement, TOLERANCE).expect("an arrangement can be cut");
            assert!((area(&cut) - 32.0).abs() < 1e-11);
            improve(&mut cut);
            assert!((area(&cut) - 32.0).abs() < 1e-11);
            cuts += 1;
        }
        assert!(cuts >= 390, "{cuts}");
    }
}
