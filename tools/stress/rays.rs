//! A slower, independent computation: every ray tested against every triangle.
//!
//! It shares nothing with the solver but the triangles: no planes, no tree, no clipping, no closed
//! form, and its own directions. Irradiance is the mean of the radiosity that rays meet, over a lattice of
//! directions of density cos/pi (Roberts 2018: multiples of the powers of the plastic number).

use glam::DVec3;
use lumel::scene::Scene;

/// Steps of the lattice.
const STEPS: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_3];

/// What a point sees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Mean radiosity over the hemisphere: irradiance.
    pub irradiance: f64,
    /// Share of the hemisphere that is filled by sides that radiate.
    pub radiant: f64,
    /// Share that is filled by black backs, whatever lies on them.
    pub black: f64,
}

/// Looks around at a point with a unit normal along `count` rays, which begin `lift` metres ahead;
/// `radiosity` is that of all sides that radiate, at a place.
pub fn look(
    scene: &Scene,
    point: DVec3,
    normal: DVec3,
    count: usize,
    lift: f64,
    radiosity: impl Fn(DVec3) -> f64,
) -> Seen {
    let u = normal.any_orthonormal_vector();
    let v = normal.cross(u);
    let mut seen = Seen::default();
    for k in 0..count {
        let [s, t] = STEPS.map(|step| (0.5 + step * (k + 1) as f64).fract());
        let (sin, cos) = (std::f64::consts::TAU * t).sin_cos();
        let direction = s.sqrt() * (cos * u + sin * v) + (1.0 - s).sqrt() * normal;
        let Some(met) = nearest(scene, point + lift * normal, direction) else {
            continue;
        };
        seen.black += f64::from(u8::from(met.black));
        if met.radiates {
            seen.radiant += 1.0;
            seen.irradiance += radiosity(point + met.distance * direction);
        }
    }
    let share = 1.0 / count as f64;
    Seen {
        irradiance: share * seen.irradiance,
        radiant: share * seen.radiant,
        black: share * seen.black,
    }
}

/// Distances that differ by less than this share are those of faces that lie on each other: neither
/// hides the other.
const TIE: f64 = 1e-12;

/// What a ray meets first.
#[derive(Clone, Copy)]
struct Met {
    distance: f64,
    /// Whether there is a side that radiates, and one that does not: both where faces lie on each
    /// other.
    radiates: bool,
    black: bool,
}

/// The nearest triangles along a ray (Moeller & Trumbore 1997).
fn nearest(scene: &Scene, origin: DVec3, direction: DVec3) -> Option<Met> {
    let mut best: Option<Met> = None;
    for t in &scene.triangles {
        let Some((distance, least)) = plane_of(&t.vertices, origin, direction) else { continue };
        let nearest = best.map_or(f64::INFINITY, |b| b.distance);
        if least < 0.0 || distance <= 0.0 || distance > nearest * (1.0 + TIE) {
            continue;
        }
        let two_sided = scene.materials[t.material as usize].two_sided;
        let front = two_sided || t.normal_and_area().0.dot(direction) < 0.0;
        let tied = best.filter(|b| distance > b.distance * (1.0 - TIE));
        best = Some(Met {
            distance,
            radiates: front || tied.is_some_and(|b| b.radiates),
            black: !front || tied.is_some_and(|b| b.black),
        });
    }
    best
}

/// Distance along a ray to the plane of a triangle in units of `direction`, and the least barycentric
/// weight there.
fn plane_of(t: &[DVec3; 3], origin: DVec3, direction: DVec3) -> Option<(f64, f64)> {
    let (e1, e2) = (t[1] - t[0], t[2] - t[0]);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let from = origin - t[0];
    let q = from.cross(e1);
    let (b, c) = (from.dot(p) / determinant, direction.dot(q) / determinant);
    Some((e2.dot(q) / determinant, b.min(c).min(1.0 - b - c)))
}

/// Whether two points see each other: `None` where the line between them passes the rim of a
/// triangle, or begins or ends near its plane, by less than `margin` metres. Planes within `rounding`
/// of an end are those that it lies on.
pub fn sees(scene: &Scene, a: DVec3, b: DVec3, margin: f64, rounding: f64) -> Option<bool> {
    let mut free = Some(true);
    let (direction, length) = (b - a, a.distance(b));
    for t in &scene.triangles {
        let Some((along, least)) = plane_of(&t.vertices, a, direction) else { continue };
        let (normal, area) = t.normal_and_area();
        let slope = (direction.dot(normal) / length).abs();
        // The least height of the triangle in metres, and how far along the line that is.
        let [p, q, r] = t.vertices;
        let longest = p.distance(q).max(q.distance(r)).max(r.distance(p));
        let height = 2.0 * area / longest;
        let rim = margin / (height * slope.max(1e-9));
        let ends = margin / (length * slope.max(1e-9));
        if least < -rim || along < -ends || along > 1.0 + ends {
            continue;
        }
        let lies_on = |x: DVec3| (x - p).dot(normal).abs() <= rounding;
        // What the line begins or ends on does not stop it.
        if lies_on(a) && along.abs() <= ends || lies_on(b) && (along - 1.0).abs() <= ends {
            if slope > 1e-3 {
                continue;
            }
            free = None;
        } else if least > rim && along > ends && along < 1.0 - ends {
            return Some(false);
        } else {
            free = None;
        }
    }
    free
}
