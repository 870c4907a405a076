//! A conforming triangulation of the surface, refined by bisection of longest edges.
//!
//! It begins with the roots of the mesh. Their corners are welded (roots of neighbouring faces, and
//! of faces that touch, get the same vertices), and a root on whose edge a corner of another lies is
//! cut there: no vertex hangs on an edge, so what is drawn has no cracks.
//!
//! Refinement is that of M.-C. Rivara, "Algorithms for refining triangular grids suitable for
//! adaptive and multigrid techniques" (1984): triangles to be refined are bisected across their
//! longest edge, and so are neighbours until nothing hangs. Angles stay above half of the least
//! angle before. Midpoints belong to edges, and edges to pairs of welded vertices, so it holds across
//! creases, between objects, and where more than two faces meet in an edge.

use std::collections::{HashMap, HashSet};

use glam::DVec3;

use crate::geometry::{Bounds, BoxTree};
use crate::mesh::Mesh;

/// Corners of roots are one vertex where they are at most this share of the largest coordinate
/// apart: about a unit in the last place of the f32 that they are written as. What is smaller than
/// that vanishes.
const WELD: f64 = 1.0 / 8_388_608.0;

/// A triangle of the triangulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tri {
    /// The root that it is a part of.
    pub root: u32,
    /// Its corners, counter-clockwise on the side of its face.
    pub corners: [u32; 3],
}

/// Triangles that share vertices.
pub(super) struct Conforming {
    /// Vertices, metres.
    pub positions: Vec<DVec3>,
    /// Triangles.
    pub triangles: Vec<Tri>,
}

/// An edge, by its vertices in ascending order.
type Edge = (u32, u32);

fn edge(t: &Tri, k: usize) -> Edge {
    let (a, b) = (t.corners[k], t.corners[(k + 1) % 3]);
    (a.min(b), a.max(b))
}

