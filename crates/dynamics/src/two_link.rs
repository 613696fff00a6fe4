//! The two-link balancing model — Sect. 2, Fig. 3; design note §3.
//!
//! The first link is everything that leans with the frame (body, rear wheel, steering, front
//! wheel); the second is the balancer. Only the joint between them is driven, so the roll
//! axis is unactuated:
//!
//! ```text
//! M(q) q̈ + h(q, q̇) = [T_roll, τ],    q = [roll α, balancer β],    φ = α + β
//!
//! M11 = a0 + a2 + 2 a3 cos β     M12 = a2 + a3 cos β     M22 = a2
//! h   = C(q, q̇) q̇ + ∂V/∂q + (terms of a moving offset)
//! ```
//!
//! Flywheel mode and balancer mode differ only in the offset `d` of the balancer's centre of
//! gravity. While the shift motor moves it, `ḋ` and `d̈` enter as known motions; they are part
//! of the model's [`Offset`] and zero otherwise.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

use crate::bike::BikeState;
use crate::constants::GRAVITY;
use crate::params::{BikeParams, Lumped, Offset};
use crate::plant::{Plant, State};
use crate::sensor::Measurement;

/// Roll and balancer angles with their rates.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TwoLinkState {
    /// Roll `α` of the frame, rad: zero upright, positive to the right.
    pub roll: f64,
    /// Balancer angle `β` relative to the frame, rad, same sense; counts turns.
    pub balancer: f64,
    /// `α̇`, rad/s.
    pub roll_rate: f64,
    /// `β̇`, rad/s.
    pub balancer_rate: f64,
}

impl State for TwoLinkState {
    /// `[α̇, β̇, α̈, β̈]`.
    type Rate = Vector4<f64>;

    fn moved(&self, rate: &Vector4<f64>, dt: f64) -> Self {
        Self {
            roll: self.roll + rate[0] * dt,
            balancer: self.balancer + rate[1] * dt,
            roll_rate: self.roll_rate + rate[2] * dt,
            balancer_rate: self.balancer_rate + rate[3] * dt,
        }
    }
}

/// The roll and balancer part of a bike's state.
impl From<&BikeState> for TwoLinkState {
    fn from(state: &BikeState) -> Self {
        Self {
            roll: state.roll,
            balancer: state.balancer,
            roll_rate: state.roll_rate,
            balancer_rate: state.balancer_rate,
        }
    }
}

/// The roll and balancer part of what the sensors say.
impl From<&Measurement> for TwoLinkState {
    fn from(measured: &Measurement) -> Self {
        Self {
            roll: measured.roll,
            balancer: measured.balancer,
            roll_rate: measured.roll_rate,
            balancer_rate: measured.balancer_rate,
        }
    }
}

/// What acts on the two links from outside the model.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TwoLinkInput {
    /// Torque `τ` of the frame on the balancer, N m, positive along `β`.
    pub balancer_torque: f64,
    /// External moment on the roll axis, N m, positive to the right.
    pub roll_moment: f64,
}

/// `ẋ = A x + B τ` for `x = [α, β, α̇, β̇]` about the upright rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linearisation {
    /// State matrix `A`.
    pub a: Matrix4<f64>,
    /// Input vector `B`, of the balancer torque.
    pub b: Vector4<f64>,
}

/// The model: constants and the equations over them, no state of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoLink {
    lumped: Lumped,
    /// Balancer mass `m2`, kg, and pivot height `l`, m: needed beside the lumped constants
    /// when the offset moves.
    m2: f64,
    l: f64,
    offset: Offset,
}

impl TwoLink {
    /// The model of a bike with its balancer at `offset`: a distance in m, or an [`Offset`]
    /// in motion.
    #[must_use]
    pub fn new(params: &BikeParams, offset: impl Into<Offset>) -> Self {
        let offset = offset.into();
        Self {
            lumped: params.lumped(offset.d),
            m2: params.m2,
            l: params.l,
            offset,
        }
    }

    /// The lumped constants at this offset.
    #[must_use]
    pub fn lumped(&self) -> &Lumped {
        &self.lumped
    }

