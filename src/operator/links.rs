//! Links: exact coefficients between the nodes of an element and visible parts of clusters.

use super::pairs::{Cell, Pending, Source};
use super::walk::Stage;
use crate::geometry::Pieces;
use crate::kernel::{Moments, View};
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
    /// Bytes of its lists.
    pub fn bytes(&self) -> usize {
        4 * (self.ends.len() + self.clusters.len()) + 24 * self.coefficients.len()
    }

    /// Gives back memory that is not needed.
    pub fn shrink(&mut self) {
        self.ends.shrink_to_fit();
        self.clusters.shrink_to_fit();
        self.coefficients.shrink_to_fit();
    }
}

/// Memory for linking, used again for every element.
#[derive(Default)]
pub struct Linker {
    /// As [`crate::kernel::moments`] takes it.
    precision: f64,
    shadows: Shadows,
    active: Vec<u32>,
    candidates: Vec<u32>,
    /// Ranges of sources of one face, and of the occluders between.
    groups: Vec<(usize, usize, usize)>,
    clip: Pieces,
}

impl Linker {
    /// For integrals of a precision, as [`crate::kernel::moments`] takes it.
    pub fn new(precision: f64) -> Linker {
        Linker { precision, ..Linker::default() }
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
        self.group(pending, from);
        let first = element.first_element(stage) as usize * mesh.basis.nodes();
        for node in first..first + mesh.basis.nodes() {
            let (point, normal) = mesh.node(node);
            let observer = Observer { occluders, point, normal };
            let mut begin = 0;
            for g in 0..self.groups.len() {
                let (one, end, candidates_end) = self.groups[g];
                let candidates = begin..candidates_end;
                begin = candidates_end;
                self.face(&observer, stage, &pending.sources[one..end], candidates, rows);
            }
            rows.ends.push(rows.clusters.len() as u32);
        }
    }

    /// Finds runs of sources of one face, and lists the occluders of each once.
    fn group(&mut self, pending: &Pending, from: usize) {
        self.groups.clear();
        self.candidates.clear();
        let mut begin = from;
        while begin < pending.sources.len() {
            let face = pending.sources[begin].cell.face;
            let same = pending.sources[begin..].iter().take_while(|s| s.cell.face == face).count();
            let candidates = self.candidates.len();
            for source in &pending.sources[begin..begin + same] {
                let (first, last) = source.between;
                for &i in &pending.occluders[first as usize..last as usize] {
                    if !self.candidates[candidates..].contains(&i) {
                        self.candidates.push(i);
                    }
                }
            }
            self.candidates[candidates..].sort_unstable();
            begin += same;
            self.groups.push((begin - same, begin, self.candidates.len()));
        }
    }

    /// Links one node to clusters of one face.
    fn face(
        &mut self,
        observer: &Observer,
        stage: Stage,
        sources: &[Source],
        candidates: std::ops::Range<usize>,
        rows: &mut Rows,
    ) {
        let face = &stage.mesh.faces[sources[0].cell.face as usize];
        let view = View::new(&face.frame, observer.point, observer.normal);
        let occluders = observer.occluders;
        if view.d <= occluders.coincidence() || observer.faces_away(face.frame.n) {
            return;
        }
        let horizon = view.horizon(occluders.magnitude);
        self.active.clear();
        if !candidates.is_empty() {
            let list = self.candidates[candidates].iter().copied();
            self.shadows.cast(observer, &face.frame, &face.corners, list, &mut self.active);
        }
        let shadows = self.active.len();
        for source in sources {
            let corners = &source.cell.corners;
            if horizon.nowhere_positive(corners) {
                continue;
            }
            let coverage = if source.between.0 == source.between.1 || shadows == 0 {
                Coverage::Full
            } else {
                self.shadows.narrow(corners, &mut self.active, 0)
            };
            let moments = match coverage {
                Coverage::Full => {
                    near::moments(&view, &horizon, corners, self.precision, &mut self.clip)
                }
                Coverage::Hidden => Moments::default(),
                Coverage::Partial => {
                    let pieces = self.shadows.visible(corners, &self.active[shadows..]);
                    gray::moments(&view, &horizon, corners, pieces, self.precision, &mut self.clip)
                }
            };
            self.active.truncate(shadows);
            if moments != Moments::default() {
                rows.clusters.push(source.cell.number);
                rows.coefficients.push(near::coefficients(moments, corners, Basis::Linear));
            }
        }
    }
}
