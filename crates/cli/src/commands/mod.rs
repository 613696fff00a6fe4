//! One file per verb: its flags, and what it does.

pub mod check;
pub mod compare;
pub mod completions;
pub mod eigenvalues;
pub mod envelope;
pub mod explain;
pub mod info;
pub mod init;
pub mod live;
pub mod log;
pub mod man;
pub mod map;
pub mod map_build;
pub mod plan;
pub mod plot;
pub mod report;
pub mod reproduce;
pub mod run;
pub mod schema;
pub mod sweep;
pub mod table2;
pub mod verify;

use std::io::{self, Write};
use std::process::ExitCode;

use clap::error::{ContextKind, ErrorKind};

use crate::exit::Exit;

/// Ends after a command line that was not understood, or that asked for help.
pub fn usage(error: &clap::Error) -> ExitCode {
    let exit = match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => Exit::Done,
        _ => Exit::Usage,
    };
    // A closed pipe ends `bikebot --help | head -1`; there is nobody to tell.
    let _ = error.print();
    let is_of_seed = error
        .get(ContextKind::InvalidArg)
        .is_some_and(|argument| argument.to_string().starts_with("--seed"));
    if is_of_seed && !std::env::args().any(|word| word.starts_with("--seed")) {
        let _ = writeln!(
            io::stderr().lock(),
            "\nThe value is that of the environment's BIKEBOT_SEED."
        );
    }
    exit.into()
}
