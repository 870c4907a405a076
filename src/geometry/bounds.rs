//! Axis-aligned boxes.

use glam::DVec3;

/// Axis-aligned box; empty when `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: DVec3,
    /// Largest coordinates.
    pub max: DVec3,
}

impl Bounds {
    /// The box of no points.
    pub const EMPTY: Bounds = Bounds { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The smallest box of `points`.
    pub fn of<'a>(points: impl IntoIterator<Item = &'a DVec3>) -> Bounds {
        points.into_iter().fold(Bounds::EMPTY, |b, &p| b.with(p))
    }

    /// The smallest box of this one and `p`.
    pub fn with(self, p: DVec3) -> Bounds {
        Bounds { min: self.min.min(p), max: self.max.max(p) }
    }

    /// The smallest box of both.
    pub fn union(self, other: Bounds) -> Bounds {
        Bounds { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// This box, `margin` wider on all six sides.
    pub fn grown(self, margin: f64) -> Bounds {
        Bounds { min: self.min - margin, max: self.max + margin }
    }

    /// Whether the closed boxes share a point.
    pub fn meets(self, other: Bounds) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// Its centre.
    pub fn centre(self) -> DVec3 {
        0.5 * (self.min + self.max)
    }

    /// Its longest side; 0 when empty.
    pub fn extent(self) -> f64 {
        (self.max - self.min).max_element().max(0.0)
    }

    /// Its largest coordinate in size; 0 when empty.
    pub fn magnitude(self) -> f64 {
        if self.min.cmple(self.max).all() {
            self.min.abs().max(self.max.abs()).max_element()
        } else {
            0.0
        }
    }

    /// Largest value of `normal . x` over the box (its p-vertex).
    pub fn support(self, normal: DVec3) -> f64 {
        (normal * self.min).max(normal * self.max).element_sum()
    }

    /// Squared distance from `p` to the box, 0 inside.
    pub fn distance_squared(self, p: DVec3) -> f64 {
        (self.min - p).max(p - self.max).max(DVec3::ZERO).length_squared()
    }
}
