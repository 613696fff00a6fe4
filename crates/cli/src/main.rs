//! `bikebot`, the command line: reads files, shows results, decides exit codes.
//! All thinking is done by the libraries below.

#![cfg_attr(not(test), warn(clippy::unwrap_used, clippy::expect_used))]

mod args;
mod commands;
mod diag;
mod exit;
mod in_order;
mod input;
mod interrupt;
mod output;
mod picture;
mod plan_text;
mod progress;
mod recording;
mod reference;
mod render;
mod stopwatch;
mod table;
mod terminal;

use std::io;
use std::process::ExitCode;

use clap::Parser;
use tracing_subscriber::EnvFilter;

use crate::args::{Cli, Common, LogVerb, MapVerb, Verb};
use crate::diag::Diagnostic;
use crate::exit::Ending;
use crate::terminal::Terminal;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return commands::usage(&error),
    };
    let terminal = Terminal::new(&cli.common);
    log_to_stderr(&cli.common, &terminal);
    match dispatch(&cli.verb, &terminal) {
        Ok(exit) => exit.into(),
        Err(failure) => {
            if let Some(diagnostic) = failure.diagnostic() {
                terminal.show(diagnostic);
            }
            failure.exit().into()
        }
    }
}

fn dispatch(verb: &Verb, terminal: &Terminal) -> Ending {
    match verb {
        Verb::Run(args) => commands::run::run(args, terminal),
        Verb::Plan(args) => commands::plan::run(args, terminal),
        Verb::Verify(args) => commands::verify::run(args, terminal),
        Verb::Table2(args) => commands::table2::run(args, terminal),
        Verb::Reproduce(args) => commands::reproduce::run(args, terminal),
        Verb::Plot(args) => commands::plot::run(args, terminal),
        Verb::Report(args) => commands::report::run(args, terminal),
        Verb::Sweep(args) => commands::sweep::run(args, terminal),
        Verb::Compare(args) => commands::compare::run(args, terminal),
        Verb::Eigenvalues(args) => commands::eigenvalues::run(args, terminal),
        Verb::Check(args) => commands::check::run(args, terminal),
        Verb::Explain(args) => commands::explain::run(args, terminal),
        Verb::Schema(args) => commands::schema::run(args, terminal),
        Verb::Init(args) => commands::init::run(args, terminal),
        Verb::Map(MapVerb::Info(args)) => commands::map::info(args, terminal),
        Verb::Map(MapVerb::Build(args)) => commands::map_build::run(args, terminal),
        Verb::Info(args) => commands::info::run(args, terminal),
        Verb::Log(LogVerb::Check(args)) => commands::log::check(args, terminal),
        Verb::Log(LogVerb::Recover(args)) => commands::log::recover(args, terminal),
        Verb::Completions(args) => commands::completions::run(args, terminal),
        Verb::Man(args) => commands::man::run(args, terminal),
    }
}

/// `BIKEBOT_LOG` says what to log; without it `-v` and `-q` do.
fn log_to_stderr(common: &Common, terminal: &Terminal) {
    let level = match (common.quiet, common.verbose) {
        (true, _) => "error",
        (false, 0) => "warn",
        (false, 1) => "info",
        (false, _) => "debug",
    };
    let filter = match std::env::var("BIKEBOT_LOG") {
        Ok(asked) if !asked.trim().is_empty() => match EnvFilter::try_new(&asked) {
            Ok(filter) => filter,
            Err(error) => {
                terminal.warn(
                    &Diagnostic::warning(format!(
                        "BIKEBOT_LOG=`{asked}` is not understood: {error}"
                    ))
                    .help("use error, warn, info, debug or trace"),
                );
                EnvFilter::new(level)
            }
        },
        _ => EnvFilter::new(level),
    };
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(io::stderr)
        .with_ansi(terminal.color())
        .without_time()
        .with_target(common.verbose > 1)
        .init();
}
