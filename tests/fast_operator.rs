//! The fast operator against the exact one, on many scenes that are hard on purpose.

mod common;
#[path = "common/random.rs"]
mod random;

use std::f64::consts::PI;
use std::path::Path;

use common::{Prepared, box_quads, exact_of, material, rotated, scene};
use glam::DVec3;
use lumel::cluster::fit::deviations;
use lumel::mesh::{Basis, Refinement};
use lumel::monitor::Monitor;
use lumel::operator::Operator;
use lumel::operator::fast::{Demand, FastOperator, FastOptions};
use lumel::scene::{Material, ReadOptions, Scene, read};
use random::Random;
use rayon::prelude::*;

type Quad = [DVec3; 4];

/// A closed room with things in it, and a lamp.
fn room(seed: u64) -> Scene {
    let mut r = Random::new(seed);
    let size = DVec3::new(1.0, r.within(0.5, 1.5), r.within(0.4, 1.2));
    let mut quads: Vec<(Quad, u32)> =
        box_quads(DVec3::ZERO, size, false).into_iter().map(|q| (q, 0)).collect();
    let lamp = size * DVec3::new(r.within(0.2, 0.6), r.within(0.2, 0.6), 0.98);
    let wide = r.within(0.05, 0.3);
    let (x, y) = (wide * DVec3::X, wide * DVec3::Y);
    quads.push(([lamp, lamp + y, lamp + x + y, lamp + x], 1));
    for _ in 0..1 + r.below(3) {
        // Somewhere inside, turned or not.
        let turn = if r.below(2) == 0 { r.turn() } else { glam::DMat3::IDENTITY };
        let middle = size * DVec3::new(r.within(0.3, 0.7), r.within(0.3, 0.7), r.within(0.2, 0.6));
        let half = r.within(0.05, 0.2);
        let place = |x: f64, y: f64, z: f64| middle + half * (turn * DVec3::new(x, y, z));
        let rectangle = |x: (f64, f64), y: (f64, f64), z: f64| -> Quad {
            [place(x.0, y.0, z), place(x.1, y.0, z), place(x.1, y.1, z), place(x.0, y.1, z)]
        };
        let close = 10f64.powf(-r.within(3.0, 9.0));
        match r.below(6) {
            0 => {
                let (low, high) = (DVec3::new(-1.0, -0.7, -0.5), DVec3::new(1.0, 0.7, 0.5));
                for quad in box_quads(low, high, true) {
                    quads.push((quad.map(|x| middle + half * (turn * x)), 0));
                }
            }
            1 => {
                let count = 2 + r.below(3);
                for k in 0..count {
                    let at = 2.0 * (k as f64 + 0.5) / count as f64 - 1.0;
                    let width = r.within(0.01, 0.3) / count as f64;
                    quads.push((rectangle((-1.0, 1.0), (at - width, at + width), 0.0), 2));
                }
            }
            2 => {
                // A hole: a ring of quads.
                let hole = r.within(0.1, 0.8);
                quads.push((rectangle((-1.0, 1.0), (-1.0, -hole), 0.0), 2));
                quads.push((rectangle((-1.0, 1.0), (hole, 1.0), 0.0), 2));
                quads.push((rectangle((-1.0, -hole), (-hole, hole), 0.0), 2));
                quads.push((rectangle((hole, 1.0), (-hole, hole), 0.0), 2));
            }
            3 => {
                // Two plates that nearly touch.
                quads.push((rectangle((-1.0, 1.0), (-1.0, 1.0), 0.0), 2));
                let off = r.within(-0.5, 0.5);
                quads.push((rectangle((off - 1.0, off + 0.8), (-0.6, 1.1), close), 2));
            }
            4 => {
                // A plate that nearly touches the floor and a wall.
                let far = r.within(0.1, 0.4);
                let [a, b] = [close, close + far];
                let corner = |x: f64, y: f64| DVec3::new(x, y, close);
                quads.push(([corner(a, a), corner(b, a), corner(b, b), corner(a, b)], 2));
            }
            _ => {
                // Long and thin.
                let thin = 10f64.powf(-r.within(1.0, 3.0));
                quads.push((rectangle((-1.5, 1.5), (0.0, thin), 0.0), 2));
            }
        }
    }
    let both = Material { two_sided: true, ..material("both", 0.5, 0.0) };
    let scene = scene(&quads, vec![material("grey", 0.5, 0.0), material("lamp", 0.5, 1.0), both]);
    match r.below(4) {
        0 => rotated(&scene, r.turn(), 10f64.powf(r.within(-4.0, 4.0)), DVec3::ZERO),
        1 => rotated(&scene, r.turn(), 1.0, 10.0 * r.direction()),
        _ => scene,
    }
}

