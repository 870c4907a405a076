//! A camera for scenes that have none.
//!
//! The rule: of a fixed list of views, take the one with the greatest sum of three shares: of the
//! scene's radiating surface that it sees from the front, of the objects that it sees (which tells
//! the inside of a house from its walls outside), and, counted a quarter, of the light sources
//! (which tell the inside of a two-sided room). The list holds views from outside (towards the
//! middle of the bounding box from its corners and faces, far enough to see the whole box) and from
//! inside (from near its corners and faces towards the middle). So a room whose faces look inward,
//! black from outside, is seen from inside; an open box through its opening; an object on its own
//! from outside. Of views that are equally good, within a thousandth, the first in the list wins.
//!
//! What a view sees is drawn into a small depth buffer. A pixel at distance r whose surface is
//! inclined by theta covers omega r^2 / cos(theta) of it, omega being its solid angle; a triangle
//! counts for at most its own area. Cost: views x triangles, about 0.1 s for 100,000 triangles.

use glam::DVec3;

use super::camera::{Camera, Projection, look_at};
use super::{Scene, Triangle};

/// Size of the depth buffer, pixels: enough to rank views, small enough to cost nothing.
const WIDTH: usize = 64;
const HEIGHT: usize = 48;

/// Full vertical field of view from outside and from inside, degrees.
const OUTSIDE_FOV: f64 = 40.0;
const INSIDE_FOV: f64 = 75.0;

/// A view from inside starts this far into the box, as a share of its sides.
const INSET: f64 = 0.04;

/// What the share of the light sources counts beside the share of all surface.
const LAMPS: f64 = 0.25;

/// A camera that shows as much of the scene as a simple choice can; see the rule above. Y is up,
/// as in glTF.
pub fn default_camera(scene: &Scene) -> Camera {
    let mut best: Option<(f64, Camera)> = None;
    for camera in candidates(scene) {
        let score = score(scene, &camera);
        if best.as_ref().is_none_or(|(most, _)| score > most * 1.001) {
            best = Some((score, camera));
        }
    }
    let (_, mut camera) = best.unwrap_or_else(|| (0.0, fallback()));
    camera.name = "default".into();
    camera
}

/// The view of an empty scene.
fn fallback() -> Camera {
    Camera {
        name: String::new(),
        eye: DVec3::Z,
        right: DVec3::X,
        up: DVec3::Y,
        forward: DVec3::NEG_Z,
        projection: Projection::Perspective {
            vertical_fov: OUTSIDE_FOV.to_radians(),
            aspect: None,
        },
    }
}

/// Directions from the middle of the box to its corners and faces, the likeliest first.
const DIRECTIONS: [[f64; 3]; 14] = [
    [1.0, 0.7, 1.0],
    [-1.0, 0.7, 1.0],
    [1.0, 0.7, -1.0],
    [-1.0, 0.7, -1.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 0.0, -1.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [1.0, -0.7, 1.0],
    [-1.0, -0.7, 1.0],
    [1.0, -0.7, -1.0],
    [-1.0, -0.7, -1.0],
];

fn candidates(scene: &Scene) -> Vec<Camera> {
    let (low, high) = scene.bounds();
    let middle = 0.5 * (low + high);
    let half = 0.5 * (high - low);
    let radius = half.length();
    let mut views = Vec::new();
    let mut add = |eye: DVec3, fov: f64| {
        let view = (middle - eye).normalize_or_zero();
        let up = if view.y.abs() > 0.99 { DVec3::NEG_Z } else { DVec3::Y };
        views.extend(look_at(eye, middle, up, fov.to_radians()));
    };
    for direction in DIRECTIONS.map(DVec3::from) {
        // The sphere around the box fits the height of the picture.
        let distance = radius / (0.5 * OUTSIDE_FOV).to_radians().sin();
        add(middle + direction.normalize() * distance, OUTSIDE_FOV);
    }
    for direction in DIRECTIONS.map(DVec3::from) {
        add(middle + signs(direction) * half * (1.0 - 2.0 * INSET), INSIDE_FOV);
    }
    views
}

/// Signs of the components, zero for zero.
fn signs(v: DVec3) -> DVec3 {
    DVec3::select(v.cmpeq(DVec3::ZERO), DVec3::ZERO, v.signum())
}

/// How good a view is, see the rule above.
fn score(scene: &Scene, camera: &Camera) -> f64 {
    let Projection::Perspective { vertical_fov, .. } = camera.projection else {
        return 0.0;
    };
    let top = (0.5 * vertical_fov).tan();
    let view = View {
        camera,
        right: top * WIDTH as f64 / HEIGHT as f64,
        top,
        near: 1e-6 * scene.extent(),
    };
    let mut nearest = vec![(f64::INFINITY, usize::MAX); WIDTH * HEIGHT];
    for (i, triangle) in scene.triangles.iter().enumerate() {
        view.draw(triangle, i, &mut nearest);
    }
    // Pixels of one triangle together cover at most the triangle.
    let mut seen: Vec<(usize, f64)> = Vec::new();
    for (pixel, &(_, i)) in nearest.iter().enumerate() {
        let Some(triangle) = scene.triangles.get(i) else { continue };
        let ray = view.ray(pixel % WIDTH, pixel / WIDTH);
        let (normal, _) = triangle.normal_and_area();
        let cosine = -ray.dot(normal) / ray.length();
        let two_sided =
            scene.materials.get(triangle.material as usize).is_some_and(|m| m.two_sided);
        if cosine <= 0.0 && !two_sided {
            continue;
        }
        let along = (triangle.vertices[0] - camera.eye).dot(normal) / ray.dot(normal);
        let distance_squared = ray.length_squared() * along * along;
        // Solid angle of a pixel on the plane at distance 1: area x cos^3.
        let pixel_area = 4.0 * view.right * view.top / (WIDTH * HEIGHT) as f64;
        let solid_angle = pixel_area / ray.length().powi(3);
        let area = solid_angle * distance_squared / cosine.abs();
        if area.is_finite() {
            seen.push((i, area));
        }
    }
    seen.sort_by_key(|&(i, _)| i);
    let emits = |i: usize| scene.emits(scene.triangles[i].material as usize);
    let (mut all, mut lamps) = (0.0, 0.0);
    let mut objects = vec![false; scene.objects.len()];
    for group in seen.chunk_by(|a, b| a.0 == b.0) {
        let triangle = group[0].0;
        let (_, whole) = scene.triangles[triangle].normal_and_area();
        let area = group.iter().map(|&(_, area)| area).sum::<f64>().min(whole);
        all += area;
        lamps += if emits(triangle) { area } else { 0.0 };
        if let Some(seen) = objects.get_mut(scene.triangles[triangle].object as usize) {
            *seen = true;
        }
    }
    let objects_seen = objects.iter().filter(|&&seen| seen).count();
    let (mut whole, mut whole_lamps) = (0.0, 0.0);
    for (i, triangle) in scene.triangles.iter().enumerate() {
        let (_, area) = triangle.normal_and_area();
        whole += area;
        whole_lamps += if emits(i) { area } else { 0.0 };
    }
    let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
    share(all, whole)
        + share(objects_seen as f64, objects.len() as f64)
        + LAMPS * share(lamps, whole_lamps)
}

/// A perspective view with the half sizes of its picture at distance 1.
struct View<'a> {
    camera: &'a Camera,
    right: f64,
    top: f64,
    near: f64,
}

