//! One order of the objects of a scene, whatever that of the file.
//!
//! Sums are taken in the order of the triangles, faces are joined and cut in it, and points are spread
//! in it: with the objects of a file in another order, all light would differ in its last digits. So
//! triangles are put object by object in an order that follows from where they are. Each object keeps
//! the order of its own triangles, and the list of objects that of the file.

use std::cmp::Ordering;

use glam::DVec3;

use super::{Scene, Triangle};

/// Puts the triangles in order: objects by the corners of their first triangle, of their second if
/// these are equal, and so on; by the order of the file where all of them are.
///
/// Cost: O(n + k log k) for n triangles in k objects, unless many objects begin alike.
pub(super) fn arrange(scene: &mut Scene) {
    let mut objects: Vec<Vec<Triangle>> = vec![vec![]; scene.objects.len()];
    for triangle in std::mem::take(&mut scene.triangles) {
        let object = triangle.object as usize;
        if objects.len() <= object {
            objects.resize(object + 1, vec![]);
        }
        objects[object].push(triangle);
    }
    // A stable sort.
    objects.sort_by(|a, b| compare(a, b));
    scene.triangles = objects.into_iter().flatten().collect();
}

fn compare(a: &[Triangle], b: &[Triangle]) -> Ordering {
    keys(a).cmp(keys(b))
}

/// All corners, one after the other.
fn keys(triangles: &[Triangle]) -> impl Iterator<Item = [u64; 3]> {
    triangles.iter().flat_map(|t| t.vertices).map(key)
}

/// The order of positions: by x, y, z.
fn key(p: DVec3) -> [u64; 3] {
    // Adding zero makes -0 and 0 the same. All coordinates are finite: negative numbers are turned
    // round, and positive ones put above them.
    (p + 0.0).to_array().map(|x| {
        let bits = x.to_bits();
        if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Material, Object};
    use glam::DVec2;

    #[test]
    fn positions_are_in_order() {
        let at = |x: f64| key(DVec3::new(x, 1.0, 2.0));
        let rising = [-1e300, -2.0, -1.0, -1e-300, 0.0, 1e-300, 0.5, 3.0];
        assert!(rising.windows(2).all(|w| at(w[0]) < at(w[1])));
        assert_eq!(at(-0.0), at(0.0));
        assert!(key(DVec3::new(1.0, 5.0, 0.0)) < key(DVec3::new(1.0, 5.0, 1.0)));
    }

    #[test]
    fn the_order_of_objects_does_not_matter() {
        let triangle = |x: f64, y: f64, object| Triangle {
            vertices: [DVec3::X, DVec3::Y, DVec3::Z].map(|p| p + DVec3::new(x, y, 0.0)),
            uv: [[DVec2::ZERO; 3]; 2],
            colour: [DVec3::ONE; 3],
            material: 0,
            object,
        };
        // Three objects; two of them begin alike, one is interleaved with another.
        let of = |names: [usize; 3]| {
            let mut scene = Scene {
                materials: vec![Material::plain("m", DVec3::ONE)],
                objects: (0..3).map(|i| Object { name: i.to_string() }).collect(),
                ..Scene::default()
            };
            let [a, b, c] = names.map(|name| name as u32);
            let all = [
                triangle(3.0, 0.0, a),
                triangle(-1.0, 0.0, b),
                triangle(1.0, 0.0, a),
                triangle(-1.0, 0.0, c),
                triangle(-1.0, 2.0, c),
                triangle(-1.0, 5.0, b),
            ];
            scene.triangles = all.to_vec();
            arrange(&mut scene);
            scene.triangles.iter().map(|t| t.vertices).collect::<Vec<_>>()
        };
        let want = of([0, 1, 2]);
        for names in [[0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            assert_eq!(of(names), want);
        }
        let x = |k: usize| want[k][1];
        assert_eq!(
            [x(0), x(1), x(2), x(3), x(4), x(5)],
            [(-1.0, 0.0), (-1.0, 2.0), (-1.0, 0.0), (-1.0, 5.0), (3.0, 0.0), (1.0, 0.0)]
                .map(|(x, y)| DVec3::Y + DVec3::new(x, y, 0.0))
        );
    }
}
