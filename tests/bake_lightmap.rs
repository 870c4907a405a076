//! Lightmaps: texels hold the mean irradiance of what they cover, and nothing of what they do not.

mod common;

use std::path::Path;

use common::{box_quads, material, scene};
use glam::{DVec2, DVec3, dvec3};
use lumel::Monitor;
use lumel::bake::{
    Atlas, AtlasOptions, BakeCounts, Lightmap, LightmapOptions, bake_lightmaps, make_atlas,
};
use lumel::mesh::barycentric;
use lumel::operator::Walker;
use lumel::scene::{Material, Object, ReadOptions, Scene, read};
use lumel::solve::{Light, WithinOptions, light_within};
use rayon::prelude::*;
use serde_json::Value;

fn shipped(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    read(&path, &ReadOptions::default()).unwrap()
}

fn within(scene: &Scene, tolerance: f64) -> Light {
    light_within(scene, &WithinOptions::new(tolerance, u64::MAX), &Monitor::silent()).unwrap()
}

fn of_size(size: u32) -> AtlasOptions {
    AtlasOptions { size: Some(size), ..AtlasOptions::default() }
}

struct Baked {
    scene: Scene,
    light: Light,
    atlas: Atlas,
    map: Lightmap,
    counts: BakeCounts,
    mean: f64,
}

fn baked(scene: Scene, tolerance: f64, options: &AtlasOptions) -> Baked {
    let light = within(&scene, tolerance);
    let atlas = make_atlas(&scene, options).unwrap();
    let how = LightmapOptions::default();
    let (mut maps, counts) =
        bake_lightmaps(&scene, &light, &atlas, &how, &Monitor::silent()).unwrap();
    assert_eq!(maps.len(), 1);
    let map = maps.remove(0);
    assert!(map.total().all(|v| v.is_finite() && v.min_element() >= 0.0));
    let mean = light.apart().unwrap().estimate.mean.max_element();
    Baked { scene, light, atlas, map, counts, mean }
}

impl Baked {
    /// The front at a place on the page (texels): triangle, position, normal.
    fn at(&self, place: DVec2) -> Option<(usize, DVec3, DVec3)> {
        let size = DVec2::new(f64::from(self.map.width), f64::from(self.map.height));
        (0..self.scene.triangles.len()).find_map(|i| {
            self.atlas.page[i]?;
            let w = barycentric(&self.atlas.uv[i], place / size);
            let [a, b, c] = self.scene.triangles[i].vertices;
            let point = w.x * a + w.y * b + w.z * c;
            let normal = self.scene.triangle_normal_and_area(i).0;
            (w.min_element() >= 0.0).then_some((i, point, normal))
        })
    }

    fn total(&self, column: u32, row: u32) -> DVec3 {
        let k = (row * self.map.width + column) as usize;
        (self.map.direct[k] + self.map.indirect[k]).as_dvec3()
    }

    fn covered(&self, column: u32, row: u32) -> f32 {
        self.map.covered[(row * self.map.width + column) as usize]
    }

    /// What bilinear filtering shows at a place (texels).
    fn filtered(&self, place: DVec2) -> DVec3 {
        let (low, part) = ((place - 0.5).floor(), (place - 0.5).fract());
        let at = |dx: f64, dy: f64| {
            let last = DVec2::new(f64::from(self.map.width), f64::from(self.map.height)) - 1.0;
            let x = (low + DVec2::new(dx, dy)).clamp(DVec2::ZERO, last);
            self.total(x.x as u32, x.y as u32)
        };
        at(0.0, 0.0)
            .lerp(at(1.0, 0.0), part.x)
            .lerp(at(0.0, 1.0).lerp(at(1.0, 1.0), part.x), part.y)
    }

    /// What filtering shows at a point of a triangle.
    fn shown(&self, triangle: usize, point: DVec3) -> DVec3 {
        let [a, b, c] = self.scene.triangles[triangle].vertices;
        let n = (b - a).cross(c - a);
        let w = |p: DVec3, q: DVec3| (q - p).cross(point - p).dot(n) / n.length_squared();
        let weights = [w(b, c), w(c, a), w(a, b)];
        let uv = self.atlas.uv[triangle];
        let place = weights[0] * uv[0] + weights[1] * uv[1] + weights[2] * uv[2];
        self.filtered(place * DVec2::new(f64::from(self.map.width), f64::from(self.map.height)))
    }
}

