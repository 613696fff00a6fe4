//! Controllers from outside: a follower or a balance law that is not ours, lent tick by tick.
//!
//! A controller of one's own takes the place of [`crate::follower`] or of [`crate::balance`] and of nothing
//! else: phases, braking before the goal, the drive observer, the lean reference, the guardian of the
//! margins and every limit of the motors stay where they are. Any closure of the right form is one:
//!
//! ```
//! use bikebot_control::external::{BalancerView, External};
//!
//! let mut stiff = |seen: &BalancerView<'_>| Ok(120.0 * seen.state.roll + 40.0 * seen.state.roll_rate);
//! let external = External { balancer: Some(&mut stiff), ..External::default() };
//! # drop(external);
//! ```
//!
//! It is lent for each tick ([`crate::RideController::tick_with`]) and never owned, so that our own
//! controllers stay plain values.

use bikebot_dynamics::{Measurement, TwoLinkState};

use crate::error::ControlError;
pub use crate::followed_path::{FollowedPath, PathSample, Projection};
use crate::output_zeroing::OutputReference;
use crate::roll_model::TurnMoment;

/// What a follower is shown at a tick.
#[derive(Debug, Clone, Copy)]
pub struct FollowerView<'a> {
    /// Time since the start of the ride, s.
    pub time: f64,
    /// Control period: what is answered now holds so long, s.
    pub period: f64,
    /// What the sensors say.
    pub measured: &'a Measurement,
    /// The curve to be followed, with its speed profile.
    pub path: &'a FollowedPath,
    /// The foot of the followed point on the curve.
    pub projection: Projection,
    /// The curve at that foot.
    pub reference: PathSample,
    /// How far ahead of the rear contact the followed point lies, m.
    pub ahead: f64,
    /// Way of the rear contact to the end of the path, m; negative past it.
    pub remaining: f64,
}

/// What a follower answers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FollowerCommand {
    /// Acceleration of the rear contact along the heading, m/s^2. Before the goal, and before a stop line,
    /// the braking law takes its place.
    pub acceleration: f64,
    /// Steering rate, rad/s, positive to the left.
    pub steer_rate: f64,
}

/// What a balance law is shown at a tick.
#[derive(Debug, Clone, Copy)]
pub struct BalancerView<'a> {
    /// Time since the start of the ride, s.
    pub time: f64,
    /// Control period, s.
    pub period: f64,
    /// Roll and balancer as the sensors say, rad and rad/s.
    pub state: &'a TwoLinkState,
    /// The turn the bike is in; zero while it stands.
    pub turn: &'a TurnMoment,
    /// The lean asked for, rad, with the share of the roll-moment observer, and its derivatives.
    pub reference: OutputReference,
    /// Estimated roll moment from outside, N m; zero without an observer.
    pub moment_estimate: f64,
    /// Offset `d` of the balancer's centre of gravity above its pivot, m.
    pub offset: f64,
}

/// Why a controller from outside gave no answer; the ride ends with it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Declined(pub String);

/// A path follower from outside. It is asked at every tick but those in which the bike is held at rest.
pub trait ExternalFollower {
    /// How the bike shall accelerate and steer.
    ///
    /// # Errors
    ///
    /// [`Declined`] ends the ride.
    fn follow(&mut self, seen: &FollowerView<'_>) -> Result<FollowerCommand, Declined>;
}

impl<F> ExternalFollower for F
where
    F: FnMut(&FollowerView<'_>) -> Result<FollowerCommand, Declined>,
{
    fn follow(&mut self, seen: &FollowerView<'_>) -> Result<FollowerCommand, Declined> {
        self(seen)
    }
}

/// A balance law from outside, asked at every tick.
pub trait ExternalBalancer {
    /// The torque of the frame on the balancer, N m, before the limits of the motor.
    ///
    /// # Errors
    ///
    /// [`Declined`] ends the ride.
    fn balance(&mut self, seen: &BalancerView<'_>) -> Result<f64, Declined>;
}

impl<F> ExternalBalancer for F
where
    F: FnMut(&BalancerView<'_>) -> Result<f64, Declined>,
{
    fn balance(&mut self, seen: &BalancerView<'_>) -> Result<f64, Declined> {
        self(seen)
    }
}

/// The controllers from outside that are lent; none by default.
#[derive(Default)]
pub struct External<'g> {
    /// Time since the start of the ride, s, as they shall be told.
    pub time: f64,
    /// In place of the path follower.
    pub follower: Option<&'g mut dyn ExternalFollower>,
    /// In place of the balance law.
    pub balancer: Option<&'g mut dyn ExternalBalancer>,
}

/// Asks a follower, and refuses a command that is no number.
pub(crate) fn asked(
    follower: &mut dyn ExternalFollower,
    seen: &FollowerView<'_>,
) -> Result<FollowerCommand, ControlError> {
    let command = follower
        .follow(seen)
        .map_err(|declined| ControlError::Declined {
            who: "follower",
            declined,
        })?;
    finite("acceleration", command.acceleration)?;
    finite("steering rate", command.steer_rate)?;
    Ok(command)
}

/// Asks a balance law, and refuses a torque that is no number.
pub(crate) fn asked_balancer(
    balancer: &mut dyn ExternalBalancer,
    seen: &BalancerView<'_>,
) -> Result<f64, ControlError> {
    let torque = balancer
        .balance(seen)
        .map_err(|declined| ControlError::Declined {
            who: "balancer",
            declined,
        })?;
    finite("balancer torque", torque)?;
    Ok(torque)
}

fn finite(quantity: &'static str, value: f64) -> Result<(), ControlError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(ControlError::CommandNotFinite { quantity, value })
    }
}
