//! The nearest thing met in a tube about each beam of a fan.

use std::collections::VecDeque;

/// Finds it in one sweep to either side, however many beams a thing near by fills.
///
/// What is nearer fills more beams to either side. So, on the way along the fan, something nearer hides for good
/// whatever was met before it, and what remains waits in the order of its distance: each beam enters and leaves the queue once.
#[derive(Debug, Clone)]
pub(crate) struct Beside {
    /// Up to which beam of the sweep, and how far away (m), nearest first.
    queue: VecDeque<(usize, f64)>,
}

impl Beside {
    pub(crate) fn with_capacity(beams: usize) -> Self {
        Self {
            queue: VecDeque::with_capacity(beams),
        }
    }

    /// Lowers `nearest` (m), one for each beam, to the least of what the beams beside it have met. `met` tells what a beam has
    /// met (m, not finite for nothing), `reach` to how many beams on either side that counts, never more for what is farther away.
    pub(crate) fn lower(
        &mut self,
        nearest: &mut [f64],
        met: impl Fn(usize) -> f64,
        reach: impl Fn(f64) -> usize,
    ) {
        let count = nearest.len();
        for is_forth in [true, false] {
            self.queue.clear();
            for k in 0..count {
                let beam = if is_forth { k } else { count - 1 - k };
                let distance = met(beam);
                if distance.is_finite() {
                    while self
                        .queue
                        .back()
                        .is_some_and(|(_, other)| *other >= distance)
                    {
                        self.queue.pop_back();
                    }
                    self.queue
                        .push_back((k.saturating_add(reach(distance)), distance));
                }
                while self.queue.front().is_some_and(|(last, _)| *last < k) {
                    self.queue.pop_front();
                }
                if let Some((_, least)) = self.queue.front() {
                    nearest[beam] = nearest[beam].min(*least);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against each beam telling all those beside it.
        #[test]
        fn it_is_the_least_of_all_that_reach_a_beam(
            met in prop::collection::vec(prop_oneof![Just(f64::INFINITY), Just(f64::NAN), 0.01_f64..10.0], 0..60),
            width in 0.0_f64..5.0,
        ) {
            let reach = |distance: f64| (width / distance) as usize;
            let mut expected = vec![f64::INFINITY; met.len()];
            for (j, distance) in met.iter().enumerate().filter(|(_, distance)| distance.is_finite()) {
                for (i, nearest) in expected.iter_mut().enumerate() {
                    if i.abs_diff(j) <= reach(*distance) {
                        *nearest = nearest.min(*distance);
                    }
                }
            }
            let mut nearest = vec![f64::INFINITY; met.len()];
            Beside::with_capacity(0).lower(&mut nearest, |i| met[i], reach);
            prop_assert_eq!(nearest, expected);
        }
    }

    #[test]
    fn each_beam_is_looked_at_twice_though_all_meet_something_near() {
        let count = 100_000;
        let (asked, reached) = (std::cell::Cell::new(0), std::cell::Cell::new(0));
        let mut nearest = vec![f64::INFINITY; count];
        Beside::with_capacity(count).lower(
            &mut nearest,
            |i| {
                asked.set(asked.get() + 1);
                0.03 + 1e-7 * i as f64
            },
            |_| {
                reached.set(reached.get() + 1);
                usize::MAX
            },
        );
        assert_eq!((asked.get(), reached.get()), (2 * count, 2 * count));
        assert!(nearest.iter().all(|least| *least == 0.03));
    }
}
