//! The motors of the bike: every limit and every lag between a command and what happens.
//!
//! - Steering: a rate servo with a first-order lag from commanded to actual rate, a largest
//!   rate, and stops at both sides.
//! - Balancer: a largest torque; at and above the largest speed it can only brake.
//! - Drive: a largest force either way.
//!
//! [`Actuators::apply`] is called once per plant step and reports which limits were active.

use crate::params::BikeParams;

/// What a controller asks of the motors.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Command {
    /// Drive force at the rear contact, N.
    pub drive_force: f64,
    /// Steering rate, rad/s, positive to the left.
    pub steer_rate: f64,
    /// Torque of the frame on the balancer, N m.
    pub balancer_torque: f64,
}

/// Which limits were active during a step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Saturation {
    /// The drive force was clipped.
    pub drive_force: bool,
    /// The commanded steering rate was clipped.
    pub steer_rate: bool,
    /// The steering pushed against a stop.
    pub steer_stop: bool,
    /// The balancer torque was clipped.
    pub balancer_torque: bool,
    /// The balancer was at its largest speed and an accelerating torque was withheld.
    pub balancer_speed: bool,
}

impl Saturation {
    /// Whether any limit was active.
    #[must_use]
    pub fn any(&self) -> bool {
        self.drive_force
            || self.steer_rate
            || self.steer_stop
            || self.balancer_torque
            || self.balancer_speed
    }

    /// The limits active in either of two steps.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            drive_force: self.drive_force || other.drive_force,
            steer_rate: self.steer_rate || other.steer_rate,
            steer_stop: self.steer_stop || other.steer_stop,
            balancer_torque: self.balancer_torque || other.balancer_torque,
            balancer_speed: self.balancer_speed || other.balancer_speed,
        }
    }
}

/// What the motors do during one plant step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Applied {
    /// Drive force at the rear contact, N.
    pub drive_force: f64,
    /// Mean steering rate over the step, rad/s: the rate that carries the steering angle to
    /// exactly where the lagging servo has it at the end of the step.
    pub steer_rate: f64,
    /// Torque of the frame on the balancer, N m.
    pub balancer_torque: f64,
    /// The limits that were active.
    pub saturation: Saturation,
}

/// The motors with their limits; the only state is the steering servo's present rate.
#[derive(Debug, Clone, PartialEq)]
pub struct Actuators {
    drive_force_max: f64,
    steer_max: f64,
    steer_rate_max: f64,
    steer_lag: f64,
    balancer_torque_max: f64,
    balancer_speed_max: f64,
    steer_rate: f64,
}

impl Actuators {
    /// The motors of a bike, with the steering at rest.
    #[must_use]
    pub fn new(params: &BikeParams) -> Self {
        Self {
            drive_force_max: params.drive_force_max,
            steer_max: params.steer_max(),
            steer_rate_max: params.steer_rate_max,
            steer_lag: params.steer_lag,
            balancer_torque_max: params.balancer_torque_max,
            balancer_speed_max: params.balancer_speed_max,
            steer_rate: 0.0,
        }
    }

    /// The steering servo's present rate, rad/s.
    #[must_use]
    pub fn steer_rate(&self) -> f64 {
        self.steer_rate
    }

    /// The steering is held fast: its servo has no rate to carry on with.
    pub fn stop_steering(&mut self) {
        self.steer_rate = 0.0;
    }

    /// What the motors make of `command` over the next `dt` seconds, starting from steering
    /// angle `steer` (rad) and balancer speed `balancer_rate` (rad/s).
    ///
    /// A command that is not a number stays one, so that the fault is seen where it shows.
    pub fn apply(&mut self, command: &Command, steer: f64, balancer_rate: f64, dt: f64) -> Applied {
        let (drive_force, drive_clipped) = limited(command.drive_force, self.drive_force_max);
        let (target, rate_clipped) = limited(command.steer_rate, self.steer_rate_max);
        let (steer_rate, steer_stop) = self.turn_steering(target, steer, dt);
        let (balancer_torque, torque_clipped, speed_limited) =
            self.balancer_torque(command.balancer_torque, balancer_rate);
        Applied {
            drive_force,
            steer_rate,
            balancer_torque,
            saturation: Saturation {
                drive_force: drive_clipped,
                steer_rate: rate_clipped,
                steer_stop,
                balancer_torque: torque_clipped,
                balancer_speed: speed_limited,
            },
        }
    }

    /// The balancer motor alone: the torque (N m) it gives when `command` is asked of it at
    /// `balancer_rate` (rad/s), whether the torque was clipped, and whether the speed limit
    /// withheld it.
    #[must_use]
    pub fn balancer_torque(&self, command: f64, balancer_rate: f64) -> (f64, bool, bool) {
        let accelerates = command * balancer_rate > 0.0;
        if accelerates && balancer_rate.abs() >= self.balancer_speed_max {
            return (0.0, false, true);
        }
        let (torque, clipped) = limited(command, self.balancer_torque_max);
        (torque, clipped, false)
    }

    /// First-order lag `T ψ̈ = target − ψ̇`, solved exactly over the step, then the stops.
    fn turn_steering(&mut self, target: f64, steer: f64, dt: f64) -> (f64, bool) {
        if dt <= 0.0 {
            return (self.steer_rate, false);
        }
        let excess = self.steer_rate - target;
        let (end, mean) = if self.steer_lag > 0.0 {
            let fall = -(-dt / self.steer_lag).exp_m1();
            (
                target + excess * (1.0 - fall),
                target + excess * fall * self.steer_lag / dt,
            )
        } else {
            (target, target)
        };

        // The largest mean rates that end on a stop. A start beyond a stop may only come back.
        let left = ((self.steer_max - steer) / dt).max(0.0);
        let right = ((-self.steer_max - steer) / dt).min(0.0);
        if mean > left || mean < right {
            // The servo stands against the stop: it has no rate to carry on with.
            self.steer_rate = 0.0;
            (if mean > left { left } else { right }, true)
        } else {
            self.steer_rate = end;
            (mean, false)
        }
    }
}

