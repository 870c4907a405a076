//! Neighbours that disagree about which side is their front.
//!
//! Corners run counter-clockwise seen from the front. Where two faces of one surface share an edge,
//! the one runs it from a to b, the other from b to a; if both run it in the same direction, the
//! front of one continues the back of the other, and one of them is black where light should be.
//!
//! **What is counted**: edges of an object that exactly two of its triangles share, corner by corner,
//! both one-sided, both in the same direction.
//!
//! **What is not**: edges of three triangles or more (the rim of a sheet on a sheet, walls that meet
//! a wall), edges that end in the middle of others (there is no neighbour corner by corner), triangles
//! of different objects, and two triangles that lie on each other ([`FOLDED`]): those face the same
//! way, and overlap. Two sheets back to back are one closed surface, and agree.
//!
//! Nothing is changed: which of the two is wrong only the user knows. Cost: O(n log n).

use glam::DVec3;

use super::corners::corner_numbers;
use super::hygiene::about;
use super::notices::Notices;
use super::{Disagreement, Scene};

/// What is said of an object, once; the count is of edges.
pub const DISAGREES: &str = "neighbouring one-sided faces have their fronts on different sides, and \
                             backs are black: recalculate the normals in the modelling program, or \
                             let both sides radiate with --two-sided";

/// Two triangles that share an edge lie on each other when the angle between them is less than
/// this, radians. Corners in f32 that are meant to be in one plane make far smaller angles unless
/// the triangle is a sliver, and no surface is folded as sharply on purpose.
const FOLDED: f64 = 1e-3;

/// Counts edges across which neighbours disagree, in [`Scene::winding`] and in a notice for each
/// object.
pub(crate) fn check(scene: &mut Scene) {
    scene.winding = find(scene);
    let mut notices = Notices::default();
    for own in &scene.winding {
        notices.add_many(about(scene, own.object), DISAGREES, own.edges);
    }
    scene.notices.extend(notices.into_list());
}

/// An edge of a triangle, from the corner with the lower number.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Edge {
    object: u32,
    low: u32,
    high: u32,
    triangle: u32,
    /// Number of the edge in its triangle.
    place: u8,
    /// Whether the triangle runs it from the lower to the higher number.
    forward: bool,
}

fn find(scene: &Scene) -> Vec<Disagreement> {
    let mut edges = Vec::with_capacity(3 * scene.triangles.len());
    for (i, (triangle, corners)) in
        scene.triangles.iter().zip(corner_numbers(&scene.triangles)).enumerate()
    {
        for place in 0..3u8 {
            let (a, b) = (corners[usize::from(place)], corners[usize::from(place + 1) % 3]);
            edges.push(Edge {
                object: triangle.object,
                low: a.min(b),
                high: a.max(b),
                triangle: i as u32,
                place,
                forward: a < b,
            });
        }
    }
    edges.sort_unstable();
    let mut found: Vec<Disagreement> = vec![];
    for group in edges.chunk_by(|a, b| (a.object, a.low, a.high) == (b.object, b.low, b.high)) {
        let [a, b] = group else { continue };
        if a.forward != b.forward || !is_one_sided(scene, a) || !is_one_sided(scene, b) {
            continue;
        }
        if is_folded(scene, a, b) {
            continue;
        }
        match found.last_mut().filter(|own| own.object == a.object) {
            Some(own) => own.edges += 1,
            None => {
                let [p, q] = ends(scene, a);
                found.push(Disagreement { object: a.object, edges: 1, at: p.midpoint(q) });
            }
        }
    }
    found
}

fn is_one_sided(scene: &Scene, edge: &Edge) -> bool {
    let material = scene.triangles[edge.triangle as usize].material as usize;
    scene.materials.get(material).is_some_and(|m| !m.two_sided)
}

fn ends(scene: &Scene, edge: &Edge) -> [DVec3; 2] {
    let t = &scene.triangles[edge.triangle as usize].vertices;
    let k = usize::from(edge.place);
    [t[k], t[(k + 1) % 3]]
}

/// Whether two triangles with a common edge lie on each other.
fn is_folded(scene: &Scene, a: &Edge, b: &Edge) -> bool {
    let [p, q] = ends(scene, a);
    let along = (q - p).normalize_or_zero();
    let across = [a, b].map(|edge| {
        let apex =
            scene.triangles[edge.triangle as usize].vertices[usize::from(edge.place + 2) % 3];
        let away = apex - p;
        (away - away.dot(along) * along).normalize_or_zero()
    });
    let [x, y] = across;
    x.dot(y) > 0.0 && x.cross(y).length() < FOLDED
}

#[cfg(test)]
mod tests {
    use super::super::{Material, Object, Triangle};
    use super::*;
    use glam::DVec2;

