//! The two camera matrices of an OpenEXR file.
//!
//! Conventions of OpenEXR: points are *row* vectors, p' = p M, and M is stored row by row, so the
//! translation stands in elements 12 to 14.
//!
//! - `worldToCamera`: camera space is left-handed, x to the right, y up, z into the picture.
//! - `worldToNDC`: (0, 0) is the upper left and (1, 1) the lower right corner of the picture
//!   after division by the last coordinate; z is not normalised (it is the depth for an
//!   orthographic and the constant 1 for a perspective view) and is to be ignored.

use glam::{DMat4, DVec4};

use crate::scene::{Camera, Projection};

/// Where a picture was seen from, as OpenEXR writes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraMatrices {
    /// World to camera space, row by row, for row vectors.
    pub world_to_camera: [f32; 16],
    /// World to picture coordinates in [0, 1]^2, row by row, for row vectors.
    pub world_to_ndc: [f32; 16],
}

impl CameraMatrices {
    /// The matrices of `camera` for a picture whose width is `aspect` times its height.
    ///
    /// A perspective camera keeps its vertical field of view and an orthographic one its half
    /// height; the width follows from `aspect`.
    pub fn of(camera: &Camera, aspect: f64) -> CameraMatrices {
        // glam multiplies column vectors and stores columns; its array is therefore, read row
        // by row, the transposed matrix: just the one for row vectors.
        let (x, y, z) = (camera.right, camera.up, camera.forward);
        let rotation = DMat4::from_cols(
            DVec4::new(x.x, y.x, z.x, 0.0),
            DVec4::new(x.y, y.y, z.y, 0.0),
            DVec4::new(x.z, y.z, z.z, 0.0),
            DVec4::W,
        );
        let world_to_camera = rotation * DMat4::from_translation(-camera.eye);
        let to_ndc = match camera.projection {
            Projection::Perspective { vertical_fov, .. } => {
                let half = (0.5 * vertical_fov).tan();
                // x' = 1/2 + x / (2 half aspect z), y' = 1/2 - y / (2 half z)
                DMat4::from_cols(
                    DVec4::new(0.5 / (half * aspect), 0.0, 0.0, 0.0),
                    DVec4::new(0.0, -0.5 / half, 0.0, 0.0),
                    DVec4::new(0.5, 0.5, 1.0, 1.0),
                    DVec4::ZERO,
                )
            }
            Projection::Orthographic { half_height, .. } => DMat4::from_cols(
                DVec4::new(0.5 / (half_height * aspect), 0.0, 0.0, 0.0),
                DVec4::new(0.0, -0.5 / half_height, 0.0, 0.0),
                DVec4::Z,
                DVec4::new(0.5, 0.5, 0.0, 1.0),
            ),
        };
        CameraMatrices {
            world_to_camera: world_to_camera.to_cols_array().map(|v| v as f32),
            world_to_ndc: (to_ndc * world_to_camera).to_cols_array().map(|v| v as f32),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn row_times(p: DVec3, m: &[f32; 16]) -> [f64; 4] {
        let p = [p.x, p.y, p.z, 1.0];
        std::array::from_fn(|j| (0..4).map(|i| p[i] * f64::from(m[4 * i + j])).sum())
    }

    fn camera(projection: Projection) -> Camera {
        // Looking along -z of the world, turned by 90 degrees about y: right is -z, forward -x.
        Camera {
            name: "c".into(),
            eye: DVec3::new(5.0, 1.0, 2.0),
            right: DVec3::NEG_Z,
            up: DVec3::Y,
            forward: DVec3::NEG_X,
            projection,
        }
    }

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-6, "{a} is not {b}");
    }

    #[test]
    fn camera_space_has_x_right_y_up_z_forward_from_the_eye() {
        let c = camera(Projection::Perspective { vertical_fov: 1.0, aspect: None });
        let m = CameraMatrices::of(&c, 1.5).world_to_camera;
        let p = row_times(c.eye + 3.0 * c.forward + 0.5 * c.up - 0.25 * c.right, &m);
        [-0.25, 0.5, 3.0, 1.0].iter().zip(p).for_each(|(want, got)| close(got, *want));
    }

    #[test]
    fn corners_of_the_view_are_corners_of_the_picture() {
        let fov = 0.9_f64;
        let aspect = 1.5;
        for (projection, half, depths) in [
            (
                Projection::Perspective { vertical_fov: fov, aspect: None },
                (0.5 * fov).tan(),
                [0.5, 7.0],
            ),
            (Projection::Orthographic { half_width: 9.0, half_height: 2.0 }, 2.0, [0.0, 0.0]),
        ] {
            let c = camera(projection);
            let m = CameraMatrices::of(&c, aspect).world_to_ndc;
            for depth in depths {
                let scale = if depth == 0.0 { 1.0 } else { depth };
                let middle = c.eye + depth * c.forward;
                for (sx, sy, u, v) in [(-1.0, 1.0, 0.0, 0.0), (1.0, -1.0, 1.0, 1.0)] {
                    let p = middle + scale * half * (sx * aspect * c.right + sy * c.up);
                    let q = row_times(p, &m);
                    close(q[0] / q[3], u);
                    close(q[1] / q[3], v);
                }
            }
        }
    }
}
