//! What was read, in numbers: for people as aligned text, for programs as JSON.

use std::f64::consts::PI;

use glam::DVec3;
use lumel::bake::second_sets;
use lumel::scene::{self, Camera, Projection, Scene};
use serde::Serialize;

use super::audit_text::AuditBlock;
use super::console;
use super::forecast::Forecast;
use super::table::{Table, figure, figures};
use super::view::View;

/// A scene in numbers. Colours are red, green, blue; lengths are metres.
#[derive(Debug, Serialize)]
pub struct Description {
    scene: String,
    objects: usize,
    faces: usize,
    /// Sides that radiate: two for each face of a two-sided material.
    sides: usize,
    /// Of the faces, square metres.
    area: f64,
    bounds: [[f64; 3]; 2],
    materials: Vec<MaterialLine>,
    /// Light that all emitters send out, W.
    power: [f64; 3],
    cameras: Vec<CameraLine>,
    /// Objects whose second set of texture coordinates cannot hold a lightmap.
    lightmap_coordinates: Vec<CoordinatesLine>,
    view: ViewLine,
    /// What solving it would take.
    forecast: Forecast,
    notices: Vec<NoticeLine>,
    /// What an audit found, where one was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    audit: Option<AuditBlock>,
}

#[derive(Debug, Serialize)]
struct MaterialLine {
    name: String,
    faces: usize,
    /// Of its faces, square metres.
    area: f64,
    two_sided: bool,
    /// Mean over its faces, textures and vertex colours included.
    reflectance: [f64; 3],
    /// Mean over its faces, W/(m^2 sr).
    radiance: [f64; 3],
    /// Of all its sides, W.
    power: [f64; 3],
    textures: Vec<&'static str>,
}

#[derive(Debug, Serialize)]
struct CameraLine {
    index: usize,
    name: String,
    eye: [f64; 3],
    forward: [f64; 3],
    up: [f64; 3],
    #[serde(flatten)]
    projection: ProjectionLine,
}

#[derive(Debug, Serialize)]
#[serde(tag = "projection", rename_all = "lowercase")]
enum ProjectionLine {
    Perspective { vertical_fov_degrees: f64, aspect: Option<f64> },
    Orthographic { half_width: f64, half_height: f64 },
}

/// Faces of an object by what is wrong with their second set of texture coordinates.
#[derive(Debug, Serialize)]
struct CoordinatesLine {
    object: String,
    faces: usize,
    /// It has none.
    missing: usize,
    /// Others without area.
    flat: usize,
    /// A corner is outside of the unit square.
    outside: usize,
    /// They overlap others.
    overlapping: usize,
}

#[derive(Debug, Serialize)]
struct ViewLine {
    camera: String,
    eye: [f64; 3],
    forward: [f64; 3],
    width: u32,
    height: u32,
}

#[derive(Debug, Serialize)]
struct NoticeLine {
    about: String,
    text: String,
    count: usize,
    #[serde(skip)]
    line: String,
}

/// Sums over the faces of one material.
#[derive(Clone, Default)]
struct Sums {
    faces: usize,
    area: f64,
    reflected: DVec3,
    emitted: DVec3,
}

