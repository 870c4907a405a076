//! Points to probe, read from a table, and the values found there, written as one.
//!
//! The format is comma-separated text with a header line. Reading takes the columns
//! `x,y,z,nx,ny,nz` in any order; further columns are ignored, blank lines and lines that begin
//! with `#` are skipped, spaces around a field, quotes around it and CRLF line ends are accepted.
//! A comma inside quotes is not: every line must have as many fields as the header, so that a
//! shifted column is an error and never a wrong number.

use std::fmt::Write;
use std::path::Path;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::output::atomic;

/// The columns that a table of points must have.
const COLUMNS: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

/// The header of the results.
const RESULT_HEADER: &str = "x,y,z,nx,ny,nz,irradiance_r,irradiance_g,irradiance_b,\
                             radiosity_r,radiosity_g,radiosity_b";

/// Where and in which direction to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Position, metres.
    pub position: DVec3,
    /// Unit normal of the measuring surface.
    pub normal: DVec3,
}

/// What was found at a point, channels R, G, B.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeResult {
    /// Irradiance on the side that the normal points to, W/m^2; none where time ran out before.
    pub irradiance: Option<DVec3>,
    /// Radiosity of the surface there, W/m^2; none where there is no surface.
    pub radiosity: Option<DVec3>,
}

/// Reads the points of a file.
pub fn read_points(path: &Path) -> Result<Vec<Point>> {
    let bytes = std::fs::read(path).map_err(|e| Error::unreadable(path, e))?;
    let text = String::from_utf8(bytes)
        .map_err(|_| Error::unreadable(path, "it is not UTF-8 text; save it as CSV in UTF-8"))?;
    parse_points(path, &text)
}

/// Reads the points of a text; `path` names it in errors.
pub fn parse_points(path: &Path, text: &str) -> Result<Vec<Point>> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let Some((number, header)) = lines.next() else {
        return Err(Error::invalid(
            path,
            "header",
            "the file is empty; its first line must be x,y,z,nx,ny,nz",
        ));
    };
    let names: Vec<&str> = header.split(',').map(field).collect();
    let columns = find_columns(&names).map_err(|e| Error::invalid(path, at(number), e))?;
    lines
        .map(|(number, line)| {
            let fields: Vec<&str> = line.split(',').map(field).collect();
            if fields.len() != names.len() {
                let reason =
                    format!("it has {} fields where the header has {}", fields.len(), names.len());
                return Err(Error::invalid(path, at(number), reason));
            }
            point(&fields, &columns).map_err(|e| Error::invalid(path, at(number), e))
        })
        .collect()
}

/// The results as a table, one line for each point, numbers with as many digits as it takes to
/// read the same f64 back. What is not there is empty.
pub fn format_results(points: &[Point], results: &[ProbeResult]) -> String {
    let mut table = String::with_capacity(RESULT_HEADER.len() + 1 + 200 * points.len());
    table.push_str(RESULT_HEADER);
    table.push('\n');
    for (point, result) in points.iter().zip(results) {
        let found = [Some(point.position), Some(point.normal), result.irradiance, result.radiosity];
        for (i, vector) in found.into_iter().enumerate() {
            let comma = if i == 0 { "" } else { "," };
            // `{:?}` is the shortest text that reads back, with an exponent where that is
            // shorter. Writing to a String cannot fail.
            let _ = match vector {
                Some(v) => write!(table, "{comma}{:?},{:?},{:?}", v.x, v.y, v.z),
                None => write!(table, "{comma},,"),
            };
        }
        table.push('\n');
    }
    table
}

/// Writes the results to a file, whole or not at all.
pub fn write_results(path: &Path, points: &[Point], results: &[ProbeResult]) -> Result<()> {
    atomic::write_whole(path, format_results(points, results).as_bytes())
}

fn at(line: usize) -> String {
    format!("line {line}")
}

/// A field without the spaces and quotes around it.
fn field(text: &str) -> &str {
    let text = text.trim();
    text.strip_prefix('"').and_then(|t| t.strip_suffix('"')).map_or(text, str::trim)
}

/// The places of x, y, z, nx, ny, nz in the header.
fn find_columns(names: &[&str]) -> std::result::Result<[usize; 6], String> {
    let mut columns = [0; 6];
    for (column, wanted) in columns.iter_mut().zip(COLUMNS) {
        let mut found = names.iter().enumerate().filter(|(_, name)| **name == wanted);
        *column = match (found.next(), found.next()) {
            (Some((place, _)), None) => place,
            (Some(_), Some(_)) => return Err(format!("column \"{wanted}\" occurs twice")),
            (None, _) => {
                return Err(format!(
                    "there is no column \"{wanted}\"; the header must name x,y,z,nx,ny,nz, \
                     separated by commas, and names {}",
                    names.join(",")
                ));
            }
        };
    }
    Ok(columns)
}

fn point(fields: &[&str], columns: &[usize; 6]) -> std::result::Result<Point, String> {
    let mut values = [0.0; 6];
    for ((value, &column), name) in values.iter_mut().zip(columns).zip(COLUMNS) {
        let text = fields.get(column).copied().unwrap_or_default();
        *value = match text.parse::<f64>() {
            Ok(v) if v.is_finite() => v,
            Ok(_) => return Err(format!("{name} is \"{text}\", which is not finite")),
            Err(_) => return Err(format!("{name} is \"{text}\", which is not a number")),
        };
    }
    let [x, y, z, nx, ny, nz] = values;
    let normal = unit(DVec3::new(nx, ny, nz)).ok_or("the normal nx,ny,nz is zero")?;
    Ok(Point { position: DVec3::new(x, y, z), normal })
}

