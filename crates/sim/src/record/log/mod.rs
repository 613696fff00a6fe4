//! What a recording holds, whether it is whole, and what can be saved of it.
//!
//! | question | asked of |
//! |---|---|
//! | what is in it | [`inspect`] |
//! | is it whole, and where not | [`check`] |
//! | save what can be saved | [`recover`] |
//! | run it again | [`read_run`], [`read_attachment`] |
//! | its numbers | [`read_trace`] |
//!
//! All of them take any file at all: what is declared in it is believed only as
//! far as the file reaches, unpacking is limited, and nothing panics.

mod check;
mod info;
mod recover;
mod run;

use std::fmt;
use std::io;

use thiserror::Error;

pub use check::{LogReport, check};
pub use info::{AttachmentInfo, LogInfo, TopicInfo, inspect};
pub use recover::{RecoverReport, recover};
pub use run::{RunSource, read_attachment, read_run, read_trace};

use super::wire::Fault;

/// Why a question about a recording has no answer.
#[derive(Debug, Error)]
pub enum LogError {
    /// The file could not be read (or, by [`recover`], written).
    #[error("the file could not be read or written: {0}")]
    File(#[from] io::Error),
    /// The file is no MCAP file.
    #[error("not an MCAP file: it begins with other bytes")]
    NotMcap,
    /// The container refused what [`recover`] wanted to write.
    #[error("what was saved could not be written: {0}")]
    Container(Box<mcap::McapError>),
    /// The recording carries nothing of that name.
    #[error("the recording has no {what}{}", broken_at(.damage))]
    Missing {
        /// What was looked for.
        what: String,
        /// Where the file is broken, if it is.
        damage: Option<Problem>,
    },
    /// A record of ours does not say what it should.
    #[error("the recording's {record} says {found:?} where {expected} is expected")]
    Unexpected {
        /// Which record and key.
        record: String,
        /// What it says.
        found: String,
        /// What it should say.
        expected: String,
    },
}

fn broken_at(damage: &Option<Problem>) -> String {
    damage
        .as_ref()
        .map_or_else(String::new, |it| format!(" (it is broken {it})"))
}

impl From<mcap::McapError> for LogError {
    fn from(error: mcap::McapError) -> Self {
        match error {
            mcap::McapError::Io(error) => Self::File(error),
            error => Self::Container(Box::new(error)),
        }
    }
}

/// What is wrong, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Bytes from the start of the file to the record, or to the chunk around it.
    pub offset: u64,
    /// What is wrong there.
    pub text: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "at byte {}: {}", self.offset, self.text)
    }
}

impl From<&Fault> for Problem {
    fn from(fault: &Fault) -> Self {
        Self {
            offset: fault.offset,
            text: fault.text.clone(),
        }
    }
}

/// Whether a fault means that this was never an MCAP file.
fn is_foreign(fault: &Fault) -> bool {
    fault.fatal && fault.offset == 0
}