/// Root mean square of differences from densely sampled means, relative to the mean irradiance, over
/// every `stride`th texel that surface covers; and the largest.
fn error(baked: &Baked, reference: &Light, stride: usize, n: u32) -> (f64, f64) {
    let map = &baked.map;
    let texels: Vec<u32> =
        (0..map.width * map.height).filter(|&k| map.covered[k as usize] > 0.0).collect();
    let chosen: Vec<u32> = texels.into_iter().step_by(stride).collect();
    let off: Vec<f64> = chosen
        .par_iter()
        .map_init(Walker::default, |walker, &k| {
            let (column, row) = (k % map.width, k / map.width);
            let (mut sum, mut count) = (DVec3::ZERO, 0.0);
            for j in 0..n {
                for i in 0..n {
                    let inner = (DVec2::new(f64::from(i), f64::from(j)) + 0.5) / f64::from(n);
                    let place = DVec2::new(f64::from(column), f64::from(row)) + inner;
                    let Some((_, point, normal)) = baked.at(place) else { continue };
                    let value = reference.irradiance(walker, point, normal);
                    // What is buried is exactly dark; nothing else is.
                    if value.max_element() > 1e-4 * baked.mean {
                        sum += value;
                        count += 1.0;
                    }
                }
            }
            if count == 0.0 {
                return 0.0;
            }
            (sum / count - baked.total(column, row)).abs().max_element() / baked.mean
        })
        .collect();
    let rms = (off.iter().map(|x| x * x).sum::<f64>() / off.len() as f64).sqrt();
    (rms, off.iter().copied().fold(0.0, f64::max))
}

#[test]
fn texels_are_means_of_the_irradiance() {
    let tolerance = 0.003;
    let cornell = baked(shipped("cornell.gltf"), tolerance, &of_size(256));
    let reference = within(&cornell.scene, 0.0005);
    let (rms, largest) = error(&cornell, &reference, 97, 6);
    println!("rms {rms:.2e} largest {largest:.2e} {:?}", cornell.counts);
    assert!(rms < tolerance, "{rms:e}");
    // Most texels are covered whole; those that are not hold the mean of what they show.
    assert!(largest < 10.0 * tolerance, "{largest:e}");
    assert!(cornell.counts.buried > 0 && cornell.counts.refined > 0);
}

#[test]
fn smooth_texels_have_the_irradiance_at_their_centres() {
    let cornell = baked(shipped("cornell.gltf"), 0.001, &of_size(256));
    let (width, height) = (cornell.map.width, cornell.map.height);
    let mut walker = Walker::default();
    let mut count = 0;
    for row in (1..height - 1).step_by(7) {
        for column in (1..width - 1).step_by(7) {
            let around = [(0, 1), (2, 1), (1, 0), (1, 2), (1, 1)]
                .map(|(x, y)| (column + x - 1, row + y - 1));
            if around.iter().any(|&(x, y)| cornell.covered(x, y) < 0.999) {
                continue;
            }
            let [a, b, c, d, own] = around.map(|(x, y)| cornell.total(x, y));
            let bend = (a + b - 2.0 * own).abs() + (c + d - 2.0 * own).abs();
            if bend.max_element() > 1e-3 * cornell.mean {
                continue;
            }
            let place = DVec2::new(f64::from(column), f64::from(row)) + 0.5;
            let (_, point, normal) = cornell.at(place).unwrap();
            let exact = cornell.light.irradiance(&mut walker, point, normal);
            let off = (exact - own).abs().max_element() / cornell.mean;
            assert!(off < 1e-3, "{column} {row}: {off:e}");
            count += 1;
        }
    }
    assert!(count > 150, "{count}");
}

/// Points that Mitsuba traced (`tools/mitsuba/references.py`): position, normal, irradiance and the
/// standard error of that.
fn traced(name: &str) -> Vec<[DVec3; 4]> {
    let path = format!("{}/tests/data/mitsuba_{name}.json", env!("CARGO_MANIFEST_DIR"));
    let data: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let vector = |v: &Value| DVec3::from_array([0, 1, 2].map(|k| v[k].as_f64().unwrap()));
    let entries = data["points"]["entries"].as_array().unwrap();
    let of =
        |e: &Value| ["position", "normal", "irradiance", "standard_error"].map(|k| vector(&e[k]));
    entries.iter().map(of).collect()
}

