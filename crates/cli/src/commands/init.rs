//! `bikebot init`: a commented scenario to start from.

use std::path::PathBuf;

use clap::Args;

use crate::args::Force;
use crate::exit::{Ending, Exit};
use crate::output::{Output, make_folder};
use crate::terminal::Terminal;

/// The scenario it writes.
pub const TEMPLATE: &str = include_str!("../../templates/scenario.toml");

/// Write a commented scenario to start from
///
/// Writes scenario.toml, which runs as it is: a map of shapes, a start, a goal,
/// and the keys most people change, each explained.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot init                    # scenario.toml in this folder
  bikebot init first-ride         # the same in a new folder
  bikebot run scenario.toml")]
pub struct InitArgs {
    /// Folder to write to; made if it is not there
    #[arg(value_name = "DIR", default_value = ".")]
    pub dir: PathBuf,
    #[command(flatten)]
    pub force: Force,
}

/// Writes it, and says what to do next.
pub fn run(args: &InitArgs, terminal: &Terminal) -> Ending {
    make_folder(&args.dir)?;
    let path = if args.dir.as_os_str() == "." {
        PathBuf::from("scenario.toml")
    } else {
        args.dir.join("scenario.toml")
    };
    let path = Output::create(&path, args.force.force)?.write_all(TEMPLATE.as_bytes())?;
    terminal.print(&format!("wrote {}\n", path.display()))?;
    terminal.remark(&format!("next: bikebot run {}", path.display()));
    Ok(Exit::Done)
}
