//! A scene as it was read, written as JSON for other programs.
//!
//! What is written is what everything else here works on: triangles in world space after all
//! oddities of the file were resolved, and the view of a picture. One object:
//!
//! - `program`: name and version of this program; `scene`: the file that was read.
//! - `objects`: names. `materials`: `name`, `two_sided` (else the back of a face is black and
//!   blocks light).
//! - `triangles`, lists of the same length:
//!   `vertices`: nine coordinates each, metres, corners counter-clockwise seen from the side that
//!   radiates; `material` and `object`: indices; `reflectance` in [0, 1) and emitted `radiance` in
//!   W/(m^2 sr): red, green, blue each.
//! - `averaged`: indices of the triangles with textures or vertex colours, whose reflectance and
//!   radiance are means over the triangle.
//! - `view`: name of the `camera`, `eye` (metres), unit vectors `right`, `up` and `forward`,
//!   `width` and `height` in pixels, and `vertical_fov` (radians, full angle) or, for a camera of
//!   parallel rays, `half_height` (metres). The horizontal extent follows from the picture's shape.
//!
//! Numbers have as many digits as it takes to read the same f64 back.

use std::f64::consts::PI;
use std::path::Path;

use glam::DVec3;
use serde::Serialize;

use crate::error::{Error, Result};
use crate::output::{SOFTWARE, atomic};
use crate::scene::{self, Camera, Projection, Scene, Triangle};

#[derive(Serialize)]
struct Export<'a> {
    program: &'static str,
    scene: String,
    objects: Vec<&'a str>,
    materials: Vec<MaterialEntry<'a>>,
    triangles: Triangles,
    averaged: Vec<usize>,
    view: ViewEntry<'a>,
}

#[derive(Serialize)]
struct MaterialEntry<'a> {
    name: &'a str,
    two_sided: bool,
}

#[derive(Serialize)]
struct Triangles {
    vertices: Vec<[f64; 9]>,
    material: Vec<u32>,
    object: Vec<u32>,
    reflectance: Vec<[f64; 3]>,
    radiance: Vec<[f64; 3]>,
}

#[derive(Serialize)]
struct ViewEntry<'a> {
    camera: &'a str,
    eye: [f64; 3],
    right: [f64; 3],
    up: [f64; 3],
    forward: [f64; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    vertical_fov: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    half_height: Option<f64>,
    width: u32,
    height: u32,
}

/// The scene and a view of it, of `size` (width, height) pixels, as JSON text.
///
/// # Errors
///
/// [`Error::Runtime`] when no text can be made, which no scene that was read leads to.
pub fn export_json(scene: &Scene, camera: &Camera, size: (u32, u32)) -> Result<String> {
    let whole = [DVec3::X, DVec3::Y, DVec3::Z];
    let triangles = &scene.triangles;
    let (vertical_fov, half_height) = match camera.projection {
        Projection::Perspective { vertical_fov, .. } => (Some(vertical_fov), None),
        Projection::Orthographic { half_height, .. } => (None, Some(half_height)),
    };
    let each = |value: &dyn Fn(usize) -> DVec3| -> Vec<[f64; 3]> {
        (0..triangles.len()).map(|index| value(index).to_array()).collect()
    };
    let export = Export {
        program: SOFTWARE,
        scene: scene.path.display().to_string(),
        objects: scene.objects.iter().map(|o| o.name.as_str()).collect(),
        materials: scene
            .materials
            .iter()
            .map(|m| MaterialEntry { name: &m.name, two_sided: m.two_sided })
            .collect(),
        triangles: Triangles {
            vertices: triangles.iter().map(coordinates).collect(),
            material: triangles.iter().map(|t| t.material).collect(),
            object: triangles.iter().map(|t| t.object).collect(),
            reflectance: each(&|index| scene::reflectance(scene, index, &whole)),
            radiance: each(&|index| scene::exitance(scene, index, &whole) / PI),
        },
        averaged: (0..triangles.len()).filter(|&index| varies(scene, index)).collect(),
        view: ViewEntry {
            camera: &camera.name,
            eye: camera.eye.to_array(),
            right: camera.right.to_array(),
            up: camera.up.to_array(),
            forward: camera.forward.to_array(),
            vertical_fov,
            half_height,
            width: size.0,
            height: size.1,
        },
    };
    serde_json::to_string(&export)
        .map(|text| text + "\n")
        .map_err(|e| Error::Runtime(format!("the scene cannot be written as JSON: {e}")))
}