#[test]
fn texels_agree_with_a_path_tracer() {
    let tolerance = 0.003;
    for name in ["cornell", "room"] {
        let baked = baked(shipped(&format!("{name}.gltf")), tolerance, &of_size(512));
        let (size, extent) = (f64::from(baked.map.width), baked.scene.extent());
        let (mut squares, mut expected, mut smooth) = (0.0, 0.0, 0);
        let points = traced(name);
        for [position, normal, theirs, error] in &points {
            let holds = |&i: &usize| {
                let t = baked.scene.triangles[i].vertices;
                let n = (t[1] - t[0]).cross(t[2] - t[0]);
                let w = |p: DVec3, q: DVec3| (q - p).cross(*position - p).dot(n);
                let inside = w(t[0], t[1]).min(w(t[1], t[2])).min(w(t[2], t[0])) >= 0.0;
                let off = (*position - t[0]).dot(n.normalize()).abs();
                inside && off < 1e-6 * extent && normal.dot(n.normalize()) > 0.999
            };
            let triangle = (0..baked.scene.triangles.len()).find(holds).unwrap();
            // Two texels.
            let t = baked.scene.triangles[triangle].vertices;
            let longest = (t[1] - t[0]).length().max((t[2] - t[0]).length());
            let uv = baked.atlas.uv[triangle];
            let across = size * (uv[1] - uv[0]).length().max((uv[2] - uv[0]).length());
            let step = 2.0 * longest / across;
            let along = (t[1] - t[0]).normalize();
            let sides = [along, along.cross(*normal)];
            let ours = baked.shown(triangle, *position);
            // Filtering rounds off what light bends by.
            let bends = sides
                .map(|side| {
                    let at = |by: f64| baked.shown(triangle, *position + by * step * side);
                    (at(1.0) + at(-1.0) - 2.0 * ours).abs().max_element()
                })
                .into_iter()
                .fold(0.0, f64::max);
            if bends > tolerance * baked.mean {
                continue;
            }
            smooth += 1;
            let off = (ours - *theirs).abs();
            let allowed = 4.0 * error.max_element() + tolerance * baked.mean + bends;
            assert!(off.max_element() < allowed, "{name} {position}: {ours} {theirs} {error}");
            squares += off.max_element().powi(2);
            expected += error.max_element().powi(2);
        }
        assert!(2 * smooth > points.len(), "{name}: {smooth} of {}", points.len());
        let rms = |sum: f64| (sum / f64::from(smooth as u32)).sqrt() / baked.mean;
        println!(
            "{name}: {smooth} of {}, {:.2e} {:.2e}",
            points.len(),
            rms(squares),
            rms(expected)
        );
        assert!(rms(squares) < (2.0 * rms(expected)).hypot(0.3 * tolerance), "{name}");
    }
}

#[test]
fn in_a_furnace_every_texel_is_the_same() {
    let furnace = baked(shipped("furnace.gltf"), 1e-3, &of_size(128));
    let expected = furnace.mean;
    for value in furnace.map.total() {
        // Corners and gutters too.
        let off = (f64::from(value.x) / expected - 1.0).abs();
        assert!(off < 3e-3, "{value} {expected}");
    }
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let bits = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let options = AtlasOptions { texels_per_metre: Some(30.0), ..AtlasOptions::default() };
            let made = baked(shipped("cornell.gltf"), 0.01, &options);
            let values = made.map.direct.iter().chain(&made.map.indirect);
            let bits: Vec<[u32; 3]> = values.map(|v| v.to_array().map(f32::to_bits)).collect();
            (made.atlas, bits)
        })
    };
    let one = bits(1);
    assert!(one == bits(2) && one == bits(3));
}

/// A lit room with a block on its floor, a part of it below the floor where `sunk` is not 0.
fn room_with_block(sunk: f64, two_sided: bool, bottom: bool) -> Scene {
    let mut quads: Vec<_> =
        box_quads(DVec3::ZERO, DVec3::ONE, false).into_iter().map(|q| (q, 0)).collect();
    let block = box_quads(dvec3(0.31, 0.33, -sunk), dvec3(0.58, 0.61, 0.4), true);
    quads.extend(block.into_iter().skip(usize::from(!bottom)).map(|q| (q, 1)));
    let lamp =
        [dvec3(0.3, 0.7, 0.9), dvec3(0.7, 0.7, 0.9), dvec3(0.7, 0.3, 0.9), dvec3(0.3, 0.3, 0.9)];
    quads.push((lamp, 2));
    let block = Material { two_sided, ..material("block", 0.5, 0.0) };
    scene(&quads, vec![material("walls", 0.5, 0.0), block, material("lamp", 0.0, 5.0)])
}

