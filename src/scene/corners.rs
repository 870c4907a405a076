//! Which triangles share corners: equal positions have equal numbers.

use std::collections::HashMap;

use super::Triangle;

/// Numbers of the corners of each triangle, from 0 in the order in which positions occur. Two
/// corners have the same number if their positions are equal, bit for bit but for the sign of zero.
pub fn corner_numbers(triangles: &[Triangle]) -> Vec<[u32; 3]> {
    // Only looked up, never listed: the order of a hash table does not matter.
    let mut numbers = HashMap::with_capacity(triangles.len());
    let mut number = |p: glam::DVec3| {
        let next = numbers.len() as u32;
        // Adding zero makes -0 and 0 the same bits.
        *numbers.entry((p + 0.0).to_array().map(f64::to_bits)).or_insert(next)
    };
    triangles.iter().map(|t| t.vertices.map(&mut number)).collect()
}
