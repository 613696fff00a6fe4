//! Tyre forces and wheel loads of the simplified bike — §5.3.
//!
//! The constraint forces that keep the wheels from slipping sideways and the ground from
//! being left, computed from the motion. They say whether the motion was possible: a wheel
//! whose friction use exceeds one would have slipped, a wheel with no load would have lifted.

use crate::bike::{Bike, BikeInput, BikeState};
use crate::constants::GRAVITY;
use crate::inertia::Moments;
use crate::params::Offset;

/// Forces of the ground on the two tyres, N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactForces {
    /// Drive force at the rear wheel along the heading.
    pub drive: f64,
    /// Lateral force at the rear wheel, positive to the left of the heading.
    pub rear_lateral: f64,
    /// Lateral force at the front wheel, positive along the front wheel's left normal.
    pub front_normal: f64,
    /// Vertical load of the rear wheel; zero or negative means the wheel has lifted.
    pub rear_load: f64,
    /// Vertical load of the front wheel; zero or negative means the wheel has lifted.
    pub front_load: f64,
    /// Whether a loaded tyre is seen to slide. A model that forbids sliding says `false`, and its friction use
    /// exceeds one instead.
    pub slides: bool,
}

impl ContactForces {
    /// The coefficient of friction the rear wheel asks for, `√(F² + F_yr²)/N_r`; infinite
    /// once the wheel has lifted, which is outside the model.
    #[must_use]
    pub fn friction_demand_rear(&self) -> f64 {
        demand(self.drive.hypot(self.rear_lateral), self.rear_load)
    }

    /// The coefficient of friction the front wheel asks for, `|F_f|/N_f`; infinite once the
    /// wheel has lifted.
    #[must_use]
    pub fn friction_demand_front(&self) -> f64 {
        demand(self.front_normal.abs(), self.front_load)
    }

    /// Share of the friction `mu` (−) the rear wheel uses; it slips above one.
    #[must_use]
    pub fn friction_use_rear(&self, mu: f64) -> f64 {
        self.friction_demand_rear() / mu
    }

    /// Share of the friction `mu` (−) the front wheel uses; it slips above one.
    #[must_use]
    pub fn friction_use_front(&self, mu: f64) -> f64 {
        self.friction_demand_front() / mu
    }

    /// Whether both wheels press on the ground.
    #[must_use]
    pub fn both_wheels_down(&self) -> bool {
        self.rear_load > 0.0 && self.front_load > 0.0
    }
}

fn demand(force: f64, load: f64) -> f64 {
    if load > 0.0 {
        force / load
    } else {
        f64::INFINITY
    }
}

