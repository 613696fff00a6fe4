//! `bikebot compare`: one scenario over several plants and controllers.

use bikebot_sim::study::{CompareError, CompareStudy, Controllers, Known};
use bikebot_sim::sweep::SweepError;
use clap::Args;

use crate::args::{Changes, Jobs, ScenarioArg};
use crate::diag::Diagnostic;
use crate::exit::{Ending, Exit, Failure};
use crate::input::Loaded;
use crate::interrupt;
use crate::render;
use crate::table::{Format, TableArgs};
use crate::terminal::Terminal;

/// Run one scenario over several plants and controllers, and table the differences
///
/// Every plant is combined with every pair of controllers. The first combination is
/// the one the others are compared with: roll, torque, errors, and the work the
/// motors gave out. All combinations run at the same seed.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot compare scenarios/course.toml --plants bike3d,two_link,kinematic
  bikebot compare scenarios/course.toml --controllers pvfc,pure_pursuit,stanley,lqr+
  bikebot compare scenarios/course.toml --controllers pvfc+output_zeroing,lqr+lqr
  bikebot compare scenarios/fig7.toml --plants bike3d,two_link --format markdown -o fig7.md

A controller is a path follower (FOLLOWER), a balance law (LAW) or both
(FOLLOWER+LAW); a name that is both is told apart by its plus sign: `lqr+` follows,
`+lqr` balances. What is not named stays as the scenario says. `two_link` stands
still: it gets the scenario without its way.")]
pub struct CompareArgs {
    #[command(flatten)]
    pub scenario: ScenarioArg,
    /// Plants, the first one first: bike3d, two_link, kinematic, … [default: the scenario's]
    #[arg(long, value_name = "PLANT,…", value_delimiter = ',')]
    pub plants: Vec<String>,
    /// Controllers, each FOLLOWER, LAW or FOLLOWER+LAW [default: the scenario's]
    #[arg(long, value_name = "FOLLOWER+LAW,…", value_delimiter = ',')]
    pub controllers: Vec<String>,
    #[command(flatten)]
    pub changes: Changes,
    #[command(flatten)]
    pub jobs: Jobs,
    #[command(flatten)]
    pub table: TableArgs,
}

/// Compares, and tells.
pub fn run(args: &CompareArgs, terminal: &Terminal) -> Ending {
    let known = Known::from_schema();
    let controllers = args
        .controllers
        .iter()
        .map(|text| Controllers::parse(text, &known).map_err(|error| tell_name(&error, text)))
        .collect::<Result<Vec<_>, _>>()?;
    let loaded = Loaded::read(&args.scenario.scenario, &args.changes)?;
    interrupt::install()?;
    let target = args.table.open()?;
    let study = CompareStudy {
        file: loaded.file(),
        plants: &args.plants,
        controllers: &controllers,
        read: &|inner| loaded.read_file(inner),
        jobs: args.jobs.count(),
        stop: &interrupt::asked,
    };
    let bar = terminal.rows(study.runs() as u64, "comparing");
    let comparison = study.measure(&mut || bar.done());
    drop(bar);
    let comparison = comparison.map_err(|error| tell(&loaded, error, &known))?;
    let text = match args.table.format() {
        Format::Json => format!("{}\n", comparison.to_json()),
        Format::Text => {
            let runs = render::count(comparison.columns.len() as u64, "run");
            let (name, seed) = (&comparison.scenario, comparison.seed);
            format!(
                "{name}: {runs} at seed {seed}, compared with the first\n\n{}",
                comparison.to_text()
            )
        }
        Format::Markdown => comparison.to_markdown(),
        Format::Csv => comparison.to_csv(),
    };
    target.write(&text, terminal)?;
    // That a combination falls is what the table tells, not a failure of it.
    Ok(if comparison.interrupted {
        Exit::Interrupted
    } else {
        Exit::Done
    })
}

/// What is wrong with a name of `--controllers`.
fn tell_name(error: &CompareError, typed: &str) -> Failure {
    let diagnostic = Diagnostic::error(format!("invalid --controllers {typed}: {error}"));
    Failure::usage(match error {
        CompareError::Ambiguous(name) => diagnostic.help(format!(
            "write {name}+ for the path follower, +{name} for the balance law"
        )),
        _ => diagnostic,
    })
}

/// What is wrong with a comparison that did not begin.
fn tell(loaded: &Loaded, error: CompareError, known: &Known) -> Failure {
    let help = match &error {
        CompareError::Sweep(SweepError::Scenario(error)) => {
            return Failure::usage(loaded.tell(error));
        }
        CompareError::Sweep(SweepError::Threads(_)) => {
            return Failure::io(Diagnostic::error(error.to_string()));
        }
        CompareError::Alone => {
            format!(
                "name several of --plants {} or --controllers, path followers {} and balance laws {}",
                known.plants.join(","),
                known.followers.join(","),
                known.balance_laws.join(",")
            )
        }
        CompareError::TooMany(_) => "name fewer plants or controllers".to_owned(),
        _ => String::new(),
    };
    if let CompareError::Sweep(SweepError::Setup(error)) = error {
        return loaded.tell_setup(error, &std::collections::BTreeMap::new());
    }
    let diagnostic = Diagnostic::error(error.to_string());
    Failure::usage(if help.is_empty() {
        diagnostic
    } else {
        diagnostic.help(help)
    })
}
