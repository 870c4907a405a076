//! Which roots light can reach at all: what stays dark is never built.

use super::pairs::Cell;
use super::walk::Stage;
use crate::visibility::{Coverage, Shaft, faces_away};

/// Roots from which more roots than this would have to be searched are taken to be lit.
const MOST_ROOTS: usize = 4000;

/// Which roots send out light: those that `emits` says, and those that reflect (`reflects`) and
/// that a root which sends out light may see.
///
/// What is left out is proved dark: it is turned away from all light, or one occluder hides it.
pub fn lit(stage: Stage, emits: &[bool], reflects: &[bool]) -> Vec<bool> {
    if emits.len() > MOST_ROOTS {
        return emits.iter().zip(reflects).map(|(&e, &r)| e || r).collect();
    }
    let cells: Vec<Cell> = (0..emits.len() as u32).map(|r| Cell::root(stage, r)).collect();
    let mut sends = emits.to_vec();
    let mut front: Vec<usize> = (0..emits.len()).filter(|&r| emits[r]).collect();
    while !front.is_empty() {
        let next: Vec<usize> = (0..emits.len())
            .filter(|&r| reflects[r] && !sends[r])
            .filter(|&r| front.iter().any(|&source| may_see(stage, &cells[r], &cells[source])))
            .collect();
        next.iter().for_each(|&r| sends[r] = true);
        front = next;
    }
    sends
}

/// Whether light from the roots that `emits` says may arrive on any root; false is a proof.
pub fn arrives(stage: Stage, emits: &[bool]) -> bool {
    if emits.len() > MOST_ROOTS {
        return emits.contains(&true);
    }
    let cells: Vec<Cell> = (0..emits.len() as u32).map(|r| Cell::root(stage, r)).collect();
    (0..emits.len()).filter(|&source| emits[source]).any(|source| {
        (0..emits.len()).any(|r| r != source && may_see(stage, &cells[r], &cells[source]))
    })
}

/// Whether light from one root may reach the other; false is a proof.
fn may_see(stage: Stage, receiver: &Cell, source: &Cell) -> bool {
    let Stage { mesh, occluders, .. } = stage;
    let tau = occluders.coincidence();
    let frames = [receiver, source].map(|c| &mesh.faces[c.face as usize].frame);
    if receiver.space.iter().all(|&x| frames[1].height(x) <= tau)
        || source.space.iter().all(|&x| frames[0].height(x) <= tau)
        || faces_away(frames[0].n, frames[1].n)
    {
        return false;
    }
    let shaft = Shaft::new(occluders, (receiver.space, frames[0].n), (source.space, frames[1].n));
    let mut found = vec![];
    shaft.find(&mut found);
    let all = (0, found.len() as u32);
    shaft.narrow(&mut found, all) != Coverage::Hidden
}
