//! The exact row of a point: what it sees of every element.
//!
//! Each face is looked at as a whole first: turned away, below the horizon, unoccluded, hidden. Its
//! quadtrees are then descended with the list of shadows narrowed on the way, until a subtree is
//! proved fully visible or hidden. What remains are elements that a shadow line or the horizon
//! crosses; their visible parts are cut out exactly.

use glam::{DVec2, DVec3};

use crate::geometry::Pieces;
use crate::geometry::polygon::Linear;
use crate::kernel::{Moments, View, moments_above};
use crate::mesh::{ALPHA, Basis, Mesh, child};
use crate::visibility::{Coverage, Observer, Occluders, Shadows};

/// What was met on the way; the report shows it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Faces that the point is behind, or that lie below its horizon or in its plane.
    pub faces_away: u64,
    /// Faces with an occluder between them and the point.
    pub faces_shaded: u64,
    /// Faces without.
    pub faces_clear: u64,
    /// Elements fully visible.
    pub full: u64,
    /// Elements partly visible.
    pub partial: u64,
    /// Elements hidden.
    pub hidden: u64,
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, o: Counts) {
        self.faces_away += o.faces_away;
        self.faces_shaded += o.faces_shaded;
        self.faces_clear += o.faces_clear;
        self.full += o.full;
        self.partial += o.partial;
        self.hidden += o.hidden;
    }
}

/// Memory for walking, used again for every point.
#[derive(Default)]
pub struct Walker {
    shadows: Shadows,
    active: Vec<u32>,
    clip: Pieces,
    /// What was met since this was last reset.
    pub counts: Counts,
}

/// One face as seen from the current point.
struct Scope {
    view: View,
    horizon: Linear,
    basis: Basis,
}

impl Walker {
    /// Calls `entry` with each element that `point` (unit `normal`) sees something of, in order,
    /// and the integrals of G V times its basis functions.
    pub fn row(
        &mut self,
        mesh: &Mesh,
        occluders: &Occluders,
        point: DVec3,
        normal: DVec3,
        mut entry: impl FnMut(u32, [f64; 3]),
    ) {
        let observer = Observer { occluders, point, normal };
        let tau = occluders.coincidence();
        for face in &mesh.faces {
            let view = View::new(&face.frame, point, normal);
            if view.d <= tau || observer.faces_away(face.frame.n) {
                self.counts.faces_away += 1;
                continue;
            }
            let horizon = view.horizon(occluders.magnitude);
            if horizon.nowhere_positive(&face.corners) {
                self.counts.faces_away += 1;
                continue;
            }
            self.active.clear();
            self.shadows.find(&observer, &face.frame, &face.corners, &mut self.active);
            if self.active.is_empty() {
                self.counts.faces_clear += 1;
            } else {
                self.counts.faces_shaded += 1;
            }
            let scope = Scope { view, horizon, basis: mesh.basis };
            for r in face.roots.0..face.roots.1 {
                let root = &mesh.roots[r as usize];
                self.descend(&scope, &root.corners, root.level, root.first, 0, &mut entry);
            }
        }
    }

    /// Handles a quadtree node with `level` levels below it, whose first element is `first`;
    /// `active[from..]` are the shadows that may touch its parent.
    fn descend(
        &mut self,
        scope: &Scope,
        corners: &[DVec2; 3],
        level: u32,
        first: u32,
        from: usize,
        entry: &mut impl FnMut(u32, [f64; 3]),
    ) {
        if scope.horizon.nowhere_positive(corners) {
            return;
        }
        let to = self.active.len();
        if from < to {
            match self.shadows.narrow(corners, &mut self.active, from) {
                Coverage::Hidden => {
                    self.counts.hidden += 1 << (2 * level);
                    return;
                }
                // No shadow left is nothing left to narrow: `from == to` from here on.
                Coverage::Full | Coverage::Partial => {}
            }
        }
        if level > 0 {
            let quarter = 1u32 << (2 * (level - 1));
            for k in 0..4 {
                let child = child(corners, k);
                self.descend(scope, &child, level - 1, first + k as u32 * quarter, to, entry);
            }
        } else {
            let moments = self.element(scope, corners, to);
            if moments != Moments::default() {
                entry(first, coefficients(moments, corners, scope.basis));
            }
        }
        self.active.truncate(to);
    }

    /// Moments about its centroid of what is visible of one element; `active[to..]` shade it.
    fn element(&mut self, scope: &Scope, corners: &[DVec2; 3], to: usize) -> Moments {
        let centroid = (corners[0] + corners[1] + corners[2]) / 3.0;
        if self.active.len() == to {
            self.counts.full += 1;
            return moments_above(&scope.view, corners, centroid, &scope.horizon, &mut self.clip);
        }
        let mut sum = Moments::default();
        let pieces = self.shadows.visible(corners, &self.active[to..]);
        for piece in pieces.iter() {
            sum += moments_above(&scope.view, piece, centroid, &scope.horizon, &mut self.clip);
        }
        if pieces.is_empty() {
            self.counts.hidden += 1;
        } else {
            self.counts.partial += 1;
        }
        sum
    }
}

/// Turns moments of G V about an element's centroid into integrals of G V times its basis
/// functions: the collocation integrals of AC (2.9), without rho/pi.
pub fn coefficients(m: Moments, element: &[DVec2; 3], basis: Basis) -> [f64; 3] {
    match basis {
        Basis::Constant => [m.zeroth, 0.0, 0.0],
        Basis::Linear => {
            let [v1, v2, v3] = *element;
            let twice = (v2 - v1).perp_dot(v3 - v1);
            // The barycentric weight of a corner is 1/3 + gradient . (x - centroid), with the
            // gradient normal to the opposite edge.
            let weight = |opposite: DVec2| {
                let gradient = DVec2::new(-opposite.y, opposite.x) / twice;
                m.zeroth / 3.0 + gradient.dot(m.first)
            };
            let l = |w: f64| (w - ALPHA * m.zeroth) / (1.0 - 3.0 * ALPHA);
            [l(weight(v2 - v1)), l(weight(v1 - v3)), l(weight(v3 - v2))]
        }
    }
}

/// Irradiance H = 1/pi int u G V at a point with the given unit normal: iterated collocation.
///
/// `values` holds the radiosities at the nodes, per channel, W/m^2.
pub fn gather(
    walker: &mut Walker,
    mesh: &Mesh,
    occluders: &Occluders,
    values: &[DVec3],
    point: DVec3,
    normal: DVec3,
) -> DVec3 {
    let nodes = mesh.basis.nodes();
    let mut sum = DVec3::ZERO;
    walker.row(mesh, occluders, point, normal, |element, c| {
        let begin = element as usize * nodes;
        for (value, c) in values[begin..begin + nodes].iter().zip(c) {
            sum += c * *value;
        }
    });
    sum / std::f64::consts::PI
}