/// Writes the scene and a view of it to a file, whole or not at all.
pub fn write_export(path: &Path, scene: &Scene, camera: &Camera, size: (u32, u32)) -> Result<()> {
    atomic::write_whole(path, export_json(scene, camera, size)?.as_bytes())
}

fn coordinates(triangle: &Triangle) -> [f64; 9] {
    std::array::from_fn(|k| triangle.vertices[k / 3][k % 3])
}

/// Whether reflectance or radiance may differ from point to point of a triangle.
fn varies(scene: &Scene, triangle: usize) -> bool {
    let triangle = &scene.triangles[triangle];
    let material = &scene.materials[triangle.material as usize];
    let [a, b, c] = triangle.colour;
    a != b
        || b != c
        || material.reflectance_texture.is_some()
        || (material.metallic_texture.is_some() && material.metallic != 0.0)
        || (material.radiance_texture.is_some() && material.radiance != DVec3::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Material, Object, look_at};
    use glam::{DVec2, dvec3};

    fn scene() -> Scene {
        let triangle = |vertices, material| Triangle {
            vertices,
            uv: [[DVec2::ZERO; 3]; 2],
            colour: [DVec3::ONE; 3],
            material,
            object: 0,
        };
        let lamp = Material {
            radiance: dvec3(0.1, 0.2, 0.3),
            two_sided: true,
            ..Material::plain("lamp", DVec3::ZERO)
        };
        let mut shaded = triangle([DVec3::ZERO, DVec3::X, DVec3::Y], 0);
        shaded.colour = [DVec3::ZERO, DVec3::splat(0.5), DVec3::ONE];
        Scene {
            path: "s.obj".into(),
            objects: vec![Object { name: "o".into() }],
            materials: vec![Material::plain("floor", dvec3(0.5, 0.25, 0.125)), lamp],
            triangles: vec![
                triangle([dvec3(0.1, 0.0, 1e-300), 2.0 * DVec3::X, dvec3(1.0 / 3.0, 1.0, 0.0)], 0),
                shaded,
                triangle([DVec3::Z, DVec3::X, DVec3::ONE], 1),
            ],
            ..Scene::default()
        }
    }

    fn exported(camera: &Camera) -> serde_json::Value {
        serde_json::from_str(&export_json(&scene(), camera, (64, 48)).unwrap()).unwrap()
    }

    #[test]
    fn coordinates_read_back_bit_for_bit_and_light_is_radiance() {
        let camera = look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 0.7).unwrap();
        let json = exported(&camera);
        let triangles = &json["triangles"];
        let vertex = |i: usize, k: usize| triangles["vertices"][i][k].as_f64().unwrap();
        assert_eq!([0, 1, 2, 3, 6].map(|k| vertex(0, k)), [0.1, 0.0, 1e-300, 2.0, 1.0 / 3.0]);
        assert_eq!(triangles["material"], serde_json::json!([0, 0, 1]));
        let radiance = triangles["radiance"][2][1].as_f64().unwrap();
        assert!((radiance - 0.2).abs() < 1e-16);
        assert_eq!(json["materials"][1]["two_sided"], true);
        assert_eq!(json["materials"][0]["two_sided"], false);
        assert_eq!(json["view"]["vertical_fov"], 0.7);
        assert!(json["view"].get("half_height").is_none());
        assert_eq!((&json["view"]["width"], &json["view"]["height"]), (&64.into(), &48.into()));
    }

    #[test]
    fn what_varies_is_averaged_and_said() {
        let mut camera = look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 0.7).unwrap();
        camera.projection = Projection::Orthographic { half_width: 3.0, half_height: 2.0 };
        let json = exported(&camera);
        assert_eq!(json["averaged"], serde_json::json!([1]));
        // The mean of vertex colours is that at the centroid, one half.
        let mean = json["triangles"]["reflectance"][1][0].as_f64().unwrap();
        assert!((mean - 0.25).abs() < 1e-15);
        assert_eq!(json["view"]["half_height"], 2.0);
        assert!(json["view"].get("vertical_fov").is_none());
    }
}
