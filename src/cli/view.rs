//! Which camera a picture is seen from, and how large the picture is.

use lumel::scene::{Camera, Projection, Scene, default_camera, look_at};
use lumel::{Error, Result};

use super::settings::{ViewChoice, ViewSettings};

/// Longer side of a picture whose size is not given, pixels.
const USUAL_SIDE: u32 = 960;

/// Width over height where neither the user nor the camera fixes it.
const USUAL_ASPECT: f64 = 16.0 / 9.0;

/// A camera and the size of its picture.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Where the picture is seen from.
    pub camera: Camera,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// The view that was asked for.
pub fn choose(scene: &Scene, settings: &ViewSettings) -> Result<View> {
    let camera = match &settings.choice {
        ViewChoice::First => scene.cameras.first().cloned(),
        ViewChoice::Named(name) => Some(find(scene, name)?.clone()),
        ViewChoice::Eye(own) => Some(look_at(own.eye, own.look_at, own.up, own.vertical_fov)?),
    };
    let camera = camera.unwrap_or_else(|| default_camera(scene));
    let (width, height) = settings.size.unwrap_or_else(|| usual_size(&camera.projection));
    Ok(View { camera, width, height })
}

/// A camera by its name, or else by its number. A name that several cameras share means the first.
fn find<'a>(scene: &'a Scene, name: &str) -> Result<&'a Camera> {
    let by_name = scene.cameras.iter().find(|camera| camera.name == name);
    let by_number = || name.parse::<usize>().ok().and_then(|index| scene.cameras.get(index));
    by_name.or_else(by_number).ok_or_else(|| {
        let there: Vec<String> = scene
            .cameras
            .iter()
            .enumerate()
            .map(|(index, camera)| format!("{index} \"{}\"", camera.name))
            .collect();
        let path = scene.path.display();
        Error::Usage(if there.is_empty() {
            format!(
                "--camera {name}: {path} has no cameras; give a view with --eye and --look-at, or \
                 leave --camera out"
            )
        } else {
            format!("--camera {name}: {path} has no such camera; it has {}", there.join(", "))
        })
    })
}

/// A size with the longer side [`USUAL_SIDE`].
fn usual_size(projection: &Projection) -> (u32, u32) {
    let aspect = match *projection {
        Projection::Perspective { aspect, .. } => aspect.unwrap_or(USUAL_ASPECT),
        Projection::Orthographic { half_width, half_height } => half_width / half_height,
    };
    let other = |ratio: f64| ((f64::from(USUAL_SIDE) * ratio).round() as u32).max(1);
    if aspect >= 1.0 { (USUAL_SIDE, other(1.0 / aspect)) } else { (other(aspect), USUAL_SIDE) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn camera(name: &str, aspect: Option<f64>) -> Camera {
        let mut camera = look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 0.7).unwrap();
        camera.name = name.into();
        camera.projection = Projection::Perspective { vertical_fov: 0.7, aspect };
        camera
    }

    fn chosen(scene: &Scene, choice: ViewChoice) -> Result<View> {
        choose(scene, &ViewSettings { choice, size: None })
    }

    #[test]
    fn names_come_before_numbers() {
        let scene = Scene {
            cameras: vec![camera("1", None), camera("desk", Some(0.5))],
            ..Scene::default()
        };
        let name_of =
            |name: &str| chosen(&scene, ViewChoice::Named(name.into())).unwrap().camera.name;
        assert_eq!(name_of("1"), "1");
        assert_eq!(name_of("0"), "1");
        assert_eq!(name_of("desk"), "desk");
        assert_eq!(chosen(&scene, ViewChoice::First).unwrap().camera.name, "1");
        for wrong in ["2", "Desk", "-1"] {
            let failure = chosen(&scene, ViewChoice::Named(wrong.into())).unwrap_err();
            assert_eq!(failure.exit_code(), 2);
            assert!(failure.to_string().contains("0 \"1\", 1 \"desk\""), "{failure}");
        }
    }

    #[test]
    fn a_camera_asked_for_in_a_scene_without_any_is_an_error_that_teaches() {
        let failure = chosen(&Scene::default(), ViewChoice::Named("a".into())).unwrap_err();
        assert!(failure.to_string().contains("--eye"), "{failure}");
    }

    #[test]
    fn the_size_follows_the_camera_unless_it_is_given() {
        let mut scene = Scene { cameras: vec![camera("a", Some(0.5))], ..Scene::default() };
        let size = |scene: &Scene, size| {
            let view = choose(scene, &ViewSettings { choice: ViewChoice::First, size }).unwrap();
            (view.width, view.height)
        };
        assert_eq!(size(&scene, None), (480, 960));
        assert_eq!(size(&scene, Some((10, 10))), (10, 10));
        scene.cameras[0].projection = Projection::Perspective { vertical_fov: 0.7, aspect: None };
        assert_eq!(size(&scene, None), (960, 540));
        scene.cameras[0].projection =
            Projection::Orthographic { half_width: 3.0, half_height: 1.0 };
        assert_eq!(size(&scene, None), (960, 320));
        // However narrow, a picture has a pixel.
        scene.cameras[0].projection =
            Projection::Orthographic { half_width: 1e6, half_height: 1.0 };
        assert_eq!(size(&scene, None), (960, 1));
    }
}
