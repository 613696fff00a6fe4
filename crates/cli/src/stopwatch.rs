//! The clock the planner does not have: a deadline, and Ctrl-C.

use std::time::{Duration, Instant};

use bikebot_planner::StopReason;

use crate::interrupt;

/// Runs from the start of a search.
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch {
    began: Instant,
    limit: Option<Duration>,
}

impl Stopwatch {
    /// Starts now; the search shall end after `limit`.
    pub fn start(limit: Option<Duration>) -> Self {
        Self {
            began: Instant::now(),
            limit,
        }
    }

    /// Time since the start, s.
    pub fn seconds(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    /// The planner's question: go on?
    pub fn ask(&self) -> Option<StopReason> {
        if interrupt::asked() {
            Some(StopReason::Cancelled)
        } else if self
            .limit
            .is_some_and(|limit| self.began.elapsed() >= limit)
        {
            Some(StopReason::Deadline)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_of_nothing_has_passed() {
        let watch = Stopwatch::start(Some(Duration::ZERO));
        assert_eq!(watch.ask(), Some(StopReason::Deadline));
        assert_eq!(Stopwatch::start(None).ask(), None);
    }
}
