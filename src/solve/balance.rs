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
//!
//! Row sums are known at the nodes. That does not do for an element with a spot of light, which may be
//! all that something close by takes: what such elements send is left out on both sides.

use std::f64::consts::PI;

use glam::DVec3;

use super::Solution;
use crate::mesh::Mesh;
use crate::operator::Operator;

/// What indirect irradiance is to be multiplied by for the balance to hold, by channel.
///
/// S is what sends: `row_sums` (over pi, at the nodes) are of that, and good to `accuracy`. One where
/// so little of what S sends is lost on the way that this is not enough to know it. `spots` are elements
/// to leave out.
pub fn balancing(
    mesh: &Mesh,
    operator: &Operator,
    row_sums: &[f64],
    reflectance: &[DVec3],
    solution: &Solution,
    spots: &[usize],
    accuracy: f64,
) -> DVec3 {
    let nodes = mesh.basis.nodes();
    let from_spots = arriving_from(mesh, operator, solution, spots);
    let mut is_spot = vec![false; mesh.elements()];
    spots.iter().for_each(|&element| is_spot[element] = true);
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
            let sent = if is_spot[node / nodes] { DVec3::ZERO } else { s * b };
            let arrived = from_spots.as_ref().map_or(w, |from_spots| w - from_spots[node]);
            missing += area * (sent - arrived);
            lost += area * (1.0 - s * reflectance[node]) * w;
            all += area * w;
        }
    }
    DVec3::ONE + DVec3::select(lost.cmpgt(accuracy * all), missing / lost, DVec3::ZERO)
}

/// Irradiance at the nodes from some elements, if there are any.
fn arriving_from(
    mesh: &Mesh,
    operator: &Operator,
    solution: &Solution,
    elements: &[usize],
) -> Option<Vec<DVec3>> {
    if elements.is_empty() {
        return None;
    }
    let nodes = mesh.basis.nodes();
    let mut sent = vec![[0.0; 3]; mesh.nodes()];
    for node in elements.iter().flat_map(|element| element * nodes..(element + 1) * nodes) {
        sent[node] = solution.radiosity[node].to_array();
    }
    let mut out = vec![[0.0; 3]; mesh.nodes()];
    operator.apply(&sent, &mut out);
    Some(out.into_iter().map(|h| DVec3::from_array(h) / PI).collect())
}
