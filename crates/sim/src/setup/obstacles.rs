//! `[[obstacle]]`s: those that the map knows join it, the others are traffic.

use std::str::FromStr;

use super::maps::Field;
use super::{Resolver, SetupError};
use crate::scenario::{ObstacleSection, PlantModel, Repeat};
use crate::traffic::{Itinerary, MOST_REACH, MovingObstacle, Traffic, placed};
use bikebot_geometry::{Point2, Pose2};
use bikebot_planner::EndPose;
use bikebot_world::{Footprint, Obstacle, World};

const SHAPES: &str = "it may be \"disc:0.3\" (radius), \"box:1.0x0.6\" (length x width) or \"polygon:x,y;x,y;…\" (vertices), in metres";

impl Resolver<'_> {
    /// Puts what is known to stand there on the map of `field`; what moves, comes, goes or is hidden is returned.
    pub(super) fn obstacles(&mut self, field: &mut Field) -> Result<Traffic, SetupError> {
        let mut traffic = Traffic::default();
        let sections = &self.scenario.obstacle;
        if sections.is_empty() {
            return Ok(traffic);
        }
        if self.scenario.plant.model == PlantModel::TwoLink && self.scenario.path.is_none() {
            return self.refuse(
                "obstacle",
                "the scenario has an [[obstacle]], but `plant.model` = \"two_link\" stands still",
                "remove it, or choose plant.model = \"bike3d\"",
            );
        }
        let Some(world) = &field.world else {
            return self.refuse(
                "obstacle",
                "the scenario has an [[obstacle]], but no [map] for it to stand in",
                "add [map] with `bounds_m = [min x, min y, max x, max y]`",
            );
        };
        let mut known = Vec::new();
        for (index, section) in sections.iter().enumerate() {
            let outline = self.outline(index, section)?;
            self.times_make_sense(index, section)?;
            let itinerary = Itinerary::new(section, !matches!(outline, Obstacle::Disc { .. }));
            if section.repeat != Repeat::No && itinerary.stands() {
                return self.refuse(
                    &format!("obstacle.{index}.repeat"),
                    "`repeat` says nothing about an obstacle with one way point",
                    "remove it, or add way points",
                );
            }
            let lasts = section.appear_s == 0.0 && section.disappear_s.is_none();
            if let (true, true, false) = (itinerary.stands(), lasts, section.hidden) {
                if section.height_m.is_some() {
                    return self.refuse(
                        &format!("obstacle.{index}.height_m"),
                        "an obstacle that the map knows is as high as all of the map",
                        "remove `height_m`, set `laser.obstacle_height_m` for all, or add `hidden = true`",
                    );
                }
                // It is there from time zero on.
                known.extend(itinerary.pose(0.0).map(|pose| placed(&outline, &pose)));
                continue;
            }
            let height = section
                .height_m
                .unwrap_or(self.scenario.laser.obstacle_height);
            match MovingObstacle::new(outline, height, itinerary) {
                Ok(obstacle) => traffic.push(index, obstacle),
                Err(error) => {
                    return self.refuse(
                        &format!("obstacle.{index}.shape"),
                        format!("`shape` = \"{}\": {error}", shortened(&section.shape)),
                        SHAPES,
                    );
                }
            }
        }
        if !known.is_empty() {
            let obstacles = world.obstacles().iter().cloned().chain(known).collect();
            match World::build(world.bounds(), obstacles, world.grid().cloned()) {
                Ok(world) => field.world = Some(world),
                Err(error) => {
                    return self.refuse("obstacle", format!("[[obstacle]]: {error}"), SHAPES);
                }
            }
        }
        Ok(traffic)
    }

    fn outline(&self, index: usize, section: &ObstacleSection) -> Result<Obstacle, SetupError> {
        let key = format!("obstacle.{index}.shape");
        let written = shortened(&section.shape);
        let refuse = |problem: &str| {
            self.refuse(&key, format!("`shape` is \"{written}\": {problem}"), SHAPES)
        };
        let footprint = match Footprint::from_str(&section.shape) {
            Ok(footprint) => footprint,
            Err(error) => return refuse(&error.problem),
        };
        if footprint.reach() > MOST_REACH {
            return refuse(&format!(
                "it reaches {} m from its reference point, and {MOST_REACH} m is the most",
                footprint.reach()
            ));
        }
        match footprint {
            Footprint::Disc { radius } => Ok(Obstacle::Disc {
                center: Point2::origin(),
                radius,
            }),
            Footprint::Rectangle {
                rear,
                front,
                half_width,
            } => Ok(Obstacle::Block {
                min: Point2::new(rear, -half_width),
                max: Point2::new(front, half_width),
            }),
            Footprint::Polygon(polygon) if polygon.rounding() == 0.0 => Ok(Obstacle::Polygon {
                vertices: polygon.vertices().to_vec(),
            }),
            _ => refuse("no outline of an obstacle"),
        }
    }

    fn times_make_sense(&self, index: usize, section: &ObstacleSection) -> Result<(), SetupError> {
        if let Some(gone) = section.disappear_s
            && gone <= section.appear_s
        {
            return self.refuse(
                &format!("obstacle.{index}.disappear_s"),
                format!(
                    "`disappear_s` = {gone} is not after `appear_s` = {}",
                    section.appear_s
                ),
                "both are times since the start of the run, s",
            );
        }
        Ok(())
    }

    /// Refuses an obstacle that stands on the bike when the run starts.
    pub(super) fn starts_clear(
        &self,
        traffic: &Traffic,
        footprint: &Footprint,
        pose: &Pose2,
        start: Option<&EndPose>,
    ) -> Result<(), SetupError> {
        // A start whose heading is left to the plan stands at least on this.
        let footprint = match start {
            Some(start) if start.heading.is_none() => match footprint.inscribed_radius() {
                radius if radius > 0.0 => Footprint::Disc { radius },
                _ => Footprint::Point,
            },
            _ => footprint.clone(),
        };
        let Some((index, clearance)) = traffic.nearest(&footprint, pose, 0.0, 0.0) else {
            return Ok(());
        };
        let number = traffic.number(index).unwrap_or(index);
        self.refuse(
            &format!("obstacle.{number}.waypoints_m"),
            format!(
                "obstacle {} starts on the bike: it overlaps the bike's outline at ({}, {}) by {:.2} m",
                number + 1,
                pose.position.x,
                pose.position.y,
                -clearance
            ),
            "move its first way point or the start apart, or let it appear later (`appear_s`)",
        )
    }
}

/// The beginning of what was written, for a message.
fn shortened(text: &str) -> String {
    if text.chars().count() <= 40 {
        text.to_owned()
    } else {
        text.chars().take(39).chain(['…']).collect()
    }
}
