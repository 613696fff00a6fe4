//! The three streams a user sees: results on standard output, warnings and
//! errors on standard error, and a progress bar where someone is watching.

use std::io::{self, IsTerminal, Write};

use serde::Serialize;

use crate::args::{ColorChoice, Common};
use crate::diag::Diagnostic;
use crate::exit::Failure;
use crate::progress::Rows;

/// Where and how to write, decided once from the flags and the environment.
#[derive(Debug)]
pub struct Terminal {
    color: bool,
    quiet: bool,
    progress: bool,
}

impl Terminal {
    /// Reads the flags, `NO_COLOR`, `TERM`, and whether stderr is a terminal.
    pub fn new(common: &Common) -> Self {
        let watched = io::stderr().is_terminal();
        Self {
            color: use_color(common.color, watched),
            quiet: common.quiet,
            progress: watched && !common.no_progress && !common.quiet,
        }
    }

    /// Whether messages are coloured.
    pub fn color(&self) -> bool {
        self.color
    }

    /// Writes a result to standard output.
    pub fn print(&self, text: &str) -> Result<(), Failure> {
        let mut stdout = io::stdout().lock();
        stdout
            .write_all(text.as_bytes())
            .and_then(|()| stdout.flush())
            .map_err(|error| Failure::stdout(&error))
    }

    /// Writes one line of JSON to standard output.
    pub fn print_json(&self, value: &impl Serialize) -> Result<(), Failure> {
        let mut line = serde_json::to_string(value)
            .map_err(|error| Failure::stdout(&io::Error::other(error)))?;
        line.push('\n');
        self.print(&line)
    }

    /// Shows a warning, unless `--quiet`.
    pub fn warn(&self, diagnostic: &Diagnostic) {
        if !self.quiet {
            self.show(diagnostic);
        }
    }

    /// Shows a diagnostic. A closed standard error has nobody to tell, so the
    /// write's own failure is dropped.
    pub fn show(&self, diagnostic: &Diagnostic) {
        let text = diagnostic.render(self.color);
        let _ = writeln!(io::stderr().lock(), "{text}");
    }

    /// A remark on standard error (where a file went), unless `--quiet`.
    pub fn remark(&self, text: &str) {
        if !self.quiet {
            let _ = writeln!(io::stderr().lock(), "{text}");
        }
    }

    /// Whether somebody watches progress: standard error is a terminal, and not told to be quiet.
    pub fn is_watched(&self) -> bool {
        self.progress
    }

    /// Shows how many of `count` rows are done.
    pub fn rows(&self, count: u64, what: &'static str) -> Rows {
        Rows::begin(self.progress, count, what)
    }
}

/// `--color` first, then <https://no-color.org>, then the terminal itself.
fn use_color(choice: ColorChoice, watched: bool) -> bool {
    let refused = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty())
        || std::env::var_os("TERM").is_some_and(|value| value == "dumb");
    match choice {
        ColorChoice::Always => true,
        ColorChoice::Never => false,
        ColorChoice::Auto => watched && !refused,
    }
}
