//! Gathering by error: irradiance at any point from an adaptive field.
//!
//! A point looks at each cell as a whole first, and takes its linear fit where the error of that is
//! below what is allowed: form factor times deviation, and times (R/d)^2 where the cell is fully
//! visible, since the fit keeps the moments of degree 0 and 1 and what is left is G's curvature.
//! Visibility is exact throughout. Integrals are no more precise than the cell's light asks for.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::walk::{Scope, Stage, Walker};
use crate::cluster::adaptive::Field;
use crate::cluster::fit::Fit;
use crate::geometry::{Pieces, triangle_area};
use crate::kernel::{Moments, Precision, moments_at};
use crate::mesh::{Basis, child};
use crate::visibility::Coverage;
use crate::{gray, near};

/// Precisions to choose from: relative errors 10^(-k/2).
const PRECISIONS: usize = 25;

/// Share of the error that a cell may make which its integral may.
const OF_INTEGRAL: f64 = 0.18;

/// What radiates, ready for gathering.
pub struct Radiant {
    /// Radiosity, W/m^2.
    pub field: Field,
    /// The fits again, cell by cell.
    planes: Vec<Plane>,
    /// Faces that radiate.
    faces: Vec<u32>,
    /// Bounds of relative errors, falling, and what keeps them.
    bounds: Vec<f64>,
    precisions: Vec<Precision>,
}

/// A linear fit as gathering takes it: its value at x is mean + (x - centroid) . gradient.
#[derive(Clone, Copy, Debug)]
struct Plane {
    /// Value at the cell's centroid, W/m^2.
    mean: DVec3,
    /// Derivatives along the two axes of the face's plane, W/m^3.
    gradient: [DVec3; 2],
    /// The largest value at a node, of all channels.
    size: f64,
}

impl Plane {
    fn new(corners: &[DVec2; 3], fit: &Fit<3>) -> Plane {
        // Integrals of one linear function each.
        let of = |zeroth, first| {
            let c = near::coefficients(Moments { zeroth, first }, corners, Basis::Linear);
            fit.iter().zip(c).map(|(value, c)| c * DVec3::from_array(*value)).sum()
        };
        Plane {
            mean: of(1.0, DVec2::ZERO),
            gradient: [of(0.0, DVec2::X), of(0.0, DVec2::Y)],
            size: fit.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs())),
        }
    }

    /// The integral of its product with what has these moments about the centroid.
    fn integral(&self, m: Moments) -> DVec3 {
        m.zeroth * self.mean + m.first.x * self.gradient[0] + m.first.y * self.gradient[1]
    }
}

/// A cell on the way down.
#[derive(Clone, Copy)]
pub(super) struct Cell<'a> {
    pub number: u32,
    pub corners: &'a [DVec2; 3],
    /// Distance of its farthest corner from their mean, and its area.
    pub radius: f64,
    pub area: f64,
}

impl<'a> Cell<'a> {
    /// A whole root.
    pub fn root(stage: Stage<'a>, root: u32) -> Cell<'a> {
        let corners = &stage.mesh.roots[root as usize].corners;
        let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
        let radius = corners.iter().map(|x| x.distance(centre)).fold(0.0, f64::max);
        let area = triangle_area(corners);
        Cell { number: root, corners, radius, area }
    }
}

impl Radiant {
    /// Of the radiosity `field` on the roots of the stage's mesh.
    pub fn new(stage: Stage, field: Field) -> Radiant {
        let faces = (0..stage.mesh.faces.len() as u32)
            .filter(|&f| {
                let (begin, end) = stage.mesh.faces[f as usize].roots;
                (begin..end).any(|root| !field.is_dark(root))
            })
            .collect();
        let mut planes: Vec<Plane> = Vec::with_capacity(field.fits.len());
        let mut corners: Vec<[DVec2; 3]> = stage.mesh.roots.iter().map(|r| r.corners).collect();
        for cell in 0..field.fits.len() {
            // Children come after their parents.
            if let Some(first) = field.tree.children(cell as u32) {
                corners.resize(corners.len().max(first as usize + 4), [DVec2::ZERO; 3]);
                for k in 0..4 {
                    corners[first as usize + k] = child(&corners[cell], k);
                }
            }
            planes.push(Plane::new(&corners[cell], &field.fits[cell]));
        }
        let bounds: Vec<f64> = (0..PRECISIONS).map(|k| 10f64.powf(-0.5 * k as f64)).collect();
        let precisions = bounds.iter().map(|&bound| Precision::within(bound)).collect();
        Radiant { field, planes, faces, bounds, precisions }
    }

