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
    /// What pushes the frame from outside.
    pub push: Push,
    /// The balancer's offset and its motion.
    pub offset: Offset,
}

/// Forces from outside on points of the frame, level and in the heading frame, and the arms they act at.
///
/// Forces at several points add up: every field is a sum over them. A force at height `h` up the frame acts
/// at `(x, −h sin α, h cos α)` of the heading frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Push {
    /// Force along the heading, N.
    pub forward: f64,
    /// Force to the left of the heading, N.
    pub left: f64,
    /// Force along the heading times its height up the frame, N m.
    pub forward_height: f64,
    /// Force to the left times its height up the frame, N m.
    pub left_height: f64,
    /// Force to the left times its distance ahead of the rear contact, N m.
    pub left_ahead: f64,
}

impl Push {
    /// A force `forward` along the heading and `left` to its left (N) at a point of the frame `ahead` of the
    /// rear contact and `height` up the frame (m).
    #[must_use]
    pub fn at(forward: f64, left: f64, ahead: f64, height: f64) -> Self {
        Self {
            forward,
            left,
            forward_height: forward * height,
            left_height: left * height,
            left_ahead: left * ahead,
        }
    }

    /// Moment about the heading through the rear contact, N m, positive to the right, at roll `α` (rad).
    #[must_use]
    pub fn roll_moment(&self, roll: f64) -> f64 {
        -self.left_height * roll.cos()
    }

    /// Moment about the lateral axis through the rear contact, N m: what takes load off the front wheel is
    /// negative.
    #[must_use]
    pub fn pitch_moment(&self, roll: f64) -> f64 {
        self.forward_height * roll.cos()
    }

    /// Moment about the vertical through the rear contact, N m, positive to the left.
    #[must_use]
    pub fn yaw_moment(&self, roll: f64) -> f64 {
        self.left_ahead + self.forward_height * roll.sin()
    }
}

