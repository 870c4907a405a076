//! What a scene lacks so that a user would be surprised by its light.

use glam::DVec3;
use lumel::scene::{self, Notice, Scene};
use lumel::solve::Light;

use super::table::figure;

/// How many materials are named before they are only counted.
const NAMED: usize = 8;

/// Scenes smaller or larger than this, metres, are likely to have been made in another unit: a coin
/// and a town lie between.
const USUAL_SIZES: std::ops::Range<f64> = 1e-3..1e4;

/// Most pairs of an emitting and another face that are looked at: a tenth of a second.
const MOST_PAIRS: usize = 10_000_000;

/// Warnings about the scene as a whole, in the words of the command line.
pub fn advice(scene: &Scene, light_scale: f64) -> Vec<Notice> {
    let mut notices = darkness(scene, light_scale);
    let size = scene.extent();
    if !USUAL_SIZES.contains(&size) {
        notices.extend(of_scene(vec![format!(
            "it is {} m large, as lengths are read as metres: if another unit was meant, scale the \
             scene where it was made. Light is the same in any unit; --eye, --look-at, --max-edge, \
             --texels-per-metre and points to probe are not",
            figure(size)
        )]));
    }
    notices
}

/// Warnings that the scene is dark.
pub fn darkness(scene: &Scene, light_scale: f64) -> Vec<Notice> {
    let whole_face = [DVec3::X, DVec3::Y, DVec3::Z];
    let any = |quantity: fn(&Scene, usize, &[DVec3; 3]) -> DVec3| {
        (0..scene.triangles.len()).any(|i| quantity(scene, i, &whole_face) != DVec3::ZERO)
    };
    let mut texts = vec![];
    if light_scale == 0.0 {
        texts.push("--light-scale 0 puts out all light, so everything is black".into());
    } else if !any(scene::exitance) {
        texts.push(format!(
            "nothing emits light, so everything is black: let a material emit with --emission \
             NAME=R,G,B ({})",
            materials(scene)
        ));
    }
    if !any(scene::reflectance) {
        texts.push(format!(
            "nothing reflects light, so all but the emitters is black: let a material reflect \
             with --reflectance NAME=R,G,B ({})",
            materials(scene)
        ));
    }
    // Where nothing else could show light, that has been said.
    if any(scene::reflectance) && emitters_face_nothing(scene) {
        texts.push(
            "faces that emit light and all other faces are turned away from each other, so no light \
             arrives anywhere: are faces inside out? Turn them around where the scene was made, or \
             let both sides radiate with --two-sided"
                .into(),
        );
    }
    of_scene(texts)
}

/// Warnings that only solving tells: of light that is there, but arrives nowhere.
pub fn advice_of_light(scene: &Scene, light: &Light) -> Vec<Notice> {
    let arrives = match light.apart() {
        Some(source) => source.estimate.mean != DVec3::ZERO,
        None => light.solution.irradiance.iter().any(|h| *h != DVec3::ZERO),
    };
    let whole_face = [DVec3::X, DVec3::Y, DVec3::Z];
    let emits = |i| scene::exitance(scene, i, &whole_face) != DVec3::ZERO;
    // What was known before has been said.
    if arrives || !(0..scene.triangles.len()).any(emits) || emitters_face_nothing(scene) {
        return vec![];
    }
    of_scene(vec![
        "light is emitted, but arrives at no surface: are the lamps inside of other things, or \
         covered by them? Move them where the scene was made, or let both sides of faces radiate with \
         --two-sided"
            .into(),
    ])
}

fn of_scene(texts: Vec<String>) -> Vec<Notice> {
    texts.into_iter().map(|text| Notice { about: "scene".into(), text, count: 1 }).collect()
}

/// Whether something emits, and it is certain that its light arrives nowhere, whatever is in
/// between: of an emitting and any other face, one lies behind the other. `false` where there are
/// too many pairs to tell.
fn emitters_face_nothing(scene: &Scene) -> bool {
    let whole_face = [DVec3::X, DVec3::Y, DVec3::Z];
    let emits = |i: &usize| scene::exitance(scene, *i, &whole_face) != DVec3::ZERO;
    let emitters: Vec<usize> = (0..scene.triangles.len()).filter(emits).collect();
    if emitters.is_empty() || emitters.len() * scene.triangles.len() > MOST_PAIRS {
        return false;
    }
    // A face that only touches the plane of another is not in front of it.
    let touching = scene.contact_distance();
    let planes: Vec<(DVec3, bool)> = scene
        .triangles
        .iter()
        .map(|t| (t.normal_and_area().0, scene.materials[t.material as usize].two_sided))
        .collect();
    // Whether some of b lies on a side of a that radiates.
    let shines_at = |a: usize, b: usize| {
        let (normal, two_sided) = planes[a];
        let origin = scene.triangles[a].vertices[0];
        scene.triangles[b].vertices.iter().any(|p| {
            let height = normal.dot(*p - origin);
            height > touching || (two_sided && height < -touching)
        })
    };
    !emitters
        .iter()
        .any(|&a| (0..planes.len()).any(|b| b != a && shines_at(a, b) && shines_at(b, a)))
}

