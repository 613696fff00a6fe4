//! Plane motion without slip and nothing else: the smallest plant a path follower can ride.

use bikebot_geometry::{Pose2, angle};
use nalgebra::SVector;

use crate::plant::{Plant, State};

/// Where the bike is, how it steers and how fast it rolls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KinematicState {
    /// Rear contact point (m) and heading (rad, counter-clockwise from x).
    pub pose: Pose2,
    /// Ground-projected steering angle `ψ`, rad, positive to the left.
    pub steer: f64,
    /// Speed `v` of the rear contact along the heading, m/s.
    pub speed: f64,
}

impl State for KinematicState {
    /// `[ẋ, ẏ, θ̇, ψ̇, v̇]`.
    type Rate = SVector<f64, 5>;

    fn moved(&self, rate: &SVector<f64, 5>, dt: f64) -> Self {
        Self {
            pose: Pose2::new(
                self.pose.position.x + rate[0] * dt,
                self.pose.position.y + rate[1] * dt,
                angle::wrap(self.pose.heading + rate[2] * dt),
            ),
            steer: self.steer + rate[3] * dt,
            speed: self.speed + rate[4] * dt,
        }
    }
}

/// What drives the plane motion.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct KinematicInput {
    /// `v̇`, m/s².
    pub acceleration: f64,
    /// `ψ̇`, rad/s.
    pub steer_rate: f64,
}

/// `ẋ = v cos θ`, `ẏ = v sin θ`, `θ̇ = v tan ψ / w`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kinematic {
    /// Distance `w` between the wheel contacts, m.
    pub wheelbase: f64,
}

impl Plant for Kinematic {
    type State = KinematicState;
    type Input = KinematicInput;

    fn rate(&self, _t: f64, state: &KinematicState, input: &KinematicInput) -> SVector<f64, 5> {
        let (sin, cos) = state.pose.heading.sin_cos();
        SVector::from([
            state.speed * cos,
            state.speed * sin,
            state.speed * state.steer.tan() / self.wheelbase,
            input.steer_rate,
            input.acceleration,
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrator::{Integrator, Rk4};

    #[test]
    fn constant_steering_rides_a_circle_back_to_its_start() {
        let plant = Kinematic { wheelbase: 1.12 };
        let start = KinematicState {
            pose: Pose2::new(2.0, -1.0, 0.3),
            steer: 0.4,
            speed: 1.5,
        };
        let radius = 1.12 / 0.4_f64.tan();
        let turn = std::f64::consts::TAU * radius / 1.5;
        let steps = 2000;
        let dt = turn / f64::from(steps);
        let mut state = start;
        for i in 0..steps {
            state = Rk4.step(
                &plant,
                f64::from(i) * dt,
                &state,
                &KinematicInput::default(),
                dt,
            );
        }
        assert!((state.pose.position - start.pose.position).norm() < 1e-9);
        assert!(angle::difference(state.pose.heading, start.pose.heading).abs() < 1e-12);
    }

    #[test]
    fn braking_stops_after_v_squared_over_twice_the_deceleration() {
        let plant = Kinematic { wheelbase: 1.0 };
        let start = KinematicState {
            pose: Pose2::new(0.0, 0.0, 0.0),
            steer: 0.0,
            speed: 2.0,
        };
        let input = KinematicInput {
            acceleration: -0.5,
            steer_rate: 0.0,
        };
        let end = Rk4.step(&plant, 0.0, &start, &input, 4.0);
        assert!(end.speed.abs() < 1e-15);
        assert!((end.pose.position.x - 4.0).abs() < 1e-13);
    }
}
