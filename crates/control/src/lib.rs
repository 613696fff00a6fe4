//! Balance by output zeroing, path following by passive velocity fields.
//!
//! Two loops ride the bike. The outer one, [`pvfc`], turns the plane motion of a
//! point ahead of the rear contact into that of a point mass in an encoded velocity
//! field and moves drive and steering accordingly; [`follower`] has it beside pure pursuit,
//! Stanley and LQR. The inner one, [`output_zeroing`],
//! swings the balancer so that a special output of the roll dynamics vanishes; what is
//! left is one exponentially stable number. Between them stands [`lean_reference`]:
//! a balancer cannot hold the moment of a turn, so the body must already lean when the
//! turn comes. [`cascade::RideController`] joins the three and [`supervisor`] tells it
//! when to start, cruise, brake and hold. [`RideController::set_stop`] and
//! [`RideController::replace_path`] let a planner move the end of the way while the bike rides.
//! Either loop can be somebody else's: [`external`].
//!
//! SI units and radians throughout. World frame: x right, y up, heading
//! counter-clockwise from +x. Roll is positive to the right, the balancer angle is
//! measured from the body in the same sense, steering is positive to the left.

#![cfg_attr(not(test), warn(clippy::unwrap_used, clippy::expect_used))]

mod authority;
pub mod balance;
pub mod braking;
pub mod cascade;
pub mod controller;
pub mod energy_tank;
pub mod error;
pub mod external;
pub mod followed_path;
pub mod follower;
pub mod guardian;
pub mod lean_reference;
pub mod look_ahead;
pub mod lqr;
pub mod lyapunov;
pub mod observer;
pub mod output_function;
pub mod output_zeroing;
pub mod params;
mod plan_table;
pub mod predictive;
pub mod profile;
pub mod pvfc;
mod ramps;
pub mod recoverable;
pub mod roll_model;
mod steering_assist;
pub mod supervisor;
pub mod velocity_field;

pub use balance::{BalanceController, BalanceLaw, BalanceOutput};
pub use braking::{BrakingLimits, BrakingManoeuvre};
pub use cascade::{ControlOutput, RideController};
pub use controller::Controller;
pub use energy_tank::EnergyTank;
pub use error::ControlError;
pub use external::{External, ExternalBalancer, ExternalFollower};
pub use followed_path::{FollowedPath, PathSample, RideLimits};
pub use follower::Follower;
pub use guardian::{Guardian, Intervention, Margin, SupervisorParams};
pub use lean_reference::LeanReference;
pub use look_ahead::LookAhead;
pub use lyapunov::AugmentedEnergy;
pub use observer::{DriveObserver, RollMomentObserver};
pub use output_function::OutputFunction;
pub use output_zeroing::{OutputReference, OutputZeroing};
pub use params::{
    BalanceLawKind, BalanceParams, FollowController, FollowParams, LateralLqrParams,
    PurePursuitParams, StanleyParams, Track,
};
pub use predictive::{Predicted, Predictive, SteeringRoom, Trouble};
pub use pvfc::Pvfc;
pub use roll_model::{RollModel, TurnMoment};
pub use supervisor::{ModeChange, Phase};
pub use velocity_field::VelocityField;
