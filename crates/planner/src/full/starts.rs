//! Starts that need chance: BiRRT and taut, batch by batch.

use super::found::{FullSearch, Tell, Way};
use super::{BATCH, Full, SAMPLES};
use crate::birrt;
use crate::budget::Meter;
use crate::chance::{Chance, Purpose};
use crate::in_order;
use crate::search::PointQuery;
use crate::taut;

/// What came of one BiRRT start.
enum Start {
    Way(Way),
    Disconnected,
    Nothing,
}

impl Full<'_, '_> {
    /// The starts `first`, `first` + 1, … of one batch: their ways, and then the curves along those of them that can be worth it.
    pub(super) fn batch(
        &self,
        first: u32,
        found: &mut FullSearch,
        meter: &mut Meter<'_>,
        tell: Tell<'_>,
    ) {
        let last = (first + BATCH - 1).min(self.params.starts);
        let numbers: Vec<u32> = (first..=last).collect();
        let known = found.rivals.clone();
        let has_way = found.has_way;
        let shorter_than = found.cost() / self.weight();
        let mut ways: Vec<Way> = Vec::new();
        in_order::run(
            &numbers,
            meter,
            |&number, meter| self.start(number, has_way, shorter_than, &known, meter),
            |start, _| match start {
                Start::Way(way) => {
                    found.has_way = true;
                    if self.is_new(&way, &found.rivals) {
                        found.rivals.push(way.pulled.length);
                        ways.push(way);
                    }
                    true
                }
                Start::Disconnected => {
                    found.disconnected = true;
                    false
                }
                // Without a way the next start would do no better with as many samples.
                Start::Nothing => has_way,
            },
        );
        // A curve is no shorter than the taut polyline of its class.
        ways.retain(|way| self.weight() * way.pulled.length < found.cost());
        in_order::run(
            &ways,
            meter,
            |way, meter| {
                let guide = self.to_the_region(&way.pulled.path);
                self.refine(&guide, meter, &mut |_, _| {})
            },
            |refined, (index, meter)| {
                self.keep(&ways[index], refined, f64::INFINITY, found, meter, tell);
                !self.is_over(found, meter)
            },
        );
        self.polish(found, meter, tell);
    }

    /// BiRRT and taut.
    fn start(
        &self,
        number: u32,
        has_way: bool,
        shorter_than: f64,
        known: &[f64],
        meter: &mut Meter<'_>,
    ) -> Start {
        let query = PointQuery {
            checker: self.discs,
            start: self.problem.start.position,
            goal: self.problem.goal.position,
            goal_mode: self.params.goal,
            tolerance: self.problem.goal.tolerance,
            max_step: self.params.max_step(),
            max_samples: if has_way {
                SAMPLES.min(self.params.search_iterations)
            } else {
                self.params.search_iterations
            },
            shorter_than,
        };
        let mut chance = Chance::new(self.seed, Purpose::Birrt, number);
        let search = birrt::search(&query, true, &mut chance, meter);
        if search.disconnected {
            return Start::Disconnected;
        }
        let Some(coarse) = search.path else {
            return Start::Nothing;
        };
        let pulled = taut::pull(&coarse, &self.rivals(known), self.discs, meter);
        Start::Way(Way {
            number,
            tree: search.edges,
            coarse,
            pulled,
        })
    }
}
