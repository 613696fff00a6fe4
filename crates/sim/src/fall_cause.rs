//! Why a bike that falls over does: a fault that acts, a balancer at its limits, or neither.
//!
//! A tyre that slips and a wheel that lifts are their own cause ([`crate::monitor`]); what is left is a roll
//! that nobody stopped.

use crate::disturbance::Disturbances;
use crate::scenario::disturbance::{FaultIs, FaultOf};
use bikebot_dynamics::constants::GRAVITY;
use bikebot_dynamics::{BikeInput, BikeParams, BikeState};

/// Every reason a bike can fall for, as the recording and the tables name it.
pub const FALL_REASONS: [&str; 9] = [
    "balancer_stuck",
    "steering_stuck",
    "sensor_fault",
    "balancer_saturated",
    "roll",
    "slip",
    "wheel_lift",
    "not_finite",
    "control_failed",
];

/// A roll below this is upright enough for a fall not to have begun, rad.
const UPRIGHT: f64 = 3.0 * std::f64::consts::PI / 180.0;
/// Share of the fall in which the balancer was at a limit for the limit to be its cause.
const SATURATED_SHARE: f64 = 0.3;
/// What may be stronger than the parameters say, as a factor: a fall is only called early beyond doubt.
const DOUBT: f64 = 1.1;

/// Follows a roll from where it began.
#[derive(Debug, Clone, Copy, Default)]
pub struct FallCause {
    ticks: u32,
    saturated: u32,
}

impl FallCause {
    /// One tick: the true roll (rad), and whether the balancer is at a limit of torque or speed.
    pub fn watch(&mut self, roll: f64, balancer_saturated: bool) {
        if roll.abs() < UPRIGHT && !balancer_saturated {
            *self = Self::default();
            return;
        }
        self.ticks += 1;
        self.saturated += u32::from(balancer_saturated);
    }

    /// Why the bike falls at time `t` (s).
    #[must_use]
    pub fn name(&self, disturbances: &Disturbances, t: f64) -> &'static str {
        let stuck = |of| disturbances.has_fault(t, of, FaultIs::Stuck);
        if stuck(FaultOf::Balancer) {
            "balancer_stuck"
        } else if stuck(FaultOf::Steering) {
            "steering_stuck"
        } else if disturbances
            .faults(t)
            .any(|(_, fault)| !fault.of.is_motor())
        {
            "sensor_fault"
        } else if f64::from(self.saturated) >= SATURATED_SHARE * f64::from(self.ticks)
            && self.saturated > 0
        {
            "balancer_saturated"
        } else {
            "roll"
        }
    }
}

