//! Several searches at once, with the result of one after the other.
//!
//! Each job runs on a fork of the meter that has all of the budget left at the beginning. Results are taken in the order of the
//! jobs: while what a job spent is within what its predecessors left, it went the very way it would have gone after
//! them. A job that spent more is made again with what is left. What jobs after the end of the budget did is thrown away.

use crate::budget::Meter;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Runs `work` on every job, on as many threads as the meter's budget allows, and gives the results to `take` in the order of the jobs,
/// with the number of the job and the meter that has counted it. Ends when `take` says `false`, or the meter does.
pub(crate) fn run<'b, J: Sync, T: Send>(
    jobs: &[J],
    meter: &mut Meter<'b>,
    work: impl Fn(&J, &mut Meter<'b>) -> T + Sync,
    mut take: impl FnMut(T, (usize, &mut Meter<'b>)) -> bool,
) {
    let threads = meter.threads().min(jobs.len());
    let mut ahead = if threads > 1 {
        run_ahead(jobs, threads, meter, &work)
    } else {
        Vec::new()
    };
    for (number, job) in jobs.iter().enumerate() {
        if meter.cut_short().is_some() {
            return;
        }
        let made = ahead
            .get_mut(number)
            .and_then(Option::take)
            .filter(|(_, fork)| meter.has_room_for(fork));
        let (result, fork) = made.unwrap_or_else(|| {
            let mut fork = meter.fork();
            (work(job, &mut fork), fork)
        });
        meter.join(&fork);
        if !take(result, (number, meter)) {
            return;
        }
    }
}

/// A result, and the meter it was made on.
type Made<'b, T> = Option<(T, Meter<'b>)>;

fn run_ahead<'b, J: Sync, T: Send>(
    jobs: &[J],
    threads: usize,
    meter: &Meter<'b>,
    work: &(impl Fn(&J, &mut Meter<'b>) -> T + Sync),
) -> Vec<Made<'b, T>> {
    let next = AtomicUsize::new(0);
    let tasks: Vec<Mutex<(Option<T>, Meter<'b>)>> = jobs
        .iter()
        .map(|_| Mutex::new((None, meter.fork())))
        .collect();
    let worker = || {
        while let number = next.fetch_add(1, Ordering::Relaxed)
            && let (Some(job), Some(task)) = (jobs.get(number), tasks.get(number))
        {
            // Each task is one thread's alone.
            let mut task = task.lock().unwrap_or_else(PoisonError::into_inner);
            let (result, fork) = &mut *task;
            *result = Some(work(job, fork));
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(worker);
        }
        worker();
    });
    tasks
        .into_iter()
        .map(|task| task.into_inner().unwrap_or_else(PoisonError::into_inner))
        .map(|(result, fork)| Some((result?, fork)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::{Budget, CutShort};
    use proptest::prelude::*;

    /// Jobs that count to their number, as far as the budget goes.
    fn outcome(
        jobs: &[u64],
        threads: usize,
        limit: Option<u64>,
    ) -> (Vec<(usize, u64)>, u64, Option<CutShort>) {
        let mut meter = Meter::new(&Budget {
            iterations: limit,
            threads,
            ..Budget::unlimited()
        });
        let mut taken = Vec::new();
        run(
            jobs,
            &mut meter,
            |&wanted, meter| (0..wanted).take_while(|_| meter.step()).count() as u64,
            |counted, (number, _)| {
                taken.push((number, counted));
                true
            },
        );
        (taken, meter.iterations(), meter.cut_short())
    }

    proptest! {
        #[test]
        fn any_number_of_threads_gives_what_one_gives(
            jobs in proptest::collection::vec(0u64..50, 0..12), limit in proptest::option::of(0u64..300), threads in 2usize..6,
        ) {
            let one = outcome(&jobs, 1, limit);
            prop_assert_eq!(&one, &outcome(&jobs, threads, limit));
            let all: u64 = jobs.iter().sum();
            prop_assert_eq!(one.1, limit.map_or(all, |limit| limit.min(all)));
        }
    }

    #[test]
    fn what_comes_after_the_end_is_not_taken() {
        let mut meter = Meter::new(&Budget {
            threads: 3,
            ..Budget::unlimited()
        });
        let mut taken = Vec::new();
        run(
            &[0, 1, 2, 3, 4],
            &mut meter,
            |&job, _| job,
            |job, _| {
                taken.push(job);
                job < 2
            },
        );
        assert_eq!(taken, [0, 1, 2]);
    }
}
