//! Rays of a camera through the samples of its pixels.

use glam::DVec3;

use crate::scene::{Camera, Projection};

/// A sample's ray, and those of its neighbours one sample to the right and below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it begins.
    pub origin: DVec3,
    /// Its direction (unit depth along the camera's axis, so not of unit length).
    pub direction: DVec3,
    /// Origin and direction of the ray one sample to the right.
    pub right: (DVec3, DVec3),
    /// Origin and direction of the ray one sample down.
    pub down: (DVec3, DVec3),
}

/// Rays of one picture.
#[derive(Clone, Debug)]
pub struct CameraRays {
    camera: Camera,
    width: f64,
    height: f64,
    /// Samples along each side of a pixel.
    pub samples: u32,
    /// Half width and half height of the view at unit depth, or in metres.
    half: (f64, f64),
}

impl CameraRays {
    /// A picture of `width` x `height` pixels. The vertical extent of the view is the camera's;
    /// the horizontal one follows from the shape of the picture.
    pub fn new(camera: &Camera, width: u32, height: u32, samples: u32) -> CameraRays {
        let aspect = f64::from(width) / f64::from(height);
        let half_height = match camera.projection {
            Projection::Perspective { vertical_fov, .. } => (0.5 * vertical_fov).tan(),
            Projection::Orthographic { half_height, .. } => half_height,
        };
        CameraRays {
            camera: camera.clone(),
            width: f64::from(width),
            height: f64::from(height),
            samples,
            half: (half_height * aspect, half_height),
        }
    }

    /// The ray through sample (i, j) of pixel (x, y); both count from the top left.
    pub fn sample(&self, x: u32, y: u32, i: u32, j: u32) -> Ray {
        let place = |offset_x: f64, offset_y: f64| {
            let n = f64::from(self.samples);
            let u = f64::from(x) + (f64::from(i) + 0.5 + offset_x) / n;
            let v = f64::from(y) + (f64::from(j) + 0.5 + offset_y) / n;
            self.ray(
                (2.0 * u / self.width - 1.0) * self.half.0,
                (1.0 - 2.0 * v / self.height) * self.half.1,
            )
        };
        let (origin, direction) = place(0.0, 0.0);
        Ray { origin, direction, right: place(1.0, 0.0), down: place(0.0, 1.0) }
    }

    /// The ray through the point (x, y) of the picture plane, x to the right, y up.
    fn ray(&self, x: f64, y: f64) -> (DVec3, DVec3) {
        let Camera { eye, right, up, forward, projection, .. } = &self.camera;
        match projection {
            Projection::Perspective { .. } => (*eye, *forward + x * *right + y * *up),
            Projection::Orthographic { .. } => (*eye + x * *right + y * *up, *forward),
        }
    }
}
