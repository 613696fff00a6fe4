//! How long a search may go on: a count of iterations, and a stop condition of the caller's.
//!
//! A count is repeatable on any machine; a clock is not, so the planner never reads one. Whoever has a
//! deadline hands in a closure. Every stage counts its iterations on one [`Meter`]; a plan that was
//! stopped names the count, and the same seed with that count as its budget gives the same plan bit for bit.

use serde::{Deserialize, Serialize};
use std::cell::Cell;

/// Why a caller's stop condition fired.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// The time allowed has passed.
    Deadline,
    /// Nobody wants the answer any more.
    Cancelled,
}

/// What ended a search before it was done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CutShort {
    /// The iterations allowed are used up.
    Iterations,
    /// The caller's deadline.
    Deadline,
    /// The caller's cancellation.
    Cancelled,
}

impl From<StopReason> for CutShort {
    fn from(reason: StopReason) -> Self {
        match reason {
            StopReason::Deadline => Self::Deadline,
            StopReason::Cancelled => Self::Cancelled,
        }
    }
}

/// Limits on one call of [`plan`](crate::plan); the default is none.
#[derive(Clone, Copy, Default)]
pub struct Budget<'a> {
    /// Iterations of all stages together: samples, shortcut attempts, batches of cells.
    pub iterations: Option<u64>,
    /// Asked at least every [`Meter::CHECK_EVERY`] iterations; an answer ends the search.
    pub stop: Option<&'a (dyn Fn() -> Option<StopReason> + Sync)>,
    /// What is good enough to stop at before the budget ends. Heeded by the anytime method, `full`.
    pub enough: Option<Enough<'a>>,
    /// Threads to search with; 0 counts as 1. The result is the same for any number.
    pub threads: usize,
}

/// When an anytime search may stop before its budget ends: with a path of at most this cost, but not before `settled` says so.
#[derive(Clone, Copy)]
pub struct Enough<'a> {
    /// w_p (L + w_J J), m for a length weight of 1.
    pub cost: f64,
    /// Whether the least time of the search has passed; `None`: it has.
    pub settled: Option<&'a (dyn Fn() -> bool + Sync)>,
}

impl Enough<'_> {
    /// Whether a path of this cost ends the search now.
    #[must_use]
    pub fn is_met_by(&self, cost: f64) -> bool {
        cost <= self.cost && self.settled.is_none_or(|settled| settled())
    }
}

impl std::fmt::Debug for Enough<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Enough")
            .field("cost", &self.cost)
            .field("settled", &self.settled.map(|_| "closure"))
            .finish()
    }
}

impl<'a> Budget<'a> {
    /// No limit but those of the parameters.
    #[must_use]
    pub fn unlimited() -> Self {
        Self::default()
    }

    /// At most `iterations` iterations of all stages together.
    #[must_use]
    pub fn of_iterations(iterations: u64) -> Self {
        Self {
            iterations: Some(iterations),
            ..Self::default()
        }
    }

    /// Until `stop` answers.
    #[must_use]
    pub fn until(stop: &'a (dyn Fn() -> Option<StopReason> + Sync)) -> Self {
        Self {
            stop: Some(stop),
            ..Self::default()
        }
    }
}

impl std::fmt::Debug for Budget<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Budget")
            .field("iterations", &self.iterations)
            .field("stop", &self.stop.map(|_| "closure"))
            .field("enough", &self.enough)
            .field("threads", &self.threads)
            .finish()
    }
}

/// Counts iterations against a [`Budget`] through all stages of one plan.
///
/// A stage begins each iteration with [`Meter::step`] and leaves its loop, with the best it has, at the
/// first `false`. Because nothing but `step` ends a stage early, stopping after `k` iterations has the same effect
/// whatever the reason was.
#[derive(Debug)]
pub struct Meter<'a> {
    budget: Budget<'a>,
    iterations: u64,
    cut_short: Option<CutShort>,
    /// An answer of the stop condition that the next step is to heed.
    pending: Cell<Option<CutShort>>,
}

