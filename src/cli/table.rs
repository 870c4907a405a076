//! Text in aligned columns, and numbers as people read them.

use std::fmt::Write;

/// Rows of cells below a row of headings.
pub struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    pub fn new(headings: &[&str]) -> Table {
        Table { rows: vec![headings.iter().map(|h| h.to_string()).collect()] }
    }

    /// Adds a row; it should have as many cells as there are headings.
    pub fn row(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }

    /// The table with two spaces before each row and between columns. A column whose cells below
    /// the heading are all single numbers is set to the right.
    pub fn to_text(&self) -> String {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let cells = |column: usize| self.rows.iter().filter_map(move |row| row.get(column));
        let width = |cell: &String| cell.chars().count();
        let is_number = |cell: &String| cell.parse::<f64>().is_ok();
        let layout: Vec<(usize, bool)> = (0..columns)
            .map(|column| {
                let right = self.rows.len() > 1 && cells(column).skip(1).all(is_number);
                (cells(column).map(width).max().unwrap_or(0), right)
            })
            .collect();
        let mut text = String::new();
        for row in &self.rows {
            let mut line = String::new();
            for (cell, &(width, right)) in row.iter().zip(&layout) {
                // Writing to a String cannot fail.
                let _ = if right {
                    write!(line, "  {cell:>width$}")
                } else {
                    write!(line, "  {cell:<width$}")
                };
            }
            text.push_str(line.trim_end());
            text.push('\n');
        }
        text
    }
}

/// A number with four significant figures and no zeros at the end; with an exponent below 0.001
/// and from a million.
pub fn figure(v: f64) -> String {
    if v == 0.0 {
        return "0".into();
    }
    let size = v.abs();
    if !(1e-3..1e6).contains(&size) {
        return format!("{v:.3e}");
    }
    let decimals = (3 - size.log10().floor() as i32).max(0) as usize;
    let text = format!("{v:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// Numbers with spaces between them.
pub fn figures(values: &[f64]) -> String {
    values.iter().map(|&v| figure(v)).collect::<Vec<_>>().join(" ")
}

/// Bytes with a binary unit.
pub fn bytes(count: u64) -> String {
    let mut amount = count as f64;
    for unit in ["B", "KiB", "MiB"] {
        if amount < 1024.0 {
            return format!("{} {unit}", figure(amount));
        }
        amount /= 1024.0;
    }
    format!("{} GiB", figure(amount))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_four_places() {
        for (v, text) in [
            (0.0, "0"),
            (1.0, "1"),
            (-0.125, "-0.125"),
            (1.0 / 3.0, "0.3333"),
            (12345.6, "12346"),
            (1200.0, "1200"),
            (0.001, "0.001"),
            (2.5e-7, "2.500e-7"),
            (3e8, "3.000e8"),
            (39.597_8, "39.6"),
        ] {
            assert_eq!(figure(v), text);
        }
        assert_eq!(figures(&[1.0, 0.5]), "1 0.5");
        assert_eq!(bytes(3 << 29), "1.5 GiB");
        assert_eq!(bytes(512), "512 B");
    }

    #[test]
    fn columns_of_numbers_are_set_to_the_right() {
        let mut table = Table::new(&["name", "faces"]);
        table.row(vec!["Wände".into(), "5".into()]);
        table.row(vec!["x".into(), "1234567".into()]);
        assert_eq!(table.to_text(), "  name     faces\n  Wände        5\n  x      1234567\n");
        assert_eq!(Table::new(&["a"]).to_text(), "  a\n");
    }
}
