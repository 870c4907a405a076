//! What a descent finds, computed and kept.

use std::time::Instant;

use glam::DVec3;

use super::store::{FarPair, FarPairs, Links, Numbers};
use crate::far::Interpolation;
use crate::far::interpolation::MOST_INTERPOLATION_ORDER;
use crate::geometry::Frame;
use crate::kernel::Precision;
use crate::operator::links::{Linker, Rows};
use crate::operator::pairs::{Cell, Pending, Receiver};
use crate::operator::walk::Stage;

/// Most nodes of a cluster.
const MOST_NODES: usize = MOST_INTERPOLATION_ORDER * (MOST_INTERPOLATION_ORDER + 1) / 2;

/// Computes far pairs and links as a descent finds them; memory that is used again.
pub struct Collector<'a> {
    stage: Stage<'a>,
    interpolation: &'a Interpolation,
    single: bool,
    linker: Linker,
    points: Vec<DVec3>,
    pairs: Vec<FarPair>,
    matrices: Vec<f64>,
    rows: Rows,
    /// Receivers left to tasks of their own.
    pub tasks: Vec<(Cell, Pending)>,
    /// Seconds spent on far pairs and on links.
    pub seconds: Seconds,
}

/// Seconds of all threads together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seconds {
    /// On matrices between far clusters.
    pub far: f64,
    /// On links: visible parts and their integrals.
    pub links: f64,
    /// On finding pairs, with those.
    pub all: f64,
}

impl std::ops::AddAssign for Seconds {
    fn add_assign(&mut self, other: Seconds) {
        self.far += other.far;
        self.links += other.links;
        self.all += other.all;
    }
}

impl<'a> Collector<'a> {
    /// With links of a precision, and f32 at rest when `single`.
    pub fn new(
        stage: Stage<'a>,
        interpolation: &'a Interpolation,
        precision: Precision,
        single: bool,
    ) -> Self {
        Collector {
            stage,
            interpolation,
            single,
            linker: Linker::new(precision),
            points: vec![],
            pairs: vec![],
            matrices: vec![],
            rows: Rows::default(),
            tasks: vec![],
            seconds: Seconds::default(),
        }
    }

    /// What was collected since the last time.
    pub fn take(&mut self) -> (FarPairs, Links) {
        let far = FarPairs {
            pairs: self.pairs.as_slice().into(),
            matrices: Numbers::keep(&self.matrices, self.single),
        };
        let links = Links {
            ends: self.rows.ends.as_slice().into(),
            clusters: self.rows.clusters.as_slice().into(),
            coefficients: Numbers::keep(self.rows.coefficients.as_flattened(), self.single),
        };
        self.pairs.clear();
        self.matrices.clear();
        self.rows.clear();
        (far, links)
    }
}

impl Receiver for &mut Collector<'_> {
    fn far(&mut self, receiver: &Cell, source: &Cell, by_fit: bool) {
        let start = Instant::now();
        let faces = &self.stage.mesh.faces;
        let n = self.interpolation.count();
        let frames = (&faces[receiver.face as usize].frame, &faces[source.face as usize].frame);
        let column = (self.matrices.len() / n) as u32;
        let [a, b, c] = receiver.space;
        self.points.clear();
        self.points.extend(self.interpolation.nodes.iter().map(|w| w.x * a + w.y * b + w.z * c));
        if by_fit {
            self.linker.columns(self.stage, &self.points, frames, source, &mut self.matrices);
        } else {
            transfer(self.interpolation, &self.points, frames, source, &mut self.matrices);
        }
        let (receiver, source) = (receiver.number, source.number);
        self.pairs.push(FarPair { receiver, source, by_fit, column });
        self.seconds.far += start.elapsed().as_secs_f64();
    }

    fn links(&mut self, element: &Cell, pending: &Pending, from: usize) {
        let start = Instant::now();
        self.linker.link(self.stage, element, pending, from, &mut self.rows);
        self.seconds.links += start.elapsed().as_secs_f64();
    }

    fn task(&mut self, receiver: &Cell, pending: &Pending, from: usize) {
        let mut own = Pending::default();
        for source in &pending.sources[from..] {
            let mut source = *source;
            let begin = own.occluders.len() as u32;
            let (first, last) = source.between;
            own.occluders.extend(&pending.occluders[first as usize..last as usize]);
            source.between = (begin, own.occluders.len() as u32);
            own.sources.push(source);
        }
        self.tasks.push((*receiver, own));
    }
}

/// Appends G at all pairs of nodes: (height of x over the source) (height of y over the receiver)
/// / |x - y|^4.
fn transfer(
    interpolation: &Interpolation,
    receivers: &[DVec3],
    (own, other): (&Frame, &Frame),
    source: &Cell,
    matrix: &mut Vec<f64>,
) {
    let n = receivers.len();
    let (mut x, mut y, mut z) = ([0.0; MOST_NODES], [0.0; MOST_NODES], [0.0; MOST_NODES]);
    let mut height = [0.0; MOST_NODES];
    for (i, p) in receivers.iter().enumerate() {
        (x[i], y[i], z[i]) = (p.x, p.y, p.z);
        height[i] = other.height(*p);
    }
    let [a, b, c] = source.space;
    matrix.reserve(n * n);
    for w in &interpolation.nodes {
        let q = w.x * a + w.y * b + w.z * c;
        let rise = own.height(q);
        let mut column = [0.0; MOST_NODES];
        for i in 0..n {
            let (dx, dy, dz) = (x[i] - q.x, y[i] - q.y, z[i] - q.z);
            let s = dx * dx + dy * dy + dz * dz;
            column[i] = rise * height[i] / (s * s);
        }
        matrix.extend_from_slice(&column[..n]);
    }
}
