//! Directions over a hemisphere, spread so evenly that what they estimate converges much faster
//! than with random ones.
//!
//! The first two dimensions of Sobol's sequence: any 2^k successive points from a multiple of 2^k
//! have one in each box of area 2^-k of every elementary shape (a (0, k, 2)-net). Flipping bits of
//! the coordinates, the same ones for all points, keeps that and makes the points of different
//! receivers independent. (Sobol 1967; Kollig & Keller 2002.)

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use crate::geometry::Frame;

/// Mixes 64 bits as SplitMix64 does (Steele, Lea & Flood 2014).
pub(super) fn mix(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Flips of bits that belong to a point in space: the same wherever it is asked for.
pub fn flips(point: DVec3) -> [u32; 2] {
    let bits = point
        .to_array()
        .iter()
        .fold(0u64, |hash, x| mix(hash.wrapping_add(0x9e37_79b9_7f4a_7c15) ^ (x + 0.0).to_bits()));
    [bits as u32, (bits >> 32) as u32]
}

/// Flips that differ for each number, made from others.
pub fn flips_for(flips: [u32; 2], number: u64) -> [u32; 2] {
    let bits = mix(u64::from(flips[0]) | u64::from(flips[1]) << 32);
    let bits = mix(bits ^ mix(number.wrapping_add(0x9e37_79b9_7f4a_7c15)));
    [bits as u32, (bits >> 32) as u32]
}

/// Point `index` of the sequence in the unit square.
pub fn in_square(index: u32, flips: [u32; 2]) -> DVec2 {
    let first = index.reverse_bits();
    // Direction numbers of x + 1: v, v ^ (v >> 1), ...
    let (mut second, mut v, mut rest) = (0, 1u32 << 31, index);
    while rest != 0 {
        if rest & 1 != 0 {
            second ^= v;
        }
        (v, rest) = (v ^ (v >> 1), rest >> 1);
    }
    let unit = |bits: u32| (f64::from(bits) + 0.5) / 4_294_967_296.0;
    DVec2::new(unit(first ^ flips[0]), unit(second ^ flips[1]))
}

/// The numbers below 2^`power` in an order in which points of a net follow near ones (a Z curve),
/// also when a multiple of that is added to all: rays that go the same way meet the same boxes.
pub fn near_ones_together(power: u32) -> Vec<u32> {
    let place = |index: u32| {
        let x = 65_536.0 * in_square(index, [0, 0]);
        let (x, y) = (x.x as u32, x.y as u32);
        (0..16).fold(0u32, |all, bit| {
            all | (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1)
        })
    };
    let mut order: Vec<u32> = (0..1 << power).collect();
    order.sort_by_key(|&index| place(index));
    order
}

/// Unit direction number `index` about a frame's normal, with density cos/pi: the mean of the
/// radiosity that such directions meet is the irradiance.
pub fn direction(frame: &Frame, index: u32, flips: [u32; 2]) -> DVec3 {
    let x = in_square(index, flips);
    let (sin, cos) = (TAU * x.y).sin_cos();
    let radius = x.x.sqrt();
    radius * cos * frame.u + radius * sin * frame.v + (1.0 - x.x).sqrt() * frame.n
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_box_of_a_net_has_one_point() {
        let flips = flips(DVec3::new(0.1, -2.0, 3.0));
        for (rows, columns) in [(1, 64), (2, 32), (4, 16), (8, 8), (16, 4), (32, 2), (64, 1)] {
            let mut seen = [false; 64];
            for index in 128..192 {
                let x = in_square(index, flips);
                let (i, j) =
                    ((x.x * f64::from(rows)) as usize, (x.y * f64::from(columns)) as usize);
                let own = &mut seen[i * columns as usize + j];
                assert!(!*own);
                *own = true;
            }
        }
    }

    #[test]
    fn a_linear_radiosity_is_integrated() {
        // Mean of d.n over cos/pi: 2/3.
        let frame = Frame::new(DVec3::ZERO, DVec3::new(0.6, 0.0, 0.8));
        let flips = flips(DVec3::ONE);
        let mean: DVec3 = (0..4096).map(|i| direction(&frame, i, flips)).sum::<DVec3>() / 4096.0;
        assert!((mean - 2.0 / 3.0 * frame.n).length() < 1e-3, "{mean}");
    }
}
