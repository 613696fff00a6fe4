//! `[mapper]`: how scans become a belief.

use crate::error::MappingError;
use crate::evidence::UNIT;
use crate::tracks::TrackerParams;

/// How much a scan tells, and what it takes to believe it.
///
/// Evidence is counted in log-odds, `ln(p / (1 − p))`: 0 is no idea, 1.6 is five to one.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(default, deny_unknown_fields)]
pub struct MapperParams {
    /// Side of a cell, m. 0.05: what stands in a cell blocks all of it, and in a thicket a decimetre lost to both sides closes ways that a
    /// bike can ride; a scan is still inserted in well below a millisecond.
    #[serde(rename = "cell_m")]
    #[schemars(range(min = 0.01, max = 10.0))]
    pub cell: f64,
    /// Height of what stands around, m: a beam above it passes over and tells nothing.
    #[serde(rename = "obstacle_height_m")]
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 100.0))]
    pub obstacle_height: f64,
    /// How wrong the roll may be, degrees. What this error would let touch the ground, or pass over an obstacle, is not
    /// believed. 1° is three times the noise of a good inclinometer.
    #[schemars(range(min = 0.0, max = 45.0))]
    pub roll_tolerance_deg: f64,
    /// How uneven the ground and how wrong the height of the mount may be, m.
    #[serde(rename = "height_tolerance_m")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub height_tolerance: f64,
    /// Standard deviation of the position the scan is taken from, m: it blurs all evidence.
    #[serde(rename = "position_sigma_m")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub position_sigma: f64,
    /// Standard deviation of the heading, degrees: it blurs evidence the more the farther it lies.
    #[schemars(range(min = 0.0, max = 45.0))]
    pub heading_sigma_deg: f64,
    /// A beam clears nothing nearer than this to a surface hit by it or by a beam beside it, sides of a cell. One: then a cell
    /// that is called free holds at most a corner of what stands there.
    #[serde(rename = "surface_margin_cells")]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub surface_margin: f64,
    /// How far a beam without return clears, m; never beyond the laser's largest range, and not past what the two beams on
    /// either side have met. 0: a missing return tells nothing.
    #[serde(rename = "no_return_clears_m")]
    #[schemars(range(min = 0.0, max = 10000.0))]
    pub no_return_clears: f64,
    /// Returns nearer to the scanner than this are parts of the bike, m.
    #[serde(rename = "ignore_within_m")]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub ignore_within: f64,
    /// Evidence of a hit, log-odds. 1.6: unknown becomes occupied at once, free becomes unknown at once and occupied with the second
    /// (as far as 12 and 7 m away; farther evidence weighs less).
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 10.0))]
    pub hit_log_odds: f64,
    /// Evidence of a beam that passed, log-odds. 0.5: two scans free an unknown cell, seven one where something stood.
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 10.0))]
    pub miss_log_odds: f64,
    /// Largest log-odds against an obstacle: as sure as a cell can be that it is free.
    #[schemars(range(min = 0.0, max = 30.0))]
    pub free_limit: f64,
    /// Largest log-odds for an obstacle: as sure as a cell can be that it is occupied. It says how long a moved obstacle stays.
    #[schemars(range(min = 0.0, max = 30.0))]
    pub occupied_limit: f64,
    /// A cell becomes free when its log-odds fall to this.
    #[schemars(range(min = -30.0, max = 30.0))]
    pub free_at: f64,
    /// A free cell is unknown again when its log-odds rise above this.
    #[schemars(range(min = -30.0, max = 30.0))]
    pub free_until: f64,
    /// An occupied cell is unknown again when its log-odds fall below this.
    #[schemars(range(min = -30.0, max = 30.0))]
    pub occupied_until: f64,
    /// A cell becomes occupied when its log-odds rise to this.
    #[schemars(range(min = -30.0, max = 30.0))]
    pub occupied_at: f64,
    /// How moving things are followed.
    pub tracker: TrackerParams,
}

impl Default for MapperParams {
    fn default() -> Self {
        Self {
            cell: 0.05,
            obstacle_height: 2.0,
            roll_tolerance_deg: 1.0,
            height_tolerance: 0.05,
            position_sigma: 0.02,
            heading_sigma_deg: 0.3,
            surface_margin: 1.0,
            no_return_clears: 30.0,
            ignore_within: 0.0,
            hit_log_odds: 1.6,
            miss_log_odds: 0.5,
            free_limit: 2.0,
            occupied_limit: 2.5,
            free_at: -1.0,
            free_until: -0.9,
            occupied_until: 0.0,
            occupied_at: 0.7,
            tracker: TrackerParams::default(),
        }
    }
}