/// A room, blocks and plates with corners on a grid: edges, corners and planes coincide, and things
/// stand in each other.
fn grid_room(seed: u64) -> Scene {
    let mut r = Random::new(seed);
    let size = DVec3::new(4.0, 4.0, 3.0);
    let mut quads: Vec<(Quad, u32)> =
        box_quads(DVec3::ZERO, size, false).into_iter().map(|q| (q, 0)).collect();
    let lamp = DVec3::new(1.0, 2.0, 3.0);
    quads.push(([lamp, lamp + DVec3::Y, lamp + DVec3::X + DVec3::Y, lamp + DVec3::X], 1));
    for _ in 0..2 + r.below(3) {
        let mut corner = || DVec3::new(r.below(5) as f64, r.below(5) as f64, r.below(4) as f64);
        let (a, b, c) = (corner(), corner(), corner());
        if (a - b).abs().min_element() > 0.0 && c.x > 1.0 {
            for quad in box_quads(a.min(b), a.max(b), true) {
                quads.push((quad, 0));
            }
        } else if (b - a).cross(c - a) != DVec3::ZERO
            && (b + c - a).clamp(DVec3::ZERO, size) == b + c - a
        {
            quads.push(([a, b, b + c - a, c], 2));
        }
    }
    let both = Material { two_sided: true, ..material("both", 0.5, 0.0) };
    let scene = scene(&quads, vec![material("grey", 0.5, 0.0), material("lamp", 0.5, 1.0), both]);
    match r.below(3) {
        0 => rotated(&scene, r.turn(), 10f64.powf(r.within(-7.0, 7.0)), DVec3::ZERO),
        1 => rotated(&scene, r.turn(), 1.0, 1e3 * r.direction()),
        _ => scene,
    }
}

fn apply(operator: &Operator, u: &[f64]) -> Vec<f64> {
    let u: Vec<[f64; 1]> = u.iter().map(|&u| [u]).collect();
    let mut out = vec![[0.0]; u.len()];
    operator.apply(&u, &mut out);
    out.iter().map(|h| h[0]).collect()
}

/// Values of a smooth function at the nodes.
fn smooth(prepared: &Prepared) -> Vec<f64> {
    let (from, size) = (prepared.mesh.bounds.min, prepared.mesh.bounds.extent());
    (0..prepared.mesh.nodes())
        .map(|i| {
            let x = (prepared.mesh.node(i).0 - from) / size;
            1.0 + 0.5 * (2.0 * x.x + x.y).sin() + 0.3 * (3.0 * (x.z - x.y)).cos()
        })
        .collect()
}

/// What the lamp gives after two bounces: it has shadow lines.
fn lit(scene: &Scene, prepared: &Prepared, exact: &Operator) -> Vec<f64> {
    let (reflectance, exitance) = lumel::mesh::appearance(scene, &prepared.mesh);
    let mut u: Vec<f64> = exitance.iter().map(|e| e.x).collect();
    for _ in 0..2 {
        let h = apply(exact, &u);
        for (i, u) in u.iter_mut().enumerate() {
            *u = exitance[i].x + reflectance[i].x * h[i] / PI;
        }
    }
    u
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |a, v| a.max(v.abs()))
}

/// What a fast operator is built for.
#[derive(Clone, Copy)]
struct Wish {
    order: usize,
    /// Largest error of a link, over the largest irradiance.
    allowed: f64,
    precision: f64,
}