#[test]
fn nothing_dark_leaks_from_below_a_block() {
    for (sunk, two_sided, bottom) in
        [(0.0, false, true), (0.0, true, true), (0.03, false, true), (0.0, false, false)]
    {
        let options = AtlasOptions { texels_per_metre: Some(31.7), ..AtlasOptions::default() };
        let made = baked(room_with_block(sunk, two_sided, bottom), 0.01, &options);
        assert!(made.counts.buried > 0);
        let mut walker = Walker::default();
        let floor: Vec<usize> = (0..made.scene.triangles.len())
            .filter(|&i| {
                let t = &made.scene.triangles[i];
                t.material == 0 && t.vertices.iter().all(|v| v.z == 0.0)
            })
            .collect();
        // Along the foot, a hair beside the block: as light as the floor is there.
        for k in 0..40 {
            let s = (f64::from(k) + 0.5) / 40.0;
            for point in [
                dvec3(0.309, 0.33 + 0.28 * s, 0.0),
                dvec3(0.581, 0.33 + 0.28 * s, 0.0),
                dvec3(0.31 + 0.27 * s, 0.329, 0.0),
                dvec3(0.31 + 0.27 * s, 0.611, 0.0),
            ] {
                let inside = |&&i: &&usize| {
                    let [a, b, c] = made.scene.triangles[i].vertices.map(|v| v.truncate());
                    barycentric(&[a, b, c], point.truncate()).min_element() >= -1e-9
                };
                let triangle = floor.iter().find(inside).unwrap();
                let exact = made.light.irradiance(&mut walker, point, DVec3::Z).x;
                let shown = made.shown(*triangle, point).x;
                // Light falls off towards the foot within a texel.
                assert!(
                    shown > 0.8 * exact,
                    "{sunk} {two_sided} {bottom} {point}: {shown} {exact}"
                );
            }
        }
    }
}

/// A floor in two objects that meet at x = 1, lit from a lamp above the first; with a wall on the
/// seam that reaches up to a ceiling, or without.
fn two_tiles(wall: bool) -> Scene {
    let mut quads: Vec<_> = box_quads(DVec3::ZERO, dvec3(2.0, 1.0, 1.0), false)
        .into_iter()
        .skip(1)
        .map(|q| (q, 0))
        .collect();
    let tile = |x: f64, end: f64| {
        [dvec3(x, 0.0, 0.0), dvec3(end, 0.0, 0.0), dvec3(end, 1.0, 0.0), dvec3(x, 1.0, 0.0)]
    };
    quads.extend([(tile(0.0, 1.0), 0), (tile(1.0, 2.0), 0)]);
    let lamp =
        [dvec3(0.4, 0.6, 0.8), dvec3(0.6, 0.6, 0.8), dvec3(0.6, 0.4, 0.8), dvec3(0.4, 0.4, 0.8)];
    quads.push((lamp, 1));
    if wall {
        let side = [DVec3::X, dvec3(1.0, 1.0, 0.0), dvec3(1.0, 1.0, 1.0), dvec3(1.0, 0.0, 1.0)];
        quads.push((side, 2));
    }
    let two_sided = Material { two_sided: true, ..material("wall", 0.5, 0.0) };
    let mut made =
        scene(&quads, vec![material("room", 0.5, 0.0), material("lamp", 0.0, 9.0), two_sided]);
    made.objects = (0..4).map(|k| Object { name: k.to_string() }).collect();
    for (i, triangle) in made.triangles.iter_mut().enumerate() {
        triangle.object = match i / 2 {
            5 => 1,
            6 => 2,
            _ => 0,
        };
    }
    made
}

#[test]
fn a_seam_between_two_tiles_does_not_show() {
    let options = AtlasOptions { texels_per_metre: Some(21.3), ..AtlasOptions::default() };
    let tolerance = 0.002;
    let made = baked(two_tiles(false), tolerance, &options);
    for k in 1..40 {
        let point = dvec3(1.0, f64::from(k) / 40.0, 0.0);
        let side = |first: usize| {
            let of = |i: usize| {
                let [a, b, c] = made.scene.triangles[i].vertices.map(|v| v.truncate());
                barycentric(&[a, b, c], point.truncate()).min_element() > -1e-12
            };
            let triangle = (first..first + 2).find(|&i| of(i)).unwrap();
            made.shown(triangle, point).x
        };
        let (a, b) = (side(10), side(12));
        // A texel is half a decimetre: light falls by a few percent from one to the next.
        assert!((a - b).abs() < tolerance * made.mean, "{point}: {a} {b}");
    }
}