impl Bike {
    /// The forces of the ground while the bike moves in `state` under `input`.
    #[must_use]
    pub fn contact_forces(&self, state: &BikeState, input: &BikeInput) -> ContactForces {
        let p = &self.params;
        let q = Moments::new(p, state, &input.offset);
        let acceleration = self.accelerations(state, input);
        let Offset {
            d,
            rate: d_dot,
            acceleration: d_ddot,
        } = input.offset;
        let (sa, ca, sf, cf) = (q.sin_alpha, q.cos_alpha, q.sin_phi, q.cos_phi);
        let v = state.speed;
        let omega = self.yaw_rate(state);
        let (v_dot, omega_dot) = (acceleration.speed, acceleration.yaw);
        let (alpha_dot, alpha_ddot) = (state.roll_rate, acceleration.roll);
        let (beta_dot, beta_ddot) = (state.balancer_rate, acceleration.balancer);
        let phi_dot = alpha_dot + beta_dot;
        let phi_ddot = alpha_ddot + beta_ddot;
        let m = p.mass();

        // Accelerations of points on the two arms, per unit of arm, across and up.
        let frame_y = -(ca * alpha_ddot - sa * alpha_dot * alpha_dot);
        let frame_z = -(sa * alpha_ddot + ca * alpha_dot * alpha_dot);
        let arm_y = -(cf * phi_ddot - sf * phi_dot * phi_dot);
        let arm_z = -(sf * phi_ddot + cf * phi_dot * phi_dot);
        let (y1_dot, y1_ddot, z1_ddot) = (-p.h1 * ca * alpha_dot, p.h1 * frame_y, p.h1 * frame_z);
        let y2_dot = -p.l * ca * alpha_dot - d * cf * phi_dot - d_dot * sf;
        let y2_ddot = p.l * frame_y + d * arm_y - 2.0 * d_dot * cf * phi_dot - d_ddot * sf;
        let z2_ddot = p.l * frame_z + d * arm_z - 2.0 * d_dot * sf * phi_dot + d_ddot * cf;

        // Sideways and about the vertical.
        let side_momentum = omega * q.sx + q.sy_rate;
        let side_momentum_rate = omega_dot * q.sx + p.m1 * y1_ddot + p.m2 * y2_ddot;
        let lateral = side_momentum_rate + omega * (m * v - omega * q.sy) - input.push.left;
        let yaw_momentum_rate = -v_dot * q.sy - v * q.sy_rate + omega_dot * q.j + omega * q.j_rate
            - q.a_a * alpha_ddot
            - q.a_a_rate * alpha_dot
            - q.a_b * beta_ddot
            - q.a_b_rate * beta_dot
            - q.a_d * d_ddot
            - q.a_d_rate * d_dot;
        // The slope's pull acts beside the wheel line as the centre of gravity leans out.
        let slope_yaw = -input.slope_force * q.sy / m;
        let yaw_moment =
            yaw_momentum_rate + v * side_momentum - slope_yaw - input.push.yaw_moment(state.roll);
        let front_normal = yaw_moment / (p.wheelbase * state.steer.cos());
        let rear_lateral = lateral - yaw_moment / p.wheelbase;

        // Up, and about the lateral axis.
        let total_load = m * GRAVITY + p.m1 * z1_ddot + p.m2 * z2_ddot;
        let ax = |x: f64, y: f64, y_dot: f64| {
            v_dot - omega_dot * y - 2.0 * omega * y_dot - omega * omega * x
        };
        let translation = p.m1 * (q.z1 * ax(p.x1, q.y1, y1_dot) - p.x1 * z1_ddot)
            + p.m2 * (q.z2 * ax(p.x2, q.y2, y2_dot) - p.x2 * z2_ddot);
        // d/dt of ω sin cos (Iy − Iz), and the gyroscopic moment of the rolling body.
        let pitch = |sin: f64, cos: f64, difference: f64, i_x: f64, rate: f64| {
            difference * (omega_dot * sin * cos + omega * (cos * cos - sin * sin) * rate)
                + omega * i_x * rate
        };
        let rotation = pitch(sa, ca, p.i1y - p.i1z, p.i1x, alpha_dot)
            + pitch(sf, cf, p.i2y - p.i2z, p.i2x, phi_dot)
            - p.i1xz * (frame_z + omega * omega * ca);
        let slope_pitch = input.slope_force * q.hz / m;
        let push_pitch = input.push.pitch_moment(state.roll);
        let front_load =
            (GRAVITY * q.sx + slope_pitch + push_pitch - translation - rotation) / p.wheelbase;

        ContactForces {
            drive: input.drive_force,
            rear_lateral,
            front_normal,
            rear_load: total_load - front_load,
            front_load,
            slides: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::BikeParams;
    use approx::assert_relative_eq;
    use bikebot_geometry::Pose2;

    fn bike() -> Bike {
        Bike::new(BikeParams::default())
    }

    fn rolling(speed: f64) -> BikeState {
        BikeState::upright(Pose2::new(0.0, 0.0, 0.0), speed)
    }

    #[test]
    fn a_standing_bike_presses_with_its_weight_by_the_lever_rule() {
        let forces = bike().contact_forces(&rolling(0.0), &BikeInput::default());
        let front = GRAVITY * (38.0 * 0.48 + 12.0 * 0.30) / 1.12;
        assert_relative_eq!(forces.front_load, front, max_relative = 1e-14);
        assert_relative_eq!(
            forces.rear_load,
            50.0 * GRAVITY - front,
            max_relative = 1e-14
        );
        assert_eq!(forces.rear_lateral, 0.0);
        assert_eq!(forces.front_normal, 0.0);
        assert!(forces.both_wheels_down());
    }

    #[test]
    fn driving_loads_the_rear_wheel_and_climbing_does_so_without_accelerating() {
        let bike = bike();
        let still = bike.contact_forces(&rolling(1.0), &BikeInput::default());
        let driving = BikeInput {
            drive_force: 50.0,
            ..BikeInput::default()
        };
        let climbing = BikeInput {
            slope_force: -50.0,
            ..driving
        };
        // Load transfer F h/w with the common centre of gravity at h.
        let h = (38.0 * 0.52 + 12.0 * 0.80) / 50.0;
        for input in [driving, climbing] {
            let forces = bike.contact_forces(&rolling(1.0), &input);
            let transfer = still.front_load - forces.front_load;
            assert_relative_eq!(transfer, 50.0 * h / 1.12, max_relative = 1e-12);
        }
        assert!(bike.accelerations(&rolling(1.0), &climbing).speed.abs() < 1e-15);
    }

    #[test]
    fn a_push_at_the_centre_of_percussion_leaves_the_tyres_alone() {
        // A body hit where it would turn about the ground line asks nothing of the ground sideways:
        // at the height a0/(m h) with the balancer free, and above or below it the tyres hold back or on.
        let bike = bike();
        let lumped = bike.params.lumped(0.0);
        let moment = 38.0 * 0.52 + 12.0 * 0.80;
        let height = lumped.a0 / moment;
        let pushed = |height: f64| {
            let forces = bike.contact_forces(
                &rolling(1.0),
                &BikeInput {
                    push: crate::bike::Push::at(0.0, -100.0, 0.437, height),
                    ..BikeInput::default()
                },
            );
            forces.rear_lateral + forces.front_normal
        };
        assert!(pushed(height).abs() < 1e-10, "{}", pushed(height));
        assert!(pushed(0.0) > 99.0 && pushed(2.0 * height) < -99.0);
    }

    #[test]
    fn a_left_turn_is_held_by_forces_to_the_left_that_sum_to_the_centripetal_force() {
        let bike = bike();
        let steer = (1.12_f64 / 3.0).atan();
        // The steady lean of this turn.
        let state = BikeState {
            steer,
            roll: -4.302_f64.to_radians(),
            ..rolling(1.5)
        };
        let forces = bike.contact_forces(&state, &BikeInput::default());
        assert!(forces.rear_lateral > 0.0 && forces.front_normal > 0.0);
        let lateral = forces.rear_lateral + forces.front_normal * steer.cos();
        let q = Moments::new(&bike.params, &state, &Offset::fixed(0.0));
        // m v ω − ω² SY: the centre of gravity leans into the turn. The remaining roll
        // acceleration of the rounded lean is below 1e-3 rad/s².
        let centripetal = 50.0 * 1.5 * 0.5 - 0.25 * q.sy;
        assert_relative_eq!(lateral, centripetal, epsilon = 0.03);
    }

    #[test]
    fn friction_use_is_demand_over_friction_and_infinite_for_a_lifted_wheel() {
        let forces = ContactForces {
            drive: 30.0,
            rear_lateral: -40.0,
            front_normal: -35.0,
            rear_load: 250.0,
            front_load: 100.0,
            slides: false,
        };
        assert_eq!(forces.friction_demand_rear(), 0.2);
        assert_eq!(forces.friction_demand_front(), 0.35);
        assert_eq!(forces.friction_use_rear(0.5), 0.4);
        assert_eq!(forces.friction_use_front(0.7), 0.5);
        let lifted = ContactForces {
            rear_load: -1.0,
            ..forces
        };
        assert_eq!(lifted.friction_use_rear(0.7), f64::INFINITY);
        assert!(!lifted.both_wheels_down());
    }
}
