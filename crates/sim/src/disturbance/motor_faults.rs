//! Motors that lag, weaken or jam.

use super::Disturbances;
use crate::scenario::disturbance::{FaultIs, FaultOf};
use bikebot_dynamics::{BikeParams, Command, Saturation};

/// Bends a command as the faulty motors do, before their own limits.
#[derive(Debug, Clone)]
pub struct MotorFaults {
    limits: Command,
    /// What the lagging motors follow; `None` before the first step and without a lag.
    lagging: [Option<f64>; 3],
}

/// What is left of a command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bent {
    /// What the motors make of the command, before their own limits.
    pub command: Command,
    /// Which of them a fault has cut.
    pub saturation: Saturation,
    /// The steering does not move.
    pub steering_is_stuck: bool,
    /// The balancer does not move against the frame.
    pub balancer_is_stuck: bool,
}

impl MotorFaults {
    /// The motors of the true bike.
    #[must_use]
    pub fn new(bike: &BikeParams) -> Self {
        Self {
            limits: Command {
                drive_force: bike.drive_force_max,
                steer_rate: bike.steer_rate_max,
                balancer_torque: bike.balancer_torque_max,
            },
            lagging: [None; 3],
        }
    }

    /// What becomes of `command` from `t` to `t + dt` (s).
    pub fn bend(
        &mut self,
        disturbances: &Disturbances,
        t: f64,
        dt: f64,
        command: &Command,
    ) -> Bent {
        let mut bent = Bent {
            command: *command,
            saturation: Saturation::default(),
            steering_is_stuck: false,
            balancer_is_stuck: false,
        };
        let mut lags = [false; 3];
        for (_, fault) in disturbances.faults(t) {
            let motor = match fault.of {
                FaultOf::Drive => 0,
                FaultOf::Steering => 1,
                FaultOf::Balancer => 2,
                _ => continue,
            };
            let (value, limit) = match motor {
                0 => (&mut bent.command.drive_force, self.limits.drive_force),
                1 => (&mut bent.command.steer_rate, self.limits.steer_rate),
                _ => (
                    &mut bent.command.balancer_torque,
                    self.limits.balancer_torque,
                ),
            };
            match (fault.is, fault.lag_s, fault.limit_share) {
                (FaultIs::Lag, Some(lag), _) => {
                    lags[motor] = true;
                    let from = self.lagging[motor].unwrap_or(*value);
                    // First order, exact over the step; the mean of the step is its end but for O(dt/lag).
                    let end = *value + (from - *value) * (-dt / lag).exp();
                    self.lagging[motor] = Some(end);
                    *value = end;
                }
                (FaultIs::Limit, _, Some(share)) => {
                    let limit = share * limit;
                    if value.abs() > limit {
                        *value = value.clamp(-limit, limit);
                        match motor {
                            0 => bent.saturation.drive_force = true,
                            1 => bent.saturation.steer_rate = true,
                            _ => bent.saturation.balancer_torque = true,
                        }
                    }
                }
                (FaultIs::Stuck, ..) => {
                    bent.steering_is_stuck |= motor == 1;
                    bent.balancer_is_stuck |= motor == 2;
                }
                _ => {}
            }
        }
        for (lagging, lags) in self.lagging.iter_mut().zip(lags) {
            if !lags {
                *lagging = None;
            }
        }
        bent
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::disturbance::{Disturbance, FaultSection};

    const DT: f64 = 0.0025;

    fn bent(fault: FaultSection, command: Command, steps: usize) -> Vec<Bent> {
        let bike = BikeParams::default();
        let disturbances = Disturbances::new(&[Disturbance::Fault(fault)], &bike);
        let mut motors = MotorFaults::new(&bike);
        // The first step is at rest, so that a lag has something to start from.
        motors.bend(&disturbances, 0.0, DT, &Command::default());
        (1..=steps)
            .map(|i| motors.bend(&disturbances, i as f64 * DT, DT, &command))
            .collect()
    }

    #[test]
    fn a_lagging_balancer_follows_a_step_with_its_time_constant() {
        let fault = FaultSection {
            of: FaultOf::Balancer,
            is: FaultIs::Lag,
            lag_s: Some(0.05),
            ..FaultSection::default()
        };
        let command = Command {
            balancer_torque: 10.0,
            ..Command::default()
        };
        let found = bent(fault, command, 20);
        for (i, bent) in found.iter().enumerate() {
            let t = (i + 1) as f64 * DT;
            let wanted = 10.0 * (1.0 - (-t / 0.05).exp());
            assert!((bent.command.balancer_torque - wanted).abs() < 1e-12);
        }
    }

    #[test]
    fn a_weak_motor_gives_its_share_and_says_so() {
        let fault = FaultSection {
            of: FaultOf::Balancer,
            is: FaultIs::Limit,
            limit_share: Some(0.25),
            ..FaultSection::default()
        };
        let command = Command {
            balancer_torque: -60.0,
            steer_rate: 1.0,
            ..Command::default()
        };
        let found = bent(fault, command, 1)[0];
        assert_eq!(found.command.balancer_torque, -17.5);
        assert_eq!(found.command.steer_rate, 1.0);
        assert!(found.saturation.balancer_torque && !found.saturation.steer_rate);
    }

    #[test]
    fn stuck_is_told_of_the_part_that_is() {
        let found = bent(FaultSection::default(), Command::default(), 1)[0];
        assert!(found.steering_is_stuck && !found.balancer_is_stuck);
    }

    #[test]
    fn a_fault_that_is_over_leaves_nothing_behind() {
        let fault = FaultSection {
            of: FaultOf::Steering,
            is: FaultIs::Lag,
            lag_s: Some(0.5),
            duration_s: Some(4.0 * DT),
            ..FaultSection::default()
        };
        let command = Command {
            steer_rate: 1.0,
            ..Command::default()
        };
        let found = bent(fault, command, 6);
        assert!(found[0].command.steer_rate < 0.1);
        assert_eq!(found[5].command.steer_rate, 1.0);
    }
}