/// What a user gets who asks for a tolerance.
fn wish(tolerance: f64) -> Wish {
    let options = FastOptions::new(tolerance, None, None).unwrap();
    Wish { order: options.order(), allowed: options.allowed(1.0), precision: options.precision() }
}

/// The fast product of `u`, by an operator that is built for it.
fn product(prepared: &Prepared, u: &[f64], highest: f64, wish: Wish) -> Vec<f64> {
    let Prepared { mesh, clusters, .. } = prepared;
    let values: Vec<[f64; 1]> = u.iter().map(|&u| [u]).collect();
    let all = vec![true; mesh.roots.len()];
    let demand = Demand {
        order: wish.order,
        eta: 0.5,
        deviation: &deviations(mesh, clusters, &values),
        allowed: wish.allowed * highest / PI,
        precision: wish.precision,
        sends: &all,
        receives: &all,
    };
    let silent = Monitor::silent();
    let fast = FastOperator::build(prepared.stage(), &demand, u64::MAX, &silent).unwrap();
    let mut out = vec![[0.0]; u.len()];
    fast.apply(&values, &mut out);
    out.iter().map(|h| h[0]).collect()
}

/// Largest error of the fast product of `u`, relative to the largest value.
fn error(prepared: &Prepared, exact: &Operator, u: &[f64], wish: Wish) -> f64 {
    let want = apply(exact, u);
    let highest = largest(&want);
    let got = product(prepared, u, highest, wish);
    let off: Vec<f64> = got.iter().zip(&want).map(|(g, w)| g - w).collect();
    largest(&off) / highest
}

/// Checks rooms to a tolerance, with smooth radiosities, such that have single elements that are
/// off by about the tolerance, and such as a lamp gives.
fn check(seeds: std::ops::Range<u64>, basis: Basis, tolerance: f64) {
    let errors: Vec<(u64, [f64; 3])> = seeds
        .into_par_iter()
        .map(|seed| {
            let scene = room(seed);
            let elements = if seed % 50 == 7 { 1500 } else { 80 + 100 * (seed % 4) as usize };
            let prepared = Prepared::new(&scene, basis, Refinement::Elements(elements));
            let exact = exact_of(&prepared);
            let plain = smooth(&prepared);
            let mut r = Random::new(!seed);
            let (high, step) = (10f64.powf(r.within(-1.0, 2.0)) * tolerance, 5 + r.below(30));
            let off = |i: usize| if (i / basis.nodes()).is_multiple_of(step) { high } else { 0.0 };
            let spiked = plain.iter().enumerate().map(|(i, u)| u + off(i)).collect();
            let lit = lit(&scene, &prepared, &exact);
            let of = |u: Vec<f64>| error(&prepared, &exact, &u, wish(tolerance)) / tolerance;
            (seed, [of(plain), of(spiked), of(lit)])
        })
        .collect();
    let worst = |k: usize| errors.iter().map(|(_, e)| e[k]).fold(0.0, f64::max);
    println!("{tolerance:e}: {:.2} smooth, {:.2} spiked, {:.2} lit", worst(0), worst(1), worst(2));
    let wrong: Vec<_> = errors.iter().filter(|(_, e)| !e.iter().all(|e| *e <= 1.0)).collect();
    assert!(wrong.is_empty(), "{tolerance:e} is not met: (seed, errors over it) = {wrong:?}");
}

#[test]
fn random_rooms_to_four_digits() {
    check(0..100, Basis::Linear, 1e-4);
}

#[test]
fn random_rooms_to_six_digits() {
    check(100..130, Basis::Linear, 1e-6);
}

#[test]
fn random_rooms_with_the_constant_basis() {
    check(200..210, Basis::Constant, 1e-4);
    check(210..215, Basis::Constant, 1e-6);
}

