//! `bikebot explain`: the resolved scenario, and where each value comes from.

use std::fmt::Write as _;

use clap::Args;
use serde_json::json;

use crate::args::{Changes, ScenarioArg};
use crate::exit::{Ending, Exit};
use crate::input::Loaded;
use crate::render;
use crate::terminal::Terminal;

/// Print every value of a scenario, resolved, with where it comes from
///
/// One line for each key: its value, and its origin: a line of the file, --set,
/// a preset, or the default. Keys are written as --set takes them.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot explain scenario.toml
  bikebot explain scenario.toml | grep follow
  bikebot explain scenario.toml --set bike.preset=low_pivot --json")]
pub struct ExplainArgs {
    #[command(flatten)]
    pub scenario: ScenarioArg,
    #[command(flatten)]
    pub changes: Changes,
    /// One JSON object: {"keys": [{"key", "value", "origin"}, …]}
    #[arg(long)]
    pub json: bool,
}

/// Prints it.
pub fn run(args: &ExplainArgs, terminal: &Terminal) -> Ending {
    let loaded = Loaded::read(&args.scenario.scenario, &args.changes)?;
    let rows = loaded.file().explain();
    if args.json {
        let keys: Vec<_> = rows
            .iter()
            .map(
                |row| json!({"key": row.key, "value": row.value, "origin": row.origin.to_string()}),
            )
            .collect();
        terminal.print(&format!("{}\n", json!({ "keys": keys })))?;
        return Ok(Exit::Done);
    }
    let lines: Vec<(String, String)> = rows
        .iter()
        .map(|row| {
            (
                format!("{} = {}", row.key, row.value),
                row.origin.to_string(),
            )
        })
        .collect();
    let mut text = String::new();
    let width = render::column(lines.iter().map(|(line, _)| line.as_str()), 56);
    for (line, origin) in &lines {
        let _ = writeln!(text, "{line:width$}  # {origin}");
    }
    terminal.print(&text)?;
    Ok(Exit::Done)
}
