//! What the navigator says: orders, and why a bike has to stop.

use bikebot_geometry::CurvePath;
use bikebot_planner::Reason;
use serde::{Deserialize, Serialize};

/// Why the bike has to stop, or has stopped: the closed list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Halt {
    /// Something stands on the path so near that no new one could be taken over before it.
    BlockedAhead,
    /// There is something at the goal.
    GoalBlocked,
    /// Space that was never seen begins on the path; it is free as far as is known.
    UnknownAhead,
    /// Start and goal are proved to lie in different rooms.
    Disconnected,
    /// It is proved that no path within the curvature limit leaves this place, or reaches the goal.
    CurvatureInfeasible,
    /// There is a way through, but no curve along it was found that the bike can ride.
    NoCurve,
    /// The search for a way has ended without a proof.
    NoPath,
}

impl Halt {
    /// The name in reports and recordings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::BlockedAhead => "blocked_ahead",
            Self::GoalBlocked => "goal_blocked",
            Self::UnknownAhead => "unknown_ahead",
            Self::Disconnected => "disconnected",
            Self::CurvatureInfeasible => "curvature_infeasible",
            Self::NoCurve => "no_curve",
            Self::NoPath => "no_path",
        }
    }

    /// The same for people.
    #[must_use]
    pub fn in_words(self) -> &'static str {
        match self {
            Self::BlockedAhead => "the way is blocked right ahead",
            Self::GoalBlocked => "something stands at the goal",
            Self::UnknownAhead => "what lies ahead cannot be seen",
            Self::Disconnected => "no way leads to the goal",
            Self::CurvatureInfeasible => "no path that the bike can ride leaves this place",
            Self::NoCurve => "no path that the bike can ride was found along the ways there are",
            Self::NoPath => "no way was found",
        }
    }
}

impl From<Reason> for Halt {
    fn from(reason: Reason) -> Self {
        match reason {
            Reason::Disconnected => Self::Disconnected,
            Reason::CurvatureInfeasible => Self::CurvatureInfeasible,
            Reason::NoCurve => Self::NoCurve,
            Reason::Found | Reason::Iterations | Reason::Deadline | Reason::Cancelled => {
                Self::NoPath
            }
        }
    }
}

/// How things stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// All of the path is known to be free.
    Clear,
    /// The path is free as far as is known; the bike rides no faster than it sees.
    Seeing,
    /// The path is blocked, and a new one is being planned or waits to be taken over.
    Replanning,
    /// No way is known. The bike brakes, or stands, and looks on.
    Halted(Halt),
}

/// Why there is a new path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The first one.
    First,
    /// The old one led round what had come to block it.
    Repaired,
    /// The old one was blocked, and this one was planned from nothing.
    Afresh,
    /// The old one is free, this one is clearly cheaper.
    Improved,
}

impl Cause {
    /// The name in reports and recordings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::First => "first",
            Self::Repaired => "repaired",
            Self::Afresh => "afresh",
            Self::Improved => "improved",
        }
    }
}

/// A path to be taken over now.
#[derive(Debug, Clone)]
pub struct NewPath {
    /// From the start of the ride to the goal: up to the joint the old path, so that arc lengths go on. Position, heading and
    /// curvature are continuous.
    pub curves: CurvePath,
    /// Arc length at which it leaves the old path, m.
    pub joint: f64,
    /// Why.
    pub cause: Cause,
    /// Iterations of the search that found it.
    pub iterations: u64,
}

/// A search for a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Searched {
    /// Arc length at which the new path was to leave the present one, m.
    pub at: f64,
    /// Whether the bike was at rest: then more is tried.
    pub at_rest: bool,
    /// Whether the present path was free, and something better was looked for.
    pub is_improvement: bool,
    /// What was found.
    pub found: Option<Cause>,
    /// Whether that took a search over poses and steering angles, or would have.
    pub over_poses: bool,
    /// It took all that the method `full` has.
    pub is_thorough: bool,
}

/// What is to be done from now on.
#[derive(Debug, Clone)]
pub struct Order {
    /// The path to ride, where it is a new one.
    pub path: Option<NewPath>,
    /// Arc length of the rear contact, on the path that counts from now on, at which the bike has to be at rest at the latest, m; `None`:
    /// the path's end.
    pub stop_at: Option<f64>,
    /// How things stand.
    pub status: Status,
    /// What was promised to be free is so no more, within the stopping distance: brake as hard as can be.
    pub is_emergency: bool,
    /// The bike has stood without a way for as long as it was to look for one.
    pub gives_up: Option<Halt>,
    /// The search for a path that was made for this order.
    pub search: Option<Searched>,
}
