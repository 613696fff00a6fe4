//! What the claims are judged by: plain numbers, so that a test can make them by hand.

use super::super::Table2;
use crate::outcome::{Metrics, RunOutcome};
use serde::Serialize;

/// All that was measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    /// Plans of every method that has chance in it.
    pub runs: u64,
    /// Rides of each kind.
    pub rides: u64,
    /// Seed of the first of them; the others follow on.
    pub seed: u64,
    /// Table 2.
    pub table2: Table2,
    /// Algorithm 1 to the letter, on the same field.
    pub as_printed: Found,
    /// Rides of `fig7.toml`, one for each seed.
    pub flywheel: Rides,
    /// Rides of `fig7-balancer.toml`.
    pub balancer: Rides,
    /// The ride of `fig7.toml` on rigid bodies; absent where the program was built without them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rigid: Option<Ridden>,
    /// Rides of `unknown-yard.toml`, on what the laser shows.
    pub unknown: Rides,
    /// How far the standing bike may lean and be caught, in flywheel mode, °.
    pub lean_flywheel_deg: f64,
    /// The same in balancer mode, °.
    pub lean_balancer_deg: f64,
}

/// How many searches found a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Found {
    /// Of so many.
    pub runs: u64,
    /// So many.
    pub found: u64,
}

/// One ride.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ridden {
    /// Its seed.
    pub seed: u64,
    /// How it ended.
    pub outcome: RunOutcome,
    /// Why.
    pub reason: String,
    /// What was measured on it.
    pub metrics: Metrics,
    /// Hash of the run.
    pub result_hash: String,
}

/// Rides of one scenario with several seeds.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
#[serde(transparent)]
pub struct Rides(pub Vec<Ridden>);

impl Rides {
    /// How many arrived.
    #[must_use]
    pub fn arrived(&self) -> usize {
        let arrived = |ride: &&Ridden| ride.outcome == RunOutcome::Arrived;
        self.0.iter().filter(arrived).count()
    }

    /// Whether there are rides, and all of them arrived.
    #[must_use]
    pub fn all_arrived(&self) -> bool {
        !self.0.is_empty() && self.arrived() == self.0.len()
    }

    /// The greatest value of a metric; `None` where one ride lacks it, or there are none.
    #[must_use]
    pub fn most(&self, metric: impl Fn(&Metrics) -> Option<f64>) -> Option<f64> {
        self.folded(metric, f64::max)
    }

    /// The least value of a metric; `None` where one ride lacks it, or there are none.
    #[must_use]
    pub fn least(&self, metric: impl Fn(&Metrics) -> Option<f64>) -> Option<f64> {
        self.folded(metric, f64::min)
    }

    /// The mean of a metric; `None` where one ride lacks it, or there are none.
    #[must_use]
    pub fn mean(&self, metric: impl Fn(&Metrics) -> Option<f64>) -> Option<f64> {
        let sum = self.folded(metric, |a, b| a + b)?;
        Some(sum / self.0.len() as f64)
    }

    fn folded(
        &self,
        metric: impl Fn(&Metrics) -> Option<f64>,
        of: fn(f64, f64) -> f64,
    ) -> Option<f64> {
        let values: Option<Vec<f64>> = self.0.iter().map(|ride| metric(&ride.metrics)).collect();
        values?.into_iter().reduce(of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_metric_that_one_ride_lacks_is_lacking() {
        let ride = |roll_max_deg| Ridden {
            seed: 1,
            outcome: RunOutcome::Arrived,
            reason: String::new(),
            metrics: Metrics {
                roll_max_deg,
                ..Metrics::default()
            },
            result_hash: String::new(),
        };
        let both = Rides(vec![ride(Some(2.0)), ride(Some(5.0))]);
        assert_eq!(both.most(|m| m.roll_max_deg), Some(5.0));
        assert_eq!(both.least(|m| m.roll_max_deg), Some(2.0));
        assert_eq!(both.mean(|m| m.roll_max_deg), Some(3.5));
        let one = Rides(vec![ride(Some(2.0)), ride(None)]);
        assert_eq!(one.most(|m| m.roll_max_deg), None);
        assert_eq!(Rides::default().most(|m| m.roll_max_deg), None);
        assert!(!Rides::default().all_arrived());
    }
}
