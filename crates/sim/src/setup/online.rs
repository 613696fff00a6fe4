//! Planning while riding: what it needs of the rest of a scenario.

use super::{PathSource, Resolver, SetupError};
use crate::online::OnlineParams;
use bikebot_dynamics::LaserParams;
use bikebot_mapping::BeliefGrid;
use bikebot_planner::EndPose;
use bikebot_world::World;

/// How a ride plans from what its laser shows.
#[derive(Debug, Clone, PartialEq)]
pub struct OnlineSetup {
    /// `[online]`.
    pub params: OnlineParams,
    /// Whether the planner is given the map.
    pub map_is_known: bool,
}

impl Resolver<'_> {
    /// How to plan while riding; `None` where the path is made or given once and for all.
    pub(super) fn online(
        &self,
        path: &PathSource,
        laser: &LaserParams,
        start: Option<&EndPose>,
        world: Option<&World>,
    ) -> Result<Option<OnlineSetup>, SetupError> {
        let map_is_known = self.scenario.map.as_ref().is_none_or(|map| map.known);
        if map_is_known && !self.scenario.online.enabled {
            return Ok(None);
        }
        let key = if map_is_known {
            "online.enabled"
        } else {
            "map.known"
        };
        if *path != PathSource::Planned {
            return self.refuse(
                key,
                format!("`{key}` asks for planning while riding, but the scenario plans no path"),
                "remove it, or [path], and add [map] and [goal]",
            );
        }
        if !laser.enabled {
            return self.refuse(
                key,
                format!("`{key}` asks for planning from what the laser shows, but `laser.enabled` is false"),
                "set laser.enabled = true",
            );
        }
        if start.is_none_or(|start| start.heading.is_none()) {
            return self.refuse(
                "start",
                "the scenario has no `start.heading_deg`, but the laser has to look somewhere before there is a plan",
                "add `heading_deg` to [start]",
            );
        }
        self.belief_fits(world)?;
        Ok(Some(OnlineSetup {
            params: self.scenario.online.clone(),
            map_is_known,
        }))
    }

    /// Refuses a field of shapes that takes more cells than a grid may have. A map of cells lends the belief its own.
    fn belief_fits(&self, world: Option<&World>) -> Result<(), SetupError> {
        let cell = self.scenario.mapper.cell;
        let Some(field) = world.filter(|world| world.grid().is_none()) else {
            return Ok(());
        };
        let Err(error) = BeliefGrid::over(field.bounds(), cell) else {
            return Ok(());
        };
        let keys = ["mapper.cell_m", "map.bounds_m"];
        let key = keys.into_iter().find(|key| self.file.is_written(key));
        self.refuse(
            key.unwrap_or("map"),
            format!("the belief about this field in cells of {cell} m (`mapper.cell_m`): {error}"),
            "take larger cells or a smaller field",
        )
    }
}
