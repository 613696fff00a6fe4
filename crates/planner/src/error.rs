//! Problems that make no sense. A search that ends empty is no error but an
//! outcome of it.

use bikebot_geometry::Point2;
use bikebot_world::FootprintError;
use serde::{Deserialize, Serialize};

/// Which end of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// x_init.
    Start,
    /// x_goal.
    Goal,
}

impl std::fmt::Display for End {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Start => "start",
            Self::Goal => "goal",
        })
    }
}

/// Why a planning problem cannot even be tried.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// The footprint at the start touches an obstacle.
    #[error(
        "the start ({:.3}, {:.3}) m is in an obstacle: the footprint's clearance there is {clearance:.3} m, \
         {margin:.3} m is asked for",
        position.x, position.y
    )]
    StartInObstacle {
        /// Position of the start, m.
        position: Point2,
        /// Signed distance from the footprint to the nearest obstacle, m.
        clearance: f64,
        /// Clearance asked for, m.
        margin: f64,
    },
    /// The footprint at the goal touches an obstacle.
    #[error(
        "the goal ({:.3}, {:.3}) m is in an obstacle: the footprint's clearance there is {clearance:.3} m, \
         {margin:.3} m is asked for",
        position.x, position.y
    )]
    GoalInObstacle {
        /// Position of the goal, m.
        position: Point2,
        /// Signed distance from the footprint to the nearest obstacle, m.
        clearance: f64,
        /// Clearance asked for, m.
        margin: f64,
    },
    /// An end lies outside the map.
    #[error(
        "the {which} ({:.3}, {:.3}) m lies outside the map, which reaches from ({:.3}, {:.3}) m to ({:.3}, {:.3}) m",
        position.x, position.y, min.x, min.y, max.x, max.y
    )]
    OutsideMap {
        /// Which end.
        which: End,
        /// Its position, m.
        position: Point2,
        /// Lower left corner of the map, m.
        min: Point2,
        /// Upper right corner of the map, m.
        max: Point2,
    },
    /// A number that cannot be planned with.
    #[error("{name} is {value}, but must be {expected}")]
    InvalidParameter {
        /// The key, with its unit.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What it must be.
        expected: &'static str,
    },
    /// A footprint that cannot be read.
    #[error(transparent)]
    InvalidFootprint(#[from] FootprintError),
}
