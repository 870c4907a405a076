//! Scenes of many small faces: light from bundles of rays agrees with exact visibility.

mod common;
#[allow(dead_code)]
#[path = "common/random.rs"]
mod random;
#[allow(dead_code)]
#[path = "common/rooms.rs"]
mod rooms;

use std::path::Path;

use glam::DVec3;
use lumel::Monitor;
use lumel::operator::Walker;
use lumel::render::{RenderOptions, render};
use lumel::scene::{Override, ReadOptions, Scene, Triangle, default_camera, read};
use lumel::solve::many::is_many;
use lumel::solve::{Light, Reflected, WithinOptions, light_within};
use rooms::furnished;

/// The same surface in 4^levels times the triangles.
fn cut(scene: &Scene, levels: u32) -> Scene {
    let mut fine = scene.clone();
    for _ in 0..levels {
        let four = |t: &Triangle| -> [Triangle; 4] {
            let [a, b, c] = t.vertices;
            let (ab, bc, ca) = (a.midpoint(b), b.midpoint(c), c.midpoint(a));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
                .map(|vertices| Triangle { vertices, ..t.clone() })
        };
        fine.triangles = fine.triangles.iter().flat_map(four).collect();
    }
    fine
}

fn within(scene: &Scene, tolerance: f64) -> Light {
    light_within(scene, &WithinOptions::new(tolerance, u64::MAX), &Monitor::silent()).unwrap()
}

/// Irradiance at the centroids of some triangles, a little before them.
fn at_triangles(light: &Light, scene: &Scene, step: usize) -> Vec<DVec3> {
    let mut walker = Walker::default();
    let at = |t: &Triangle| {
        let [a, b, c] = t.vertices;
        light.irradiance(&mut walker, (a + b + c) / 3.0, t.normal_and_area().0)
    };
    scene.triangles.iter().step_by(step).map(at).collect()
}

fn is_by_rays(light: &Light) -> bool {
    matches!(light.apart().unwrap().reflected, Reflected::Rays(_))
}

#[test]
fn rays_agree_with_exact_visibility() {
    for seed in [0, 1] {
        let room = furnished(seed);
        let fine = cut(&room, 3);
        let (exact, rays) = (within(&room, 3e-3), within(&fine, 1e-2));
        assert!(!is_by_rays(&exact) && is_by_rays(&rays));
        let (want, got) = (at_triangles(&exact, &fine, 13), at_triangles(&rays, &fine, 13));
        let source = rays.apart().unwrap();
        let mean = source.estimate.mean;
        // By area: small things have as many triangles as walls.
        let weights: Vec<f64> =
            fine.triangles.iter().step_by(13).map(|t| t.normal_and_area().1).collect();
        let total: f64 = weights.iter().sum();
        let squares: DVec3 = (0..want.len())
            .map(|i| weights[i] / total * ((got[i] - want[i]) / mean).powf(2.0))
            .sum();
        // Solution and gathering.
        let estimate = source.estimate.rms.hypot(source.allowed / mean.max_element());
        let error = squares.max_element().sqrt();
        println!("room {seed}: {} points, error {error:.2e}, estimate {estimate:.2e}", want.len());
        // Both are sums over few points.
        assert!(error <= 1e-2 && 1.5 * estimate >= error, "{error:e} {estimate:e}");
    }
}

