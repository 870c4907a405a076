//! What a point sees of the surface: its minimal admissible covering, and its exact row.
//!
//! Faces that are turned away are passed over, many at once. Each other face is looked at as a
//! whole first: below the horizon, unoccluded, hidden. Its quadtrees are then descended with the
//! list of shadows narrowed on the way, until a cluster is proved hidden, or fully visible and far
//! enough. What remains are near elements, and gray ones that a shadow line crosses; their visible
//! parts are cut out exactly.

use glam::{DVec2, DVec3};

use crate::cluster::fit::Deviation;
use crate::cluster::{Clusters, admissible};
use crate::geometry::polygon::Linear;
use crate::geometry::{Pieces, triangle_area};
use crate::gray;
use crate::kernel::{Moments, Precision, View};
use crate::mesh::{Basis, Face, Mesh, child};
use crate::near;
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
    /// Clusters in the far field.
    pub far: u64,
    /// Elements in the near field: fully visible.
    pub near: u64,
    /// Elements in the gray field: partly visible.
    pub gray: u64,
    /// Elements hidden.
    pub hidden: u64,
}

impl Counts {
    /// The counts by name.
    pub fn named(&self) -> Vec<(&'static str, u64)> {
        vec![
            ("faces turned away from a node", self.faces_away),
            ("faces clear of occluders", self.faces_clear),
            ("faces with occluders between", self.faces_shaded),
            ("far clusters", self.far),
            ("near elements", self.near),
            ("gray elements", self.gray),
            ("hidden elements", self.hidden),
        ]
    }
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, o: Counts) {
        self.faces_away += o.faces_away;
        self.faces_shaded += o.faces_shaded;
        self.faces_clear += o.faces_clear;
        self.far += o.far;
        self.near += o.near;
        self.gray += o.gray;
        self.hidden += o.hidden;
    }
}

/// Memory for walking, used again for every point.
#[derive(Default)]
pub struct Walker {
    pub(super) shadows: Shadows,
    pub(super) active: Vec<u32>,
    pub(super) numbers: Vec<u32>,
    facing: Vec<u32>,
    stack: Vec<u32>,
    /// Boxes that a ray has yet to look into.
    pub(super) boxes: Vec<(u32, f32)>,
    pub(super) clip: Pieces,
    /// What was met since this was last reset.
    pub counts: Counts,
}

/// The surface that points look at.
#[derive(Clone, Copy)]
pub struct Stage<'a> {
    /// Elements.
    pub mesh: &'a Mesh,
    /// Clusters of them.
    pub clusters: &'a Clusters,
    /// What blocks light.
    pub occluders: &'a Occluders,
}

/// One face as seen from the current point.
pub struct Scope<'a> {
    /// The face.
    pub face: &'a Face,
    /// Number of the face.
    pub index: u32,
    /// The point in the face's frame.
    pub view: View,
    /// Height above the point's horizon.
    pub horizon: Linear,
}

/// Which clusters a covering may take whole.
#[derive(Clone, Copy)]
pub enum Rule<'a> {
    /// None: elements alone.
    Exact,
    /// Fully visible, admissible ones (AC (3.3)) with this eta: its members are [`Seen::Far`].
    Far(f64),
    /// Those whose fit is good enough: numbers of [`Seen::Near`] and [`Seen::Gray`] are then those
    /// of clusters, not of elements.
    Fit(&'a FitRule),
}

/// When the fit of a cluster may stand for what it radiates.
#[derive(Clone, Debug, PartialEq)]
pub struct FitRule {
    /// Deviation of each cluster's radiosity from its fit, W/m^2.
    pub deviation: Vec<Deviation>,
    /// Largest error that one may make, as [`Deviation::error`] bounds it, W/m^2.
    pub allowed: f64,
}

