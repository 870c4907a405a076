//! The parts of texels that a triangle covers, exactly: polygons with their areas and centroids.

use std::ops::Range;

use glam::DVec2;

/// Parts of a texel smaller than this, in texels, are left out: corners on the border of a texel
/// whose roundings reach over it. (Coordinates of f32 are good to 2e-4 texels.)
const LEAST: f64 = 1e-7;

/// A part of a texel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    /// Column of the texel.
    pub column: u32,
    /// Its row.
    pub row: u32,
    /// Area in texels.
    pub area: f64,
    /// Centroid in texels.
    pub centre: DVec2,
}

/// Calls `found` with the parts of texels that a triangle covers, in rows `rows` and columns below
/// `width`, row by row. Corners are in texels, of either winding.
pub(super) fn parts(
    triangle: &[DVec2; 3],
    rows: Range<u32>,
    width: u32,
    mut found: impl FnMut(Part),
) {
    let whole = Polygon::of(triangle);
    let least = LEAST * whole.area_and_centroid().0.min(1.0);
    let (low, high) = (
        triangle[0].min(triangle[1]).min(triangle[2]),
        triangle[0].max(triangle[1]).max(triangle[2]),
    );
    let first = rows.start.max(low.y.max(0.0) as u32);
    let last = rows.end.min(high.y.max(0.0).ceil() as u32);
    for row in first..last {
        let strip = whole.above(1, f64::from(row)).below(1, f64::from(row) + 1.0);
        let (left, right) = strip.range(0);
        if left > right {
            continue;
        }
        let columns = left.max(0.0) as u32..(right.max(0.0).ceil() as u32).min(width);
        for column in columns {
            let part = strip.above(0, f64::from(column)).below(0, f64::from(column) + 1.0);
            let (area, centre) = part.area_and_centroid();
            if area > least {
                found(Part { column, row, area, centre });
            }
        }
    }
}

/// Calls `found` with area and centroid of the parts of a triangle in each of n x n squares of a
/// texel.
pub(super) fn parts_of_texel(
    triangle: &[DVec2; 3],
    (column, row): (u32, u32),
    n: u32,
    mut found: impl FnMut(f64, DVec2),
) {
    let whole = Polygon::of(triangle);
    let least = LEAST * whole.area_and_centroid().0.min(1.0);
    let at = |start: u32, k: u32| f64::from(start) + f64::from(k) / f64::from(n);
    for j in 0..n {
        let strip = whole.above(1, at(row, j)).below(1, at(row, j + 1));
        for i in 0..n {
            let part = strip.above(0, at(column, i)).below(0, at(column, i + 1));
            let (area, centre) = part.area_and_centroid();
            if area > least {
                found(area, centre);
            }
        }
    }
}

/// Most corners of a triangle that a square has cut.
const MOST: usize = 7;

/// A convex polygon.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [DVec2; MOST],
    count: usize,
}

impl Polygon {
    fn of(triangle: &[DVec2; 3]) -> Polygon {
        let mut polygon = Polygon { corners: [DVec2::ZERO; MOST], count: 3 };
        polygon.corners[..3].copy_from_slice(triangle);
        polygon
    }

    /// The part with coordinate `axis` at most `end`.
    fn below(&self, axis: usize, end: f64) -> Polygon {
        self.cut(axis, |x| end - x)
    }

    /// The part with coordinate `axis` at least `begin`.
    fn above(&self, axis: usize, begin: f64) -> Polygon {
        self.cut(axis, |x| x - begin)
    }

    /// The part where a function of one coordinate is not negative.
    fn cut(&self, axis: usize, inside: impl Fn(f64) -> f64) -> Polygon {
        let mut part = Polygon { corners: [DVec2::ZERO; MOST], count: 0 };
        let Some(&last) = self.corners[..self.count].last() else { return part };
        let (mut from, mut from_value) = (last, inside(last[axis]));
        for &to in &self.corners[..self.count] {
            let value = inside(to[axis]);
            if value * from_value < 0.0 {
                part.push(from + (to - from) * (from_value / (from_value - value)));
            }
            if value >= 0.0 {
                part.push(to);
            }
            (from, from_value) = (to, value);
        }
        part
    }

