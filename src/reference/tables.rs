//! Running the experiments.

use std::time::Instant;

use rayon::prelude::*;

use super::manufactured::{RHO, Solution};
use super::printed::{self, ErrorTable};
use super::surface::Surface;
use crate::error::{Error, Result};
use crate::mesh::Basis;
use crate::monitor::Monitor;
use crate::operator::clustered::{ClusteredOperator, ClusteredOptions, FieldSizes, field_sizes};
use crate::output::machine::cpu_seconds;

/// Tables that there are.
pub const TABLES: [&str; 11] =
    ["6.1", "6.2", "6.3", "6.4", "6.5", "6.6", "6.7", "6.8", "6.9", "6.10", "6.11"];

/// Admissibility and order that stand for the exact operator in Table 6.8: the error of the
/// clustering is below 1e-3 of that of collocation there.
const AS_EXACT: (f64, usize) = (0.03125, 5);

/// What is computed.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceOptions {
    /// Numbers of tables, of [`TABLES`]; all when empty.
    pub tables: Vec<String>,
    /// Largest number of elements n.
    pub max_n: usize,
    /// Bytes that an operator may take.
    pub max_memory: u64,
}

/// One computed value beside what the paper prints.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Row {
    /// Number of the table.
    pub table: &'static str,
    /// Elements.
    pub n: usize,
    /// Admissibility, where it matters.
    pub eta: Option<f64>,
    /// Order m of the Taylor polynomials, where it matters.
    pub order: Option<usize>,
    /// sigma_G, sigma_N, sigma_F, max_error, ratio or seconds_per_iteration.
    pub quantity: &'static str,
    /// The paper's value, where it has one.
    pub printed: Option<f64>,
    /// Ours. Seconds are CPU seconds of all threads (wall seconds where the run is too short for
    /// the CPU clock, below half a second).
    pub computed: f64,
}

/// An error table with the solution that it is about.
type Errors = (&'static ErrorTable, Solution);

/// Runs the experiments, n by n and eta by eta, so that each operator is built once; hands each
/// row to `found` as soon as it is known, and returns all in the order of the tables.
pub fn run(
    options: &ReferenceOptions,
    monitor: &Monitor,
    found: &mut dyn FnMut(&Row),
) -> Result<Vec<Row>> {
    if let Some(wrong) = options.tables.iter().find(|t| !TABLES.contains(&t.as_str())) {
        return Err(Error::Usage(format!(
            "there is no table {wrong}; there are {}",
            TABLES.join(", ")
        )));
    }
    let wants =
        |table: &str| options.tables.is_empty() || options.tables.iter().any(|t| t == table);
    let mut rows: Vec<Row> = vec![];
    let mut say = |row: Row| {
        found(&row);
        rows.push(row);
    };
    let sizes: Vec<usize> =
        printed::SIZES.iter().copied().filter(|&n| n <= options.max_n.max(10)).collect();
    for (k, &n) in sizes.iter().enumerate() {
        let surface = Surface::of_size(Basis::Linear, n)?;
        let last = n == sizes[sizes.len() - 1];
        let mut emissivities: [Option<(Vec<f64>, Vec<f64>)>; 2] = [None, None];
        for (e, &eta) in printed::ETAS.iter().enumerate() {
            let tables: Vec<Errors> = printed::INDICATOR
                .iter()
                .map(|t| (t, Solution::Indicator))
                .chain(printed::KINKED.iter().map(|t| (t, Solution::PAPER)))
                .filter(|(t, _)| n >= 40 && t.eta == eta && wants(t.name))
                .collect();
            let by_eta = wants("6.7") && last;
            let exact = wants("6.8") && eta == AS_EXACT.0 && n >= 40;
            let field = printed::FIELD_ETAS.iter().position(|&f| f == eta);
            let count_gray = wants("6.1") && eta == 0.125;
            let count_fields = (wants("6.2") || wants("6.3")) && field.is_some();
            let mut fields: Option<FieldSizes> = None;
            if !tables.is_empty() || by_eta || exact {
                let clustering = ClusteredOptions::new(eta, 1)?;
                let operator = ClusteredOperator::build(
                    surface.stage(),
                    clustering,
                    options.max_memory,
                    monitor,
                )?;
                fields = Some(operator.sizes);
                // Tables share runs: 6.7 has those of 6.4 to 6.6, and 6.8 one of 6.11.
                let mut known: Vec<(Solution, usize, (f64, f64))> = vec![];
                let mut error_of = |solution: Solution, order: usize| -> Result<(f64, f64)> {
                    if let Some(run) = known.iter().find(|k| (k.0, k.1) == (solution, order)) {
                        return Ok(run.2);
                    }
                    let slot = &mut emissivities[usize::from(solution == Solution::PAPER)];
                    if slot.is_none() {
                        *slot = Some((solution.at_nodes(&surface), solution.emissivity(&surface)?));
                    }
                    let (u, emissivity) = slot.as_ref().expect("filled above");
                    let result = fixed_point(&operator, order, u, emissivity, monitor)?;
                    known.push((solution, order, result));
                    Ok(result)
                };
                for (table, solution) in &tables {
                    for (column, &order) in table.orders.iter().enumerate() {
                        let (error, seconds) = error_of(*solution, order)?;
                        let row = |quantity, printed, computed| Row {
                            table: table.name,
                            n,
                            eta: Some(eta),
                            order: Some(order),
                            quantity,
                            printed,
                            computed,
                        };
                        say(row("max_error", Some(table.errors[k - 1][column]), error));
                        let printed = table.seconds[k - 1][column];
                        if !printed.is_nan() {
                            say(row("seconds_per_iteration", Some(printed), seconds));
                        }
                    }
                }
                if by_eta {
                    for (column, order) in [2, 4].into_iter().enumerate() {
                        let (error, _) = error_of(Solution::Indicator, order)?;
                        let there = n == printed::SIZES[7];
                        say(Row {
                            table: "6.7",
                            n,
                            eta: Some(eta),
                            order: Some(order),
                            quantity: "max_error",
                            printed: there.then_some(printed::BY_ETA[e][column]),
                            computed: error,
                        });
                    }
                }
                if exact {
                    let (error, _) = error_of(Solution::PAPER, AS_EXACT.1)?;
                    say(Row {
                        table: "6.8",
                        n,
                        eta: None,
                        order: None,
                        quantity: "max_error",
                        printed: Some(printed::COLLOCATION[k - 1]),
                        computed: error,
                    });
                }
            }
            if count_gray || count_fields {
                let sizes = match fields {
                    Some(sizes) => sizes,
                    None => field_sizes(surface.stage(), eta, monitor)?,
                };
                let row = |table, eta, quantity, printed: u64, computed: u64| Row {
                    table,
                    n,
                    eta,
                    order: None,
                    quantity,
                    printed: Some(printed as f64),
                    computed: computed as f64,
                };
                if count_gray {
                    say(row("6.1", None, "sigma_G", printed::GRAY[k], sizes.gray));
                }
                if let Some(f) = field {
                    if wants("6.2") {
                        let printed = printed::NEAR[f][k];
                        say(row("6.2", Some(eta), "sigma_N", printed, sizes.near));
                    }
                    if wants("6.3") {
                        let printed = printed::FAR[f][k];
                        say(row("6.3", Some(eta), "sigma_F", printed, sizes.far));
                    }
                }
            }
        }
    }
    for row in ratios(&rows) {
        found(&row);
        rows.push(row);
    }
    let place = |row: &Row| TABLES.iter().position(|t| *t == row.table);
    rows.sort_by_key(place);
    Ok(rows)
}

/// Ratios of successive errors in Tables 6.7 and 6.8.
fn ratios(rows: &[Row]) -> Vec<Row> {
    let mut found = vec![];
    let errors = |table: &'static str, order: Option<usize>| {
        let matches =
            move |r: &&Row| r.table == table && r.order == order && r.quantity == "max_error";
        rows.iter().filter(matches).collect::<Vec<_>>()
    };
    for (table, order) in [("6.7", Some(2)), ("6.7", Some(4)), ("6.8", None)] {
        for (k, pair) in errors(table, order).windows(2).enumerate() {
            let printed = match (order, pair[1].printed) {
                (_, None) => None,
                (Some(order), _) => Some(printed::ETA_RATIOS[k][order / 2 - 1]),
                (None, _) => Some(printed::COLLOCATION_RATIOS[k]),
            };
            found.push(Row {
                quantity: "ratio",
                printed,
                computed: pair[0].computed / pair[1].computed,
                ..pair[1].clone()
            });
        }
    }
    found
}

