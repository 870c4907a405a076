//! Links: exact coefficients between the nodes of an element and visible parts of clusters.

use glam::DVec3;

use super::pairs::{Cell, Pending, Source};
use super::runs::{Run, Runs};
use super::walk::Stage;
use crate::geometry::{Frame, Pieces};
use crate::kernel::{Moments, Precision, View};
use crate::mesh::Basis;
use crate::visibility::{Coverage, Observer, Shadows};
use crate::{gray, near};

/// Rows of links: for each node the clusters it is linked to, and the integrals of G V times the
/// three basis functions of their fits.
#[derive(Default)]
pub struct Rows {
    /// End of each node's entries.
    pub ends: Vec<u32>,
    /// Numbers of clusters.
    pub clusters: Vec<u32>,
    /// Coefficients.
    pub coefficients: Vec<[f64; 3]>,
}

impl Rows {
    /// Forgets all rows; keeps the memory.
    pub fn clear(&mut self) {
        self.ends.clear();
        self.clusters.clear();
        self.coefficients.clear();
    }
}

/// Memory for linking, used again for every element.
pub struct Linker {
    precision: Precision,
    shadows: Shadows,
    active: Vec<u32>,
    /// Shadows of the candidates of a run (or none).
    numbers: Vec<u32>,
    runs: Runs,
    clip: Pieces,
}

impl Linker {
    /// For integrals of a precision.
    pub fn new(precision: Precision) -> Linker {
        Linker {
            precision,
            shadows: Shadows::default(),
            active: vec![],
            numbers: vec![],
            runs: Runs::default(),
            clip: Pieces::default(),
        }
    }

    /// Appends the rows of an element's nodes; its links are `pending.sources[from..]`.
    pub fn link(
        &mut self,
        stage: Stage,
        element: &Cell,
        pending: &Pending,
        from: usize,
        rows: &mut Rows,
    ) {
        let Stage { mesh, occluders, .. } = stage;
        let of = |s: &Source| (s.cell.face, s.between);
        self.runs.find(&pending.sources, from, &pending.occluders, of);
        let first = element.first_element(stage) as usize * mesh.basis.nodes();
        for node in first..first + mesh.basis.nodes() {
            let (point, normal) = mesh.node(node);
            let observer = Observer { occluders, point, normal };
            self.shadows.look_from(&observer);
            for g in 0..self.runs.list.len() {
                let group = self.runs.list[g];
                let (first, end) = group.sources;
                self.face(&observer, stage, &pending.sources[first..end], &group, rows);
            }
            rows.ends.push(rows.clusters.len() as u32);
        }
    }

    /// Appends the integrals of G times the three basis functions of a fully visible cluster, as
    /// points of a plane see them: three columns, with one entry a point.
    pub fn columns(
        &mut self,
        stage: Stage,
        points: &[DVec3],
        (own, other): (&Frame, &Frame),
        source: &Cell,
        columns: &mut Vec<f64>,
    ) {
        let (n, begin) = (points.len(), columns.len());
        columns.resize(begin + 3 * n, 0.0);
        for (i, &point) in points.iter().enumerate() {
            let view = View::new(other, point, own.n);
            // In the source's plane, where cells meet it, nothing is received.
            if view.d <= stage.occluders.coincidence() {
                continue;
            }
            let horizon = view.horizon(stage.occluders.magnitude);
            let corners = &source.corners;
            let moments = near::moments(&view, &horizon, corners, &self.precision, &mut self.clip);
            let three = near::coefficients(moments, corners, Basis::Linear);
            for (k, c) in three.into_iter().enumerate() {
                columns[begin + k * n + i] = c;
            }
        }
    }

    /// Links one node to clusters of one face.
    fn face(
        &mut self,
        observer: &Observer,
        stage: Stage,
        sources: &[Source],
        group: &Run,
        rows: &mut Rows,
    ) {
        let face = &stage.mesh.faces[sources[0].cell.face as usize];
        let view = View::new(&face.frame, observer.point, observer.normal);
        let occluders = observer.occluders;
        if view.d <= occluders.coincidence() || observer.faces_away(face.frame.n) {
            return;
        }
        let horizon = view.horizon(occluders.magnitude);
        self.numbers.clear();
        let (first, end) = group.candidates;
        if first < end {
            let list = &self.runs.candidates[first..end];
            self.shadows.cast(observer, &face.frame, &face.corners, list, &mut self.numbers);
        }
        let mut place = group.places;
        for source in sources {
            let corners = &source.cell.corners;
            let places = place..place + (source.between.1 - source.between.0) as usize;
            place = places.end;
            if horizon.nowhere_positive(corners) {
                continue;
            }
            self.active.clear();
            let shadows = self.runs.places[places].iter().map(|&p| self.numbers[p as usize]);
            self.active.extend(shadows.filter(|&number| number != Shadows::NONE));
            // Faces of one body have the same shadow.
            self.active.sort_unstable();
            self.active.dedup();
            let to = self.active.len();
            let coverage = match to {
                0 => Coverage::Full,
                _ => self.shadows.narrow(corners, &mut self.active, 0),
            };
            let moments = match coverage {
                Coverage::Full => {
                    near::moments(&view, &horizon, corners, &self.precision, &mut self.clip)
                }
                Coverage::Hidden => Moments::default(),
                Coverage::Partial => {
                    let pieces = self.shadows.visible(corners, &self.active[to..]);
                    gray::moments(&view, &horizon, corners, pieces, &self.precision, &mut self.clip)
                }
            };
            if moments != Moments::default() {
                rows.clusters.push(source.cell.number);
                rows.coefficients.push(near::coefficients(moments, corners, Basis::Linear));
            }
        }
    }
}
