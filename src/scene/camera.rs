//! Views of a scene.

use glam::DVec3;

use crate::error::{Error, Result};

/// A view of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the file, or one made from its place there.
    pub name: String,
    /// Position of the eye, metres.
    pub eye: DVec3,
    /// Unit vector to the right of the picture.
    pub right: DVec3,
    /// Unit vector to the top of the picture.
    pub up: DVec3,
    /// Unit vector into the picture.
    pub forward: DVec3,
    /// How points are projected.
    pub projection: Projection,
}

/// Projection of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Rays leave from the eye.
    Perspective {
        /// Full vertical field of view, radians, in (0, pi).
        vertical_fov: f64,
        /// Width over height, where the file fixes it.
        aspect: Option<f64>,
    },
    /// Rays are parallel to the forward direction.
    Orthographic {
        /// Half width of the view, metres.
        half_width: f64,
        /// Half height of the view, metres.
        half_height: f64,
    },
}

/// A perspective camera at `eye` that looks at `target`, with `up` as near to the top of the
/// picture as can be. `vertical_fov` is the full angle in radians.
///
/// # Errors
///
/// [`Error::Usage`] when a number is not finite, the eye is at the target, `up` is zero or along
/// the view (an angle below 1e-9), or the field of view is not in (0, pi).
pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, vertical_fov: f64) -> Result<Camera> {
    if !(eye.is_finite() && target.is_finite() && up.is_finite()) {
        return Err(Error::Usage("camera: eye, target and up must be finite".into()));
    }
    if !(vertical_fov > 0.0 && vertical_fov < std::f64::consts::PI) {
        return Err(Error::Usage(format!(
            "camera: the vertical field of view must be between 0 and 180 degrees, not {}",
            vertical_fov.to_degrees()
        )));
    }
    let forward = (target - eye)
        .try_normalize()
        .ok_or_else(|| Error::Usage("camera: the eye is at the target".into()))?;
    let right = forward.cross(up.normalize_or_zero());
    if right.length() < 1e-9 {
        return Err(Error::Usage(
            "camera: the up direction is zero or along the view; choose another".into(),
        ));
    }
    let right = right.normalize();
    Ok(Camera {
        name: "look at".into(),
        eye,
        right,
        up: right.cross(forward),
        forward,
        projection: Projection::Perspective { vertical_fov, aspect: None },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_right_handed() {
        let c = look_at(DVec3::new(0.0, 1.0, 5.0), DVec3::new(0.0, 1.0, 0.0), DVec3::Y, 1.0);
        let c = c.unwrap();
        assert!((c.forward - DVec3::NEG_Z).length() < 1e-15);
        assert!((c.right - DVec3::X).length() < 1e-15);
        assert!((c.up - DVec3::Y).length() < 1e-15);
    }

    #[test]
    fn impossible_views_are_usage_errors() {
        let bad = [
            look_at(DVec3::ZERO, DVec3::ZERO, DVec3::Y, 1.0),
            look_at(DVec3::ZERO, DVec3::Y, DVec3::Y, 1.0),
            look_at(DVec3::ZERO, DVec3::X, DVec3::ZERO, 1.0),
            look_at(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0),
            look_at(DVec3::ZERO, DVec3::X, DVec3::Y, f64::NAN),
            look_at(DVec3::NAN, DVec3::X, DVec3::Y, 1.0),
        ];
        for result in bad {
            assert!(matches!(result, Err(Error::Usage(_))));
        }
    }
}
