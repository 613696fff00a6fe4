//! Exceptions: `bikebot.BikebotError` and its kinds live in `bikebot/_errors.py`; here they are filled.

use std::path::Path;

use bikebot_planner::PlanError;
use bikebot_sim::plan_file::reason_of;
use bikebot_sim::{Error, ScenarioError, SetupError};
use bikebot_world::formats::MapError;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// An exception of the class `name`; where even that fails, what failed.
fn make(py: Python<'_>, name: &str, message: &str, facts: &Bound<'_, PyDict>) -> PyErr {
    let made = py
        .import("bikebot._errors")
        .and_then(|module| module.getattr(name))
        .and_then(|class| class.call((message,), Some(facts)));
    match made {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

/// `BikebotError`.
pub fn bikebot(py: Python<'_>, message: &str) -> PyErr {
    make(py, "BikebotError", message, &PyDict::new(py))
}

/// A dictionary of what is known, for the keywords of an exception.
macro_rules! facts {
    ($py:expr, $($name:ident = $value:expr),+ $(,)?) => {{
        let facts = PyDict::new($py);
        let filled: PyResult<()> = (|| {
            $( facts.set_item(stringify!($name), $value)?; )+
            Ok(())
        })();
        match filled {
            Ok(()) => facts,
            Err(error) => return error,
        }
    }};
}

/// `ScenarioError` for a scenario `file` with this `text`.
pub fn scenario(py: Python<'_>, error: &ScenarioError, file: Option<&str>, text: &str) -> PyErr {
    let at = error.span.as_ref().filter(|span| span.start <= text.len());
    let before = at.and_then(|span| text.get(..span.start));
    let line = before.map(|before| before.matches('\n').count() + 1);
    let column = before.map(|before| before.rsplit('\n').next().unwrap_or("").chars().count() + 1);
    let facts = facts!(
        py,
        file = file,
        line = line,
        column = column,
        key = error.key.as_deref(),
        change = error
            .from_override
            .as_deref()
            .map(|change| change.trim_start_matches("--set ")),
        help = error.help.as_deref(),
    );
    make(py, "ScenarioError", &error.message, &facts)
}

/// `ScenarioError` without a place.
pub fn bad_scenario(py: Python<'_>, message: &str, help: &str) -> PyErr {
    let facts = facts!(py, help = help);
    make(py, "ScenarioError", message, &facts)
}

/// `MapError` or `ScenarioError`.
pub fn setup(py: Python<'_>, error: &SetupError, file: Option<&str>, text: &str) -> PyErr {
    match error {
        SetupError::Scenario(error) => scenario(py, error, file, text),
        SetupError::Map { error, .. } => map(py, error),
    }
}

/// `MapError`.
pub fn map(py: Python<'_>, error: &MapError) -> PyErr {
    let facts = facts!(
        py,
        file = error.file.as_str(),
        line = error.line,
        key = error.key.as_deref(),
    );
    make(py, "MapError", &error.problem.to_string(), &facts)
}

/// `MapError` for what was given as arrays or shapes.
pub fn bad_world(py: Python<'_>, message: &str) -> PyErr {
    make(py, "MapError", message, &PyDict::new(py))
}

/// `PlanError`.
pub fn plan(py: Python<'_>, error: &PlanError) -> PyErr {
    let facts = facts!(py, reason = reason_of(error));
    make(py, "PlanError", &error.to_string(), &facts)
}

/// `PlanError` or `BikebotError`: a run that makes no sense.
pub fn run(py: Python<'_>, error: &Error) -> PyErr {
    match error {
        Error::Plan(error) => plan(py, error),
        other => bikebot(py, &other.to_string()),
    }
}

/// `OSError` of the operating system, naming the file.
pub fn file(path: &Path, error: std::io::Error) -> PyErr {
    let code = error.raw_os_error();
    match code {
        // Python makes FileNotFoundError, PermissionError, … of it.
        Some(code) => pyo3::exceptions::PyOSError::new_err((
            code,
            error.to_string(),
            path.display().to_string(),
        )),
        None => pyo3::exceptions::PyOSError::new_err(format!("{}: {error}", path.display())),
    }
}

/// `ValueError`.
pub fn value(message: impl Into<String>) -> PyErr {
    PyValueError::new_err(message.into())
}

/// `TypeError`.
pub fn kind(message: impl Into<String>) -> PyErr {
    PyTypeError::new_err(message.into())
}
