//! Sensors that fall silent, drift or are late.

use super::Disturbances;
use crate::clock::Period;
use crate::scenario::disturbance::{Disturbance, FaultIs, FaultOf, FaultSection};
use bikebot_dynamics::Measurement;
use bikebot_geometry::Pose2;
use std::collections::VecDeque;

/// Bends a measurement as the faulty sensors do.
#[derive(Debug, Clone)]
pub struct SensorFaults {
    tick: f64,
    wheelbase: f64,
    /// A localiser that is silent goes on by odometry.
    odometry: bool,
    /// The newest measurements, the latest last, as far back as the longest delay.
    past: VecDeque<Measurement>,
    /// What was said last before a silence, by the number of the disturbance.
    held: Vec<Option<Measurement>>,
    /// What the controller was told at the last tick.
    last: Option<Measurement>,
}

impl SensorFaults {
    /// Sensors read once every `tick`, on a bike with this believed `wheelbase` (m).
    #[must_use]
    pub fn new(sections: &[Disturbance], tick: Period, wheelbase: f64, odometry: bool) -> Self {
        let longest = sections
            .iter()
            .filter_map(|section| match section {
                Disturbance::Fault(fault) => fault.delay_s,
                _ => None,
            })
            .fold(0.0, f64::max);
        let tick = tick.seconds();
        Self {
            tick,
            wheelbase,
            odometry,
            past: VecDeque::with_capacity((longest / tick).round() as usize + 1),
            held: vec![None; sections.len()],
            last: None,
        }
    }

    /// What the controller is told at time `t` (s) of what the sensors measured.
    pub fn bend(
        &mut self,
        disturbances: &Disturbances,
        t: f64,
        measured: &Measurement,
    ) -> Measurement {
        if self.past.len() == self.past.capacity() {
            self.past.pop_front();
        }
        self.past.push_back(*measured);
        let mut told = *measured;
        let mut silent = vec_of_false(self.held.len());
        for (index, fault) in disturbances
            .faults(t)
            .filter(|(_, fault)| !fault.of.is_motor())
        {
            match fault.is {
                FaultIs::Delay => {
                    let ticks = (fault.delay_s.unwrap_or(0.0) / self.tick).round() as usize;
                    let from = self.past.len().saturating_sub(1 + ticks);
                    if let Some(old) = self.past.get(from) {
                        take(&mut told, old, fault.of);
                    }
                }
                FaultIs::Bias => add_bias(&mut told, fault),
                FaultIs::Dropout => {
                    silent[index] = true;
                    let mut held = self.held[index].or(self.last).unwrap_or(*measured);
                    if fault.of == FaultOf::Pose && self.odometry && self.last.is_some() {
                        held.pose = self.dead_reckoned(&held.pose, measured);
                    }
                    take(&mut told, &held, fault.of);
                    self.held[index] = Some(held);
                }
                FaultIs::Stuck | FaultIs::Lag | FaultIs::Limit => {}
            }
        }
        for (held, silent) in self.held.iter_mut().zip(silent) {
            if !silent {
                *held = None;
            }
        }
        self.last = Some(told);
        told
    }

    /// One tick further from `pose`, along the arc of the measured speed and steering.
    fn dead_reckoned(&self, pose: &Pose2, measured: &Measurement) -> Pose2 {
        let way = measured.speed * self.tick;
        let turn = way * measured.steer.tan() / self.wheelbase;
        let (sin, cos) = (0.5 * turn).sin_cos();
        pose.compose(&Pose2::new(way * cos, way * sin, turn))
    }
}

fn vec_of_false(length: usize) -> Vec<bool> {
    vec![false; length]
}

/// Takes from `other` what this sensor says.
fn take(told: &mut Measurement, other: &Measurement, of: FaultOf) {
    match of {
        FaultOf::Roll => told.roll = other.roll,
        FaultOf::RollRate => told.roll_rate = other.roll_rate,
        FaultOf::Imu => (told.roll, told.roll_rate) = (other.roll, other.roll_rate),
        FaultOf::Speed => told.speed = other.speed,
        FaultOf::SteerEncoder => (told.steer, told.steer_rate) = (other.steer, other.steer_rate),
        FaultOf::BalancerEncoder => {
            (told.balancer, told.balancer_rate) = (other.balancer, other.balancer_rate);
        }
        FaultOf::Pose => told.pose = other.pose,
        FaultOf::Steering | FaultOf::Balancer | FaultOf::Drive => {}
    }
}

