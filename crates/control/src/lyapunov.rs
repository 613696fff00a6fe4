//! The energy account of the augmented system: the quantity that passivity is about.
//!
//! The coupling of [`crate::pvfc`] does no work, so over one tick the energy
//! `k = q'^T M q'/2` can only rise by what comes from outside. The tick is an explicit Euler
//! step of the forces `tau`, which is exact to read off:
//!
//! ```text
//! k(n+1) - k(n) = dt tau . q'(n) + dt^2 tau^T M^-1 tau / 2 + J . (q'_ideal + J/(2 m_p)),
//! ```
//!
//! with `J = m_p (P'(n+1) - P'(n)) - dt tau_P` the impulse by which the real bike departs from
//! the ideal point: actuator limits and lag, slopes, pushes, tyre forces. The last term is the
//! supplied work, `dt tau . q'(n)` is the regulator's work alone if the coupling is skew as it
//! must be, and the middle term, known before the step, is the error bound of the integrator.

use bikebot_geometry::Vector2;

use crate::pvfc::PvfcStep;

/// The account of the tick that has just ended.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AugmentedEnergy {
    /// `k` now, J.
    pub stored: f64,
    /// `k` now less `k` one tick ago, J.
    pub rise: f64,
    /// Mean power that the surroundings supplied during the tick, W.
    pub supplied_power: f64,
    /// Mean power of the energy regulator during the tick, W.
    pub regulator_power: f64,
    /// What the explicit Euler step may have added, J.
    pub error_bound: f64,
}

impl AugmentedEnergy {
    /// Least violation that counts, J: above rounding, which is near 1e-13 J at a few hundred joules.
    pub const TOLERANCE: f64 = 1e-9;

    /// By how much the stored energy rose beyond what was accounted for in a tick of `dt` seconds, J;
    /// negative when it did not.
    #[must_use]
    pub fn unexplained(&self, dt: f64) -> f64 {
        self.rise
            - dt * (self.supplied_power + self.regulator_power)
            - self.error_bound
            - Self::TOLERANCE
    }

    /// Whether passivity was violated in a tick of `dt` seconds.
    #[must_use]
    pub fn is_violated(&self, dt: f64) -> bool {
        self.unexplained(dt) > 0.0
    }
}

/// Keeps the books from tick to tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EnergyAccount {
    open: Option<(PvfcStep, Vector2)>,
    closed: AugmentedEnergy,
}

impl EnergyAccount {
    /// Closes the tick before and opens the next: `step` has just been taken with the point moving
    /// at `point_rate`; `point_mass` in kg, `dt` in s.
    pub fn enter(
        &mut self,
        step: &PvfcStep,
        point_rate: Vector2,
        point_mass: f64,
        dt: f64,
    ) -> AugmentedEnergy {
        self.closed = match self.open {
            None => AugmentedEnergy {
                stored: step.stored,
                ..AugmentedEnergy::default()
            },
            Some((before, rate_before)) => {
                let ideal = rate_before + before.force * (dt / point_mass);
                let impulse = (point_rate - ideal) * point_mass;
                let work = impulse.dot(&((ideal + point_rate) * 0.5));
                AugmentedEnergy {
                    stored: step.stored,
                    rise: step.stored - before.stored,
                    supplied_power: work / dt,
                    regulator_power: before.regulator_power,
                    error_bound: before.euler_excess,
                }
            }
        };
        self.open = Some((*step, point_rate));
        self.closed
    }

    /// Stops the augmented system: from now on nothing rises and nothing is supplied.
    pub fn rest(&mut self) -> AugmentedEnergy {
        self.open = None;
        self.closed = AugmentedEnergy {
            stored: self.closed.stored,
            ..AugmentedEnergy::default()
        };
        self.closed
    }
}
