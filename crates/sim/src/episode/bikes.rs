//! Many bikes on one course, stepped in parallel.

use super::{Course, Ending, Episode, EpisodeError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Where the outcomes of a step are written, one entry per bike (observations: one row).
#[derive(Debug)]
pub struct Buffers<'b> {
    /// Row by row.
    pub observations: &'b mut [f32],
    /// What the step was worth.
    pub rewards: &'b mut [f64],
    /// Whether the state ended the episode.
    pub terminated: &'b mut [bool],
    /// Whether the clock did.
    pub truncated: &'b mut [bool],
    /// [`Ending`] as its number.
    pub endings: &'b mut [u8],
}

/// Many bikes on one course.
///
/// Each has its own seed and its own streams of chance: `n` bikes ride as `n` episodes alone would, bit for
/// bit, on any number of threads. A bike whose episode has ended begins its next one in the step after,
/// whatever its action (gymnasium's "next step" reset).
#[derive(Debug)]
pub struct Bikes {
    course: Arc<Course>,
    bikes: Vec<Episode>,
    /// Beside the calling thread.
    pool: Option<rayon::ThreadPool>,
    threads: usize,
}

/// Bikes below which a further thread costs more than it gives.
const LEAST_PER_THREAD: usize = 16;
/// Pieces that each thread takes in the mean.
const PIECES_PER_THREAD: usize = 4;

impl Bikes {
    /// `seeds.len()` bikes, on `threads` threads (0: one per core).
    ///
    /// # Errors
    ///
    /// As [`Episode::new`], and where threads cannot be started.
    pub fn new(course: Arc<Course>, seeds: &[u64], threads: usize) -> Result<Self, EpisodeError> {
        let bikes = seeds
            .iter()
            .map(|seed| Episode::new(&course, *seed))
            .collect::<Result<Vec<_>, _>>()?;
        let wanted = if threads == 0 {
            std::thread::available_parallelism().map_or(1, usize::from)
        } else {
            threads
        };
        let threads = wanted.min(seeds.len().div_ceil(LEAST_PER_THREAD)).max(1);
        let pool = (threads > 1)
            .then(|| {
                rayon::ThreadPoolBuilder::new()
                    .num_threads(threads - 1)
                    .build()
            })
            .transpose()
            .map_err(|error| EpisodeError::Threads(error.to_string()))?;
        Ok(Self {
            course,
            bikes,
            pool,
            threads,
        })
    }

    /// The course.
    #[must_use]
    pub fn course(&self) -> &Arc<Course> {
        &self.course
    }

    /// The bikes.
    #[must_use]
    pub fn bikes(&self) -> &[Episode] {
        &self.bikes
    }

    /// Begins anew: bike `i` the first episode of `seeds[i]`, or its next one without a seed, and not at all
    /// where `which` says so. All observations are written.
    ///
    /// # Errors
    ///
    /// [`EpisodeError::Length`], or as [`Episode::new`].
    pub fn reset(
        &mut self,
        seeds: &[Option<u64>],
        which: Option<&[bool]>,
        observations: &mut [f32],
    ) -> Result<(), EpisodeError> {
        let count = self.bikes.len();
        length("seeds", seeds.len(), count)?;
        let width = self.course.task().observations().len();
        length("observations", observations.len(), count * width)?;
        if let Some(which) = which {
            length("the mask", which.len(), count)?;
        }
        for (i, (bike, row)) in self
            .bikes
            .iter_mut()
            .zip(observations.chunks_exact_mut(width))
            .enumerate()
        {
            if which.is_none_or(|which| which[i]) {
                match seeds[i] {
                    Some(seed) => bike.reset(seed)?,
                    None => bike.reset_next()?,
                }
            }
            bike.observe(row)?;
        }
        Ok(())
    }

