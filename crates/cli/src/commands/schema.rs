//! `bikebot schema`: the JSON Schema of scenario files.

use clap::Args;

use crate::exit::{Ending, Exit};
use crate::terminal::Terminal;

/// Print the JSON Schema of scenario files, for editors
///
/// Editors that know TOML schemas (Even Better TOML, taplo) complete and check
/// scenarios with it.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot schema > scenario.schema.json
  then, as the first line of a scenario:  #:schema scenario.schema.json")]
pub struct SchemaArgs {}

/// Prints it.
pub fn run(_: &SchemaArgs, terminal: &Terminal) -> Ending {
    terminal.print(&format!("{:#}\n", bikebot_sim::json_schema()))?;
    Ok(Exit::Done)
}
