//! The simplified 3D bike — §5.1.
//!
//! Rigid bodies, thin wheels that roll without side slip, a vertical steering axis through
//! the front contact, flat ground; fork and wheels are lumped into link 1, and the spin
//! momentum of the wheels is neglected (2 to 3 % of the centrifugal term). Steering is a rate
//! input. With `ω = κ v`, `κ = tan ψ / w`, the Lagrange–d'Alembert equations reduce to three
//! rows for `(v̇, α̈, β̈)`:
//!
//! ```text
//! ⎡ m − 2κ SY + κ² J   −κ A_a   −κ A_b ⎤ ⎡ v̇ ⎤   ⎡ rhs_v ⎤
//! ⎢ −κ A_a              M11      M12   ⎥ ⎢ α̈ ⎥ = ⎢ rhs_a ⎥
//! ⎣ −κ A_b              M12      M22   ⎦ ⎣ β̈ ⎦   ⎣ rhs_b ⎦
//! ```
//!
//! The lower right block is [`TwoLink`]: a turn adds a roll moment and a joint moment to the
//! two-link model and changes nothing else.

use bikebot_geometry::{Pose2, angle};
use nalgebra::{Matrix3, SVector, Vector3};

use crate::inertia::Moments;
use crate::params::{BikeParams, Offset};
use crate::plant::{Plant, State};
use crate::two_link::{TwoLink, TwoLinkState};

/// The state of the bike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BikeState {
    /// Rear contact point (m) and heading `θ` (rad, counter-clockwise from x).
    pub pose: Pose2,
    /// Ground-projected steering angle `ψ`, rad, positive to the left.
    pub steer: f64,
    /// Roll `α`, rad, positive to the right.
    pub roll: f64,
    /// Balancer angle `β` relative to the frame, rad, same sense as roll; counts turns.
    pub balancer: f64,
    /// Speed `v` of the rear contact along the heading, m/s.
    pub speed: f64,
    /// `α̇`, rad/s.
    pub roll_rate: f64,
    /// `β̇`, rad/s.
    pub balancer_rate: f64,
}

impl BikeState {
    /// Upright, steering straight, rolling at `speed` (m/s).
    #[must_use]
    pub fn upright(pose: Pose2, speed: f64) -> Self {
        Self {
            pose,
            steer: 0.0,
            roll: 0.0,
            balancer: 0.0,
            speed,
            roll_rate: 0.0,
            balancer_rate: 0.0,
        }
    }

    /// Whether every number of the state is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.pose.is_finite()
            && [
                self.steer,
                self.roll,
                self.balancer,
                self.speed,
                self.roll_rate,
                self.balancer_rate,
            ]
            .iter()
            .all(|value| value.is_finite())
    }
}

impl State for BikeState {
    /// `[ẋ, ẏ, θ̇, ψ̇, α̇, β̇, v̇, α̈, β̈]`.
    type Rate = SVector<f64, 9>;

    fn moved(&self, rate: &SVector<f64, 9>, dt: f64) -> Self {
        Self {
            pose: Pose2::new(
                self.pose.position.x + rate[0] * dt,
                self.pose.position.y + rate[1] * dt,
                angle::wrap(self.pose.heading + rate[2] * dt),
            ),
            steer: self.steer + rate[3] * dt,
            roll: self.roll + rate[4] * dt,
            balancer: self.balancer + rate[5] * dt,
            speed: self.speed + rate[6] * dt,
            roll_rate: self.roll_rate + rate[7] * dt,
            balancer_rate: self.balancer_rate + rate[8] * dt,
        }
    }
}

/// What acts on the bike.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BikeInput {
    /// Force `F` of the ground on the rear tyre along the heading, N: wheel torque over wheel
    /// radius.
    pub drive_force: f64,
    /// Steering rate `ψ̇`, rad/s.
    pub steer_rate: f64,
    /// Torque `τ` of the frame on the balancer, N m.
    pub balancer_torque: f64,
    /// External moment on the roll axis, N m, positive to the right.
    pub roll_moment: f64,
    /// External force along the heading at the common centre of gravity, N: the pull of a
    /// slope, negative uphill.
    pub slope_force: f64,
    /// The balancer's offset and its motion.
    pub offset: Offset,
}

/// Accelerations of the bike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BikeAcceleration {
    /// `v̇`, m/s².
    pub speed: f64,
    /// `ω̇ = θ̈`, rad/s².
    pub yaw: f64,
    /// `α̈`, rad/s².
    pub roll: f64,
    /// `β̈`, rad/s².
    pub balancer: f64,
}

/// The model: parameters and the equations over them, no state of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bike {
    /// The parameters the equations are evaluated with.
    pub params: BikeParams,
}

impl Bike {
    /// The bike with these parameters.
    #[must_use]
    pub fn new(params: BikeParams) -> Self {
        Self { params }
    }

    /// Curvature `κ = tan ψ / w` of the rear contact's path, 1/m.
    #[must_use]
    pub fn curvature(&self, steer: f64) -> f64 {
        steer.tan() / self.params.wheelbase
    }

    /// Yaw rate `ω = κ v`, rad/s.
    #[must_use]
    pub fn yaw_rate(&self, state: &BikeState) -> f64 {
        self.curvature(state.steer) * state.speed
    }

