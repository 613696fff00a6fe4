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
//! must be, and the middle term, known before the step, is the error of the integrator.
//!
//! With an energy tank of content `T` the books are stricter: the tank pays for regulator and
//! integrator, so `k + T` rises by the supplied work, less what a full tank gives up.
//!
//! A path taken over on the way may be ridden faster than any before. Its field then has more energy, which is
//! granted with it: at most once as much as there is between the first path's field and that of the highest speed.

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
    /// What the explicit Euler step added, J; the energy tank pays for it if there is one.
    pub error_bound: f64,
    /// Content of the energy tank now, J; zero without one.
    pub tank: f64,
    /// The tank's content now less that one tick ago, J.
    pub tank_rise: f64,
    /// What the full tank gave up during the tick, J.
    pub given_up: f64,
    /// Whether a tank pays for regulator and integrator.
    pub strict: bool,
    /// What a new path brought along at the beginning of the tick, J: its field has more energy than the one before.
    pub granted: f64,
}

impl AugmentedEnergy {
    /// Least violation that counts, J: above rounding, which is near 1e-13 J at a few hundred joules.
    pub const TOLERANCE: f64 = 1e-9;

    /// What the books of a tick of `dt` seconds miss, J: zero but for rounding, whatever the bike did.
    #[must_use]
    pub fn residual(&self, dt: f64) -> f64 {
        let supplied = dt * self.supplied_power + self.granted;
        if self.strict {
            self.rise + self.tank_rise + self.given_up - supplied
        } else {
            self.rise - supplied - dt * self.regulator_power - self.error_bound
        }
    }

    /// By how far the books of a tick of `dt` seconds are off beyond rounding, J; negative when they are not.
    /// Energy that vanishes without a trace is as wrong as energy from nowhere.
    #[must_use]
    pub fn unexplained(&self, dt: f64) -> f64 {
        self.residual(dt).abs() - Self::TOLERANCE
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
    granted: f64,
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
        let granted = std::mem::take(&mut self.granted);
        self.closed = match self.open {
            None => AugmentedEnergy {
                stored: step.stored,
                tank: step.tank.unwrap_or(0.0),
                strict: step.tank.is_some(),
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
                    tank: step.tank.unwrap_or(0.0),
                    tank_rise: step.tank.unwrap_or(0.0) - before.tank.unwrap_or(0.0),
                    given_up: before.given_up,
                    strict: step.tank.is_some(),
                    granted,
                }
            }
        };
        self.open = Some((*step, point_rate));
        self.closed
    }

    /// Enters `energy` J that a new path brought along.
    pub fn grant(&mut self, energy: f64) {
        self.granted += energy;
    }

    /// Stops the augmented system: from now on nothing rises and nothing is supplied.
    pub fn rest(&mut self) -> AugmentedEnergy {
        self.open = None;
        self.closed = AugmentedEnergy {
            stored: self.closed.stored,
            tank: self.closed.tank,
            strict: self.closed.strict,
            ..AugmentedEnergy::default()
        };
        self.closed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::velocity_field::FieldValue;
    use nalgebra::Vector4;

    fn step(stored: f64, force: Vector2, regulator_power: f64, euler_excess: f64) -> PvfcStep {
        let field = FieldValue {
            velocity: Vector4::zeros(),
            rate: Vector4::zeros(),
            error: Vector2::zeros(),
        };
        PvfcStep {
            acceleration: force / 50.0,
            field,
            force,
            stored,
            regulator_power,
            euler_excess,
            tank: None,
            given_up: 0.0,
        }
    }

    #[test]
    fn a_push_is_supplied_work_and_a_gift_is_a_violation() {
        let (mass, dt) = (50.0, 0.005);
        let mut account = EnergyAccount::default();
        let (slow, fast) = (Vector2::new(1.0, 0.0), Vector2::new(1.1, 0.0));
        account.enter(&step(25.0, Vector2::zeros(), 0.0, 0.0), slow, mass, dt);
        // From 1.0 to 1.1 m/s without a force of ours: 5.25 J from outside.
        let pushed = account.enter(&step(30.25, Vector2::zeros(), 0.0, 0.0), fast, mass, dt);
        assert!((pushed.supplied_power * dt - 5.25).abs() < 1e-12);
        assert!(!pushed.is_violated(dt));
        // The same energy again, but the point has not moved any faster: software made it up.
        let gift = account.enter(&step(30.26, Vector2::zeros(), 0.0, 0.0), fast, mass, dt);
        assert!(gift.is_violated(dt) && (gift.unexplained(dt) - 0.01).abs() < 1e-8);
    }

    #[test]
    fn with_a_tank_even_the_regulator_must_say_where_it_has_it_from() {
        let (mass, dt) = (50.0, 0.005);
        let rate = Vector2::new(1.0, 0.0);
        let filled = |stored: f64, tank: f64| PvfcStep {
            tank: Some(tank),
            ..step(stored, Vector2::zeros(), 2.0, 0.0)
        };
        let mut account = EnergyAccount::default();
        account.enter(&filled(25.0, 5.0), rate, mass, dt);
        let paid = account.enter(&filled(25.01, 4.99), rate, mass, dt);
        assert!(paid.residual(dt).abs() < 1e-12 && !paid.is_violated(dt));
        let unpaid = account.enter(&filled(25.02, 4.99), rate, mass, dt);
        assert!(unpaid.is_violated(dt) && (unpaid.residual(dt) - 0.01).abs() < 1e-12);
    }

    #[test]
    fn what_a_new_path_brings_is_in_the_books_once() {
        let (mass, dt) = (50.0, 0.005);
        let rate = Vector2::new(1.0, 0.0);
        let mut account = EnergyAccount::default();
        account.enter(&step(25.0, Vector2::zeros(), 0.0, 0.0), rate, mass, dt);
        account.grant(7.0);
        let raised = account.enter(&step(32.0, Vector2::zeros(), 0.0, 0.0), rate, mass, dt);
        assert!(!raised.is_violated(dt) && raised.granted == 7.0);
        let after = account.enter(&step(32.0, Vector2::zeros(), 0.0, 0.0), rate, mass, dt);
        assert!(!after.is_violated(dt) && after.granted == 0.0);
    }

    #[test]
    fn nothing_rises_at_rest() {
        let mut account = EnergyAccount::default();
        account.enter(
            &step(20.0, Vector2::zeros(), 1.0, 0.0),
            Vector2::zeros(),
            50.0,
            0.005,
        );
        let rest = account.rest();
        assert_eq!(
            (rest.rise, rest.supplied_power, rest.stored),
            (0.0, 0.0, 20.0)
        );
        assert!(!rest.is_violated(0.005));
    }
}
