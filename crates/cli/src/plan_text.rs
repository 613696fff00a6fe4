//! Plan files as text, and what is wrong with them.

use std::path::Path;

use bikebot_report::ReportError;

use crate::diag::Diagnostic;
use crate::exit::Failure;
use crate::input;

/// Largest plan file that is read, bytes.
const MAX_PLAN_BYTES: u64 = 1 << 30;

/// Reads a plan file; `is_what` says what a file is that cannot be one, `takes` what would do.
pub fn read(path: &Path, is_what: &str, takes: &str) -> Result<String, Failure> {
    String::from_utf8(input::read(path, MAX_PLAN_BYTES)?).map_err(|_| {
        Failure::usage(
            Diagnostic::error(format!("{} is {is_what}", path.display()))
                .note("a byte of it is not UTF-8")
                .help(format!(
                    "it takes a plan.json as written by `bikebot plan -o`{takes}"
                )),
        )
    })
}

/// What is wrong with a plan file.
pub fn tell(error: &ReportError, place: &str, text: &str) -> Failure {
    let line = match error {
        ReportError::NotJson { line, .. } => Some(*line),
        ReportError::NotAPlan { line, .. } => *line,
        _ => None,
    };
    let diagnostic = Diagnostic::error(error.to_string());
    // A line of a plan may be the whole plan: shown only where it is short.
    let shown = line.and_then(|line| text.lines().nth(line - 1));
    let diagnostic = match (line, shown) {
        (Some(line), Some(content)) if content.len() < 120 => {
            match input::span_of_line(text, line) {
                Some(span) => diagnostic.at_span(place, text, span),
                None => diagnostic.at_line(place, Some(line)),
            }
        }
        _ => diagnostic.at_line(place, line),
    };
    Failure::usage(diagnostic.help("it takes a plan as written by `bikebot plan -o plan.json`"))
}
