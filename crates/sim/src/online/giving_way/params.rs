//! Tunables of giving way: the scenario's `[online.moving]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the bike rides among things that move: the scenario's `[online.moving]`.
///
/// `fastest_mps` and `acceleration_mps2` are what is announced of them. Who keeps to both, and shows himself before the bike is nearer
/// than its stopping distance, is not met.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GivingWayParams {
    /// Distance kept from where a moving thing may be, m, beyond what the bike may be beside its path.
    #[serde(rename = "clearance_m")]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub clearance: f64,
    /// How many standard deviations of its position and velocity a thing may be off its track.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub sigmas: f64,
    /// Announced: nothing moves faster than this, m/s. The default is a runner's; a track that seems faster is taken for this fast.
    #[serde(rename = "fastest_mps")]
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 100.0))]
    pub fastest: f64,
    /// Announced: how hard things that move change their velocity, m/s², beyond what the track leaves open. People can do more; who counts
    /// on that stops for everyone.
    #[serde(rename = "acceleration_mps2")]
    #[schemars(range(min = 0.0, max = 20.0))]
    pub acceleration: f64,
    /// The bike goes first only if it has left the place at least so long before the other may be there, s.
    #[serde(rename = "before_s")]
    #[schemars(range(min = 0.0, max = 60.0))]
    pub before: f64,
    /// The bike goes behind the other no sooner than this after it has left the place, s.
    #[serde(rename = "after_s")]
    #[schemars(range(min = 0.0, max = 60.0))]
    pub after: f64,
    /// How far things are foreseen, s: longer than the bike takes to stop.
    #[serde(rename = "horizon_s")]
    #[schemars(range(min = 1.0, max = 60.0))]
    pub horizon: f64,
    /// A bike that gives way stands this much before the place where it would be in the way, m.
    #[serde(rename = "stop_margin_m")]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub stop_margin: f64,
    /// A thing that has been slower than `mapper.tracker.confirm_speed_mps` for so long stands, s: it becomes a part of the map and is
    /// planned around.
    #[serde(rename = "rest_after_s")]
    #[schemars(range(min = 0.1, max = 60.0))]
    pub rest_after: f64,
}

impl Default for GivingWayParams {
    fn default() -> Self {
        Self {
            clearance: 0.25,
            sigmas: 2.0,
            fastest: 3.0,
            acceleration: 0.2,
            before: 1.0,
            after: 0.3,
            horizon: 8.0,
            stop_margin: 0.3,
            rest_after: 1.5,
        }
    }
}
