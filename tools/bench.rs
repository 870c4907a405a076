//! Run time against error of the operators: `cargo bench`, or `cargo bench -- NAME` for the cases
//! whose line contains NAME.
//!
//! Every case solves a scene in a process of its own, so that its CPU seconds (user and system, of
//! all threads) and its peak of memory are its own. The error of an operator is that of the
//! irradiance at nodes, against rows gathered exactly at 400 of them with the same radiosity,
//! relative to the largest irradiance. Growth exponents are those between a case and the one above
//! it. The last table repeats one case with one thread and with two.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use lumel::mesh::{Basis, MeshOptions, Refinement};
use lumel::operator::{ClusteredOptions, FastOptions, OperatorKind, Walker, gather};
use lumel::output::machine;
use lumel::scene::{ReadOptions, read};
use lumel::solve::{Light, LightOptions, SolveOptions, light};
use lumel::{Error, Monitor, Result};
use serde_json::{Value, json};

/// One solve.
#[derive(Clone, Copy)]
struct Case {
    scene: &'static str,
    /// Times each face is refined, or below zero: minus the number of elements aimed at.
    size: i64,
    operator: &'static str,
    tolerance: f64,
    /// Order of the far field, where it does not follow from the tolerance.
    order: Option<usize>,
    threads: usize,
}

/// Nodes at which the operator's error is measured.
const SAMPLES: usize = 400;

fn cases() -> Vec<Case> {
    let case = |scene, size, operator, tolerance| Case {
        scene,
        size,
        operator,
        tolerance,
        order: None,
        threads: 2,
    };
    let mut list = vec![];
    for tolerance in [1e-5, 1e-7] {
        list.extend([4, 5, 6, 7].map(|size| case("paper", size, "fast", tolerance)));
    }
    list.extend([4, 5].map(|size| case("paper", size, "exact", 0.0)));
    list.extend([4, 5, 6].map(|size| case("paper", size, "clustered", 1e-5)));
    for scene in ["cornell", "room"] {
        for tolerance in [1e-3, 1e-4, 1e-5] {
            list.extend(
                [-6_000, -25_000, -100_000].map(|size| case(scene, size, "fast", tolerance)),
            );
        }
        list.push(case(scene, -6_000, "exact", 0.0));
    }
    // The far field alone: links are exact at this tolerance.
    for (scene, sizes) in
        [("paper", [4, 5]), ("cornell", [-2_500, -10_000]), ("room", [-2_500, -10_000])]
    {
        for size in sizes {
            let orders = [4, 6, 8, 10, 12].map(Some);
            list.extend(orders.map(|order| Case { order, ..case(scene, size, "fast", 1e-12) }));
        }
    }
    list
}

fn kind(case: &Case) -> Result<OperatorKind> {
    Ok(match case.operator {
        "exact" => OperatorKind::Exact,
        "clustered" => OperatorKind::Clustered(ClusteredOptions::new(0.125, 4)?),
        _ => OperatorKind::Fast(FastOptions::new(case.tolerance, case.order, None)?),
    })
}

fn solved(case: &Case) -> Result<Light> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(case.scene);
    let scene = read(&path.with_extension("gltf"), &ReadOptions::default())?;
    let refinement = match u32::try_from(case.size) {
        Ok(levels) => Refinement::Levels(levels),
        Err(_) => Refinement::Elements(case.size.unsigned_abs() as usize),
    };
    let options = LightOptions {
        mesh: MeshOptions { basis: Basis::Linear, refinement },
        operator: kind(case)?,
        solve: SolveOptions { residual: 1e-8, ..SolveOptions::default() },
        max_memory: u64::MAX,
    };
    light::light(&scene, &options, &Monitor::silent())
}

/// Largest difference between the irradiance and exact rows at sampled nodes, relative.
fn operator_error(light: &Light) -> f64 {
    let irradiance = &light.solution.irradiance;
    let largest = irradiance.iter().map(|h| h.max_element()).fold(0.0, f64::max);
    let nodes = light.mesh.nodes();
    let mut walker = Walker::default();
    let mut worst: f64 = 0.0;
    for sample in 0..SAMPLES.min(nodes) {
        // Multiples of the golden section: spread evenly, in step with nothing.
        let node = ((sample as f64 * 0.618_033_988_749_895).fract() * nodes as f64) as usize;
        let (point, normal) = light.mesh.node(node);
        let want = gather(&mut walker, light.stage(), &light.solution.radiosity, point, normal);
        let lit = light.reflectance[node] != glam::DVec3::ZERO;
        if lit {
            worst = worst.max((irradiance[node] - want).abs().max_element());
        }
    }
    worst / largest
}

