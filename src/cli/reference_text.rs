//! The paper's tables as text: printed and computed side by side.

use lumel::reference::{Row, fit::exponent};
use lumel::{Error, Result};

/// One row as a line of JSON.
pub fn json_line(row: &Row) -> Result<String> {
    let line = serde_json::to_string(row);
    Ok(line.map_err(|e| Error::Runtime(format!("no JSON can be made: {e}")))? + "\n")
}

/// All rows, table by table, and the growth exponents of the times.
pub fn tables(rows: &[Row]) -> String {
    let mut text = String::new();
    let mut table = "";
    for row in rows {
        if row.table != table {
            table = row.table;
            text.push_str(&format!("\nTable {table}{}\n", remark(table)));
            let head = ["n", "eta", "order", "quantity", "printed", "computed", "ratio"];
            text.push_str(&line(head.map(String::from)));
        }
        let or_dash = |value: Option<String>| value.unwrap_or_else(|| "-".into());
        text.push_str(&line([
            row.n.to_string(),
            or_dash(row.eta.map(|eta| eta.to_string())),
            or_dash(row.order.map(|order| order.to_string())),
            row.quantity.into(),
            or_dash(row.printed.map(|p| number(row, p))),
            number(row, row.computed),
            or_dash(row.printed.map(|p| format!("{:.3}", row.computed / p))),
        ]));
    }
    text.push_str(&growth(rows));
    text
}

fn line(cells: [String; 7]) -> String {
    let [n, eta, order, quantity, printed, computed, ratio] = cells;
    format!("{n:>8} {eta:>8} {order:>6}  {quantity:<21} {printed:>10} {computed:>10} {ratio:>8}\n")
}

fn number(row: &Row, value: f64) -> String {
    match row.quantity {
        "sigma_G" | "sigma_N" | "sigma_F" => format!("{value:.0}"),
        "ratio" => format!("{value:.2}"),
        "seconds_per_iteration" => format!("{value:.4}"),
        _ => format!("{value:.3e}"),
    }
}

fn remark(table: &str) -> &'static str {
    match table {
        "6.1" => ": largest gray field of a node",
        "6.2" => ": largest near field of a node",
        "6.3" => ": largest far field of a node",
        "6.4" | "6.5" | "6.6" => ": solution (6.8), error of clustering alone",
        "6.7" => ": the same for the largest n, by eta (printed for n = 163840)",
        "6.8" => ": solution (5.2), error of linear collocation",
        "6.11" => ": solution (5.2) (labelled eta = .0625 in print; its data are of .03125)",
        _ => ": solution (5.2)",
    }
}

/// Exponents of (6.12), T ~ eta^-p at the largest n, and of (6.13), T ~ n^q at eta = .03125.
fn growth(rows: &[Row]) -> String {
    let times = |order: usize| {
        rows.iter().filter(move |r| {
            r.quantity == "seconds_per_iteration" && r.order == Some(order) && r.computed > 0.0
        })
    };
    let mut text = String::new();
    for order in [1, 3, 5] {
        let largest = times(order).map(|r| r.n).max().unwrap_or(0);
        let by_eta: Vec<(f64, f64)> = times(order)
            .filter(|r| r.n == largest)
            .filter_map(|r| Some((r.eta?, r.computed)))
            .collect();
        if let Some(p) = exponent(&by_eta) {
            text.push_str(&format!(
                "(6.12) order {order}, n = {largest}: T ~ eta^-{:.2} (the paper: 1.88)\n",
                -p
            ));
        }
        let by_n: Vec<(f64, f64)> = times(order)
            .filter(|r| r.eta == Some(0.03125) && r.n >= 640)
            .map(|r| (r.n as f64, r.computed))
            .collect();
        if let Some(q) = exponent(&by_n) {
            text.push_str(&format!(
                "(6.13) order {order}, eta = .03125, n >= 640: T ~ n^{q:.2} (the paper: 1.19)\n"
            ));
        }
    }
    if text.is_empty() { text } else { format!("\nGrowth of the time of an iteration\n{text}") }
}
