//! `[mapper.tracker]`: how moving things are followed.

use crate::error::MappingError;

/// What counts as moving, and how its motion is estimated.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(default, deny_unknown_fields)]
pub struct TrackerParams {
    /// What has been in one place for so long stands still, s. It is on the map by then.
    #[serde(rename = "settle_s")]
    #[schemars(range(min = 0.1, max = 60.0))]
    pub settle: f64,
    /// Hits farther apart than this belong to different things, m.
    #[serde(rename = "cluster_gap_m")]
    #[schemars(range(min = 0.01, max = 10.0))]
    pub cluster_gap: f64,
    /// Fewest hits that make a thing. 3: noise seldom moves three beams side by side.
    #[schemars(range(min = 1, max = 1000))]
    pub min_hits: u32,
    /// Least radius a moving thing is taken to have, m.
    #[serde(rename = "min_radius_m")]
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 10.0))]
    pub min_radius: f64,
    /// Largest radius of a moving thing, m: what is wider is no pedestrian and no bicycle.
    #[serde(rename = "max_radius_m")]
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 100.0))]
    pub max_radius: f64,
    /// Standard deviation of a measured centre, m: noise of the laser, blur of the pose, and an outline that is no disc.
    #[serde(rename = "position_sigma_m")]
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 10.0))]
    pub position_sigma: f64,
    /// How far the velocity wanders in a second, m/s (after t seconds √t times that): people turn and stop.
    #[serde(rename = "velocity_drift_mps")]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub velocity_drift: f64,
    /// Speed a new thing may have, m/s, one standard deviation along each axis.
    #[serde(rename = "birth_speed_mps")]
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 100.0))]
    pub birth_speed: f64,
    /// How far a measurement may lie from the prediction, in standard deviations.
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 100.0))]
    pub gate: f64,
    /// Scans a thing must be seen in before it counts.
    #[schemars(range(min = 1, max = 1000))]
    pub confirm_scans: u32,
    /// Speed it must have shown, m/s: what stands still is the map's. Three standard deviations of it as well, or so much way that it cannot
    /// be noise.
    #[serde(rename = "confirm_speed_mps")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub confirm_speed: f64,
    /// A thing not seen for so long is given up, s.
    #[serde(rename = "forget_s")]
    #[schemars(range(min = 0.01, max = 60.0))]
    pub forget: f64,
}

impl TrackerParams {
    /// Checks that there are radii between the least and the largest.
    ///
    /// # Errors
    ///
    /// [`MappingError::Radii`].
    pub fn check(&self) -> Result<(), MappingError> {
        let (min, max) = (self.min_radius, self.max_radius);
        if min <= max {
            Ok(())
        } else {
            Err(MappingError::Radii { min, max })
        }
    }
}

impl Default for TrackerParams {
    fn default() -> Self {
        Self {
            settle: 3.0,
            cluster_gap: 0.3,
            min_hits: 3,
            min_radius: 0.1,
            max_radius: 1.5,
            position_sigma: 0.05,
            velocity_drift: 0.5,
            birth_speed: 1.5,
            gate: 4.0,
            confirm_scans: 4,
            confirm_speed: 0.2,
            forget: 1.0,
        }
    }
}
