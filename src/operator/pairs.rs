//! Pairs of clusters: what receiving and radiating parts of the surface are to each other.
//!
//! Both quadtrees are descended at once. A pair of clusters is passed over where one is behind the
//! other or all of it is proved hidden; it is *far* where it is proved fully visible and the
//! clusters are small compared with their distance; and it is handed down otherwise, with the list
//! of occluders that may still stand between. What reaches the elements of the receiving side
//! are *links*, from an element to a cluster whose radiosity is as good as linear, or is too
//! close to expand: they are integrated exactly, node by node, over the visible part.

use glam::{DVec2, DVec3};

use super::walk::Stage;
use crate::cluster::fit::Deviation;
use crate::geometry::triangle_area;
use crate::mesh::child;
use crate::visibility::{Coverage, Shaft, faces_away};

/// A cluster on its way down.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    /// Its root.
    pub root: u32,
    /// Its face.
    pub face: u32,
    /// Levels above it in the root's quadtree, and below.
    pub depth: u32,
    /// Levels below.
    pub level: u32,
    /// Number along its level.
    pub index: u32,
    /// Number among all clusters.
    pub number: u32,
    /// Corners in the face's plane.
    pub corners: [DVec2; 3],
    /// Corners in space.
    pub space: [DVec3; 3],
    /// Centre of the smallest enclosing circle.
    pub centre: DVec3,
    /// Its radius.
    pub radius: f64,
    /// Area, square metres.
    pub area: f64,
}

impl Cell {
    /// A whole root.
    pub fn root(stage: Stage, root: u32) -> Cell {
        let r = &stage.mesh.roots[root as usize];
        let area = triangle_area(&r.corners);
        let radius = stage.clusters.root_radius[root as usize];
        Cell::new(stage, (root, r.face), (0, r.level), 0, r.corners, radius, area)
    }

    /// Child `k` of a cluster that is no element.
    pub fn child(&self, stage: Stage, k: u32) -> Cell {
        Cell::new(
            stage,
            (self.root, self.face),
            (self.depth + 1, self.level - 1),
            4 * self.index + k,
            child(&self.corners, k as usize),
            0.5 * self.radius,
            0.25 * self.area,
        )
    }

    fn new(
        stage: Stage,
        (root, face): (u32, u32),
        (depth, level): (u32, u32),
        index: u32,
        corners: [DVec2; 3],
        radius: f64,
        area: f64,
    ) -> Cell {
        let frame = &stage.mesh.faces[face as usize].frame;
        let number = stage.clusters.number(root as usize, depth, index);
        let space = corners.map(|x| frame.lift(x));
        let centre = frame.lift(stage.clusters.centre[number as usize]);
        Cell { root, face, depth, level, index, number, corners, space, centre, radius, area }
    }

    /// The first of its elements.
    pub fn first_element(&self, stage: Stage) -> u32 {
        stage.mesh.roots[self.root as usize].first + (self.index << (2 * self.level))
    }
}

/// What decides the fate of a pair.
#[derive(Clone, Copy)]
pub struct Rules<'a> {
    /// What is far: see [`far`].
    pub eta: f64,
    /// Deviation of the radiosity of each cluster from linear, W/m^2.
    pub deviation: &'a [Deviation],
    /// Largest error that a link may make, as [`Deviation::error`] bounds it, W/m^2.
    pub allowed: f64,
    /// Receivers of at most this many levels take fully visible clusters as links where they may.
    pub link_levels: u32,
    /// Most pairs of elements that are linked rather than taken as far.
    pub few_links: usize,
    /// Which roots radiate.
    pub sends: &'a [bool],
}

/// Whether two clusters are far from each other, given their radii and the distance d of their
/// centres: R_P <= kappa (d - R_Q) and R_Q <= kappa (d - R_P), where kappa = eta/(2 - eta). For equal
/// radii this is R_P + R_Q <= eta d.
///
/// Seen from the centre of P the poles of G lie d - R_Q away and farther, so that interpolation on P
/// gains a factor 1/kappa + sqrt(1/kappa^2 - 1) with each order: 5.8 at eta = 1/2. With
/// R_P + R_Q <= eta d alone R_P may come near eta d beside a small source, such as a lamp, and the
/// gain down to 3.7. The slack of a few roundings is for regular meshes, where equality is common.
pub fn far(eta: f64, radii: (f64, f64), distance: f64) -> bool {
    // The condition on the larger one implies the other.
    let (small, large) = (radii.0.min(radii.1), radii.0.max(radii.1));
    far_from_exact(eta, large, distance - small)
}

