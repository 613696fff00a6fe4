//! How a ride ended, with the numbers that go with it, and whether that was expected.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RunOutcome {
    /// At rest within the goal's tolerance; without a goal: recovered (`two_link`), or at rest at the path's end.
    Arrived,
    /// |roll| above 0.7 rad, slipped, or lifted a wheel.
    Fell,
    /// The footprint met a true obstacle.
    Collided,
    /// Planning found no path, so nothing was ridden.
    NoPath,
    /// The scenario's duration ended first.
    TimedOut,
    /// Stopped from outside.
    Interrupted,
    /// Came to rest, upright, elsewhere than at the goal.
    Stopped,
}

impl RunOutcome {
    /// The name as written in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Arrived => "arrived",
            Self::Fell => "fell",
            Self::Collided => "collided",
            Self::NoPath => "no_path",
            Self::TimedOut => "timed_out",
            Self::Interrupted => "interrupted",
            Self::Stopped => "stopped",
        }
    }
}

impl std::fmt::Display for RunOutcome {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// Declares [`Metrics`] and, over the same names, [`Expect`].
macro_rules! metrics {
    ($($(#[doc = $doc:literal])+ $name:ident: $kind:ty, $side:ident;)+) => {
        /// What was measured on a ride; what does not apply is absent, never zero.
        #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
        pub struct Metrics {
            $(
                $(#[doc = $doc])+
                #[serde(skip_serializing_if = "Option::is_none")]
                pub $name: Option<$kind>,
            )+
        }

        impl Metrics {
            /// Names of all metrics, in the order of the documentation.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($name)),+];

            /// Name and value of every metric that applies.
            pub fn iter(&self) -> impl Iterator<Item = (&'static str, f64)> {
                [$((stringify!($name), self.$name.map(|value| value as f64))),+]
                    .into_iter()
                    .filter_map(|(name, value)| value.map(|value| (name, value)))
            }
        }

        /// `[expect]`: what the run has to show for exit code 0.
        ///
        /// Each metric named here is a bound: the greatest value allowed, or, for those that measure a
        /// least value (`…_min…`), the least.
        #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
        #[serde(default, deny_unknown_fields)]
        pub struct Expect {
            /// How the run has to end. Left out: arrived.
            #[serde(skip_serializing_if = "Option::is_none")]
            pub outcome: Option<RunOutcome>,
            /// The reason it has to give.
            #[serde(skip_serializing_if = "Option::is_none")]
            pub reason: Option<String>,
            $(
                #[doc = concat!("Bound on the metric `", stringify!($name), "`.")]
                #[serde(skip_serializing_if = "Option::is_none")]
                #[schemars(range(min = -1.0e9, max = 1.0e9))]
                pub $name: Option<f64>,
            )+
        }

        impl Expect {
            fn bounds(&self, metrics: &Metrics) -> Vec<ExpectCheck> {
                let mut checks = Vec::new();
                $(
                    if let Some(bound) = self.$name {
                        checks.push(bound_check(
                            stringify!($name),
                            metrics.$name.map(|value| value as f64),
                            bound,
                            stringify!($side) == "least",
                        ));
                    }
                )+
                checks
            }
        }
    };
}

metrics! {
    /// Simulated time of the ride, s.
    time_s: f64, most;
    /// Way of the rear contact, m.
    distance_m: f64, most;
    /// Greatest distance of the followed point from the followed curve, from 1 m after the start, m.
    lateral_error_max_m: f64, most;
    /// Root mean square of the same, m.
    lateral_error_rms_m: f64, most;
    /// Greatest distance of the rear contact from the planned path, m.
    rear_error_max_m: f64, most;
    /// Rear contact to the goal point (or the path's end), at rest, m.
    end_position_error_m: f64, most;
    /// Heading at rest against the goal heading (or the path's last), degrees.
    end_heading_error_deg: f64, most;
    /// Greatest |roll|, degrees.
    roll_max_deg: f64, most;
    /// Greatest |balancer torque|, N m.
    balancer_torque_max_nm: f64, most;
    /// Root mean square of the balancer torque, N m.
    balancer_torque_rms_nm: f64, most;
    /// Greatest |balancer speed|, rad/s.
    balancer_speed_max_radps: f64, most;
    /// Greatest |balancer angle|, rad.
    balancer_angle_max_rad: f64, most;
    /// Work the drive gave out, `∫ max(F v, 0) dt`, J; what braking takes up is not given back.
    drive_work_j: f64, most;
    /// Work the balancer's motor gave out, `∫ max(τ β̇, 0) dt`, J.
    balancer_work_j: f64, most;
    /// Greatest speed of the rear contact, m/s.
    speed_max_mps: f64, most;
    /// Speed of the followed point at the largest path curvature more than 1.5 m from both ends, m/s.
    corner_speed_mps: f64, most;
    /// Largest curvature of the planned path, 1/m.
    max_path_curvature_per_m: f64, most;
    /// Greatest share of the rear wheel's friction in use, while it is on the ground.
    friction_use_rear_max: f64, most;
    /// Greatest share of the front wheel's friction in use, while it is on the ground.
    friction_use_front_max: f64, most;
    /// Least load of either wheel, N.
    wheel_load_min_n: f64, least;
    /// Least distance of the footprint from a true obstacle, m.
    min_clearance_m: f64, least;
    /// Ticks in which the augmented system gained energy nobody supplied.
    passivity_violations: u64, most;
    /// Least |D|/|D upright| of the balance law.
    decoupling_margin_min: f64, least;
    /// Ticks in which the balance law's guard took over.
    balance_fallbacks: u64, most;
    /// Plans made while riding, the first not counted.
    replans: u64, most;
    /// Wall-clock time of planning, s.
    plan_time_s: f64, most;
    /// Wall-clock time of the whole run, s.
    wall_time_s: f64, most;
    /// Simulated time over wall-clock time of the ride.
    real_time_factor: f64, least;
}

/// The metrics that a clock measures; they are not part of a result.
pub const WALL_CLOCK_METRICS: [&str; 3] = ["plan_time_s", "wall_time_s", "real_time_factor"];

/// One expectation and whether it holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExpectCheck {
    /// The expectation in words, with what was found.
    pub check: String,
    /// It holds.
    pub ok: bool,
}

impl Expect {
    /// Holds a run against every expectation, in the order of the metrics.
    #[must_use]
    pub fn checks(&self, outcome: RunOutcome, reason: &str, metrics: &Metrics) -> Vec<ExpectCheck> {
        let wanted = self.outcome.unwrap_or(RunOutcome::Arrived);
        let mut checks = vec![ExpectCheck {
            check: if wanted == outcome {
                format!("outcome = {outcome}")
            } else {
                format!("outcome = {wanted} (was {outcome})")
            },
            ok: wanted == outcome,
        }];
        if let Some(wanted) = &self.reason {
            checks.push(ExpectCheck {
                check: format!("reason = {wanted} (was {reason})"),
                ok: wanted == reason,
            });
        }
        checks.extend(self.bounds(metrics));
        checks
    }
}

fn bound_check(name: &str, found: Option<f64>, bound: f64, is_least: bool) -> ExpectCheck {
    let sign = if is_least { "≥" } else { "≤" };
    match found {
        Some(value) => ExpectCheck {
            check: format!("{name} {sign} {bound} (was {value:.4})"),
            ok: if is_least {
                value >= bound
            } else {
                value <= bound
            },
        },
        None => ExpectCheck {
            check: format!("{name} {sign} {bound} (was not measured)"),
            ok: false,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_metric_that_was_not_measured_fails_its_expectation() {
        let expect = Expect {
            lateral_error_max_m: Some(0.05),
            ..Expect::default()
        };
        let checks = expect.checks(RunOutcome::Arrived, "at_goal", &Metrics::default());
        assert_eq!(
            checks.iter().map(|check| check.ok).collect::<Vec<_>>(),
            [true, false]
        );
    }

    #[test]
    fn least_values_are_bounded_from_below() {
        let expect = Expect {
            wheel_load_min_n: Some(50.0),
            ..Expect::default()
        };
        let metrics = |load| Metrics {
            wheel_load_min_n: Some(load),
            ..Metrics::default()
        };
        assert!(expect.checks(RunOutcome::Arrived, "", &metrics(51.0))[1].ok);
        assert!(!expect.checks(RunOutcome::Arrived, "", &metrics(49.0))[1].ok);
    }

    #[test]
    fn absent_metrics_are_absent_from_json() {
        let json = serde_json::to_string(&Metrics::default()).expect("plain numbers serialise");
        assert_eq!(json, "{}");
    }
}
