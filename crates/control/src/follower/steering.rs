//! What pure pursuit, Stanley and LQR share: a steering servo, a speed law, and the future of both.
//!
//! The law of choice says which steering angle `psi_d` it wants; the servo turns there with
//! `psi' = k_psi (psi_d - psi)` within the rate limit, and the speed follows the profile,
//! `v' = rho rho' + k_v (rho - v)`.
//!
//! The roll-out of the lean preview is this very loop.

use bikebot_dynamics::{BikeParams, Measurement};
use bikebot_geometry::Pose2;

use super::lateral_lqr::LateralLqr;
use super::pure_pursuit::PurePursuit;
use super::rolling::{MotionLimits, RollingBike, roll_out};
use super::stanley::Stanley;
use super::{FollowStep, PlaneMotion, Turning};
use crate::followed_path::{FollowedPath, PathSample, Projection};
use crate::look_ahead::LookAhead;
use crate::params::{FollowController, FollowParams};

/// Longest step of the roll-out, s; a third of the usual lag of the steering.
const ROLL_OUT_STEP: f64 = 0.01;

/// A law that sets a steering angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SteeringLaw {
    /// Pure pursuit.
    PurePursuit(PurePursuit),
    /// The Stanley law.
    Stanley(Stanley),
    /// Linear-quadratic feedback.
    Lqr(LateralLqr),
}

impl SteeringLaw {
    /// The steering angle wanted, rad, with the law's own point at `projection` beside `path`.
    #[must_use]
    pub fn steering_angle(
        &self,
        path: &FollowedPath,
        pose: &Pose2,
        speed: f64,
        projection: &Projection,
    ) -> f64 {
        match self {
            Self::PurePursuit(law) => law.steering_angle(path, pose, speed, projection),
            Self::Stanley(law) => law.steering_angle(path, pose, speed, projection),
            Self::Lqr(law) => law.steering_angle(path, pose, speed, projection),
        }
    }
}

/// A steering law with its servo and its speed law.
#[derive(Debug, Clone, PartialEq)]
pub struct SteeringFollower {
    law: SteeringLaw,
    own: LookAhead,
    steering_gain: f64,
    speed_gain: f64,
    limits: MotionLimits,
    virtual_time: f64,
}

impl SteeringFollower {
    /// The law of `params`, starting with its own point at `projection`.
    #[must_use]
    pub fn new(params: &FollowParams, bike: &BikeParams, projection: &Projection) -> Self {
        let w = bike.wheelbase;
        let (law, steering_gain) = match params.controller {
            FollowController::Stanley => (
                SteeringLaw::Stanley(Stanley::new(&params.stanley)),
                params.stanley.steering_gain,
            ),
            FollowController::Lqr => (
                SteeringLaw::Lqr(LateralLqr::new(&params.lqr, w)),
                params.lqr.steering_gain,
            ),
            FollowController::PurePursuit | FollowController::Pvfc => (
                SteeringLaw::PurePursuit(PurePursuit::new(&params.pure_pursuit, w)),
                params.pure_pursuit.steering_gain,
            ),
        };
        Self {
            law,
            own: LookAhead {
                distance: super::Follower::own_distance(params, bike),
                wheelbase: w,
                speed_floor: params.steering_speed_floor,
            },
            steering_gain,
            speed_gain: params.speed_gain,
            limits: MotionLimits::new(params, bike),
            virtual_time: projection.s,
        }
    }

    /// The law's own point.
    #[must_use]
    pub fn own_point(&self) -> &LookAhead {
        &self.own
    }

    /// Arc length of the own point's foot on the curve, m.
    #[must_use]
    pub fn virtual_time(&self) -> f64 {
        self.virtual_time
    }

    /// One tick with the own point at `projection` beside `path`.
    pub fn step(
        &mut self,
        path: &FollowedPath,
        m: &Measurement,
        projection: &Projection,
    ) -> FollowStep {
        self.virtual_time = projection.s;
        let wanted = self
            .law
            .steering_angle(path, &m.pose, m.speed, projection)
            .clamp(-self.limits.steer, self.limits.steer);
        FollowStep {
            acceleration: self.acceleration(&path.reference(projection.s), m.speed, m.steer),
            turning: Turning::SteerRate(self.steering_gain * (wanted - m.steer)),
            energy: None,
        }
    }

    /// Goes over to another curve, on which the foot of its own point is `virtual_time`, m.
    pub fn take_over(&mut self, virtual_time: f64) {
        self.virtual_time = virtual_time;
    }

    /// The speed law on a `sample` of the curve. The profile is that of the own point, which on the front
    /// wheel is faster than the rear contact by `1/cos(psi)`.
    fn acceleration(&self, sample: &PathSample, speed: f64, steer: f64) -> f64 {
        let share = if self.own.distance == 0.0 {
            1.0
        } else {
            let slope = steer.tan() * self.own.distance / self.own.wheelbase;
            1.0 / (1.0 + slope * slope).sqrt()
        };
        let wanted = share * sample.speed;
        wanted * sample.speed_slope + self.speed_gain * (wanted - speed)
    }

    /// The closed loop ahead, as [`super::Follower::roll_out`].
    pub fn roll_out(
        &self,
        path: &FollowedPath,
        motion: &PlaneMotion,
        step: f64,
        steps: usize,
        visit: &mut dyn FnMut(f64, f64),
    ) {
        let mut s = self.virtual_time;
        let limit = self.limits.steer;
        let advance = |bike: &mut RollingBike| {
            let m = &bike.measured;
            let projection = path.project_once(self.own.point(m), s + m.speed * bike.dt());
            let wanted = self
                .law
                .steering_angle(path, &m.pose, m.speed, &projection)
                .clamp(-limit, limit);
            // The end is braked for by the cascade, as the riding profile foresees it.
            let sample = path.riding_sample(projection.s);
            let wanted_acceleration = self.acceleration(&sample, m.speed, m.steer);
            let acceleration =
                bike.driven(path.governed(wanted_acceleration, m.speed, projection.s, bike.dt()));
            let rate = self.steering_gain * (wanted - m.steer);
            s = projection.s;
            bike.roll(acceleration, rate)
        };
        let grid = (step, steps, ROLL_OUT_STEP);
        roll_out(&motion.measured, &self.limits, grid, advance, visit);
    }
}
