//! `bikebot check`: is this scenario fit to run?

use clap::Args;

use crate::args::{Changes, ScenarioArg};
use crate::exit::{Ending, Exit};
use crate::input::Loaded;
use crate::terminal::Terminal;

/// Check a scenario and everything it names, without running it
///
/// Reads the scenario and its map, checks every key, range and rate, and that
/// start and goal are free. Prints what it found; exit code 2 says what to mend.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot check scenario.toml
  bikebot check scenario.toml --set bike.mode=balancer")]
pub struct CheckArgs {
    #[command(flatten)]
    pub scenario: ScenarioArg,
    #[command(flatten)]
    pub changes: Changes,
}

/// Checks it.
pub fn run(args: &CheckArgs, terminal: &Terminal) -> Ending {
    let loaded = Loaded::read(&args.scenario.scenario, &args.changes)?;
    let setup = loaded.setup(terminal)?;
    loaded.check_ends(&setup)?;
    terminal.print(&format!("{}: ok\n", loaded.name()))?;
    Ok(Exit::Done)
}