#[test]
fn no_light_passes_below_a_wall() {
    let options = AtlasOptions { texels_per_metre: Some(21.3), ..AtlasOptions::default() };
    let made = baked(two_tiles(true), 0.01, &options);
    for k in 1..40 {
        let y = f64::from(k) / 40.0;
        for i in 12..14 {
            let [a, b, c] = made.scene.triangles[i].vertices.map(|v| v.truncate());
            for x in [1.0, 1.01, 1.03, 1.1, 1.9, 2.0] {
                if barycentric(&[a, b, c], DVec2::new(x, y)).min_element() > -1e-12 {
                    let shown = made.shown(i, dvec3(x, y, 0.0)).max_element();
                    assert!(shown < 1e-9 * made.mean, "{x} {y}: {shown}");
                }
            }
        }
    }
}

#[test]
fn small_thin_and_degenerate_things_have_light() {
    let quad = |o: DVec3, u: DVec3, v: DVec3| [o, o + u, o + u + v, o + v];
    let mut quads: Vec<_> =
        box_quads(DVec3::ZERO, DVec3::ONE, false).into_iter().map(|q| (q, 0)).collect();
    // A shelf thinner than a texel, a face smaller than one, a needle.
    quads.extend(
        box_quads(dvec3(0.2, 0.2, 0.5), dvec3(0.8, 0.8, 0.5 + 1e-3), true)
            .into_iter()
            .map(|q| (q, 0)),
    );
    quads.push((quad(dvec3(0.1, 0.1, 0.2), 1e-4 * DVec3::X, 1e-4 * DVec3::Y), 0));
    quads.push((quad(dvec3(0.1, 0.5, 0.2), 0.5 * DVec3::X, 1e-6 * DVec3::Y), 0));
    let lamp = quad(dvec3(0.4, 0.6, 0.99), 0.2 * DVec3::X, -0.2 * DVec3::Y);
    quads.push((lamp, 1));
    for size in [1e-6, 1.0, 1e6] {
        let mut made = scene(&quads, vec![material("grey", 0.5, 0.0), material("lamp", 0.0, 20.0)]);
        for triangle in &mut made.triangles {
            triangle.vertices = triangle.vertices.map(|v| size * v);
        }
        let options =
            AtlasOptions { texels_per_metre: Some(10.0 / size), ..AtlasOptions::default() };
        let made = baked(made, 0.02, &options);
        for chart in &made.atlas.charts {
            let [x, y, w, h] = chart.rectangle;
            let brightest = (y..y + h)
                .flat_map(|row| (x..x + w).map(move |column| (column, row)))
                .map(|(column, row)| made.total(column, row).max_element())
                .fold(0.0, f64::max);
            assert!(brightest > 1e-3 * made.mean, "{size}: {chart:?}");
            // What has an area has a texel of its own.
            let own = (y..y + h).any(|row| (x..x + w).any(|c| made.covered(c, row) > 0.4));
            assert!(own, "{size}: {chart:?}");
        }
    }
}

#[test]
fn backs_that_are_brighter_get_a_notice() {
    let turned = |up: bool| {
        let mut quads: Vec<_> =
            box_quads(DVec3::ZERO, DVec3::ONE, false).into_iter().map(|q| (q, 0)).collect();
        let lamp = [
            dvec3(0.3, 0.7, 0.9),
            dvec3(0.7, 0.7, 0.9),
            dvec3(0.7, 0.3, 0.9),
            dvec3(0.3, 0.3, 0.9),
        ];
        let mut sheet = [
            dvec3(0.2, 0.2, 0.4),
            dvec3(0.8, 0.2, 0.4),
            dvec3(0.8, 0.8, 0.4),
            dvec3(0.2, 0.8, 0.4),
        ];
        if !up {
            sheet.reverse();
        }
        quads.extend([(lamp, 1), (sheet, 2)]);
        let both = Material { two_sided: true, ..material("sheet", 0.5, 0.0) };
        scene(&quads, vec![material("grey", 0.5, 0.0), material("lamp", 0.0, 5.0), both])
    };
    for up in [true, false] {
        let made = baked(turned(up), 0.02, &of_size(64));
        assert_eq!(made.counts.notices.len(), usize::from(!up), "{:?}", made.counts.notices);
    }
}
