//! Many runs of one scenario, on all cores, one row each.
//!
//! The rows arrive in the order of the cases and are the same on any number of threads: each case
//! is a run of its own, with its own seed.

use crate::closed_loop::{RunControl, run};
use crate::outcome::{Metrics, RunOutcome, WALL_CLOCK_METRICS};
use crate::scenario::{Override, ScenarioError, ScenarioFile};
use crate::setup::{Setup, SetupError};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::str::FromStr;
use std::sync::mpsc;

/// Most cases one sweep may have.
pub const MAX_CASES: usize = 1_000_000;

/// A key of the scenario and the values it takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Vary {
    /// Dotted key, as in an override.
    pub key: String,
    /// The values, in order, in TOML syntax.
    pub values: Vec<String>,
}

impl FromStr for Vary {
    type Err = String;

    /// `key=a:b:n` (n values from a to b) or `key=[v, …]`.
    fn from_str(text: &str) -> Result<Self, String> {
        const HELP: &str =
            "write it as key=from:to:count, such as start.roll_deg=1:12:12, or as key=[value, …]";
        let (key, values) = text
            .split_once('=')
            .map(|(key, values)| (key.trim(), values.trim()))
            .filter(|(key, _)| !key.is_empty())
            .ok_or_else(|| format!("`{text}` names no key; {HELP}"))?;
        let values = if values.starts_with('[') {
            let table: toml::Table = toml::from_str(&format!("values = {values}"))
                .map_err(|error| format!("`{values}`: {}; {HELP}", error.message()))?;
            match table.get("values").and_then(toml::Value::as_array) {
                Some(list) if !list.is_empty() => list.iter().map(ToString::to_string).collect(),
                _ => return Err(format!("`{values}` holds no values; {HELP}")),
            }
        } else {
            let parts: Vec<&str> = values.split(':').map(str::trim).collect();
            let [from, to, count] = parts[..] else {
                return Err(format!("`{values}` is not a range; {HELP}"));
            };
            let number = |text: &str| {
                text.parse::<f64>()
                    .ok()
                    .filter(|value| value.is_finite())
                    .ok_or_else(|| format!("`{text}` is not a finite number; {HELP}"))
            };
            let (from, to) = (number(from)?, number(to)?);
            let count: usize = count
                .parse()
                .ok()
                .filter(|count| (1..=MAX_CASES).contains(count))
                .ok_or_else(|| format!("`{count}` is not a count from 1 to {MAX_CASES}; {HELP}"))?;
            linear(from, to, count)
                .map(|value| format!("{value:?}"))
                .collect()
        };
        Ok(Self {
            key: key.to_owned(),
            values,
        })
    }
}

fn linear(from: f64, to: f64, count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |i| {
        if count == 1 {
            from
        } else {
            let share = i as f64 / (count - 1) as f64;
            // Exact at both ends, whatever the rounding between.
            from * (1.0 - share) + to * share
        }
    })
}

/// One case of a sweep: the varied values and the seed.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Number of the case, from 0.
    pub index: usize,
    /// One override per varied key, in the order of the keys.
    pub varied: Vec<Override>,
    /// Its seed.
    pub seed: u64,
}

/// All combinations: the first key varies slowest, the seed fastest. Never more than one beyond
/// [`MAX_CASES`], which is enough for [`sweep`] to refuse them.
#[must_use]
pub fn cases(varies: &[Vary], seeds: &[u64]) -> Vec<Case> {
    let mut combinations: Vec<Vec<Override>> = vec![Vec::new()];
    for vary in varies {
        combinations = combinations
            .iter()
            .flat_map(|prefix| {
                vary.values.iter().map(move |value| {
                    let mut next = prefix.clone();
                    next.push(Override::new(vary.key.clone(), value));
                    next
                })
            })
            .take(MAX_CASES + 1)
            .collect();
    }
    combinations
        .into_iter()
        .flat_map(|varied| seeds.iter().map(move |seed| (varied.clone(), *seed)))
        .take(MAX_CASES + 1)
        .enumerate()
        .map(|(index, (varied, seed))| Case {
            index,
            varied,
            seed,
        })
        .collect()
}

/// The result of one case.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The case.
    pub case: Case,
    /// How it ended; `Err` where the run made no sense, with the message.
    pub result: Result<RowResult, String>,
}

/// What a case that ran has to show.
#[derive(Debug, Clone, PartialEq)]
pub struct RowResult {
    /// How it ended.
    pub outcome: RunOutcome,
    /// Why.
    pub reason: String,
    /// All expectations hold.
    pub passed: bool,
    /// The metrics; those of the wall clock are left out.
    pub metrics: Metrics,
    /// Hash of the run.
    pub result_hash: String,
}

