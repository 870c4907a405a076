//! Random numbers that follow from a seed.

use glam::{DMat3, DVec3};

/// SplitMix64 (Steele, Lea & Flood 2014): every test scene follows from one number.
pub struct Random(u64);

impl Random {
    /// The sequence of a seed.
    pub fn new(seed: u64) -> Random {
        Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x5DEE_CE66_D1CE_4E5B)
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * 2f64.powi(-53)
    }

    /// Uniform in [low, high).
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in 0..n.
    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    /// Uniform in a cube of half width `half`.
    pub fn point(&mut self, half: f64) -> DVec3 {
        DVec3::new(self.within(-half, half), self.within(-half, half), self.within(-half, half))
    }

    /// Uniform on the sphere.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let x = self.point(1.0);
            if (0.01..1.0).contains(&x.length_squared()) {
                return x.normalize();
            }
        }
    }

    /// A rotation by any angle about any axis.
    pub fn turn(&mut self) -> DMat3 {
        let angle = self.within(0.0, std::f64::consts::TAU);
        DMat3::from_axis_angle(self.direction(), angle)
    }
}
