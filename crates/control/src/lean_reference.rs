//! The lean a coming turn asks for.
//!
//! A balancer cannot hold the moment of a turn, so the body must already lean when the turn
//! comes. The reference that needs no balancer torque obeys
//! `alpha_ref'' = lambda^2 (alpha_ref - alpha_eq(t))`; its bounded solution is a preview and a
//! filter, the same split as the divergent component of motion in walking robots:
//!
//! ```text
//! xi_ref(t) = lambda integral_0^inf exp(-lambda s) alpha_eq(t + s) ds,
//! alpha_ref' = lambda (xi_ref - alpha_ref).
//! ```
//!
//! Between two previews `xi_ref' = lambda (xi_ref - alpha_eq)` carries it on, which is what the integral does
//! in a future that comes as foreseen. What the next preview says beyond that is a surprise (a late pose, a
//! start beside the path) and enters over a settling time.
//!
//! `alpha_eq(t + s)` comes from the path follower, which rolls out its own closed loop
//! ([`crate::follower::Follower::roll_out`]).

use crate::output_zeroing::OutputReference;
use crate::params::BalanceParams;
use crate::roll_model::{RollModel, TurnMoment};

/// No turn asks for more lean than this, rad: tyres slip before.
const LEAN_MAX: f64 = 0.7;

/// Preview and filter of the lean reference.
#[derive(Debug, Clone, PartialEq)]
pub struct LeanReference {
    enabled: bool,
    step: f64,
    /// `exp(-lambda i h) (1 - exp(-lambda h))`.
    weights: Vec<f64>,
    rate: f64,
    period: u32,
    ticks: u32,
    /// Share of a surprise that one preview lets in.
    share: f64,
    divergent: f64,
    lean: f64,
}

impl LeanReference {
    /// Starts at the present lean `lean`, rad, so that switching on makes no step; called every
    /// `control_period` s.
    #[must_use]
    pub fn new(params: &BalanceParams, model: &RollModel, lean: f64, control_period: f64) -> Self {
        let mut reference = Self {
            enabled: params.preview,
            step: params.preview_step,
            weights: vec![0.0; params.preview_steps.max(1) as usize],
            rate: 0.0,
            period: params.preview_ticks.max(1),
            ticks: 0,
            share: if params.preview_settling > 0.0 {
                let time = control_period * f64::from(params.preview_ticks.max(1));
                1.0 - (-time / params.preview_settling).exp()
            } else {
                1.0
            },
            divergent: lean,
            lean,
        };
        reference.set_model(model);
        reference
    }

    /// Takes over the toppling rate of a model whose offset has moved. Does not allocate.
    pub fn set_model(&mut self, model: &RollModel) {
        let rate = model.toppling_rate();
        if rate == self.rate {
            return;
        }
        self.rate = rate;
        let decay = (-rate * self.step).exp();
        let mut weight = 1.0 - decay;
        for w in &mut self.weights {
            *w = weight;
            weight *= decay;
        }
    }

    /// `xi_ref`, rad: the divergent component the body should have.
    #[must_use]
    pub fn divergent(&self) -> f64 {
        self.divergent
    }

    /// `alpha_ref`, rad.
    #[must_use]
    pub fn lean(&self) -> f64 {
        self.lean
    }

    /// Looks ahead on every `preview_ticks`-th call. `roll_out` is given step, s, and number of steps, and tells
    /// the centripetal acceleration, m/s^2, and the yaw acceleration, rad/s^2, of each of them; `turn` is the
    /// present one.
    pub fn look(
        &mut self,
        model: &RollModel,
        turn: &TurnMoment,
        roll_out: impl FnOnce(f64, usize, &mut dyn FnMut(f64, f64)),
    ) {
        if !self.enabled {
            // Nothing is known of the coming yaw acceleration, and the present one is over too soon to lean for.
            self.divergent = model.equilibrium_lean(turn.centripetal, 0.0);
            return;
        }
        if self.ticks == 0 {
            let mut weights = self.weights.iter();
            let mut xi = 0.0;
            roll_out(self.step, self.weights.len(), &mut |centripetal, yaw| {
                if let Some(weight) = weights.next() {
                    let lean = model.equilibrium_lean(centripetal, yaw);
                    // A roll-out that leaves the numbers foresees nothing.
                    if lean.is_finite() {
                        xi += weight * lean.clamp(-LEAN_MAX, LEAN_MAX);
                    }
                }
            });
            let surprise = xi - self.divergent;
            self.divergent += self.share * surprise;
        }
        self.ticks = (self.ticks + 1) % self.period;
    }

    /// No turn is coming: the bike stands.
    pub fn look_at_nothing(&mut self) {
        self.divergent = 0.0;
    }

