//! `lumel probe` as a user runs it: values at points, in full precision.

mod command_support;

use std::fs;
use std::path::Path;

use command_support::*;

/// The cells below the header.
fn rows(text: &str) -> Vec<Vec<&str>> {
    let mut lines = text.lines();
    assert_eq!(
        lines.next().unwrap(),
        "x,y,z,nx,ny,nz,irradiance_r,irradiance_g,irradiance_b,\
         radiosity_r,radiosity_g,radiosity_b"
    );
    lines.map(|line| line.split(',').collect()).collect()
}

fn write_points(directory: &Path, points: &[[f64; 6]]) {
    let mut text = "x,y,z,nx,ny,nz\n".to_string();
    for p in points {
        text += &p.map(|v| v.to_string()).join(",");
        text += "\n";
    }
    fs::write(directory.join("points.csv"), text).unwrap();
}

#[test]
fn a_furnace_has_one_value_everywhere() {
    let room = tempfile::tempdir().unwrap();
    // On four walls, one of them near an edge, and inside, where there is no surface.
    let on = [
        [0.3, 0.0, 0.2, 0.0, 1.0, 0.0],
        [0.0, 0.7, 0.1, 1.0, 0.0, 0.0],
        [0.5, 0.5, 0.75, 0.0, 0.0, -1.0],
        [1.0 - 1e-4, 1.5, 0.3, 0.0, -1.0, 0.0],
    ];
    let off = [[0.5, 0.5, 0.3, 0.0, 0.0, 1.0], [0.1, 1.2, 0.7, 0.6, 0.0, 0.8]];
    write_points(room.path(), &[&on[..], &off[..]].concat());
    // What each operator promises; the default is that of the fast one.
    for (operator, tolerance) in
        [("", 1e-4), ("--operator-tolerance 1e-9", 1e-9), ("--operator exact", 1e-12)]
    {
        let command = format!("probe scenes/furnace.gltf --points points.csv {operator}");
        let output = succeeds(room.path(), &format!("{command} --residual 1e-13"));
        assert_eq!(stderr(&output), "");
        let text = stdout(&output);
        let rows = rows(&text);
        assert_eq!(rows.len(), 6);
        for (k, row) in rows.iter().enumerate() {
            assert_eq!(row.len(), 12);
            let is_two = |cell: &str| (cell.parse::<f64>().unwrap() - 2.0).abs() < 2.0 * tolerance;
            assert!(row[6..9].iter().all(|cell| is_two(cell)), "irradiance: {row:?}");
            if k < on.len() {
                assert!(row[9..].iter().all(|cell| is_two(cell)), "radiosity: {row:?}");
            } else {
                assert_eq!(row[9..], ["", "", ""], "there is no surface: {row:?}");
            }
        }
    }
}

#[test]
fn the_number_of_threads_changes_no_byte_and_the_file_is_what_is_printed() {
    let room = tempfile::tempdir().unwrap();
    let points: Vec<[f64; 6]> =
        (0..50).map(|k| [0.011 * f64::from(k), 0.0, 0.27, 0.0, 1.0, 0.0]).collect();
    write_points(room.path(), &points);
    let words = "probe scenes/cornell.gltf --points points.csv --subdivide 1";
    let tables = ["1", "2", "3"].map(|threads| {
        succeeds(room.path(), &format!("{words} -o {threads}.csv --threads {threads}"));
        fs::read_to_string(room.path().join(format!("{threads}.csv"))).unwrap()
    });
    assert!(tables[0] == tables[1] && tables[0] == tables[2]);
    assert_eq!(stdout(&succeeds(room.path(), words)), tables[0]);
    assert_eq!(rows(&tables[0]).len(), points.len());
    // The light is seen from the middle of the floor, and not from under a block.
    let red = |k: usize| rows(&tables[0])[k][6].parse::<f64>().unwrap();
    assert!(red(25) > 0.5, "{}", red(25));
}

#[test]
fn the_report_counts_the_points() {
    let room = tempfile::tempdir().unwrap();
    write_points(room.path(), &[[0.3, 0.0, 0.2, 0.0, 1.0, 0.0]]);
    let words = "probe scenes/furnace.gltf --points points.csv -o out.csv --report r.json";
    succeeds(room.path(), words);
    let report = json(&room.path().join("r.json"));
    assert_eq!((&report["command"], &report["counts"]["points"]), (&"probe".into(), &1.into()));
    assert_eq!(report["stages"][2]["name"], "probe");
}

#[test]
fn darkness_is_said_and_measured() {
    let room = tempfile::tempdir().unwrap();
    write_points(room.path(), &[[0.3, 0.0, 0.2, 0.0, 1.0, 0.0]]);
    let words = "probe scenes/furnace.gltf --points points.csv --light-scale 0";
    let output = succeeds(room.path(), words);
    assert!(stderr(&output).contains("--light-scale 0"), "{}", stderr(&output));
    assert_eq!(rows(&stdout(&output))[0][6..], ["0.0"; 6]);
}
