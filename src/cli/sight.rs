//! Whether a view shows anything, found by some rays before anything long is begun.

use glam::DVec3;
use lumel::geometry::{Bounds, BoxTree, ray};
use lumel::render::CameraRays;
use lumel::scene::{Notice, Scene};

use super::table::figures;
use super::view::View;

/// Rays across the picture and down: what none of them meets covers less than about a thousandth
/// of it.
const ACROSS: u32 = 64;
const DOWN: u32 = 48;

/// Distances of coincident faces differ by less than this, relative.
const SAME: f64 = 1e-12;

/// What the rays of a view met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sight {
    /// Sides that radiate.
    pub sides: usize,
    /// Backs, which are black.
    pub backs: usize,
    /// Nothing.
    pub misses: usize,
}

/// Casts rays through the picture.
pub fn look(scene: &Scene, view: &View) -> Sight {
    let boxes: Vec<Bounds> = scene.triangles.iter().map(|t| Bounds::of(&t.vertices)).collect();
    let tree = BoxTree::build(&boxes);
    let rays = CameraRays::new(&view.camera, view.width, view.height, 1);
    let place = |k: u32, of: u32, size: u32| {
        ((f64::from(k) + 0.5) / f64::from(of) * f64::from(size)) as u32
    };
    let mut sight = Sight::default();
    for j in 0..DOWN {
        for i in 0..ACROSS {
            let ray = rays.sample(place(i, ACROSS, view.width), place(j, DOWN, view.height), 0, 0);
            match radiates(scene, &tree, ray.origin, ray.direction) {
                Some(true) => sight.sides += 1,
                Some(false) => sight.backs += 1,
                None => sight.misses += 1,
            }
        }
    }
    sight
}

/// Whether the nearest thing along a ray is a side that radiates; nothing where there is nothing.
fn radiates(scene: &Scene, tree: &BoxTree, origin: DVec3, direction: DVec3) -> Option<bool> {
    let mut nearest: Option<(f64, bool)> = None;
    tree.cast(origin, direction, f64::INFINITY, |index, end| {
        let triangle = &scene.triangles[index];
        let Some(hit) = ray::intersect(origin, direction, &triangle.vertices) else { return end };
        if hit.t <= 0.0 {
            return end;
        }
        let (normal, _) = triangle.normal_and_area();
        let material = scene.materials.get(triangle.material as usize);
        let radiates = direction.dot(normal) < 0.0 || material.is_some_and(|m| m.two_sided);
        nearest = match nearest {
            // Of coincident faces a side that radiates is what is seen.
            Some((t, seen)) if (hit.t - t).abs() <= SAME * t => Some((t, seen || radiates)),
            Some((t, seen)) if t < hit.t => Some((t, seen)),
            _ => Some((hit.t, radiates)),
        };
        // A little beyond, for what coincides.
        nearest.map_or(end, |(t, _)| t * (1.0 + 10.0 * SAME))
    });
    nearest.map(|(_, radiates)| radiates)
}

/// A warning where a picture would be black because of its view.
pub fn advice(scene: &Scene, view: &View) -> Option<Notice> {
    let sight = look(scene, view);
    if sight.sides > 0 {
        return None;
    }
    let text = if sight.backs > 0 {
        "sees only backs of faces, which are black, so the picture is black: it stands inside of \
         something solid or behind a wall, or the faces of the scene are turned inside out. Choose \
         another view (--camera, or --eye and --look-at), or let both sides of faces radiate \
         (--two-sided)"
            .into()
    } else {
        let (low, high) = scene.bounds();
        format!(
            "sees nothing of the scene, so the picture is black: it stands at {} and looks along {}, \
             and the scene lies between {} and {}. Choose another view (--camera, or --eye and \
             --look-at)",
            figures(&view.camera.eye.to_array()),
            figures(&view.camera.forward.to_array()),
            figures(&low.to_array()),
            figures(&high.to_array())
        )
    };
    Some(Notice { about: format!("camera \"{}\"", view.camera.name), text, count: 1 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use lumel::scene::{Material, Triangle, look_at};

    /// A triangle in the plane z = 0 that faces +z.
    fn scene(two_sided: bool) -> Scene {
        let triangle = Triangle {
            vertices: [DVec3::ZERO, DVec3::X, DVec3::Y],
            uv: [[DVec2::ZERO; 3]; 2],
            colour: [DVec3::ONE; 3],
            material: 0,
            object: 0,
        };
        let material = Material { two_sided, ..Material::plain("grey", DVec3::splat(0.5)) };
        Scene { triangles: vec![triangle], materials: vec![material], ..Scene::default() }
    }

    fn view(z: f64, to: f64) -> View {
        let at = |z| DVec3::new(0.25, 0.25, z);
        View { camera: look_at(at(z), at(to), DVec3::Y, 1.0).unwrap(), width: 30, height: 200 }
    }

    #[test]
    fn rays_meet_sides_backs_or_nothing() {
        let count = (ACROSS * DOWN) as usize;
        let front = look(&scene(false), &view(2.0, 0.0));
        assert!(front.sides > count / 20 && front.backs == 0 && front.misses > 0, "{front:?}");
        let back = look(&scene(false), &view(-2.0, 0.0));
        assert_eq!((back.backs, back.sides), (front.sides, 0));
        assert_eq!(look(&scene(true), &view(-2.0, 0.0)).sides, front.sides);
        assert_eq!(look(&scene(false), &view(2.0, 4.0)).misses, count);
        // However near, a picture full of it.
        assert_eq!(look(&scene(false), &view(1e-6, 0.0)).sides, count);
    }

    #[test]
    fn of_coincident_faces_the_side_that_radiates_is_seen() {
        let mut sheet = scene(false);
        let mut other = sheet.triangles[0].clone();
        other.vertices.swap(1, 2);
        sheet.triangles.push(other);
        for z in [-2.0, 2.0] {
            assert_eq!(look(&sheet, &view(z, 0.0)).backs, 0);
        }
    }

    #[test]
    fn only_a_black_picture_is_warned_of() {
        assert_eq!(advice(&scene(false), &view(2.0, 0.0)), None);
        let behind = advice(&scene(false), &view(-2.0, 0.0)).unwrap().text;
        assert!(behind.contains("backs") && behind.contains("--two-sided"), "{behind}");
        assert_eq!(advice(&scene(true), &view(-2.0, 0.0)), None);
        let away = advice(&scene(false), &view(2.0, 4.0)).unwrap().text;
        assert!(away.contains("0.25 0.25 2") && away.contains("--eye"), "{away}");
    }
}