impl Conforming {
    /// The roots of a mesh. `exact` has the input's vertices of the triangle of each root's face,
    /// which a corner of the root takes over where it is one of them.
    pub fn new(mesh: &Mesh, exact: impl Fn(usize) -> [DVec3; 3]) -> Conforming {
        let tolerance = WELD * mesh.magnitude;
        let mut weld = Weld::new(tolerance);
        let mut triangles = vec![];
        for (index, root) in mesh.roots.iter().enumerate() {
            let face = &mesh.faces[root.face as usize];
            let own = exact(face.triangle as usize);
            let corners = root.corners.map(|x| {
                let p = face.frame.lift(x);
                let near = own.into_iter().find(|v| v.distance(p) <= tolerance);
                weld.vertex(near.unwrap_or(p))
            });
            if corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0] {
                triangles.push(Tri { root: index as u32, corners });
            }
        }
        let mut mesh = Conforming { positions: weld.positions, triangles };
        mesh.cut_at_hanging(tolerance);
        mesh
    }

    /// Cuts triangles at vertices that lie on their edges.
    fn cut_at_hanging(&mut self, tolerance: f64) {
        let corners = |t: &Tri| t.corners.map(|v| self.positions[v as usize]);
        let boxes: Vec<Bounds> =
            self.triangles.iter().map(|t| Bounds::of(&corners(t)).grown(tolerance)).collect();
        let tree = BoxTree::build(&boxes);
        // Vertices on each edge of each triangle, with their places along it.
        let mut on: HashMap<(usize, usize), Vec<(f64, u32)>> = HashMap::new();
        for (v, &p) in self.positions.iter().enumerate() {
            let mut near = vec![];
            let here = Bounds { min: p, max: p };
            tree.visit(|b| b.meets(here), |t| near.push(t));
            for t in near {
                let x = corners(&self.triangles[t]);
                for k in 0..3 {
                    let (from, along) = (x[k], x[(k + 1) % 3] - x[k]);
                    let s = (p - from).dot(along) / along.length_squared();
                    let off = p.distance(from + s * along);
                    // Within a weld of its ends it is one of them.
                    let margin = tolerance / along.length();
                    if off <= tolerance && s > margin && s < 1.0 - margin {
                        on.entry((t, k)).or_default().push((s, v as u32));
                    }
                }
            }
        }
        let mut cut = vec![];
        for (index, triangle) in self.triangles.iter().enumerate() {
            let mut hanging: [Vec<u32>; 3] = std::array::from_fn(|k| {
                let mut list = on.remove(&(index, k)).unwrap_or_default();
                list.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                list.into_iter().map(|(_, v)| v).collect()
            });
            // Of a sliver a vertex may lie on two edges.
            for k in 0..3 {
                let others: Vec<u32> =
                    (0..3).filter(|&i| i < k).flat_map(|i| hanging[i].clone()).collect();
                hanging[k].retain(|v| !others.contains(v) && !triangle.corners.contains(v));
            }
            cut_triangle(triangle, hanging, &mut cut);
        }
        self.triangles = cut;
    }

    /// Square of the length of an edge, metres.
    fn length_squared(&self, (a, b): Edge) -> f64 {
        self.positions[a as usize].distance_squared(self.positions[b as usize])
    }

    /// The longest edge of a triangle: of equal ones the one with the greatest vertices, so that
    /// neighbours agree.
    fn longest(&self, t: &Tri) -> usize {
        let key = |k: usize| (self.length_squared(edge(t, k)), edge(t, k));
        (1..3).fold(0, |best, k| {
            let ((a, e), (b, f)) = (key(best), key(k));
            if b.total_cmp(&a).then(f.cmp(&e)).is_gt() { k } else { best }
        })
    }

    /// The length of the longest edge of a triangle, metres.
    pub fn size(&self, t: &Tri) -> f64 {
        self.length_squared(edge(t, self.longest(t))).sqrt()
    }

    /// Bisects the triangles of `wanted` and what must be bisected with them, unless there would be
    /// more than `most` triangles then: nothing is done in that case. Says of each triangle that is
    /// there afterwards which it was before.
    pub fn refine(&mut self, wanted: &[usize], most: usize) -> Option<Vec<usize>> {
        let mut around: HashMap<Edge, Vec<u32>> = HashMap::new();
        for (index, t) in self.triangles.iter().enumerate() {
            (0..3).for_each(|k| around.entry(edge(t, k)).or_default().push(index as u32));
        }
        let mut marked: HashSet<Edge> = HashSet::new();
        let mut fresh: Vec<Edge> = vec![];
        let mark = |t: &Tri, marked: &mut HashSet<Edge>, fresh: &mut Vec<Edge>| {
            let longest = edge(t, self.longest(t));
            if marked.insert(longest) {
                fresh.push(longest);
            }
        };
        for &index in wanted {
            mark(&self.triangles[index], &mut marked, &mut fresh);
        }
        let mut count = self.triangles.len();
        while let Some(next) = fresh.pop() {
            let beside = &around[&next];
            count += beside.len();
            if count > most {
                return None;
            }
            for &index in beside {
                mark(&self.triangles[index as usize], &mut marked, &mut fresh);
            }
        }
        let mut middles: HashMap<Edge, u32> = HashMap::new();
        let (mut triangles, mut before) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for index in 0..self.triangles.len() {
            let mut stack = vec![self.triangles[index]];
            while let Some(t) = stack.pop() {
                // Children have two halves of edges, and one new edge, which is not marked.
                let cut = (0..3).filter(|&k| marked.contains(&edge(&t, k)));
                let key = |k: usize| (self.length_squared(edge(&t, k)), edge(&t, k));
                let longest = cut.max_by(|&i, &j| {
                    let ((a, e), (b, f)) = (key(i), key(j));
                    a.total_cmp(&b).then(e.cmp(&f))
                });
                let Some(k) = longest else {
                    triangles.push(t);
                    before.push(index);
                    continue;
                };
                let [a, b, c] = [0, 1, 2].map(|i| t.corners[(k + i) % 3]);
                let along = edge(&t, k);
                let middle = *middles.entry(along).or_insert_with(|| {
                    let [p, q] = [along.0, along.1].map(|v| self.positions[v as usize]);
                    self.positions.push(0.5 * (p + q));
                    self.positions.len() as u32 - 1
                });
                stack.push(Tri { root: t.root, corners: [middle, b, c] });
                stack.push(Tri { root: t.root, corners: [a, middle, c] });
            }
        }
        self.triangles = triangles;
        Some(before)
    }
}

/// Cuts a triangle at the vertices on its edges, in order along each.
fn cut_triangle(t: &Tri, mut on: [Vec<u32>; 3], cut: &mut Vec<Tri>) {
    let Some(k) = (0..3).find(|&k| !on[k].is_empty()) else {
        cut.push(*t);
        return;
    };
    let [a, b, c] = [0, 1, 2].map(|i| t.corners[(k + i) % 3]);
    let mut before = std::mem::take(&mut on[k]);
    let after = before.split_off(before.len() / 2 + 1);
    // The last of the first half is where it is cut: the most even halves.
    let Some(middle) = before.pop() else { return };
    let [next, last] = [1, 2].map(|i| std::mem::take(&mut on[(k + i) % 3]));
    let one = Tri { root: t.root, corners: [a, middle, c] };
    let other = Tri { root: t.root, corners: [middle, b, c] };
    cut_triangle(&one, [before, vec![], last], cut);
    cut_triangle(&other, [after, next, vec![]], cut);
}