fn add_bias(told: &mut Measurement, fault: &FaultSection) {
    let angle = fault.bias_deg.unwrap_or(0.0).to_radians();
    let rate = fault.bias_radps.unwrap_or(0.0);
    match fault.of {
        FaultOf::Roll => told.roll += angle,
        FaultOf::RollRate => told.roll_rate += rate,
        FaultOf::Imu => {
            told.roll += angle;
            told.roll_rate += rate;
        }
        FaultOf::Speed => told.speed += fault.bias_mps.unwrap_or(0.0),
        FaultOf::SteerEncoder => told.steer += angle,
        FaultOf::BalancerEncoder => told.balancer += angle,
        FaultOf::Pose => {
            let aside = Pose2::new(0.0, fault.bias_m.unwrap_or(0.0), angle);
            told.pose = told.pose.compose(&aside);
        }
        FaultOf::Steering | FaultOf::Balancer | FaultOf::Drive => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_dynamics::{BikeParams, BikeState};

    const TICK: f64 = 0.005;

    /// What is told at each of a hundred ticks of a bike that turns, leans ever more and moves on.
    fn told(fault: FaultSection) -> Vec<(Measurement, Measurement)> {
        let sections = [Disturbance::Fault(fault)];
        let disturbances = Disturbances::new(&sections, &BikeParams::default());
        let tick = Period::from_seconds(TICK).expect("whole nanoseconds");
        let mut faults = SensorFaults::new(&sections, tick, 1.12, true);
        (0..100)
            .map(|i| {
                let t = f64::from(i) * TICK;
                let mut state = BikeState::upright(Pose2::new(t, 0.0, 0.0), 1.0);
                state.roll = t;
                state.roll_rate = 1.0;
                let measured = Measurement::ideal(&state, 0.0);
                (measured, faults.bend(&disturbances, t, &measured))
            })
            .collect()
    }

    fn fault(of: FaultOf, is: FaultIs) -> FaultSection {
        FaultSection {
            of,
            is,
            time_s: Some(0.1),
            duration_s: Some(0.2),
            ..FaultSection::default()
        }
    }

    #[test]
    fn a_silent_sensor_repeats_what_it_said_last_and_then_speaks_again() {
        for (i, (truth, told)) in told(fault(FaultOf::Roll, FaultIs::Dropout))
            .iter()
            .enumerate()
        {
            let wanted = if (20..60).contains(&i) {
                19.0 * TICK
            } else {
                truth.roll
            };
            assert!((told.roll - wanted).abs() < 1e-12, "tick {i}");
            assert_eq!(told.roll_rate, truth.roll_rate);
        }
    }

    #[test]
    fn a_silent_localiser_goes_on_by_odometry() {
        for (truth, told) in told(fault(FaultOf::Pose, FaultIs::Dropout)) {
            // Straight ahead at a constant speed, dead reckoning is exact.
            assert!((told.pose.position - truth.pose.position).norm() < 1e-12);
        }
    }

    #[test]
    fn a_late_sensor_says_what_was() {
        let late = FaultSection {
            delay_s: Some(0.03),
            ..fault(FaultOf::Imu, FaultIs::Delay)
        };
        for (i, (truth, told)) in told(late).iter().enumerate() {
            let late = if (20..60).contains(&i) {
                6.0 * TICK
            } else {
                0.0
            };
            assert!((told.roll - (truth.roll - late)).abs() < 1e-12, "tick {i}");
        }
    }

    #[test]
    fn a_bias_is_added_in_its_own_unit() {
        let biased = FaultSection {
            bias_deg: Some(2.0),
            bias_radps: Some(-0.1),
            ..fault(FaultOf::Imu, FaultIs::Bias)
        };
        let told = told(biased);
        assert!((told[30].1.roll - told[30].0.roll - 2f64.to_radians()).abs() < 1e-12);
        assert!((told[30].1.roll_rate - told[30].0.roll_rate + 0.1).abs() < 1e-12);
        assert_eq!(told[10].0, told[10].1);
        let aside = FaultSection {
            bias_m: Some(0.3),
            ..fault(FaultOf::Pose, FaultIs::Bias)
        };
        assert!((self::told(aside)[30].1.pose.position.y - 0.3).abs() < 1e-12);
    }
}
