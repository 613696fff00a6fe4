//! `bikebot sweep`: one scenario, many values and seeds, one row each.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::PathBuf;

use bikebot_sim::sweep::{self, Row, SweepError, Vary};
use clap::Args;
use serde::Serialize;

use crate::args::{Changes, Force, Jobs, ScenarioArg, runs};
use crate::diag::Diagnostic;
use crate::exit::{Ending, Exit, Failure};
use crate::input::Loaded;
use crate::interrupt;
use crate::output::{Output, make_folder};
use crate::render;
use crate::terminal::Terminal;

use super::envelope::EnvelopeMap;

/// Run a scenario over ranges of values and seeds, one CSV row for each run
///
/// Values of several --vary multiply, and so do seeds. Rows come in the same order
/// and with the same bytes for any number of jobs.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot sweep scenario.toml --vary bike.m1_kg=30:50:5 -o masses.csv
  bikebot sweep scenario.toml --vary follow.max_speed_mps=[1.0,1.5,2.0] --runs 20 -o speeds.csv
  bikebot sweep scenario.toml --vary bike.mode='[\"flywheel\",\"balancer\"]' --runs 5 -o modes/
  bikebot sweep push.toml --vary disturbance.0.impulse_ns=0:40:9 \\
      --vary follow.max_speed_mps=0.5:2.5:9 -o push.csv --map push.svg")]
pub struct SweepArgs {
    #[command(flatten)]
    pub scenario: ScenarioArg,
    /// What to vary: KEY=A:B:N (N values from A to B) or KEY=[…] (these values); repeatable
    #[arg(long, value_name = "KEY=A:B:N|KEY=[…]")]
    pub vary: Vec<String>,
    /// Runs of each combination, with seeds SEED, SEED+1, …
    #[arg(long, value_name = "N", default_value_t = 1, allow_hyphen_values = true, value_parser = runs)]
    pub runs: u64,
    #[command(flatten)]
    pub changes: Changes,
    #[command(flatten)]
    pub jobs: Jobs,
    /// Where the rows go: a CSV file, or a folder (which gets sweep.csv)
    #[arg(short, long, value_name = "FILE.csv|DIR")]
    pub output: PathBuf,
    /// Draw the envelope map as well: the first --vary to the right, the second upwards, any other in panels
    #[arg(long, value_name = "FILE.svg|FILE.png")]
    pub map: Option<PathBuf>,
    #[command(flatten)]
    pub force: Force,
    /// One JSON object telling how many runs ended how, instead of the summary
    #[arg(long)]
    pub json: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct SweepJson {
    rows: usize,
    passed: usize,
    invalid: usize,
    outcomes: BTreeMap<&'static str, usize>,
    output: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    map: Option<String>,
    interrupted: bool,
    version: &'static str,
}

/// How the rows came out.
#[derive(Debug, Default)]
struct Tally {
    passed: usize,
    invalid: usize,
    outcomes: BTreeMap<&'static str, usize>,
}

impl Tally {
    fn count(&mut self, row: &Row) {
        match &row.result {
            Ok(result) => {
                self.passed += usize::from(result.passed);
                *self.outcomes.entry(result.outcome.name()).or_default() += 1;
            }
            Err(_) => self.invalid += 1,
        }
    }

