//! The table as text for people, as Markdown and as CSV.

use super::Spread;
use super::table2::{Row, Table2};
use super::wrapped::wrapped;
use std::fmt::Write as _;

/// Headings of the columns: of the group, and of the column.
const COLUMNS: [(&str, &str); 11] = [
    ("", "method"),
    ("length, m", "ours"),
    ("", "paper"),
    ("roughness, 1/m^5", "ours"),
    ("", "paper"),
    ("", "at 0.5 m"),
    ("curvature, 1/m", "max"),
    ("", "jump"),
    ("wall time", "ours"),
    ("", "paper"),
    ("", "found"),
];

/// Columns of a terminal.
const WIDTH: usize = 80;

/// The columns of each of the two tables that a terminal gets: side by side they would not fit.
const TABLES: [[usize; 6]; 2] = [[0, 1, 2, 8, 9, 10], [0, 3, 4, 5, 6, 7]];

const NOTES: [&str; 3] = [
    "Means over the runs that found a path; curvature is the largest of all runs, and a polyline has none.",
    "Roughness is J/L² with J = ∫(dσ/ds)² ds: \"ours\" on curves exactly and on a polyline's own vertices, \"at 0.5 m\" \
     for every path resampled at that step, which is the fair comparison.",
    "One row \"LP\" of the paper stands beside both readings of it, Laplace potential and linear programme.",
];

/// About the built-in field.
const RECONSTRUCTION: &str = "The field is a reconstruction: the paper shows its own only as a picture. Lengths on it compare methods with each other; \
     beside the paper's they show the order, not the metre.";

impl Table2 {
    /// Aligned columns for a terminal, in two tables of 80 columns at most. `is_reconstruction` adds what the built-in field is.
    #[must_use]
    pub fn to_text(&self, is_reconstruction: bool) -> String {
        let rows: Vec<Vec<String>> = self.rows.iter().map(cells).collect();
        let mut text = String::new();
        for columns in TABLES {
            text.push_str(&aligned(&rows, &columns));
            text.push('\n');
        }
        for note in self.notes(is_reconstruction) {
            text.push_str(&wrapped(&note, WIDTH));
        }
        text
    }

    /// The cells of every row as text for people: name; length, the paper's; roughness, the paper's, at 0.5 m; largest curvature, jump; time, the
    /// paper's; how many found a path. `-` where something does not apply.
    #[must_use]
    pub fn cells(&self) -> Vec<Vec<String>> {
        self.rows.iter().map(cells).collect()
    }

    /// A table in Markdown.
    #[must_use]
    pub fn to_markdown(&self, is_reconstruction: bool) -> String {
        let mut text = String::from(
            "| method | length, m | paper | roughness, 1/m⁵ | paper | roughness at 0.5 m | max curvature, 1/m | jump, 1/m | time | paper | found |\n\
             |---|---|---|---|---|---|---|---|---|---|---|\n",
        );
        for row in &self.rows {
            let mut cells = cells(row);
            cells[0] = format!("`{}`", cells[0]);
            let _ = writeln!(text, "| {} |", cells.join(" | "));
        }
        text.push('\n');
        for note in self.notes(is_reconstruction) {
            let _ = writeln!(text, "{note}\n");
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
        text
    }

    /// One line per row, with units in the header; empty where something does not apply.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = String::from("method,curvature_limited,deterministic,runs,found");
        for name in [
            "time_s",
            "length_m",
            "roughness_per_m5",
            "roughness_fixed_step_per_m5",
            "goal_gap_m",
        ] {
            for part in ["mean", "median", "p05", "p95"] {
                let _ = write!(text, ",{name}_{part}");
            }
        }
        text.push_str(
            ",max_curvature_per_m,curvature_jump_per_m,paper_time_s,paper_length_m,paper_roughness\n",
        );
        for row in &self.rows {
            let _ = write!(
                text,
                "{},{},{},{},{}",
                row.method, row.curvature_limited, row.deterministic, row.runs, row.found
            );
            let mut put = |value: Option<f64>| {
                text.push(',');
                if let Some(value) = value {
                    let _ = write!(text, "{value:?}");
                }
            };
            for spread in [
                row.time_s,
                row.length_m,
                row.roughness,
                row.roughness_fixed_step,
                row.goal_gap_m,
            ] {
                put(spread.map(|s| s.mean));
                put(spread.map(|s| s.median));
                put(spread.map(|s| s.p05));
                put(spread.map(|s| s.p95));
            }
            put(row.max_curvature_per_m);
            put(row.curvature_jump_per_m);
            put(row.paper.and_then(|paper| paper.time_s));
            put(row.paper.map(|paper| paper.length_m));
            put(row.paper.map(|paper| paper.roughness));
            text.push('\n');
        }
        text
    }

