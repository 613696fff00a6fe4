//! What makes no sense to a controller.
//!
//! Falling, saturating or missing the goal are outcomes of a ride and never errors.

use crate::external::Declined;

/// Input that a controller cannot work with.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ControlError {
    /// A measured quantity is not a finite number.
    #[error("the measured {quantity} is {value}, not a finite number")]
    NotFinite {
        /// Name of the measured quantity.
        quantity: &'static str,
        /// The value that was measured.
        value: f64,
    },
    /// The control period is not a positive, finite time.
    #[error("the control period must be positive and at most 0.1 s, got {period} s")]
    ControlPeriod {
        /// The period asked for, s.
        period: f64,
    },
    /// The path is too short to be followed.
    #[error("the path is {length} m long; following needs at least {least} m")]
    PathTooShort {
        /// Length of the path, m.
        length: f64,
        /// Shortest path that can be followed, m.
        least: f64,
    },
    /// The path is longer than what is tabulated of it may be.
    #[error("the path is {length} m long; at most {most} m can be followed")]
    PathTooLong {
        /// Length of the path, m.
        length: f64,
        /// Longest path that can be followed, m.
        most: f64,
    },
    /// The path contains a point that is not finite or two equal neighbours.
    #[error("the path cannot be sampled at s = {arc_length} m")]
    PathDegenerate {
        /// Where along the path, m.
        arc_length: f64,
    },
    /// A path to go over to does not lead past the bike.
    #[error(
        "the new path does not lead past the bike: {distance} m beside it, heading {turn} rad off"
    )]
    PathElsewhere {
        /// Distance of the followed point from the new followed curve, m.
        distance: f64,
        /// Heading of the new followed curve there less that of the bike, rad.
        turn: f64,
    },
    /// The upright decoupling term vanishes for this bike, so the balancer cannot control the roll.
    #[error(
        "the balancer has no authority over the roll at an offset of {offset} m (decoupling {decoupling} 1/s^2)"
    )]
    NoBalanceAuthority {
        /// Balancer offset `d`, m.
        offset: f64,
        /// Upright decoupling term `D / M11`, 1/s^2.
        decoupling: f64,
    },
    /// Shifting the balancer would pass through an offset where balance is lost.
    #[error(
        "a mode change would pass a singular offset: percussion height {percussion_height} m of the frame is not below {bound} m"
    )]
    SingularModeChange {
        /// Centre-of-percussion height of the frame, `h1 + I1x / (m1 h1)`, m.
        percussion_height: f64,
        /// Its bound, `l + 2 sqrt((1 + m2 l / (m1 h1)) I2x / m2)`, m.
        bound: f64,
    },
    /// A mode change is asked for while another one is running.
    #[error("a mode change is already under way")]
    ModeChangeUnderWay,
    /// A mode change shall be quicker than the least time.
    #[error("a mode change must take at least {least} s, got {duration} s")]
    ModeChangeTooQuick {
        /// The time asked for, s.
        duration: f64,
        /// The least time, s.
        least: f64,
    },
    /// The algebraic Riccati equation has no stabilising solution for these weights.
    #[error("no stabilising feedback for these weights (relative Riccati residual {residual})")]
    NoStabilisingGain {
        /// Residual of the Riccati equation relative to the weights.
        residual: f64,
    },
    /// A controller from outside gave no answer.
    #[error("the {who} gave no command: {declined}")]
    Declined {
        /// `follower` or `balancer`.
        who: &'static str,
        /// Why.
        declined: Declined,
    },
    /// A controller from outside gave a command that is no number.
    #[error("the commanded {quantity} is {value}, not a finite number")]
    CommandNotFinite {
        /// Name of the commanded quantity.
        quantity: &'static str,
        /// The value that was commanded.
        value: f64,
    },
}

impl ControlError {
    /// Whether a controller from outside is at fault ([`crate::external`]), and not the ride.
    #[must_use]
    pub fn is_from_outside(&self) -> bool {
        matches!(self, Self::Declined { .. } | Self::CommandNotFinite { .. })
    }
}