/// `value` within `±limit`, and whether it had to be clipped. NaN passes through.
fn limited(value: f64, limit: f64) -> (f64, bool) {
    if value > limit {
        (limit, true)
    } else if value < -limit {
        (-limit, true)
    } else {
        (value, false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.0025;

    fn motors() -> Actuators {
        Actuators::new(&BikeParams::default())
    }

    fn steer_command(rate: f64) -> Command {
        Command {
            steer_rate: rate,
            ..Command::default()
        }
    }

    #[test]
    fn commands_within_the_limits_pass_unchanged() {
        let mut motors = motors();
        let command = Command {
            drive_force: 50.0,
            steer_rate: 0.0,
            balancer_torque: -30.0,
        };
        let applied = motors.apply(&command, 0.0, 10.0, DT);
        assert_eq!(applied.drive_force, 50.0);
        assert_eq!(applied.balancer_torque, -30.0);
        assert!(!applied.saturation.any());
    }

    #[test]
    fn every_limit_is_reported_when_it_is_active() {
        let mut motors = motors();
        let command = Command {
            drive_force: -500.0,
            steer_rate: 9.0,
            balancer_torque: 100.0,
        };
        let applied = motors.apply(&command, 0.0, 0.0, DT);
        assert_eq!(applied.drive_force, -120.0);
        assert_eq!(applied.balancer_torque, 70.0);
        let s = applied.saturation;
        assert!(s.drive_force && s.steer_rate && s.balancer_torque);
        assert!(!s.steer_stop && !s.balancer_speed && s.any());
        assert!(Saturation::default().or(s).drive_force);
    }

    #[test]
    fn at_its_largest_speed_the_balancer_only_brakes() {
        let motors = motors();
        assert_eq!(motors.balancer_torque(20.0, 40.0), (0.0, false, true));
        assert_eq!(motors.balancer_torque(-20.0, 40.0), (-20.0, false, false));
        assert_eq!(motors.balancer_torque(-200.0, -41.0), (0.0, false, true));
        assert_eq!(motors.balancer_torque(200.0, -41.0), (70.0, true, false));
        assert_eq!(motors.balancer_torque(20.0, 39.999), (20.0, false, false));
    }

    #[test]
    fn the_steering_rate_follows_a_step_with_the_servo_lag() {
        let mut motors = motors();
        let (mut steer, mut t) = (0.0, 0.0);
        for _ in 0..40 {
            steer += motors.apply(&steer_command(1.0), steer, 0.0, DT).steer_rate * DT;
            t += DT;
            // Step response: rate 1 − e^{−t/T}, angle t − T (1 − e^{−t/T}), T = 30 ms.
            let fall = 1.0 - (-t / 0.03_f64).exp();
            assert!((motors.steer_rate() - fall).abs() < 1e-13);
            assert!((steer - (t - 0.03 * fall)).abs() < 1e-13);
        }
    }

    #[test]
    fn the_step_length_does_not_change_where_the_steering_ends() {
        let ride = |steps: u32| {
            let mut motors = motors();
            let dt = 0.1 / f64::from(steps);
            let mut steer = 0.1;
            for _ in 0..steps {
                steer += motors
                    .apply(&steer_command(-1.5), steer, 0.0, dt)
                    .steer_rate
                    * dt;
            }
            steer
        };
        assert!((ride(10) - ride(1000)).abs() < 1e-12);
    }

    #[test]
    fn without_lag_the_rate_is_reached_at_once() {
        let mut motors = Actuators::new(&BikeParams {
            steer_lag: 0.0,
            ..BikeParams::default()
        });
        assert_eq!(
            motors.apply(&steer_command(0.7), 0.0, 0.0, DT).steer_rate,
            0.7
        );
        assert_eq!(motors.steer_rate(), 0.7);
    }

    #[test]
    fn the_steering_stops_exactly_at_its_stops_and_leaves_them_freely() {
        let mut motors = motors();
        let stop = 45f64.to_radians();
        let mut steer: f64 = 0.7;
        let mut touched = false;
        for _ in 0..200 {
            let applied = motors.apply(&steer_command(2.0), steer, 0.0, DT);
            steer += applied.steer_rate * DT;
            touched |= applied.saturation.steer_stop;
        }
        assert!(touched);
        // Rounding of steer + ((stop − steer)/dt) dt.
        assert!((steer - stop).abs() < 1e-15);
        assert_eq!(motors.steer_rate(), 0.0);
        let applied = motors.apply(&steer_command(-2.0), steer, 0.0, DT);
        assert!(applied.steer_rate < 0.0 && !applied.saturation.steer_stop);
    }

    #[test]
    fn a_command_that_is_not_a_number_is_not_hidden() {
        let mut motors = motors();
        let command = Command {
            drive_force: f64::NAN,
            steer_rate: 0.0,
            balancer_torque: f64::NAN,
        };
        let applied = motors.apply(&command, 0.0, 0.0, DT);
        assert!(applied.drive_force.is_nan() && applied.balancer_torque.is_nan());
    }
}