/// Header line of the table, without line end.
#[must_use]
pub fn csv_header(varies: &[Vary]) -> String {
    let mut line = String::from("case");
    for vary in varies {
        line.push(',');
        line.push_str(&csv_field(&vary.key));
    }
    line.push_str(",seed,outcome,reason,passed");
    for name in metric_names() {
        line.push(',');
        line.push_str(name);
    }
    line.push_str(",result_hash,error");
    line
}

impl Row {
    /// The row as a line of CSV, without line end. Absent metrics are empty.
    #[must_use]
    pub fn csv_line(&self) -> String {
        let mut line = self.case.index.to_string();
        for change in &self.case.varied {
            line.push(',');
            line.push_str(&csv_field(change.value.trim_matches('"')));
        }
        let _ = write!(line, ",{}", self.case.seed);
        match &self.result {
            Ok(result) => {
                let _ = write!(
                    line,
                    ",{},{},{}",
                    result.outcome,
                    csv_field(&result.reason),
                    result.passed
                );
                let found: BTreeMap<&str, f64> = result.metrics.iter().collect();
                for name in metric_names() {
                    line.push(',');
                    if let Some(value) = found.get(name) {
                        let _ = write!(line, "{value}");
                    }
                }
                let _ = write!(line, ",{},", result.result_hash);
            }
            Err(message) => {
                line.push_str(",invalid,,false");
                line.extend(metric_names().map(|_| ','));
                let _ = write!(line, ",,{}", csv_field(message));
            }
        }
        line
    }
}

fn metric_names() -> impl Iterator<Item = &'static str> {
    Metrics::NAMES
        .iter()
        .copied()
        .filter(|name| !WALL_CLOCK_METRICS.contains(name))
}

/// A field in quotes where commas, quotes or line ends ask for them.
pub(crate) fn csv_field(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// Why a sweep did not begin.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// A case asks for what a scenario cannot be.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The scenario cannot be resolved.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// More cases than [`MAX_CASES`].
    #[error("the sweep has {0} cases or more; at most {MAX_CASES} are run")]
    TooManyCases(usize),
    /// The threads could not be started.
    #[error("cannot start the threads: {0}")]
    Threads(String),
}

/// Reads the files a scenario names, from any thread.
pub type SharedRead<'a> = &'a (dyn Fn(&str) -> Result<Vec<u8>, String> + Sync);

