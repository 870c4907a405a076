//! Solving (I - K) u = E: restarted GMRES, all colours in one product.

pub mod apart;
mod balance;
mod colours;
pub mod direct;
mod gmres;
pub mod levels;
pub mod light;
pub mod many;
pub mod missed;
pub mod samples;
pub mod within;

use glam::DVec3;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::operator::Operator;

pub use colours::Colours;
pub use gmres::gmres;
pub use light::{ApartSource, Light, LightOptions, RaySource, Reflected};
pub use within::{Estimate, Way, WithinOptions, light_within};

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

impl SolveOptions {
    /// The same for light of about `mean` at most places, W/m^2: where a few nodes `sent` much more,
    /// residuals relative to that would leave all the others unsolved.
    pub fn relative_to(
        self,
        mean: DVec3,
        sent: impl ExactSizeIterator<Item = DVec3>,
    ) -> SolveOptions {
        let nodes = sent.len().max(1) as f64;
        let squares: DVec3 = sent.map(|b| b * b).sum();
        let rms = (squares / nodes).map(f64::sqrt);
        let share = DVec3::select(rms.cmpgt(mean), mean / rms, DVec3::ONE);
        let shares = share.to_array().into_iter().filter(|share| *share > 0.0);
        let residual = self.residual * shares.fold(1.0, f64::min);
        SolveOptions { residual: residual.max(LEAST_RESIDUAL), ..self }
    }
}

/// Residuals below this are roundings.
pub const LEAST_RESIDUAL: f64 = 1e-13;

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
    /// Channels that were solved for: fewer than three where some are dark or equal.
    pub channels: usize,
}

/// Solves u - rho/pi A u = E.
///
/// `reflectance` and `exitance` hold rho and E at the nodes. Channels that are dark, or equal to
/// another one (up to a factor in E), are not solved for again ([`Colours`]); `guess` is where the
/// iteration starts. [`Error::NotConverged`] when the tolerance is not reached, never a silent
/// result.
pub fn solve(
    operator: &Operator,
    reflectance: &[DVec3],
    exitance: &[DVec3],
    guess: Option<&[DVec3]>,
    options: &SolveOptions,
    monitor: &Monitor,
) -> Result<Solution> {
    let colours = Colours::of(reflectance, exitance);
    let problem = Problem { operator, reflectance, exitance, guess, colours: &colours };
    match colours.solved.len() {
        0 => problem.dark(),
        1 => problem.solve::<1>(options, monitor),
        2 => problem.solve::<2>(options, monitor),
        _ => problem.solve::<3>(options, monitor),
    }
}

struct Problem<'a> {
    operator: &'a Operator<'a>,
    reflectance: &'a [DVec3],
    exitance: &'a [DVec3],
    guess: Option<&'a [DVec3]>,
    colours: &'a Colours,
}

impl Problem<'_> {
    fn dark(&self) -> Result<Solution> {
        let zero = vec![DVec3::ZERO; self.exitance.len()];
        Ok(Solution {
            radiosity: zero.clone(),
            irradiance: zero,
            residual: DVec3::ZERO,
            iterations: 0,
            channels: 0,
        })
    }

    fn solve<const C: usize>(&self, options: &SolveOptions, monitor: &Monitor) -> Result<Solution> {
        use std::array::from_fn;
        let solved = &self.colours.solved;
        let pick = |x: &[DVec3]| -> Vec<[f64; C]> {
            x.iter().map(|x| from_fn(|c| x[solved[c]])).collect()
        };
        let (rho, b) = (pick(self.reflectance), pick(self.exitance));
        let apply = |u: &[[f64; C]], out: &mut [[f64; C]]| {
            self.operator.apply(u, out);
            out.par_iter_mut().zip(&rho).zip(u).for_each(|((out, rho), u)| {
                *out = from_fn(|c| u[c] - rho[c] / std::f64::consts::PI * out[c]);
            });
        };
        let (u, residual, iterations) = gmres(&apply, &b, self.guess.map(pick), options, monitor)?;
        // What is not a number has not converged either.
        if !residual.iter().all(|&r| r <= options.residual) {
            return Err(Error::NotConverged {
                residual: residual.iter().copied().fold(0.0, f64::max),
                iterations,
                tolerance: options.residual,
            });
        }
        let mut irradiance = vec![[0.0; C]; u.len()];
        self.operator.apply(&u, &mut irradiance);
        let spread = |x: &[[f64; C]], scale: f64| -> Vec<DVec3> {
            x.iter().map(|x| scale * self.colours.spread(x)).collect()
        };
        Ok(Solution {
            radiosity: spread(&u, 1.0),
            irradiance: spread(&irradiance, std::f64::consts::FRAC_1_PI),
            residual: self.colours.spread(&residual).map(|r| if r > 0.0 { r } else { 0.0 }),
            iterations,
            channels: C,
        })
    }
}
