//! Gathering a solution at any point: the links that the point would have.

use glam::DVec3;

use super::FastOptions;
use crate::cluster::fit::{Fit, deviations, fits};
use crate::geometry::Pieces;
use crate::kernel::Precision;
use crate::mesh::Basis;
use crate::operator::walk::{FitRule, Rule, Stage, Walker, exact_entry};

/// A solution ready for gathering by its fits.
pub struct FitSource {
    fits: Vec<Fit<3>>,
    rule: FitRule,
    precision: Precision,
}

impl FitSource {
    /// For the piecewise polynomial with node values `values`: errors of the irradiance are of the
    /// size of the tolerance times `largest_irradiance`.
    pub fn new(
        stage: Stage,
        options: &FastOptions,
        values: &[DVec3],
        largest_irradiance: f64,
    ) -> FitSource {
        let Stage { mesh, clusters, .. } = stage;
        let values: Vec<[f64; 3]> = values.iter().map(|u| u.to_array()).collect();
        let deviation = deviations(mesh, clusters, &values);
        let rule = FitRule { deviation, allowed: options.allowed(largest_irradiance) };
        FitSource {
            fits: fits(mesh, clusters, &values),
            rule,
            precision: Precision::within(options.precision()),
        }
    }

    /// Irradiance H = 1/pi int u G V at a point with the given unit normal: visibility is exact, u
    /// is taken for linear on clusters as large as the tolerance allows.
    pub fn gather(&self, walker: &mut Walker, stage: Stage, point: DVec3, normal: DVec3) -> DVec3 {
        let mut clip = Pieces::default();
        let mut sum = DVec3::ZERO;
        walker.cover(stage, point, normal, Rule::Fit(&self.rule), |scope, seen| {
            let precision = &self.precision;
            if let Some((cluster, c)) =
                exact_entry(scope, seen, Basis::Linear, precision, &mut clip)
            {
                for (value, c) in self.fits[cluster as usize].iter().zip(c) {
                    sum += c * DVec3::from_array(*value);
                }
            }
        });
        sum / std::f64::consts::PI
    }
}