/// Describes a scene, the view that a picture of it would have and what solving it would take.
pub fn describe(scene: &Scene, view: &View, forecast: Forecast) -> Description {
    let whole_face = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut sums = vec![Sums::default(); scene.materials.len()];
    for (index, triangle) in scene.triangles.iter().enumerate() {
        let (_, area) = triangle.normal_and_area();
        let sum = &mut sums[triangle.material as usize];
        sum.faces += 1;
        sum.area += area;
        sum.reflected += area * scene::reflectance(scene, index, &whole_face);
        sum.emitted += area * scene::exitance(scene, index, &whole_face);
    }
    let materials: Vec<MaterialLine> = scene
        .materials
        .iter()
        .zip(&sums)
        .map(|(material, sum)| material_line(material, sum))
        .collect();
    let (low, high) = scene.bounds();
    let power = materials.iter().fold(DVec3::ZERO, |sum, m| sum + DVec3::from(m.power));
    Description {
        scene: scene.path.display().to_string(),
        objects: scene.objects.len(),
        faces: scene.triangles.len(),
        sides: materials.iter().map(|m| m.faces * sides(m.two_sided)).sum(),
        area: materials.iter().map(|m| m.area).sum(),
        bounds: [low.into(), high.into()],
        materials,
        power: power.into(),
        cameras: scene.cameras.iter().enumerate().map(camera_line).collect(),
        lightmap_coordinates: second_sets(scene)
            .iter()
            .filter(|set| set.triangles > 0 && !set.is_valid())
            .map(|set| CoordinatesLine {
                object: scene.objects[set.object as usize].name.clone(),
                faces: set.triangles,
                missing: set.missing,
                flat: set.flat,
                outside: set.outside,
                overlapping: set.overlapping,
            })
            .collect(),
        view: ViewLine {
            camera: view.camera.name.clone(),
            eye: view.camera.eye.into(),
            forward: view.camera.forward.into(),
            width: view.width,
            height: view.height,
        },
        forecast,
        notices: scene
            .notices
            .iter()
            .map(|notice| NoticeLine {
                about: notice.about.clone(),
                text: notice.text.clone(),
                count: notice.count,
                line: console::line(notice),
            })
            .collect(),
        audit: None,
    }
}

fn sides(two_sided: bool) -> usize {
    if two_sided { 2 } else { 1 }
}

fn material_line(material: &scene::Material, sum: &Sums) -> MaterialLine {
    // A material that no face uses has no mean; what its factors say stands in for it.
    let (reflectance, radiance) = if sum.area > 0.0 {
        (sum.reflected / sum.area, sum.emitted / (PI * sum.area))
    } else {
        (material.reflectance * (1.0 - material.metallic), material.radiance)
    };
    let textures = [
        ("reflectance", &material.reflectance_texture),
        ("metallic", &material.metallic_texture),
        ("radiance", &material.radiance_texture),
    ];
    MaterialLine {
        name: material.name.clone(),
        faces: sum.faces,
        area: sum.area,
        two_sided: material.two_sided,
        reflectance: reflectance.into(),
        radiance: radiance.into(),
        power: (sum.emitted * sides(material.two_sided) as f64).into(),
        textures: textures.iter().filter(|(_, t)| t.is_some()).map(|(name, _)| *name).collect(),
    }
}

fn camera_line((index, camera): (usize, &Camera)) -> CameraLine {
    let projection = match camera.projection {
        Projection::Perspective { vertical_fov, aspect } => {
            ProjectionLine::Perspective { vertical_fov_degrees: vertical_fov.to_degrees(), aspect }
        }
        Projection::Orthographic { half_width, half_height } => {
            ProjectionLine::Orthographic { half_width, half_height }
        }
    };
    CameraLine {
        index,
        name: camera.name.clone(),
        eye: camera.eye.into(),
        forward: camera.forward.into(),
        up: camera.up.into(),
        projection,
    }
}

impl Description {
    /// Adds what an audit found.
    pub fn add_audit(&mut self, audit: AuditBlock) {
        self.audit = Some(audit);
    }

    /// For people.
    pub fn to_text(&self) -> String {
        let [low, high] = self.bounds;
        let size: Vec<f64> = low.iter().zip(high).map(|(low, high)| high - low).collect();
        let mut summary = Table::new(&["scene", &self.scene]);
        let mut line = |name: &str, value: String| summary.row(vec![name.into(), value]);
        line("objects", self.objects.to_string());
        line("faces", format!("{} ({} sides that radiate)", self.faces, self.sides));
        line("area", format!("{} m^2", figure(self.area)));
        line("bounds", format!("{}  to  {}  m", figures(&low), figures(&high)));
        line("size", format!("{} m", figures(&size)));
        line("power", format!("{} W", figures(&self.power)));
        line(
            "view",
            format!(
                "camera \"{}\" at {} looking along {}, {} x {} pixels",
                self.view.camera,
                figures(&self.view.eye),
                figures(&self.view.forward),
                self.view.width,
                self.view.height
            ),
        );
        let Forecast { elements, nodes, .. } = self.forecast;
        line("mesh", format!("{elements} elements, {nodes} nodes"));
        line("operator", self.forecast.memory_text());
        let mut text = summary.to_text();
        text.push_str(&self.materials_text());
        text.push_str(&self.emitters_text());
        text.push_str(&self.cameras_text());
        text.push_str(&self.coordinates_text());
        // An audit has them among its findings.
        if let Some(audit) = &self.audit {
            text.push_str(&audit.to_text());
        } else if !self.notices.is_empty() {
            text.push_str(&format!("\nnotices ({})\n", self.notices.len()));
            for notice in &self.notices {
                text.push_str(&format!("  {}\n", notice.line));
            }
        }
        text
    }