impl FitRule {
    /// Whether a cluster with this centre (in its plane), radius and corners may be taken whole.
    fn allows(
        &self,
        cluster: u32,
        view: &View,
        centre: DVec2,
        radius: f64,
        t: &[DVec2; 3],
    ) -> bool {
        let distance = ((centre - view.foot).length_squared() + view.d * view.d).sqrt() - radius;
        let factor = if distance > 0.0 {
            let area = triangle_area(t);
            let cosine = (view.d / distance).min(1.0);
            area * cosine / (std::f64::consts::PI * distance * distance)
        } else {
            f64::INFINITY
        };
        self.deviation[cluster as usize].error(factor) <= self.allowed
    }
}

/// Something that a point sees: the members of its minimal admissible covering.
pub enum Seen<'a> {
    /// A fully visible, admissible cluster above the horizon.
    Far(u32),
    /// A fully visible element that is not admissible (or that the horizon crosses).
    Near(u32, &'a [DVec2; 3]),
    /// An element that is partly visible, and its visible pieces.
    Gray(u32, &'a [DVec2; 3], &'a Pieces),
}

/// Where the walk stands in a root's quadtree.
#[derive(Clone, Copy)]
struct Place {
    root: u32,
    /// Levels above and below.
    depth: u32,
    level: u32,
    /// Number along its level, and its radius.
    index: u32,
    radius: f64,
}

impl Walker {
    /// Calls `seen` with each member of the unique minimal admissible covering of the surface, as
    /// seen from `point` with unit `normal`, that is not hidden, face by face in ascending order.
    ///
    /// A cluster is far when it is admissible, wholly above the horizon and proved fully visible.
    pub fn cover(
        &mut self,
        stage: Stage,
        point: DVec3,
        normal: DVec3,
        rule: Rule,
        mut seen: impl FnMut(&Scope, Seen),
    ) {
        let Stage { mesh, clusters, .. } = stage;
        self.each_face(stage, point, normal, None, |walker, scope| {
            let face = scope.face;
            for root in face.roots.0..face.roots.1 {
                let r = &mesh.roots[root as usize];
                let radius = clusters.root_radius[root as usize];
                let place = Place { root, depth: 0, level: r.level, index: 0, radius };
                walker.descend(stage, scope, place, &r.corners, rule, 0, &mut seen);
            }
        });
    }

    /// Calls `look` with each face that may send light to `point` with unit `normal` (of those in
    /// `only`, where they are given), with its shadows found and `active` holding their numbers.
    pub(super) fn each_face(
        &mut self,
        stage: Stage,
        point: DVec3,
        normal: DVec3,
        only: Option<&[u32]>,
        mut look: impl FnMut(&mut Walker, &Scope),
    ) {
        let Stage { mesh, clusters, occluders } = stage;
        let observer = Observer { occluders, point, normal };
        self.shadows.look_from(&observer);
        let tau = occluders.coincidence();
        match only {
            None => {
                clusters.faces.facing(point, normal, tau, &mut self.facing, &mut self.stack);
                self.counts.faces_away += (mesh.faces.len() - self.facing.len()) as u64;
            }
            Some(faces) => {
                self.facing.clear();
                self.facing.extend(faces);
            }
        }
        for k in 0..self.facing.len() {
            let index = self.facing[k];
            let face = &mesh.faces[index as usize];
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
            let scope = Scope { face, index, view, horizon };
            look(self, &scope);
        }
    }