    /// Roundings may make a corner more than there can be: it is left out.
    fn push(&mut self, x: DVec2) {
        if let Some(place) = self.corners.get_mut(self.count) {
            *place = x;
            self.count += 1;
        }
    }

    /// Least and greatest coordinate; the least is above the greatest where there is no corner.
    fn range(&self, axis: usize) -> (f64, f64) {
        let all = self.corners[..self.count].iter().map(|x| x[axis]);
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
    }

    fn area_and_centroid(&self) -> (f64, DVec2) {
        let corners = &self.corners[..self.count];
        let Some(&first) = corners.first() else { return (0.0, DVec2::ZERO) };
        let (mut twice, mut moment) = (0.0, DVec2::ZERO);
        for pair in corners[1..].windows(2) {
            let (a, b) = (pair[0] - first, pair[1] - first);
            let own = a.perp_dot(b);
            twice += own;
            moment += own * (a + b);
        }
        if twice == 0.0 {
            return (0.0, first);
        }
        (0.5 * twice.abs(), first + moment / (3.0 * twice))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn t(corners: [[f64; 2]; 3]) -> [DVec2; 3] {
        corners.map(DVec2::from)
    }

    /// Area, first moments.
    fn whole(t: &[DVec2; 3]) -> (f64, DVec2) {
        let area = 0.5 * (t[1] - t[0]).perp_dot(t[2] - t[0]).abs();
        (area, area * (t[0] + t[1] + t[2]) / 3.0)
    }

    #[test]
    fn parts_make_up_the_triangle() {
        for triangle in [
            t([[0.2, 0.3], [7.9, 1.1], [2.5, 6.7]]),
            t([[2.5, 6.7], [7.9, 1.1], [0.2, 0.3]]),
            t([[1.0, 1.0], [5.0, 1.0], [5.0, 4.0]]),
            t([[3.1, 3.1], [3.2, 3.15], [3.15, 3.3]]),
            t([[0.0, 0.0], [8.0, 8.0], [8.0, 7.999]]),
        ] {
            let (mut area, mut moment) = (0.0, DVec2::ZERO);
            let mut finer = (0.0, DVec2::ZERO);
            parts(&triangle, 0..8, 8, |p| {
                let inside = p.centre - DVec2::new(p.column.into(), p.row.into());
                assert!(inside.min_element() >= 0.0 && inside.max_element() <= 1.0);
                assert!(p.area <= 1.0 + 1e-12);
                area += p.area;
                moment += p.area * p.centre;
                parts_of_texel(&triangle, (p.column, p.row), 4, |a, x| {
                    finer.0 += a;
                    finer.1 += a * x;
                });
            });
            let expected = whole(&triangle);
            for (a, m) in [(area, moment), finer] {
                assert!((a - expected.0).abs() < 1e-6 * expected.0, "{a} {}", expected.0);
                assert!(m.distance(expected.1) < 1e-5 * expected.0);
            }
        }
    }

    #[test]
    fn what_ends_on_the_border_of_a_texel_stays_inside() {
        let mut count = 0;
        let triangle = t([[1.0, 1.0], [3.0 + 1e-12, 1.0], [3.0, 3.0 + 1e-12]]);
        parts(&triangle, 0..9, 9, |p| {
            assert!((1..3).contains(&p.column) && (1..3).contains(&p.row));
            count += 1;
        });
        assert_eq!(count, 3);
        // Rows and columns outside of the page are left out.
        parts(&t([[-5.0, -5.0], [30.0, -5.0], [-5.0, 30.0]]), 2..4, 3, |p| {
            assert!(p.column < 3 && (2..4).contains(&p.row));
            count += 1;
        });
        assert_eq!(count, 9);
    }
}
