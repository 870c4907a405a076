//! Solving (I - K) u = E: restarted GMRES, three colours in one product.

mod gmres;
pub mod light;

use glam::DVec3;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::monitor::Monitor;

pub use gmres::gmres;
pub use light::{Light, LightOptions};

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveOptions {
    /// Stop when ||E - (I - K) u|| <= residual ||E|| (2-norm over the nodes) in every channel.
    pub residual: f64,
    /// Give up after this many products with K.
    pub most_iterations: usize,
}

impl Default for SolveOptions {
    fn default() -> Self {
        SolveOptions { residual: 1e-8, most_iterations: 1000 }
    }
}

/// Radiosities and irradiances at the nodes, W/m^2 per channel.
#[derive(Clone, Debug)]
pub struct Solution {
    /// u at the nodes.
    pub radiosity: Vec<DVec3>,
    /// H = 1/pi int u G V at the nodes.
    pub irradiance: Vec<DVec3>,
    /// Relative residual reached, per channel.
    pub residual: DVec3,
    /// Products with K that were needed.
    pub iterations: usize,
}

/// Solves u - rho/pi A u = E.
///
/// `apply(u, out)` computes out = A u; `reflectance` and `exitance` hold rho and E at the nodes.
/// [`Error::NotConverged`] when the tolerance is not reached, never a silent result.
pub fn solve(
    apply: &(dyn Fn(&[DVec3], &mut [DVec3]) + Sync),
    reflectance: &[DVec3],
    exitance: &[DVec3],
    options: &SolveOptions,
    monitor: &Monitor,
) -> Result<Solution> {
    let reflect = |u: &[DVec3], out: &mut [DVec3]| {
        apply(u, out);
        out.par_iter_mut().zip(reflectance).zip(u).for_each(|((out, rho), u)| {
            *out = u - *rho / std::f64::consts::PI * *out;
        });
    };
    let (radiosity, residual, iterations) = gmres(&reflect, exitance, options, monitor)?;
    // What is not a number has not converged either.
    let converged = residual.max_element() <= options.residual;
    if !converged {
        return Err(Error::NotConverged {
            residual: residual.max_element(),
            iterations,
            tolerance: options.residual,
        });
    }
    let mut irradiance = vec![DVec3::ZERO; radiosity.len()];
    apply(&radiosity, &mut irradiance);
    irradiance.par_iter_mut().for_each(|h| *h /= std::f64::consts::PI);
    Ok(Solution { radiosity, irradiance, residual, iterations })
}