/// Vertices by place.
struct Weld {
    tolerance: f64,
    cells: HashMap<[i64; 3], Vec<u32>>,
    positions: Vec<DVec3>,
}

impl Weld {
    fn new(tolerance: f64) -> Weld {
        Weld { tolerance, cells: HashMap::new(), positions: vec![] }
    }

    /// The vertex at a place, which is the first one near enough, or a new one.
    fn vertex(&mut self, p: DVec3) -> u32 {
        // Cells of twice the tolerance: what is near is in this one or in one beside it.
        let cell = |x: f64| (x / (2.0 * self.tolerance).max(f64::MIN_POSITIVE)).floor() as i64;
        let home = p.to_array().map(cell);
        let mut found: Option<u32> = None;
        for k in 0..27 {
            let place: [i64; 3] =
                std::array::from_fn(|a| home[a].saturating_add([k % 3, k / 3 % 3, k / 9][a] - 1));
            for &v in self.cells.get(&place).into_iter().flatten() {
                if self.positions[v as usize].distance(p) <= self.tolerance {
                    found = Some(found.map_or(v, |best| best.min(v)));
                }
            }
        }
        found.unwrap_or_else(|| {
            let new = self.positions.len() as u32;
            self.positions.push(p);
            self.cells.entry(home).or_default().push(new);
            new
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every edge of a closed surface has two sides, and only whole edges meet.
    fn is_closed(mesh: &Conforming) -> bool {
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        for t in &mesh.triangles {
            for k in 0..3 {
                *edges.entry((t.corners[k], t.corners[(k + 1) % 3])).or_default() += 1;
            }
        }
        edges.iter().all(|((a, b), n)| edges.get(&(*b, *a)) == Some(n))
    }

    fn area(mesh: &Conforming) -> f64 {
        let corners = |t: &Tri| t.corners.map(|v| mesh.positions[v as usize]);
        let twice = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).length();
        mesh.triangles.iter().map(|t| 0.5 * twice(corners(t))).sum()
    }

    /// A tetrahedron one of whose edges has a further vertex on one side only.
    fn tetrahedron() -> Conforming {
        let half = DVec3::new(0.5, 0.0, 0.0);
        let positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, half];
        let faces = [[0, 2, 1], [0, 4, 3], [4, 1, 3], [1, 2, 3], [0, 3, 2]];
        let triangles = faces.iter().enumerate();
        let triangles = triangles.map(|(i, &corners)| Tri { root: i as u32, corners }).collect();
        Conforming { positions, triangles }
    }

    #[test]
    fn nothing_hangs_after_cutting_and_refining() {
        let mut mesh = tetrahedron();
        assert!(!is_closed(&mesh));
        mesh.cut_at_hanging(1e-9);
        assert_eq!(mesh.triangles.len(), 6);
        assert!(is_closed(&mesh));
        let whole = area(&mesh);
        // Corner after corner is refined; neighbours follow.
        for round in 0..40 {
            let wanted = [round % mesh.triangles.len(), 0];
            let before = mesh.refine(&wanted, 100_000).unwrap();
            assert_eq!(before.len(), mesh.triangles.len());
            assert!(is_closed(&mesh), "{round}");
        }
        assert!((area(&mesh) - whole).abs() < 1e-12);
        assert!(mesh.triangles.len() > 80);
    }

    #[test]
    fn refinement_that_would_be_too_much_changes_nothing() {
        let mut mesh = tetrahedron();
        mesh.cut_at_hanging(1e-9);
        let before = mesh.triangles.clone();
        assert!(mesh.refine(&[0, 1, 2], 7).is_none());
        assert_eq!(mesh.triangles, before);
    }

    #[test]
    fn places_are_welded_within_the_tolerance_only() {
        let mut weld = Weld::new(1e-3);
        let at = |x: f64| DVec3::new(x, 1.0 - 1e-9, -x);
        let first = weld.vertex(at(0.0));
        assert_eq!(weld.vertex(at(0.0005)), first);
        assert_eq!(weld.vertex(at(-0.0005)), first);
        assert_ne!(weld.vertex(at(0.003)), first);
    }
}
