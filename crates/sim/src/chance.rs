//! The simulator's streams of chance, one per component, apart from the planner's.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What draws. The number is part of the promise "same seed, same ride": never renumber.
/// The planner's streams of the same seed lie below 2³⁵.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub(crate) enum Component {
    Sensors = 1 << 40,
    Laser = 2 << 40,
    FirstLook = 3 << 40,
    Start = 4 << 40,
}

/// The stream of one component.
pub(crate) fn stream(seed: u64, component: Component) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(component as u64);
    rng
}

/// The stream of one component in an episode; that of episode 0 is [`stream`]'s.
pub(crate) fn episode_stream(seed: u64, component: Component, number: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(component as u64 + number);
    rng
}

/// Uniform in `[0, 1)`: the top 53 bits of one word.
pub(crate) fn uniform(rng: &mut ChaCha8Rng) -> f64 {
    const ULP: f64 = 1.0 / (1_u64 << 53) as f64;
    (rng.next_u64() >> 11) as f64 * ULP
}