/// Runs a case in this process; one line of JSON.
fn run_here(case: &Case) -> Result<Value> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(case.threads).build();
    let pool = pool.map_err(|e| Error::Runtime(e.to_string()))?;
    pool.install(|| {
        let (start, before) = (Instant::now(), machine::cpu_seconds().unwrap_or(f64::NAN));
        let light = solved(case)?;
        let cpu = machine::cpu_seconds().unwrap_or(f64::NAN) - before;
        let wall = start.elapsed().as_secs_f64();
        let memory = machine::peak_memory().unwrap_or(0);
        let bits = light.solution.irradiance.iter().flat_map(|h| h.to_array());
        let hash = bits
            .fold(0u64, |h, x| h.rotate_left(5) ^ x.to_bits().wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let seconds = |name: &str| {
            light.seconds.iter().find(|(n, _)| *n == name).map_or(f64::NAN, |(_, s)| *s)
        };
        Ok(json!({
            "elements": light.mesh.elements(),
            "cpu": cpu,
            "wall": wall,
            "memory": memory,
            "bytes": light.bytes,
            "entries": light.entries as f64 / light.mesh.nodes() as f64,
            "products": light.solution.iterations,
            "pairs": seconds("pair seconds"),
            "far": seconds("far field seconds"),
            "links": seconds("link seconds"),
            "error": operator_error(&light),
            "hash": format!("{hash:016x}"),
        }))
    })
}

/// Runs a case in a process of its own.
fn run_apart(index: usize, threads: usize) -> Result<Value> {
    let own = std::env::current_exe().map_err(|e| Error::Runtime(e.to_string()))?;
    let output =
        Command::new(own).args(["--case", &index.to_string(), &threads.to_string()]).output();
    let output = output.map_err(|e| Error::Runtime(e.to_string()))?;
    serde_json::from_slice(&output.stdout)
        .map_err(|e| Error::Runtime(format!("{e}: {}", String::from_utf8_lossy(&output.stderr))))
}

fn number(value: &Value, name: &str) -> f64 {
    value[name].as_f64().unwrap_or(f64::NAN)
}

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).filter(|w| w != "--bench").collect();
    let list = cases();
    if let [flag, index, threads] = &words[..]
        && flag == "--case"
    {
        let index: usize = index.parse().unwrap_or(0);
        let case = Case { threads: threads.parse().unwrap_or(2), ..list[index] };
        println!("{}", run_here(&case)?);
        return Ok(());
    }
    println!(
        "| scene | operator | elements | CPU s | pairs | far | links | products | memory MB | operator MB | \
         entries a node | error | time ~ n^q | entries ~ n^q |"
    );
    println!("|---{}|", "|---".repeat(13));
    let mut above: Option<(usize, Value)> = None;
    for (index, case) in list.iter().enumerate() {
        let operator = match case.operator {
            "fast" => match case.order {
                None => format!("fast {:.0e}", case.tolerance),
                Some(order) => format!("fast order {order}"),
            },
            "clustered" => "clustered 0.125, 4".into(),
            name => name.into(),
        };
        let line = format!("{} {operator}", case.scene);
        if !words.iter().all(|w| line.contains(w.as_str())) {
            continue;
        }
        let value = run_apart(index, case.threads)?;
        let number = |name: &str| number(&value, name);
        let same = |k: usize| {
            let other = &list[k];
            (other.scene, other.operator, other.tolerance, other.order)
                == (case.scene, case.operator, case.tolerance, case.order)
        };
        let growth = |name: &str| match &above {
            Some((k, before)) if same(*k) => {
                let ratio = |name: &str| number(name) / before[name].as_f64().unwrap_or(f64::NAN);
                let per_node = if name == "entries" { 1.0 } else { 0.0 };
                format!("{:.2}", ratio(name).ln() / ratio("elements").ln() + per_node)
            }
            _ => String::new(),
        };
        println!(
            "| {} | {operator} | {} | {:.2} | {:.2} | {:.2} | {:.2} | {} | {:.0} | {:.0} | {:.1} | {:.1e} | {} | {} |",
            case.scene,
            number("elements"),
            number("cpu"),
            number("pairs"),
            number("far"),
            number("links"),
            number("products"),
            number("memory") / 1e6,
            number("bytes") / 1e6,
            number("entries"),
            number("error"),
            growth("cpu"),
            growth("entries"),
        );
        above = Some((index, value));
    }
    println!("\n| scene | elements | wall s, 1 thread | wall s, 2 threads | gain | same bits |");
    println!("|---|---|---|---|---|---|");
    for (index, case) in list.iter().enumerate() {
        let line = format!("{} {} {:.0e} threads", case.scene, case.operator, case.tolerance);
        let large = case.size == 7 || case.size == -100_000;
        if case.operator != "fast" || !large || !words.iter().all(|w| line.contains(w.as_str())) {
            continue;
        }
        let (one, two) = (run_apart(index, 1)?, run_apart(index, 2)?);
        println!(
            "| {} {:.0e} | {} | {:.2} | {:.2} | {:.2} | {} |",
            case.scene,
            case.tolerance,
            one["elements"],
            number(&one, "wall"),
            number(&two, "wall"),
            number(&one, "wall") / number(&two, "wall"),
            if one["hash"] == two["hash"] { "yes" } else { "NO" }
        );
    }
    Ok(())
}
