//! The discrete operator: from values at the nodes to irradiance at points.
//!
//! (A u)_i = sum_e sum_k u_{e,k} int_e V(P_i, Q) G(P_i, Q) phi_{e,k}(Q) dS_Q, so that K_n of AC
//! (2.10) is diag(rho/pi) A. Everything here is colour-blind: geometry, never reflectance.

pub mod clustered;
pub mod exact;
pub mod fast;
pub mod links;
pub mod pairs;
pub mod walk;

use glam::DVec3;

use crate::error::Result;
use crate::monitor::Monitor;

pub use clustered::{ClusteredOperator, ClusteredOptions};
pub use exact::ExactOperator;
pub use walk::{Counts, Stage, Walker, gather};

/// Which operator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum OperatorKind {
    /// Every coefficient computed and stored.
    #[default]
    Exact,
    /// The clustering method of AC section 3.
    Clustered(ClusteredOptions),
}

/// An operator of either kind.
pub enum Operator<'a> {
    /// See [`ExactOperator`].
    Exact(ExactOperator),
    /// See [`ClusteredOperator`].
    Clustered(ClusteredOperator<'a>),
}

impl<'a> Operator<'a> {
    /// Forecast of the bytes that the operator will take.
    pub fn forecast(stage: Stage, kind: OperatorKind) -> u64 {
        match kind {
            OperatorKind::Exact => exact::forecast(stage.mesh, stage.occluders).bytes,
            OperatorKind::Clustered(options) => {
                clustered::forecast(stage, options.eta).bytes(clustered::Kept::All)
            }
        }
    }

    /// Builds the operator in at most `max_memory` bytes; the result does not depend on the number
    /// of threads.
    pub fn build(
        stage: Stage<'a>,
        kind: OperatorKind,
        max_memory: u64,
        monitor: &Monitor,
    ) -> Result<Operator<'a>> {
        Ok(match kind {
            OperatorKind::Exact => {
                Operator::Exact(ExactOperator::build(stage, max_memory, monitor)?)
            }
            OperatorKind::Clustered(options) => {
                Operator::Clustered(ClusteredOperator::build(stage, options, max_memory, monitor)?)
            }
        })
    }

    /// out = A u for three right-hand sides at once; both have one entry a node.
    pub fn apply(&self, u: &[DVec3], out: &mut [DVec3]) {
        match self {
            Operator::Exact(operator) => operator.apply(u, out),
            Operator::Clustered(operator) => operator.apply(u, out),
        }
    }

    /// Exact entries stored: pairs of a node and an element.
    pub fn entries(&self) -> usize {
        match self {
            Operator::Exact(operator) => operator.entries(),
            Operator::Clustered(operator) => operator.entries(),
        }
    }

    /// Bytes stored.
    pub fn bytes(&self) -> usize {
        match self {
            Operator::Exact(operator) => operator.bytes(),
            Operator::Clustered(operator) => operator.bytes(),
        }
    }

    /// What was met while the operator was built.
    pub fn counts(&self) -> Counts {
        match self {
            Operator::Exact(operator) => operator.counts,
            Operator::Clustered(operator) => operator.counts,
        }
    }

    /// Sums of the rows over pi: the share of the hemisphere that is filled by radiating surfaces,
    /// 1 in a closed scene.
    pub fn row_sums(&self, nodes: usize) -> Vec<f64> {
        let mut out = vec![DVec3::ZERO; nodes];
        self.apply(&vec![DVec3::ONE; nodes], &mut out);
        out.iter().map(|h| h.x / std::f64::consts::PI).collect()
    }
}
