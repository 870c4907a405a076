//! Occluders as one observer sees them: what their shadows on all source planes have in common.

use glam::DVec3;

use super::bodies::{Body, Face, MOST_FACES, NONE};
use super::shadows::{Observer, continues_flat};

/// Where a face of a body is seen edge-on, all of its faces cast shadows of their own: roundings would
/// turn parts of the outline. Height over the plane, in units of the distance.
const EDGE_ON: f64 = 1e-6;

/// The plane through the observer and an edge of an occluder.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgePlane {
    /// From the observer to the corner of the edge where it begins, seen counter-clockwise, metres.
    pub to_corner: DVec3,
    /// Normal that points to the occluder's side; twice the area of the triangle from the observer long.
    pub normal: DVec3,
    /// Lengths of these, and of the edge.
    pub distance: f64,
    pub twice_area: f64,
    pub edge: f64,
}

/// An occluder, or a convex body of several, that may block light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Silhouette {
    /// Its edges: `edges[begin..end]` of [`Silhouettes`].
    pub begin: usize,
    pub end: usize,
    /// It shades what is beyond all of `planes[first..last]`.
    pub first: usize,
    pub last: usize,
}

/// What is seen of an occluder.
#[derive(Clone, Copy, Debug)]
pub(super) enum Seen {
    /// It blocks nothing that matters.
    Nothing,
    /// It casts a shadow of its own.
    Alone(Silhouette),
    /// It casts one with the other faces of the body of that number.
    Together(u32, Silhouette),
}

/// What was found out about occluders from where one observer is; memory that is used again and again.
#[derive(Default)]
pub(super) struct Silhouettes {
    /// Where the observer is, and the unit normal there.
    point: DVec3,
    normal: DVec3,
    pub edges: Vec<EdgePlane>,
    /// Points and unit normals of planes that face the observer; the normals point beyond.
    pub planes: Vec<(DVec3, DVec3)>,
    /// By occluder, then by body: the number of the observer who looked last, and the place in `seen`.
    known: Vec<(u32, u32)>,
    /// None for a body whose faces cast shadows of their own.
    seen: Vec<Option<Seen>>,
    observer: u32,
}

impl Silhouettes {
    /// Forgets what another observer saw.
    pub fn look_from(&mut self, observer: &Observer) {
        (self.point, self.normal) = (observer.point, observer.normal);
        self.edges.clear();
        self.planes.clear();
        self.seen.clear();
        self.observer = self.observer.wrapping_add(1);
        if self.observer == 0 {
            self.known.clear();
            self.observer = 1;
        }
        let count = observer.occluders.len() + observer.occluders.bodies.len();
        if self.known.len() < count {
            self.known.resize(count, (0, 0));
        }
    }

    /// What is seen of an occluder by the observer who looks.
    pub fn of(&mut self, observer: &Observer, index: usize) -> Seen {
        debug_assert_eq!((self.point, self.normal), (observer.point, observer.normal));
        let found = self.once(index, |own| {
            let body = observer.occluders.body_of[index];
            let together = if body == NONE { None } else { own.of_body(observer, body) };
            Some(match together {
                Some(seen) => seen,
                None if cannot_be_shaded(observer, index) => Seen::Nothing,
                None => Seen::Alone(own.trace(observer, index)),
            })
        });
        found.unwrap_or(Seen::Nothing)
    }

    fn of_body(&mut self, observer: &Observer, number: u32) -> Option<Seen> {
        let body = &observer.occluders.bodies[number as usize];
        let slot = observer.occluders.len() + number as usize;
        self.once(slot, |own| own.trace_body(observer, body, number))
    }

    /// What was found before, or is found now.
    fn once(&mut self, slot: usize, find: impl FnOnce(&mut Self) -> Option<Seen>) -> Option<Seen> {
        let (looked, place) = self.known[slot];
        if looked == self.observer {
            return self.seen[place as usize];
        }
        let found = find(self);
        self.known[slot] = (self.observer, self.seen.len() as u32);
        self.seen.push(found);
        found
    }

    fn trace(&mut self, observer: &Observer, index: usize) -> Silhouette {
        let (begin, first) = (self.edges.len(), self.planes.len());
        self.trace_face(observer, index, |_| true);
        Silhouette { begin, end: self.edges.len(), first, last: self.planes.len() }
    }

    /// Adds the plane of an occluder, and of those edges that are wanted.
    fn trace_face(&mut self, observer: &Observer, index: usize, wanted: impl Fn(usize) -> bool) {
        let corners = observer.occluders.corners(index);
        let (on_plane, n) = observer.occluders.plane(index);
        // Seen from its front the corners run counter-clockwise, and the cross products of
        // successive corners point outward.
        let side = -(observer.point - on_plane).dot(n).signum();
        self.planes.push((on_plane, side * n));
        for i in (0..corners.len()).filter(|&i| wanted(i)) {
            let (begin, end) = (corners[i], corners[(i + 1) % corners.len()]);
            // Edges of one outline are to run the same way round: each has another first corner.
            let first = if side < 0.0 { begin } else { end };
            // a x edge is a x b, without the cancellation for short edges.
            let (a, edge) = (first - observer.point, end - begin);
            let normal = side * a.cross(edge);
            self.edges.push(EdgePlane {
                to_corner: a,
                normal,
                distance: a.length(),
                twice_area: normal.length(),
                edge: edge.length(),
            });
        }
    }

    /// The outline of a body, between faces that are turned towards the observer and others. None where
    /// the observer looks into it, is inside, or sees a face edge-on: its faces cast shadows of their
    /// own then.
    fn trace_body(&mut self, observer: &Observer, body: &Body, number: u32) -> Option<Seen> {
        let Observer { occluders, point, normal } = *observer;
        let tau = occluders.coincidence();
        let looks_in = |(on, n): &(DVec3, DVec3)| (point - *on).dot(*n) > tau;
        if body.missing.iter().any(looks_in) {
            return None;
        }
        let height = |face: &Face| {
            let (on_plane, n) = occluders.plane(face.occluder as usize);
            (point - on_plane).dot(n) * face.outward
        };
        let reach = body.corners.iter().map(|w| w.distance(point)).fold(0.0, f64::max);
        if body.faces.iter().any(|face| height(face).abs() <= EDGE_ON * reach) {
            return None;
        }
        let is_turned = |face: &Face| height(face) > 0.0;
        let turned: [bool; MOST_FACES] =
            std::array::from_fn(|k| body.faces.get(k).is_some_and(is_turned));
        let continues = |face: &Face| {
            let (on_plane, n) = occluders.plane(face.occluder as usize);
            continues_flat(normal, n, &[(point - on_plane).dot(n)])
        };
        let mut fronts = body.faces.iter().zip(turned).filter(|(_, turned)| *turned).peekable();
        if fronts.peek().is_none() || fronts.any(|(face, _)| continues(face)) {
            return None;
        }
        if body.corners.iter().all(|&w| (w - point).dot(normal) <= tau) {
            return Some(Seen::Nothing);
        }
        let (begin, first) = (self.edges.len(), self.planes.len());
        for (face, _) in body.faces.iter().zip(turned).filter(|(_, turned)| *turned) {
            self.trace_face(observer, face.occluder as usize, |i| {
                let beyond = face.beyond[i];
                beyond == NONE || !turned[beyond as usize]
            });
        }
        let (end, last) = (self.edges.len(), self.planes.len());
        Some(Seen::Together(number, Silhouette { begin, end, first, last }))
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
