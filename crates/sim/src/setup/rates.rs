//! The rates of a scenario: they divide one another, and a run has an end.

use super::{MAX_TICKS, Resolver, SetupError};
use crate::clock::{ClockError, Period, SimTime};
use crate::scenario::{Disturbance, PlantModel};

/// Longest step of the rigid-body model, s.
const RIGID_STEP_MAX: f64 = 0.002;

impl Resolver<'_> {
    pub(super) fn rates(&self) -> Result<(Period, Period), SetupError> {
        let plant = &self.scenario.plant;
        let period = |key: &str, seconds: f64| {
            Period::from_seconds(seconds).or_else(|_| {
                self.refuse(
                    key,
                    format!("`{key}` is {seconds} s, which is not a whole number of nanoseconds"),
                    "use a value such as 0.0025",
                )
            })
        };
        let step = period("plant.step_s", plant.step_s)?;
        let control = period("plant.control_s", plant.control_s)?;
        if let Err(ClockError::DoesNotDivide { .. }) = control.in_steps_of(step) {
            return self.refuse(
                "plant.step_s",
                format!(
                    "`plant.step_s` = {} does not divide `plant.control_s` = {}",
                    plant.step_s, plant.control_s
                ),
                "choose the step so that the control period is a whole number of steps, such as 0.0025 in 0.005",
            );
        }
        if plant.model == PlantModel::Rapier3d && plant.step_s > RIGID_STEP_MAX {
            return self.refuse(
                "plant.step_s",
                format!(
                    "`plant.step_s` = {} is too long for `plant.model` = \"rapier3d\"",
                    plant.step_s
                ),
                format!("use at most {RIGID_STEP_MAX}, or leave it out for 0.001: beyond it the tyres' forces lag"),
            );
        }
        self.step_resolves_the_lags()?;
        let ticks = SimTime::from_seconds(self.scenario.run.duration_s).nanoseconds()
            / control.nanoseconds();
        if ticks > MAX_TICKS {
            return self.refuse(
                "run.duration_s",
                format!(
                    "`run.duration_s` = {} holds {ticks} control periods of {} s",
                    self.scenario.run.duration_s, plant.control_s
                ),
                format!("a run has at most {MAX_TICKS}; shorten it, or control less often"),
            );
        }
        Ok((step, control))
    }

    /// A step longer than a lag sees nothing of it.
    fn step_resolves_the_lags(&self) -> Result<(), SetupError> {
        let step = self.scenario.plant.step_s;
        let true_lag = self.scenario.plant.bike.0.get("steer_lag_s");
        let steering = true_lag
            .and_then(|value| {
                value
                    .as_float()
                    .or(value.as_integer().map(|lag| lag as f64))
            })
            .unwrap_or(self.scenario.bike.params.steer_lag);
        let steering_key = ["plant.bike.steer_lag_s", "bike.steer_lag_s"]
            .into_iter()
            .find(|key| self.file.is_written(key))
            .unwrap_or("plant.step_s");
        let faults = self.scenario.disturbance.iter().enumerate();
        let lags = faults
            .filter_map(|(index, disturbance)| match disturbance {
                Disturbance::Fault(fault) => {
                    Some((format!("disturbance.{index}.lag_s"), fault.lag_s?))
                }
                _ => None,
            })
            .chain([(steering_key.to_owned(), steering)]);
        for (key, lag) in lags {
            if lag > 0.0 && step > lag {
                return self.refuse(
                    &key,
                    format!(
                        "`plant.step_s` = {step} is longer than the lag of {lag} s of a motor, so the lag would not be seen"
                    ),
                    format!("choose `plant.step_s` of at most {lag}, or a lag of 0"),
                );
            }
        }
        Ok(())
    }
}
