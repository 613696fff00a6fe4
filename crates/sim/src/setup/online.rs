//! Planning while riding: what it needs of the rest of a scenario.

use super::{PathSource, Resolver, SetupError};
use crate::online::OnlineParams;
use bikebot_dynamics::LaserParams;
use bikebot_planner::EndPose;

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
        Ok(Some(OnlineSetup {
            params: self.scenario.online.clone(),
            map_is_known,
        }))
    }
}
