//! Light to a tolerance: the error that was asked for is met, and the estimate of it is honest.

mod common;
#[path = "common/random.rs"]
mod random;
#[path = "common/rooms.rs"]
mod rooms;

use common::{material, rotated, scene};
use glam::{DVec2, DVec3, dvec3};
use lumel::mesh::{Basis, Mesh, MeshOptions, Refinement};
use lumel::operator::spread::Shares;
use lumel::operator::{FastOptions, OperatorKind, Walker};
use lumel::reconstruct::fill::RootPoints;
use lumel::reconstruct::irradiance::irradiances;
use lumel::scene::{Scene, Texture, TextureUse};
use lumel::solve::{Light, LightOptions, SolveOptions, WithinOptions, light_within};
use lumel::{Monitor, solve};
use random::Random;
use rayon::prelude::*;
use rooms::{furnished, with_spots};

fn within(scene: &Scene, tolerance: f64) -> Light {
    // Tight references of some rooms would take all memory: a little less tight does.
    let options = WithinOptions::new(tolerance, 8 << 30);
    light_within(scene, &options, &Monitor::silent()).unwrap()
}

/// Random points of the surface, evenly by area, root by root.
fn points(mesh: &Mesh, count: usize, seed: u64) -> Vec<RootPoints> {
    let area = |t: &[DVec2; 3]| 0.5 * (t[1] - t[0]).perp_dot(t[2] - t[0]);
    let total: f64 = mesh.roots.iter().map(|r| area(&r.corners)).sum();
    let mut random = Random::new(seed);
    let mut asked: Vec<RootPoints> =
        (0..mesh.roots.len() as u32).map(|root| RootPoints { root, points: vec![] }).collect();
    for _ in 0..count {
        let mut left = random.unit() * total;
        let number = mesh.roots.iter().position(|r| {
            left -= area(&r.corners);
            left < 0.0
        });
        let number = number.unwrap_or(0);
        asked[number].points.push(in_triangle(&mesh.roots[number].corners, &mut random));
    }
    asked
}

/// A random point of a triangle, evenly by area.
fn in_triangle(t: &[DVec2; 3], random: &mut Random) -> DVec2 {
    let (mut s, mut u) = (random.unit(), random.unit());
    if s + u > 1.0 {
        (s, u) = (1.0 - s, 1.0 - u);
    }
    t[0] + s * (t[1] - t[0]) + u * (t[2] - t[0])
}

/// Irradiance gathered at each point.
fn gathered(light: &Light, asked: &[RootPoints]) -> Vec<DVec3> {
    let at: Vec<(u32, DVec2)> =
        asked.iter().flat_map(|own| own.points.iter().map(|&x| (own.root, x))).collect();
    at.par_iter()
        .map_init(Walker::default, |walker, &(root, x)| {
            let frame = &light.mesh.faces[light.mesh.roots[root as usize].face as usize].frame;
            light.irradiance(walker, frame.lift(x), frame.n)
        })
        .collect()
}

/// Root mean square difference relative to the mean of `want`; of the channels the largest.
fn difference(got: &[DVec3], want: &[DVec3]) -> f64 {
    let n = want.len() as f64;
    let mean = want.iter().sum::<DVec3>() / n;
    let squares = got.iter().zip(want).map(|(a, b)| (*a - *b) * (*a - *b)).sum::<DVec3>() / n;
    (squares / (mean * mean)).max_element().sqrt()
}

/// Random points, as many by area as by irradiance (a spot of little area may hold most of the squared
/// error), with their weights in a mean over the surface: roots, points in their planes, weights.
fn weighed_points(light: &Light, count: usize, seed: u64) -> Vec<(u32, DVec2, f64)> {
    let (mesh, nodes) = (&light.mesh, light.mesh.basis.nodes());
    let area: Vec<f64> = (0..mesh.elements()).map(|e| mesh.area(e)).collect();
    let power = |e: usize| {
        let own = &light.solution.irradiance[e * nodes..(e + 1) * nodes];
        area[e] * own.iter().map(|h| h.max_element()).sum::<f64>().max(0.0)
    };
    let (surface, all): (f64, f64) = (area.iter().sum(), (0..area.len()).map(power).sum());
    let share = |e: usize| 0.5 * area[e] / surface + 0.5 * power(e) / all;
    let (shares, _) = Shares::of((0..area.len()).map(share));
    let mut random = Random::new(seed);
    let mut one = || {
        let (e, _) = shares.choose(DVec2::new(random.unit(), 0.0));
        let x = in_triangle(&mesh.element_corners[e], &mut random);
        (mesh.element_root[e], x, area[e] / surface / share(e))
    };
    (0..count).map(|_| one()).collect()
}

