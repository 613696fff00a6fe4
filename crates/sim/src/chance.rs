//! The simulator's streams of chance, one per component, apart from the planner's.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// What draws. The number is part of the promise "same seed, same ride": never renumber.
/// The planner's streams of the same seed lie below 2³⁵.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub(crate) enum Component {
    Sensors = 1 << 40,
    Laser = 2 << 40,
    FirstLook = 3 << 40,
}

/// The stream of one component.
pub(crate) fn stream(seed: u64, component: Component) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(component as u64);
    rng
}
