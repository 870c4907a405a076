//! Triangles of plane polygons, concave ones too.
//!
//! The polygon is projected along its Newell normal (the sum of the cross products of its edges,
//! whose length is twice the area) and cut by ear clipping. Triangles keep its orientation, and
//! their areas add up to the polygon's; where they do not, it crosses itself, which is reported.

use std::collections::HashSet;

use earcut::Earcut;
use glam::{DVec2, DVec3};

/// How far a corner may lie off the plane, relative to the polygon's diameter, before that is
/// reported: coordinates written with six digits stay below this for polygons down to a
/// hundredth of their distance from the origin.
const FLAT: f64 = 1e-4;

/// How well areas must add up, relative to the polygon's area: far above rounding.
const AREA: f64 = 1e-9;

/// Polygons of no more corners are cut whatever they are: the worst take a tenth of a millisecond.
const MOST_UNCHECKED: usize = 100;

/// What is wrong with a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flaw {
    /// Its corners are not in one plane.
    NotPlane,
    /// Its outline crosses or covers itself.
    SelfIntersecting,
}

impl Flaw {
    /// In words, for notices.
    pub(crate) fn text(self) -> &'static str {
        match self {
            Flaw::NotPlane => "polygons that are not plane are cut into triangles as they come",
            Flaw::SelfIntersecting => {
                "polygons that cross themselves are cut into triangles as they come"
            }
        }
    }
}

/// Cuts polygons into triangles; keeps its memory from one to the next.
#[derive(Default)]
pub(crate) struct Cutter {
    earcut: Earcut<f64>,
    flat: Vec<[f64; 2]>,
    corners: Vec<u32>,
}

impl Cutter {
    /// The corner numbers of the triangles of a polygon, and what is wrong with it.
    pub(crate) fn cut(&mut self, polygon: &[DVec3]) -> (Vec<[usize; 3]>, Option<Flaw>) {
        if polygon.len() <= 3 {
            return (fan(polygon.len()), None);
        }
        // A bridge to a hole repeats two corners for at least three new ones. Outlines that repeat more
        // than that go round and round: cutting ears from them takes the cube of their length.
        if polygon.len() > MOST_UNCHECKED && 2 * distinct(polygon) < polygon.len() {
            return (fan(polygon.len()), Some(Flaw::SelfIntersecting));
        }
        // Differences to one corner keep the digits that matter, and one unit the exponents.
        let origin = polygon[0];
        let size = polygon.iter().map(|p| (p - origin).abs().max_element()).fold(0.0, f64::max);
        if !(size > 0.0 && size.is_finite()) {
            return (fan(polygon.len()), None);
        }
        let local = |p: DVec3| (p - origin) / size;
        let mut normal = DVec3::ZERO;
        for (i, &p) in polygon.iter().enumerate() {
            normal += local(p).cross(local(polygon[(i + 1) % polygon.len()]));
        }
        let double_area = normal.length();
        if double_area < 1e-14 {
            // A line, or loops that cancel: there is no plane to cut in.
            return (fan(polygon.len()), Some(Flaw::SelfIntersecting));
        }
        let normal = normal / double_area;
        let (right, up) = normal.any_orthonormal_pair();
        self.flat.clear();
        let mut off_plane = 0.0;
        let mut heights = (f64::INFINITY, f64::NEG_INFINITY);
        for p in polygon.iter().map(|&p| local(p)) {
            self.flat.push([p.dot(right), p.dot(up)]);
            let height = p.dot(normal);
            heights = (heights.0.min(height), heights.1.max(height));
            off_plane = heights.1 - heights.0;
        }
        self.earcut.earcut_slice::<u32>(&self.flat, &[], &mut self.corners);

        let mut triangles = Vec::with_capacity(polygon.len() - 2);
        let mut covered = 0.0;
        for ear in self.corners.chunks_exact(3) {
            let [a, b, c] = [ear[0], ear[1], ear[2]].map(|i| i as usize);
            let at = |i: usize| DVec2::from(self.flat[i]);
            let double = (at(b) - at(a)).perp_dot(at(c) - at(a));
            covered += double.abs();
            triangles.push(if double < 0.0 { [a, c, b] } else { [a, b, c] });
        }
        let flaw = if off_plane > FLAT {
            Some(Flaw::NotPlane)
        } else if (covered - double_area).abs() > AREA * double_area {
            Some(Flaw::SelfIntersecting)
        } else {
            None
        };
        (triangles, flaw)
    }
}

/// How many different corners there are.
fn distinct(polygon: &[DVec3]) -> usize {
    let bits = |p: &DVec3| (*p + DVec3::ZERO).to_array().map(f64::to_bits);
    polygon.iter().map(bits).collect::<HashSet<_>>().len()
}

/// All triangles with the first corner.
fn fan(corners: usize) -> Vec<[usize; 3]> {
    (2..corners).map(|i| [0, i - 1, i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn total(polygon: &[DVec3], triangles: &[[usize; 3]]) -> DVec3 {
        triangles
            .iter()
            .map(|&[a, b, c]| 0.5 * (polygon[b] - polygon[a]).cross(polygon[c] - polygon[a]))
            .sum()
    }

    /// A comb of `n` teeth in a tilted plane, far from the origin.
    fn comb(n: usize) -> (Vec<DVec3>, f64) {
        let mut flat = Vec::new();
        for i in 0..n {
            let x = 2.0 * i as f64;
            flat.extend([(x, 0.0), (x, 5.0), (x + 1.0, 5.0), (x + 1.0, 0.0)]);
        }
        flat.extend([(2.0 * n as f64 - 1.0, -1.0), (0.0, -1.0)]);
        let (u, v) = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, 1.0, 0.0));
        let place = |(x, y)| DVec3::new(100.0, -50.0, 7.0) + u * x + v * y;
        (flat.into_iter().map(place).collect(), 5.0 * n as f64 + 2.0 * n as f64 - 1.0)
    }

    #[test]
    fn concave_polygons_keep_area_and_orientation() {
        let (polygon, area) = comb(30);
        for polygon in [polygon.clone(), polygon.into_iter().rev().collect()] {
            let (triangles, flaw) = Cutter::default().cut(&polygon);
            assert_eq!(flaw, None);
            let sum = total(&polygon, &triangles);
            assert!((sum.length() - area).abs() < 1e-9 * area);
            for t in &triangles {
                // Corners in a line give triangles whose area is rounding.
                assert!(total(&polygon, &[*t]).dot(sum) > -1e-9, "{t:?} is turned over");
            }
        }
    }

    #[test]
    fn flaws_are_seen_and_cut_all_the_same() {
        let bow_tie = [(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 1.0)];
        let bow_tie = bow_tie.map(|(x, y)| DVec3::new(x, y, 0.0));
        let (triangles, flaw) = Cutter::default().cut(&bow_tie);
        assert_eq!(flaw, Some(Flaw::SelfIntersecting));
        assert_eq!((triangles, flaw), Cutter::default().cut(&bow_tie));
        let saddle = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.3), (1.0, 1.0, 0.0), (0.0, 1.0, 0.3)];
        let (triangles, flaw) = Cutter::default().cut(&saddle.map(DVec3::from));
        assert_eq!((triangles.len(), flaw), (2, Some(Flaw::NotPlane)));
        let line = [0.0, 1.0, 2.0, 3.0].map(|x| DVec3::new(x, 0.0, 0.0));
        assert_eq!(Cutter::default().cut(&line).0.len(), 2);
    }
}
