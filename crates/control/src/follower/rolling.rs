//! The bike as a follower's roll-out moves it: kinematics, servo and limits.
//!
//! The lean preview must know the coming turns as exactly as the bike will ride them, so a
//! roll-out integrates the follower's very loop. An approximate preview, such as one that assumes
//! the bike on the curve, leaves the balancer with the difference.

use bikebot_dynamics::{BikeParams, Measurement};
use bikebot_geometry::Vector2;

use crate::params::FollowParams;

/// What limits steering and drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionLimits {
    /// Wheelbase `w`, m.
    pub wheelbase: f64,
    /// Greatest steering angle, rad.
    pub steer: f64,
    /// Greatest steering rate, rad/s.
    pub steer_rate: f64,
    /// Time constant from commanded to actual steering rate, s.
    pub steer_lag: f64,
    /// Greatest acceleration, m/s^2.
    pub acceleration: f64,
    /// Greatest deceleration, m/s^2.
    pub deceleration: f64,
}

impl MotionLimits {
    /// Those of `bike` as `params` has it ridden.
    #[must_use]
    pub fn new(params: &FollowParams, bike: &BikeParams) -> Self {
        Self {
            wheelbase: bike.wheelbase,
            steer: bike.steer_max(),
            steer_rate: bike.steer_rate_max,
            steer_lag: bike.steer_lag,
            acceleration: params.drive_acceleration,
            deceleration: params.drive_deceleration,
        }
    }
}

/// A rolling bike that does as it is told, within its limits.
#[derive(Debug, Clone, Copy)]
pub struct RollingBike {
    /// Where it is and how it moves; the roll is of no interest here.
    pub measured: Measurement,
    /// tan(psi): it is the dearest part of a step.
    slope: f64,
    limits: MotionLimits,
    dt: f64,
    /// What is left of the lag of the steering rate after a step.
    memory: f64,
}

impl RollingBike {
    /// As `measured`, rolled ahead in steps of `dt` s.
    #[must_use]
    pub fn new(measured: &Measurement, limits: &MotionLimits, dt: f64) -> Self {
        let memory = if limits.steer_lag > 0.0 {
            (-dt / limits.steer_lag).exp()
        } else {
            0.0
        };
        Self {
            measured: *measured,
            slope: measured.steer.tan(),
            limits: *limits,
            dt,
            memory,
        }
    }

    /// The step it is rolled in, s.
    #[must_use]
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// `acceleration`, m/s^2, as far as the drive allows it.
    #[must_use]
    pub fn driven(&self, acceleration: f64) -> f64 {
        acceleration.clamp(-self.limits.deceleration, self.limits.acceleration)
    }

    /// Rolls on with forward acceleration `acceleration`, m/s^2, and commanded steering rate
    /// `steer_rate`, rad/s; returns centripetal acceleration, m/s^2, and yaw acceleration, rad/s^2,
    /// over the step.
    pub fn roll(&mut self, acceleration: f64, steer_rate: f64) -> (f64, f64) {
        let (m, l, dt) = (&mut self.measured, &self.limits, self.dt);
        let command = steer_rate.clamp(-l.steer_rate, l.steer_rate);
        // The servo's lag in closed form, then the bike by the midpoint rule.
        let departure = m.steer_rate - command;
        let turned = command * dt + departure * l.steer_lag * (1.0 - self.memory);
        m.steer_rate = command + departure * self.memory;
        let after = (m.steer + turned).clamp(-l.steer, l.steer);
        let (slow, fast) = (m.speed, (m.speed + acceleration * dt).max(0.0));
        let w = l.wheelbase;
        let slope = self.slope;
        self.slope = after.tan();
        let (yaw_before, yaw_after) = (slow * slope / w, fast * self.slope / w);
        let (speed, yaw_rate) = (0.5 * (slow + fast), 0.5 * (yaw_before + yaw_after));
        let (sin, cos) = (m.pose.heading + 0.5 * yaw_rate * dt).sin_cos();
        m.pose.position += Vector2::new(cos, sin) * (speed * dt);
        m.pose.heading += yaw_rate * dt;
        m.steer = after;
        m.speed = fast;
        (speed * yaw_rate, (yaw_after - yaw_before) / dt)
    }
}

/// Rolls ahead in `steps` steps of `step` s, each in pieces no longer than `longest`; `advance` rolls
/// the bike one piece, `visit` is told the means over each step.
pub fn roll_out(
    measured: &Measurement,
    limits: &MotionLimits,
    (step, steps, longest): (f64, usize, f64),
    mut advance: impl FnMut(&mut RollingBike) -> (f64, f64),
    visit: &mut dyn FnMut(f64, f64),
) {
    let pieces = (step / longest).ceil().max(1.0);
    let mut bike = RollingBike::new(measured, limits, step / pieces);
    for _ in 0..steps {
        let (mut centripetal, mut yaw_acceleration) = (0.0, 0.0);
        for _ in 0..pieces as usize {
            let (c, y) = advance(&mut bike);
            centripetal += c;
            yaw_acceleration += y;
        }
        visit(centripetal / pieces, yaw_acceleration / pieces);
    }
}