impl MapperParams {
    /// Checks that the thresholds are in order, and those of unknown cells between them, and the tracker's parameters.
    ///
    /// # Errors
    ///
    /// [`MappingError::Thresholds`], [`MappingError::ThresholdSigns`], or as [`TrackerParams::check`].
    pub fn check(&self) -> Result<(), MappingError> {
        let ladder = [
            -self.free_limit,
            self.free_at,
            self.free_until,
            self.occupied_until,
            self.occupied_at,
            self.occupied_limit,
        ];
        if !(ladder.is_sorted() && self.free_at < self.occupied_at) {
            return Err(MappingError::Thresholds {
                free_limit: ladder[0],
                free_at: ladder[1],
                free_until: ladder[2],
                occupied_until: ladder[3],
                occupied_at: ladder[4],
                occupied_limit: ladder[5],
            });
        }
        // Log-odds are counted in thousandths: nearer to zero than one they would round to it.
        let least = UNIT.recip();
        if self.free_at > -least || self.occupied_at < least {
            return Err(MappingError::ThresholdSigns {
                free_at: self.free_at,
                occupied_at: self.occupied_at,
            });
        }
        self.tracker.check()
    }

    /// Allowed error of the roll, rad.
    pub(crate) fn roll_tolerance(&self) -> f64 {
        self.roll_tolerance_deg.to_radians()
    }

    /// Variance (m²) across a beam of what lies `distance` (m) away.
    pub(crate) fn lateral_variance(&self, distance: f64) -> f64 {
        let by_heading = self.heading_sigma_deg.to_radians() * distance;
        self.position_sigma * self.position_sigma + by_heading * by_heading
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_in_order_and_every_number_has_its_range() {
        assert_eq!(MapperParams::default().check(), Ok(()));
        let schema = serde_json::to_value(schemars::schema_for!(MapperParams)).expect("a schema");
        let own = schema["properties"].as_object().expect("properties");
        let trackers = schema["$defs"]["TrackerParams"]["properties"].as_object();
        for (key, property) in own.iter().chain(trackers.expect("properties")) {
            if key == "tracker" {
                continue;
            }
            let bounded = property.get("maximum").is_some()
                && (property.get("minimum").is_some()
                    || property.get("exclusiveMinimum").is_some());
            assert!(bounded, "{key}: {property}");
            assert!(property.get("description").is_some(), "{key}");
        }
    }

    #[test]
    fn no_threshold_lets_a_hit_free_or_a_miss_fill_an_unknown_cell() {
        // With free_at above 0 a first hit from afar, worth 0.3, would leave the cell free.
        for (free_at, occupied_at) in [
            (0.5, 0.7),
            (0.0, 0.7),
            (-1.0, -0.5),
            (-1.0, 0.0),
            (-1e-4, 0.7),
        ] {
            let params = MapperParams {
                free_at,
                free_until: free_at,
                occupied_until: occupied_at,
                occupied_at,
                ..MapperParams::default()
            };
            let refused = params.check().expect_err("the wrong side of zero");
            assert!(refused.to_string().contains("above 0"), "{refused}");
        }
    }

    #[test]
    fn a_least_radius_above_the_largest_is_refused() {
        let params = MapperParams {
            tracker: TrackerParams {
                min_radius: 2.0,
                ..TrackerParams::default()
            },
            ..MapperParams::default()
        };
        let refused = params.check().expect_err("no radius between").to_string();
        assert!(refused.contains("min_radius_m 2 m"), "{refused}");
    }

    #[test]
    fn thresholds_that_contradict_each_other_are_refused() {
        for params in [
            MapperParams {
                free_at: -0.5,
                ..MapperParams::default()
            },
            MapperParams {
                occupied_until: 0.8,
                ..MapperParams::default()
            },
            MapperParams {
                free_limit: 0.9,
                ..MapperParams::default()
            },
            MapperParams {
                occupied_at: f64::NAN,
                ..MapperParams::default()
            },
        ] {
            let refused = params.check().expect_err("a contradiction");
            assert!(refused.to_string().contains("free_until"), "{refused}");
        }
    }
}
