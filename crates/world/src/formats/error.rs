//! What is wrong with a map file, where, and what would be right.

use std::fmt;

use crate::error::WorldError;

/// A map that cannot be used: which file, where in it, what was found, what would do.
///
/// Its display is one line, `file:line: key: problem`, ready for a person.
#[derive(Debug, Clone, PartialEq)]
pub struct MapError {
    /// Name of the file as it was given or as the map names it.
    pub file: String,
    /// Line in the file, from 1, where there are lines.
    pub line: Option<usize>,
    /// The key concerned, where there are keys.
    pub key: Option<String>,
    /// What is wrong.
    pub problem: MapProblem,
}

impl MapError {
    pub(crate) fn new(file: &str, problem: MapProblem) -> Self {
        Self {
            file: file.to_owned(),
            line: None,
            key: None,
            problem,
        }
    }

    pub(crate) fn at_line(file: &str, line: usize, problem: MapProblem) -> Self {
        Self {
            line: Some(line),
            ..Self::new(file, problem)
        }
    }

    pub(crate) fn at_key(file: &str, line: usize, key: &str, problem: MapProblem) -> Self {
        Self {
            key: Some(shorten(key)),
            ..Self::at_line(file, line, problem)
        }
    }
}

impl fmt::Display for MapError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if let Some(key) = &self.key {
            write!(f, ": `{key}`")?;
        }
        write!(f, ": {}", self.problem)
    }
}

impl std::error::Error for MapError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match &self.problem {
            MapProblem::World(e) => Some(e),
            _ => None,
        }
    }
}

/// What is wrong with a map file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MapProblem {
    /// A file the map names could not be read.
    #[error("cannot read \"{named}\": {reason}")]
    Unreadable {
        /// As the map names it.
        named: String,
        /// What the reader said.
        reason: String,
    },
    /// The bytes are of no kind this program reads.
    #[error(
        "not a map this program reads ({found}); it reads map_server .yaml with PGM, PNG or BMP, bare .pgm/.png/.bmp, MovingAI .map, scene .json and text pictures .txt"
    )]
    UnknownKind {
        /// What the file looks like.
        found: String,
    },
    /// More bytes than a file of this kind may have.
    #[error("{found} bytes are too many, at most {limit} are read")]
    TooManyBytes {
        /// Bytes found.
        found: usize,
        /// Bytes allowed.
        limit: usize,
    },
    /// A map larger than can be held.
    #[error("{width} x {height} cells are too many: at most 16384 a side and 67108864 in all")]
    TooManyCells {
        /// Cells or pixels across.
        width: u64,
        /// Cells or pixels down.
        height: u64,
    },
    /// The file ends before its own header says it should.
    #[error("the file ends too early: {expected} bytes of {what} expected, {found} found")]
    Short {
        /// Which part is short.
        what: &'static str,
        /// Bytes the header promises.
        expected: u64,
        /// Bytes there are.
        found: u64,
    },
    /// A row with more or fewer cells than the rest.
    #[error("a row of {expected} cells expected, {found} found")]
    RowLength {
        /// Cells expected.
        expected: usize,
        /// Cells found.
        found: usize,
    },
    /// A character that stands for no kind of cell.
    #[error("column {column}: {found:?} is no cell; expected {expected}")]
    Character {
        /// Column, from 1.
        column: usize,
        /// The character.
        found: char,
        /// The cells there are.
        expected: &'static str,
    },
    /// A key that must be there is not.
    #[error("missing; write for example {example}")]
    Missing {
        /// A line that would do.
        example: &'static str,
    },
    /// A key given twice.
    #[error("given twice, first in line {first}; keep one")]
    Duplicate {
        /// Line of the first.
        first: usize,
    },
    /// A value that cannot be used.
    #[error("found {found}, expected {expected}")]
    Malformed {
        /// What the file says.
        found: String,
        /// What would do.
        expected: String,
    },
    /// A JSON file that does not hold what it should.
    #[error("{problem}; expected {expected}")]
    Json {
        /// What the JSON reader says.
        problem: String,
        /// What would do.
        expected: &'static str,
    },
    /// Something the format allows and this program does not read.
    #[error("{found} is not read; {instead}")]
    Unsupported {
        /// What was met.
        found: String,
        /// What to do instead.
        instead: &'static str,
    },
    /// The format does not say how large a cell is.
    #[error(
        "the format does not say how large a cell is; give `meters_per_cell` in the scenario's [map] (flag --meters-per-cell)"
    )]
    MissingCellSize,
    /// The map was read, but is no world.
    #[error(transparent)]
    World(#[from] WorldError),
}

/// Untrusted text for a message: at most 60 characters, control characters escaped.
pub(crate) fn shorten(text: &str) -> String {
    let mut short: String = text
        .chars()
        .take(60)
        .map(|c| {
            if c.is_control() {
                c.escape_debug().to_string()
            } else {
                c.to_string()
            }
        })
        .collect();
    if text.chars().nth(60).is_some() {
        short.push('…');
    }
    short
}

/// The same in quotation marks.
pub(crate) fn quoted(text: &str) -> String {
    format!("\"{}\"", shorten(text))
}