impl std::ops::Add for Push {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            forward: self.forward + other.forward,
            left: self.left + other.left,
            forward_height: self.forward_height + other.forward_height,
            left_height: self.left_height + other.left_height,
            left_ahead: self.left_ahead + other.left_ahead,
        }
    }
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
            + input.push.forward
            + kappa * input.push.yaw_moment(state.roll)
            + drift * q.sy
            + omega * q.sy_rate
            - kappa * yaw_momentum_drift;
        let rhs_a = q.a_a * drift
            + v * omega * q.hz
            + 0.5 * omega * omega * q.j_a
            + input.roll_moment
            + input.push.roll_moment(state.roll)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrator::{Integrator, Rk4};
    use crate::two_link::TwoLinkInput;
    use approx::assert_relative_eq;

    fn bike() -> Bike {
        Bike::new(BikeParams::default())
    }

    fn rolling(speed: f64) -> BikeState {
        BikeState::upright(Pose2::new(0.0, 0.0, 0.0), speed)
    }

    /// The roll at which a steady turn needs no roll acceleration, by bisection.
    fn steady_lean(bike: &Bike, speed: f64, curvature: f64) -> f64 {
        let (mut low, mut high) = (-1.0, 1.0);
        for _ in 0..60 {
            let roll = 0.5 * (low + high);
            let state = BikeState {
                steer: (curvature * bike.params.wheelbase).atan(),
                roll,
                ..rolling(speed)
            };
            // Leaning further to the right than balanced falls to the right.
            if bike.accelerations(&state, &BikeInput::default()).roll > 0.0 {
                high = roll;
            } else {
                low = roll;
            }
        }
        0.5 * (low + high)
    }

    #[test]
    fn a_steady_left_turn_leans_left_by_the_full_moment_balance() {
        // §5.2: 1.5 m/s on a radius of 3 m, against −atan(v ω/g) of a point mass.
        let lean = steady_lean(&bike(), 1.5, 1.0 / 3.0).to_degrees();
        assert!((lean + 4.302).abs() < 5e-4, "{lean}");
        let point_mass = -(1.5_f64 * 0.5 / 9.81).atan().to_degrees();
        assert!((point_mass + 4.372).abs() < 5e-4);
        let right = steady_lean(&bike(), 1.5, -1.0 / 3.0).to_degrees();
        assert!((right + lean).abs() < 1e-9);
    }

    #[test]
    fn straight_ahead_the_bike_rolls_as_the_two_link_model() {
        let bike = bike();
        let state = BikeState {
            roll: 0.1,
            balancer: -0.7,
            roll_rate: 0.3,
            balancer_rate: 2.0,
            ..rolling(1.3)
        };
        let input = BikeInput {
            drive_force: 25.0,
            balancer_torque: -11.0,
            roll_moment: 3.0,
            offset: Offset {
                d: 0.1,
                rate: 0.05,
                acceleration: -0.2,
            },
            ..BikeInput::default()
        };
        let a = bike.accelerations(&state, &input);
        let links = TwoLink::new(&bike.params, input.offset).accelerations(
            &(&state).into(),
            &TwoLinkInput {
                balancer_torque: -11.0,
                roll_moment: 3.0,
            },
        );
        assert_relative_eq!(a.roll, links[0], max_relative = 1e-13);
        assert_relative_eq!(a.balancer, links[1], max_relative = 1e-13);
        assert_relative_eq!(a.speed, 25.0 / 50.0, max_relative = 1e-15);
    }

    #[test]
    fn an_upright_bike_rolls_under_steering_as_the_lean_coefficients_say() {
        // §5.2 with the balancer locked: M11 α̈ − b1 α = (A v/w) ψ̇ + (H v²/w) ψ.
        let bike = bike();
        let (v, steer, steer_rate) = (1.5, 1e-5, 1e-5);
        let state = BikeState {
            steer,
            ..rolling(v)
        };
        let input = BikeInput {
            steer_rate,
            ..BikeInput::default()
        };
        let a = bike.accelerations(&state, &input);
        let m = TwoLink::new(&bike.params, 0.0).mass_matrix(0.0);
        let turn = bike.params.lean_coefficients(0.0);
        let w = bike.params.wheelbase;
        let moment = turn.yaw * v * steer_rate / w + turn.centrifugal * v * v * steer / w;
        // Quadratic terms of the small angles remain.
        assert_relative_eq!(
            m[(0, 0)] * a.roll + m[(0, 1)] * a.balancer,
            moment,
            max_relative = 1e-8
        );
    }

    #[test]
    fn a_slope_pulls_like_a_force_at_the_centre_of_gravity() {
        let bike = bike();
        let pull = BikeInput {
            slope_force: -24.5,
            ..BikeInput::default()
        };
        let a = bike.accelerations(&rolling(1.0), &pull);
        assert_relative_eq!(a.speed, -24.5 / 50.0, max_relative = 1e-15);
        // Leaning right in a left turn, the centre of gravity travels the larger circle.
        let state = BikeState {
            steer: 0.5,
            roll: 0.2,
            ..rolling(1.0)
        };
        let drive = BikeInput {
            drive_force: -24.5,
            ..BikeInput::default()
        };
        let by_slope = bike.accelerations(&state, &pull).speed;
        let by_wheel = bike.accelerations(&state, &drive).speed;
        assert!(by_slope < by_wheel);
    }

    #[test]
    fn a_push_works_on_the_bike_what_its_point_of_attack_travels() {
        // Power balance: d/dt (T + V) = F · velocity of the point, for any motion.
        let bike = bike();
        let offset = Offset::fixed(0.15);
        let (ahead, height) = (0.4, 0.7);
        let mut state = BikeState {
            steer: 0.4,
            roll: 0.2,
            balancer: 0.5,
            roll_rate: -0.4,
            balancer_rate: 1.0,
            ..rolling(1.3)
        };
        let (forward, left) = (30.0, -80.0);
        let input = BikeInput {
            push: Push::at(forward, left, ahead, height),
            offset,
            ..BikeInput::default()
        };
        let power = |s: &BikeState| {
            let omega = bike.yaw_rate(s);
            let (sin, cos) = s.roll.sin_cos();
            forward * (s.speed + omega * height * sin)
                + left * (omega * ahead - height * cos * s.roll_rate)
        };
        let before = bike.energy(&state, &offset);
        let (dt, steps) = (1e-4, 1000);
        let mut work = 0.0;
        for i in 0..steps {
            let from = power(&state);
            state = Rk4.step(&bike, f64::from(i) * dt, &state, &input, dt);
            work += 0.5 * dt * (from + power(&state));
        }
        // The trapezoidal rule over 0.1 s of a smooth power leaves dt² P''/12 ~ 1e-8 of it.
        assert_relative_eq!(
            bike.energy(&state, &offset) - before,
            work,
            max_relative = 1e-6
        );
    }

    #[test]
    fn pushes_at_several_points_add_up() {
        let (one, two) = (
            Push::at(10.0, -20.0, 0.3, 0.6),
            Push::at(0.0, 5.0, 0.9, 1.1),
        );
        let both = one + two;
        for roll in [-0.3, 0.0, 0.4] {
            assert_relative_eq!(
                both.roll_moment(roll),
                one.roll_moment(roll) + two.roll_moment(roll)
            );
        }
        // 20 N to the right at 0.6 m rolls to the right.
        assert_relative_eq!(one.roll_moment(0.0), 12.0);
    }

    #[test]
    fn the_heading_wraps_while_the_balancer_counts_its_turns() {
        let bike = bike();
        let mut state = BikeState {
            pose: Pose2::new(0.0, 0.0, 3.1),
            steer: 0.3,
            balancer_rate: 10.0,
            ..rolling(1.5)
        };
        // Held upright, so that only heading and balancer turn.
        for i in 0..800 {
            state = Rk4.step(
                &bike,
                f64::from(i) * 2.5e-3,
                &state,
                &BikeInput::default(),
                2.5e-3,
            );
            state.roll = 0.0;
            state.roll_rate = 0.0;
        }
        assert!(state.pose.heading.abs() <= std::f64::consts::PI);
        assert!(
            state.pose.heading < 0.0,
            "turned left through west: {}",
            state.pose.heading
        );
        assert!(state.balancer > std::f64::consts::TAU);
    }

    #[test]
    fn an_open_loop_run_gains_exactly_the_work_done() {
        let bike = bike();
        let offset = Offset::fixed(0.15);
        let mut state = BikeState {
            roll: 0.02,
            balancer: 0.1,
            steer: 0.05,
            ..rolling(1.2)
        };
        let before = bike.energy(&state, &offset);
        let dt = 1e-3;
        let mut work = 0.0;
        let power = |s: &BikeState, i: &BikeInput| {
            i.drive_force * s.speed
                + i.balancer_torque * s.balancer_rate
                + i.roll_moment * s.roll_rate
        };
        for i in 0..500 {
            let t = f64::from(i) * dt;
            let input = BikeInput {
                drive_force: 5.0,
                steer_rate: 0.2 * t.cos(),
                balancer_torque: -3.0 * (2.0 * t).sin(),
                roll_moment: 1.0,
                offset,
                ..BikeInput::default()
            };
            let middle = Rk4.step(&bike, t, &state, &input, 0.5 * dt);
            let end = Rk4.step(&bike, t, &state, &input, dt);
            // Simpson's rule over the step.
            work += dt / 6.0
                * (power(&state, &input) + 4.0 * power(&middle, &input) + power(&end, &input));
            state = end;
        }
        // Rounding of energies near 300 J over 500 steps.
        assert!((bike.energy(&state, &offset) - before - work).abs() < 1e-9);
    }

    #[test]
    fn a_state_that_is_not_finite_is_recognised() {
        assert!(rolling(1.0).is_finite());
        assert!(
            !BikeState {
                roll_rate: f64::NAN,
                ..rolling(1.0)
            }
            .is_finite()
        );
        let lost = BikeState {
            steer: f64::INFINITY,
            ..rolling(1.0)
        };
        assert!(!lost.is_finite());
    }
}
