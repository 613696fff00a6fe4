//! Opening recordings, and saying what is wrong with them.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use bikebot_sim::record::log::LogError;

use crate::diag::Diagnostic;
use crate::exit::{Failure, plain};

/// Opens a recording for reading.
pub fn open(path: &Path) -> Result<BufReader<File>, Failure> {
    if path.is_dir() {
        return Err(Failure::io(Diagnostic::error(format!(
            "cannot read {}: it is a folder",
            path.display()
        ))));
    }
    match File::open(path) {
        Ok(file) => Ok(BufReader::new(file)),
        Err(error) => Err(Failure::file("read", path, &error)),
    }
}

/// What is wrong with a recording: the file itself, so exit code 3.
pub fn tell(path: &Path, error: &LogError) -> Failure {
    let place = path.display().to_string();
    Failure::io(match error {
        LogError::File(error) => {
            Diagnostic::error(format!("cannot read {place}: {}", plain(error)))
        }
        LogError::NotMcap => Diagnostic::error(format!("{place} is not a recording"))
            .note("a recording is an MCAP file; this one begins with other bytes"),
        LogError::Missing {
            damage: Some(_), ..
        } => Diagnostic::error(error.to_string())
            .at_line(&place, None)
            .help(format!(
                "`bikebot log check {place}` tells what is left of it"
            )),
        LogError::Missing { .. } => Diagnostic::error(error.to_string())
            .at_line(&place, None)
            .help("was it recorded by another program?"),
        _ => Diagnostic::error(error.to_string()).at_line(&place, None),
    })
}
