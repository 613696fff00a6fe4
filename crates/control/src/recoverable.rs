//! What can be recovered at all, and what a balance law recovers of it.
//!
//! **The bound.** In `p = alpha + F(beta)` and `sigma` the roll is a cooperative system that the
//! balancer pushes one way only: `sigma'` rises with `p` and falls with `beta`, at every balancer
//! angle (`D < 0`). The further the balancer has got, the further the bike has been thrown back; and
//! full torque gets it furthest. So a state from which *full torque for ever* does not throw the
//! bike back across the vertical falls to that side under any law. [`Standing::can_be_saved`] asks
//! this of both sides, on the nonlinear model with the motor's own limits of torque and speed. It is
//! an outer bound: exact in flywheel mode, where `p' = sigma/M11` does not know `beta`; in balancer
//! mode `M11` varies by 13 % about its mean with the balancer angle, and
//! [`Standing::saved_by_switching`] tries to refute it by search. What a law recovers is the inner
//! bound; the truth is between the two.

use std::sync::atomic::{AtomicUsize, Ordering};

use bikebot_dynamics::{
    Actuators, BalancerMode, BikeParams, Integrator, Rk4, TwoLink, TwoLinkInput, TwoLinkState,
};

use crate::balance::BalanceController;
use crate::error::ControlError;
use crate::params::BalanceParams;

/// |roll| at which the bike has fallen, rad.
const FALL_ROLL: f64 = 0.7;

/// Integration step, s.
const STEP: f64 = 0.001;
/// Roll on the other side at which a bike has been thrown back, rad.
const THROWN_BACK: f64 = 0.2;
/// Longest it may take, s: eleven toppling times.
const LONGEST: f64 = 3.0;
/// Height at which pushes act, m, and how long they last, s.
pub const PUSH_HEIGHT: f64 = 0.6;
/// How long a push lasts, s.
pub const PUSH_TIME: f64 = 0.1;
/// How long a law has to recover, s.
pub const TIME: f64 = 7.0;
/// |roll|, rad, and |roll rate|, rad/s, below which it has.
pub const RECOVERED: (f64, f64) = (0.5 * std::f64::consts::PI / 180.0, 0.05);

/// The standing bike: the two-link model behind its motor.
#[derive(Debug, Clone)]
pub struct Standing {
    bike: BikeParams,
    mode: BalancerMode,
    model: TwoLink,
    motor: Actuators,
}

impl Standing {
    /// `bike` with its balancer in `mode`.
    #[must_use]
    pub fn new(bike: &BikeParams, mode: BalancerMode) -> Self {
        Self {
            bike: *bike,
            mode,
            model: TwoLink::new(bike, bike.offset(mode)),
            motor: Actuators::new(bike),
        }
    }

    /// One step under `command` N m and an outer roll moment, N m.
    fn step(&self, state: &TwoLinkState, command: f64, roll_moment: f64) -> TwoLinkState {
        let (balancer_torque, _, _) = self.motor.balancer_torque(command, state.balancer_rate);
        let input = TwoLinkInput {
            balancer_torque,
            roll_moment,
        };
        Rk4.step(&self.model, 0.0, state, &input, STEP)
    }

    /// Whether full torque one way ever throws the bike across the vertical, `side` being the
    /// sign of the torque.
    fn is_thrown_back(&self, mut state: TwoLinkState, side: f64, mut push: f64) -> bool {
        let moment = push * PUSH_HEIGHT / PUSH_TIME;
        for i in 0..(LONGEST / STEP) as usize {
            if i as f64 * STEP >= PUSH_TIME {
                push = 0.0;
            }
            let acting = if push == 0.0 { 0.0 } else { moment };
            state = self.step(&state, side * self.bike.balancer_torque_max, acting);
            let roll = side * state.roll;
            if roll > FALL_ROLL || roll.is_nan() {
                return false;
            }
            if roll < -THROWN_BACK {
                return true;
            }
        }
        false
    }

    /// Whether the bound of the module's head leaves hope for `state`.
    #[must_use]
    pub fn can_be_saved(&self, state: &TwoLinkState) -> bool {
        [1.0, -1.0]
            .iter()
            .all(|side| self.is_thrown_back(*state, *side, 0.0))
    }

    /// Whether it does for an upright bike pushed with `impulse` N s to the right.
    #[must_use]
    pub fn push_can_be_saved(&self, impulse: f64) -> bool {
        self.is_thrown_back(TwoLinkState::default(), 1.0, impulse)
    }

