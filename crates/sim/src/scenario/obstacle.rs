//! `[[obstacle]]`: what stands or moves in the field beside the map, as written in a scenario.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One `[[obstacle]]`: something solid on the ground. It moves along its way points, or stands at the only one.
///
/// The planner's map knows it only if it stands from the beginning, for good, and is not hidden.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObstacleSection {
    /// Its outline about its own reference point: "disc:0.3" (radius), "box:1.0x0.6" (length x width in metres, centred) or
    /// "polygon:x,y;x,y;…" (vertices in metres, in order).
    #[schemars(length(min = 1, max = 10000))]
    pub shape: String,
    /// Where its reference point goes, one after another, `[[x, y], …]`, m. One point: it stands there.
    #[schemars(length(min = 1, max = 1000), inner(inner(range(min = -1.0e6, max = 1.0e6))))]
    pub waypoints_m: Vec<[f64; 2]>,
    /// Speed between way points, m/s: a pedestrian's.
    #[serde(default = "walking")]
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 50.0))]
    pub speed_mps: f64,
    /// How long it waits at each way point before it goes on, s.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 86400.0))]
    pub pause_s: f64,
    /// What it does at the last way point.
    #[serde(default)]
    pub repeat: Repeat,
    /// Direction its outline's x axis points in all the while, degrees, counter-clockwise from +x. Left out: ahead, and at
    /// way points it turns on the spot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -360.0, max = 360.0))]
    pub heading_deg: Option<f64>,
    /// How fast it turns on the spot, rad/s: a quarter turn in a second. A disc need not turn.
    #[serde(default = "quarter_a_second")]
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 100.0))]
    pub turn_rate_radps: f64,
    /// When it appears, and sets off, s.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 86400.0))]
    pub appear_s: f64,
    /// When it is gone again, s. Left out: never.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 86400.0))]
    pub disappear_s: Option<f64>,
    /// Whether it is kept from the planner's map although it stands there from the beginning.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub hidden: bool,
    /// How high it is, m: a beam above passes over it. Left out: `laser.obstacle_height_m`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.05, max = 100.0))]
    pub height_m: Option<f64>,
}

fn walking() -> f64 {
    1.2
}

fn quarter_a_second() -> f64 {
    std::f64::consts::FRAC_PI_2
}

/// What a moving obstacle does at its last way point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Repeat {
    /// It stays.
    #[default]
    No,
    /// It goes back the way it came, and forth again; what has a front backs up.
    BackAndForth,
    /// It goes on to the first.
    Loop,
}
