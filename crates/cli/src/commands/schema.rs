//! `bikebot schema`: the JSON Schema of scenario files.

use clap::{Args, ValueEnum};

use crate::exit::{Ending, Exit};
use crate::reference;
use crate::terminal::Terminal;

/// Print the JSON Schema of scenario files, for editors
///
/// Editors that know TOML schemas (Even Better TOML, taplo) complete and check
/// scenarios with it: `#:schema scenario.schema.json` as the first line of a scenario.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot schema > scenario.schema.json
  bikebot schema | jq '.properties | keys'
  bikebot schema --format markdown > scenario-reference.md")]
pub struct SchemaArgs {
    /// How to write it
    #[arg(
        long,
        value_name = "FORMAT",
        default_value = "json",
        hide_possible_values = true,
        help = "How to write it: json, or markdown for people"
    )]
    pub format: SchemaFormat,
}

/// How to write the schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SchemaFormat {
    /// JSON Schema, for editors.
    Json,
    /// Tables of all keys, for people.
    Markdown,
}

/// Prints it.
pub fn run(args: &SchemaArgs, terminal: &Terminal) -> Ending {
    let schema = bikebot_sim::json_schema();
    terminal.print(&match args.format {
        SchemaFormat::Json => format!("{schema:#}\n"),
        SchemaFormat::Markdown => reference::markdown(&schema),
    })?;
    Ok(Exit::Done)
}