    /// Whether any torque that switches between its two limits at most twice, at whole multiples of
    /// `grid` s, keeps a bike up that falls to the right under full torque. A bound that is one
    /// is refuted by none.
    #[must_use]
    pub fn saved_by_switching(&self, state: &TwoLinkState, grid: f64, reach: usize) -> bool {
        let max = self.bike.balancer_torque_max;
        let lasting = (grid / STEP).round().max(1.0) as usize;
        let ends = |mut state: TwoLinkState, torque: f64| {
            for _ in 0..lasting {
                state = self.step(&state, torque, 0.0);
            }
            state
        };
        [max, -max].into_iter().any(|first| {
            let mut before = *state;
            (0..reach).any(|_| {
                let mut between = before;
                let saved = (0..reach).any(|_| {
                    let saved = self.is_thrown_back(between, first.signum(), 0.0)
                        && self.is_thrown_back(between, -first.signum(), 0.0);
                    between = ends(between, -first);
                    saved
                });
                before = ends(before, first);
                saved
            })
        })
    }

    /// Whether the law of `params`, called every `period` seconds, brings the bike from `start` to
    /// rest within [`TIME`], after a push of `impulse` N s.
    ///
    /// # Errors
    ///
    /// As [`BalanceController::new`].
    pub fn recovers(
        &self,
        params: &BalanceParams,
        period: f64,
        start: &TwoLinkState,
        impulse: f64,
    ) -> Result<bool, ControlError> {
        let mut law = BalanceController::new(&self.bike, self.mode, params, period)?;
        let mut state = *start;
        let steps = (period / STEP).round().max(1.0) as usize;
        let mut time = 0.0;
        for _ in 0..(TIME / period).round() as usize {
            let torque = law.torque(&state).torque;
            for _ in 0..steps {
                let moment = if time < PUSH_TIME - 0.5 * STEP {
                    impulse * PUSH_HEIGHT / PUSH_TIME
                } else {
                    0.0
                };
                state = self.step(&state, torque, moment);
                time += STEP;
            }
            if state.roll.is_nan() || state.roll.abs() > FALL_ROLL {
                return Ok(false);
            }
        }
        Ok(state.roll.abs() < RECOVERED.0 && state.roll_rate.abs() < RECOVERED.1)
    }
}

/// A square of initial rolls and roll rates, the balancer at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BasinGrid {
    /// Points along each side.
    pub points: usize,
    /// Greatest roll either way, rad.
    pub roll: f64,
    /// Greatest roll rate either way, rad/s.
    pub roll_rate: f64,
}

impl Default for BasinGrid {
    /// The 33 x 33 points of the design note: 16 deg, 1 rad/s.
    fn default() -> Self {
        Self {
            points: 33,
            roll: 16f64.to_radians(),
            roll_rate: 1.0,
        }
    }
}

impl BasinGrid {
    /// All states, roll rate by roll rate.
    #[must_use]
    pub fn states(&self) -> Vec<TwoLinkState> {
        let last = (self.points.max(2) - 1) as f64;
        let at = |i: usize, most: f64| most * (2.0 * i as f64 / last - 1.0);
        (0..self.points * self.points)
            .map(|i| TwoLinkState {
                roll: at(i % self.points, self.roll),
                roll_rate: at(i / self.points, self.roll_rate),
                ..TwoLinkState::default()
            })
            .collect()
    }

    /// Which of [`Self::states`] pass, asked on all cores. Roll and balance know no left and right,
    /// so that only half of them are asked.
    #[must_use]
    pub fn map(&self, passes: impl Fn(&TwoLinkState) -> bool + Sync) -> Vec<bool> {
        let states = self.states();
        let asked = &states[..states.len().div_ceil(2)];
        let next = AtomicUsize::new(0);
        let workers = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let mut cells = vec![false; states.len()];
        std::thread::scope(|scope| {
            let running: Vec<_> = (0..workers)
                .map(|_| {
                    scope.spawn(|| {
                        let mut passed = Vec::new();
                        while let Some((i, state)) = take(&next, asked) {
                            if passes(state) {
                                passed.push(i);
                            }
                        }
                        passed
                    })
                })
                .collect();
            for worker in running {
                // A worker can only end badly by a panic of `passes`, which goes on here.
                match worker.join() {
                    Ok(passed) => passed.into_iter().for_each(|i| cells[i] = true),
                    Err(panic) => std::panic::resume_unwind(panic),
                }
            }
        });
        for i in asked.len()..states.len() {
            cells[i] = cells[states.len() - 1 - i];
        }
        cells
    }
}

