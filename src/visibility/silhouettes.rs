//! Occluders as one observer sees them: what their shadows on all source planes have in common.

use glam::DVec3;

use super::shadows::{Observer, continues_flat};

/// The plane through the observer and an edge of an occluder.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgePlane {
    /// From the observer to the edge's first corner, metres.
    pub to_corner: DVec3,
    /// Normal that points to the occluder's side; twice the area of the triangle from the observer long.
    pub normal: DVec3,
    /// Lengths of these, and of the edge.
    pub distance: f64,
    pub twice_area: f64,
    pub edge: f64,
}

/// An occluder that may block light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Silhouette {
    /// Its edges: `edges[begin..end]` of [`Silhouettes`].
    pub begin: usize,
    pub end: usize,
    /// 1 where its own normal points away from the observer, -1 where towards it.
    pub side: f64,
}

/// What was found out about occluders from where one observer is; memory that is used again and again.
#[derive(Default)]
pub(super) struct Silhouettes {
    /// Where the observer is, and the unit normal there.
    pub point: DVec3,
    pub normal: DVec3,
    pub edges: Vec<EdgePlane>,
    /// By occluder: the number of the observer who looked last, and what was seen.
    known: Vec<(u64, Option<Silhouette>)>,
    observer: u64,
}

impl Silhouettes {
    /// Forgets what another observer saw.
    pub fn look_from(&mut self, observer: &Observer) {
        (self.point, self.normal) = (observer.point, observer.normal);
        self.edges.clear();
        self.observer += 1;
        if self.known.len() < observer.occluders.len() {
            self.known.resize(observer.occluders.len(), (0, None));
        }
    }

    /// The silhouette of an occluder; `None` where it blocks nothing that matters, seen from this point.
    pub fn of(&mut self, observer: &Observer, index: usize) -> Option<Silhouette> {
        let (looked, found) = self.known[index];
        if looked == self.observer {
            return found;
        }
        let found = (!cannot_be_shaded(observer, index)).then(|| self.trace(observer, index));
        self.known[index] = (self.observer, found);
        found
    }

    fn trace(&mut self, observer: &Observer, index: usize) -> Silhouette {
        let corners = observer.occluders.corners(index);
        let (on_plane, n) = observer.occluders.plane(index);
        // Seen from its front the corners run counter-clockwise, and the cross products of
        // successive corners point outward.
        let side = -(observer.point - on_plane).dot(n).signum();
        let begin = self.edges.len();
        for (i, &w) in corners.iter().enumerate() {
            // a x edge is a x b, without the cancellation for short edges.
            let (a, edge) = (w - observer.point, corners[(i + 1) % corners.len()] - w);
            let normal = side * a.cross(edge);
            self.edges.push(EdgePlane {
                to_corner: a,
                normal,
                distance: a.length(),
                twice_area: normal.length(),
                edge: edge.length(),
            });
        }
        Silhouette { begin, end: self.edges.len(), side }
    }
}

/// Whether the occluder blocks nothing that matters: the point is in its plane, or it is all at or below
/// the horizon, or it continues the point's own flat surface.
fn cannot_be_shaded(observer: &Observer, index: usize) -> bool {
    let Observer { occluders, point, normal } = *observer;
    let (on_plane, n) = occluders.plane(index);
    let (tau, height) = (occluders.coincidence(), (point - on_plane).dot(n));
    height.abs() <= tau
        || continues_flat(normal, n, &[height])
        || occluders.corners(index).iter().all(|&w| (w - point).dot(normal) <= tau)
}