    /// The offset this model was made for.
    #[must_use]
    pub fn offset(&self) -> &Offset {
        &self.offset
    }

    /// Mass matrix `M(β)`, kg m². Symmetric and positive definite for every angle.
    #[must_use]
    pub fn mass_matrix(&self, balancer: f64) -> Matrix2<f64> {
        let Lumped { a0, a2, a3, .. } = self.lumped;
        let coupling = a3 * balancer.cos();
        let m12 = a2 + coupling;
        Matrix2::new(a0 + a2 + 2.0 * coupling, m12, m12, a2)
    }

    /// The Coriolis matrix `C(q, q̇)`, chosen so that `Ṁ − 2C` is skew-symmetric, N m s.
    #[must_use]
    pub fn coriolis_matrix(&self, state: &TwoLinkState) -> Matrix2<f64> {
        let s = self.lumped.a3 * state.balancer.sin();
        Matrix2::new(
            -s * state.balancer_rate,
            -s * (state.roll_rate + state.balancer_rate),
            s * state.roll_rate,
            0.0,
        )
    }

    /// Coriolis and centrifugal terms `[c1, c2] = C(q, q̇) q̇`, N m.
    #[must_use]
    pub fn coriolis(&self, state: &TwoLinkState) -> Vector2<f64> {
        let s = self.lumped.a3 * state.balancer.sin();
        let (alpha_dot, beta_dot) = (state.roll_rate, state.balancer_rate);
        Vector2::new(
            -s * (2.0 * alpha_dot + beta_dot) * beta_dot,
            s * alpha_dot * alpha_dot,
        )
    }

    /// Gravity terms `∂V/∂q`, N m; the gravity *moment* on the links is their negative.
    #[must_use]
    pub fn gravity(&self, state: &TwoLinkState) -> Vector2<f64> {
        let Lumped { b1, b2, .. } = self.lumped;
        let balancer = -b2 * (state.roll + state.balancer).sin();
        Vector2::new(-b1 * state.roll.sin() + balancer, balancer)
    }

    /// Terms of a moving offset, N m: zero while the shift motor rests.
    #[must_use]
    pub fn shift(&self, state: &TwoLinkState) -> Vector2<f64> {
        let Offset {
            d,
            rate,
            acceleration,
        } = self.offset;
        let (sin, cos) = state.balancer.sin_cos();
        let phi_dot = state.roll_rate + state.balancer_rate;
        let joint = 2.0 * self.m2 * d * rate * phi_dot;
        Vector2::new(
            joint + self.m2 * self.l * (2.0 * cos * rate * phi_dot + sin * acceleration),
            joint,
        )
    }

    /// Bias `h(q, q̇)`, N m: Coriolis, gravity and the terms of a moving offset.
    #[must_use]
    pub fn bias(&self, state: &TwoLinkState) -> Vector2<f64> {
        self.coriolis(state) + self.gravity(state) + self.shift(state)
    }

    /// `[α̈, β̈] = M⁻¹ ([T_roll, τ] − h)`, rad/s².
    #[must_use]
    pub fn accelerations(&self, state: &TwoLinkState, input: &TwoLinkInput) -> Vector2<f64> {
        let m = self.mass_matrix(state.balancer);
        let force = Vector2::new(input.roll_moment, input.balancer_torque) - self.bias(state);
        solve(&m, &force)
    }

    /// Kinetic energy, J, with that of the offset's own motion.
    #[must_use]
    pub fn kinetic_energy(&self, state: &TwoLinkState) -> f64 {
        let rates = Vector2::new(state.roll_rate, state.balancer_rate);
        let links = 0.5 * rates.dot(&(self.mass_matrix(state.balancer) * rates));
        let d_dot = self.offset.rate;
        let shift = self.l * state.balancer.sin() * state.roll_rate + 0.5 * d_dot;
        links + self.m2 * d_dot * shift
    }

