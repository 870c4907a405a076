//! Visible areas by another road: occluders projected onto the source plane, and polygon booleans
//! in 64-bit integers (`i_overlay`).
//!
//! From the observer at height d above the source plane, a point at height h and offset q from the
//! foot is seen at foot + q d/(d - h). A triangle is first cut in these homogeneous coordinates
//! (q d, d - h) to h >= 0 and to a box about the source, which leaves d - h > 0 and finite
//! coordinates; the box is then scaled to integers of 58 bits, more than a f64 has digits.

use glam::{DVec2, DVec3};
use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay::{Overlay, ShapeType};
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::i_float::int::point::IntPoint;

use super::scenes::Sight;

/// Heights below this share of the scene's size are meant to be zero. Scenes given to the oracle
/// have sizes about 1 and shifts of at most that, so that roundings are about 1e-15; and random
/// scenes come this close to a coincidence once in about 1e8 planes.
const ON: f64 = 1e-12;

/// Areas on the source plane, square metres.
pub struct Areas {
    /// Of the source.
    pub source: f64,
    /// Of what the observer sees of it.
    pub visible: f64,
}

/// What the observer sees of the source. Blockers in the source's plane or in the observer's do
/// not shade.
pub fn areas(sight: &Sight) -> Areas {
    let [a, b, c] = sight.source;
    let n = (b - a).cross(c - a).normalize();
    let u = (b - a).normalize();
    let v = n.cross(u);
    let flat = |x: DVec3| DVec2::new((x - a).dot(u), (x - a).dot(v));
    let d = (sight.point - a).dot(n);
    let foot = flat(sight.point);
    let source = sight.source.map(flat);

    let heights = sight.source.map(|x| (x - sight.point).dot(sight.normal));
    let risen = cut(&source.iter().map(|p| p.to_array()).zip(heights).collect::<Vec<_>>());
    let middle = (source[0] + source[1] + source[2]) / 3.0;
    let half = 1.1 * source.iter().map(|p| (*p - middle).abs().max_element()).fold(0.0, f64::max);

    let unit = 2f64.powi(58) / half;
    let whole = |p: DVec2| {
        let q = (p - middle) * unit;
        IntPoint::<i64>::new(q.x.round() as i64, q.y.round() as i64)
    };
    let mut overlay = Overlay::<i64>::new(64);
    let subject: Vec<_> = risen.iter().map(|&p| whole(DVec2::from(p))).collect();
    overlay.add_contour(&subject, ShapeType::Subject);
    for triangle in &sight.blockers {
        let normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).normalize();
        if (sight.point - triangle[0]).dot(normal).abs() <= ON {
            continue;
        }
        let height = triangle.map(|x| (x - a).dot(n));
        if height.iter().all(|&h| h <= ON) {
            continue;
        }
        let corners: Vec<[f64; 3]> = triangle
            .iter()
            .zip(height)
            .map(|(&x, h)| {
                let q = (flat(x) - foot) * d;
                [q.x, q.y, d - h]
            })
            .collect();
        let low = middle - half - foot;
        let high = middle + half - foot;
        // h >= 0, then the four sides of the box: each a linear function of the three.
        let sides = [
            [0.0, 0.0, -1.0, d],
            [1.0, 0.0, -low.x, 0.0],
            [0.0, 1.0, -low.y, 0.0],
            [-1.0, 0.0, high.x, 0.0],
            [0.0, -1.0, high.y, 0.0],
        ];
        let shadow = sides.iter().fold(corners, |polygon, [x, y, w, one]| {
            let value = |p: &[f64; 3]| x * p[0] + y * p[1] + w * p[2] + one;
            cut(&polygon.iter().map(|p| (*p, value(p))).collect::<Vec<_>>())
        });
        if shadow.len() < 3 {
            continue;
        }
        let mut contour: Vec<_> =
            shadow.iter().map(|p| whole(foot + DVec2::new(p[0], p[1]) / p[2])).collect();
        if area(&contour) < 0.0 {
            contour.reverse();
        }
        overlay.add_contour(&contour, ShapeType::Clip);
    }
    let shapes = overlay.overlay(OverlayRule::Difference, FillRule::NonZero);
    let visible: f64 = shapes.iter().flatten().map(|c| area(c)).sum::<f64>() / (unit * unit);
    Areas { source: 0.5 * (source[1] - source[0]).perp_dot(source[2] - source[0]), visible }
}