#[test]
fn pictures_by_rays_agree_with_exact_ones() {
    let mut room = furnished(1);
    // All alike: what irradiance is off by is then in proportion to what is seen of it.
    for m in &mut room.materials {
        m.reflectance = DVec3::splat(0.5);
    }
    let fine = cut(&room, 3);
    let (exact, rays) = (within(&room, 3e-3), within(&fine, 1e-2));
    assert!(!is_by_rays(&exact) && is_by_rays(&rays));
    let camera = default_camera(&room);
    let options = RenderOptions { width: 160, height: 120, samples: 1, gather: true };
    let picture = |scene, light| render(scene, light, &camera, &options, &Monitor::silent());
    let (want, _) = picture(&room, &exact).unwrap();
    let (got, gathered) = picture(&fine, &rays).unwrap();
    let of_irradiance = std::f64::consts::PI / 0.5 / gathered.against;
    let off = |(a, b): (&[f32; 3], &[f32; 3])| {
        let difference = DVec3::from(a.map(f64::from)) - DVec3::from(b.map(f64::from));
        (of_irradiance * difference).powf(2.0)
    };
    let squares: DVec3 = want.iter().zip(&got).map(off).sum();
    let error = (squares.max_element() / want.len() as f64).sqrt();
    let (solved, drawn) = (rays.apart().unwrap().estimate.rms, gathered.error());
    println!("error {error:.2e}; estimates: solved {solved:.2e}, drawn {drawn:.2e}");
    let estimate = solved.hypot(drawn);
    assert!(error <= 1e-2 && 1.5 * estimate >= error && estimate <= 1e-2);
    // What the solution left of the tolerance was made use of.
    assert!(estimate >= 0.8e-2, "{estimate:e}");
    assert!(gathered.counts.direct.gathered < gathered.counts.direct.points);
}

#[test]
fn a_closed_furnace_is_as_bright_as_it_must_be() {
    let mut room = cut(&furnished(4), 3);
    for m in &mut room.materials {
        (m.reflectance, m.radiance) =
            (DVec3::splat(0.5), DVec3::splat(std::f64::consts::FRAC_1_PI));
    }
    let light = within(&room, 1e-2);
    assert!(is_by_rays(&light));
    // u = E / (1 - rho) = 2 everywhere that is not buried.
    let off: Vec<f64> = at_triangles(&light, &room, 17)
        .into_iter()
        .map(|h| (h - 2.0).abs().max_element())
        .filter(|off| *off < 1.0)
        .collect();
    let square = off.iter().map(|x| x * x).sum::<f64>() / off.len() as f64;
    println!("{} points, off by {:.2e}", off.len(), square.sqrt());
    assert!(square.sqrt() < 2e-2);
}

#[test]
fn what_stands_on_a_floor_does_not_darken_it() {
    // Patches that are mostly under something have their middles there, where it is dark.
    let every = |text| vec![Override::parse(text).unwrap()];
    let options = ReadOptions {
        emission: every("*=0.3183098861837907"),
        reflectance: every("*=0.5"),
        ..ReadOptions::default()
    };
    let hall = read(Path::new("scenes/arcade.gltf"), &options).unwrap();
    let light = within(&hall, 3e-2);
    assert!(is_by_rays(&light));
    let seen = |h: &f64| *h > 1.0;
    let found: Vec<f64> =
        at_triangles(&light, &hall, 201).into_iter().map(|h| h.x).filter(seen).collect();
    let mean = found.iter().sum::<f64>() / found.len() as f64;
    let square = found.iter().map(|h| (h - 2.0).powi(2)).sum::<f64>() / found.len() as f64;
    println!("{} points, mean {mean}, off by {:.2e}", found.len(), square.sqrt());
    assert!(found.len() > 20 && (mean - 2.0).abs() < 4e-3 && square.sqrt() < 1e-2);
}

