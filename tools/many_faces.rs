//! Scenes of many small faces: `cargo bench --bench many_faces -- FILE [--emission NAME=R,G,B]
//! [--tolerance 0.01] [--points 200]`.
//!
//! Prints the rate of rays, the CPU seconds and memory of the solution, and the error of the
//! irradiance at points spread over the surface by area: as a picture finds it, against emitted
//! light gathered exactly and reflected light from 131,072 rays a point, of the same solution and of
//! one for a quarter of the tolerance. Errors are root mean squares relative to the mean irradiance.

use std::path::Path;
use std::time::Instant;

use glam::DVec3;
use lumel::geometry::triangle_area;
use lumel::mesh::Mesh;
use lumel::operator::Walker;
use lumel::operator::bundles::RayScene;
use lumel::operator::hemisphere::{direction, flips, in_square};
use lumel::operator::lamps::Place;
use lumel::operator::ray_gather::{Enough, RayCounts, Sources};
use lumel::operator::spread::{Shares, on_triangle};
use lumel::output::machine;
use lumel::reconstruct::fill::RootPoints;
use lumel::reconstruct::irradiance::irradiances;
use lumel::scene::{Override, ReadOptions, Scene, read};
use lumel::solve::{Light, Reflected, WithinOptions, light_within};
use lumel::{Error, Monitor, Result};
use rayon::prelude::*;

/// Points that are shown.
const WORST: usize = 5;

/// Rays of a reference.
const RAYS: u32 = 131_072;

fn main() -> Result<()> {
    let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
    let (mut file, mut tolerance, mut count) = (None, 0.01, 200);
    let mut options = ReadOptions::default();
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or_else(|| usage(&format!("{word} needs a value")));
        match word.as_str() {
            "--emission" => {
                options.emission.push(Override::parse(&value()?).map_err(|why| usage(&why))?);
            }
            "--tolerance" => tolerance = value()?.parse().map_err(|_| usage("a number"))?,
            "--points" => count = value()?.parse().map_err(|_| usage("a number"))?,
            _ => file = Some(word),
        }
    }
    let file = file.ok_or_else(|| usage("a scene file is needed"))?;
    let scene = read(Path::new(&file), &options)?;
    let read_for = cpu();
    let begin = Instant::now();
    let light = within(&scene, tolerance)?;
    println!("{file}: {} triangles, {} roots", scene.triangles.len(), light.mesh.roots.len());
    let memory = machine::peak_memory().unwrap_or(0) as f64 / f64::from(1 << 20);
    println!(
        "solved for {tolerance}: {:.1} CPU s after {read_for:.1} for reading, {:.1} s, {memory:.0} MiB",
        cpu() - read_for,
        begin.elapsed().as_secs_f64()
    );
    rate(&scene, &light.mesh);
    let Some(source) = light.apart() else { return Ok(()) };
    println!("estimated error {:.2e}", source.estimate.rms);
    if let Some(rays) = &source.rays {
        println!("rays estimate {:.2} of the light, off by {:.1e}", rays.share, rays.error);
    }
    let asked = points(&light.mesh, count);
    let before = cpu();
    let (found, counts) = irradiances(&light, &asked, &Monitor::silent())?;
    let each = (cpu() - before) / count as f64;
    let filling = counts.error(source.estimate.mean);
    println!("{count} points: {:.2} CPU ms each, estimated error {filling:.1e}", 1e3 * each);
    let own = reference(&light, &asked);
    let found: Vec<DVec3> = found.into_iter().flatten().collect();
    println!("off from the same solution gathered better: {:.2e}", off(&found, &own));
    print_worst(&light.mesh, &asked, &found, &own);
    let finer = within(&scene, 0.3 * tolerance)?;
    let right = reference(&finer, &asked);
    println!("off from a solution for {}: {:.2e}", 0.3 * tolerance, off(&found, &right));
    println!("of that the solution: {:.2e}", off(&own, &right));
    Ok(())
}

fn usage(what: &str) -> Error {
    Error::Usage(what.into())
}

fn cpu() -> f64 {
    machine::cpu_seconds().unwrap_or(f64::NAN)
}