    /// What has to be said below the table, a sentence or two each.
    #[must_use]
    pub fn notes(&self, is_reconstruction: bool) -> Vec<String> {
        let mut notes = Vec::new();
        if self.interrupted {
            notes.push("Interrupted: these are the runs made until then.".to_owned());
        }
        notes.extend(NOTES.map(str::to_owned));
        let gap = |row: &&Row| row.goal_gap_m.is_some_and(|gap| gap.mean > 1e-3);
        let short: Vec<_> = self.rows.iter().filter(gap).map(|row| row.method).collect();
        if !short.is_empty() {
            notes.push(format!(
                "In the goal's ball, up to its radius short of the goal itself, ends: {}.",
                short.join(", ")
            ));
        }
        let alone = |row: &&Row| row.deterministic;
        let alone: Vec<_> = self
            .rows
            .iter()
            .filter(alone)
            .map(|row| row.method)
            .collect();
        if !alone.is_empty() && self.runs > 1 {
            notes.push(format!(
                "Without chance, hence run once for all {}: {}.",
                self.runs,
                alone.join(", ")
            ));
        }
        if is_reconstruction {
            notes.push(RECONSTRUCTION.to_owned());
        }
        notes
    }
}

/// Some columns of the rows under their headings, aligned.
fn aligned(rows: &[Vec<String>], columns: &[usize]) -> String {
    let headings = |c: usize| COLUMNS[columns[c]];
    let mut widths: Vec<usize> = columns
        .iter()
        .map(|c| {
            let longest = rows.iter().map(|row| width(&row[*c])).max().unwrap_or(0);
            longest.max(width(COLUMNS[*c].1))
        })
        .collect();
    // A group is as wide as its heading; what stands alone is a group of its own.
    let is_first = |c: usize| !headings(c).0.is_empty() || COLUMNS[columns[c]].1 == "found";
    let begins = (0..columns.len()).filter(|c| is_first(*c));
    let begins: Vec<usize> = begins.chain([columns.len()]).collect();
    for group in begins.windows(2) {
        let own: usize = widths[group[0]..group[1]].iter().map(|w| w + 2).sum();
        widths[group[0]] += width(headings(group[0]).0).saturating_sub(own - 2);
    }
    let mut text = String::new();
    // A group's heading stands over its columns.
    let mut line = String::new();
    for c in 0..columns.len() {
        let (group, _) = headings(c);
        let begin: usize = widths[..c].iter().map(|w| w + 2).sum();
        if !group.is_empty() {
            let gap = begin.saturating_sub(width(&line));
            let _ = write!(line, "{:gap$}{group}", "");
        }
    }
    text.push_str(line.trim_end());
    text.push('\n');
    let mut put = |cell: &dyn Fn(usize) -> String| {
        let mut line = String::new();
        for (c, column) in columns.iter().enumerate() {
            let cell = cell(*column);
            let gap = widths[c] - width(&cell);
            let _ = if c == 0 {
                write!(line, "{cell}{:gap$}", "")
            } else {
                write!(line, "  {:gap$}{cell}", "")
            };
        }
        text.push_str(line.trim_end());
        text.push('\n');
    };
    put(&|column| COLUMNS[column].1.to_owned());
    for row in rows {
        put(&|column| row[column].clone());
    }
    text
}

