//! Passive velocity field control as a follower: the look-ahead point in an encoded field.
//!
//! The law itself is [`crate::pvfc`]; here the acceleration it wants of the point becomes forward
//! and yaw acceleration, and its energy account is kept.

use bikebot_dynamics::{BikeParams, Measurement};
use bikebot_geometry::Vector2;

use super::rolling::{MotionLimits, RollingBike, roll_out};
use super::{FollowStep, PlaneMotion, Turning};
use crate::followed_path::{FollowedPath, Projection};
use crate::look_ahead::LookAhead;
use crate::lyapunov::{AugmentedEnergy, EnergyAccount};
use crate::params::FollowParams;
use crate::pvfc::Pvfc;
use crate::velocity_field::VelocityField;

/// Longest step of the roll-out, s.
const ROLL_OUT_STEP: f64 = 0.02;

/// The velocity field, the point that moves in it and the energy account of both.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldFollower {
    own: LookAhead,
    pvfc: Pvfc,
    /// As it was at the measurement: where a roll-out starts.
    measured: Pvfc,
    account: EnergyAccount,
    point_mass: f64,
    limits: MotionLimits,
}

impl FieldFollower {
    /// For `bike`, which stands at `start` with its look-ahead point at `projection` beside `path`.
    #[must_use]
    pub fn new(
        params: &FollowParams,
        bike: &BikeParams,
        path: &FollowedPath,
        start: &Measurement,
        projection: &Projection,
    ) -> Self {
        let own = LookAhead {
            distance: params.look_ahead,
            wheelbase: bike.wheelbase,
            speed_floor: params.steering_speed_floor,
        };
        let point_rate = own.velocity(start);
        let along = path.sample(projection.s).heading;
        let virtual_rate = point_rate
            .dot(&Vector2::new(along.cos(), along.sin()))
            .max(0.0);
        let field = VelocityField::new(params, path.speed_max());
        let pvfc = Pvfc::new(params, field, projection.s, virtual_rate, point_rate);
        Self {
            own,
            pvfc,
            measured: pvfc,
            account: EnergyAccount::default(),
            point_mass: params.point_mass,
            limits: MotionLimits::new(params, bike),
        }
    }

    /// The look-ahead point.
    #[must_use]
    pub fn own_point(&self) -> &LookAhead {
        &self.own
    }

    /// `s`, m.
    #[must_use]
    pub fn virtual_time(&self) -> f64 {
        self.pvfc.virtual_time()
    }

    /// One tick of `dt` seconds.
    pub fn step(&mut self, path: &FollowedPath, m: &Measurement, dt: f64) -> FollowStep {
        let (point, point_rate) = (self.own.point(m), self.own.velocity(m));
        self.measured = self.pvfc;
        let step = self.pvfc.step(path, point, point_rate, self.lag(dt), dt);
        let energy = self.account.enter(&step, point_rate, self.point_mass, dt);
        FollowStep {
            acceleration: self.own.forward_acceleration(m, step.acceleration),
            turning: Turning::YawAcceleration(
                self.own
                    .yaw_acceleration(&self.by_then(m, self.lag(dt)), step.acceleration),
            ),
            energy: Some(energy),
        }
    }

    /// How late a command that is held for `dt` s turns the bike, s.
    fn lag(&self, dt: f64) -> f64 {
        self.limits.steer_lag + 0.5 * dt
    }

    /// The bike when a command given now turns it: with the steering angle that the present rate
    /// makes by then.
    fn by_then(&self, m: &Measurement, lag: f64) -> Measurement {
        Measurement {
            steer: (m.steer + m.steer_rate * lag).clamp(-self.limits.steer, self.limits.steer),
            ..*m
        }
    }

    /// Stops the augmented system.
    pub fn rest(&mut self) -> AugmentedEnergy {
        self.account.rest()
    }

    /// Goes over to `path`, on whose curve the virtual time is `virtual_time`, m.
    pub fn take_over(&mut self, params: &FollowParams, path: &FollowedPath, virtual_time: f64) {
        let field = self.pvfc.field().raised_for(params, path.speed_max());
        let granted = self.pvfc.take_over(field, virtual_time);
        self.account.grant(granted);
        self.measured = self.pvfc;
    }

    /// Sets off again after a rest, with the look-ahead point at `projection` beside `path`.
    pub fn resume(&mut self, path: &FollowedPath, m: &Measurement, projection: &Projection) {
        let point_rate = self.own.velocity(m);
        let along = path.sample(projection.s).heading;
        let virtual_rate = point_rate
            .dot(&Vector2::new(along.cos(), along.sin()))
            .max(0.0);
        self.pvfc.resume(projection.s, virtual_rate, point_rate);
        self.measured = self.pvfc;
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
        let mut pvfc = self.measured;
        let lag = self.lag(ROLL_OUT_STEP.min(step));
        let advance = |bike: &mut RollingBike| {
            let m = bike.measured;
            let (point, rate) = (self.own.point(&m), self.own.velocity(&m));
            let wanted = pvfc.step(path, point, rate, lag, bike.dt()).acceleration;
            let forward = self.own.forward_acceleration(&m, wanted);
            let s = pvfc.virtual_time();
            let acceleration = bike.driven(path.governed(forward, m.speed, s, bike.dt()));
            let yaw = self.own.yaw_acceleration(&self.by_then(&m, lag), wanted);
            bike.roll(acceleration, self.own.steer_rate(&m, acceleration, yaw))
        };
        let grid = (step, steps, ROLL_OUT_STEP);
        roll_out(&motion.measured, &self.limits, grid, advance, visit);
    }
}
