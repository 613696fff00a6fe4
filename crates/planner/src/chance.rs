//! Chance: one ChaCha8 stream per purpose, so that a seed alone fixes a plan.
//!
//! A stream is derived from (seed, stage, start index). Adding draws to one stage never moves another, and
//! starts that run in parallel each own their stream. Doubles are made here, not by a library that may change how it
//! makes them: the upper 53 bits of a word times 2⁻⁵³.

use bikebot_geometry::Point2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What a stream is for. The number is part of the promise "same seed, same plan": never renumber.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Purpose {
    /// Samples of the plain RRT.
    Rrt = 1,
    /// Samples of the plain RRT*.
    RrtStar = 2,
    /// Samples of the bidirectional RRT.
    Birrt = 3,
    /// Pairs of points of the shortcut.
    Shortcut = 4,
    /// Samples of the corridor RRT*.
    Corridor = 5,
    /// Samples of the bidirectional RRT about a place where a path is blocked.
    Repair = 6,
}

/// A stream of random numbers.
#[derive(Debug, Clone)]
pub struct Chance(ChaCha8Rng);

impl Chance {
    /// The stream for one purpose and one start of it (0 where there is only one).
    #[must_use]
    pub fn new(seed: u64, purpose: Purpose, start: u32) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(u64::from(purpose as u32) << 32 | u64::from(start));
        Self(rng)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        const ULP: f64 = 1.0 / (1u64 << 53) as f64;
        (self.0.next_u64() >> 11) as f64 * ULP
    }

    /// Uniform in [`low`, `high`).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in the box from `min` to `max`, x drawn first.
    pub fn point_in(&mut self, min: Point2, max: Point2) -> Point2 {
        let x = self.between(min.x, max.x);
        let y = self.between(min.y, max.y);
        Point2::new(x, y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_generator_is_the_one_our_plans_were_recorded_with() {
        let mut rng = ChaCha8Rng::seed_from_u64(42);
        assert_eq!(rng.next_u64(), 12_578_764_544_318_200_737);
        assert_eq!(rng.next_u64(), 17_529_487_244_874_322_312);
    }

    #[test]
    fn streams_repeat_and_differ_by_purpose_start_and_seed() {
        let first = |seed, purpose, start| Chance::new(seed, purpose, start).unit();
        let reference = first(1, Purpose::Birrt, 0);
        assert_eq!(reference, first(1, Purpose::Birrt, 0));
        assert_ne!(reference, first(2, Purpose::Birrt, 0));
        assert_ne!(reference, first(1, Purpose::Shortcut, 0));
        assert_ne!(reference, first(1, Purpose::Birrt, 1));
    }

    #[test]
    fn doubles_are_uniform_below_one() {
        let mut chance = Chance::new(7, Purpose::Rrt, 0);
        let n = 100_000;
        let mean = (0..n)
            .map(|_| {
                let x = chance.unit();
                assert!((0.0..1.0).contains(&x));
                x
            })
            .sum::<f64>()
            / f64::from(n);
        // Standard deviation of the mean is 1/√(12 n) ≈ 9e-4; five of them.
        assert!((mean - 0.5).abs() < 4.6e-3, "{mean}");
    }

    #[test]
    fn points_fill_their_box() {
        let mut chance = Chance::new(7, Purpose::Rrt, 0);
        for _ in 0..1000 {
            let p = chance.point_in(Point2::new(-1.0, 2.0), Point2::new(1.0, 2.5));
            assert!((-1.0..1.0).contains(&p.x) && (2.0..2.5).contains(&p.y));
        }
    }
}
