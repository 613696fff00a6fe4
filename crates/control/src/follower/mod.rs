//! Following a path: four laws behind one face.
//!
//! Every follower watches an *own point* of the bike, a distance ahead of the rear contact, and
//! keeps it on the followed curve ([`crate::followed_path`]):
//!
//! | law | own point |
//! |---|---|
//! | passive velocity field ([`field`]) | `ell` ahead of the rear contact |
//! | pure pursuit ([`pure_pursuit`]) | the rear contact |
//! | Stanley ([`stanley`]) | the contact of the front wheel |
//! | LQR ([`lateral_lqr`]) | the rear contact |
//!
//! Each tick it says how the bike shall accelerate and steer, and where on the curve it stands.
//! Asked by the lean preview, it rolls out its own closed loop: what it would do if the bike
//! moved as commanded. The rest of the cascade does not know which law rides.

pub mod field;
pub mod lateral_lqr;
pub mod pure_pursuit;
pub mod rolling;
pub mod stanley;
pub mod steering;
#[cfg(test)]
mod test_paths;

use bikebot_dynamics::{BikeParams, Measurement};

use crate::followed_path::{FollowedPath, Projection};
use crate::look_ahead::LookAhead;
use crate::lyapunov::AugmentedEnergy;
use crate::params::{FollowController, FollowParams};

use field::FieldFollower;
use steering::SteeringFollower;

/// How a follower wants the bike to turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Turning {
    /// With this yaw acceleration, rad/s^2; the steering rate depends on the forward acceleration.
    YawAcceleration(f64),
    /// With this steering rate, rad/s.
    SteerRate(f64),
}

/// What a follower asks for in one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FollowStep {
    /// `v'`, m/s^2, of the rear contact, before the limits of the drive.
    pub acceleration: f64,
    /// How the bike shall turn.
    pub turning: Turning,
    /// The energy account of the tick before; only the velocity field keeps one.
    pub energy: Option<AugmentedEnergy>,
}

/// The plane motion of the bike from which a follower rolls out its own future.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneMotion {
    /// What is measured now.
    pub measured: Measurement,
    /// `omega`, rad/s.
    pub yaw_rate: f64,
    /// `omega'`, rad/s^2.
    pub yaw_acceleration: f64,
}

/// A law that follows a path.
#[derive(Debug, Clone, PartialEq)]
pub enum Follower {
    /// Passive velocity field control.
    Field(Box<FieldFollower>),
    /// A law that sets a steering angle: pure pursuit, Stanley or LQR.
    Steering(Box<SteeringFollower>),
}

impl Follower {
    /// How far ahead of the rear contact the own point of a law lies, m.
    #[must_use]
    pub fn own_distance(params: &FollowParams, bike: &BikeParams) -> f64 {
        match params.controller {
            FollowController::Pvfc => params.look_ahead,
            FollowController::PurePursuit | FollowController::Lqr => 0.0,
            FollowController::Stanley => bike.wheelbase,
        }
    }

    /// For `bike`, which stands at `start` with its own point at `projection` beside `path`.
    #[must_use]
    pub fn new(
        params: &FollowParams,
        bike: &BikeParams,
        path: &FollowedPath,
        start: &Measurement,
        projection: &Projection,
    ) -> Self {
        match params.controller {
            FollowController::Pvfc => Self::Field(Box::new(FieldFollower::new(
                params, bike, path, start, projection,
            ))),
            FollowController::PurePursuit | FollowController::Stanley | FollowController::Lqr => {
                Self::Steering(Box::new(SteeringFollower::new(params, bike, projection)))
            }
        }
    }

    /// The point of the bike that is kept on the curve.
    #[must_use]
    pub fn own_point(&self) -> &LookAhead {
        match self {
            Self::Field(field) => field.own_point(),
            Self::Steering(steering) => steering.own_point(),
        }
    }

    /// `s`, m: where on the followed curve the own point should be now.
    #[must_use]
    pub fn virtual_time(&self) -> f64 {
        match self {
            Self::Field(field) => field.virtual_time(),
            Self::Steering(steering) => steering.virtual_time(),
        }
    }

    /// One tick of `dt` seconds with the own point at `projection` beside `path`.
    pub fn step(
        &mut self,
        path: &FollowedPath,
        m: &Measurement,
        projection: &Projection,
        dt: f64,
    ) -> FollowStep {
        match self {
            Self::Field(field) => field.step(path, m, dt),
            Self::Steering(steering) => steering.step(path, m, projection),
        }
    }

    /// The bike is held at rest: no law is at work.
    pub fn rest(&mut self) -> Option<AugmentedEnergy> {
        match self {
            Self::Field(field) => Some(field.rest()),
            Self::Steering(_) => None,
        }
    }

    /// Goes over to `path`, on whose curve the virtual time is `virtual_time`, m.
    pub fn take_over(&mut self, params: &FollowParams, path: &FollowedPath, virtual_time: f64) {
        match self {
            Self::Field(field) => field.take_over(params, path, virtual_time),
            Self::Steering(steering) => steering.take_over(virtual_time),
        }
    }

    /// Sets off again after a rest, with the own point at `projection` beside `path`.
    pub fn resume(&mut self, path: &FollowedPath, m: &Measurement, projection: &Projection) {
        match self {
            Self::Field(field) => field.resume(path, m, projection),
            Self::Steering(steering) => steering.take_over(projection.s),
        }
    }

    /// Rolls the closed loop of follower and bike ahead along `path`: `visit` is told centripetal
    /// acceleration, m/s^2, and yaw acceleration, rad/s^2, of each of `steps` steps of `step` s.
    pub fn roll_out(
        &self,
        path: &FollowedPath,
        motion: &PlaneMotion,
        step: f64,
        steps: usize,
        visit: &mut dyn FnMut(f64, f64),
    ) {
        match self {
            Self::Field(field) => field.roll_out(path, motion, step, steps, visit),
            Self::Steering(steering) => steering.roll_out(path, motion, step, steps, visit),
        }
    }
}
