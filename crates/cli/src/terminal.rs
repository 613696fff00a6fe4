//! The three streams a user sees: results on standard output, warnings and
//! errors on standard error, and a progress bar where someone is watching.

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::args::{ColorChoice, Common};
use crate::diag::Diagnostic;
use crate::exit::Failure;

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

    /// A progress bar over `length` steps, hidden unless stderr is a terminal.
    pub fn progress(&self, length: u64, what: &'static str) -> ProgressBar {
        if !self.progress {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new(length).with_message(what);
        let template = "{msg:10} [{bar:30}] {percent:>3} %  {elapsed}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.enable_steady_tick(Duration::from_millis(200));
        bar
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
