//! Irradiance at the vertices of the elements, continuous across seams.
//!
//! Each element's polynomial is extrapolated to its corners. Corners that meet in a point and are
//! connected around it, through elements and across seams, are one vertex, whose value is the mean
//! of theirs: never across a crease, and across a contact only at its very end.
//!
//! Where the elements beside a seam do not match (roots refined to different levels, or a root's
//! corner on the edge of another), a vertex *hangs* on the longer edge. Along that edge the
//! irradiance is taken piecewise linear through the hanging vertices, and in the element
//!
//! ```text
//! H(x) = 3 w_k H_c + (1 - 3 w_k) H_edge(x'),   w_k the least weight of x,
//! ```
//!
//! with H_c the mean of the corners and x' where the ray from the centroid through x leaves over
//! the edge opposite corner k: linear on the fan of triangles between the centroid and the
//! vertices on the boundary. Both sides of every seam then have the same values, and elements on
//! which nothing hangs have the plain linear interpolation (for which H is an identity).

use glam::{DVec2, DVec3};

use crate::mesh::{Mesh, Side};

/// Vertices on the two sides of a seam are one when they are at most this share of the shorter
/// element edge apart. Matching ones are apart by roundings (1e-16), or by the contact tolerance
/// where a line was snapped on both sides; others by half an element.
const SAME: f64 = 1e-3;

/// Irradiance at the corners of the elements, continuous over each smooth patch.
pub struct VertexIrradiance {
    /// Vertex numbers of the corners of each element.
    corners: Vec<[u32; 3]>,
    /// Irradiance at each vertex, W/m^2 per channel.
    values: Vec<DVec3>,
    /// What hangs on the edges of elements, by element, edge and place.
    hanging: Vec<Hanging>,
    /// For each element the end of its part of `hanging`.
    hanging_ends: Vec<u32>,
}

/// A vertex on the edge of an element that it is not a corner of.
#[derive(Clone, Copy)]
struct Hanging {
    element: u32,
    /// Edge k runs from corner k to corner k + 1 (mod 3).
    edge: u8,
    /// Share of the edge before it.
    t: f64,
    vertex: u32,
}

impl VertexIrradiance {
    /// Values at the vertices from those at the nodes. Negative means (undershoot of the
    /// extrapolation at shadow edges) become zero.
    pub fn new(mesh: &Mesh, irradiance: &[DVec3]) -> VertexIrradiance {
        let mut joining = Joining::new(mesh);
        for seam in &mesh.seams {
            joining.join(mesh, seam.sides);
        }
        joining.join_hanging();
        let Joining { mut owner, corners, mut hanging, .. } = joining;
        let mut number = |v: u32| representative(&mut owner, v);
        let corners: Vec<[u32; 3]> = corners.iter().map(|c| c.map(&mut number)).collect();
        hanging.iter_mut().for_each(|h| h.vertex = number(h.vertex));

        let nodes = mesh.basis.nodes();
        let mut sums = vec![(DVec3::ZERO, 0.0); owner.len()];
        let mut add = |element: usize, vertex: u32, weights: DVec3| {
            let here = &irradiance[element * nodes..][..nodes];
            let values = mesh.basis.values(weights);
            let (sum, count) = &mut sums[vertex as usize];
            *sum += here.iter().zip(values).map(|(h, w)| *h * w).sum::<DVec3>();
            *count += 1.0;
        };
        for (element, c) in corners.iter().enumerate() {
            (0..3).for_each(|k| add(element, c[k], DVec3::AXES[k]));
        }
        for h in &hanging {
            let (a, b) = (DVec3::AXES[h.edge as usize], DVec3::AXES[(h.edge as usize + 1) % 3]);
            add(h.element as usize, h.vertex, a + h.t * (b - a));
        }
        let mean = |&(sum, count): &(DVec3, f64)| {
            if count > 0.0 { (sum / count).max(DVec3::ZERO) } else { DVec3::ZERO }
        };
        let mut hanging_ends = vec![0; corners.len()];
        hanging.iter().for_each(|h| hanging_ends[h.element as usize] += 1);
        let mut end = 0;
        hanging_ends.iter_mut().for_each(|count| {
            end += *count;
            *count = end;
        });
        VertexIrradiance { corners, values: sums.iter().map(mean).collect(), hanging, hanging_ends }
    }