/// The next of `states` that nobody has taken yet.
fn take<'s>(next: &AtomicUsize, states: &'s [TwoLinkState]) -> Option<(usize, &'s TwoLinkState)> {
    let i = next.fetch_add(1, Ordering::Relaxed);
    states.get(i).map(|state| (i, state))
}

/// Share of cells that passed.
#[must_use]
pub fn share(cells: &[bool]) -> f64 {
    cells.iter().filter(|cell| **cell).count() as f64 / cells.len().max(1) as f64
}

/// The largest multiple of `step` up to `most` below which everything passes; asked in steps of
/// eight first.
pub fn largest(step: f64, most: f64, mut passes: impl FnMut(f64) -> bool) -> f64 {
    let last = (most / step).round() as usize;
    let mut reached = 0;
    for stride in [8, 1] {
        while reached + stride <= last && passes((reached + stride) as f64 * step) {
            reached += stride;
        }
    }
    reached as f64 * step
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::BalanceLawKind;

    fn leaning(degrees: f64) -> TwoLinkState {
        TwoLinkState {
            roll: degrees.to_radians(),
            ..TwoLinkState::default()
        }
    }

    #[test]
    fn the_bound_is_that_of_bang_bang_in_flywheel_mode() {
        let bike = Standing::new(&BikeParams::default(), BalancerMode::Flywheel);
        let roll = largest(0.1, 20.0, |d| bike.can_be_saved(&leaning(d)));
        let push = largest(0.1, 60.0, |j| bike.push_can_be_saved(j));
        // The design note's independent 11.4 deg and 30.7 N s, to half a step of its print and one
        // of ours; a push that lasts is a little worse than the note's blow.
        assert!((roll - 11.4).abs() < 0.11, "{roll}");
        assert!(push > 28.0 && push < 30.8, "{push}");
    }

    #[test]
    fn the_linear_torque_bound_is_met_when_speed_is_free() {
        // Without a speed limit: |xi| < tau_max / b1, and xi = alpha at rest. Gravity on the frame
        // is its sine: at 14 deg 1 % less than linear.
        let bike = BikeParams {
            balancer_speed_max: 1e4,
            ..BikeParams::default()
        };
        let standing = Standing::new(&bike, BalancerMode::Flywheel);
        let linear = (bike.balancer_torque_max / bike.lumped(0.0).b1).to_degrees();
        let sine = (bike.balancer_torque_max / bike.lumped(0.0).b1)
            .asin()
            .to_degrees();
        let roll = largest(0.05, 20.0, |d| standing.can_be_saved(&leaning(d)));
        assert!(
            roll > linear - 0.05 && roll < sine + 0.05,
            "{linear} {roll} {sine}"
        );
    }

    #[test]
    fn no_switching_saves_what_the_bound_gives_up() {
        let bike = BikeParams::default();
        for mode in [BalancerMode::Flywheel, BalancerMode::Balancer] {
            let standing = Standing::new(&bike, mode);
            let roll = largest(0.1, 20.0, |d| standing.can_be_saved(&leaning(d)));
            assert!(!standing.saved_by_switching(&leaning(roll + 0.1), 0.05, 8));
            assert!(standing.saved_by_switching(&leaning(roll), 0.05, 1));
        }
    }

    #[test]
    fn the_predictive_law_recovers_nearly_all_that_can_be() {
        // The line of the grid at rest and one through its moving states.
        let bike = BikeParams::default();
        let params = BalanceParams {
            controller: BalanceLawKind::Mpc,
            observer: false,
            ..BalanceParams::default()
        };
        for (mode, least) in [
            (BalancerMode::Flywheel, 0.98),
            (BalancerMode::Balancer, 0.95),
        ] {
            let standing = Standing::new(&bike, mode);
            let law = |d: f64| {
                standing
                    .recovers(&params, 0.005, &leaning(d), 0.0)
                    .expect("the default bike balances")
            };
            let bound = largest(0.1, 20.0, |d| standing.can_be_saved(&leaning(d)));
            // From well inside on, in steps of a tenth.
            let mut reached = 0.9 * bound;
            while law(reached + 0.1) {
                reached += 0.1;
            }
            assert!(
                law(5.0) && reached >= least * bound,
                "{mode:?}: {reached} of {bound}"
            );
        }
    }
}
