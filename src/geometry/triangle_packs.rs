//! Which of four triangles a ray may meet, in f32: most are told to be missed at once.
//!
//! Corners relative to the ray's origin are sheared so that the ray runs along an axis (Woop, Benthin
//! and Wald 2013, "Watertight ray/triangle intersection"); the signs of three areas in the plane across
//! it tell on which side of the edges it passes. Areas within their roundings of zero have either
//! sign, so nothing is missed that [`super::ray::intersect`], which decides, would meet.

use glam::{DVec3, Vec4};

/// Triangles of a pack.
pub const PACK: usize = 4;

/// What roundings can make of a sheared coordinate, in a scene scaled to the cube from -1 to 1 and seen
/// from inside of it: 2^-24 times 2 for each corner, for the origin, for their difference, and 12 for the
/// product with the shear and what is subtracted; half as much again for products in areas.
const OFF: f32 = 3e-6;

/// Up to four triangles.
#[derive(Clone, Copy)]
pub struct Pack {
    /// By corner and axis those of all triangles, scaled.
    corners: [[Vec4; 3]; 3],
    /// A bit for each triangle that is there.
    there: u32,
}

/// A ray as packs are met by it.
pub struct Sheared {
    /// The axis that the ray runs along most, the two others, and whether it runs up.
    axes: [usize; 3],
    up: bool,
    /// The origin by `axes`, scaled.
    origin: [Vec4; 3],
    /// What one step along the first axis moves the ray along the others.
    shear: [Vec4; 2],
    /// Distance along the first axis for a distance along the ray.
    along: f32,
    /// See [`OFF`].
    off: f32,
}

impl Pack {
    /// One to four triangles, scaled.
    pub fn new(triangles: &[[DVec3; 3]]) -> Pack {
        let mut corners = [[Vec4::ZERO; 3]; 3];
        for (k, triangle) in triangles.iter().enumerate() {
            for (of_corner, corner) in corners.iter_mut().zip(triangle) {
                for (of_axis, x) in of_corner.iter_mut().zip(corner.as_vec3().to_array()) {
                    of_axis[k] = x;
                }
            }
        }
        Pack { corners, there: (1 << triangles.len()) - 1 }
    }
}

impl Sheared {
    /// A ray from a scaled origin; `direction` is scaled likewise: distances are in units of it.
    pub fn new(origin: DVec3, direction: DVec3) -> Sheared {
        let first = direction.abs().max_position();
        let axes = [first, (first + 1) % 3, (first + 2) % 3];
        let d = axes.map(|axis| direction[axis]);
        let shear = [d[1] / d[0], d[2] / d[0]].map(|s| Vec4::splat(s as f32));
        Sheared {
            axes,
            up: d[0] > 0.0,
            origin: axes.map(|axis| Vec4::splat(origin[axis] as f32)),
            shear,
            along: d[0].abs() as f32,
            off: OFF * origin.abs().max_element().max(1.0) as f32,
        }
    }

    /// A bit for each triangle of a pack that may be met before `end`, in units of the direction.
    #[inline]
    pub fn may_meet(&self, pack: &Pack, end: f32) -> u32 {
        let [first, second, third] = self.axes;
        let sheared = |corner: &[Vec4; 3]| {
            let height = corner[first] - self.origin[0];
            let x = (corner[second] - self.origin[1]) - self.shear[0] * height;
            let y = (corner[third] - self.origin[2]) - self.shear[1] * height;
            (x, y, if self.up { height } else { -height })
        };
        let [a, b, c] = &pack.corners;
        let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (sheared(a), sheared(b), sheared(c));
        let (u, v, w) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
        let sizes = (ax.abs() + ay.abs()) + (bx.abs() + by.abs()) + (cx.abs() + cy.abs());
        let off = Vec4::splat(self.off) * (sizes + Vec4::splat(self.off));
        let aside = u.min(v).min(w).cmplt(-off) & u.max(v).max(w).cmpgt(off);
        let behind = az.max(bz).max(cz).cmplt(Vec4::splat(-self.off));
        let beyond = az.min(bz).min(cz).cmpgt(Vec4::splat(end * self.along + self.off));
        !(aside | behind | beyond).bitmask() & pack.there
    }
}

#[cfg(test)]
mod tests {
    use super::super::ray;
    use super::*;

    /// Numbers from -1 to 1 that a simple recurrence scatters.
    fn scattered() -> impl FnMut() -> f64 {
        let mut x = 0.3f64;
        move || {
            x = (x * 997.0 + 0.618_033_988_749).fract();
            2.0 * x - 1.0
        }
    }

    #[test]
    fn nothing_is_missed_and_little_is_kept() {
        let mut next = scattered();
        let mut point = |size: f64| DVec3::new(size * next(), size * next(), size * next());
        let (mut hits, mut kept) = (0, 0);
        for size in [1.0, 0.1, 1e-2, 1e-4, 1e-7, 1e-12] {
            for _ in 0..400 {
                let triangles: [[DVec3; 3]; 4] = std::array::from_fn(|_| {
                    let (a, b) = (point(1.0 - size), point(size));
                    // Slivers among them.
                    [a, a + b, a + 0.5 * b + point(size * size)]
                });
                let pack = Pack::new(&triangles);
                let origin = point(1.0);
                for [a, b, c] in triangles {
                    let (to_edge, to_inner) = (a.midpoint(b), (a + b + c) / 3.0);
                    for to in [a, to_edge, to_inner, to_edge + 1e-6 * point(1.0), point(1.0)] {
                        let direction = (to - origin) * 1e-3;
                        let hit = |t: &[DVec3; 3]| ray::intersect(origin, direction, t);
                        let own = triangles.each_ref().map(hit);
                        let ray = Sheared::new(origin, direction);
                        for end in [f32::INFINITY, 1500.0, 700.0] {
                            let may = ray.may_meet(&pack, end);
                            for (k, hit) in own.iter().enumerate() {
                                let met = hit.is_some_and(|h| h.t > 0.0 && h.t < f64::from(end));
                                assert!(!met || may >> k & 1 == 1, "{triangles:?} {origin} {to}");
                                hits += usize::from(met && size > 1e-3);
                            }
                            // Slivers as thin as roundings are kept.
                            kept += if size > 1e-3 { may.count_ones() as usize } else { 0 };
                        }
                    }
                }
            }
        }
        assert!(hits > 5_000, "{hits}");
        assert!(kept < 2 * hits, "{kept} kept, {hits} met");
    }
}
