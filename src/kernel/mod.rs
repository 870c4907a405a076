//! Integrals of the kernel G = cos cos / r^2 over polygons, without visibility.
//!
//! A receiver point P with unit normal nP looks at a polygon in the plane z = 0 of a [`Frame`]
//! with normal nQ. With r = Q - P, d the height of P, c = nP.nQ and a = nP - c nQ,
//!
//! G = (nP.r)(-r.nQ)/|r|^4 = (a.rho - c d) d / (|rho|^2 + d^2)^2,   rho = in-plane part of r.
//!
//! [`moments`] gives the integrals of G and of G (x - about) over a convex polygon, from which the
//! coefficients of constant and linear elements follow. Near polygons take the closed form
//! ([`closed_form`]), far ones, where it cancels, Gauss rules ([`quadrature`]).

pub mod closed_form;
pub mod dilogarithm;
pub mod gauss;
pub mod quadrature;

use glam::{DVec2, DVec3};

use crate::geometry::polygon::{Linear, Pieces};
use crate::geometry::{COINCIDENCE, Frame};

/// A receiver as seen from a source plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Foot of the receiver on the plane, in plane coordinates.
    pub foot: DVec2,
    /// Height of the receiver above the plane, on the side that radiates; metres, positive.
    pub d: f64,
    /// In-plane part of the receiver's normal.
    pub a: DVec2,
    /// Cosine between the two normals.
    pub c: f64,
}

impl View {
    /// Receiver at `point` with unit `normal`, seen from the plane of `frame`.
    pub fn new(frame: &Frame, point: DVec3, normal: DVec3) -> View {
        View {
            foot: frame.project(point),
            d: frame.height(point),
            a: DVec2::new(normal.dot(frame.u), normal.dot(frame.v)),
            c: normal.dot(frame.n),
        }
    }

    /// Height of a point of the plane above the receiver's horizon: nP.(x - P).
    ///
    /// `magnitude` is the scene's largest coordinate; it sets the uncertainty.
    pub fn horizon(&self, magnitude: f64) -> Linear {
        Linear {
            g: self.a,
            c: -self.a.dot(self.foot) - self.c * self.d,
            uncertainty: COINCIDENCE * magnitude,
        }
    }

    /// G at a point of the plane.
    pub fn g(&self, x: DVec2) -> f64 {
        let rho = x - self.foot;
        let s = rho.length_squared() + self.d * self.d;
        (self.a.dot(rho) - self.c * self.d) * self.d / (s * s)
    }
}

/// Integrals of G over a polygon, and of G (x - about).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Moments {
    /// Integral of G, dimensionless.
    pub zeroth: f64,
    /// Integral of G (x - about), metres.
    pub first: DVec2,
}

impl std::ops::AddAssign for Moments {
    fn add_assign(&mut self, other: Moments) {
        self.zeroth += other.zeroth;
        self.first += other.first;
    }
}

/// Radius over distance above which the closed form is used.
///
/// At 1/4 the closed form has lost little more than one digit (it loses about two powers of
/// distance over radius, and one more in the first moment), and 9 x 9 Gauss points are exact.
const CLOSED_FORM_ABOVE: f64 = 0.25;

/// How precise integrals are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Precision {
    /// Squares of the largest radius over distance for each number of Gauss points a direction, from 1
    /// on; none is smaller than the one before.
    ladder: [f64; MOST_POINTS],
}

/// Most points a direction for which a Gauss rule is faster than the closed form.
const MOST_POINTS: usize = 11;

impl Precision {
    /// As exact as the closed forms: see [`moments`].
    pub const EXACT: Precision = Precision { ladder: [0.0; MOST_POINTS] };

    /// Errors below `bound` times area/distance^2; those of the first moment times the radius.
    /// Exact for a bound of 0.
    pub fn within(bound: f64) -> Precision {
        let rung =
            |k: usize| if bound > 0.0 { quadrature::ratio_for(k + 1, bound).powi(2) } else { 0.0 };
        Precision { ladder: std::array::from_fn(rung) }
    }

    /// Points a direction that suffice for this square of radius over distance, unless too many are
    /// needed.
    fn points(&self, square: f64) -> Option<usize> {
        let enough: usize = self.ladder.iter().map(|&most| usize::from(square <= most)).sum();
        (enough > 0).then(|| MOST_POINTS + 1 - enough)
    }
}

/// Integrals over a convex polygon that lies above the receiver's horizon.
///
/// With [`Precision::EXACT`] the relative error is 1e-12 in the zeroth moment; in the first moment
/// 1e-12 of the zeroth times the polygon's radius.
pub fn moments(view: &View, polygon: &[DVec2], about: DVec2, precision: &Precision) -> Moments {
    let centre = polygon.iter().sum::<DVec2>() / polygon.len() as f64;
    let radius_squared = polygon.iter().map(|x| x.distance_squared(centre)).fold(0.0, f64::max);
    let square = radius_squared / (centre.distance_squared(view.foot) + view.d * view.d);
    moments_at(view, polygon, about, square, precision)
}

/// As [`moments`], where the `square` of radius over distance is known: distances from the mean of the
/// corners to the farthest of them and to the receiver.
pub fn moments_at(
    view: &View,
    polygon: &[DVec2],
    about: DVec2,
    square: f64,
    precision: &Precision,
) -> Moments {
    if let Some(points) = precision.points(square) {
        return quadrature::moments(view, polygon, about, points);
    }
    let ratio = square.sqrt();
    if ratio > CLOSED_FORM_ABOVE {
        closed_form::moments(view, polygon, about)
    } else {
        quadrature::moments(view, polygon, about, quadrature::points_for(ratio))
    }
}

/// As [`moments`], for a convex polygon of which only a part may lie above the horizon.
pub fn moments_above(
    view: &View,
    polygon: &[DVec2],
    about: DVec2,
    horizon: &Linear,
    precision: &Precision,
    scratch: &mut Pieces,
) -> Moments {
    if horizon.nowhere_negative(polygon) {
        return moments(view, polygon, about, precision);
    }
    scratch.clear();
    if scratch.push_clipped(polygon, horizon) {
        moments(view, scratch.get(0), about, precision)
    } else {
        Moments::default()
    }
}
