//! The figures of each suite.

use std::fmt::Write as _;

use serde::Serialize;

use super::Row;
use crate::outcome::RunOutcome;

/// The figures of one suite.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Its name.
    pub suite: String,
    /// Rides made.
    pub rides: usize,
    /// Those for which there is a path with full knowledge.
    pub solvable: usize,
    /// Of those, the ones that arrived.
    pub arrived: usize,
    /// Stopped or never set off, upright, with a reason.
    pub stopped: usize,
    /// Collisions.
    pub collided: usize,
    /// Falls.
    pub fell: usize,
    /// Neither arrived nor given up in time.
    pub timed_out: usize,
    /// Median of the ridden length over that with full knowledge, of those that arrived.
    pub ratio_median: f64,
    /// Ticks in which braking would have met a true obstacle.
    pub unsafe_ticks: u64,
    /// Ticks in which braking would have led over what was not believed free.
    pub unproved_ticks: u64,
    /// Times at which what was believed free was so no more within the stopping distance.
    pub emergencies: u64,
    /// Most times at which the path of one ride went over to the other side of a block between two equal ways.
    pub most_side_changes: u64,
}

/// The figures of each suite, in the order in which they come.
#[must_use]
pub fn summaries(rows: &[Row]) -> Vec<Summary> {
    let mut suites: Vec<&str> = rows.iter().map(|row| row.suite.as_str()).collect();
    suites.dedup();
    suites
        .into_iter()
        .map(|suite| {
            let of: Vec<&Row> = rows.iter().filter(|row| row.suite == suite).collect();
            let ended =
                |outcome: RunOutcome| of.iter().filter(|row| row.outcome == outcome).count();
            let solvable: Vec<&&Row> = of
                .iter()
                .filter(|row| row.known_length_m.is_some())
                .collect();
            let mut ratios: Vec<f64> = solvable
                .iter()
                .filter(|row| row.outcome == RunOutcome::Arrived)
                .filter_map(|row| Some(row.distance_m / row.known_length_m?))
                .collect();
            ratios.sort_by(f64::total_cmp);
            Summary {
                suite: suite.to_owned(),
                rides: of.len(),
                solvable: solvable.len(),
                arrived: ratios.len(),
                stopped: ended(RunOutcome::Stopped) + ended(RunOutcome::NoPath),
                collided: ended(RunOutcome::Collided),
                fell: ended(RunOutcome::Fell),
                timed_out: ended(RunOutcome::TimedOut),
                ratio_median: ratios.get(ratios.len() / 2).copied().unwrap_or(f64::NAN),
                unsafe_ticks: of.iter().map(|row| row.unsafe_ticks).sum(),
                unproved_ticks: of.iter().map(|row| row.unproved_ticks).sum(),
                emergencies: of.iter().map(|row| row.emergencies).sum(),
                most_side_changes: of.iter().map(|row| row.side_changes).max().unwrap_or(0),
            }
        })
        .collect()
}

/// The summaries as a Markdown table.
#[must_use]
pub fn markdown(summaries: &[Summary]) -> String {
    let mut text = String::from(
        "| suite | rides | solvable | arrived | stopped | collided | fell | timed out | ridden / known | unsafe ticks | unproved ticks | emergencies | side changes, most |\n\
         |---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n",
    );
    for s in summaries {
        let share = 100.0 * s.arrived as f64 / s.solvable.max(1) as f64;
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} ({share:.0} %) | {} | {} | {} | {} | {:.3} | {} | {} | {} | {} |",
            s.suite,
            s.rides,
            s.solvable,
            s.arrived,
            s.stopped,
            s.collided,
            s.fell,
            s.timed_out,
            s.ratio_median,
            s.unsafe_ticks,
            s.unproved_ticks,
            s.emergencies,
            s.most_side_changes
        );
    }
    text
}