    /// Potential energy `b1 cos α + b2 cos φ`, J, zero with both centres at ground height.
    #[must_use]
    pub fn potential_energy(&self, state: &TwoLinkState) -> f64 {
        let Lumped { b1, b2, .. } = self.lumped;
        b1 * state.roll.cos() + b2 * (state.roll + state.balancer).cos()
    }

    /// Kinetic plus potential energy, J. Its rate is the power of `τ`, of the external roll
    /// moment and of the shift motor.
    #[must_use]
    pub fn energy(&self, state: &TwoLinkState) -> f64 {
        self.kinetic_energy(state) + self.potential_energy(state)
    }

    /// Angular momentum `σ` about the line of contact, kg m²/s.
    #[must_use]
    pub fn momentum(&self, state: &TwoLinkState) -> f64 {
        let m = self.mass_matrix(state.balancer);
        m[(0, 0)] * state.roll_rate
            + m[(0, 1)] * state.balancer_rate
            + self.m2 * self.l * state.balancer.sin() * self.offset.rate
    }

    /// `σ̇`: the moment of gravity plus `roll_moment`, N m. The joint torque does not appear.
    #[must_use]
    pub fn momentum_rate(&self, state: &TwoLinkState, roll_moment: f64) -> f64 {
        roll_moment - self.gravity(state)[0]
    }

    /// Force of the shift motor on the balancer along its arm, N, positive outwards, while
    /// the links accelerate at `accelerations = [α̈, β̈]`.
    #[must_use]
    pub fn shift_force(&self, state: &TwoLinkState, accelerations: &Vector2<f64>) -> f64 {
        let (sin, cos) = state.balancer.sin_cos();
        let phi_dot = state.roll_rate + state.balancer_rate;
        self.m2
            * (self.offset.acceleration + self.l * sin * accelerations[0]
                - self.l * cos * state.roll_rate * state.roll_rate
                - self.offset.d * phi_dot * phi_dot
                + GRAVITY * (state.roll + state.balancer).cos())
    }

    /// The linear model about the upright rest at this offset, taken as fixed.
    #[must_use]
    pub fn linearisation(&self) -> Linearisation {
        let Lumped { b1, b2, .. } = self.lumped;
        let m = self.mass_matrix(0.0);
        // M q̈ = K q + [0, τ] with K = −∂²V/∂q² upright.
        let roll = solve(&m, &Vector2::new(b1 + b2, b2));
        let balancer = solve(&m, &Vector2::new(b2, b2));
        let torque = solve(&m, &Vector2::new(0.0, 1.0));
        #[rustfmt::skip]
        let a = Matrix4::new(
            0.0,     0.0,         1.0, 0.0,
            0.0,     0.0,         0.0, 1.0,
            roll[0], balancer[0], 0.0, 0.0,
            roll[1], balancer[1], 0.0, 0.0,
        );
        Linearisation {
            a,
            b: Vector4::new(0.0, 0.0, torque[0], torque[1]),
        }
    }
}

impl Plant for TwoLink {
    type State = TwoLinkState;
    type Input = TwoLinkInput;

    fn rate(&self, _t: f64, state: &TwoLinkState, input: &TwoLinkInput) -> Vector4<f64> {
        let accelerations = self.accelerations(state, input);
        Vector4::new(
            state.roll_rate,
            state.balancer_rate,
            accelerations[0],
            accelerations[1],
        )
    }
}

