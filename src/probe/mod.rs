//! Values at points: irradiance gathered exactly there, radiosity of the surface there.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::operator::walk::Walker;
use crate::output::csv::{Point, ProbeResult};
use crate::reconstruct::Surface;
use crate::scene::{self, Scene};
use crate::solve::Light;

/// A point belongs to a surface within this share of the scene's size.
const ON_SURFACE: f64 = 1e-6;

/// Irradiance (W/m^2) at each point and normal, and radiosity of the surface there.
///
/// A point that lies on a surface but for `ON_SURFACE`, and behind it, is moved onto it: its own
/// surface does not shade it. Radiosity is E + rho H with the surface's own normal. When time runs out
/// the points that have been looked at keep their values, and the others have none.
pub fn probe(
    scene: &Scene,
    light: &Light,
    points: &[Point],
    monitor: &Monitor,
) -> Result<Vec<ProbeResult>> {
    let surface = Surface::new(scene, &light.mesh);
    let tolerance = ON_SURFACE * light.mesh.bounds.extent();
    let stage = monitor.stage("probe", points.len() as u64);
    points
        .par_iter()
        .map_init(Walker::default, |walker, p| {
            match stage.advance(1) {
                Err(Error::TimeLimit(_)) => {
                    return Ok(ProbeResult { irradiance: None, radiosity: None });
                }
                other => other?,
            }
            let foot = surface.at(p.position, p.normal, tolerance);
            let Some(foot) = foot else {
                let irradiance = light.irradiance(walker, p.position, p.normal);
                return Ok(ProbeResult { irradiance: Some(irradiance), radiosity: None });
            };
            let face = &light.mesh.faces[foot.face as usize];
            let at = if foot.height < 0.0 { face.frame.lift(foot.x) } else { p.position };
            let irradiance = light.irradiance(walker, at, p.normal);
            let own = if p.normal.distance(face.frame.n) <= 1e-9 {
                irradiance
            } else {
                light.irradiance(walker, at, face.frame.n)
            };
            let w = face.triangle_weights(foot.x);
            let triangle = face.triangle as usize;
            let radiosity = scene::exitance(scene, triangle, &[w; 3])
                + scene::reflectance(scene, triangle, &[w; 3]) * own;
            Ok(ProbeResult { irradiance: Some(irradiance), radiosity: Some(radiosity) })
        })
        .collect()
}
