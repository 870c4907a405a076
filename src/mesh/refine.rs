//! How finely roots are refined.

use glam::DVec2;

/// What decides the size of elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refinement {
    /// Every root is refined this many times.
    Levels(u32),
    /// Every root is refined until its longest edge is at most this, metres.
    MaxEdge(f64),
    /// The longest edge is chosen so that there are about this many elements.
    Elements(usize),
}

/// Finest level of refinement: 4^12 = 16.8 million elements a root.
pub const DEEPEST: u32 = 12;

/// Child `k` (0 to 3) of a triangle: three at the corners, then the middle one.
///
/// All four wind the same way as their parent.
pub fn child(t: &[DVec2; 3], k: usize) -> [DVec2; 3] {
    let [v1, v2, v3] = *t;
    let (m12, m23, m31) = (0.5 * (v1 + v2), 0.5 * (v2 + v3), 0.5 * (v3 + v1));
    match k {
        0 => [v1, m12, m31],
        1 => [m12, v2, m23],
        2 => [m31, m23, v3],
        _ => [m23, m31, m12],
    }
}

/// Level at which a root with the given longest edge has edges of at most `max_edge`.
pub fn level_for(longest: f64, max_edge: f64) -> u32 {
    // One part in 1e9 of slack: an edge that equals the limit but for roundings is not cut again.
    let halvings = (longest / max_edge * (1.0 - 1e-9)).log2().ceil();
    if halvings > 0.0 { (halvings as u32).min(DEEPEST) } else { 0 }
}

/// Longest allowed edge that gives at most `target` elements over roots with these longest edges
/// (or no refinement at all, when there are more roots than that).
pub(super) fn edge_for_count(longest: &[f64], target: usize) -> f64 {
    let count =
        |edge: f64| longest.iter().map(|&l| 4f64.powi(level_for(l, edge) as i32)).sum::<f64>();
    let top = longest.iter().copied().fold(0.0, f64::max);
    let (mut fine, mut coarse) = (top * 2f64.powi(-(DEEPEST as i32)), top);
    if count(fine) <= target as f64 {
        return fine;
    }
    // Bisection on the logarithm: count falls as the edge grows.
    for _ in 0..60 {
        let middle = (fine * coarse).sqrt();
        if count(middle) > target as f64 {
            fine = middle;
        } else {
            coarse = middle;
        }
    }
    coarse
}