/// Whether no law can keep a bike in flywheel mode from falling: the largest balancer torque and the largest
/// moment that steering makes at this speed, both at once and from now on, do not stop its roll.
///
/// With the balancer on its pivot `a0 α̈ = b1 sin α − U`, whatever the balancer does within `|τ| ≤ τ_max`; so the
/// roll is stopped exactly if its energy does not carry it over `α*`, where `b1 sin α* = U`. Exact for the model;
/// a tenth more than the parameters say is granted. Never with an offset balancer, whose whirling mass
/// makes moments of another kind.
#[must_use]
pub fn is_beyond_recovery(bike: &BikeParams, state: &BikeState, input: &BikeInput) -> bool {
    if input.offset.d.abs() > 1e-9 || input.offset.rate != 0.0 {
        return false;
    }
    let lumped = bike.lumped(0.0);
    let lean = bike.lean_coefficients(0.0);
    let (roll, rate) = (state.roll.abs(), state.roll_rate * state.roll.signum());
    if rate <= 0.0 {
        return false;
    }
    let steer_max = bike.steer_max().max(state.steer.abs());
    let speed = state.speed.abs();
    let centripetal =
        (speed * speed * steer_max.tan() / bike.wheelbase).min(bike.friction * GRAVITY);
    let yaw = speed * bike.steer_rate_max / (bike.wheelbase * steer_max.cos().powi(2));
    let outside = input.roll_moment.abs() + input.push.roll_moment(state.roll).abs();
    let moment = DOUBT
        * (bike.balancer_torque_max
            + lean.centrifugal * centripetal
            + lean.yaw.abs() * yaw
            + outside);
    if moment >= lumped.b1 {
        return false;
    }
    let edge = (moment / lumped.b1).asin();
    if roll >= edge {
        return true;
    }
    let energy = 0.5 * lumped.a0 * rate * rate;
    let barrier = moment * (edge - roll) - lumped.b1 * (roll.cos() - edge.cos());
    energy > barrier
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::disturbance::{Disturbance, FaultSection};
    use bikebot_dynamics::{Integrator, Rk4, TwoLink, TwoLinkInput, TwoLinkState};
    use bikebot_geometry::Pose2;

    fn leaning(roll: f64, roll_rate: f64) -> BikeState {
        BikeState {
            roll,
            roll_rate,
            ..BikeState::upright(Pose2::new(0.0, 0.0, 0.0), 0.0)
        }
    }

    /// Whether full torque, a tenth above what the motor has, keeps a standing bike from lying down.
    fn is_held_by_full_torque(roll: f64, roll_rate: f64) -> bool {
        let bike = BikeParams::default();
        let plant = TwoLink::new(&bike, 0.0);
        let mut state = TwoLinkState {
            roll,
            roll_rate,
            ..TwoLinkState::default()
        };
        let input = TwoLinkInput {
            balancer_torque: DOUBT * bike.balancer_torque_max,
            roll_moment: 0.0,
        };
        for i in 0..20_000 {
            state = Rk4.step(&plant, f64::from(i) * 1e-3, &state, &input, 1e-3);
            if state.roll_rate <= 0.0 {
                return true;
            }
            if state.roll > 1.2 {
                return false;
            }
        }
        false
    }

    #[test]
    fn the_bound_is_that_of_full_torque_from_now_on() {
        let bike = BikeParams::default();
        for roll in [0.02, 0.1, 0.2, 0.26] {
            for rate in [0.05, 0.3, 0.6, 0.8, 0.9, 1.0, 1.2] {
                let state = leaning(roll, rate);
                assert_eq!(
                    is_beyond_recovery(&bike, &state, &BikeInput::default()),
                    !is_held_by_full_torque(roll, rate),
                    "{roll} {rate}"
                );
                // The other side is its mirror image.
                let mirrored = leaning(-roll, -rate);
                assert_eq!(
                    is_beyond_recovery(&bike, &state, &BikeInput::default()),
                    is_beyond_recovery(&bike, &mirrored, &BikeInput::default())
                );
            }
        }
    }

    #[test]
    fn a_bike_that_rights_itself_is_not_given_up() {
        let bike = BikeParams::default();
        assert!(!is_beyond_recovery(
            &bike,
            &leaning(0.3, -0.1),
            &BikeInput::default()
        ));
        // At 3 m/s steering alone makes more moment than gravity.
        let fast = BikeState {
            speed: 3.0,
            ..leaning(0.3, 0.5)
        };
        assert!(!is_beyond_recovery(&bike, &fast, &BikeInput::default()));
    }

    #[test]
    fn a_fault_is_named_before_the_limit_it_led_to() {
        let fault = Disturbance::Fault(FaultSection {
            of: FaultOf::Balancer,
            ..FaultSection::default()
        });
        let none = Disturbances::new(&[], &BikeParams::default());
        let stuck = Disturbances::new(&[fault], &BikeParams::default());
        let mut cause = FallCause::default();
        assert_eq!(cause.name(&none, 1.0), "roll");
        for i in 0..10 {
            cause.watch(0.1, i % 2 == 0);
        }
        assert_eq!(cause.name(&none, 1.0), "balancer_saturated");
        assert_eq!(cause.name(&stuck, 1.0), "balancer_stuck");
        // Upright again, all is forgotten.
        cause.watch(0.0, false);
        assert_eq!(cause.name(&none, 1.0), "roll");
    }
}