    /// Irradiance at the plane point `x` of an element.
    pub fn at(&self, mesh: &Mesh, element: usize, x: DVec2) -> DVec3 {
        let w = mesh.weights(element, x);
        let values = self.corners[element].map(|v| self.values[v as usize]);
        let begin = if element == 0 { 0 } else { self.hanging_ends[element - 1] as usize };
        let hanging = &self.hanging[begin..self.hanging_ends[element] as usize];
        if hanging.is_empty() {
            return w.x * values[0] + w.y * values[1] + w.z * values[2];
        }
        let k = (0..3).min_by(|&i, &j| w[i].total_cmp(&w[j])).unwrap_or(0);
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let centre = (values[0] + values[1] + values[2]) / 3.0;
        let (a, b) = (w[i] - w[k], w[j] - w[k]);
        if a + b <= 0.0 {
            return centre;
        }
        let t = b / (a + b);
        // The two points of the edge around t.
        let (mut before, mut after) = ((0.0, values[i]), (1.0, values[j]));
        for h in hanging.iter().filter(|h| h.edge as usize == i) {
            let point = (h.t, self.values[h.vertex as usize]);
            if h.t <= t {
                before = point;
            } else {
                after = point;
                break;
            }
        }
        let share = (t - before.0) / (after.0 - before.0);
        3.0 * w[k] * centre + (a + b) * before.1.lerp(after.1, share)
    }
}

/// Vertices of all roots before and while they are joined across seams.
///
/// A root of level l has the vertices v1 + i/N (v2 - v1) + j/N (v3 - v1), N = 2^l, i + j <= N.
struct Joining {
    /// Union-find forest over the vertices of all roots.
    owner: Vec<u32>,
    /// First vertex of each root.
    first: Vec<u32>,
    /// Vertices of the corners of each element.
    corners: Vec<[u32; 3]>,
    /// For each root and each of its edges the elements along it, and their edges there.
    along: Vec<[Vec<Side>; 3]>,
    hanging: Vec<Hanging>,
}

impl Joining {
    fn new(mesh: &Mesh) -> Joining {
        let mut joining = Joining {
            owner: vec![],
            first: vec![],
            corners: Vec::with_capacity(mesh.elements()),
            along: vec![],
            hanging: vec![],
        };
        for root in &mesh.roots {
            let first = joining.owner.len() as u32;
            let n = 1u32 << root.level;
            joining.first.push(first);
            joining.owner.extend(first..first + (n + 1) * (n + 2) / 2);
            let mut along = [0; 3].map(|_| vec![(0, 0); n as usize]);
            for index in 0..1u32 << (2 * root.level) {
                let places = corners_in_root(index, root.level);
                let element = joining.corners.len() as u32;
                joining.corners.push(places.map(|p| first + vertex(p, n)));
                for k in 0..3 {
                    let (p, q) = (places[k], places[(k + 1) % 3]);
                    if let Some((edge, at)) = on_boundary(p, q, n) {
                        along[edge][at as usize] = (element, k as u8);
                    }
                }
            }
            joining.along.push(along);
        }
        joining
    }

    /// Joins the vertices along two edges of roots.
    fn join(&mut self, mesh: &Mesh, sides: [Side; 2]) {
        let line = |side: Side| {
            let root = &mesh.roots[side.0 as usize];
            let frame = &mesh.faces[root.face as usize].frame;
            let (p, q) = (root.corners[side.1 as usize], root.corners[(side.1 as usize + 1) % 3]);
            (frame.lift(p), frame.lift(q), 1u32 << root.level)
        };
        let (from, to, n) = line(sides[0]);
        let (its_from, its_to, its_n) = line(sides[1]);
        let along = (to - from) / from.distance_squared(to);
        // Places on both, in shares of the first edge; the second runs against it.
        let (start, end) = ((its_to - from).dot(along), (its_from - from).dot(along));
        let (step, its_step) = (1.0 / f64::from(n), (end - start) / f64::from(its_n));
        if its_step <= 0.0 || its_step.is_nan() {
            return;
        }
        let same = SAME * step.min(its_step);
        let (mut i, mut j) = (0, 0);
        while i <= n || j <= its_n {
            let s = f64::from(i) * step;
            let t = start + f64::from(j) * its_step;
            let (mine, its) = (
                self.on_edge(sides[0], i, n),
                self.on_edge(sides[1], its_n.saturating_sub(j), its_n),
            );
            if i <= n && j <= its_n && (s - t).abs() <= same {
                self.unite(mine, its);
                (i, j) = (i + 1, j + 1);
            } else if j > its_n || (i <= n && s < t) {
                // Its places count down from its end.
                let place = f64::from(its_n) - (s - start) / its_step;
                self.hang(sides[1], its_n, place, mine);
                i += 1;
            } else {
                self.hang(sides[0], n, t / step, its);
                j += 1;
            }
        }
    }