#[test]
fn a_lamp_close_to_a_wall_lights_the_room_by_a_few_bright_cells() {
    // All that the room gets was reflected where the lamp is a hand's breadth off: rays from
    // elsewhere rarely meet that.
    let mut room = furnished(0);
    for m in &mut room.materials {
        (m.reflectance, m.radiance) = (DVec3::splat(0.6), DVec3::ZERO);
    }
    let mut lamp = room.materials[0].clone();
    lamp.name = "small lamp".into();
    (lamp.reflectance, lamp.radiance) = (DVec3::ZERO, DVec3::ONE);
    room.materials.push(lamp);
    let (low, high) = room.bounds();
    let middle = low + DVec3::new(0.5, 0.7, 0.0) * (high - low) + 0.05 * DVec3::Z;
    let corner = |x: f64, y: f64| middle + 0.03 * DVec3::new(x, y, 0.0);
    let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let material = room.materials.len() as u32 - 1;
    room.triangles.extend([[a, c, b], [a, d, c]].map(|vertices| Triangle {
        vertices,
        material,
        ..room.triangles[0].clone()
    }));
    let fine = cut(&room, 3);
    let (exact, rays) = (within(&room, 3e-3), within(&fine, 1e-2));
    assert!(!is_by_rays(&exact) && is_by_rays(&rays));
    let source = rays.apart().unwrap();
    let Reflected::Rays(radiant) = &source.reflected else { unreachable!() };
    assert!(!radiant.bright.is_empty());
    let (want, got) = (at_triangles(&exact, &fine, 13), at_triangles(&rays, &fine, 13));
    let mean = source.estimate.mean.x;
    let estimate = source.estimate.rms.hypot(source.allowed / mean);
    // On what reflects: the lamp itself sees the spot, a thousand times as bright as the mean.
    let area = |t: &Triangle| if t.material == material { 0.0 } else { t.normal_and_area().1 };
    let weights: Vec<f64> = fine.triangles.iter().step_by(13).map(area).collect();
    let squares: f64 =
        (0..want.len()).map(|i| weights[i] * ((got[i].x - want[i].x) / mean).powi(2)).sum();
    let error = (squares / weights.iter().sum::<f64>()).sqrt();
    println!("error {error:.2e}, estimate {estimate:.2e}");
    assert!(error <= 1e-2 && estimate <= 1e-2 && 1.5 * estimate >= error);
}

#[test]
fn what_is_dark_below_a_plate_stays_dark() {
    // Tiles, and a plate half a millimetre above them: a tile below the plate's rim is bright and
    // dark, and in the slot one tile is all that points see.
    let mut room = furnished(3);
    let up = |t: &Triangle| t.normal_and_area().0.y > 0.9;
    let lowest = room.bounds().0.y;
    let high = |t: &Triangle| t.vertices.iter().map(|v| v.y).fold(f64::NEG_INFINITY, f64::max);
    let is_floor = |t: &Triangle| up(t) && high(t) < lowest + 1e-9;
    let floor: Vec<Triangle> = room.triangles.iter().filter(|t| is_floor(t)).cloned().collect();
    assert!(!floor.is_empty());
    room.triangles.retain(|t| !is_floor(t));
    let mut fine = cut(&room, 3);
    let (low, high) = room.bounds();
    let tiles = cut(&Scene { triangles: floor.clone(), ..room.clone() }, 4).triangles;
    let corner = |x: f64, z: f64| {
        DVec3::new(low.x + x * (high.x - low.x), lowest + 5e-4, low.z + z * (high.z - low.z))
    };
    let [a, b, c, d] = [corner(0.3, 0.2), corner(0.3, 0.7), corner(0.8, 0.7), corner(0.8, 0.2)];
    let plate = [[a, b, c], [a, c, d], [a, c, b], [a, d, c]]
        .map(|vertices| Triangle { vertices, ..floor[0].clone() });
    fine.triangles.extend(tiles.iter().chain(&plate).cloned());
    let light = within(&fine, 3e-2);
    assert!(is_by_rays(&light));
    let mean = light.apart().unwrap().estimate.mean.x;
    let mut walker = Walker::default();
    let mut random = random::Random::new(7);
    let mut largest = 0.0f64;
    for _ in 0..200 {
        let (x, z) = (random.within(0.31, 0.79), random.within(0.21, 0.69));
        // From 2 cm on inside, less than (h/d)^2 of the light outside arrives: 1e-3.
        for (y, n) in [(lowest, DVec3::Y), (lowest + 5e-4, DVec3::NEG_Y)] {
            let found = light.irradiance(&mut walker, corner(x, z).with_y(y), n).x / mean;
            largest = largest.max(found.abs());
        }
    }
    println!("{largest:e} of the mean");
    assert!(largest < 1e-2);
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let room = cut(&furnished(1), 3);
    let bits = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let light = within(&room, 3e-2);
            assert!(is_by_rays(&light));
            at_triangles(&light, &room, 101)
        })
    };
    let one = bits(1);
    assert!(one == bits(2) && one == bits(3));
}

#[test]
fn few_faces_and_small_tolerances_are_left_to_exact_visibility() {
    assert!(!is_many(300, 1e-2) && !is_many(5000, 1e-3));
    assert!(is_many(60_000, 1e-2) && is_many(60_000, 3e-3));
}