/// The materials that faces have, by name.
fn materials(scene: &Scene) -> String {
    let mut used = vec![false; scene.materials.len()];
    scene.triangles.iter().for_each(|t| used[t.material as usize] = true);
    let names: Vec<&str> = scene
        .materials
        .iter()
        .zip(used)
        .filter(|(_, used)| *used)
        .map(|(material, _)| material.name.as_str())
        .collect();
    let listed = names[..names.len().min(NAMED)].join(", ");
    match names.len().saturating_sub(NAMED) {
        0 => format!("there is {listed}"),
        more => format!("there is {listed} and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use lumel::scene::{Material, Triangle};

    /// A face of each material: the first looks up, the others, a metre above it, look down.
    fn scene(materials: Vec<Material>) -> Scene {
        let triangle = |material| Triangle {
            vertices: match material {
                0 => [DVec3::ZERO, DVec3::X, DVec3::Y],
                _ => [DVec3::Z, DVec3::Z + DVec3::Y, DVec3::Z + DVec3::X],
            },
            uv: [[DVec2::ZERO; 3]; 2],
            colour: [DVec3::ONE; 3],
            material,
            object: 0,
        };
        let triangles = (0..materials.len() as u32).map(triangle).collect();
        Scene { triangles, materials, ..Scene::default() }
    }

    fn lamp() -> Material {
        Material { radiance: DVec3::X, ..Material::plain("lamp", DVec3::ZERO) }
    }

    #[test]
    fn a_scene_with_light_and_colour_needs_no_advice() {
        let lit = scene(vec![lamp(), Material::plain("wall", DVec3::Y)]);
        assert_eq!(advice(&lit, 1.0), []);
    }

    #[test]
    fn lamps_that_are_turned_away_are_told_from_those_that_shine() {
        let mut away = scene(vec![lamp(), Material::plain("wall", DVec3::Y)]);
        let shown =
            |scene: &Scene| advice(scene, 1.0).iter().any(|n| n.text.contains("--two-sided"));
        assert!(!shown(&away));
        // Of one of the two that is turned around no light goes to the other.
        for k in 0..2 {
            away.triangles[k].vertices.swap(1, 2);
            assert!(shown(&away), "{k}");
            away.materials.iter_mut().for_each(|m| m.two_sided = true);
            assert!(!shown(&away), "{k}");
            away.materials.iter_mut().for_each(|m| m.two_sided = false);
            away.triangles[k].vertices.swap(1, 2);
        }
        // Nor does any within one plane.
        away.triangles[1].vertices = [DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        assert!(shown(&away));
    }

    #[test]
    fn unusual_sizes_are_said_to_be_metres() {
        let sized = |factor: f64| {
            let mut scene = scene(vec![lamp(), Material::plain("wall", DVec3::Y)]);
            scene.triangles.iter_mut().flat_map(|t| &mut t.vertices).for_each(|p| *p *= factor);
            advice(&scene, 1.0).into_iter().map(|n| n.text).collect::<Vec<_>>().join("\n")
        };
        assert_eq!(sized(1e-2) + &sized(9e3), "");
        for (factor, text) in [(2e4, "20000 m large"), (5e-4, "5.000e-4 m large")] {
            assert!(sized(factor).contains(text), "{}", sized(factor));
        }
    }

    #[test]
    fn darkness_is_said_with_its_cause_and_remedy() {
        let said = |materials, scale| {
            let list = advice(&scene(materials), scale);
            list.into_iter().map(|n| n.text).collect::<Vec<_>>().join("\n")
        };
        let wall = Material::plain("wall", DVec3::ONE);
        let dark = said(vec![wall.clone(); 10], 1.0);
        assert!(dark.contains("--emission") && dark.contains("wall and 2 more"), "{dark}");
        assert!(!dark.contains("--reflectance"), "{dark}");
        assert!(said(vec![lamp(), wall], 0.0).contains("--light-scale"));
        let black = said(vec![lamp()], 1.0);
        assert!(black.contains("--reflectance") && black.contains("lamp"), "{black}");
        assert!(!black.contains("--emission"), "{black}");
        // A lamp that no face has lights nothing.
        let mut unused = scene(vec![Material::plain("wall", DVec3::ONE)]);
        unused.materials.push(lamp());
        let text = &advice(&unused, 1.0)[0].text;
        assert!(text.contains("there is wall)"), "{text}");
    }
}