/// Random points, evenly by area, likewise.
fn even_points(light: &Light, count: usize, seed: u64) -> Vec<(u32, DVec2, f64)> {
    let asked = points(&light.mesh, count, seed);
    asked.iter().flat_map(|own| own.points.iter().map(|&x| (own.root, x, 1.0))).collect()
}

type Points = fn(&Light, usize, u64) -> Vec<(u32, DVec2, f64)>;

/// The error of a light at random points against one of a tolerance ten times smaller, and its
/// estimate over that.
fn error_and_honesty(scene: &Scene, tolerance: f64, points: Points) -> (f64, f64) {
    let (light, reference) = (within(scene, tolerance), within(scene, 0.1 * tolerance));
    let at = points(&reference, 1500, 7);
    let pairs: Vec<(DVec3, DVec3)> = at
        .par_iter()
        .map_init(Walker::default, |walker, &(root, x, _)| {
            let root = &reference.mesh.roots[root as usize];
            let frame = &reference.mesh.faces[root.face as usize].frame;
            let mut at = |light: &Light| light.irradiance(walker, frame.lift(x), frame.n);
            (at(&light), at(&reference))
        })
        .collect();
    let weights: f64 = at.iter().map(|p| p.2).sum();
    let mean = pairs.iter().zip(&at).map(|(h, p)| p.2 * h.1).sum::<DVec3>() / weights;
    let squares: DVec3 = pairs.iter().zip(&at).map(|(h, p)| p.2 * (h.0 - h.1) * (h.0 - h.1)).sum();
    let error = (squares / weights / (mean * mean)).max_element().sqrt();
    (error, light.apart().unwrap().estimate.rms / error)
}

/// Of seeded rooms nearly all meet their tolerance, and of nearly all the estimates are above their
/// errors.
fn all_meet(
    (room, points): (fn(u64) -> Scene, Points),
    seeds: std::ops::Range<u64>,
    tolerance: f64,
) {
    let (mut met, mut honest) = (0, 0);
    let count = seeds.end - seeds.start;
    for seed in seeds {
        let (error, honesty) = error_and_honesty(&room(seed), tolerance, points);
        println!("room {seed}: error {error:.2e}, estimate over it {honesty:.2}");
        met += u64::from(error <= tolerance);
        honest += u64::from(honesty >= 1.0);
    }
    println!("{met} of {count} met, {honest} honest");
    assert!(20 * met >= 19 * count && 20 * honest >= 19 * count, "{met} {honest} of {count}");
}

#[test]
fn a_few_random_rooms_meet_their_tolerance() {
    all_meet((furnished, even_points), 0..4, 2e-2);
}

/// Takes about half an hour of one processor.
#[test]
#[ignore = "a study: cargo test --release --test tolerance -- --ignored --nocapture"]
fn a_hundred_random_rooms_meet_their_tolerance() {
    all_meet((furnished, even_points), 0..100, 3e-2);
}

/// Estimates do not see all that is missed beside edges which spots light: half of it at least here.
#[test]
fn a_few_rooms_with_small_lamps_close_to_walls_meet_their_tolerance() {
    for seed in 0..2 {
        let (error, honesty) = error_and_honesty(&with_spots(seed), 3e-2, weighed_points);
        println!("room {seed}: error {error:.2e}, estimate over it {honesty:.2}");
        assert!(error <= 3e-2 && honesty >= 0.5);
    }
}

/// What is missed beside edges that spots light is not seen by estimates until elements are as small.
#[test]
#[ignore = "a study, known to fail: one estimate in eight is too low"]
fn fifty_rooms_with_small_lamps_close_to_walls_meet_their_tolerance() {
    all_meet((with_spots, weighed_points), 0..50, 6e-2);
}

