//! `bikebot table2`: every row of the paper's Table 2, measured now.

use std::path::PathBuf;
use std::time::Instant;

use bikebot_sim::study::table2::{PAPER_MAP, PAPER_SCENARIO};
use bikebot_sim::study::{Table2, Table2Study};
use clap::Args;
use serde::Serialize;

use crate::args::{Changes, runs, threads};
use crate::diag::Diagnostic;
use crate::exit::{Ending, Exit, Failure};
use crate::input::{Kind, Loaded};
use crate::interrupt;
use crate::render;
use crate::table::{Format, TableArgs};
use crate::terminal::Terminal;

/// Measure every row of the paper's Table 2, beside the printed figures
///
/// Plans with every method on one field and compares length, roughness, curvature
/// and time. Without SCENARIO the field is our reconstruction of the paper's yard.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot table2
  bikebot table2 --runs 100 --format markdown -o table2.md
  bikebot table2 maze.toml --runs 5 --json | jq '.rows[] | {method, length_m}'")]
pub struct Table2Args {
    /// Scenario file (TOML) whose field, ends and curvature limit to use [default: the paper's yard]
    #[arg(value_name = "SCENARIO")]
    pub scenario: Option<PathBuf>,
    /// Runs of each method, with seeds SEED, SEED+1, …; methods without chance run once
    #[arg(long, value_name = "N", default_value_t = 20, allow_hyphen_values = true, value_parser = runs)]
    pub runs: u64,
    #[command(flatten)]
    pub changes: Changes,
    /// Plans made at the same time; more than one disturb each other's times, and nothing else
    #[arg(long, value_name = "N", default_value_t = 1, allow_hyphen_values = true, value_parser = threads)]
    pub jobs: usize,
    #[command(flatten)]
    pub table: TableArgs,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct Table2Json<'t> {
    scenario: &'t str,
    #[serde(flatten)]
    table: &'t Table2,
    version: &'static str,
}

/// Measures, and tells.
pub fn run(args: &Table2Args, terminal: &Terminal) -> Ending {
    let loaded = match &args.scenario {
        Some(path) if path.is_file() && Kind::of(path) == Kind::Map => {
            return Err(Failure::usage(
                Diagnostic::error(format!("{} is a map, not a scenario", path.display())).help(
                    "a scenario names the map, the start and the goal; `bikebot init` writes one to begin with",
                ),
            ));
        }
        Some(path) => Loaded::read(path, &args.changes)?,
        None => Loaded::built_in(PAPER_SCENARIO, &[PAPER_MAP], &args.changes)?,
    };
    let setup = loaded.setup(terminal)?;
    let Some(problem) = setup.problem() else {
        return Err(Failure::usage(loaded.tell(&loaded.file().error_at(
            "path",
            "there is nothing to plan: the scenario has no map with a start and a goal",
            "add [map] and [goal]",
        ))));
    };
    interrupt::install()?;
    let target = args.table.open()?;
    let began = Instant::now();
    let study = Table2Study {
        problem: &problem,
        params: &setup.planner,
        runs: args.runs,
        seed: setup.seed,
        jobs: args.jobs,
        clock: &|| began.elapsed().as_secs_f64(),
        stop: &interrupt::asked,
    };
    let bar = terminal.rows(study.plans(), "planning");
    let table = study.measure(&mut || bar.done());
    drop(bar);
    let table = table.map_err(|error| Failure::usage(loaded.tell_plan(&error)))?;
    let text = match args.table.format() {
        Format::Json => json(&setup.name, &table)?,
        Format::Text => {
            let (name, seed) = (&setup.name, setup.seed);
            let runs = render::count(args.runs, "run");
            let title = format!("Table 2 on {name}, {runs} from seed {seed}\n\n");
            title + &table.to_text(args.scenario.is_none())
        }
        Format::Markdown => table.to_markdown(args.scenario.is_none()),
        Format::Csv => table.to_csv(),
    };
    target.write(&text, terminal)?;
    // That a method finds nothing is what the table tells, not a failure of it.
    Ok(if table.interrupted {
        Exit::Interrupted
    } else {
        Exit::Done
    })
}

fn json(scenario: &str, table: &Table2) -> Result<String, Failure> {
    let json = Table2Json {
        scenario,
        table,
        version: env!("CARGO_PKG_VERSION"),
    };
    let mut text = serde_json::to_string(&json).map_err(|error| {
        Failure::io(Diagnostic::error(format!(
            "cannot write the table: {error}"
        )))
    })?;
    text.push('\n');
    Ok(text)
}
