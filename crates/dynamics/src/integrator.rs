//! Fixed-step integrators: classical Runge–Kutta, and explicit Euler to compare it with.

use crate::plant::{Plant, State};

/// Advances a plant by one step of fixed length.
pub trait Integrator {
    /// The state `dt` seconds after `state`, with `input` held over the step.
    fn step<P: Plant>(
        &self,
        plant: &P,
        t: f64,
        state: &P::State,
        input: &P::Input,
        dt: f64,
    ) -> P::State;
}

/// The classical fourth-order Runge–Kutta method (Kutta 1901).
///
/// ```text
/// 0   |
/// 1/2 | 1/2
/// 1/2 | 0    1/2
/// 1   | 0    0    1
/// ----+--------------------
///     | 1/6  1/3  1/3  1/6
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Rk4;

impl Integrator for Rk4 {
    fn step<P: Plant>(
        &self,
        plant: &P,
        t: f64,
        state: &P::State,
        input: &P::Input,
        dt: f64,
    ) -> P::State {
        let half = 0.5 * dt;
        let k1 = plant.rate(t, state, input);
        let k2 = plant.rate(t + half, &state.moved(&k1, half), input);
        let k3 = plant.rate(t + half, &state.moved(&k2, half), input);
        let k4 = plant.rate(t + dt, &state.moved(&k3, dt), input);
        let mean = (k1 + (k2 + k3) * 2.0 + k4) * (1.0 / 6.0);
        state.moved(&mean, dt)
    }
}

/// The first-order explicit Euler method: gains energy on any oscillation, and is here so that
/// tests and studies can show what Runge–Kutta buys.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ExplicitEuler;

impl Integrator for ExplicitEuler {
    fn step<P: Plant>(
        &self,
        plant: &P,
        t: f64,
        state: &P::State,
        input: &P::Input,
        dt: f64,
    ) -> P::State {
        state.moved(&plant.rate(t, state, input), dt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    /// A driven harmonic oscillator `ẍ = −ω² x + u cos(t)` with a known solution.
    struct Oscillator {
        omega: f64,
    }

    impl State for Vector2<f64> {
        type Rate = Vector2<f64>;
        fn moved(&self, rate: &Vector2<f64>, dt: f64) -> Self {
            self + rate * dt
        }
    }

    impl Plant for Oscillator {
        type State = Vector2<f64>;
        type Input = f64;
        fn rate(&self, t: f64, x: &Vector2<f64>, drive: &f64) -> Vector2<f64> {
            Vector2::new(x.y, -self.omega * self.omega * x.x + drive * t.cos())
        }
    }

    const DRIVE: f64 = 0.7;

    /// From rest at x = 1: `x = (1 − c) cos ωt + c cos t`, `c = u/(ω² − 1)`.
    fn exact(omega: f64, t: f64) -> Vector2<f64> {
        let c = DRIVE / (omega * omega - 1.0);
        Vector2::new(
            (1.0 - c) * (omega * t).cos() + c * t.cos(),
            -(1.0 - c) * omega * (omega * t).sin() - c * t.sin(),
        )
    }

    fn error_after_two_seconds(method: &impl Integrator, steps: u32) -> f64 {
        let plant = Oscillator { omega: 3.0 };
        let dt = 2.0 / f64::from(steps);
        let mut x = Vector2::new(1.0, 0.0);
        for i in 0..steps {
            x = method.step(&plant, f64::from(i) * dt, &x, &DRIVE, dt);
        }
        (x - exact(3.0, 2.0)).norm()
    }

    fn measured_order(method: &impl Integrator, steps: u32) -> f64 {
        (error_after_two_seconds(method, steps) / error_after_two_seconds(method, 2 * steps)).log2()
    }

    #[test]
    fn runge_kutta_is_of_fourth_order() {
        let order = measured_order(&Rk4, 100);
        assert!((3.8..4.3).contains(&order), "measured order {order}");
    }

    #[test]
    fn explicit_euler_is_of_first_order() {
        let order = measured_order(&ExplicitEuler, 20_000);
        assert!((0.95..1.05).contains(&order), "measured order {order}");
    }

    #[test]
    fn runge_kutta_reproduces_a_cubic_in_time_exactly() {
        struct Quadratic;
        impl Plant for Quadratic {
            type State = Vector2<f64>;
            type Input = ();
            fn rate(&self, t: f64, _: &Vector2<f64>, (): &()) -> Vector2<f64> {
                Vector2::new(3.0 * t * t, 1.0)
            }
        }
        let x = Rk4.step(&Quadratic, 1.0, &Vector2::zeros(), &(), 2.0);
        // ∫₁³ 3t² dt = 26; Simpson's rule, which RK4 reduces to here, is exact on cubics.
        assert!((x - Vector2::new(26.0, 2.0)).norm() < 1e-13);
    }
}