fn room_with_lamp(lamp: Vec<([DVec3; 4], u32)>, change: impl Fn(&mut Scene)) -> Scene {
    let mut quads: Vec<_> = common::box_quads(DVec3::ZERO, dvec3(3.0, 2.0, 2.5), false)
        .into_iter()
        .map(|q| (q, 0))
        .collect();
    let block = common::box_quads(dvec3(0.8, 0.0, 0.7), dvec3(1.4, 0.7, 1.5), true);
    quads.extend(block.into_iter().map(|q| (q, 0)));
    quads.extend(lamp);
    let mut room = scene(&quads, vec![material("grey", 0.6, 0.0), material("lamp", 0.5, 3.0)]);
    change(&mut room);
    room
}

/// A lamp of n x n squares that shines down.
fn lamp(n: usize) -> Vec<([DVec3; 4], u32)> {
    let p =
        |i: usize, j: usize| dvec3(1.3, 1.8, 1.0) + 0.6 * dvec3(i as f64, 0.0, j as f64) / n as f64;
    let cell = |k: usize| {
        let (i, j) = (k / n, k % n);
        ([p(i, j), p(i + 1, j), p(i + 1, j + 1), p(i, j + 1)], 1)
    };
    (0..n * n).map(cell).collect()
}

/// Lamps of all kinds against the fast operator on a fine mesh, where emission is part of the
/// solution: another way to the same light.
#[test]
fn lamps_of_all_kinds_agree_with_a_solution_that_does_not_tell_them_apart() {
    let checker = |room: &mut Scene| {
        let pixel = |k: usize| {
            if (k / 4 + k % 4).is_multiple_of(2) { [1.0f32, 0.8, 0.1] } else { [0.1; 3] }
        };
        room.textures = vec![Texture::new("t", 4, 4, (0..16).map(pixel).collect())];
        room.materials[1].radiance_texture = Some(TextureUse::plain(0));
        for t in &mut room.triangles {
            t.uv = [t.vertices.map(|x| (DVec2::new(x.x, x.z) - DVec2::new(1.3, 1.0)) / 0.6); 2];
        }
    };
    let cases: [(&str, Scene); 4] = [
        ("of many triangles", room_with_lamp(lamp(5), |_| {})),
        ("two-sided", room_with_lamp(lamp(1), |room| room.materials[1].two_sided = true)),
        (
            "that does not reflect",
            room_with_lamp(lamp(1), |room| {
                room.materials[1].reflectance = DVec3::ZERO;
            }),
        ),
        ("with a texture", room_with_lamp(lamp(1), checker)),
    ];
    for (name, room) in cases {
        let light = within(&room, 3e-3);
        let options = LightOptions {
            mesh: MeshOptions { basis: Basis::Linear, refinement: Refinement::MaxEdge(0.08) },
            operator: OperatorKind::Fast(FastOptions::new(1e-4, None, None).unwrap()),
            solve: SolveOptions { residual: 1e-6, ..SolveOptions::default() },
            max_memory: u64::MAX,
        };
        let other = solve::light::light(&room, &options, &Monitor::silent()).unwrap();
        let asked = points(&light.mesh, 500, 3);
        let off = difference(&gathered(&light, &asked), &gathered(&other, &asked));
        println!("a lamp {name}: {off:.2e}");
        assert!(off < 5e-3, "a lamp {name}: {off:e}");
    }
}

#[test]
fn cutting_a_lamp_changes_nothing_but_errors() {
    let (one, many) =
        (within(&room_with_lamp(lamp(1), |_| {}), 3e-3), room_with_lamp(lamp(6), |_| {}));
    let many = within(&many, 3e-3);
    let position = |light: &Light, own: &RootPoints, x: DVec2| {
        light.mesh.faces[light.mesh.roots[own.root as usize].face as usize].frame.lift(x)
    };
    let asked = points(&one.mesh, 300, 5);
    let mut walker = Walker::default();
    let (mut a, mut b) = (vec![], vec![]);
    for own in &asked {
        let normal = one.mesh.faces[one.mesh.roots[own.root as usize].face as usize].frame.n;
        for &x in &own.points {
            let point = position(&one, own, x);
            a.push(one.irradiance(&mut walker, point, normal));
            b.push(many.irradiance(&mut walker, point, normal));
        }
    }
    let off = difference(&a, &b);
    assert!(off < 3e-3, "{off:e}");
}