    /// The accelerations of §5.1; not finite when the state is not.
    #[must_use]
    pub fn accelerations(&self, state: &BikeState, input: &BikeInput) -> BikeAcceleration {
        let p = &self.params;
        let q = Moments::new(p, state, &input.offset);
        let links = TwoLink::new(p, input.offset);
        let roll = TwoLinkState::from(state);
        let inertia = links.mass_matrix(state.balancer);
        let bias = links.bias(&roll);
        let Offset {
            d,
            rate: d_dot,
            acceleration: d_ddot,
        } = input.offset;
        let (v, alpha_dot, beta_dot) = (state.speed, state.roll_rate, state.balancer_rate);

        let kappa = self.curvature(state.steer);
        let omega = kappa * v;
        // ω̇ = κ v̇ + κ̇ v; the second part is known beforehand.
        let cos_steer = state.steer.cos();
        let drift = v * input.steer_rate / (p.wheelbase * cos_steer * cos_steer);

        let yaw_momentum_drift = -v * q.sy_rate + drift * q.j + omega * q.j_rate
            - q.a_a_rate * alpha_dot
            - q.a_b_rate * beta_dot
            - q.a_d_rate * d_dot
            - q.a_d * d_ddot;
        let m = p.mass();
        let rhs_v = input.drive_force
            + input.slope_force * (1.0 - kappa * q.sy / m)
            + drift * q.sy
            + omega * q.sy_rate
            - kappa * yaw_momentum_drift;
        let rhs_a =
            q.a_a * drift + v * omega * q.hz + 0.5 * omega * omega * q.j_a + input.roll_moment
                - bias[0];
        let rhs_b = q.a_b * drift
            + v * omega * p.m2 * d * q.cos_phi
            + 0.5 * omega * omega * q.j_b
            + input.balancer_torque
            - bias[1];

        #[rustfmt::skip]
        let mass = Matrix3::new(
            m - 2.0 * kappa * q.sy + kappa * kappa * q.j, -kappa * q.a_a, -kappa * q.a_b,
            -kappa * q.a_a, inertia[(0, 0)], inertia[(0, 1)],
            -kappa * q.a_b, inertia[(1, 0)], inertia[(1, 1)],
        );
        let rates = solve(&mass, &Vector3::new(rhs_v, rhs_a, rhs_b));
        BikeAcceleration {
            speed: rates[0],
            yaw: kappa * rates[0] + drift,
            roll: rates[1],
            balancer: rates[2],
        }
    }

    /// Kinetic energy, J, with that of the offset's own motion.
    #[must_use]
    pub fn kinetic_energy(&self, state: &BikeState, offset: &Offset) -> f64 {
        let q = Moments::new(&self.params, state, offset);
        let (v, omega) = (state.speed, self.yaw_rate(state));
        0.5 * self.params.mass() * v * v - v * omega * q.sy + 0.5 * omega * omega * q.j
            - omega * (q.a_a * state.roll_rate + q.a_b * state.balancer_rate + q.a_d * offset.rate)
            + TwoLink::new(&self.params, *offset).kinetic_energy(&state.into())
    }

    /// Potential energy, J, zero with both centres of gravity at ground height.
    #[must_use]
    pub fn potential_energy(&self, state: &BikeState, offset: &Offset) -> f64 {
        TwoLink::new(&self.params, *offset).potential_energy(&state.into())
    }

    /// Kinetic plus potential energy, J. With the offset at rest and no slope its rate is
    /// `F v + τ β̇ + T_roll α̇`: steering does no work.
    #[must_use]
    pub fn energy(&self, state: &BikeState, offset: &Offset) -> f64 {
        self.kinetic_energy(state, offset) + self.potential_energy(state, offset)
    }
}

impl Plant for Bike {
    type State = BikeState;
    type Input = BikeInput;

    fn rate(&self, _t: f64, state: &BikeState, input: &BikeInput) -> SVector<f64, 9> {
        let (sin, cos) = state.pose.heading.sin_cos();
        let a = self.accelerations(state, input);
        SVector::from([
            state.speed * cos,
            state.speed * sin,
            self.yaw_rate(state),
            input.steer_rate,
            state.roll_rate,
            state.balancer_rate,
            a.speed,
            a.roll,
            a.balancer,
        ])
    }
}

/// `M⁻¹ f` for a symmetric positive definite 3 × 3 matrix, by elimination without pivoting,
/// which is stable for such matrices.
fn solve(m: &Matrix3<f64>, f: &Vector3<f64>) -> Vector3<f64> {
    let l10 = m[(1, 0)] / m[(0, 0)];
    let l20 = m[(2, 0)] / m[(0, 0)];
    let d1 = m[(1, 1)] - l10 * m[(0, 1)];
    let u12 = m[(1, 2)] - l10 * m[(0, 2)];
    let l21 = u12 / d1;
    let d2 = m[(2, 2)] - l20 * m[(0, 2)] - l21 * u12;
    let f1 = f[1] - l10 * f[0];
    let x2 = (f[2] - l20 * f[0] - l21 * f1) / d2;
    let x1 = (f1 - u12 * x2) / d1;
    let x0 = (f[0] - m[(0, 1)] * x1 - m[(0, 2)] * x2) / m[(0, 0)];
    Vector3::new(x0, x1, x2)
}
