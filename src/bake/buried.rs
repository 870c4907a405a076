//! Parts of faces that nobody sees: below what stands on them, or inside of it.
//!
//! Faces are cut where others touch them, so that a root is buried as a whole or not at all. A dark
//! root is buried
//!
//! - when another face lies on it, facing it: the bottom of a block on the floor; or
//! - when all that it sees is backs that do not radiate: the floor inside of a block that is sunk
//!   in it, or that has no bottom.
//!
//! Its texels have no light of their own. Were they black, the black would be filtered into what is
//! beside the block.

use glam::DVec3;
use rayon::prelude::*;

use crate::error::Result;
use crate::monitor::Monitor;
use crate::operator::Walker;
use crate::reconstruct::Surface;
use crate::solve::Light;

/// Directions in which a root looks.
const DIRECTIONS: u32 = 32;

/// Roots with more light than this share of the mean are not dark.
const DARK: f64 = 1e-4;

/// Which of the roots asked for are buried; others are not looked at.
pub(super) fn buried(
    surface: &Surface,
    light: &Light,
    asked: &[bool],
    mean: f64,
    monitor: &Monitor,
) -> Result<Vec<bool>> {
    let stage = monitor.stage("look", asked.len() as u64);
    asked
        .par_iter()
        .enumerate()
        .map_init(Walker::default, |walker, (root, asked)| {
            stage.advance(1)?;
            Ok(*asked && is_buried(surface, light, root, mean, walker))
        })
        .collect()
}

fn is_buried(
    surface: &Surface,
    light: &Light,
    root: usize,
    mean: f64,
    walker: &mut Walker,
) -> bool {
    let mesh = &light.mesh;
    let face = &mesh.faces[mesh.roots[root].face as usize];
    let [a, b, c] = mesh.roots[root].corners;
    let (point, n) = (face.frame.lift((a + b + c) / 3.0), face.frame.n);
    let touching = mesh.contact;
    let above = point + 2.0 * touching * n;
    let hides =
        |direction: DVec3| surface.cast(above, direction).is_some_and(|met| met.face.is_none());
    let covered = surface.is_faced(point, n, touching, face.triangle);
    let enclosed = || (0..DIRECTIONS).all(|k| hides(direction(k, n)));
    (covered || enclosed()) && light.irradiance(walker, point, n).max_element() <= DARK * mean
}

/// Direction `k`, evenly over the hemisphere of `n` but for the lowest tenth.
fn direction(k: u32, n: DVec3) -> DVec3 {
    const GOLDEN: f64 = 2.399_963_229_728_653;
    let (u, v) = n.any_orthonormal_pair();
    let height = 0.1 + 0.9 * (f64::from(k) + 0.5) / f64::from(DIRECTIONS);
    let (sin, cos) = (GOLDEN * f64::from(k)).sin_cos();
    height * n + (1.0 - height * height).sqrt() * (cos * u + sin * v)
}