impl<'a> Meter<'a> {
    /// Iterations between two questions to the caller's stop condition.
    pub const CHECK_EVERY: u64 = 16;

    /// A meter at zero.
    #[must_use]
    pub fn new(budget: &Budget<'a>) -> Self {
        Self {
            budget: *budget,
            iterations: 0,
            cut_short: None,
            pending: Cell::new(None),
        }
    }

    /// Begins one more iteration; `false` if there is none left, now and ever after.
    #[must_use]
    pub fn step(&mut self) -> bool {
        if self.cut_short.is_some() {
            return false;
        }
        if self
            .budget
            .iterations
            .is_some_and(|limit| self.iterations >= limit)
        {
            self.cut_short = Some(CutShort::Iterations);
            return false;
        }
        if let Some(reason) = self.pending.get() {
            self.cut_short = Some(reason);
            return false;
        }
        if self.iterations.is_multiple_of(Self::CHECK_EVERY)
            && let Some(reason) = self.budget.stop.and_then(|stop| stop())
        {
            self.cut_short = Some(reason.into());
            return false;
        }
        self.iterations += 1;
        true
    }

    /// [`Meter::step`] for an iteration that is dear: the stop condition is asked before it, whatever the count. Sixteen of
    /// them would overrun a short deadline.
    #[must_use]
    pub fn step_dearly(&mut self) -> bool {
        let is_asked_anyway = self.iterations.is_multiple_of(Self::CHECK_EVERY);
        if self.cut_short.is_none()
            && !is_asked_anyway
            && self
                .budget
                .iterations
                .is_none_or(|limit| self.iterations < limit)
            && let Some(reason) = self.budget.stop.and_then(|stop| stop())
        {
            self.cut_short = Some(reason.into());
            return false;
        }
        self.step()
    }

