//! Rooms full of blocks.

use glam::DVec3;

use super::random::Random;

/// Blocks on the grid {0..n}^3 that do not overlap but touch each other and the walls: their
/// least and largest corners.
pub fn packed(r: &mut Random, n: usize, wanted: usize) -> Vec<(DVec3, DVec3)> {
    let mut blocks: Vec<(DVec3, DVec3)> = vec![];
    for _ in 0..20 * wanted {
        if blocks.len() == wanted {
            break;
        }
        let mut sides = || {
            let low = r.below(n);
            (low as f64, (low + 1 + r.below((n - low).min(2))) as f64)
        };
        let (x, y, z) = (sides(), sides(), sides());
        let (min, max) = (DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1));
        let apart = |b: &(DVec3, DVec3)| b.1.cmple(min).any() || max.cmple(b.0).any();
        if blocks.iter().all(apart) {
            blocks.push((min, max));
        }
    }
    blocks
}