    /// `arrived 18, fell 2`, by name.
    fn sentence(&self) -> String {
        let mut parts: Vec<String> = self
            .outcomes
            .iter()
            .map(|(name, count)| format!("{name} {count}"))
            .collect();
        if self.invalid > 0 {
            parts.push(format!("invalid {}", self.invalid));
        }
        parts.join(", ")
    }
}

/// Runs them all.
pub fn run(args: &SweepArgs, terminal: &Terminal) -> Ending {
    let varies = varies(&args.vary)?;
    let mut map = match &args.map {
        Some(path) => Some(EnvelopeMap::over(path, &varies)?),
        None => None,
    };
    let loaded = Loaded::read(&args.scenario.scenario, &args.changes)?;
    let setup = loaded.setup(terminal)?;
    let first = setup.seed;
    let seeds: Vec<u64> = (0..args.runs)
        .map(|run| first.saturating_add(run))
        .collect();
    let total = varies
        .iter()
        .map(|vary| vary.values.len())
        .chain([seeds.len()])
        .try_fold(1_usize, usize::checked_mul)
        .filter(|total| *total <= sweep::MAX_CASES);
    let Some(total) = total else {
        return Err(Failure::usage(
            Diagnostic::error(format!("the sweep has more than {} runs", sweep::MAX_CASES))
                .help("vary fewer values, or make fewer runs of each"),
        ));
    };
    interrupt::install()?;
    let output = open(&args.output, args.force)?;
    let picture = match &args.map {
        Some(path) => Some(Output::create(path, args.force.force)?),
        None => None,
    };

    // Row by row, so that a crash leaves what was done in the `.part` file.
    let mut table = output.handle()?;
    let mut written = writeln!(table, "{}", sweep::csv_header(&varies));
    let mut tally = Tally::default();
    let bar = terminal.rows(total as u64, "sweeping");
    let rows = sweep::sweep(
        loaded.file().text(),
        &loaded.changes(),
        sweep::cases(&varies, &seeds),
        &|inner| loaded.read_file(inner),
        args.jobs.count(),
        &interrupt::asked,
        &mut |row| {
            bar.done();
            tally.count(&row);
            if let Some(map) = &mut map {
                map.add(&row);
            }
            if written.is_ok() {
                written = writeln!(table, "{}", row.csv_line());
            }
        },
    );
    drop(bar);
    let rows = match rows {
        Ok(rows) => rows,
        Err(error) => {
            output.discard();
            return Err(tell(&loaded, error, &args.vary));
        }
    };
    if let Err(error) = written {
        return Err(Failure::file("write", output.path(), &error));
    }
    let path = output.finish()?;
    let drawn = match (map, picture) {
        (Some(map), Some(picture)) => {
            Some(picture.write_all(&map.picture(loaded.file().scenario.name.as_str())?)?)
        }
        _ => None,
    };
    let interrupted = rows < total;
    if args.json {
        let json = SweepJson {
            rows,
            passed: tally.passed,
            invalid: tally.invalid,
            outcomes: tally.outcomes,
            output: path.display().to_string(),
            map: drawn.as_ref().map(|path| path.display().to_string()),
            interrupted,
            version: env!("CARGO_PKG_VERSION"),
        };
        terminal.print_json(&json)?;
    } else {
        let cut = if interrupted {
            format!(" of {total} (interrupted)")
        } else {
            String::new()
        };
        terminal.print(&format!(
            "{}{cut}: {}\n{}\n{}",
            render::count(rows as u64, "run"),
            tally.sentence(),
            render::path(&path),
            drawn.map_or(String::new(), |path| format!("{}\n", render::path(&path)))
        ))?;
    }
    // A sweep asks how runs end; that some fall is an answer, not a failure.
    Ok(if interrupted {
        Exit::Interrupted
    } else {
        Exit::Done
    })
}

/// Reads what `--vary` says.
fn varies(typed: &[String]) -> Result<Vec<Vary>, Failure> {
    let refuse = |text: &str, reason: String, help: Option<String>| {
        Err(Failure::usage(
            Diagnostic::error(format!("invalid --vary {text}: {reason}")).maybe_help(help),
        ))
    };
    let mut varies: Vec<Vary> = Vec::new();
    for text in typed {
        let vary: Vary = match text.parse::<Vary>() {
            Ok(vary) => vary,
            Err(reason) => {
                let (reason, help) = match reason.split_once("; ") {
                    Some((reason, help)) => (reason.to_owned(), Some(help.to_owned())),
                    None => (reason, None),
                };
                return refuse(text, reason, help);
            }
        };
        if vary.key == "run.seed" {
            return refuse(
                text,
                "seeds are varied by --runs".into(),
                Some("--seed N --runs M makes runs with seeds N to N + M - 1".into()),
            );
        }
        if varies.iter().any(|other| other.key == vary.key) {
            return refuse(text, format!("`{}` is varied twice", vary.key), None);
        }
        varies.push(vary);
    }
    Ok(varies)
}

/// The table's file: as named, or `sweep.csv` in the folder named.
fn open(path: &std::path::Path, force: Force) -> Result<Output, Failure> {
    let ends_in_slash = path.as_os_str().to_string_lossy().ends_with('/');
    if path.is_dir() || ends_in_slash {
        make_folder(path)?;
        return Output::create(&path.join("sweep.csv"), force.force);
    }
    Output::create(path, force.force)
}

/// A diagnostic for a sweep that did not begin.
fn tell(loaded: &Loaded, error: SweepError, typed: &[String]) -> Failure {
    match error {
        SweepError::Scenario(error) => {
            let by = error.from_override.as_deref().and_then(|from| {
                let key = from.strip_prefix("--set ").unwrap_or(from);
                typed.iter().find(|text| {
                    text.split('=').next().is_some_and(|name| {
                        let name = name.trim();
                        key == name || key.starts_with(&format!("{name}."))
                    })
                })
            });
            Failure::usage(match by {
                Some(text) => Diagnostic::error(error.message)
                    .maybe_help(error.help)
                    .note(format!("given by --vary {text}")),
                None => loaded.tell(&error),
            })
        }
        SweepError::Setup(error) => loaded.tell_setup(error, &BTreeMap::new()),
        SweepError::TooManyCases(_) => Failure::usage(Diagnostic::error(error.to_string())),
        SweepError::Threads(_) => Failure::io(Diagnostic::error(error.to_string())),
    }
}