    /// Handles one cluster; `active[from..]` are the shadows that may touch its parent.
    #[allow(clippy::too_many_arguments)]
    fn descend(
        &mut self,
        stage: Stage,
        scope: &Scope,
        place: Place,
        corners: &[DVec2; 3],
        rule: Rule,
        from: usize,
        seen: &mut impl FnMut(&Scope, Seen),
    ) {
        if scope.horizon.nowhere_positive(corners) {
            return;
        }
        let to = self.active.len();
        if from < to && self.shadows.narrow(corners, &mut self.active, from) == Coverage::Hidden {
            self.counts.hidden += 1 << (2 * place.level);
            return;
        }
        let clear = self.active.len() == to;
        let number = || stage.clusters.number(place.root as usize, place.depth, place.index);
        let mut whole = place.level == 0;
        if let Rule::Fit(fit) = rule {
            let (number, view) = (number(), &scope.view);
            let centre = stage.clusters.centre[number as usize];
            whole |= fit.allows(number, view, centre, place.radius, corners);
        }
        let name = || match rule {
            Rule::Fit(_) => number(),
            _ => stage.mesh.roots[place.root as usize].first + place.index,
        };
        if let (true, Rule::Far(eta)) = (clear, rule) {
            let number = number();
            let to_centre = stage.clusters.centre[number as usize] - scope.view.foot;
            let distance_squared = to_centre.length_squared() + scope.view.d * scope.view.d;
            if admissible(place.radius, eta, distance_squared)
                && scope.horizon.nowhere_negative(corners)
            {
                self.counts.far += 1;
                seen(scope, Seen::Far(number));
                return;
            }
        }
        if !whole {
            for k in 0..4 {
                let below = Place {
                    depth: place.depth + 1,
                    level: place.level - 1,
                    index: 4 * place.index + k,
                    radius: 0.5 * place.radius,
                    ..place
                };
                self.descend(stage, scope, below, &child(corners, k as usize), rule, to, seen);
            }
        } else if clear {
            self.counts.near += 1;
            seen(scope, Seen::Near(name(), corners));
        } else {
            let pieces = self.shadows.visible(corners, &self.active[to..]);
            if pieces.is_empty() {
                self.counts.hidden += 1;
            } else {
                self.counts.gray += 1;
                seen(scope, Seen::Gray(name(), corners, pieces));
            }
        }
        self.active.truncate(to);
    }

    /// Calls `entry` with each element that `point` (unit `normal`) sees something of, in order,
    /// and the integrals of G V times its basis functions: the exact row.
    pub fn row(
        &mut self,
        stage: Stage,
        point: DVec3,
        normal: DVec3,
        mut entry: impl FnMut(u32, [f64; 3]),
    ) {
        let basis = stage.mesh.basis;
        let mut clip = std::mem::take(&mut self.clip);
        self.cover(stage, point, normal, Rule::Exact, |scope, seen| {
            let exact = &Precision::EXACT;
            if let Some((element, c)) = exact_entry(scope, seen, basis, exact, &mut clip) {
                entry(element, c);
            }
        });
        self.clip = clip;
    }
}

/// Element (or cluster) and coefficients of a near or gray member of a covering; `None` for a far one,
/// and where nothing lies above the horizon.
pub fn exact_entry(
    scope: &Scope,
    seen: Seen,
    basis: Basis,
    precision: &Precision,
    clip: &mut Pieces,
) -> Option<(u32, [f64; 3])> {
    let (element, corners, moments) = match seen {
        Seen::Far(_) => return None,
        Seen::Near(e, corners) => {
            (e, corners, near::moments(&scope.view, &scope.horizon, corners, precision, clip))
        }
        Seen::Gray(e, corners, pieces) => (
            e,
            corners,
            gray::moments(&scope.view, &scope.horizon, corners, pieces, precision, clip),
        ),
    };
    (moments != Moments::default()).then(|| (element, near::coefficients(moments, corners, basis)))
}

/// Irradiance H = 1/pi int u G V at a point with the given unit normal: iterated collocation.
///
/// `values` holds the radiosities at the nodes, per channel, W/m^2.
pub fn gather(
    walker: &mut Walker,
    stage: Stage,
    values: &[DVec3],
    point: DVec3,
    normal: DVec3,
) -> DVec3 {
    let nodes = stage.mesh.basis.nodes();
    let mut sum = DVec3::ZERO;
    walker.row(stage, point, normal, |element, c| {
        let begin = element as usize * nodes;
        for (value, c) in values[begin..begin + nodes].iter().zip(c) {
            sum += c * *value;
        }
    });
    sum / std::f64::consts::PI
}
