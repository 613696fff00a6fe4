//! Verbs whose result is one table: how it is written, and where to.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::args::Force;
use crate::exit::Failure;
use crate::output::Output;
use crate::render;
use crate::terminal::Terminal;

/// How to write the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Aligned columns, for people.
    Text,
    /// A table in Markdown.
    Markdown,
    /// One line per run or row.
    Csv,
    /// One object.
    Json,
}

/// The flags that say how a table is written, and where to.
#[derive(Debug, Args)]
pub struct TableArgs {
    /// How to write the table
    #[arg(
        long,
        value_name = "FORMAT",
        default_value = "text",
        hide_possible_values = true,
        help = "How to write the table: text, markdown, csv or json"
    )]
    format: Format,
    /// The same as --format json
    #[arg(long, conflicts_with = "format")]
    json: bool,
    /// Write the table to this file
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

impl TableArgs {
    /// The format asked for.
    pub fn format(&self) -> Format {
        if self.json { Format::Json } else { self.format }
    }

    /// Opens what the table goes to, before the work: a name that is taken is told at once.
    pub fn open(&self) -> Result<Target, Failure> {
        let output = self.output.as_ref();
        let output = output.map(|path| Output::create(path, self.force.force));
        Ok(Target(output.transpose()?))
    }
}

/// Where a table goes: a file, or else standard output.
#[derive(Debug)]
pub struct Target(Option<Output>);

impl Target {
    /// Writes the whole table, and says which file it went to.
    pub fn write(self, table: &str, terminal: &Terminal) -> Result<(), Failure> {
        match self.0 {
            Some(output) => {
                let path = output.write_all(table.as_bytes())?;
                terminal.remark(&format!("wrote {}", render::path(&path)));
                Ok(())
            }
            None => terminal.print(table),
        }
    }
}