/// Whether a cluster of some radius is far from all points at some distance or more from its
/// centre: one side of [`far`], where the other is integrated exactly.
pub fn far_from_exact(eta: f64, radius: f64, distance: f64) -> bool {
    (2.0 - eta) * radius <= eta * distance * (1.0 + 1e-13)
}

/// A radiating cluster that is not settled yet.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// The cluster.
    pub cell: Cell,
    /// Occluders that may stand between: a range of [`Pending::occluders`].
    pub between: (u32, u32),
}

/// Sources that wait for a receiver's children, or are its links.
#[derive(Clone, Debug, Default)]
pub struct Pending {
    /// Face by face.
    pub sources: Vec<Source>,
    /// Numbers of occluders.
    pub occluders: Vec<u32>,
}

/// How pairs were settled; the report shows it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PairCounts {
    /// Passed over: one behind the other, or in one plane.
    pub away: u64,
    /// Passed over: proved hidden.
    pub hidden: u64,
    /// Settled as far.
    pub far: u64,
    /// Pairs that were looked at and had no occluder between: visibility was never asked again.
    pub clear: u64,
    /// Pairs whose occluders were looked at.
    pub shaded: u64,
    /// Links, of elements to clusters.
    pub links: u64,
}

impl std::ops::AddAssign for PairCounts {
    fn add_assign(&mut self, o: PairCounts) {
        self.away += o.away;
        self.hidden += o.hidden;
        self.far += o.far;
        self.clear += o.clear;
        self.shaded += o.shaded;
        self.links += o.links;
    }
}

/// What comes of the descent.
pub trait Receiver {
    /// A far pair; whether the source's fit is good enough for it.
    fn far(&mut self, receiver: &Cell, source: &Cell, by_fit: bool);
    /// All links of an element: `pending.sources[from..]`.
    fn links(&mut self, element: &Cell, pending: &Pending, from: usize);
    /// A receiver that is left to another task; its sources are `pending.sources[from..]`.
    fn task(&mut self, receiver: &Cell, pending: &Pending, from: usize);
}

/// Descends from one receiver.
pub struct Descent<'a, 'b, R> {
    /// The surface.
    pub stage: Stage<'a>,
    /// What decides.
    pub rules: Rules<'b>,
    /// Receivers of this level are left to tasks of their own.
    pub task_level: Option<u32>,
    /// What waits.
    pub pending: Pending,
    /// How pairs were settled.
    pub counts: PairCounts,
    /// Hears of what comes of it.
    pub out: R,
}

/// All radiating roots that a root may see, with the occluders between.
pub fn sources_of(
    stage: Stage,
    receiver: &Cell,
    sends: &[bool],
    counts: &mut PairCounts,
) -> Pending {
    let Stage { mesh, occluders, .. } = stage;
    let tau = occluders.coincidence();
    let own = &mesh.faces[receiver.face as usize];
    let mut pending = Pending::default();
    for (number, face) in mesh.faces.iter().enumerate() {
        let roots = face.roots.0..face.roots.1;
        if !roots.clone().any(|r| sends[r as usize]) {
            continue;
        }
        let space = face.corners.map(|x| face.frame.lift(x));
        if number as u32 == receiver.face
            || receiver.space.iter().all(|&x| face.frame.height(x) <= tau)
            || space.iter().all(|&x| own.frame.height(x) <= tau)
            || faces_away(own.frame.n, face.frame.n)
        {
            counts.away += 1;
            continue;
        }
        let begin = pending.occluders.len() as u32;
        Shaft::new(occluders, (receiver.space, own.frame.n), (space, face.frame.n))
            .find(&mut pending.occluders);
        let between = (begin, pending.occluders.len() as u32);
        for root in roots.filter(|&r| sends[r as usize]) {
            pending.sources.push(Source { cell: Cell::root(stage, root), between });
        }
    }
    pending
}