/// Largest error at the nodes of the solution of (I - K~) u~ = E, and CPU seconds an iteration.
///
/// The iteration (2.11) starts from the known solution u, so that what it adds is the error itself,
/// and ends when another step would change the error by less than 1e-3 of it (or by roundings):
/// with rho = 0.1 each step takes the rest down by 10 or more.
fn fixed_point(
    operator: &ClusteredOperator,
    order: usize,
    u: &[f64],
    emissivity: &[f64],
    monitor: &Monitor,
) -> Result<(f64, f64)> {
    let mut now: Vec<[f64; 1]> = u.iter().map(|u| [*u]).collect();
    let mut product = vec![[0.0]; u.len()];
    let (begin, wall) = (cpu_seconds(), Instant::now());
    let mut steps = 0;
    const MOST_STEPS: u64 = 40;
    let stage = monitor.stage("iterate", MOST_STEPS);
    loop {
        operator.apply_channels(order, &now, &mut product);
        steps += 1;
        stage.advance(1)?;
        product.par_iter_mut().zip(emissivity).for_each(|(p, e)| {
            p[0] = e + RHO / std::f64::consts::PI * p[0];
        });
        let largest = |a: &[[f64; 1]], b: &dyn Fn(usize) -> f64| {
            a.iter().enumerate().map(|(i, x)| (x[0] - b(i)).abs()).fold(0.0, f64::max)
        };
        let change = largest(&product, &|i| now[i][0]);
        let error = largest(&product, &|i| u[i]);
        std::mem::swap(&mut now, &mut product);
        // Contraction by at least 0.1 / (1 - 0.1) from here on.
        if change / 9.0 <= 1e-3 * error || change <= 4.0 * f64::EPSILON || steps == MOST_STEPS {
            let seconds = match (begin, cpu_seconds()) {
                (Some(begin), Some(end)) if end - begin >= 0.5 => end - begin,
                _ => wall.elapsed().as_secs_f64(),
            };
            return Ok((error, seconds / steps as f64));
        }
    }
}