    /// One control period of every bike under its row of `actions`.
    ///
    /// # Errors
    ///
    /// [`EpisodeError::Length`] and [`EpisodeError::ActionNotFinite`]; no bike has moved then.
    pub fn step(&mut self, actions: &[f32], out: Buffers<'_>) -> Result<(), EpisodeError> {
        let count = self.bikes.len();
        let task = self.course.task();
        let (wide, width) = (task.actions().len(), task.observations().len());
        length("actions", actions.len(), count * wide)?;
        length("observations", out.observations.len(), count * width)?;
        length("rewards", out.rewards.len(), count)?;
        length("terminated", out.terminated.len(), count)?;
        length("truncated", out.truncated.len(), count)?;
        length("endings", out.endings.len(), count)?;
        finite(actions, wide)?;
        let share = count.div_ceil(PIECES_PER_THREAD * self.threads).max(1);
        let mut pieces = self
            .bikes
            .chunks_mut(share)
            .zip(actions.chunks(share * wide))
            .zip(out.observations.chunks_mut(share * width))
            .zip(out.rewards.chunks_mut(share))
            .zip(out.terminated.chunks_mut(share))
            .zip(out.truncated.chunks_mut(share))
            .zip(out.endings.chunks_mut(share))
            .map(
                |(
                    (((((bikes, actions), observations), rewards), terminated), truncated),
                    endings,
                )| {
                    Piece {
                        bikes,
                        actions,
                        out: Buffers {
                            observations,
                            rewards,
                            terminated,
                            truncated,
                            endings,
                        },
                    }
                },
            );
        let Some(pool) = &self.pool else {
            return pieces.try_for_each(|piece| piece.step(wide, width));
        };
        // Whoever is free takes the next piece: a thread that has to wait for its core holds nobody up.
        let queue = Mutex::new(pieces);
        let failed = Mutex::new(None);
        let work = || {
            while let Some(piece) = locked(&queue).next() {
                if let Err(error) = piece.step(wide, width) {
                    locked(&failed).get_or_insert(error);
                }
            }
        };
        pool.in_place_scope(|scope| {
            for _ in 1..self.threads {
                scope.spawn(|_| work());
            }
            work();
        });
        locked(&failed).take().map_or(Ok(()), Err)
    }
}

/// A lock is only poisoned by a panic, which has ended the step already.
fn locked<T>(lock: &Mutex<T>) -> MutexGuard<'_, T> {
    lock.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Some neighbouring bikes, with their share of everything.
struct Piece<'p> {
    bikes: &'p mut [Episode],
    actions: &'p [f32],
    out: Buffers<'p>,
}

impl Piece<'_> {
    fn step(self, wide: usize, width: usize) -> Result<(), EpisodeError> {
        let rows = self
            .actions
            .chunks_exact(wide)
            .zip(self.out.observations.chunks_exact_mut(width));
        for (i, (bike, (action, row))) in self.bikes.iter_mut().zip(rows).enumerate() {
            let (reward, ending) = if bike.is_over() {
                bike.reset_next()?;
                (0.0, Ending::None)
            } else {
                let step = bike.advance(action);
                (step.reward, step.ending)
            };
            bike.observe(row)?;
            self.out.rewards[i] = reward;
            self.out.terminated[i] = ending.is_terminal();
            self.out.truncated[i] = ending == Ending::Duration;
            self.out.endings[i] = ending as u8;
        }
        Ok(())
    }
}

pub(super) fn length(
    what: &'static str,
    found: usize,
    expected: usize,
) -> Result<(), EpisodeError> {
    if found == expected {
        Ok(())
    } else {
        Err(EpisodeError::Length {
            what,
            found,
            expected,
        })
    }
}

/// Refuses actions with a number that is none; `wide` numbers are one action.
pub(super) fn finite(actions: &[f32], wide: usize) -> Result<(), EpisodeError> {
    match actions.iter().position(|number| !number.is_finite()) {
        None => Ok(()),
        Some(at) => Err(EpisodeError::ActionNotFinite {
            bike: at / wide,
            number: at % wide,
            value: actions[at],
        }),
    }
}
