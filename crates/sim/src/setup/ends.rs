//! Where the ride begins and where it shall end.

use super::maps::Field;
use super::{PathSource, Resolver, SetupError};
use crate::scenario::PlantModel;
use bikebot_dynamics::BikeState;
use bikebot_geometry::{Point2, Pose2};
use bikebot_planner::{EndPose, GoalMode, GoalRegion};
use bikebot_world::formats::MapPose;

impl Resolver<'_> {
    /// Refuses what the start says about motions that the plant does not have.
    pub(super) fn start_fits_the_plant(&self) -> Result<(), SetupError> {
        let start = &self.scenario.start;
        let (model, still): (PlantModel, &[(&str, f64)]) = match self.scenario.plant.model {
            model @ (PlantModel::Bike3d | PlantModel::Rapier3d) => (model, &[]),
            PlantModel::TwoLink => (
                PlantModel::TwoLink,
                &[
                    ("speed_mps", start.speed_mps),
                    ("steer_deg", start.steer_deg),
                ],
            ),
            PlantModel::Kinematic => (
                PlantModel::Kinematic,
                &[
                    ("roll_deg", start.roll_deg),
                    ("roll_rate_radps", start.roll_rate_radps),
                    ("balancer_rad", start.balancer_rad),
                    ("balancer_rate_radps", start.balancer_rate_radps),
                ],
            ),
        };
        for (key, value) in still {
            if *value != 0.0 {
                let what = if model == PlantModel::TwoLink {
                    "stands still"
                } else {
                    "does not roll"
                };
                return self.refuse(
                    &format!("start.{key}"),
                    format!(
                        "`start.{key}` is {value}, but `plant.model` = \"{}\" {what}",
                        model.name()
                    ),
                    "remove it, or choose plant.model = \"bike3d\"",
                );
            }
        }
        Ok(())
    }

    pub(super) fn start(
        &self,
        field: &Field,
        path: &PathSource,
    ) -> Result<(BikeState, Option<EndPose>), SetupError> {
        let start = &self.scenario.start;
        let end = match path {
            PathSource::Given(path) => Some(named(path.start_pose())),
            PathSource::Planned => field.start,
            PathSource::Standing => Some(named(Pose2::new(0.0, 0.0, 0.0))),
        };
        let coordinate =
            |written: Option<f64>, named: Option<f64>, key: &str| match written.or(named) {
                Some(value) => Ok(value),
                None => self.refuse(
                    "start",
                    format!("the scenario has no `{key}`"),
                    "add [start] with x_m, y_m and heading_deg: where the rear wheel stands",
                ),
            };
        let x = coordinate(start.x_m, end.map(|pose| pose.position.x), "start.x_m")?;
        let y = coordinate(start.y_m, end.map(|pose| pose.position.y), "start.y_m")?;
        // The heading a map or a path names belongs to the place it names. A place of one's own leaves the
        // heading free to the plan; on a given path there is only the path's.
        let is_named = start.x_m.is_none() && start.y_m.is_none() || *path != PathSource::Planned;
        let heading = start
            .heading_deg
            .map(f64::to_radians)
            .or(end.filter(|_| is_named).and_then(|pose| pose.heading));
        let state = BikeState {
            pose: Pose2::new(x, y, heading.unwrap_or(0.0)),
            steer: start.steer_deg.to_radians(),
            roll: start.roll_deg.to_radians(),
            balancer: start.balancer_rad,
            speed: start.speed_mps,
            roll_rate: start.roll_rate_radps,
            balancer_rate: start.balancer_rate_radps,
        };
        let pose = EndPose {
            position: Point2::new(x, y),
            heading,
            curvature: None,
        };
        Ok((state, Some(pose)))
    }

    pub(super) fn goal(
        &self,
        field: &Field,
        path: &PathSource,
    ) -> Result<Option<GoalRegion>, SetupError> {
        let section = self.scenario.goal.clone().unwrap_or_default();
        let end = match path {
            PathSource::Given(path) => Some(named(path.end_pose())),
            PathSource::Planned => field.goal,
            PathSource::Standing => return Ok(None),
        };
        let missing = |key: &str| {
            self.refuse(
                "goal",
                format!("the scenario has no `{key}`"),
                "add [goal] with x_m and y_m: where the rear wheel shall stop; or a [path] to ride",
            )
        };
        let Some(x) = section.x_m.or(end.map(|pose| pose.position.x)) else {
            return missing("goal.x_m");
        };
        let Some(y) = section.y_m.or(end.map(|pose| pose.position.y)) else {
            return missing("goal.y_m");
        };
        let heading = section.heading_deg.map(f64::to_radians).or_else(|| {
            // A goal written without heading is free; one taken from the map keeps the map's.
            (section.x_m.is_none() && section.y_m.is_none())
                .then(|| end.and_then(|pose| pose.heading))
                .flatten()
        });
        let tolerance = match self.scenario.planner.goal {
            // The paper's ball 𝒳_goal has radius l = 3 · scale, unless the scenario says another.
            GoalMode::Ball if !self.file.is_written("goal.tolerance_m") => {
                self.scenario.planner.table_goal_tolerance()
            }
            GoalMode::Ball | GoalMode::Pose => section.tolerance_m,
        };
        Ok(Some(GoalRegion {
            position: Point2::new(x, y),
            heading,
            tolerance,
        }))
    }
}

/// An end that a path or the origin names, with its heading.
fn named(pose: Pose2) -> MapPose {
    MapPose {
        position: pose.position,
        heading: Some(pose.heading),
    }
}