/// `M⁻¹ f` for a symmetric 2 × 2 matrix, by Cramer's rule.
fn solve(m: &Matrix2<f64>, f: &Vector2<f64>) -> Vector2<f64> {
    let det = m[(0, 0)] * m[(1, 1)] - m[(0, 1)] * m[(0, 1)];
    Vector2::new(
        m[(1, 1)] * f[0] - m[(0, 1)] * f[1],
        m[(0, 0)] * f[1] - m[(0, 1)] * f[0],
    ) / det
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrator::{Integrator, Rk4};
    use proptest::prelude::*;

    fn state(roll: f64, balancer: f64, roll_rate: f64, balancer_rate: f64) -> TwoLinkState {
        TwoLinkState {
            roll,
            balancer,
            roll_rate,
            balancer_rate,
        }
    }

    proptest! {
        #[test]
        fn the_mass_matrix_is_symmetric_and_positive_definite(
            beta in -20.0..20.0, d in 0.0..1.0, m2 in 0.1..50.0, l in 0.1..1.5,
            i2x in 1e-3..5.0,
        ) {
            let params = BikeParams { m2, l, i2x, ..BikeParams::default() };
            let m = TwoLink::new(&params, d).mass_matrix(beta);
            prop_assert_eq!(m[(0, 1)], m[(1, 0)]);
            prop_assert!(m[(0, 0)] > 0.0 && m[(1, 1)] > 0.0);
            prop_assert!(m.determinant() > 0.0);
        }

        #[test]
        fn the_coriolis_matrix_makes_mass_rate_minus_twice_itself_skew(
            roll in -1.0..1.0, beta in -7.0..7.0, roll_rate in -3.0..3.0,
            beta_rate in -20.0..20.0, d in 0.0..0.5,
        ) {
            let model = TwoLink::new(&BikeParams::default(), d);
            let s = state(roll, beta, roll_rate, beta_rate);
            let c = model.coriolis_matrix(&s);
            let a3 = model.lumped().a3;
            let mass_rate = Matrix2::new(-2.0, -1.0, -1.0, 0.0) * (a3 * beta.sin() * beta_rate);
            let n = mass_rate - c * 2.0;
            // Sums of a few products near 100: rounding only.
            prop_assert!((n + n.transpose()).norm() < 1e-12);
            let product = c * Vector2::new(roll_rate, beta_rate);
            prop_assert!((product - model.coriolis(&s)).norm() < 1e-11);
        }
    }

    #[test]
    fn a_free_fall_keeps_its_energy() {
        let model = TwoLink::new(&BikeParams::default(), 0.15);
        let mut s = state(0.1, 0.5, 0.0, -2.0);
        let before = model.energy(&s);
        for i in 0..2000 {
            s = Rk4.step(
                &model,
                f64::from(i) * 1e-3,
                &s,
                &TwoLinkInput::default(),
                1e-3,
            );
        }
        // RK4 at 1 ms over 2 s of a fall with rates near 10 rad/s, relative to 300 J.
        assert!((model.energy(&s) / before - 1.0).abs() < 1e-8);
    }

    #[test]
    fn the_joint_torque_leaves_the_momentum_about_the_contact_line_alone() {
        let model = TwoLink::new(&BikeParams::default(), 0.15);
        let s = state(0.1, -0.4, 0.3, 1.0);
        for torque in [-70.0, 0.0, 70.0] {
            let input = TwoLinkInput {
                balancer_torque: torque,
                roll_moment: 4.0,
            };
            let rate = model.rate(0.0, &s, &input);
            let h = 1e-5;
            let measured = (model.momentum(&s.moved(&rate, h))
                - model.momentum(&s.moved(&rate, -h)))
                / (2.0 * h);
            assert!((measured - model.momentum_rate(&s, 4.0)).abs() < 1e-6);
        }
    }

    #[test]
    fn a_small_disturbance_falls_as_the_linearisation_says() {
        let model = TwoLink::new(&BikeParams::default(), 0.0);
        let linear = model.linearisation();
        let small = 1e-6;
        let s = state(small, -2.0 * small, 0.0, 0.0);
        let input = TwoLinkInput {
            balancer_torque: small,
            roll_moment: 0.0,
        };
        let nonlinear = model.rate(0.0, &s, &input);
        let x = Vector4::new(s.roll, s.balancer, 0.0, 0.0);
        let linearised = linear.a * x + linear.b * small;
        // The neglected terms are cubic.
        assert!((nonlinear - linearised).norm() < 1e-14);
    }

    #[test]
    fn the_balancer_hangs_still_below_its_pivot() {
        let model = TwoLink::new(&BikeParams::default(), 0.15);
        let hanging = state(0.0, std::f64::consts::PI, 0.0, 0.0);
        assert!(model.rate(0.0, &hanging, &TwoLinkInput::default()).norm() < 1e-12);
    }
}
