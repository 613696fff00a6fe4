//! The rows of the robustness study as a text table, Markdown and CSV.

use super::robustness::{FIGURE_NAMES, Figures, Row};
use std::fmt::Write as _;

/// How the ending reads in a table.
fn ending(row: &Row) -> String {
    match &row.ending {
        Ok(_) if row.holds() => "ok".into(),
        Ok((outcome, reason)) => format!("{outcome}: {reason}"),
        Err(message) => format!("not ridden: {message}"),
    }
}

fn wanted(row: &Row) -> &'static str {
    match row.reference {
        Some(reference) if reference.holds => "ok",
        Some(_) => "falls",
        None => "",
    }
}

/// `3 / 1.1 | 8 | 4.3 | …`: the columns of the design note's tables.
fn columns(figures: &Figures) -> [String; 8] {
    let v = figures.values();
    let number = |value: Option<f64>, digits: usize| {
        value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
    };
    let pair = |a: usize, b: usize, digits: [usize; 2]| {
        format!("{} / {}", number(v[a], digits[0]), number(v[b], digits[1]))
    };
    [
        pair(0, 1, [0, 1]),
        number(v[2], 0),
        number(v[3], 1),
        pair(4, 5, [0, 1]),
        number(v[6], 1),
        number(v[7], 1),
        pair(8, 9, [2, 2]),
        number(v[10], 0),
    ]
}

const HEADINGS: [&str; 8] = [
    "error mm",
    "rear mm",
    "roll °",
    "torque N m",
    "speed rad/s",
    "angle rad",
    "friction",
    "load N",
];

fn off(row: &Row) -> String {
    let list: Vec<String> = row
        .deviations()
        .iter()
        .map(|off| format!("{} {:.3} ({:.3})", off.name, off.found, off.wanted))
        .collect();
    list.join("; ")
}

/// The rows as lines of text, one figure column below the other, with what differs at the end of each.
#[must_use]
pub fn text(rows: &[Row]) -> String {
    let mut lines = Vec::new();
    let mut header = vec![
        "plant".to_owned(),
        "mode".into(),
        "case".into(),
        "outcome".into(),
    ];
    header.push("reference".into());
    header.extend(HEADINGS.map(str::to_owned));
    lines.push(header);
    for row in rows {
        let mut line = vec![
            row.plant.clone(),
            row.mode.to_owned(),
            row.case.to_owned(),
            ending(row),
            wanted(row).to_owned(),
        ];
        line.extend(columns(&row.figures));
        lines.push(line);
    }
    let widths: Vec<usize> = (0..lines[0].len())
        .map(|column| {
            lines
                .iter()
                .map(|line| line[column].chars().count())
                .max()
                .unwrap_or(0)
        })
        .collect();
    let mut out = String::new();
    for line in &lines {
        let cells: Vec<String> = line
            .iter()
            .zip(&widths)
            .map(|(cell, width)| format!("{cell:<width$}"))
            .collect();
        let _ = writeln!(out, "{}", cells.join("  ").trim_end());
    }
    out.push('\n');
    out.push_str(&summary(rows));
    out
}

/// How many rows hold, and each that does not although the reference does.
#[must_use]
pub fn summary(rows: &[Row]) -> String {
    let mut out = String::new();
    let holds = rows.iter().filter(|row| row.holds()).count();
    let lost: Vec<&Row> = rows.iter().filter(|row| !row.is_as_good()).collect();
    let _ = writeln!(
        out,
        "{holds} of {} rows hold; {} that the reference holds do not",
        rows.len(),
        lost.len()
    );
    for row in lost {
        let _ = writeln!(
            out,
            "  {} {} {}: {}",
            row.plant,
            row.mode,
            row.case,
            ending(row)
        );
    }
    out
}

/// The rows as Markdown tables, one for each plant and mode, each followed by the figures that differ by more
/// than a quarter from the reference (in brackets).
#[must_use]
pub fn markdown(rows: &[Row]) -> String {
    let mut out = String::new();
    let mut groups: Vec<(&str, &str)> = Vec::new();
    for row in rows {
        if !groups.contains(&(row.plant.as_str(), row.mode)) {
            groups.push((&row.plant, row.mode));
        }
    }
    for (plant, mode) in groups {
        let _ = writeln!(out, "### `{plant}`, {mode} mode\n");
        let _ = writeln!(
            out,
            "| case | outcome | reference | {} |",
            HEADINGS.join(" | ")
        );
        let _ = writeln!(out, "|{}", "---|".repeat(3 + HEADINGS.len()));
        let these = || {
            rows.iter()
                .filter(|row| row.plant == plant && row.mode == mode)
        };
        for row in these() {
            let _ = writeln!(
                out,
                "| {} | {} | {} | {} |",
                row.case,
                ending(row),
                wanted(row),
                columns(&row.figures).join(" | ")
            );
        }
        let _ = writeln!(
            out,
            "\n| case | differs by more than a quarter (reference) |"
        );
        let _ = writeln!(out, "|---|---|");
        for row in these().filter(|row| !row.deviations().is_empty()) {
            let _ = writeln!(out, "| {} | {} |", row.case, off(row));
        }
        out.push('\n');
    }
    out
}

/// The rows as CSV: every figure and its reference in full.
#[must_use]
pub fn csv(rows: &[Row]) -> String {
    let mut out = String::from("plant,mode,case,outcome,reason,holds,reference_holds");
    for name in FIGURE_NAMES {
        let name = name.replace([' ', '/'], "_");
        let _ = write!(out, ",{name},{name}_reference");
    }
    out.push('\n');
    for row in rows {
        let (outcome, reason) = match &row.ending {
            Ok((outcome, reason)) => (outcome.name(), reason.clone()),
            Err(message) => ("invalid", format!("\"{}\"", message.replace('"', "\"\""))),
        };
        let _ = write!(
            out,
            "{},{},{},{outcome},{reason},{},{}",
            row.plant,
            row.mode,
            row.case,
            row.holds(),
            row.reference
                .map_or(String::new(), |reference| reference.holds.to_string())
        );
        let wanted = row.reference.map(|reference| reference.figures.values());
        for (index, value) in row.figures.values().into_iter().enumerate() {
            let shown = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
            let _ = write!(
                out,
                ",{},{}",
                shown(value),
                shown(wanted.and_then(|wanted| wanted[index]))
            );
        }
        out.push('\n');
    }
    out
}
