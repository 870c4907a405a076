//! Orthonormal frames of planes: all integrals and clips run in two coordinates.

use glam::{DVec2, DVec3};

/// A plane with coordinates: x = origin + p.x u + p.y v + h n, with n = u x v.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Point of the plane.
    pub origin: DVec3,
    /// First axis in the plane.
    pub u: DVec3,
    /// Second axis in the plane.
    pub v: DVec3,
    /// Unit normal.
    pub n: DVec3,
}

impl Frame {
    /// Frame with the given origin and unit normal.
    ///
    /// The first axis is the projection of the coordinate axis least along the normal, so that
    /// planes parallel to coordinate planes get exact axes and no coordinate is rounded.
    pub fn new(origin: DVec3, n: DVec3) -> Frame {
        let size = n.abs();
        let axis = if size.x <= size.y && size.x <= size.z {
            DVec3::X
        } else if size.y <= size.z {
            DVec3::Y
        } else {
            DVec3::Z
        };
        let u = (axis - axis.dot(n) * n).normalize();
        let v = n.cross(u);
        Frame { origin, u, v, n }
    }

    /// Frame of a triangle, normal by the right-hand rule; `None` when it has no area.
    ///
    /// The normal is perpendicular to the longest edge to a rounding, however thin the triangle is:
    /// its corners lie in the plane, and so do the corners of its neighbours in the same plane. (A
    /// cross product of two edges leaves one rounding over the sine of their angle.)
    pub fn of_triangle(t: &[DVec3; 3]) -> Option<Frame> {
        let edges = [t[1] - t[0], t[2] - t[1], t[0] - t[2]];
        // Scaled first, so that tiny and huge triangles neither underflow nor overflow.
        let size = edges.iter().map(|e| e.abs().max_element()).fold(0.0, f64::max);
        if !(size > 0.0 && size.is_finite()) {
            return None;
        }
        let [e0, e1, e2] = edges.map(|e| e / size);
        let (l0, l1, l2) = (e0.length_squared(), e1.length_squared(), e2.length_squared());
        let (longest, next) = if l0 >= l1 && l0 >= l2 {
            (e0, e1)
        } else if l1 >= l2 {
            (e1, e2)
        } else {
            (e2, e0)
        };
        let along = longest.normalize();
        let n = along.cross(next - along.dot(next) * along);
        let length = n.length();
        // Divided, not multiplied by a reciprocal: the normals of planes parallel to coordinate
        // planes come out exact.
        (length > 0.0).then(|| Frame::new(t[0], n / length))
    }

    /// Coordinates of the foot of `x` on the plane.
    pub fn project(&self, x: DVec3) -> DVec2 {
        let r = x - self.origin;
        DVec2::new(r.dot(self.u), r.dot(self.v))
    }

    /// The point with coordinates `p` on the plane.
    pub fn lift(&self, p: DVec2) -> DVec3 {
        self.origin + p.x * self.u + p.y * self.v
    }

    /// Signed distance of `x` from the plane, positive on the normal's side.
    pub fn height(&self, x: DVec3) -> f64 {
        (x - self.origin).dot(self.n)
    }
}
