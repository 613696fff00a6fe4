//! Work done by several threads, taken in order: what comes out does not depend
//! on their number.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread;

use crate::exit::Failure;

/// Does `work` for 0, 1, … `count` − 1 on `threads` threads and hands each result to
/// `take` in that order, as soon as it can. `take` ends it all by `Ok(false)` or an error.
pub fn run<T: Send>(
    count: u64,
    threads: usize,
    work: impl Fn(u64) -> T + Sync,
    mut take: impl FnMut(u64, T) -> Result<bool, Failure>,
) -> Result<(), Failure> {
    if threads <= 1 || count <= 1 {
        for index in 0..count {
            if !take(index, work(index))? {
                break;
            }
        }
        return Ok(());
    }
    let next = AtomicU64::new(0);
    let ended = AtomicBool::new(false);
    let (sender, receiver) = mpsc::channel();
    thread::scope(|scope| {
        for _ in 0..threads.min(usize::try_from(count).unwrap_or(usize::MAX)) {
            let (sender, next, ended, work) = (sender.clone(), &next, &ended, &work);
            scope.spawn(move || {
                while !ended.load(Ordering::Relaxed) {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    // A closed channel: nobody takes any more.
                    if index >= count || sender.send((index, work(index))).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        let mut waiting = BTreeMap::new();
        let mut due = 0;
        for (index, result) in &receiver {
            waiting.insert(index, result);
            while let Some(result) = waiting.remove(&due) {
                let goes_on = take(due, result);
                due += 1;
                if !matches!(goes_on, Ok(true)) {
                    ended.store(true, Ordering::Relaxed);
                    drop(receiver);
                    return goes_on.map(|_| ());
                }
            }
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_for_any_number_of_threads() {
        for threads in [1, 2, 7, 100] {
            let mut taken = Vec::new();
            run(
                50,
                threads,
                |index| {
                    if index % 7 == 0 {
                        thread::yield_now();
                    }
                    index * index
                },
                |index, square| {
                    taken.push((index, square));
                    Ok(true)
                },
            )
            .unwrap();
            let expected: Vec<_> = (0..50).map(|index| (index, index * index)).collect();
            assert_eq!(taken, expected);
        }
    }

    #[test]
    fn whoever_takes_may_end_it() {
        for threads in [1, 3] {
            let mut taken = 0;
            run(
                1_000_000_000,
                threads,
                |index| index,
                |index, _| {
                    taken += 1;
                    Ok(index < 9)
                },
            )
            .unwrap();
            assert_eq!(taken, 10);
        }
    }
}