/// The unit vector along `v`, whatever its size; `None` for zero. A vector that is a unit vector
/// to rounding is left as it is, so that it is written as it was read.
fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    if largest == 0.0 {
        return None;
    }
    if (v.length_squared() - 1.0).abs() <= 4.0 * f64::EPSILON {
        return Some(v);
    }
    // Division by the largest component first: squares neither overflow nor vanish.
    Some((v / largest).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Vec<Point>> {
        parse_points(Path::new("points.csv"), text)
    }

    fn message(text: &str) -> String {
        let failure = parse(text).unwrap_err();
        assert_eq!(failure.exit_code(), 3);
        failure.to_string()
    }

    #[test]
    fn a_plain_table_is_read() {
        let points = parse("x,y,z,nx,ny,nz\n1,2.5,-3e-2,0,0,1\n").unwrap();
        assert_eq!(points, [Point { position: DVec3::new(1.0, 2.5, -0.03), normal: DVec3::Z }]);
    }

    #[test]
    fn order_extra_columns_comments_blank_lines_and_line_ends_do_not_matter() {
        let text = "\u{feff}# by hand\r\n\r\nnz, id ,x,y,z,nx,\"ny\"\r\n\
                    1 ,lamp, 4,5,6 ,0,0\r\n  # more\r\n2,\"wall\",7,8,9,0,0";
        let points = parse(text).unwrap();
        assert_eq!(points.len(), 2);
        assert_eq!(points[0].position, DVec3::new(4.0, 5.0, 6.0));
        assert_eq!(points[1], Point { position: DVec3::new(7.0, 8.0, 9.0), normal: DVec3::Z });
    }

    #[test]
    fn normals_are_normalised_whatever_their_size_and_unit_ones_kept() {
        let points =
            parse("x,y,z,nx,ny,nz\n0,0,0,3e-200,4e-200,0\n0,0,0,0,1e200,1e200\n0,0,0,0.6,0.8,0")
                .unwrap();
        assert!((points[0].normal - DVec3::new(0.6, 0.8, 0.0)).length() < 1e-15);
        assert!((points[1].normal.length() - 1.0).abs() < 1e-15);
        assert_eq!(points[2].normal, DVec3::new(0.6, 0.8, 0.0));
    }

    #[test]
    fn errors_name_the_file_and_the_line() {
        let header = "x,y,z,nx,ny,nz\n";
        for (text, parts) in [
            ("", &["points.csv", "header", "empty"][..]),
            ("x,y,z\n1,2,3\n", &["line 1", "\"nx\""]),
            ("x;y;z;nx;ny;nz\n", &["line 1", "separated by commas"]),
            ("x,y,z,nx,ny,nz,x\n", &["line 1", "\"x\" occurs twice"]),
            (&format!("{header}\n1,2,3,0,0,one\n"), &["line 3", "nz", "\"one\""]),
            (&format!("{header}1,2,3,0,0,inf\n"), &["line 2", "not finite"]),
            (&format!("{header}1,NaN,3,0,0,1\n"), &["line 2", "y", "not finite"]),
            (&format!("{header}1,2,3,0,0\n"), &["line 2", "5 fields", "6"]),
            (&format!("{header}1,2,3,,0,1\n"), &["line 2", "nx", "\"\""]),
            (&format!("{header}1,2,3,0,-0,0\n"), &["line 2", "normal", "zero"]),
        ] {
            let message = message(text);
            assert!(parts.iter().all(|part| message.contains(part)), "{text:?}: {message}");
        }
    }

    #[test]
    fn a_header_alone_is_no_points() {
        assert_eq!(parse("x,y,z,nx,ny,nz").unwrap(), []);
    }

    #[test]
    fn results_read_back_to_the_same_bits_and_missing_radiosity_is_empty() {
        let third = 1.0 / 3.0;
        let points = [
            Point { position: DVec3::new(0.1, 1e300, -5e-324), normal: DVec3::Z },
            Point { position: DVec3::ZERO, normal: DVec3::new(0.6, 0.0, 0.8) },
        ];
        let results = [
            ProbeResult { irradiance: Some(DVec3::splat(third)), radiosity: None },
            ProbeResult {
                irradiance: Some(DVec3::ONE),
                radiosity: Some(DVec3::new(third, 2.0, 3e-9)),
            },
        ];
        let table = format_results(&points, &results);
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(lines[0], RESULT_HEADER);
        assert!(lines[1].ends_with(",,,"), "{}", lines[1]);
        assert_eq!(lines[0].matches(',').count(), lines[1].matches(',').count());
        let number = |line: usize, column: usize| {
            lines[line].split(',').nth(column).unwrap().parse::<f64>().unwrap()
        };
        assert_eq!(number(1, 6).to_bits(), third.to_bits());
        assert_eq!(number(1, 2).to_bits(), (-5e-324f64).to_bits());
        assert_eq!(number(2, 9).to_bits(), third.to_bits());
        // What was written can be read as points again.
        assert_eq!(parse(&table).unwrap(), points);
    }
}
