//! How a verb ends: every exit code of the program is decided in this file.

use std::io;
use std::path::Path;
use std::process::ExitCode;

use crate::diag::Diagnostic;

/// The exit codes, as printed by `bikebot --help`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Done: arrived, found, or every expectation and check holds.
    Done,
    /// It ran, but ended otherwise than asked for.
    NotReached,
    /// Bad usage, scenario or map.
    Usage,
    /// Input or output failed, or a log was saved with losses.
    Io,
    /// Stopped by Ctrl-C; what was written is closed and readable.
    Interrupted,
}

impl Exit {
    /// The number handed to the shell.
    pub const fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::NotReached => 1,
            Self::Usage => 2,
            Self::Io => 3,
            Self::Interrupted => 130,
        }
    }

    /// The graver of two endings: their order above is that of gravity.
    #[must_use]
    pub fn max_of(self, other: Self) -> Self {
        if other.code() > self.code() {
            other
        } else {
            self
        }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        ExitCode::from(exit.code())
    }
}

/// Why a verb could not do what was asked: what to tell, and the code.
#[derive(Debug)]
pub enum Failure {
    /// Bad usage, scenario or map (2).
    Usage(Box<Diagnostic>),
    /// A file could not be read or written (3).
    Io(Box<Diagnostic>),
    /// Whoever read our standard output went away: quietly done (0).
    ReaderGone,
}

impl Failure {
    /// Bad usage, told by `diagnostic`.
    pub fn usage(diagnostic: Diagnostic) -> Self {
        Self::Usage(Box::new(diagnostic))
    }

    /// Failed input or output, told by `diagnostic`.
    pub fn io(diagnostic: Diagnostic) -> Self {
        Self::Io(Box::new(diagnostic))
    }

    /// `path` could not be `verb` ("read", "write", "create").
    pub fn file(verb: &str, path: &Path, error: &io::Error) -> Self {
        Self::io(Diagnostic::error(format!(
            "cannot {verb} {}: {}",
            path.display(),
            plain(error)
        )))
    }

    /// Standard output failed.
    pub fn stdout(error: &io::Error) -> Self {
        if error.kind() == io::ErrorKind::BrokenPipe {
            Self::ReaderGone
        } else {
            Self::io(Diagnostic::error(format!(
                "cannot write to standard output: {}",
                plain(error)
            )))
        }
    }

    /// The code this failure ends with.
    pub const fn exit(&self) -> Exit {
        match self {
            Self::Usage(_) => Exit::Usage,
            Self::Io(_) => Exit::Io,
            Self::ReaderGone => Exit::Done,
        }
    }

    /// What to print, if anything.
    pub fn diagnostic(&self) -> Option<&Diagnostic> {
        match self {
            Self::Usage(diagnostic) | Self::Io(diagnostic) => Some(diagnostic),
            Self::ReaderGone => None,
        }
    }
}

/// What every verb returns.
pub type Ending = Result<Exit, Failure>;

/// The cause in plain words, the same on every platform where the kind is
/// known; "(os error 2)" helps nobody.
pub fn plain(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "no such file or folder".into(),
        io::ErrorKind::PermissionDenied => "permission denied".into(),
        io::ErrorKind::IsADirectory => "it is a folder".into(),
        io::ErrorKind::NotADirectory => "a part of the path is not a folder".into(),
        io::ErrorKind::StorageFull => "the disk is full".into(),
        io::ErrorKind::FileTooLarge => "the file may not grow any larger".into(),
        io::ErrorKind::ReadOnlyFilesystem => "the file system is read-only".into(),
        io::ErrorKind::InvalidFilename => "the name is too long or not allowed".into(),
        _ => {
            let text = error.to_string();
            match text.rfind(" (os error") {
                Some(end) => text[..end].to_lowercase(),
                None => text,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_closed_pipe_ends_quietly_with_success() {
        let failure = Failure::stdout(&io::Error::from(io::ErrorKind::BrokenPipe));
        assert_eq!(failure.exit().code(), 0);
        assert!(failure.diagnostic().is_none());
    }

    #[test]
    fn causes_carry_no_error_numbers() {
        for number in 1..40 {
            let text = plain(&io::Error::from_raw_os_error(number));
            assert!(!text.contains("os error"), "{number}: {text}");
        }
    }
}