impl View<'_> {
    /// Direction through the centre of a pixel; its length along the view is 1.
    fn ray(&self, x: usize, y: usize) -> DVec3 {
        let s = (2.0 * (x as f64 + 0.5) / WIDTH as f64 - 1.0) * self.right;
        let t = (1.0 - 2.0 * (y as f64 + 0.5) / HEIGHT as f64) * self.top;
        self.camera.forward + s * self.camera.right + t * self.camera.up
    }

    /// Enters a triangle where it is nearest. Clips at the near plane.
    fn draw(&self, triangle: &Triangle, index: usize, nearest: &mut [(f64, usize)]) {
        let corners = triangle.vertices.map(|p| {
            let d = p - self.camera.eye;
            DVec3::new(d.dot(self.camera.right), d.dot(self.camera.up), d.dot(self.camera.forward))
        });
        let mut clipped = Vec::with_capacity(4);
        for i in 0..3 {
            let (p, q) = (corners[i], corners[(i + 1) % 3]);
            if p.z >= self.near {
                clipped.push(p);
            }
            if (p.z >= self.near) != (q.z >= self.near) {
                clipped.push(p + (q - p) * ((self.near - p.z) / (q.z - p.z)));
            }
        }
        let pixels: Vec<DVec3> = clipped
            .iter()
            .map(|p| {
                let x = 0.5 * (p.x / (p.z * self.right) + 1.0) * WIDTH as f64;
                let y = 0.5 * (1.0 - p.y / (p.z * self.top)) * HEIGHT as f64;
                DVec3::new(x, y, 1.0 / p.z)
            })
            .collect();
        for i in 2..pixels.len() {
            fill([pixels[0], pixels[i - 1], pixels[i]], index, nearest);
        }
    }
}

/// Fills the pixels whose centres lie in a triangle given by x, y and 1/depth.
fn fill([a, b, c]: [DVec3; 3], index: usize, nearest: &mut [(f64, usize)]) {
    let double = (b - a).truncate().perp_dot((c - a).truncate());
    if !(double.abs() > 0.0 && double.is_finite()) {
        return;
    }
    let low = a.min(b).min(c);
    let high = a.max(b).max(c);
    // Float to integer conversion saturates: what is off the picture is cut here.
    let x_range = (low.x - 0.5).ceil().max(0.0) as usize..((high.x + 0.5) as usize).min(WIDTH);
    for y in (low.y - 0.5).ceil().max(0.0) as usize..((high.y + 0.5) as usize).min(HEIGHT) {
        for x in x_range.clone() {
            let p = DVec3::new(x as f64 + 0.5, y as f64 + 0.5, 0.0);
            let side =
                |q: DVec3, r: DVec3| (r - q).truncate().perp_dot((p - q).truncate()) / double;
            let (u, v, w) = (side(b, c), side(c, a), side(a, b));
            if u >= 0.0 && v >= 0.0 && w >= 0.0 {
                let depth = 1.0 / (u * a.z + v * b.z + w * c.z);
                let place = &mut nearest[y * WIDTH + x];
                if depth < place.0 {
                    *place = (depth, index);
                }
            }
        }
    }
}
