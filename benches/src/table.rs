//! Tables for people, and the same numbers as CSV for plots.

use std::fmt::Write as _;
use std::path::Path;

/// Columns of a line of a text (`tests/tests/floors.rs` holds all of docs to it).
const TEXT_WIDTH: usize = 120;

/// One value of a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A word.
    Text(String),
    /// A number; NaN is shown as "-" and left empty in CSV.
    Number(f64),
}

impl From<&str> for Cell {
    fn from(s: &str) -> Self {
        Self::Text(s.into())
    }
}
impl From<String> for Cell {
    fn from(s: String) -> Self {
        Self::Text(s)
    }
}
impl From<f64> for Cell {
    fn from(x: f64) -> Self {
        Self::Number(x)
    }
}
impl From<usize> for Cell {
    fn from(n: usize) -> Self {
        Self::Number(n as f64)
    }
}
impl From<u64> for Cell {
    fn from(n: u64) -> Self {
        Self::Number(n as f64)
    }
}

/// A number to three significant digits, or all of a count.
pub fn shown(x: f64) -> String {
    match x.abs() {
        a if a.is_nan() => "-".into(),
        0.0 => "0".into(),
        a if x.fract() == 0.0 && a < 1e9 => format!("{x:.0}"),
        a if !(1e-3..1e7).contains(&a) => format!("{x:.1e}"),
        a => {
            let digits = (2 - a.log10().floor() as i32).max(0) as usize;
            format!("{x:.digits$}")
        }
    }
}

/// Text for HTML and SVG.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

impl Cell {
    fn shown(&self) -> String {
        match self {
            Cell::Text(s) => s.clone(),
            Cell::Number(x) => shown(*x),
        }
    }

    fn csv(&self) -> String {
        match self {
            Cell::Text(s) if s.contains([',', '"', '\n']) => format!("\"{}\"", s.replace('"', "\"\"")),
            Cell::Text(s) => s.clone(),
            Cell::Number(x) if x.is_nan() => String::new(),
            Cell::Number(x) => format!("{x}"),
        }
    }
}

/// A row of cells from values of different types.
#[macro_export]
macro_rules! row {
    ($($value:expr),+ $(,)?) => { vec![$($crate::table::Cell::from($value)),+] };
}

