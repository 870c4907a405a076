//! The paper's Tables 6.1 to 6.11, up to n = 2560.

use lumel::monitor::Monitor;
use lumel::reference::{ReferenceOptions, Row, run};

#[test]
fn tables_up_to_2560() {
    let options = ReferenceOptions { tables: vec![], max_n: 2560, max_memory: 4 << 30 };
    let rows = run(&options, &Monitor::silent(), &mut |_| {}).unwrap();
    let mut checked = 0;
    for row in &rows {
        let Row { table, n, order, printed, computed, .. } = *row;
        let Some(printed) = printed else { continue };
        let ok = match row.quantity {
            "sigma_G" | "sigma_N" | "sigma_F" => computed == printed,
            "max_error" if printed < 1e-14 => computed < 1e-14,
            "max_error" => match (table, order) {
                // The paper's runs of 6.9 and 6.10 carry an extra error that no order removes, of
                // 4e-6 to 1.1e-5 at eta = 0.125 (its order 5 against the exact 6.8). At n = 640 it
                // does not go along with the error of order 1: 1.02e-4 against 9.79e-5.
                ("6.10", Some(1)) if n == 640 => (computed - printed).abs() < 1.1e-5,
                ("6.9" | "6.10", Some(3)) => (computed / printed - 1.0).abs() < 0.1,
                ("6.9" | "6.10", Some(5)) => computed <= printed * 1.005,
                _ => (computed / printed - 1.0).abs() < 0.01,
            },
            "ratio" => (computed / printed - 1.0).abs() < 0.02,
            _ => continue,
        };
        assert!(ok, "{row:?} at n = {n}");
        checked += 1;
    }
    // 5 sizes of 7 counts, 4 sizes of 9 + 9 + 1 errors, 3 ratios.
    assert_eq!(checked, 35 + 76 + 3);
}
