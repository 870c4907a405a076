//! The discrete operator: from values at the nodes to irradiance at points.
//!
//! (A u)_i = sum_e sum_k u_{e,k} int_e V(P_i, Q) G(P_i, Q) phi_{e,k}(Q) dS_Q, so that K_n of AC
//! (2.10) is diag(rho/pi) A. Everything here is colour-blind: geometry, never reflectance.

pub mod beam;
pub mod bright;
pub mod bundles;
pub mod clustered;
pub mod exact;
pub mod fast;
pub mod gather;
pub mod hemisphere;
pub mod lamps;
pub mod links;
pub mod pairs;
pub mod patches;
pub mod ray_gather;
pub mod reach;
pub mod runs;
pub mod spread;
pub mod walk;

use crate::cluster::fit::Deviation;
use crate::error::Result;
use crate::monitor::Monitor;

pub use clustered::{ClusteredOperator, ClusteredOptions};
pub use exact::ExactOperator;
pub use fast::{Demand, FastOperator, FastOptions};
pub use walk::{Counts, Stage, Walker, gather};

/// Which operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OperatorKind {
    /// Both sides clustered, to a tolerance.
    Fast(FastOptions),
    /// Every coefficient computed and stored.
    Exact,
    /// The clustering method of AC section 3.
    Clustered(ClusteredOptions),
}

impl Default for OperatorKind {
    fn default() -> Self {
        OperatorKind::Fast(FastOptions::default())
    }
}

/// An operator of any kind.
pub enum Operator<'a> {
    /// See [`FastOperator`].
    Fast(Box<FastOperator<'a>>),
    /// See [`ExactOperator`].
    Exact(ExactOperator),
    /// See [`ClusteredOperator`].
    Clustered(ClusteredOperator<'a>),
}

impl<'a> Operator<'a> {
    /// Forecast of the bytes that the operator will take.
    pub fn forecast(stage: Stage, kind: OperatorKind) -> u64 {
        match kind {
            OperatorKind::Fast(options) => fast::forecast::bytes(stage, &options),
            OperatorKind::Exact => exact::forecast(stage.mesh, stage.occluders).bytes,
            OperatorKind::Clustered(options) => {
                clustered::forecast(stage, options.eta).bytes(clustered::Kept::All)
            }
        }
    }

    /// Builds the operator in at most `max_memory` bytes; the result does not depend on the number
    /// of threads.
    ///
    /// A fast operator built here is good for any radiosity; one built for a certain radiosity
    /// ([`FastOperator::build`]) needs less.
    pub fn build(
        stage: Stage<'a>,
        kind: OperatorKind,
        max_memory: u64,
        monitor: &Monitor,
    ) -> Result<Operator<'a>> {
        Ok(match kind {
            OperatorKind::Fast(options) => {
                let all = vec![true; stage.mesh.roots.len()];
                let unknown = vec![Deviation::UNKNOWN; stage.clusters.len()];
                let demand = Demand::new(&options, &unknown, 0.0, &all, &all);
                Operator::Fast(Box::new(FastOperator::build(stage, &demand, max_memory, monitor)?))
            }
            OperatorKind::Exact => {
                Operator::Exact(ExactOperator::build(stage, max_memory, monitor)?)
            }
            OperatorKind::Clustered(options) => {
                Operator::Clustered(ClusteredOperator::build(stage, options, max_memory, monitor)?)
            }
        })
    }

    /// out = A u for C channels at once; both have one entry a node.
    pub fn apply<const C: usize>(&self, u: &[[f64; C]], out: &mut [[f64; C]]) {
        match self {
            Operator::Fast(operator) => operator.apply(u, out),
            Operator::Exact(operator) => operator.apply(u, out),
            Operator::Clustered(operator) => operator.apply(u, out),
        }
    }

    /// Coefficients stored: pairs of a node and an element or cluster.
    pub fn entries(&self) -> usize {
        match self {
            Operator::Fast(operator) => operator.links(),
            Operator::Exact(operator) => operator.entries(),
            Operator::Clustered(operator) => operator.entries(),
        }
    }

    /// Bytes stored.
    pub fn bytes(&self) -> usize {
        match self {
            Operator::Fast(operator) => operator.bytes(),
            Operator::Exact(operator) => operator.bytes(),
            Operator::Clustered(operator) => operator.bytes(),
        }
    }

    /// What was met while the operator was built, by name, for the report.
    pub fn counts(&self) -> Vec<(&'static str, u64)> {
        match self {
            Operator::Fast(operator) => operator.named_counts(),
            Operator::Exact(operator) => operator.counts.named(),
            Operator::Clustered(operator) => operator.counts.named(),
        }
    }

    /// Seconds of all threads that its parts took, by name, for the report.
    pub fn seconds(&self) -> Vec<(&'static str, f64)> {
        match self {
            Operator::Fast(operator) => operator.named_seconds(),
            Operator::Exact(_) | Operator::Clustered(_) => vec![],
        }
    }

    /// Sums of the rows over pi: the share of the hemisphere that is filled by radiating surfaces,
    /// 1 in a closed scene.
    pub fn row_sums(&self, nodes: usize) -> Vec<f64> {
        let mut out = vec![[0.0]; nodes];
        self.apply(&vec![[1.0]; nodes], &mut out);
        out.iter().map(|h| h[0] / std::f64::consts::PI).collect()
    }
}
