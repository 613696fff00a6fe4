//! Scenario, closed loop, recorder, sweeps: the room where planner, dynamics and control meet.
//!
//! ```text
//! text ─▶ ScenarioFile ─▶ Setup ─▶ run ─▶ RunReport
//!                                   └──▶ Recorder (events)
//! ```
//!
//! [`scenario::ScenarioFile`] is what was written, [`setup::Setup`] what it means, and
//! [`closed_loop::run`] plays it. Nothing here opens a file, prints, or reads a clock: the caller
//! lends what is needed.

#![cfg_attr(not(test), warn(clippy::unwrap_used, clippy::expect_used))]

mod chance;
pub mod clock;
pub mod closed_loop;
pub mod disturbance;
pub mod episode;
mod error;
pub mod fall_cause;
pub mod monitor;
pub mod online;
pub mod outcome;
pub mod path_file;
mod picture;
mod pilot;
pub mod plan_file;
pub mod record;
pub mod refit;
mod ride_metrics;
pub mod scenario;
pub mod setup;
pub mod study;
pub mod sweep;
pub mod traffic;
mod true_bike;
pub mod true_plant;
pub mod true_scene;

/// Controllers from outside, for [`run_with`].
pub use bikebot_control::external;
pub use closed_loop::{Progress, RunControl, RunReport, plan, run, run_with};
pub use error::Error;
pub use outcome::{Expect, ExpectCheck, Metrics, RunOutcome};
pub use scenario::{Override, Scenario, ScenarioError, ScenarioFile, json_schema};
pub use setup::{Setup, SetupError};

/// Version of the program, as written into recordings.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