    /// Faces that radiate.
    pub fn faces(&self) -> &[u32] {
        &self.faces
    }

    /// Whether nothing radiates.
    pub fn is_dark(&self) -> bool {
        self.faces.is_empty()
    }

    /// Irradiance H = 1/pi int u G V at a point with the given unit normal. Each cell may add an
    /// error of `allowed` (W/m^2) in each channel; 0 takes leaves and exact integrals.
    pub fn gather(
        &self,
        walker: &mut Walker,
        stage: Stage,
        point: DVec3,
        normal: DVec3,
        allowed: f64,
    ) -> DVec3 {
        let mut sum = DVec3::ZERO;
        let mut clip = std::mem::take(&mut walker.clip);
        let only = (self.faces.len() < stage.mesh.faces.len()).then_some(&self.faces[..]);
        walker.each_face(stage, point, normal, only, |walker, scope| {
            for root in scope.face.roots.0..scope.face.roots.1 {
                let cell = Cell::root(stage, root);
                sum += self.descend(walker, scope, cell, 0, allowed, &mut clip);
            }
        });
        walker.clip = clip;
        sum / PI
    }

    /// int u G V over one cell; `active[from..]` are the shadows that may touch its parent.
    pub(super) fn descend(
        &self,
        walker: &mut Walker,
        scope: &Scope,
        cell: Cell,
        from: usize,
        allowed: f64,
        clip: &mut Pieces,
    ) -> DVec3 {
        let corners = cell.corners;
        if self.field.is_dark(cell.number) || scope.horizon.nowhere_positive(corners) {
            return DVec3::ZERO;
        }
        let to = walker.active.len();
        if from < to && walker.shadows.narrow(corners, &mut walker.active, from) == Coverage::Hidden
        {
            walker.counts.hidden += 1;
            return DVec3::ZERO;
        }
        let clear = walker.active.len() == to;
        let view = &scope.view;
        let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
        let square = (centre - view.foot).length_squared() + view.d * view.d;
        let nearest = square.sqrt() - cell.radius;
        // Where the horizon crosses it G has a kink.
        let smooth = clear && scope.horizon.nowhere_negative(corners);
        // A bound on the error is deviation area/pi times one on cos cos/d^2 over the cell: heights over
        // distances, heights over the point's horizon being at most R more than in the middle. Times
        // (R/distance)^2 where it is smooth.
        let above = scope.horizon.g.dot(centre) + scope.horizon.c + cell.radius;
        let deviation = self.field.deviation[cell.number as usize];
        let error = deviation * cell.area * view.d.min(nearest) * above.min(nearest);
        let most = PI * allowed * (nearest * nearest) * (nearest * nearest);
        let radius_squared = cell.radius * cell.radius;
        let is_small = error <= most || smooth && error * radius_squared <= most * square;
        let is_good = deviation == 0.0 || nearest > 0.0 && is_small;
        let mut sum = DVec3::ZERO;
        let below = if is_good { None } else { self.field.tree.children(cell.number) };
        if let Some(first) = below {
            for k in 0..4 {
                let below = Cell {
                    number: first + k,
                    corners: &child(corners, k as usize),
                    radius: 0.5 * cell.radius,
                    area: 0.25 * cell.area,
                };
                sum += self.descend(walker, scope, below, to, allowed, clip);
            }
        } else {
            let plane = &self.planes[cell.number as usize];
            if plane.size == 0.0 {
                walker.active.truncate(to);
                return DVec3::ZERO;
            }
            let precision =
                self.precision(OF_INTEGRAL * allowed * PI * square / (cell.area * plane.size));
            let m = if clear {
                walker.counts.near += 1;
                if smooth {
                    moments_at(view, corners, centre, radius_squared / square, precision)
                } else {
                    near::moments(view, &scope.horizon, corners, precision, clip)
                }
            } else {
                let pieces = walker.shadows.visible(corners, &walker.active[to..]);
                walker.counts.gray += u64::from(!pieces.is_empty());
                walker.counts.hidden += u64::from(pieces.is_empty());
                gray::moments(view, &scope.horizon, corners, pieces, precision, clip)
            };
            sum = plane.integral(m);
        }
        walker.active.truncate(to);
        sum
    }

    /// The coarsest precision with relative errors of at most `bound`; exact where that is no number.
    fn precision(&self, bound: f64) -> &Precision {
        let enough: usize = self.bounds.iter().map(|&known| usize::from(known <= bound)).sum();
        self.precisions.get(PRECISIONS - enough).unwrap_or(&Precision::EXACT)
    }
}
