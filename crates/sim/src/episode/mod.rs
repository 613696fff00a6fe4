//! Episodes: a scenario as a task for whoever learns to ride, one bike or many at once.
//!
//! A [`Course`] is the task with everything that never changes; an [`Episode`] is one bike on it, and
//! [`Bikes`] are many, stepped in parallel. The bike is the very one of the closed loop: the same plant,
//! integrator, motors, sensors, disturbances and faults, and an agent's action in place of our controllers'
//! commands. One step is one control period.
//!
//! | task | the agent gives, as shares from −1 to 1 of the largest | while |
//! |---|---|---|
//! | [`Task::Balance`] | balancer torque | the bike stands (`two_link`) |
//! | [`Task::Follow`] | acceleration, steering rate | our laws balance, and brake before the goal |
//! | [`Task::Ride`] | drive force, steering rate, balancer torque | nobody helps |
//!
//! Chance: episode `k` of seed `s` is a function of both and of nothing else, so results do not depend on
//! the number of bikes or threads.

mod bikes;
mod course;
mod ending;
mod single;

pub use bikes::{Bikes, Buffers};
pub use course::{Course, Spread};
pub use ending::Ending;
pub use single::{Episode, Step};

use crate::error::Error;

/// What an agent is to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Task {
    /// Keep a standing bike upright.
    Balance,
    /// Lead a bike that keeps its own balance along its path.
    Follow,
    /// Ride along the path and keep the balance.
    Ride,
}

/// Way ahead of the followed point at which the curvature of the curve is shown, m.
pub const PREVIEW: [f64; 3] = [0.5, 1.0, 2.0];

const BALANCE: [(&str, f64); 4] = [
    ("roll_rad", 4.0),
    ("balancer_rad", 1.0e4),
    ("roll_rate_radps", 100.0),
    ("balancer_rate_radps", 1.0e3),
];

const RIDE: [(&str, f64); 15] = [
    ("roll_rad", 4.0),
    ("balancer_rad", 1.0e4),
    ("roll_rate_radps", 100.0),
    ("balancer_rate_radps", 1.0e3),
    ("lateral_error_m", 100.0),
    ("heading_error_rad", 4.0),
    ("speed_mps", 100.0),
    ("speed_reference_mps", 100.0),
    ("steer_rad", 4.0),
    ("steer_rate_radps", 100.0),
    ("path_curvature_per_m", 100.0),
    ("path_curvature_ahead_0.5m_per_m", 100.0),
    ("path_curvature_ahead_1m_per_m", 100.0),
    ("path_curvature_ahead_2m_per_m", 100.0),
    ("remaining_m", 2.0e4),
];

impl Task {
    /// Numbers of an action.
    #[must_use]
    pub fn actions(self) -> &'static [&'static str] {
        match self {
            Self::Balance => &["balancer_torque"],
            Self::Follow => &["acceleration", "steer_rate"],
            Self::Ride => &["drive_force", "steer_rate", "balancer_torque"],
        }
    }

    /// Names of the numbers of an observation, with their units, and the bound that none exceeds.
    ///
    /// All are what the sensors say, by the names of a recording where it has them. The balancer's angle
    /// counts turns; `heading_error_rad` is the bike's heading less that of the curve, and `remaining_m`
    /// the way to the end.
    #[must_use]
    pub fn observations(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Balance => &BALANCE,
            Self::Follow | Self::Ride => &RIDE,
        }
    }
}

/// Why there is no episode, or no step.
#[derive(Debug, thiserror::Error)]
pub enum EpisodeError {
    /// The scenario does not fit the task.
    #[error("{problem}; {remedy}")]
    Scenario {
        /// What it is.
        problem: String,
        /// What would do.
        remedy: &'static str,
    },
    /// The run of the scenario makes no sense.
    #[error(transparent)]
    Run(#[from] Error),
    /// A spread that is none.
    #[error("the spread of {name} is {value}: it takes a finite number of 0 or more")]
    Spread {
        /// Of which part of the start.
        name: &'static str,
        /// What was given.
        value: f64,
    },
    /// A number of an action that is none.
    #[error("number {number} of the action of bike {bike} is {value}: it takes a finite number")]
    ActionNotFinite {
        /// Which bike, from 0.
        bike: usize,
        /// Which number, from 0.
        number: usize,
        /// What was given.
        value: f32,
    },
    /// A slice of another length than the bikes need.
    #[error("{what} has {found} entries: {expected} are needed")]
    Length {
        /// Of what.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many are needed.
        expected: usize,
    },
    /// The episode has ended, or has not begun.
    #[error("the episode of bike {bike} has ended: it has to be reset before the next step")]
    Over {
        /// Which bike, from 0.
        bike: usize,
    },
    /// The threads could not be started.
    #[error("cannot start the threads: {0}")]
    Threads(String),
}