    /// What is wrong with second sets of texture coordinates; those that are missing altogether are
    /// the usual case, and counted.
    fn coordinates_text(&self) -> String {
        let (missing, bad): (Vec<_>, Vec<_>) =
            self.lightmap_coordinates.iter().partition(|line| line.missing == line.faces);
        let mut text = String::new();
        if !missing.is_empty() {
            text.push_str(&format!(
                "\nlightmap coordinates (TEXCOORD_1)\n  missing in {} of {} objects: bake makes them\n",
                missing.len(),
                self.objects
            ));
        }
        if !bad.is_empty() {
            let head = ["not usable", "faces", "missing", "flat", "outside", "overlapping"];
            let mut table = Table::new(&head);
            for line in bad {
                let counts = [line.faces, line.missing, line.flat, line.outside, line.overlapping];
                let counts = counts.iter().map(|n| n.to_string());
                table.row([line.object.clone()].into_iter().chain(counts).collect());
            }
            let head = if text.is_empty() { "\nlightmap coordinates (TEXCOORD_1)\n" } else { "" };
            text.push_str(&format!("{head}{}  bake makes new ones for these\n", table.to_text()));
        }
        text
    }

    fn materials_text(&self) -> String {
        let mut table =
            Table::new(&["name", "faces", "area m^2", "sides", "mean reflectance", "textures"]);
        for m in &self.materials {
            table.row(vec![
                m.name.clone(),
                m.faces.to_string(),
                figure(m.area),
                sides(m.two_sided).to_string(),
                figures(&m.reflectance),
                m.textures.join(", "),
            ]);
        }
        format!("\nmaterials ({})\n{}", self.materials.len(), table.to_text())
    }

    fn emitters_text(&self) -> String {
        let emitters: Vec<&MaterialLine> =
            self.materials.iter().filter(|m| m.radiance.iter().any(|&v| v > 0.0)).collect();
        if emitters.is_empty() {
            return "\nemitters (0)\n".into();
        }
        let mut table =
            Table::new(&["material", "faces", "area m^2", "mean radiance W/(m^2 sr)", "power W"]);
        for m in &emitters {
            table.row(vec![
                m.name.clone(),
                m.faces.to_string(),
                figure(m.area),
                figures(&m.radiance),
                figures(&m.power),
            ]);
        }
        format!("\nemitters ({})\n{}", emitters.len(), table.to_text())
    }