    /// Whether the stop condition answers now: for work that counts as one iteration however long it takes. The answer is kept: the
    /// next step ends the search.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        if self.pending.get().is_none() {
            let answer = self.budget.stop.and_then(|stop| stop());
            self.pending.set(answer.map(CutShort::from));
        }
        self.pending.get().is_some()
    }

    /// Does `work` with at most `most` iterations; that they are used up does not end this meter.
    pub(crate) fn at_most<T>(&mut self, most: u64, work: impl FnOnce(&mut Self) -> T) -> T {
        let budget = self.budget.iterations;
        let limit = self.iterations.saturating_add(most);
        let is_tighter = budget.is_none_or(|budget| limit < budget);
        if is_tighter {
            self.budget.iterations = Some(limit);
        }
        let result = work(self);
        self.budget.iterations = budget;
        if is_tighter && self.cut_short == Some(CutShort::Iterations) {
            self.cut_short = None;
        }
        result
    }

    /// Does `work`, content with any path.
    pub(crate) fn content<T>(&mut self, work: impl FnOnce(&mut Self) -> T) -> T {
        let enough = self.budget.enough.replace(Enough {
            cost: f64::INFINITY,
            settled: None,
        });
        let result = work(self);
        self.budget.enough = enough;
        result
    }

    /// A meter for one of several searches that run at the same time, with all that is left of this one's budget.
    #[must_use]
    pub(crate) fn fork(&self) -> Self {
        let left = self.budget.iterations.map(|limit| limit - self.iterations);
        Self {
            budget: Budget {
                iterations: left,
                ..self.budget
            },
            iterations: 0,
            cut_short: self.cut_short,
            pending: self.pending.clone(),
        }
    }

    /// A meter for what follows the search: with its stop condition, but iterations of its own.
    pub(crate) fn fork_unlimited(&self) -> Self {
        Self::new(&Budget {
            iterations: None,
            ..self.budget
        })
    }

    /// Whether what `fork` spent is still within the budget here: whether the search it belongs to would have gone the same way had
    /// it run after all that is counted here already.
    pub(crate) fn has_room_for(&self, fork: &Self) -> bool {
        self.budget
            .iterations
            .is_none_or(|limit| fork.iterations <= limit - self.iterations)
    }

    /// Counts what `fork` spent, and ends if it was ended.
    pub(crate) fn join(&mut self, fork: &Self) {
        self.iterations += fork.iterations;
        self.cut_short = self.cut_short.or(fork.cut_short);
        if self.pending.get().is_none() {
            self.pending.set(fork.pending.get());
        }
    }

    /// Threads to search with, at least one.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.budget.threads.max(1)
    }

    /// Whether a path of this cost is good enough to stop at.
    #[must_use]
    pub fn is_content_with(&self, cost: f64) -> bool {
        self.budget
            .enough
            .is_some_and(|enough| enough.is_met_by(cost))
    }

    /// Iterations begun so far, in all stages.
    #[must_use]
    pub fn iterations(&self) -> u64 {
        self.iterations
    }

    /// What ended the search, if it was ended.
    #[must_use]
    pub fn cut_short(&self) -> Option<CutShort> {
        self.cut_short
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn an_iteration_budget_is_met_exactly() {
        let mut meter = Meter::new(&Budget::of_iterations(5));
        assert_eq!(std::iter::from_fn(|| meter.step().then_some(())).count(), 5);
        assert_eq!(
            (meter.iterations(), meter.cut_short()),
            (5, Some(CutShort::Iterations))
        );
        assert!(!meter.step());
        assert_eq!(meter.iterations(), 5);
    }

    #[test]
    fn the_stop_condition_is_asked_every_sixteen_iterations() {
        let asked = AtomicU64::new(0);
        let stop = || (asked.fetch_add(1, Ordering::Relaxed) == 3).then_some(StopReason::Deadline);
        let mut meter = Meter::new(&Budget::until(&stop));
        while meter.step() {}
        assert_eq!(
            (meter.iterations(), meter.cut_short()),
            (48, Some(CutShort::Deadline))
        );
        assert_eq!(asked.load(Ordering::Relaxed), 4);
    }

    #[test]
    fn before_a_dear_iteration_the_stop_condition_is_asked_once() {
        let asked = AtomicU64::new(0);
        let stop = || (asked.fetch_add(1, Ordering::Relaxed) == 20).then_some(StopReason::Deadline);
        let mut meter = Meter::new(&Budget::until(&stop));
        while meter.step_dearly() {}
        assert_eq!(
            (meter.iterations(), meter.cut_short()),
            (20, Some(CutShort::Deadline))
        );
        assert_eq!(asked.load(Ordering::Relaxed), 21);
        let mut meter = Meter::new(&Budget::of_iterations(5));
        while meter.step_dearly() {}
        assert_eq!(
            (meter.iterations(), meter.cut_short()),
            (5, Some(CutShort::Iterations))
        );
    }

    #[test]
    fn a_part_may_have_its_own_limit_within_that_of_the_whole() {
        let count =
            |meter: &mut Meter<'_>| std::iter::from_fn(|| meter.step().then_some(())).count();
        let mut meter = Meter::new(&Budget::of_iterations(10));
        assert_eq!(meter.at_most(4, count), 4);
        assert_eq!((meter.iterations(), meter.cut_short()), (4, None));
        assert_eq!(meter.at_most(9, count), 6);
        assert_eq!(
            (meter.iterations(), meter.cut_short()),
            (10, Some(CutShort::Iterations))
        );
    }

    #[test]
    fn a_deadline_already_past_allows_nothing() {
        let stop = || Some(StopReason::Cancelled);
        let mut meter = Meter::new(&Budget::until(&stop));
        assert!(!meter.step());
        assert_eq!(
            (meter.iterations(), meter.cut_short()),
            (0, Some(CutShort::Cancelled))
        );
    }
}
