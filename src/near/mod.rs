//! The near field: exact integrals over elements that are wholly visible.

use glam::DVec2;

use crate::geometry::Pieces;
use crate::geometry::polygon::Linear;
use crate::kernel::{Moments, Precision, View, moments_above};
use crate::mesh::{ALPHA, Basis};

/// Moments of G about its centroid over what lies above the horizon of a fully visible element.
pub fn moments(
    view: &View,
    horizon: &Linear,
    element: &[DVec2; 3],
    precision: &Precision,
    scratch: &mut Pieces,
) -> Moments {
    let centroid = (element[0] + element[1] + element[2]) / 3.0;
    moments_above(view, element, centroid, horizon, precision, scratch)
}

/// Turns moments of G V about an element's centroid into integrals of G V times its basis
/// functions: the collocation integrals of AC (2.9), without rho/pi.
pub fn coefficients(m: Moments, element: &[DVec2; 3], basis: Basis) -> [f64; 3] {
    match basis {
        Basis::Constant => [m.zeroth, 0.0, 0.0],
        Basis::Linear => {
            let [v1, v2, v3] = *element;
            let twice = (v2 - v1).perp_dot(v3 - v1);
            // The barycentric weight of a corner is 1/3 + gradient . (x - centroid), with the
            // gradient normal to the opposite edge.
            let weight = |opposite: DVec2| {
                let gradient = DVec2::new(-opposite.y, opposite.x) / twice;
                m.zeroth / 3.0 + gradient.dot(m.first)
            };
            let l = |w: f64| (w - ALPHA * m.zeroth) / (1.0 - 3.0 * ALPHA);
            [l(weight(v2 - v1)), l(weight(v1 - v3)), l(weight(v3 - v2))]
        }
    }
}
