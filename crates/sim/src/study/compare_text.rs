//! The comparison as text for people, as Markdown and as CSV.

use super::compare::{COMPARED, Column, Comparison, Quantity};
use super::wrapped::wrapped;
use crate::outcome::{Metrics, WALL_CLOCK_METRICS};
use crate::sweep::csv_field;
use std::fmt::Write as _;

/// Columns of a page: a label and four runs.
const LABEL: usize = 20;
const CELL: usize = 15;
const PER_BLOCK: usize = 4;

const STANDS: &str = "two_link stands still: it gets the scenario without its way, so it answers for lean and balance alone.";
const WORK: &str =
    "Work is what a motor gives out, ∫ max(P, 0) dt; what braking takes up is not given back.";

impl Comparison {
    /// Blocks of four runs within 80 columns: each value, and below it the difference from the first run.
    #[must_use]
    pub fn to_text(&self) -> String {
        let mut text = String::new();
        let quantities = self.measured();
        for begin in (0..self.columns.len()).step_by(PER_BLOCK) {
            let end = (begin + PER_BLOCK).min(self.columns.len());
            let mut line = |label: &str, cell: &dyn Fn(usize) -> String| {
                let mut line = format!("{label:LABEL$}");
                for number in begin..end {
                    let cell = fitted(&cell(number));
                    let _ = write!(line, "{cell:>CELL$}");
                }
                let _ = writeln!(text, "{}", line.trim_end());
            };
            line("", &|number| format!("({})", number + 1));
            line("plant", &|number| self.columns[number].plant.clone());
            line("follows by", &|number| law(&self.columns[number].follow));
            line("balances by", &|number| law(&self.columns[number].balance));
            line("outcome", &|number| {
                outcome(&self.columns[number]).to_owned()
            });
            line("", &|number| reason(&self.columns[number]).to_owned());
            for quantity in &quantities {
                line(quantity.label, &|number| self.value(number, quantity));
                if (begin..end).any(|number| self.difference(number, quantity).is_some()) {
                    line("", &|number| self.change(number, quantity));
                }
            }
            text.push('\n');
        }
        for note in self.notes() {
            text.push_str(&wrapped(&note, LABEL + PER_BLOCK * CELL));
        }
        text
    }

    /// A table in Markdown: one row per quantity, one column per run.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = String::new();
        let count = self.columns.len();
        let mut line = |label: &str, cell: &dyn Fn(usize) -> String| {
            let cells: Vec<String> = (0..count).map(cell).collect();
            let _ = writeln!(text, "| {label} | {} |", cells.join(" | "));
        };
        line("plant", &|number| {
            format!("`{}`", self.columns[number].plant)
        });
        line("---", &|_| "---:".to_owned());
        line("follows by", &|number| law(&self.columns[number].follow));
        line("balances by", &|number| law(&self.columns[number].balance));
        line("outcome", &|number| {
            let (outcome, reason) = (
                outcome(&self.columns[number]),
                reason(&self.columns[number]),
            );
            match reason {
                "" => outcome.to_owned(),
                reason => format!("{outcome} ({reason})"),
            }
        });
        for quantity in &self.measured() {
            line(quantity.label, &|number| match (
                self.value(number, quantity),
                self.change(number, quantity),
            ) {
                (value, change) if change.is_empty() => value,
                (value, change) => format!("{value} ({change})"),
            });
        }
        text.push('\n');
        for note in self.notes() {
            let _ = writeln!(text, "{note}\n");
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
        text
    }