fn cells(row: &Row) -> Vec<String> {
    let none = || "-".to_owned();
    let mean = |spread: Option<Spread>, show: &dyn Fn(f64) -> String| {
        spread.map_or_else(none, |spread| show(spread.mean))
    };
    let metres = |value: f64| format!("{value:.1}");
    let rough = |value: f64| format!("{value:.1e}");
    let curvature = |value: f64| {
        if value < 5e-4 {
            "0".to_owned()
        } else {
            format!("{value:.2}")
        }
    };
    let paper = row.paper;
    vec![
        row.method.to_owned(),
        mean(row.length_m, &metres),
        paper.map_or_else(none, |p| metres(p.length_m)),
        mean(row.roughness, &rough),
        paper.map_or_else(none, |p| rough(p.roughness)),
        mean(row.roughness_fixed_step, &rough),
        row.max_curvature_per_m.map_or_else(none, curvature),
        row.curvature_jump_per_m.map_or_else(none, curvature),
        mean(row.time_s, &seconds),
        paper.and_then(|p| p.time_s).map_or_else(none, seconds),
        format!("{}/{}", row.found, row.runs),
    ]
}

/// A time with two or three digits and a unit.
fn seconds(value: f64) -> String {
    let (value, unit) = if value < 1e-3 {
        (value * 1e6, "µs")
    } else if value < 1.0 {
        (value * 1e3, "ms")
    } else {
        (value, "s")
    };
    let digits = match value {
        v if v < 10.0 => 2,
        v if v < 100.0 => 1,
        _ => 0,
    };
    format!("{value:.digits$} {unit}")
}

fn width(text: &str) -> usize {
    text.chars().count()
}

#[cfg(test)]
mod tests {
    use super::super::table2::PaperFigures;
    use super::*;

    fn table() -> Table2 {
        let spread = |mean| Spread::of([mean]);
        let row = |method, deterministic, curvature| Row {
            method,
            curvature_limited: curvature,
            deterministic,
            runs: 20,
            found: 20,
            time_s: spread(0.0123),
            length_m: spread(188.04),
            roughness: spread(6.1e-7),
            roughness_fixed_step: spread(7.2e-7),
            max_curvature_per_m: curvature.then_some(0.21),
            curvature_jump_per_m: curvature.then_some(1e-12),
            goal_gap_m: spread(if curvature { 2.5 } else { 0.0 }),
            paper: Some(PaperFigures {
                time_s: None,
                length_m: 198.1,
                roughness: 7.61e-4,
            }),
        };
        Table2 {
            rows: vec![row("laplace", true, false), row("paper", false, true)],
            runs: 20,
            seed: 1,
            interrupted: false,
        }
    }

    #[test]
    fn columns_are_aligned_and_no_line_is_too_long() {
        let text = table().to_text(true);
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[2].starts_with("laplace"));
        // Right-aligned numbers end in the same column.
        assert_eq!(width(lines[2]), width(lines[3]));
        assert_eq!(width(lines[1]), width(lines[2]));
        assert!(lines[7].starts_with("laplace") && width(lines[7]) == width(lines[8]));
        assert!(lines.iter().all(|line| width(line) <= WIDTH), "{text}");
        assert!(
            text.contains("reconstruction") && !table().to_text(false).contains("reconstruction")
        );
        assert!(text.contains("run once for all 20: laplace"));
        assert!(text.contains("short of the goal itself, ends: paper"));
    }

    #[test]
    fn csv_and_markdown_have_as_many_cells_as_headings() {
        let csv = table().to_csv();
        let counts: Vec<usize> = csv.lines().map(|line| line.split(',').count()).collect();
        assert_eq!(counts, [30; 3]);
        let markdown = table().to_markdown(false);
        for line in markdown.lines().take(4) {
            assert_eq!(line.matches('|').count(), 12, "{line}");
        }
    }

    #[test]
    fn times_have_their_unit() {
        for (value, shown) in [
            (1.4e-4, "140 µs"),
            (0.0123, "12.3 ms"),
            (1.41, "1.41 s"),
            (2700.0, "2700 s"),
        ] {
            assert_eq!(seconds(value), shown);
        }
    }
}
