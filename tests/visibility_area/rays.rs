//! Visibility decided point by point, with every triangle tested.

use glam::DVec3;

use super::scenes::Sight;

/// What is known of the line from the observer to a point of the source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// It meets no blocker, by a margin.
    Free,
    /// It passes through the inside of a blocker, by a margin.
    Blocked,
    /// It passes a boundary more closely than the margin.
    Grazing,
}

/// Share of a blocker's size, of its height and of the line's length within which a line grazes.
const MARGIN: f64 = 1e-7;

/// Share of the size below which heights are meant to be zero.
const ON: f64 = 1e-10;

/// Tests the line from the observer to `x` against every blocker, but for those in the plane of
/// the observer or of the source.
pub fn line(sight: &Sight, x: DVec3) -> Line {
    let [s0, s1, s2] = sight.source;
    let up = (s1 - s0).cross(s2 - s0).normalize();
    let size = (sight.point - x).length().max((s1 - s0).length());
    let mut answer = Line::Free;
    for [a, b, c] in &sight.blockers {
        let (e1, e2) = (b - a, c - a);
        let n = e1.cross(e2);
        let unit = n.normalize();
        let (from, to) = ((sight.point - a).dot(unit), (x - a).dot(unit));
        let beneath = [a, b, c].iter().all(|&&w| (w - s0).dot(up) <= ON * size);
        if from.abs() <= ON * size || beneath {
            continue;
        }
        let slack = MARGIN * size;
        if from.min(to) > slack || from.max(to) < -slack {
            continue;
        }
        let t = from / (from - to);
        let y = sight.point + t * (x - sight.point) - a;
        let (w1, w2) = (y.cross(e2).dot(n), e1.cross(y).dot(n));
        let least = w1.min(w2).min(n.length_squared() - w1 - w2) / n.length_squared();
        if from.abs().min(to.abs()) > slack && from * to < 0.0 && least > MARGIN {
            return Line::Blocked;
        }
        if least.is_nan() || least >= -MARGIN {
            answer = Line::Grazing;
        }
    }
    answer
}

/// Point `i` of a lattice that fills a triangle evenly (Roberts 2018: multiples of the powers of
/// the plastic number, folded), as weights of the second and third corner.
pub fn lattice(i: usize) -> (f64, f64) {
    const G: f64 = 1.324_717_957_244_746;
    let (s, t) = ((0.5 + i as f64 / G).fract(), (0.5 + i as f64 / (G * G)).fract());
    if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) }
}