    fn cameras_text(&self) -> String {
        if self.cameras.is_empty() {
            return "\ncameras (0)\n".into();
        }
        let mut table = Table::new(&["index", "name", "eye m", "looking along", "projection"]);
        for camera in &self.cameras {
            let projection = match camera.projection {
                ProjectionLine::Perspective { vertical_fov_degrees, aspect } => format!(
                    "perspective, {} degrees high{}",
                    figure(vertical_fov_degrees),
                    aspect.map(|a| format!(", aspect {}", figure(a))).unwrap_or_default()
                ),
                ProjectionLine::Orthographic { half_width, half_height } => format!(
                    "orthographic, {} x {} m",
                    figure(2.0 * half_width),
                    figure(2.0 * half_height)
                ),
            };
            table.row(vec![
                camera.index.to_string(),
                camera.name.clone(),
                figures(&camera.eye),
                figures(&camera.forward),
                projection,
            ]);
        }
        format!("\ncameras ({})\n{}", self.cameras.len(), table.to_text())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use lumel::scene::{Material, Notice, Object, Triangle, look_at};

    /// A floor of 2 m^2 and a two-sided lamp of 0.5 m^2.
    fn scene() -> Scene {
        let triangle = |vertices, material| Triangle {
            vertices,
            uv: [[DVec2::ZERO; 3]; 2],
            colour: [DVec3::ONE; 3],
            material,
            object: 0,
        };
        let (x, y) = (DVec3::X, DVec3::Y);
        let lamp = Material {
            radiance: DVec3::new(2.0, 1.0, 0.0),
            two_sided: true,
            ..Material::plain("lamp", DVec3::ZERO)
        };
        let mut camera = look_at(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, DVec3::Y, 0.7).unwrap();
        camera.name = "Eye".into();
        Scene {
            path: "rooms/s.gltf".into(),
            objects: vec![Object { name: "o".into() }],
            materials: vec![
                Material::plain("floor", DVec3::new(0.5, 0.25, 0.125)),
                lamp,
                Material::plain("unused", DVec3::splat(0.9)),
            ],
            triangles: vec![
                triangle([DVec3::ZERO, 2.0 * x, 2.0 * x + y], 0),
                triangle([DVec3::ZERO, 2.0 * x + y, y], 0),
                triangle([DVec3::Z, x + DVec3::Z, y + DVec3::Z], 1),
            ],
            cameras: vec![camera],
            notices: vec![Notice { about: "mesh 1".into(), text: "is odd".into(), count: 2 }],
            ..Scene::default()
        }
    }

    const FORECAST: Forecast = Forecast {
        elements: 8,
        nodes: 24,
        operator_bytes: 1 << 20,
        max_memory: Some(3 << 30),
        fits: true,
    };

    fn description() -> Description {
        let scene = scene();
        let view = View { camera: scene.cameras[0].clone(), width: 960, height: 540 };
        describe(&scene, &view, FORECAST)
    }

    #[test]
    fn areas_sides_and_power_are_summed() {
        let d = description();
        assert_eq!((d.faces, d.sides, d.objects), (3, 4, 1));
        assert!((d.area - 2.5).abs() < 1e-12);
        assert_eq!(d.bounds, [[0.0; 3], [2.0, 1.0, 1.0]]);
        assert_eq!(d.materials[0].reflectance, [0.5, 0.25, 0.125]);
        assert_eq!(d.materials[2].reflectance, [0.9; 3]);
        assert!((d.materials[1].radiance[0] - 2.0).abs() < 1e-12);
        // Exitance 2 pi on two sides of half a square metre.
        assert!((d.power[0] - 2.0 * PI).abs() < 1e-12);
        assert_eq!(d.power[2], 0.0);
    }

    #[test]
    fn the_text_shows_each_part() {
        let text = description().to_text();
        for part in [
            "  scene     rooms/s.gltf\n",
            "  faces     3 (4 sides that radiate)\n",
            "  mesh      8 elements, 24 nodes\n",
            "  operator  about 1 MiB; 3 GiB may be used\n",
            "\nmaterials (3)\n",
            "  floor       2         2      1  0.5 0.25 0.125\n",
            "\nemitters (1)\n",
            "  lamp          1       0.5  2 1 0                     6.283 3.142 0\n",
            "\ncameras (1)\n",
            "perspective, 40.11 degrees high\n",
            "\nnotices (1)\n  mesh 1: is odd (2 times)\n",
        ] {
            assert!(text.contains(part), "{part:?} is not in\n{text}");
        }
    }

    #[test]
    fn the_json_has_the_same_numbers() {
        let json = serde_json::to_value(description()).unwrap();
        assert_eq!(json["faces"], 3);
        assert_eq!(json["materials"][1]["name"], "lamp");
        assert_eq!(json["cameras"][0]["projection"], "perspective");
        assert_eq!(json["forecast"]["nodes"], 24);
        assert_eq!(json["notices"][0]["count"], 2);
        assert!(json["notices"][0].get("line").is_none());
    }
}