/// A table with named columns.
#[derive(Clone, Debug)]
pub struct Table {
    columns: Vec<&'static str>,
    rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table without rows.
    pub fn new(columns: &[&'static str]) -> Self {
        Self { columns: columns.to_vec(), rows: Vec::new() }
    }

    /// Adds a row.
    pub fn push(&mut self, row: Vec<Cell>) {
        assert_eq!(row.len(), self.columns.len(), "a row has as many cells as the table has columns");
        self.rows.push(row);
    }

    /// As text: words to the left, numbers to the right.
    pub fn text(&self) -> String {
        let shown: Vec<Vec<String>> = self.rows.iter().map(|r| r.iter().map(Cell::shown).collect()).collect();
        let width = |k: usize| shown.iter().map(|r| r[k].chars().count()).chain([self.columns[k].len()]).max();
        let widths: Vec<usize> = (0..self.columns.len()).map(|k| width(k).unwrap_or(0)).collect();
        let is_text = |k: usize| self.rows.iter().any(|r| matches!(r[k], Cell::Text(_)));
        let mut out = String::new();
        let mut line = |cells: &[&str]| {
            let mut text = String::new();
            for (k, cell) in cells.iter().enumerate() {
                let w = widths[k];
                let _ = if is_text(k) { write!(text, "{cell:<w$}  ") } else { write!(text, "{cell:>w$}  ") };
            }
            out.push_str(text.trim_end());
            out.push('\n');
        };
        line(&self.columns);
        for row in &shown {
            line(&row.iter().map(String::as_str).collect::<Vec<_>>());
        }
        out
    }

    /// As CSV, all digits.
    pub fn csv(&self) -> String {
        let mut out = self.columns.join(",") + "\n";
        for row in &self.rows {
            out += &(row.iter().map(Cell::csv).collect::<Vec<_>>().join(",") + "\n");
        }
        out
    }

    /// The rows.
    pub fn rows(&self) -> &[Vec<Cell>] {
        &self.rows
    }

    /// The table with the rows that are chosen.
    pub fn chosen(&self, is_chosen: impl Fn(&[Cell]) -> bool) -> Self {
        Self { columns: self.columns.clone(), rows: self.rows.iter().filter(|r| is_chosen(r)).cloned().collect() }
    }

    /// As Markdown, of lines that are no longer than a text's: a table that is wider becomes several, one below the other,
    /// each of which begins with the columns that tell the rows apart.
    pub fn markdown(&self) -> String {
        let shown = self.rows.iter().map(|r| r.iter().map(Cell::shown).collect());
        let lines: Vec<Vec<String>> =
            std::iter::once(self.columns.iter().map(|c| c.replace('_', " ")).collect()).chain(shown).collect();
        let keys = self.keys();
        let mut parts: Vec<Vec<usize>> = Vec::new();
        for k in keys..self.columns.len() {
            let width = |columns: &[usize]| {
                let of = |line: &Vec<String>| columns.iter().map(|c| line[*c].chars().count() + 3).sum::<usize>() + 1;
                lines.iter().map(of).max().unwrap_or(0)
            };
            match parts.last_mut() {
                Some(last) if width(&[&last[..], &[k]].concat()) <= TEXT_WIDTH => last.push(k),
                _ => parts.push((0..keys).chain([k]).collect()),
            }
        }
        let mut out = String::new();
        for (i, columns) in parts.iter().enumerate() {
            for (row, line) in lines.iter().enumerate() {
                let cells: Vec<&str> = columns.iter().map(|c| line[*c].as_str()).collect();
                out += if row == 0 && i > 0 { "\n" } else { "" };
                out += &format!("| {} |\n", cells.join(" | "));
                if row == 0 {
                    out += &format!("|{}\n", "---|".repeat(columns.len()));
                }
            }
        }
        out
    }

    /// The least number of leading columns, one at least, by which no two rows are alike; all but the last where there is none.
    fn keys(&self) -> usize {
        let differ = |k: &usize| {
            let mut seen: Vec<String> = self.rows.iter().map(|r| format!("{:?}", &r[..*k])).collect();
            seen.sort();
            seen.windows(2).all(|w| w[0] != w[1])
        };
        let most = self.columns.len().saturating_sub(1);
        (1..most).find(differ).unwrap_or(most)
    }

    /// As HTML; all digits of a number in its tool tip.
    pub fn html(&self) -> String {
        let mut out = String::from("<table><thead><tr>");
        self.columns.iter().for_each(|c| out += &format!("<th>{}</th>", escaped(&c.replace('_', " "))));
        out += "</tr></thead><tbody>\n";
        for row in &self.rows {
            out += "<tr>";
            for cell in row {
                out += &match cell {
                    Cell::Text(s) => format!("<td class=\"word\">{}</td>", escaped(s)),
                    Cell::Number(x) if x.is_nan() => "<td>-</td>".into(),
                    Cell::Number(x) => format!("<td title=\"{x}\">{}</td>", shown(*x)),
                };
            }
            out += "</tr>\n";
        }
        out + "</tbody></table>\n"
    }

    /// Prints the table and writes `NAME.csv` into a folder.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn publish(&self, name: &str, folder: &Path) -> std::io::Result<()> {
        print!("{}", self.text());
        self.write(name, folder)
    }

    /// Writes `NAME.csv` into a folder.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn write(&self, name: &str, folder: &Path) -> std::io::Result<()> {
        std::fs::create_dir_all(folder)?;
        let path = folder.join(name).with_extension("csv");
        std::fs::write(&path, self.csv())?;
        println!("written: {}", path.display());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_lines_up_and_its_csv_keeps_all_digits() {
        let mut t = Table::new(&["case", "us", "cells"]);
        t.push(row!["a, b", 0.123456, 7usize]);
        t.push(row!["c", f64::NAN, 1234u64]);
        assert_eq!(t.text(), "case     us  cells\na, b  0.123      7\nc         -   1234\n");
        assert_eq!(t.markdown(), "| case | us | cells |\n|---|---|---|\n| a, b | 0.123 | 7 |\n| c | - | 1234 |\n");
        assert!(t.html().contains("<td title=\"0.123456\">0.123</td>") && t.html().contains("<td>-</td>"));
        assert_eq!(t.csv(), "case,us,cells\n\"a, b\",0.123456,7\nc,,1234\n");
    }

    #[test]
    fn a_wide_table_becomes_several_that_begin_with_what_tells_the_rows_apart() {
        let names =
            ["class", "rung", "a_count_of_things_with_a_long_name", "another_long_name_of_a_count", "and_one_more"];
        let mut t = Table::new(&[&names[..], &["the_last_count_that_finds_no_room"]].concat());
        t.push(row!["peg", "hit", 1.0, 2.0, 3.0, 4.0]);
        t.push(row!["peg", "time", 5.0, 6.0, 7.0, 8.0]);
        let text = t.markdown();
        assert!(text.lines().all(|l| l.chars().count() <= TEXT_WIDTH), "{text}");
        assert!(
            text.contains("| peg | time | 5 | 6 | 7 |\n\n| class | rung | the last count that finds no room |\n"),
            "{text}"
        );
        assert!(text.ends_with("|---|---|---|\n| peg | hit | 4 |\n| peg | time | 8 |\n"), "{text}");
    }
}