/// Where nothing may be approximated but the far field, what remains is its error: far below that
/// of any proof of visibility that is wrong.
fn check_visibility(make: fn(u64) -> Scene, seeds: std::ops::Range<u64>) {
    let worst = seeds
        .into_par_iter()
        .map(|seed| {
            let scene = make(seed);
            let elements = 80 + 100 * (seed % 4) as usize;
            let prepared = Prepared::new(&scene, Basis::Constant, Refinement::Elements(elements));
            let exact = exact_of(&prepared);
            let u = lit(&scene, &prepared, &exact);
            let wish = Wish { order: 14, allowed: 0.0, precision: 0.0 };
            (error(&prepared, &exact, &u, wish), seed)
        })
        .reduce(|| (0.0, 0), |a, b| if a.0 > b.0 { a } else { b });
    println!("{worst:?}");
    assert!(worst.0 < 1e-9, "{worst:?}");
}

#[test]
fn visibility_is_exact_in_random_rooms() {
    check_visibility(room, 300..330);
}

#[test]
fn visibility_is_exact_on_a_grid() {
    check_visibility(grid_room, 0..30);
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    for seed in [3, 7] {
        let scene = room(seed);
        let prepared = Prepared::new(&scene, Basis::Linear, Refinement::Elements(1200));
        let u = smooth(&prepared);
        let bits = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let out = pool.install(|| product(&prepared, &u, PI, wish(1e-4)));
            out.into_iter().map(f64::to_bits).collect::<Vec<_>>()
        };
        let one = bits(1);
        assert!(one == bits(2) && one == bits(3), "seed {seed}");
    }
}

/// One element of a cluster may be all that a node sees of it: its deviation is the largest, not
/// a mean. A mean made errors of seven tolerances here.
#[test]
fn a_single_element_may_fill_the_view() {
    let square = |z: f64, from: f64, to: f64, up: bool| -> Quad {
        let p = |x: f64, y: f64| DVec3::new(x, y, z);
        let q = [p(from, from), p(to, from), p(to, to), p(from, to)];
        if up { q } else { [q[3], q[2], q[1], q[0]] }
    };
    // Two plates 1e-5 apart, and something small between, so that no pair is clear at once.
    let mut bit = square(2e-6, 0.50, 0.51, true);
    (bit[2].z, bit[3].z) = (8e-6, 8e-6);
    let quads = [square(0.0, 0.0, 1.0, true), square(1e-5, 0.1, 1.1, false), bit];
    let scene = scene(&quads.map(|q| (q, 0)), vec![material("grey", 0.5, 0.0)]);
    let prepared = Prepared::new(&scene, Basis::Constant, Refinement::Levels(4));
    let exact = exact_of(&prepared);
    let tolerance = 1e-4;
    for high in [1.0, 2.0, 4.0] {
        let value = |i: usize| if i % 256 == 77 { 1.0 + high * tolerance } else { 1.0 };
        let u: Vec<f64> = (0..prepared.mesh.nodes()).map(value).collect();
        let error = error(&prepared, &exact, &u, wish(tolerance));
        assert!(error <= tolerance, "{high}: {error:e}");
    }
}

/// Errors of the far field alone fall by a factor of 12 or more with each two orders, down to 1e-9.
/// (Odd and even orders differ: one step alone may gain less than 3.)
#[test]
fn errors_fall_with_the_order() {
    [("paper", 1400), ("cornell", 800), ("room", 800)].par_iter().for_each(|&(name, elements)| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.gltf"));
        let scene = read(&path, &ReadOptions::default()).unwrap();
        let prepared = Prepared::new(&scene, Basis::Linear, Refinement::Elements(elements));
        let exact = exact_of(&prepared);
        let u = smooth(&prepared);
        let errors: Vec<f64> = (3..=10)
            .map(|order| error(&prepared, &exact, &u, Wish { order, allowed: 0.0, precision: 0.0 }))
            .collect();
        let text: String = errors.iter().map(|e| format!("{e:.1e} ")).collect();
        println!("{name}, {} elements: {text}", prepared.mesh.elements());
        assert!(errors[0] > 1e-5, "{name}: there is a far field");
        assert!(errors.windows(3).all(|e| e[2] <= e[0] / 12.0 || e[2] <= 1e-9), "{name}: {text}");
    });
}
