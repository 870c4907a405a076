//! The discrete operator: from values at the nodes to irradiance at points.
//!
//! (A u)_i = sum_e sum_k u_{e,k} int_e V(P_i, Q) G(P_i, Q) phi_{e,k}(Q) dS_Q, so that K_n of AC
//! (2.10) is diag(rho/pi) A. Everything here is colour-blind: geometry, never reflectance.

pub mod clustered;
pub mod exact;
pub mod walk;

pub use clustered::{ClusteredOperator, ClusteredOptions};
pub use exact::{ExactOperator, Forecast};
pub use walk::{Stage, Walker, gather};
