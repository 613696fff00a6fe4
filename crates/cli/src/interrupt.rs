//! Ctrl-C: the first asks the work to stop, so that files are closed and
//! readable; the second kills.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::diag::Diagnostic;
use crate::exit::{Exit, Failure};

static ASKED: AtomicBool = AtomicBool::new(false);
static INSTALLED: OnceLock<()> = OnceLock::new();

/// From now on Ctrl-C (and a polite kill: SIGTERM, SIGHUP) sets a flag. Called
/// only by verbs that look at it, before they open what they write: a signal finds
/// either no file or someone who clears it away. The others may simply be killed.
pub fn install() -> Result<(), Failure> {
    if INSTALLED.set(()).is_err() {
        return Ok(());
    }
    ctrlc::set_handler(|| {
        if ASKED.swap(true, Ordering::SeqCst) {
            std::process::exit(i32::from(Exit::Interrupted.code()));
        }
    })
    .map_err(|error| {
        Failure::io(Diagnostic::error(format!(
            "cannot watch for Ctrl-C: {error}"
        )))
    })
}

/// Whether the user asked to stop.
pub fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}
