//! The bike as the controller believes it, as it is, and as a planner sees it.

use super::{Resolver, ScheduledModeChange, SetupError};
use crate::scenario::PlantModel;
use bikebot_dynamics::BikeParams;
use bikebot_world::Footprint;
use std::str::FromStr;

impl Resolver<'_> {
    pub(super) fn footprints(&self) -> Result<(Footprint, Footprint), SetupError> {
        let written = &self.scenario.planner.footprint;
        let footprint = match Footprint::from_str(written) {
            Ok(footprint) => footprint,
            Err(error) => {
                return self.refuse(
                    "planner.footprint",
                    format!("`planner.footprint` is \"{written}\": {}", error.problem),
                    "it may be \"bike\", \"point\", \"disc:0.4\", \"capsule:1.8x0.6\", \"box:1.8x0.6\" or vertices, [[x, y], …]",
                );
            }
        };
        let planning = if written.trim() == "bike" {
            // The rear contact cuts a corner of curvature σ by ℓ²σ/2 (docs/paper.md, D14).
            footprint.grown(
                0.5 * self.scenario.follow.look_ahead.powi(2) * self.scenario.planner.max_curvature,
            )
        } else {
            footprint.clone()
        };
        Ok((footprint, planning))
    }

    /// Refuses a bike that cannot be taken apart into rigid bodies where it has to be.
    fn rigid_bodies(&self, true_bike: &BikeParams) -> Result<(), SetupError> {
        let plant = &self.scenario.plant;
        if plant.model != PlantModel::Rapier3d {
            return Ok(());
        }
        if let Err(message) = crate::true_plant::rigid_bodies(true_bike, plant.steering_geometry) {
            return self.refuse(
                "plant.model",
                format!("`plant.model` = \"rapier3d\": {message}"),
                "choose plant.model = \"bike3d\", or steering_geometry = \"matched\" with its light wheels",
            );
        }
        Ok(())
    }

    pub(super) fn bike(&self) -> Result<(BikeParams, Vec<ScheduledModeChange>), SetupError> {
        let section = &self.scenario.bike;
        if let Err(error) = section.params.check() {
            return self.refuse(
                "bike",
                format!("[bike]: {error}"),
                "see docs/frames.md for the meaning of the lengths",
            );
        }
        let mut changes: Vec<ScheduledModeChange> = Vec::new();
        for (index, change) in section.mode_change.iter().enumerate() {
            let model = self.scenario.plant.model;
            if !matches!(model, PlantModel::Bike3d | PlantModel::Rapier3d) {
                return self.refuse(
                    &format!("bike.mode_change.{index}"),
                    format!("`plant.model` = \"{}\" knows no mode change", model.name()),
                    "remove [[bike.mode_change]], or choose plant.model = \"bike3d\"",
                );
            }
            let condition = section.params.mode_change_is_possible();
            if !condition.is_met() {
                return self.refuse(
                    &format!("bike.mode_change.{index}"),
                    format!(
                        "this bike cannot change its mode while riding: the centre of percussion of its body lies at {:.3} m, \
                         not below {:.3} m, so the balance law loses its grip on the way",
                        condition.percussion_height, condition.bound
                    ),
                    "remove [[bike.mode_change]], or raise the pivot (l_m) or the balancer's inertia (i2x_kgm2)",
                );
            }
            if changes
                .last()
                .is_some_and(|last| change.time_s < last.time + last.duration)
            {
                return self.refuse(
                    &format!("bike.mode_change.{index}.time_s"),
                    format!(
                        "mode change {} begins before the one above it has ended",
                        index + 1
                    ),
                    "list them in order of time, each after the end of the last",
                );
            }
            changes.push(ScheduledModeChange {
                time: change.time_s,
                mode: change.mode,
                duration: change.duration_s,
            });
        }
        let mut truth = crate::scenario::to_table(&section.params);
        for (key, value) in &self.scenario.plant.bike.0 {
            truth.insert(key.clone(), value.clone());
        }
        let true_bike: BikeParams = match toml::Value::Table(truth).try_into() {
            Ok(params) => params,
            Err(error) => {
                return self.refuse(
                    "plant.bike",
                    format!("[plant.bike]: {error}"),
                    "it takes keys of [bike]",
                );
            }
        };
        if let Err(error) = true_bike.check() {
            return self.refuse(
                "plant.bike",
                format!("[plant.bike]: {error}"),
                "see docs/frames.md for the meaning of the lengths",
            );
        }
        self.rigid_bodies(&true_bike)?;
        let steer = self.scenario.start.steer_deg;
        if steer.abs() > true_bike.steer_max_deg {
            return self.refuse(
                "start.steer_deg",
                format!(
                    "`start.steer_deg` is {steer}, beyond the steering's stop at {} degrees",
                    true_bike.steer_max_deg
                ),
                "choose an angle within the stops, or set bike.steer_max_deg",
            );
        }
        Ok((true_bike, changes))
    }
}
