//! One file per verb: its flags, and what it does.

pub mod check;
pub mod completions;
pub mod explain;
pub mod info;
pub mod init;
pub mod log;
pub mod map;
pub mod plan;
pub mod run;
pub mod schema;
pub mod sweep;

use std::process::ExitCode;

use clap::error::ErrorKind;

use crate::exit::Exit;

/// Ends after a command line that was not understood, or that asked for help.
pub fn usage(error: &clap::Error) -> ExitCode {
    let exit = match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => Exit::Done,
        _ => Exit::Usage,
    };
    // A closed pipe ends `bikebot --help | head -1`; there is nobody to tell.
    let _ = error.print();
    exit.into()
}
