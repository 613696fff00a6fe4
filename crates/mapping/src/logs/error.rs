//! What is wrong with a scan log, where, and what would be right.

use std::fmt;

use crate::error::MappingError;

/// A log that cannot be used. Its display is one line, `file:line: problem`, ready for a person.
#[derive(Debug, Clone, PartialEq)]
pub struct LogError {
    /// Name of the file as it was given.
    pub file: String,
    /// Line in the file, from 1, where it is about a line.
    pub line: Option<usize>,
    /// What is wrong.
    pub problem: LogProblem,
}

impl LogError {
    pub(super) fn new(file: &str, line: Option<usize>, problem: LogProblem) -> Self {
        Self {
            file: file.to_owned(),
            line,
            problem,
        }
    }
}

impl fmt::Display for LogError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        write!(f, ": {}", self.problem)
    }
}

impl std::error::Error for LogError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match &self.problem {
            LogProblem::Map(error) => Some(error),
            _ => None,
        }
    }
}

/// What is wrong with a scan log.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LogProblem {
    /// More bytes than a log may have.
    #[error("{found} bytes are too many, at most {limit} are read")]
    TooManyBytes {
        /// Bytes found.
        found: usize,
        /// Bytes allowed.
        limit: usize,
    },
    /// Not a text file.
    #[error(
        "found bytes that are no text; a BreezySLAM or CARMEN log in plain text is read (unpack .gz first)"
    )]
    NotText,
    /// Blank lines and comments only.
    #[error("there is nothing in it; a BreezySLAM or CARMEN log is read")]
    Empty,
    /// Neither of the formats.
    #[error(
        "not a log this program reads: the first line of a BreezySLAM or CARMEN log begins with a time in microseconds or with a word like FLASER"
    )]
    UnknownFormat,
    /// A largest range that makes no sense.
    #[error("a largest range of {found} m; it must lie above 0.02 m and be at most 10000 m")]
    MaxRange {
        /// The range given, m.
        found: f64,
    },
    /// A line with fewer fields than it needs.
    #[error("the line ends after {found} fields, {expected} are needed: {what}")]
    CutShort {
        /// Fields there are.
        found: usize,
        /// Fields needed.
        expected: usize,
        /// Which fields those are.
        what: String,
    },
    /// A line with more fields than it announces.
    #[error(
        "the line has {found} fields, where {beams} ranges make {expected}: the number of ranges is wrong"
    )]
    TooManyFields {
        /// Fields there are.
        found: usize,
        /// Fields expected.
        expected: usize,
        /// Ranges announced.
        beams: usize,
    },
    /// A scan with another number of ranges than the first.
    #[error("{found} ranges, where the first scan (line {first_line}) has {expected}")]
    RangeCount {
        /// Ranges there are.
        found: usize,
        /// Ranges of the first scan.
        expected: usize,
        /// Line of the first scan.
        first_line: usize,
    },
    /// A field that is not the number it should be.
    #[error("field {field} is \"{found}\", expected {expected}")]
    Field {
        /// Which field of the line, from 1.
        field: usize,
        /// What stands there.
        found: String,
        /// What would do.
        expected: &'static str,
    },
    /// A scan of no beams.
    #[error("a scan of no ranges; at least one is needed")]
    NoBeams,
    /// A scan of more beams than any device has.
    #[error("a scan of {found} ranges; at most 100000 are read")]
    TooManyBeams {
        /// Ranges announced.
        found: usize,
    },
    /// Wheels that have turned farther than any robot rides.
    #[error("the wheel counts carry the robot to ({x:.1} m, {y:.1} m), beyond ±1e6 m")]
    Strayed {
        /// m.
        x: f64,
        /// m.
        y: f64,
    },
    /// A time before the one before it.
    #[error("the time {time} s comes after {last} s (line {last_line}); times must not go back")]
    TimeWentBack {
        /// The time, s.
        time: f64,
        /// The one before, s.
        last: f64,
        /// Where that stood.
        last_line: usize,
    },
    /// No scan at all.
    #[error("there is no scan in it; expected {expected}")]
    NoScans {
        /// What a scan looks like.
        expected: &'static str,
    },
    /// Cells of a size that no map has.
    #[error("cells of {found} m; their side must be 0.001 to 100 m")]
    Resolution {
        /// Side of a cell, m.
        found: f64,
    },
    /// A map too large to be held.
    #[error(
        "the scans cover {width:.1} m by {height:.1} m, which at {resolution} m per cell is more than 16384 cells a side or 67108864 in all; take larger cells"
    )]
    TooLarge {
        /// m.
        width: f64,
        /// m.
        height: f64,
        /// m per cell.
        resolution: f64,
    },
    /// No map can be made with these parameters.
    #[error(transparent)]
    Map(#[from] MappingError),
}

/// Untrusted text for a message: at most 40 characters, control characters escaped.
pub(super) fn shorten(text: &str) -> String {
    let mut short: String = text.chars().take(40).flat_map(char::escape_debug).collect();
    if text.chars().nth(40).is_some() {
        short.push('…');
    }
    short
}
