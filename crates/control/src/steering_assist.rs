//! Steering into a fall, where the balancer alone may not be enough.
//!
//! At 1.5 m/s full steering rate makes half the roll moment that the balancer's full torque makes,
//! and unlike the balancer it can hold it. It costs the path. There are two ways to use it: a
//! proportional law beyond a dead zone of the divergent component, and, where the balance law is
//! predictive, what that law itself asks for. While it asks, the follower stands back: it
//! would steer against it; afterwards it comes back over [`RETURN_TIME`].

use bikebot_dynamics::{BikeParams, Measurement};

use crate::params::BalanceParams;
use crate::predictive::SteeringRoom;
use crate::roll_model::RollModel;

/// Time constant with which the follower takes the steering back, s: the turn that is left over is
/// a trouble of its own, which the lean reference knows how to end.
const RETURN_TIME: f64 = 0.05;
/// An added yaw rate decays at `v/ell` under the follower; held back as it is, at half of that.
const HELD_BACK: f64 = 0.5;
/// Below this the predictive law does not ask for steering, rad/s: its solver's rounding.
const ASKS: f64 = 0.05;
/// Slower than this the predictive law does without steering, m/s: hardly any moment.
const LEAST_SPEED: f64 = 0.2;
/// The steering is not planned into a stop: it would take this long to reach it, s.
const STOP_TIME: f64 = 0.2;
const STOP_SHARE: f64 = 0.95;

/// The assist with what it has taken of the steering.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SteeringAssist {
    gain: f64,
    dead_zone: f64,
    /// Share of the steering that is the balance's: one while it asks.
    taken: f64,
}

impl SteeringAssist {
    /// The assist, if `params` ask for one.
    pub fn new(params: &BalanceParams) -> Option<Self> {
        params.steering_assist.then_some(Self {
            gain: params.assist_gain,
            dead_zone: params.assist_dead_zone,
            taken: 0.0,
        })
    }

    /// What is left of the follower's steering rate, rad/s.
    pub fn left_to_follower(&self, rate: f64, bike: &BikeParams) -> f64 {
        if self.taken == 0.0 {
            return rate;
        }
        rate.clamp(-bike.steer_rate_max, bike.steer_rate_max) * (1.0 - self.taken)
    }

    /// What the predictive law may do beside the follower's `rate`, rad/s.
    pub fn room(
        &self,
        m: &Measurement,
        bike: &BikeParams,
        model: &RollModel,
        look_ahead: f64,
        rate: f64,
    ) -> Option<SteeringRoom> {
        if m.speed < LEAST_SPEED {
            return None;
        }
        let limit = bike.steer_rate_max;
        let rate = rate.clamp(-limit, limit);
        let stop = STOP_SHARE * bike.steer_max();
        let cos = m.steer.cos();
        Some(SteeringRoom {
            yaw_gain: m.speed / (bike.wheelbase * cos * cos),
            decay: HELD_BACK * m.speed / look_ahead,
            centripetal: model.centripetal_arm() * m.speed,
            yaw_product: model.yaw_product(),
            range: (
                (-limit - rate).max((-stop - m.steer) / STOP_TIME).min(0.0),
                (limit - rate).min((stop - m.steer) / STOP_TIME).max(0.0),
            ),
        })
    }

    /// Notes how much the predictive law asks for, rad/s.
    pub fn take(&mut self, asked: f64, dt: f64) {
        if asked.abs() > ASKS {
            self.taken = 1.0;
        } else {
            self.taken *= (-dt / RETURN_TIME).exp();
            if self.taken < 1e-3 {
                self.taken = 0.0;
            }
        }
    }

    /// The proportional law, rad/s, for `error` rad of the divergent component.
    pub fn proportional(
        &self,
        error: f64,
        m: &Measurement,
        bike: &BikeParams,
        model: &RollModel,
    ) -> f64 {
        /// Below this speed steering makes hardly any moment, m/s.
        const SPEED_FLOOR: f64 = 0.4;
        /// The yaw rate is corrected within this time, s.
        const TIME: f64 = 0.1;
        let beyond = error - error.clamp(-self.dead_zone, self.dead_zone);
        let speed = m.speed.max(SPEED_FLOOR);
        let yaw_rate =
            -self.gain * model.toppling_stiffness() * beyond / (model.centripetal_arm() * speed);
        let cos = m.steer.cos();
        bike.wheelbase * cos * cos / speed * yaw_rate / TIME
    }
}
