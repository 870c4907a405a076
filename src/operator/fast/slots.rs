//! Slots of the far field: the clusters whose moments or values are needed, by levels.

use crate::far::interpolation::DIRECT_LEVELS;
use crate::operator::walk::Stage;

/// No slot.
pub const NONE: u32 = u32::MAX;

/// Clusters with far pairs, and those that they need, in an order in which work can go by levels.
#[derive(Default)]
pub struct Slots {
    /// The clusters.
    pub clusters: Vec<SlotCluster>,
    /// Of sources the slot of the first of four children, of receivers that of the parent; where
    /// they are needed.
    pub kin: Vec<Option<u32>>,
    /// Levels in order, and the ends of their slots.
    pub levels: Vec<(u32, usize)>,
}

/// A cluster with a slot.
#[derive(Clone, Copy)]
pub struct SlotCluster {
    /// Number of the cluster.
    pub number: u32,
    /// Levels below it.
    pub level: u32,
    /// Its root.
    pub root: u32,
    /// Levels above it.
    pub depth: u32,
    /// Its number along the level.
    pub index: u32,
}

impl Slots {
    /// Slots for the clusters that are marked (0) in `slot_of`, and for those that they need:
    /// children of clusters above [`DIRECT_LEVELS`]. Writes the slots to `slot_of`.
    ///
    /// Sources come by ascending level, receivers by descending level.
    pub fn new(stage: Stage, slot_of: &mut [u32], receivers: bool) -> Slots {
        let Stage { mesh, clusters, .. } = stage;
        let mut list = vec![];
        for (root, r) in mesh.roots.iter().enumerate() {
            for depth in 0..=r.level {
                let level = r.level - depth;
                for index in 0..1u32 << (2 * depth) {
                    let number = clusters.number(root, depth, index);
                    if slot_of[number as usize] == NONE {
                        continue;
                    }
                    list.push(SlotCluster { number, level, root: root as u32, depth, index });
                    if level > DIRECT_LEVELS {
                        for k in 0..4 {
                            slot_of[clusters.number(root, depth + 1, 4 * index + k) as usize] = 0;
                        }
                    }
                }
            }
        }
        if receivers {
            list.sort_by_key(|c| std::cmp::Reverse(c.level));
        } else {
            list.sort_by_key(|c| c.level);
        }
        let mut levels: Vec<(u32, usize)> = vec![];
        for (slot, c) in list.iter().enumerate() {
            slot_of[c.number as usize] = slot as u32;
            match levels.last_mut() {
                Some(last) if last.0 == c.level => last.1 = slot + 1,
                _ => levels.push((c.level, slot + 1)),
            }
        }
        let kin = list
            .iter()
            .map(|c| {
                if receivers {
                    let parent = (c.depth > 0 && c.level + 1 > DIRECT_LEVELS)
                        .then(|| clusters.number(c.root as usize, c.depth - 1, c.index / 4));
                    parent.map(|p| slot_of[p as usize]).filter(|&slot| slot != NONE)
                } else {
                    (c.level > DIRECT_LEVELS).then(|| {
                        slot_of[clusters.number(c.root as usize, c.depth + 1, 4 * c.index) as usize]
                    })
                }
            })
            .collect();
        Slots { clusters: list, kin, levels }
    }
}