    /// One line per run: every metric, and for the compared ones the difference from the first run.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let metrics: Vec<&str> = Metrics::NAMES
            .iter()
            .copied()
            .filter(|name| !WALL_CLOCK_METRICS.contains(name))
            .collect();
        let mut text = String::from("plant,follow,balance,seed,outcome,reason,passed");
        for name in &metrics {
            let _ = write!(text, ",{name}");
        }
        for quantity in &COMPARED {
            let _ = write!(text, ",{}_difference", quantity.metric);
        }
        text.push_str(",result_hash,error\n");
        for (number, column) in self.columns.iter().enumerate() {
            let name = |law: &Option<String>| law.clone().unwrap_or_default();
            let _ = write!(
                text,
                "{},{},{},{},{},{}",
                column.plant,
                name(&column.follow),
                name(&column.balance),
                self.seed,
                outcome(column),
                csv_field(reason(column)),
            );
            let result = column.result.as_ref().ok();
            let _ = write!(text, ",{}", result.is_some_and(|result| result.passed));
            let mut put = |value: Option<f64>| {
                text.push(',');
                if let Some(value) = value {
                    let _ = write!(text, "{value}");
                }
            };
            for name in &metrics {
                let found = result.and_then(|result| {
                    let mut all = result.metrics.iter();
                    all.find(|(other, _)| other == name).map(|(_, value)| value)
                });
                put(found);
            }
            for quantity in &COMPARED {
                put(self.difference(number, quantity));
            }
            let hash = result.map_or("", |result| result.result_hash.as_str());
            let error = column.result.as_ref().err().map(|error| csv_field(error));
            let _ = writeln!(text, ",{hash},{}", error.unwrap_or_default());
        }
        text
    }

    /// The quantities that at least one run has.
    fn measured(&self) -> Vec<Quantity> {
        let is_measured = |quantity: &Quantity| {
            let mut results = self
                .columns
                .iter()
                .filter_map(|column| column.result.as_ref().ok());
            results.any(|result| quantity.of(&result.metrics).is_some())
        };
        COMPARED.into_iter().filter(is_measured).collect()
    }

    fn value(&self, number: usize, quantity: &Quantity) -> String {
        let result = self.columns[number].result.as_ref().ok();
        let value = result.and_then(|result| quantity.of(&result.metrics));
        value.map_or_else(|| "-".to_owned(), |value| figures(quantity.factor * value))
    }

    /// `+0.21, +5 %`; the share only where the first run has something to take a share of.
    fn change(&self, number: usize, quantity: &Quantity) -> String {
        let Some(difference) = self.difference(number, quantity) else {
            return String::new();
        };
        if difference == 0.0 {
            return "the same".into();
        }
        let base = self.columns[0].result.as_ref().ok();
        let base = base
            .and_then(|result| quantity.of(&result.metrics))
            .unwrap_or(0.0);
        let share = 100.0 * difference / base.abs();
        let signed = |text: String| {
            if difference > 0.0 {
                format!("+{text}")
            } else {
                text
            }
        };
        let absolute = signed(figures(quantity.factor * difference));
        // A change of nothing worth naming, a change beside its share, or whichever of the two fits the column.
        if share.abs() < 0.5 {
            return "~0 %".into();
        }
        if share.abs() >= 1000.0 || !share.is_finite() {
            return absolute;
        }
        let both = format!("{absolute}, {share:+.0} %");
        if both.chars().count() < CELL {
            both
        } else {
            format!("{share:+.0} %")
        }
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.interrupted {
            notes.push("Interrupted: these are the runs made until then.".to_owned());
        }
        for (number, column) in self.columns.iter().enumerate() {
            if let Err(message) = &column.result {
                notes.push(format!("({}) makes no sense: {message}", number + 1));
            }
        }
        let stands = |column: &Column| column.follow.is_none() && column.plant == "two_link";
        if self.columns.iter().any(stands) && !self.columns.iter().all(stands) {
            notes.push(STANDS.to_owned());
        }
        if self
            .measured()
            .iter()
            .any(|quantity| quantity.metric.ends_with("_work_j"))
        {
            notes.push(WORK.to_owned());
        }
        notes
    }
}

fn law(name: &Option<String>) -> String {
    name.clone().unwrap_or_else(|| "-".to_owned())
}

fn outcome(column: &Column) -> &str {
    column
        .result
        .as_ref()
        .map_or("invalid", |result| result.outcome.name())
}

fn reason(column: &Column) -> &str {
    column
        .result
        .as_ref()
        .map_or("", |result| result.reason.as_str())
}

/// Three digits that count, never more than nine characters.
fn figures(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let magnitude = value.abs().log10().floor();
    if !(-4.0..6.0).contains(&magnitude) {
        return format!("{value:.1e}");
    }
    let digits = (2.0 - magnitude).clamp(0.0, 6.0) as usize;
    format!("{value:.digits$}")
}

/// A cell that leaves a blank before it.
fn fitted(text: &str) -> String {
    if text.chars().count() < CELL {
        return text.to_owned();
    }
    let cut: String = text.chars().take(CELL - 2).collect();
    format!("{cut}…")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RunOutcome;
    use crate::sweep::RowResult;

    fn column(plant: &str, roll: Option<f64>) -> Column {
        Column {
            plant: plant.into(),
            follow: Some("pvfc".into()),
            balance: Some("output_zeroing".into()),
            result: roll.map_or(Err("no path, though it says there is one".into()), |roll| {
                Ok(RowResult {
                    outcome: RunOutcome::Arrived,
                    reason: "at_goal".into(),
                    passed: true,
                    metrics: Metrics {
                        roll_max_deg: Some(roll),
                        lateral_error_max_m: Some(0.003),
                        drive_work_j: Some(0.0),
                        ..Metrics::default()
                    },
                    result_hash: "00".into(),
                })
            }),
        }
    }

    fn comparison() -> Comparison {
        Comparison {
            scenario: "course".into(),
            seed: 1,
            columns: vec![
                column("bike3d", Some(4.0)),
                column("rapier3d", Some(4.4)),
                column("kinematic", None),
                column("bike3d", Some(4.0)),
                column("bike3d", Some(3.0)),
            ],
            interrupted: false,
        }
    }

    #[test]
    fn the_text_keeps_to_eighty_columns_and_shows_differences() {
        let text = comparison().to_text();
        assert!(
            text.lines().all(|line| line.chars().count() <= 80),
            "{text}"
        );
        for part in [
            "roll max, °                    4.00           4.40",
            "+0.400, +10 %",
            "-1.00, -25 %",
            "the same",
            "output_zeroing",
            "invalid",
            "(3) makes no sense: no path",
        ] {
            assert!(text.contains(part), "`{part}` is not in:\n{text}");
        }
        // What nobody measured has no row.
        assert!(!text.contains("torque"));
    }

    #[test]
    fn csv_and_markdown_have_as_many_cells_as_headings() {
        let csv = comparison().to_csv();
        let counts: Vec<usize> = csv
            .lines()
            .map(|line| line.replace("no path, though", "").split(',').count())
            .collect();
        assert!(counts.iter().all(|count| *count == counts[0]), "{csv}");
        assert_eq!(counts.len(), 6);
        let markdown = comparison().to_markdown();
        for line in markdown.lines().take_while(|line| !line.is_empty()) {
            assert_eq!(line.matches('|').count(), 7, "{line}");
        }
    }
}