    /// Reference for this tick, given `alpha_eq` of the present motion; then advances by `dt` seconds.
    pub fn tick(&mut self, equilibrium: f64, dt: f64) -> OutputReference {
        let l2 = self.rate * self.rate;
        let p1 = self.rate * (self.divergent - self.lean);
        let p2 = l2 * (self.lean - equilibrium);
        let reference = OutputReference {
            value: self.lean,
            derivatives: [p1, p2, l2 * p1, l2 * p2],
        };
        self.lean += p1 * dt;
        if self.enabled {
            self.divergent += self.rate * (self.divergent - equilibrium) * dt;
        }
        reference
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_dynamics::BikeParams;

    fn reference(params: &BalanceParams) -> (LeanReference, RollModel) {
        let model = RollModel::new(&BikeParams::default(), 0.0);
        (LeanReference::new(params, &model, 0.0, 0.005), model)
    }

    /// A future in which every step turns alike.
    fn steady(centripetal: f64, yaw: f64) -> impl FnOnce(f64, usize, &mut dyn FnMut(f64, f64)) {
        move |_, steps, visit| (0..steps).for_each(|_| visit(centripetal, yaw))
    }

    #[test]
    fn a_straight_asks_for_no_lean_and_a_lasting_turn_for_its_own() {
        let (mut lean, model) = reference(&BalanceParams::default());
        lean.look(&model, &TurnMoment::default(), steady(0.0, 0.0));
        assert_eq!(lean.divergent(), 0.0);
        let (mut lean, model) = reference(&BalanceParams {
            preview_steps: 400,
            ..BalanceParams::default()
        });
        let turn = model.equilibrium_lean(0.7, 0.0);
        // It comes as a surprise, and a surprise enters over the settling time.
        lean.look(&model, &TurnMoment::default(), steady(0.7, 0.0));
        let share = 1.0 - (-0.02f64 / 0.05).exp();
        assert!((lean.divergent() - share * turn).abs() < 1e-12);
        for _ in 0..400 {
            lean.look(&model, &TurnMoment::default(), steady(0.7, 0.0));
        }
        // What lies beyond 16 s weighs exp(-58).
        assert!((lean.divergent() - turn).abs() < 1e-12);
    }

    #[test]
    fn a_future_that_comes_as_foreseen_holds_no_surprise() {
        // A ramp of centripetal acceleration: xi leads it by 1/lambda, at every moment.
        let (mut lean, model) = reference(&BalanceParams {
            preview_step: 0.005,
            preview_steps: 400,
            preview_ticks: 1,
            preview_settling: 0.0,
            ..BalanceParams::default()
        });
        let dt = 0.005;
        let at = |t: f64| 0.2 * t;
        let mut carried = None;
        for tick in 0..200 {
            let t = dt * f64::from(tick);
            lean.look(&model, &TurnMoment::default(), |step, steps, visit| {
                (0..steps).for_each(|i| visit(at(t + (i as f64 + 0.5) * step), 0.0));
            });
            if let Some(xi) = carried {
                let surprise: f64 = lean.divergent() - xi;
                // Euler's step and the end of the horizon, against a xi that rises by 1e-4 rad a tick.
                assert!(surprise.abs() < 5e-6, "{surprise}");
            }
            lean.tick(model.equilibrium_lean(at(t), 0.0), dt);
            carried = Some(lean.divergent());
        }
    }

    #[test]
    fn weights_sum_to_the_share_of_the_integral_they_cover() {
        let (lean, model) = reference(&BalanceParams::default());
        let sum: f64 = lean.weights.iter().sum();
        // A geometric series: 1 - exp(-lambda N h).
        assert!((sum - (1.0 - (-model.toppling_rate() * 45.0 * 0.04).exp())).abs() < 1e-12);
    }

    #[test]
    fn the_filter_settles_on_a_steady_turn_and_its_derivatives_are_its_own() {
        let (mut lean, model) = reference(&BalanceParams {
            preview: false,
            ..BalanceParams::default()
        });
        let turn = TurnMoment {
            centripetal: 0.6,
            ..TurnMoment::default()
        };
        let equilibrium = model.equilibrium_lean(0.6, 0.0);
        let dt = 0.0005;
        let mut before: Option<OutputReference> = None;
        for tick in 0..8000 {
            lean.look(&model, &turn, |_, _, _| {});
            let now = lean.tick(equilibrium, dt);
            if let Some(last) = before {
                // Explicit Euler: the value moves by exactly its stated rate.
                assert!((now.value - last.value - dt * last.derivatives[0]).abs() < 1e-15);
                if tick > 1 {
                    let second = (now.derivatives[0] - last.derivatives[0]) / dt;
                    // First-order difference over half a millisecond of signals below 1 rad/s^3.
                    assert!((second - last.derivatives[1]).abs() < 2e-3);
                }
            }
            before = Some(now);
        }
        assert!((lean.lean() - equilibrium).abs() < 1e-5);
    }
}
