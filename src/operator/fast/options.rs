//! What a user asks of the fast operator, and what that means for its parts.

use crate::cluster::fit::Deviation;
use crate::error::{Error, Result};
use crate::far::interpolation::{LEAST_ORDER, MOST_INTERPOLATION_ORDER};

/// How good the operator is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FastOptions {
    /// Errors of the irradiance, relative to the largest irradiance.
    pub tolerance: f64,
    /// Order p of the far field; by the tolerance where it is not given.
    pub order: Option<usize>,
    /// What is far, see [`crate::operator::pairs::far`]; 1/2 where not given.
    pub eta: Option<f64>,
}

impl Default for FastOptions {
    fn default() -> Self {
        FastOptions { tolerance: 1e-4, order: None, eta: None }
    }
}

impl FastOptions {
    /// The options, checked.
    pub fn new(tolerance: f64, order: Option<usize>, eta: Option<f64>) -> Result<FastOptions> {
        if !(tolerance > 0.0 && tolerance < 1.0) {
            return Err(Error::Usage(format!(
                "the operator's tolerance is {tolerance}: it must lie between 0 and 1"
            )));
        }
        if let Some(eta) = eta
            && !(eta > 0.0 && eta < 1.0)
        {
            return Err(Error::Usage(format!("eta is {eta}: it must lie between 0 and 1")));
        }
        let orders = LEAST_ORDER..=MOST_INTERPOLATION_ORDER;
        if let Some(order) = order
            && !orders.contains(&order)
        {
            return Err(Error::Usage(format!(
                "the order is {order}: it must lie between {} and {}",
                orders.start(),
                orders.end()
            )));
        }
        Ok(FastOptions { tolerance, order, eta })
    }

    /// The order in use.
    ///
    /// At eta = 1/2 the largest error seen is 2.5e-5 of the largest irradiance at order 6, and
    /// each order more divides it by 6 or more (tests and the benchmark measure it). Half of the
    /// tolerance is for the far field.
    pub fn order(&self) -> usize {
        let more = (2.5e-5 / (0.5 * self.tolerance)).ln() / 6f64.ln();
        let by_tolerance = (6.0 + more.ceil()).max(LEAST_ORDER as f64) as usize;
        self.order.unwrap_or(by_tolerance.min(MOST_INTERPOLATION_ORDER))
    }

    /// Largest error of a link, as it is bounded. The errors of a node's links have
    /// either sign, and most are far below this bound: half of the tolerance for each has been
    /// enough for all (tests measure it).
    pub fn allowed(&self, largest_irradiance: f64) -> f64 {
        0.5 * self.tolerance * largest_irradiance
    }

    /// Precision of the integrals of links, relative to area/distance^2.
    pub fn precision(&self) -> f64 {
        0.1 * self.tolerance
    }

    /// The eta in use.
    pub fn eta(&self) -> f64 {
        self.eta.unwrap_or(0.5)
    }
}

/// What the operator has to be good for.
#[derive(Clone, Copy)]
pub struct Demand<'a> {
    /// Order of the far field.
    pub order: usize,
    /// What is far, see [`crate::operator::pairs::far`].
    pub eta: f64,
    /// Deviation of the radiosity from linear on each cluster, W/m^2.
    pub deviation: &'a [Deviation],
    /// Largest error of a link, W/m^2.
    pub allowed: f64,
    /// Precision of the integrals of links, relative to the irradiance; 0 for exact ones.
    pub precision: f64,
    /// Which roots radiate.
    pub sends: &'a [bool],
    /// Which roots need to know their irradiance.
    pub receives: &'a [bool],
}

impl<'a> Demand<'a> {
    /// Half the tolerance is for the far field, half for links.
    pub fn new(
        options: &FastOptions,
        deviation: &'a [Deviation],
        largest_irradiance: f64,
        sends: &'a [bool],
        receives: &'a [bool],
    ) -> Demand<'a> {
        Demand {
            order: options.order(),
            eta: options.eta(),
            deviation,
            allowed: options.allowed(largest_irradiance),
            precision: options.precision(),
            sends,
            receives,
        }
    }
}
