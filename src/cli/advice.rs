//! What a scene lacks so that a user would be surprised by its light.

use glam::DVec3;
use lumel::scene::{self, Notice, Scene};

/// How many materials are named before they are only counted.
const NAMED: usize = 8;

/// Warnings about the scene as a whole, in the words of the command line.
pub fn advice(scene: &Scene, light_scale: f64) -> Vec<Notice> {
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
    texts.into_iter().map(|text| Notice { about: "scene".into(), text, count: 1 }).collect()
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

    /// A face of each material.
    fn scene(materials: Vec<Material>) -> Scene {
        let triangle = |material| Triangle {
            vertices: [DVec3::ZERO, DVec3::X, DVec3::Y],
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
