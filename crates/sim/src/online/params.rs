//! Tunables of riding on what the laser has shown: the scenario's `[online]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::giving_way::GivingWayParams;

/// Planning while riding: the scenario's `[online]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OnlineParams {
    /// Plan again while riding, from what the laser has shown. `map.known = false` does so whatever this says.
    pub enabled: bool,
    /// Time a plan takes, s: it is made of what was known so long before it is taken over. In simulated time, so that a ride repeats.
    #[serde(rename = "latency_s")]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub latency: f64,
    /// How far ahead a new path is made with care, m. Beyond it the first path that is proved free will do: it is planned again before it is
    /// ridden.
    #[serde(rename = "horizon_m")]
    #[schemars(range(min = 1.0, max = 1e4))]
    pub horizon: f64,
    /// Way beyond where the bike will be when it takes a plan over, m, on which the old path stays as it is: the follower looks ahead that
    /// far.
    #[serde(rename = "lead_m")]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub lead: f64,
    /// Iterations of all stages that one plan may take.
    #[schemars(range(min = 100, max = 10_000_000))]
    pub iterations: u64,
    /// States that one search over poses and steering angles may look at; it is made where nothing else has found a path that the bike can ride,
    /// as with its nose to a wall.
    #[schemars(range(min = 0, max = 10_000_000))]
    pub states: u64,
    /// Ways round obstacles on other sides that one plan may look for, beside the shortest.
    #[schemars(range(min = 0, max = 1000))]
    pub starts: u32,
    /// How far the bike may be beside its path, m. So much more than its outline has to be seen free before it is ridden. 0.02: rides with
    /// noisy sensors stray by 3 mm on average and by 14 mm at most.
    #[serde(rename = "tracking_allowance_m")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tracking_allowance: f64,
    /// Distance that a plan keeps from what is known to stand there, m, beyond the outline planned with and `planner.margin_m`. A cell
    /// more or less of a noisy map then blocks nothing.
    #[serde(rename = "plan_margin_m")]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub plan_margin: f64,
    /// Where the proof of free space ends, the bike is at rest this much before, m.
    #[serde(rename = "stop_margin_m")]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub stop_margin: f64,
    /// Time between two searches while there is no way, s.
    #[serde(rename = "search_period_s")]
    #[schemars(range(min = 0.01, max = 10.0))]
    pub search_period: f64,
    /// Time between two looks for a clearly better path while the present one is free, s.
    #[serde(rename = "improve_period_s")]
    #[schemars(range(min = 0.05, max = 60.0))]
    pub improve_period: f64,
    /// By which part of its cost a new path must be cheaper than a free old one to be taken: of two nearly equal ways round an
    /// obstacle a bike must choose one and stay with it.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gain: f64,
    /// By which part a way round what blocks the path may be longer than what was left of it, before a plan is made from
    /// nothing as well.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub detour: f64,
    /// How long the bike stands before a place it has never seen, s, until it counts that place as an obstacle and goes round.
    #[serde(rename = "doubt_after_s")]
    #[schemars(range(min = 0.0, max = 60.0))]
    pub doubt_after: f64,
    /// How far the bike goes on along a blocked path, m, at a time, when it stands and no way was found: from another place there may be
    /// one. Never beyond where it is proved free.
    #[serde(rename = "advance_m")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub advance: f64,
    /// How long the bike stands without a way until the ride ends as stopped, s.
    #[serde(rename = "give_up_s")]
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub give_up: f64,
    /// The scenario vouches for this much around the bike's outline at the start, m: nothing stands there, though the laser cannot see
    /// what is beside and behind it.
    #[serde(rename = "start_zone_m")]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub start_zone: f64,
    /// How the bike rides among things that move.
    pub moving: GivingWayParams,
}

impl Default for OnlineParams {
    fn default() -> Self {
        Self {
            enabled: false,
            latency: 0.1,
            horizon: 10.0,
            lead: 0.5,
            iterations: 5_000,
            states: 10_000,
            starts: 8,
            tracking_allowance: 0.02,
            plan_margin: 0.1,
            stop_margin: 0.15,
            search_period: 0.2,
            improve_period: 2.0,
            gain: 0.1,
            detour: 0.05,
            doubt_after: 1.0,
            advance: 1.0,
            give_up: 10.0,
            start_zone: 0.3,
            moving: GivingWayParams::default(),
        }
    }
}