#[test]
fn filling_in_agrees_with_gathering() {
    let room = furnished(3);
    for tolerance in [3e-2, 3e-3] {
        let light = within(&room, tolerance);
        let asked = points(&light.mesh, 60_000, 11);
        let (filled, counts) = irradiances(&light, &asked, &Monitor::silent()).unwrap();
        let some: Vec<usize> = (0..60_000).step_by(20).collect();
        let filled: Vec<DVec3> = filled.into_iter().flatten().collect();
        let each = gathered(&light, &asked);
        let pick = |all: &[DVec3]| -> Vec<DVec3> { some.iter().map(|&k| all[k]).collect() };
        let off = difference(&pick(&filled), &pick(&each));
        let estimate = counts.error(light.apart().unwrap().estimate.mean);
        println!("{tolerance:e}: filled in {off:.2e}, estimated {estimate:.2e}, {counts:?}");
        assert!(off < 0.5 * tolerance && off < 2.0 * estimate, "{off:e} {estimate:e}");
        assert!(counts.indirect.gathered < 30_000, "{counts:?}");
    }
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let room = furnished(1);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let light = within(&room, 2e-2);
            let asked = points(&light.mesh, 3000, 2);
            (irradiances(&light, &asked, &Monitor::silent()).unwrap().0, light.solution.radiosity)
        })
    };
    let one = run(1);
    assert!(one == run(2) && one == run(3));
}

#[test]
fn turning_moving_and_scaling_changes_nothing_but_errors() {
    let room = furnished(2);
    let light = within(&room, 5e-3);
    let asked = points(&light.mesh, 400, 9);
    let want = gathered(&light, &asked);
    let turn = Random::new(8).turn();
    for (scale, shift) in [(1.0, DVec3::splat(5.0)), (1e-3, DVec3::ZERO), (1e4, DVec3::splat(3.0))]
    {
        let other = within(&rotated(&room, turn, scale, shift), 5e-3);
        let mut walker = Walker::default();
        let mut got = vec![];
        for own in &asked {
            let face = &light.mesh.faces[light.mesh.roots[own.root as usize].face as usize];
            for &x in &own.points {
                let point = scale * (turn * face.frame.lift(x)) + shift;
                got.push(other.irradiance(&mut walker, point, turn * face.frame.n));
            }
        }
        let off = difference(&got, &want);
        assert!(off < 5e-3, "scale {scale}: {off:e}");
    }
}

#[test]
fn a_closed_furnace_is_as_bright_as_it_must_be() {
    let mut room = furnished(4);
    for m in &mut room.materials {
        (m.reflectance, m.radiance) =
            (DVec3::splat(0.5), DVec3::splat(std::f64::consts::FRAC_1_PI));
    }
    let light = within(&room, 1e-3);
    let asked = points(&light.mesh, 300, 1);
    // u = E / (1 - rho) = 2 everywhere that is not buried.
    let off = gathered(&light, &asked).into_iter().map(|h| (h - 2.0).abs().max_element());
    let off: Vec<f64> = off.filter(|off| *off < 1.0).collect();
    let worst = off.iter().copied().fold(0.0, f64::max);
    assert!(off.len() > 280 && worst < 4e-3, "{} {worst:e}", off.len());
}

#[test]
fn what_cannot_be_met_is_said_and_the_best_is_given() {
    let room = furnished(5);
    let options = WithinOptions::new(1e-4, 160 << 20);
    let light = light_within(&room, &options, &Monitor::silent()).unwrap();
    let source = light.apart().unwrap();
    let why = source.shortfall.as_ref().unwrap();
    assert!(why.contains("memory"), "{why}");
    assert!(source.estimate.rms > 1e-4 && source.estimate.rms < 0.1, "{:?}", source.estimate);
    // And a scene without light needs nothing.
    let mut dark = furnished(5);
    dark.materials.iter_mut().for_each(|m| m.radiance = DVec3::ZERO);
    let light = within(&dark, 1e-3);
    assert_eq!(light.apart().unwrap().estimate.rms, 0.0);
    assert!(light.solution.radiosity.iter().all(|u| *u == DVec3::ZERO));
}
