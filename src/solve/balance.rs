//! Balance of power: what a discretised operator gains or loses.
//!
//! Visibility and the kernel are symmetric, so of the power that surfaces send, the share that arrives is
//! known: integrated over a surface S whose radiosity is b, indirect irradiance w = K b satisfies
//!
//! ```text
//! int w dS = int s b dS,    s = K 1 (row sums: 1 in a closed scene).
//! ```
//!
//! Collocation on elements keeps this to its discretisation error only. What is missing is sent
//! around 1/(1 - s rho) times: in bright closed scenes it is most of the error. There w is nearly the same
//! everywhere, and what is missing is in proportion to it; elsewhere too, so that dark places stay dark.

use glam::DVec3;

use super::Solution;
use crate::mesh::Mesh;

/// What indirect irradiance is to be multiplied by for the balance to hold, by channel.
///
/// S is what sends: `row_sums` (over pi, at the nodes) are of that, and good to `accuracy`. One where
/// so little of what S sends is lost on the way that this is not enough to know it.
pub fn balancing(
    mesh: &Mesh,
    row_sums: &[f64],
    reflectance: &[DVec3],
    solution: &Solution,
    accuracy: f64,
) -> DVec3 {
    let nodes = mesh.basis.nodes();
    let (mut missing, mut lost, mut all) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for root in &mesh.roots {
        let first = root.first as usize;
        let elements = first..first + (1usize << (2 * root.level));
        let own = elements.start * nodes..elements.end * nodes;
        if solution.radiosity[own.clone()].iter().all(|b| *b == DVec3::ZERO) {
            continue;
        }
        for node in own {
            let area = mesh.area(node / nodes) / nodes as f64;
            let (s, b, w) = (row_sums[node], solution.radiosity[node], solution.irradiance[node]);
            missing += area * (s * b - w);
            lost += area * (1.0 - s * reflectance[node]) * w;
            all += area * w;
        }
    }
    DVec3::ONE + DVec3::select(lost.cmpgt(accuracy * all), missing / lost, DVec3::ZERO)
}
