//! The tank from which the energy regulator draws, and which it fills.
//!
//! The regulator's force `r` on the flywheel does the work `dt r f'` in a step, and the explicit
//! Euler step of all forces `tau` adds `dt^2 tau^T M^-1 tau / 2` on top. The tank pays for both:
//!
//! ```text
//! dt r f' + dt^2 (A + (c + r)^2/m_f)/2 <= content,
//! ```
//!
//! with `c` the coupling's force on the flywheel and `A` the share of the other coordinates. Where
//! the content does not suffice, `r` is cut to the root of this quadratic; an empty tank thus lets the
//! regulator only extract, at least as much as the integrator makes. Augmented energy and content
//! together rise by supplied work alone, to rounding. What comes in beyond the capacity is given up.

/// A finite store of energy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyTank {
    content: f64,
    capacity: f64,
}

/// The step that the tank pays for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Withdrawal {
    /// `f'`, m/s: rate of the flywheel.
    pub rate: f64,
    /// `m_f`, kg.
    pub inertia: f64,
    /// `c`, N: force of the coupling on the flywheel.
    pub force: f64,
    /// `A`, N^2/kg: `tau^T M^-1 tau` of the other coordinates.
    pub others: f64,
    /// Length of the step, s.
    pub dt: f64,
}

impl Withdrawal {
    /// What a step with regulator force `r`, N, costs, J; negative where it fills the tank.
    #[must_use]
    pub fn cost(&self, r: f64) -> f64 {
        let force = self.force + r;
        self.dt * r * self.rate
            + 0.5 * self.dt * self.dt * (self.others + force * force / self.inertia)
    }

    /// The regulator force of least cost, N.
    fn cheapest(&self) -> f64 {
        -self.force - self.rate * self.inertia / self.dt
    }
}

impl EnergyTank {
    /// A tank for `capacity` J with `start` J in it, as far as they go in.
    #[must_use]
    pub fn new(start: f64, capacity: f64) -> Self {
        Self {
            content: start.clamp(0.0, capacity.max(0.0)),
            capacity: capacity.max(0.0),
        }
    }

    /// What is in the tank, J.
    #[must_use]
    pub fn content(&self) -> f64 {
        self.content
    }

    /// Pays for `step` with a regulator force of `wanted` N, or as near to it as the content allows;
    /// returns that force, N, and what the tank had to give up, J.
    pub fn regulate(&mut self, wanted: f64, step: &Withdrawal) -> (f64, f64) {
        let force = if step.cost(wanted) <= self.content {
            wanted
        } else {
            self.affordable(wanted, step)
        };
        let content = self.content - step.cost(force);
        self.content = content.clamp(0.0, self.capacity);
        (force, (content - self.capacity).max(0.0))
    }

    /// Takes `energy` J out, or puts it in where negative, as far as content and capacity go.
    pub fn draw(&mut self, energy: f64) {
        self.content = (self.content - energy).clamp(0.0, self.capacity);
    }

    /// The force nearest to `wanted` whose cost is the whole content.
    fn affordable(&self, wanted: f64, step: &Withdrawal) -> f64 {
        // About its minimum the cost is a parabola; the force is on that side of it where `wanted` is.
        let centre = step.cheapest();
        let room = self.content - step.cost(centre);
        if room <= 0.0 || room.is_nan() {
            return centre;
        }
        let reach = (2.0 * step.inertia * room).sqrt() / step.dt;
        centre + reach.copysign(wanted - centre)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn step() -> Withdrawal {
        Withdrawal {
            rate: 2.0,
            inertia: 25.0,
            force: 3.0,
            others: 4.0,
            dt: 0.005,
        }
    }

    #[test]
    fn pays_what_is_asked_while_there_is_enough() {
        let mut tank = EnergyTank::new(10.0, 20.0);
        let (force, given_up) = tank.regulate(5.0, &step());
        assert_eq!((force, given_up), (5.0, 0.0));
        // 0.05 J of work and 25e-6/2 (4 + 64/25) J of Euler's step.
        assert!((tank.content() - (10.0 - 0.05 - 8.2e-5)).abs() < 1e-12);
    }

    #[test]
    fn an_empty_tank_makes_the_regulator_pay_for_the_integrator() {
        let mut tank = EnergyTank::new(0.0, 20.0);
        let (force, _) = tank.regulate(5.0, &step());
        // Extraction of nearly the Euler excess, 25e-6/2 (4 + 9/25) J in 0.005 s at 2 m/s.
        assert!((force + 0.00545).abs() < 2e-5, "{force}");
        assert!(tank.content() < 1e-15);
    }

    #[test]
    fn gives_up_what_does_not_go_in() {
        let mut tank = EnergyTank::new(20.0, 20.0);
        let (_, given_up) = tank.regulate(-100.0, &step());
        assert_eq!(tank.content(), 20.0);
        assert!((given_up + step().cost(-100.0)).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn never_pays_more_than_it_has_unless_nothing_is_cheaper(
            content in 0.0f64..2.0, wanted in -200.0f64..200.0, rate in -3.0f64..3.0,
            force in -50.0f64..50.0, others in 0.0f64..100.0,
        ) {
            let step = Withdrawal { rate, force, others, ..step() };
            let mut tank = EnergyTank::new(content, 5.0);
            let (r, given_up) = tank.regulate(wanted, &step);
            let books = tank.content() + given_up + step.cost(r) - content;
            // A flywheel that stands cannot pay for the integrator: at most its excess is owed.
            let owed = (step.cost(step.cheapest()) - content).max(0.0);
            prop_assert!(books.abs() <= owed + 1e-12, "{books}");
            prop_assert!(r == wanted || tank.content() <= 1e-9);
        }
    }
}