impl<R: Receiver> Descent<'_, '_, R> {
    /// Settles the sources `pending.sources[from..]` of a receiver and of all below it; what it adds
    /// to the list it takes away again.
    pub fn visit(&mut self, receiver: &Cell, from: usize) {
        let (to, occluders_to) = (self.pending.sources.len(), self.pending.occluders.len());
        for k in from..to {
            let source = self.pending.sources[k];
            self.settle(receiver, &source);
        }
        if receiver.level == 0 {
            self.counts.links += (self.pending.sources.len() - to) as u64;
            self.out.links(receiver, &self.pending, to);
        } else {
            for k in 0..4 {
                let below = receiver.child(self.stage, k);
                if self.task_level == Some(below.level) {
                    self.out.task(&below, &self.pending, to);
                } else {
                    self.visit(&below, to);
                }
            }
        }
        self.pending.sources.truncate(to);
        self.pending.occluders.truncate(occluders_to);
    }

    fn settle(&mut self, receiver: &Cell, source: &Source) {
        let Stage { mesh, occluders, .. } = self.stage;
        let tau = occluders.coincidence();
        let cell = &source.cell;
        let frames =
            (&mesh.faces[receiver.face as usize].frame, &mesh.faces[cell.face as usize].frame);
        let of_receiver = receiver.space.map(|x| frames.1.height(x));
        let of_source = cell.space.map(|x| frames.0.height(x));
        let behind = |heights: &[f64; 3]| heights.iter().all(|&h| h <= tau);
        if behind(&of_receiver) || behind(&of_source) {
            self.counts.away += 1;
            return;
        }
        let above = of_receiver.iter().chain(&of_source).all(|&h| h >= -tau);
        let highest = |heights: &[f64; 3]| heights.iter().copied().fold(0.0, f64::max);
        let may_link = self.may_link(receiver, cell, highest(&of_receiver), highest(&of_source));
        let mut between = source.between;
        if between.0 == between.1 {
            self.counts.clear += 1;
        } else {
            self.counts.shaded += 1;
            // At an element each node looks for itself.
            if !(receiver.level == 0 && may_link) {
                let shaft =
                    Shaft::new(occluders, (receiver.space, frames.0.n), (cell.space, frames.1.n));
                let begin = self.pending.occluders.len();
                if shaft.narrow(&mut self.pending.occluders, between) == Coverage::Hidden {
                    self.counts.hidden += 1;
                    return;
                }
                between = (begin as u32, self.pending.occluders.len() as u32);
            }
        }
        let clear = between.0 == between.1;
        let source = Source { cell: *cell, between };
        if clear && above {
            if may_link && receiver.level <= self.rules.link_levels {
                self.pending.sources.push(source);
                return;
            }
            let distance = receiver.centre.distance(cell.centre);
            // The fit is integrated exactly: only the receiver is small.
            let eta = self.rules.eta;
            let by_fit = may_link && far_from_exact(eta, receiver.radius, distance - cell.radius);
            let few = 1 << (2 * (receiver.level + cell.level).min(16)) <= self.rules.few_links;
            if by_fit || (!few && far(eta, (receiver.radius, cell.radius), distance)) {
                self.counts.far += 1;
                self.out.far(receiver, cell, by_fit);
                return;
            }
        } else if may_link {
            self.pending.sources.push(source);
            return;
        }
        let few = clear && above && receiver.level <= self.rules.link_levels;
        if cell.level > 0 && (cell.radius >= receiver.radius || receiver.level == 0 || few) {
            for k in 0..4 {
                let cell = cell.child(self.stage, k);
                self.settle(receiver, &Source { cell, between });
            }
        } else {
            self.pending.sources.push(source);
        }
    }

    /// Whether the source's fit may stand for it in links to the receiver's nodes, by a bound on
    /// area cos cos / (pi distance^2).
    fn may_link(&self, receiver: &Cell, source: &Cell, height: f64, rise: f64) -> bool {
        if source.level == 0 {
            return true;
        }
        let deviation = self.rules.deviation[source.number as usize];
        let d = receiver.centre.distance(source.centre) - receiver.radius - source.radius;
        let factor = if d > 0.0 {
            let cosines = (height / d).min(1.0) * (rise / d).min(1.0);
            source.area * cosines / (std::f64::consts::PI * d * d)
        } else {
            f64::INFINITY
        };
        deviation.error(factor) <= self.rules.allowed
    }
}
