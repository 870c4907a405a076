//! The far field: Taylor polynomials of the kernel, moments of the radiosity.
//!
//! AC section 3.1. On a cluster tau of one plane, (P - Q).nQ = d is constant and the rest of the
//! kernel, k(x) = (nP.r)/|r|^4, is expanded in the plane about A(tau) to total degree m - 1
//! ("order m"): two variables suffice. Then
//!
//! int_tau u G dS ~ d sum_{i + j < m} kappa_ij(P) M_ij(tau),   M_ij = int_tau u (x - A)^(i, j) dS.
//!
//! The moments are computed once for each u, exactly, and passed up the tree.

pub mod interpolation;
pub mod moments;
pub mod taylor;

pub use interpolation::Interpolation;
pub use moments::ClusterMoments;
pub use taylor::{count, expand, far_sum};

/// Highest order m that is offered.
pub const MOST_ORDER: usize = 16;
