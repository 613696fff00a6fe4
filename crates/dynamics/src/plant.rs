//! What can be moved through time: a [`State`] and the [`Plant`] that gives its rate.

use std::ops::{Add, Mul};

/// A point of a plant's state space, which need not be a vector space: headings wrap.
pub trait State: Copy {
    /// The tangent: adds and scales like a vector. Units are those of the state, per second.
    type Rate: Copy + Add<Output = Self::Rate> + Mul<f64, Output = Self::Rate>;

    /// The state reached by moving along a constant `rate` for `dt` seconds.
    ///
    /// Angles that mean a direction in the plane are wrapped to (−π, π]; angles that count
    /// turns, as the balancer's, are not.
    #[must_use]
    fn moved(&self, rate: &Self::Rate, dt: f64) -> Self;
}

/// A system in state-space form, `ẋ = f(t, x, u)`.
pub trait Plant {
    /// The state `x`.
    type State: State;
    /// The input `u`, held constant by an integrator over one step.
    type Input;

    /// The rate of change `f(t, x, u)` at time `t` (s).
    fn rate(
        &self,
        t: f64,
        state: &Self::State,
        input: &Self::Input,
    ) -> <Self::State as State>::Rate;
}
