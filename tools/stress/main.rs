//! The numerical stress suite: `cargo bench --bench stress`, or `cargo bench --bench stress -- NAME`
//! for the families whose name contains NAME.
//!
//! Prints three tables. `--seeds N` takes N scenes of each family (24, and a sixth of that for light to
//! a tolerance), `--detail` shows each. `tests/stress.rs` is the short form, with the same limits.

mod checks;
#[path = "../../tests/common/mod.rs"]
mod common;
mod light;
#[path = "../../tests/common/packed.rs"]
mod packed;
#[path = "../../tests/common/random.rs"]
#[allow(dead_code)]
mod random;
mod rays;
mod scenes;

use std::path::Path;

use checks::{Effort, Errors, errors, moved};
use light::{Truth, Within, bright, contrast, reflecting};
use lumel::scene::{ReadOptions, Scene, read};
use rayon::prelude::*;
use scenes::{FAMILIES, places};

const EFFORT: Effort = Effort { elements: 150, points: 6, rays: 20_000, pairs: 150 };

/// Light is solved to this tolerance, and to a tenth of it for comparison.
const TOLERANCE: f64 = 1e-2;

/// Points at which light is compared.
const POINTS: usize = 3000;

/// What was asked for.
struct Wish {
    words: Vec<String>,
    seeds: u64,
    detail: bool,
}

impl Wish {
    fn read() -> Wish {
        let mut words: Vec<String> = std::env::args().skip(1).filter(|w| w != "--bench").collect();
        let mut seeds = 24;
        if let Some(at) = words.iter().position(|w| w == "--seeds") {
            seeds = words.get(at + 1).and_then(|w| w.parse().ok()).unwrap_or(seeds);
            words.drain(at..(at + 2).min(words.len()));
        }
        let detail = words.iter().any(|w| w == "--detail");
        words.retain(|w| w != "--detail");
        Wish { words, seeds, detail }
    }

    fn chooses(&self, name: &str) -> bool {
        self.words.iter().all(|w| name.contains(w.as_str()))
    }
}

fn largest(numbers: impl IntoIterator<Item = f64>) -> f64 {
    numbers.into_iter().fold(0.0, f64::max)
}

/// Exact rows, the fast operator and its solution.
fn operators(wish: &Wish) {
    println!(
        "| scenes | rows | closure | limit | exact - rays | one way | fast - exact | residual | \
         turned, scaled | limit | moved by 1e6 sizes | limit |"
    );
    println!("|---{}|", "|---".repeat(11));
    for family in FAMILIES.iter().filter(|f| wish.chooses(f.name)) {
        let found: Vec<(Errors, [f64; 2])> = (0..wish.seeds)
            .into_par_iter()
            .map(|seed| {
                let case = (family.make)(seed);
                let own = errors(&case, family.basis, EFFORT, seed);
                let (turned, far) = places(seed);
                let at = |place| moved(&case, family.basis, place, EFFORT);
                (own, [largest(turned.iter().map(at)), largest(far.iter().map(at))])
            })
            .collect();
        if wish.detail {
            found.iter().enumerate().for_each(|(seed, one)| println!("{seed}: {one:?}"));
        }
        let all = found.iter().fold(Errors::default(), |a, (b, _)| a.worst(*b));
        println!(
            "| {} | {} | {:.0e} | {:.0e} | {:.0e} | {} of {} | {:.0e} | {:.0e} | {:.0e} | {:.0e} | {:.0e} \
             | {:.0e} |",
            family.name,
            all.rows,
            all.closure,
            family.closure,
            all.rays,
            all.one_way,
            all.pairs,
            all.fast,
            all.residual,
            largest(found.iter().map(|f| f.1[0])),
            family.turned,
            largest(found.iter().map(|f| f.1[1])),
            family.far,
        );
    }
}

/// Light to a tolerance.
fn tolerances(wish: &Wish) {
    println!(
        "\n| scenes | solved | met {TOLERANCE:e} | largest error | estimate / error | estimate too small | \
         imbalance of energy |"
    );
    println!("|---{}|", "|---".repeat(6));
    let print = |name: &str, found: Vec<Within>| {
        if wish.detail {
            found.iter().for_each(|one| println!("{one:?}"));
        }
        let honesty = || found.iter().map(|w| w.estimate / w.error);
        println!(
            "| {name} | {} | {} | {:.1e} | {:.1} to {:.1} | {} | {:.0e} |",
            found.len(),
            found.iter().filter(|w| w.error <= TOLERANCE).count(),
            largest(found.iter().map(|w| w.error)),
            honesty().fold(f64::INFINITY, f64::min),
            largest(honesty()),
            honesty().filter(|h| *h < 1.0).count(),
            largest(found.iter().map(|w| w.imbalance.abs())),
        );
    };
    let one =
        |scene: &Scene| Truth::of(scene, 0.1 * TOLERANCE, POINTS).against(scene, None, TOLERANCE);
    let seeds = wish.seeds.div_ceil(6);
    for family in FAMILIES.iter().filter(|f| wish.chooses(f.name)) {
        print(family.name, (0..seeds).map(|seed| one(&(family.make)(seed).scene)).collect());
    }
    let name = "lamps of contrast 1000 in two chambers";
    if wish.chooses(name) {
        print(name, (0..seeds).map(|seed| one(&contrast(seed))).collect());
    }
    for rho in [0.0, 0.9, 0.999] {
        let name = format!("boxes of reflectance {rho}");
        if wish.chooses(&name) {
            print(&name, (0..seeds).map(|seed| one(&bright(seed, rho))).collect());
        }
    }
    for name in ["paper", "cornell", "furnace", "room"].into_iter().filter(|n| wish.chooses(n)) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
        let scene = match read(&path.with_extension("gltf"), &ReadOptions::default()) {
            Ok(scene) => scene,
            Err(why) => return eprintln!("{why}"),
        };
        let truth = Truth::of(&scene, 0.1 * TOLERANCE, POINTS);
        let (turned, far) = places(1);
        let all = [None].into_iter().chain(turned.iter().chain(&far).map(Some));
        let found = all.map(|place| truth.against(&scene, place, TOLERANCE)).collect();
        print(&format!("`{name}`, as it is, turned, scaled, moved"), found);
    }
}

/// One reflectance everywhere.
fn reflectances(wish: &Wish) {
    println!("\n| boxes with blocks, E = 1 | reflectance | error, products with the operator |");
    println!("|---|---|---|");
    for (name, closed) in [("closed", true), ("open", false)] {
        for rho in [0.0, 0.9, 0.999, 1.0] {
            let found: Vec<String> = (0..wish.seeds.div_ceil(6))
                .map(|seed| reflecting(seed, closed, rho).to_string())
                .collect();
            println!("| {name} | {rho} | {} |", found.join("; "));
        }
    }
}

fn main() {
    let wish = Wish::read();
    operators(&wish);
    tolerances(&wish);
    if wish.words.is_empty() {
        reflectances(&wish);
    }
}
