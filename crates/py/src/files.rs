//! Files, read with an eye on what they are.

use std::path::Path;

use pyo3::prelude::*;

use crate::errors;

/// Largest file that is read, bytes.
const MAX_BYTES: u64 = 1 << 30;

/// The bytes of a regular file; the error in one sentence.
pub fn read_plain(path: &Path) -> Result<Vec<u8>, String> {
    let facts = std::fs::metadata(path).map_err(|error| plain(&error))?;
    if facts.is_dir() {
        return Err("it is a folder".into());
    }
    if !facts.is_file() {
        return Err("it is not a regular file".into());
    }
    if facts.len() > MAX_BYTES {
        return Err(format!(
            "it has {} bytes, more than the {MAX_BYTES} that are read",
            facts.len()
        ));
    }
    std::fs::read(path).map_err(|error| plain(&error))
}

/// The bytes of a regular file, or `OSError`.
pub fn read(path: &Path) -> PyResult<Vec<u8>> {
    match std::fs::metadata(path) {
        Err(error) => Err(errors::file(path, error)),
        Ok(_) => read_plain(path).map_err(|why| {
            pyo3::exceptions::PyOSError::new_err(format!("cannot read {}: {why}", path.display()))
        }),
    }
}

/// What the system said, without its number.
fn plain(error: &std::io::Error) -> String {
    let text = error.to_string();
    match text.split_once(" (os error") {
        Some((text, _)) => text.to_owned(),
        None => text,
    }
}
