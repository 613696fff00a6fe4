//! How an episode ends.

/// Why an episode ended; the names are those of a ride where a ride has them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Ending {
    /// It goes on.
    None = 0,
    /// Its time is over (truncated, not terminated).
    Duration = 1,
    /// At rest within the goal's tolerance.
    AtGoal = 2,
    /// |roll| above 0.7 rad, or a fall that nothing can stop any more.
    Roll = 3,
    /// A tyre slipped.
    Slip = 4,
    /// A wheel left the ground.
    WheelLift = 5,
    /// The outline met an obstacle.
    Obstacle = 6,
    /// The outline met something that moves.
    MovingObstacle = 7,
    /// More than a metre beside the curve.
    LeftPath = 8,
    /// More than half a metre past the end.
    PastGoal = 9,
    /// A number of the state is none.
    NotFinite = 10,
    /// Our law that helps could not go on.
    ControlFailed = 11,
}

impl Ending {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 12] = [
        Self::None,
        Self::Duration,
        Self::AtGoal,
        Self::Roll,
        Self::Slip,
        Self::WheelLift,
        Self::Obstacle,
        Self::MovingObstacle,
        Self::LeftPath,
        Self::PastGoal,
        Self::NotFinite,
        Self::ControlFailed,
    ];

    /// Its name; empty while it goes on.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Duration => "duration",
            Self::AtGoal => "at_goal",
            Self::Roll => "roll",
            Self::Slip => "slip",
            Self::WheelLift => "wheel_lift",
            Self::Obstacle => "obstacle",
            Self::MovingObstacle => "moving_obstacle",
            Self::LeftPath => "left_path",
            Self::PastGoal => "past_goal",
            Self::NotFinite => "not_finite",
            Self::ControlFailed => "control_failed",
        }
    }

    /// The ending of a monitor's reason.
    pub(super) fn of_fall(reason: &str) -> Self {
        match reason {
            "slip" => Self::Slip,
            "wheel_lift" => Self::WheelLift,
            "not_finite" => Self::NotFinite,
            _ => Self::Roll,
        }
    }

    /// Whether the state itself ended it, and not the clock.
    #[must_use]
    pub fn is_terminal(self) -> bool {
        !matches!(self, Self::None | Self::Duration)
    }
}