/// The part of a convex polygon with values >= 0, corners given with their values.
fn cut<const N: usize>(polygon: &[([f64; N], f64)]) -> Vec<[f64; N]> {
    let mut out = vec![];
    for (i, &(p, fp)) in polygon.iter().enumerate() {
        let (q, fq) = polygon[(i + 1) % polygon.len()];
        if fp >= 0.0 {
            out.push(p);
        }
        if (fp < 0.0) != (fq < 0.0) && fp != 0.0 && fq != 0.0 {
            let t = fp / (fp - fq);
            out.push(std::array::from_fn(|k| p[k] + t * (q[k] - p[k])));
        }
    }
    out
}

/// Signed area of an integer contour; the products are exact.
fn area(contour: &[IntPoint<i64>]) -> f64 {
    let twice: i128 = (0..contour.len())
        .map(|i| {
            let (p, q) = (contour[i], contour[(i + 1) % contour.len()]);
            i128::from(p.x) * i128::from(q.y) - i128::from(p.y) * i128::from(q.x)
        })
        .sum();
    0.5 * twice as f64
}

/// Whether every height that decides something is either meant to be zero or clearly not zero.
pub fn decidable(sight: &Sight) -> bool {
    let clear = |height: f64| height.abs() < 0.01 * ON || height.abs() > 10.0 * ON;
    let (on, up) = plane(&sight.source);
    (sight.point - on).dot(up) > 10.0 * ON
        && sight.blockers.iter().all(|triangle| {
            let (corner, n) = plane(triangle);
            clear((sight.point - corner).dot(n))
                && triangle.iter().all(|&x| clear((x - on).dot(up)))
        })
}

fn plane(&[a, b, c]: &[DVec3; 3]) -> (DVec3, DVec3) {
    (a, (b - a).cross(c - a).normalize())
}

/// The most by which the library's visible area may differ from the oracle's, square metres.
///
/// The library treats values of the linear function N.(x - P), N = a x e, of the edge e that
/// begins at P + a as zero when shifts by tau could make them zero: up to tau |e| (|a| + R) for
/// shifts of x, P and the edge, R the largest distance from P to the source, and, for shifts of the
/// edge's ends against each other, 2 tau (|a| + |e|) R, but at most 1e-9 |N| R. On the source plane
/// that is a strip of half width w = their sum over |g| along the line, g the part of N in the
/// plane. What is given to the wrong side of a line lies in its strip, so its area is at most
/// 2 w D, D the source's longest edge. The scene given may differ from the exact one by another
/// tau a coordinate (the transform's roundings): once more the same. The occluder's plane and the
/// horizon are lines as well, with tau for the uncertainty.
///
/// Blockers that do not rise above the source plane, or whose plane holds the observer, cut
/// nothing. Those within 2e-6 radians of the observer's own surface may be left out: what they
/// shade is as near its horizon.
///
/// The oracle divides by the observer's height d above the source plane, which has lost
/// magnitude/d: sixteen roundings of that in its area.
pub fn allowance(sight: &Sight) -> f64 {
    const FLAT: f64 = 2e-6;
    const TURN: f64 = 1e-9;
    let [a, b, c] = sight.source;
    let (_, n) = plane(&sight.source);
    let everything = || sight.blockers.iter().chain([&sight.source]).flatten();
    let magnitude = everything().map(|x| x.abs().max_element()).fold(0.0, f64::max);
    let tau = 16.0 * (f64::EPSILON / 2.0) * magnitude;
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    let reach = sight.source.iter().map(|x| x.distance(sight.point)).fold(0.0, f64::max);
    let in_plane = |x: DVec3| (x - x.dot(n) * n).length();
    let mut width = tau / in_plane(sight.normal);
    for triangle in &sight.blockers {
        let (corner, normal) = plane(triangle);
        if (sight.point - corner).dot(normal).abs() <= tau
            || triangle.iter().all(|&x| (x - a).dot(n) <= tau)
        {
            continue;
        }
        width += (tau / in_plane(normal)).min(longest);
        if normal.cross(sight.normal).length() <= FLAT {
            width += 2.0 * FLAT * reach / in_plane(sight.normal);
        }
        for k in 0..3 {
            let (a, e) = (triangle[k] - sight.point, triangle[(k + 1) % 3] - triangle[k]);
            let turned = 2.0 * tau * (a.length() + e.length()) * reach;
            let uncertain = tau * e.length() * (a.length() + reach)
                + turned.min(TURN * a.cross(e).length() * reach);
            width += (uncertain / in_plane(a.cross(e))).min(longest);
        }
    }
    let d = (sight.point - a).dot(n);
    2.0 * 2.0 * width * longest + tau / d * longest * longest
}