/// Runs every case on `jobs` threads (0: one per core) and hands the rows to `on_row` in order.
///
/// Every case is parsed before the first one runs, so a bad value is found at once. `stop` is asked
/// often; when it says so the rows finished so far (an unbroken beginning of the table) have been handed out.
/// Returns the number of rows.
///
/// # Errors
///
/// [`SweepError`] before the first run. A case whose run makes no sense is a row with its message.
pub fn sweep(
    text: &str,
    overrides: &[Override],
    cases: Vec<Case>,
    read: SharedRead<'_>,
    jobs: usize,
    stop: &(dyn Fn() -> bool + Sync),
    on_row: &mut dyn FnMut(Row),
) -> Result<usize, SweepError> {
    if cases.len() > MAX_CASES {
        return Err(SweepError::TooManyCases(cases.len()));
    }
    if let Some(case) = cases.first()
        && case.varied.iter().any(|change| change.key == "run.seed")
    {
        return Err(ScenarioError::plain(
            "`run.seed` is varied, but every case has its own seed already",
            "leave it out: the number of runs and the first seed say which seeds are run",
        )
        .into());
    }
    // Parsed once to find a bad value at once, and again when its turn comes: a million parsed
    // scenarios would fill the memory.
    let parse = |case: &Case| {
        let mut all = overrides.to_vec();
        all.extend(case.varied.iter().cloned());
        all.push(Override::new("run.seed", case.seed));
        ScenarioFile::parse(text, &all)
    };
    for (index, case) in cases.iter().enumerate() {
        let file = parse(case)?;
        if index == 0 {
            Setup::resolve(&file, &mut |name| read(name))?;
        }
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(jobs)
        .build()
        .map_err(|error| SweepError::Threads(error.to_string()))?;
    let total = cases.len();
    let mut handed_out = 0;
    pool.in_place_scope(|scope| {
        let (send, receive) = mpsc::channel::<(usize, Option<Row>)>();
        let queue = std::sync::Arc::new(std::sync::atomic::AtomicUsize::new(0));
        let shared = std::sync::Arc::new(cases);
        for _ in 0..pool.current_num_threads() {
            let (send, queue, shared) = (send.clone(), queue.clone(), shared.clone());
            scope.spawn(move |_| {
                loop {
                    let index = queue.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    let Some(case) = shared.get(index) else {
                        break;
                    };
                    // A closed channel means nobody waits for rows any more.
                    if stop()
                        || send
                            .send((index, run_case(case, parse, read, stop)))
                            .is_err()
                    {
                        break;
                    }
                }
            });
        }
        drop(send);
        let mut early: BTreeMap<usize, Option<Row>> = BTreeMap::new();
        for (index, row) in receive {
            early.insert(index, row);
            while let Some(Some(row)) = early.get_mut(&handed_out).map(Option::take) {
                early.remove(&handed_out);
                on_row(row);
                handed_out += 1;
            }
        }
    });
    debug_assert!(handed_out == total || stop());
    Ok(handed_out)
}

/// One row; `None` where `stop` cut the run short.
fn run_case(
    case: &Case,
    parse: impl Fn(&Case) -> Result<ScenarioFile, ScenarioError>,
    read: SharedRead<'_>,
    stop: &(dyn Fn() -> bool + Sync),
) -> Option<Row> {
    let result = parse(case)
        .map_err(SetupError::from)
        .and_then(|file| Setup::resolve(&file, &mut |name| read(name)))
        .map_err(|error| error.to_string())
        .and_then(|setup| {
            let control = RunControl {
                stop,
                progress: &mut |_| {},
                clock: None,
            };
            run(&setup, &mut (), control).map_err(|error| error.to_string())
        });
    let result = match result {
        Ok(report) if report.outcome == RunOutcome::Interrupted => return None,
        Ok(report) => Ok(RowResult {
            outcome: report.outcome,
            passed: report.passed(),
            reason: report.reason,
            metrics: report.metrics,
            result_hash: report.result_hash,
        }),
        Err(message) => Err(message),
    };
    Some(Row {
        case: case.clone(),
        result,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_holds_both_its_ends() {
        let vary: Vary = "start.roll_deg=1:12:12".parse().expect("a range");
        assert_eq!(vary.values.len(), 12);
        assert_eq!(
            (vary.values[0].as_str(), vary.values[11].as_str()),
            ("1.0", "12.0")
        );
    }

    #[test]
    fn lists_hold_any_value() {
        let vary: Vary = "bike.mode=[\"flywheel\", \"balancer\"]"
            .parse()
            .expect("a list");
        assert_eq!(vary.values, ["\"flywheel\"", "\"balancer\""]);
    }

    #[test]
    fn keys_and_seeds_multiply_and_the_seed_varies_fastest() {
        let varies: Vec<Vary> = ["a=[1,2]", "b=[3,4]"]
            .iter()
            .map(|text| text.parse().expect("a list"))
            .collect();
        let cases = cases(&varies, &[7, 8]);
        let shown: Vec<String> = cases
            .iter()
            .map(|case| {
                format!(
                    "{}{}{}",
                    case.varied[0].value, case.varied[1].value, case.seed
                )
            })
            .collect();
        assert_eq!(
            shown,
            ["137", "138", "147", "148", "237", "238", "247", "248"]
        );
    }

    #[test]
    fn more_combinations_than_can_be_run_are_not_laid_out() {
        let vary: Vary = "a=0:1:1000000".parse().expect("a range");
        assert_eq!(cases(&[vary], &[1, 2]).len(), MAX_CASES + 1);
    }

    #[test]
    fn the_seed_is_not_varied_twice() {
        let vary: Vary = "run.seed=[1, 2]".parse().expect("a list");
        let text = "format = 1\nname = \"stand\"\n[plant]\nmodel = \"two_link\"\n";
        let refused = sweep(
            text,
            &[],
            cases(&[vary], &[7]),
            &|_| Err(String::new()),
            1,
            &|| false,
            &mut |_| {},
        );
        assert!(
            matches!(refused, Err(SweepError::Scenario(_))),
            "{refused:?}"
        );
    }

    #[test]
    fn rows_do_not_depend_on_the_number_of_threads() {
        let vary: Vary = "start.roll_deg=1:3:3".parse().expect("a range");
        let text = "format = 1\nname = \"stand\"\n[plant]\nmodel = \"two_link\"\n[noise]\nroll_sigma_deg = 0.1\n[run]\nduration_s = 1.0\n";
        let table = |jobs: usize| {
            let mut lines = Vec::new();
            let rows = sweep(
                text,
                &[],
                cases(std::slice::from_ref(&vary), &[1, 2, 3]),
                &|_| Err(String::new()),
                jobs,
                &|| false,
                &mut |row| lines.push(row.csv_line()),
            );
            assert_eq!(rows.ok(), Some(9));
            lines
        };
        let one = table(1);
        assert_eq!(one, table(4));
        // Every case is a run of its own: no two rows have the same hash.
        let hashes: std::collections::BTreeSet<_> = one
            .iter()
            .filter_map(|line| line.rsplit(',').nth(1))
            .collect();
        assert_eq!(hashes.len(), 9);
    }

    #[test]
    fn what_is_no_range_is_refused_with_help() {
        for text in [
            "x",
            "=1:2:3",
            "x=1:2",
            "x=1:2:0",
            "x=nan:2:3",
            "x=[",
            "x=[]",
            "x=1:2:2000000",
        ] {
            assert!(text.parse::<Vary>().is_err(), "{text}");
        }
    }
}