    /// Triangles with an object each; material 0 is one-sided, 1 two-sided.
    fn scene(list: &[([[f64; 3]; 3], u32, u32)]) -> Scene {
        let triangle = |&(corners, object, material): &([[f64; 3]; 3], u32, u32)| Triangle {
            vertices: corners.map(DVec3::from),
            uv: [[DVec2::ZERO; 3]; 2],
            colour: [DVec3::ONE; 3],
            material,
            object,
        };
        let plain = |two_sided| Material { two_sided, ..Material::plain("m", DVec3::splat(0.5)) };
        Scene {
            objects: ["box", "rest"].map(|name| Object { name: name.into() }).to_vec(),
            materials: vec![plain(false), plain(true)],
            triangles: list.iter().map(triangle).collect(),
            ..Scene::default()
        }
    }

    fn checked(list: &[([[f64; 3]; 3], u32, u32)]) -> Scene {
        let mut scene = scene(list);
        check(&mut scene);
        scene
    }

    const A: [f64; 3] = [0.0, 0.0, 0.0];
    const B: [f64; 3] = [1.0, 0.0, 0.0];
    const C: [f64; 3] = [1.0, 1.0, 0.0];
    const D: [f64; 3] = [0.0, 1.0, 0.0];
    const UP: [f64; 3] = [0.0, 0.0, 1.0];

    /// The faces of a cube by the corners' bits x + 2 y + 4 z, outward.
    fn cube() -> Vec<[[f64; 3]; 3]> {
        let p = |i: usize| [i & 1, i >> 1 & 1, i >> 2].map(|b| b as f64);
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let halves = |[a, b, c, d]: [usize; 4]| [[p(a), p(b), p(c)], [p(a), p(c), p(d)]];
        quads.into_iter().flat_map(halves).collect()
    }

    #[test]
    fn what_agrees_is_no_finding() {
        let box_of = |turned: bool| -> Vec<_> {
            let turn = |[a, b, c]: [[f64; 3]; 3]| if turned { [a, c, b] } else { [a, b, c] };
            cube().into_iter().map(|t| (turn(t), 0, 0)).collect()
        };
        let quad = [([A, B, C], 0, 0), ([A, C, D], 0, 0)];
        let both = |more: &[([[f64; 3]; 3], u32, u32)]| [&quad[..], more].concat();
        for (list, why) in [
            (box_of(false), "a box"),
            (box_of(true), "a room: all faces are turned"),
            (quad.to_vec(), "a quad"),
            (both(&[([A, C, B], 0, 0), ([A, D, C], 0, 0)]), "two sheets back to back"),
            (both(&[([A, D, B], 0, 0), ([B, D, C], 0, 0)]), "the same with the other diagonal"),
            (both(&[([A, B, D], 0, 0), ([B, C, D], 0, 0)]), "two sheets that face the same way"),
            (both(&[([A, B, UP], 1, 0)]), "a wall of another object"),
            (both(&[([A, B, UP], 0, 1)]), "a two-sided wall"),
            (both(&[([A, C, UP], 0, 0)]), "a wall on the diagonal: three at one edge"),
            (both(&[([A, [0.5, 0.0, 0.0], UP], 0, 0)]), "a wall along half of an edge"),
            (both(&[([A, [0.0, 0.0, -0.0], UP], 0, 0)]), "no edge at all"),
        ] {
            let scene = checked(&list);
            assert!(scene.winding.is_empty() && scene.notices.is_empty(), "{why}");
        }
    }

    #[test]
    fn a_turned_face_is_counted_by_its_edges() {
        let mut list: Vec<_> = cube().into_iter().map(|t| (t, 0, 0)).collect();
        list[3].0.swap(1, 2);
        // What another object does is its own affair.
        list.extend([([A, B, C], 1, 0), ([A, D, C], 1, 0)]);
        let scene = checked(&list);
        assert_eq!(
            scene.winding.iter().map(|w| (w.object, w.edges)).collect::<Vec<_>>(),
            [(0, 3), (1, 1)]
        );
        assert_eq!(scene.winding[1].at, DVec3::new(0.5, 0.5, 0.0));
        let said: Vec<_> = scene.notices.iter().map(|n| (n.about.as_str(), n.count)).collect();
        assert_eq!(said, [("object \"box\"", 3), ("object \"rest\"", 1)]);
        assert!(scene.notices[0].text.contains("--two-sided"));
    }

    #[test]
    fn size_does_not_matter() {
        for scale in [1e-30, 1e-6, 1e6, 1e29] {
            let far = |t: [[f64; 3]; 3]| t.map(|p| p.map(|x| scale * x));
            let sheet = |t| (far(t), 0, 0);
            assert_eq!(checked(&[sheet([A, B, C]), sheet([A, D, C])]).winding.len(), 1);
            assert_eq!(checked(&[sheet([A, B, C]), sheet([A, B, D])]).winding.len(), 0);
        }
    }
}
