//! The laser as it is mounted.

use super::{Resolver, SetupError};
use crate::clock::Period;
use bikebot_dynamics::{LaserParams, LaserScanner};
use bikebot_mapping::{MapperParams, MappingError};

impl Resolver<'_> {
    /// The laser as it is mounted: a bike without a map has nothing to look at and carries none.
    pub(super) fn laser(
        &mut self,
        control: Period,
        has_map: bool,
    ) -> Result<LaserParams, SetupError> {
        let laser = self.scenario.laser;
        if !laser.enabled {
            return Ok(laser);
        }
        if !has_map {
            if self.file.is_written("laser.enabled") {
                return self.refuse(
                    "laser.enabled",
                    "`laser.enabled` is true, but the scenario has no [map] to look at",
                    "add [map], or remove it",
                );
            }
            if self.file.is_written("laser") {
                self.warnings
                    .push("[laser] has no effect: the scenario has no [map] to look at".into());
            }
            return Ok(LaserParams {
                enabled: false,
                ..laser
            });
        }
        if let Err(error) = LaserScanner::new(&laser) {
            return self.refuse(
                "laser",
                format!("[laser]: {error}"),
                "see the keys of [laser] in `bikebot schema`",
            );
        }
        if let Err(error) = laser.check_mount(&self.scenario.bike.params) {
            let key = ["laser.mount_x_m", "laser.mount_z_m", "laser.mount_y_m"]
                .into_iter()
                .find(|key| self.file.is_written(key))
                .unwrap_or("laser");
            return self.refuse(
                key,
                format!("[laser]: {error}"),
                format!(
                    "mount it above or beside the bike's parts: the wheels are {} m high, the balancer's pivot is at {} m",
                    2.0 * self.scenario.bike.params.wheel_radius,
                    self.scenario.bike.params.l
                ),
            );
        }
        let divides =
            Period::from_hertz(laser.rate).is_ok_and(|scan| scan.in_steps_of(control).is_ok());
        if !divides {
            return self.refuse(
                "laser.rate_hz",
                format!(
                    "`laser.rate_hz` = {} does not fit the control period of {} s",
                    laser.rate,
                    control.seconds()
                ),
                "one scan has to take a whole number of control periods, such as 10, 20 or 40 Hz with 0.005 s; \
                 or set laser.enabled = false",
            );
        }
        Ok(laser)
    }

    /// What becomes of its scans.
    pub(super) fn mapper(&self) -> Result<MapperParams, SetupError> {
        let mapper = self.scenario.mapper;
        match mapper.check() {
            Ok(()) => Ok(mapper),
            Err(error) => {
                const KEYS: [&str; 6] = [
                    "mapper.free_limit",
                    "mapper.free_at",
                    "mapper.free_until",
                    "mapper.occupied_until",
                    "mapper.occupied_at",
                    "mapper.occupied_limit",
                ];
                const RADII: [&str; 2] =
                    ["mapper.tracker.min_radius_m", "mapper.tracker.max_radius_m"];
                let (keys, help): (&[&str], _) = match error {
                    MappingError::Radii { .. } => (&RADII, "keep min_radius_m <= max_radius_m"),
                    _ => (
                        &KEYS,
                        "keep -free_limit <= free_at <= free_until <= occupied_until <= occupied_at <= occupied_limit, with free_at < 0 < occupied_at",
                    ),
                };
                let key = keys.iter().find(|key| self.file.is_written(key));
                self.refuse(
                    key.copied().unwrap_or("mapper"),
                    format!("[mapper]: {error}"),
                    help,
                )
            }
        }
    }
}