fn within(scene: &Scene, tolerance: f64) -> Result<Light> {
    light_within(scene, &WithinOptions::new(tolerance, u64::MAX), &Monitor::silent())
}

/// Points spread over the surface by area, each asked for by itself.
fn points(mesh: &Mesh, count: usize) -> Vec<RootPoints> {
    let (shares, _) = Shares::of(mesh.roots.iter().map(|root| triangle_area(&root.corners)));
    (0..count)
        .map(|k| {
            let x = in_square(k as u32, [0x9e37_79b9, 0x7f4a_7c15]);
            let (root, rest) = shares.choose(x);
            let ([a, b, c], w) = (mesh.roots[root].corners, on_triangle(rest));
            RootPoints { root: root as u32, points: vec![w.x * a + w.y * b + w.z * c] }
        })
        .collect()
}

/// Emitted light exactly, reflected light from very many rays.
fn reference(light: &Light, asked: &[RootPoints]) -> Vec<DVec3> {
    let Some(source) = light.apart() else { return vec![] };
    let at = |walker: &mut Walker, own: &RootPoints| {
        let frame = light.mesh.root_frame(own.root);
        let (point, n) = (frame.lift(own.points[0]), frame.n);
        let stage = light.stage();
        let direct = source.emitters.gather(walker, stage, point, n, source.allowed_direct);
        let reflected = match (&source.reflected, &source.rays) {
            (Reflected::Rays(radiant), Some(rays)) => {
                let sources = Sources::reflected(radiant, &rays.lamps);
                let counts = RayCounts { least: RAYS, most: RAYS };
                let scene = (&rays.scene, &light.mesh);
                sources
                    .gather(walker, scene, Place::new(point, n), Enough::of(0.0), counts)
                    .irradiance
            }
            (reflected, _) => source.gather_reflected(reflected, walker, stage, point, n),
        };
        direct + reflected
    };
    asked.par_iter().map_init(Walker::default, at).collect()
}

/// The points that are off most.
fn print_worst(mesh: &Mesh, asked: &[RootPoints], found: &[DVec3], right: &[DVec3]) {
    let mut order: Vec<usize> = (0..asked.len()).collect();
    let size = |&k: &usize| (found[k] - right[k]).length();
    order.sort_by(|a, b| size(b).total_cmp(&size(a)));
    for k in order.into_iter().take(WORST) {
        let frame = mesh.root_frame(asked[k].root);
        let (at, n) = (frame.lift(asked[k].points[0]), frame.n);
        println!("  at {at:.4} towards {n:.3}: {:.4} instead of {:.4}", found[k], right[k]);
    }
}

/// Of the channels the largest.
fn off(found: &[DVec3], right: &[DVec3]) -> f64 {
    let mean: DVec3 = right.iter().sum::<DVec3>() / right.len() as f64;
    let squares: DVec3 = found.iter().zip(right).map(|(a, b)| ((*a - *b) / mean).powf(2.0)).sum();
    (squares / right.len() as f64).max_element().sqrt()
}

/// Millions of rays a second and thread: nearest hits of bundles, and occlusion between points.
fn rate(scene: &Scene, mesh: &Mesh) {
    let rays = RayScene::new(scene, mesh);
    let places = points(mesh, 256);
    let mut walker = Walker::default();
    let begin = cpu();
    for own in &places {
        let frame = mesh.root_frame(own.root);
        let point = frame.lift(own.points[0]);
        for k in rays.in_order(0, 1024) {
            rays.cast(&mut walker, mesh, point, direction(frame, k, flips(point)));
        }
    }
    let nearest = cpu() - begin;
    let begin = cpu();
    for own in &places {
        let point = mesh.root_frame(own.root).lift(own.points[0]);
        for other in places.iter().cycle().take(1024) {
            let to = mesh.root_frame(other.root).lift(other.points[0]);
            if to != point {
                rays.is_blocked(&mut walker, point, to);
            }
        }
    }
    let million = 256.0 * 1024.0 * 1e-6;
    println!(
        "rays: {:.2} million a second (nearest, bundles), {:.2} (occlusion, scattered points)",
        million / nearest,
        million / (cpu() - begin)
    );
}
