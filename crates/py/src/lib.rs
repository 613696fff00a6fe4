//! The compiled part of the Python package `bikebot`: conversions between Python and the crates, and nothing else.
//!
//! | module | holds |
//! |---|---|
//! | [`world`], [`plan`], [`planner`], [`scenario`], [`ride`], [`trace`] | the classes of those names |
//! | [`own`] | controllers of the caller's own |
//! | [`gym`] | bikes for `bikebot.gym` |
//! | [`study`] | Table 2, eigenvalues, the chunks of a sweep |
//! | [`picture`] | colours and outlines for `bikebot.plot` |
//! | [`search`] | a question to the planner, from arguments to a report |
//! | [`arguments`], [`toml_value`], [`files`] | what comes in, checked |
//! | [`arrays`], [`json`], [`errors`] | what goes out |
//! | [`work`] | the interpreter's lock, Ctrl-C, progress, panics |
//!
//! What people see is `python/bikebot`; docstrings here are what `help` shows.

#![cfg_attr(not(test), warn(clippy::unwrap_used, clippy::expect_used))]

mod arguments;
mod arrays;
mod errors;
mod files;
mod gym;
mod json;
mod own;
mod picture;
mod plan;
mod planner;
mod ride;
mod scenario;
mod search;
mod study;
mod toml_value;
mod trace;
mod work;
mod world;

use pyo3::prelude::*;

/// The compiled part of `bikebot`; use the names of the package itself.
#[pymodule]
mod _bikebot {
    use super::*;

    #[pymodule_export]
    use super::gym::PyBikes;
    #[pymodule_export]
    use super::own::{PyBalancerView, PyFollowerView};
    #[pymodule_export]
    use super::picture::{_name_of_key, _outline, _palette};
    #[pymodule_export]
    use super::plan::PyPlan;
    #[pymodule_export]
    use super::planner::{PyPlanner, Refinement, plan};
    #[pymodule_export]
    use super::ride::{PyRide, read_log};
    #[pymodule_export]
    use super::scenario::PyScenario;
    #[pymodule_export]
    use super::study::{
        _check_cases, _eigenvalues, _metric_names, _panic, _run_cases, _table2, _toml,
    };
    #[pymodule_export]
    use super::trace::PyTrace;
    #[pymodule_export]
    use super::world::PyWorld;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", bikebot_sim::VERSION)
    }
}