    /// Vertex number `i` of `n` along an edge of a root (any vertex of the root past its end).
    fn on_edge(&self, (root, edge): Side, i: u32, n: u32) -> u32 {
        let i = i.min(n);
        let place = match edge {
            0 => (i, 0),
            1 => (n - i, i),
            _ => (0, n - i),
        };
        self.first[root as usize] + vertex(place, n)
    }

    /// Hangs a vertex on an edge of a root, `place` element edges from its begin, if that is on it.
    fn hang(&mut self, (root, edge): Side, n: u32, place: f64, vertex: u32) {
        if place > 0.0 && place < f64::from(n) {
            let (element, edge) = self.along[root as usize][edge as usize][place as usize];
            self.hanging.push(Hanging { element, edge, t: place.fract(), vertex });
        }
    }

    /// Sorts what hangs, and joins what hangs in the same place: neighbours that are connected
    /// there through the element on which they hang.
    fn join_hanging(&mut self) {
        let mut hanging = std::mem::take(&mut self.hanging);
        hanging.sort_by(|a, b| {
            let key = |h: &Hanging| (h.element, h.edge);
            key(a).cmp(&key(b)).then(a.t.total_cmp(&b.t)).then(a.vertex.cmp(&b.vertex))
        });
        hanging.dedup_by(|b, a| {
            let same = a.element == b.element && a.edge == b.edge && b.t - a.t <= SAME;
            if same {
                self.unite(a.vertex, b.vertex);
            }
            same
        });
        self.hanging = hanging;
    }

    fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (representative(&mut self.owner, a), representative(&mut self.owner, b));
        self.owner[a.max(b) as usize] = a.min(b);
    }
}

/// Corners (i, j) of element number `index` of a root, see [`Joining`]: the quadtree of
/// [`crate::mesh::child`] in whole numbers.
fn corners_in_root(index: u32, level: u32) -> [(u32, u32); 3] {
    let n = 1 << level;
    let mut t = [(0, 0), (n, 0), (0, n)];
    let middle = |p: (u32, u32), q: (u32, u32)| ((p.0 + q.0) / 2, (p.1 + q.1) / 2);
    for digit in (0..level).rev() {
        let [v1, v2, v3] = t;
        let (m12, m23, m31) = (middle(v1, v2), middle(v2, v3), middle(v3, v1));
        t = match index >> (2 * digit) & 3 {
            0 => [v1, m12, m31],
            1 => [m12, v2, m23],
            2 => [m31, m23, v3],
            _ => [m23, m31, m12],
        };
    }
    t
}

/// Number of vertex (i, j) in its root.
fn vertex((i, j): (u32, u32), n: u32) -> u32 {
    // Rows before row j have n + 1, n, n - 1, ... vertices.
    j * (n + 1) - j * j.saturating_sub(1) / 2 + i
}

/// The edge of a root that an element's edge from `p` to `q` lies on, and its place there, if any.
fn on_boundary(p: (u32, u32), q: (u32, u32), n: u32) -> Option<(usize, u32)> {
    if p.1 == 0 && q.1 == 0 {
        Some((0, p.0))
    } else if p.0 + p.1 == n && q.0 + q.1 == n {
        Some((1, p.1))
    } else if p.0 == 0 && q.0 == 0 {
        Some((2, n - p.1))
    } else {
        None
    }
}

/// Representative of `v` in a union-find forest, with path halving.
fn representative(owner: &mut [u32], mut v: u32) -> u32 {
    while owner[v as usize] != v {
        owner[v as usize] = owner[owner[v as usize] as usize];
        v = owner[v as usize];
    }
    v
}
