//! The roll ahead: where given torques take it, and how each of them moves it.
//!
//! The state is `(alpha, sigma, beta, beta')`. With the momentum in place of the roll rate the
//! joint torque and the centrifugal terms of the turning balancer, some 2 kN m at full speed, act on
//! `beta` alone,
//!
//! ```text
//! p' = sigma/M11,  sigma' = b1 alpha + b2 sin(phi) + T,  beta'' = w(tau),   p = alpha + F(beta)
//! ```
//!
//! and `d sigma'/d beta` at given `p` is nearly the same at every balancer angle. That is what
//! makes one linearisation good for many turns of the balancer. Gravity on the frame is taken as
//! linear: it errs to the safe side by 1 % at 14 deg, and a nominal motion that falls does
//! not curl round.

use crate::roll_model::RollModel;

/// Torque moves.
pub(super) const MOVES: usize = 12;
/// How long each torque lasts, s: the first as long as a few ticks, the last a turn of the balancer.
pub(super) const BLOCKS: [f64; MOVES] = [
    0.02, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.10, 0.12, 0.14, 0.16, 0.20,
];
/// Torques per steering rate, and steering moves.
const TORQUES_PER_STEER: usize = 2;
pub(super) const STEERS: usize = MOVES / TORQUES_PER_STEER;
/// Everything there is to choose.
pub(super) const UNKNOWNS: usize = MOVES + STEERS;
/// Longest integration step, s: a third of a radian per step at 17 rad/s.
const STEP: f64 = 0.02;
/// Beyond this lean, rad, the balancer's own gravity is frozen: it is a fall.
const LEAN_MAX: f64 = 0.4;

/// Integration steps of a torque move.
fn steps(duration: f64) -> usize {
    (duration / STEP).round().max(1.0) as usize
}

/// How long steering move `k` lasts, s.
pub(super) fn steer_duration(k: usize) -> f64 {
    BLOCKS[TORQUES_PER_STEER * k..TORQUES_PER_STEER * (k + 1)]
        .iter()
        .sum()
}

/// What the balance law is asked to settle: the state seen from the lean reference.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Trouble {
    /// Roll off the reference, rad.
    pub roll: f64,
    /// Momentum that goes with it, kg m^2/s.
    pub momentum: f64,
    /// `beta`, rad.
    pub balancer: f64,
    /// `beta'`, rad/s.
    pub balancer_rate: f64,
    /// Roll moment left on the reference itself, N m.
    pub moment: f64,
    /// Torque that holds the balancer still on the reference, N m.
    pub held_torque: f64,
}

/// What steering can do for the balance: the moment `H v omega + A omega'` of a yaw rate that is
/// added to the path's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteeringRoom {
    /// Yaw acceleration per steering rate, `v/(w cos^2 psi)`, 1/s.
    pub yaw_gain: f64,
    /// How fast the follower takes an added yaw rate back, `v/ell`, 1/s.
    pub decay: f64,
    /// `H v`, N m s.
    pub centripetal: f64,
    /// `A`, kg m^2.
    pub yaw_product: f64,
    /// Least and greatest steering rate that may be added, rad/s.
    pub range: (f64, f64),
}

/// A point of the predicted motion with how every unknown moves it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    /// Move that acts up to here, and for how long, s.
    pub block: usize,
    pub step: f64,
    /// The last node of its move.
    pub ends_block: bool,
    /// `p`, `sigma`, `beta`, `beta'` and `w`.
    pub state: [f64; 4],
    pub acceleration: f64,
    /// `d w / d tau` of the move that acts, 1/(kg m^2).
    pub mobility: f64,
    /// Derivatives of the state by each unknown.
    pub columns: [[f64; 4]; UNKNOWNS],
}

#[derive(Debug, Clone, Copy, Default)]
struct Roll {
    lean: f64,
    momentum: f64,
    balancer: f64,
    rate: f64,
}

impl Roll {
    fn moved(&self, by: &Self, h: f64) -> Self {
        Self {
            lean: self.lean + h * by.lean,
            momentum: self.momentum + h * by.momentum,
            balancer: self.balancer + h * by.balancer,
            rate: self.rate + h * by.rate,
        }
    }
}

/// Rates of the state and the coefficients of its linearisation.
struct Local {
    rate: Roll,
    m11: f64,
    mobility: f64,
    /// `d sigma'/dp`, `d sigma'/d beta` at given `p`, and `d p'/d beta`.
    stiffness: f64,
    decoupling: f64,
    shear: f64,
}

impl Local {
    fn new(model: &RollModel, x: &Roll, torque: f64, moment: f64) -> Self {
        let [a0, a2, a3, b1, b2] = model.constants();
        let (sin, cos) = x.balancer.sin_cos();
        let lean = x.lean.clamp(-LEAN_MAX, LEAN_MAX);
        // sin and cos of phi for a small lean.
        let (sf, cf) = (sin + cos * lean, cos - sin * lean);
        let m11 = a0 + a2 + 2.0 * a3 * cos;
        let m12 = a2 + a3 * cos;
        let lean_rate = (x.momentum - m12 * x.rate) / m11;
        let momentum_rate = b1 * x.lean + b2 * sf + moment;
        let c1 = -a3 * sin * (2.0 * lean_rate + x.rate) * x.rate;
        let c2 = a3 * sin * lean_rate * lean_rate;
        let mobility = m11 / (a2 * m11 - m12 * m12);
        let acceleration = (torque - c2 + b2 * sf - m12 / m11 * (momentum_rate - c1)) * mobility;
        let stiffness = b1 + b2 * cf;
        Self {
            rate: Roll {
                lean: lean_rate,
                momentum: momentum_rate,
                balancer: x.rate,
                rate: acceleration,
            },
            m11,
            mobility,
            stiffness,
            decoupling: b2 * cf - stiffness * m12 / m11,
            shear: 2.0 * a3 * sin * x.momentum / (m11 * m11),
        }
    }
}

/// Follows the motion under `moves` and calls `visit` at every node, the last of which it returns.
pub(super) fn roll_out(
    model: &RollModel,
    trouble: &Trouble,
    moves: &[f64; UNKNOWNS],
    room: Option<&SteeringRoom>,
    mut visit: impl FnMut(&Node),
) -> Node {
    let mut x = Roll {
        lean: trouble.roll,
        momentum: trouble.momentum,
        balancer: trouble.balancer,
        rate: trouble.balancer_rate,
    };
    let unknowns = if room.is_some() { UNKNOWNS } else { MOVES };
    let mut node = Node {
        block: 0,
        step: 0.0,
        ends_block: false,
        state: [0.0; 4],
        acceleration: 0.0,
        mobility: 0.0,
        columns: [[0.0; 4]; UNKNOWNS],
    };
    // The added yaw rate and how the steering moves it.
    let mut yaw = 0.0;
    let mut yaw_columns = [0.0; STEERS];
    for (block, duration) in BLOCKS.iter().enumerate() {
        let steps = steps(*duration);
        let h = duration / steps as f64;
        let (torque, steer) = (moves[block], block / TORQUES_PER_STEER);
        for left in (0..steps).rev() {
            let mut moment = trouble.moment;
            if let Some(room) = room {
                let rate = room.yaw_gain * moves[MOVES + steer] - room.decay * yaw;
                moment += room.centripetal * (yaw + 0.5 * h * rate) + room.yaw_product * rate;
                yaw += h * rate;
            }
            let start = Local::new(model, &x, torque, moment);
            let local = Local::new(model, &x.moved(&start.rate, 0.5 * h), torque, moment);
            x = x.moved(&local.rate, h);
            for (i, column) in node.columns.iter_mut().enumerate().take(unknowns) {
                let (mut w, mut push) = (0.0, 0.0);
                if i < MOVES {
                    if i > block {
                        continue;
                    }
                    if i == block {
                        w = local.mobility;
                    }
                } else if let Some(room) = room {
                    let k = i - MOVES;
                    if k > steer {
                        continue;
                    }
                    let own = if k == steer { room.yaw_gain } else { 0.0 };
                    let rate = own - room.decay * yaw_columns[k];
                    push = room.centripetal * (yaw_columns[k] + 0.5 * h * rate)
                        + room.yaw_product * rate;
                    yaw_columns[k] += h * rate;
                }
                let [p, sigma, beta, nu] = *column;
                let half = 0.5 * h;
                let p_mid = p + half * sigma / local.m11;
                let sigma_mid =
                    sigma + half * (local.stiffness * p + local.decoupling * beta + push);
                let (beta_mid, nu_mid) = (beta + half * nu, nu + half * w);
                *column = [
                    p + h * (sigma_mid / local.m11 + local.shear * beta_mid),
                    sigma + h * (local.stiffness * p_mid + local.decoupling * beta_mid + push),
                    beta + h * nu_mid,
                    nu + h * w,
                ];
            }
            node.block = block;
            node.step = h;
            node.ends_block = left == 0;
            node.state = [
                x.lean + model.inertia.value(x.balancer),
                x.momentum,
                x.balancer,
                x.rate,
            ];
            node.acceleration = local.rate.rate;
            node.mobility = local.mobility;
            visit(&node);
        }
    }
    node
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_dynamics::BikeParams;

    fn trouble() -> Trouble {
        Trouble {
            roll: 0.1,
            momentum: 2.0,
            balancer: 0.3,
            balancer_rate: 5.0,
            moment: 1.0,
            held_torque: 0.0,
        }
    }

    #[test]
    fn columns_are_the_derivatives_of_the_roll() {
        // In flywheel mode the prediction is affine, so that the quotient itself is exact. The columns
        // leave out how the roll moment moves the balancer, M12/M11 = 4 % of it: a tenth after a second for the roll
        // (p and sigma), which decides; the balancer's own speed late in a fall is off by more, and is
        // put right by the next tick's roll-out.
        let model = RollModel::new(&BikeParams::default(), 0.0);
        let room = SteeringRoom {
            yaw_gain: 1.3,
            decay: 1.5,
            centripetal: 44.0,
            yaw_product: 12.4,
            range: (-2.0, 2.0),
        };
        let mut moves = [3.0; UNKNOWNS];
        let end = roll_out(&model, &trouble(), &moves, Some(&room), |_| {});
        for i in 0..UNKNOWNS {
            moves[i] += 1.0;
            let pushed = roll_out(&model, &trouble(), &moves, Some(&room), |_| {});
            moves[i] -= 1.0;
            for k in 0..2 {
                let quotient = pushed.state[k] - end.state[k];
                let largest = end
                    .columns
                    .iter()
                    .fold(0.0f64, |most, c| most.max(c[k].abs()));
                assert!(
                    (quotient - end.columns[i][k]).abs() < 0.1 * largest,
                    "{i} {k}: {quotient} {}",
                    end.columns[i][k]
                );
            }
        }
    }

    #[test]
    fn the_momentum_hardly_knows_which_way_the_balancer_points() {
        // D of the design note, upright: within [-13.9, -12.5] over a full turn.
        let model = RollModel::new(&BikeParams::default(), 0.15);
        for i in 0..64 {
            let x = Roll {
                balancer: f64::from(i) * 0.1,
                ..Roll::default()
            };
            let d = Local::new(&model, &x, 0.0, 0.0).decoupling;
            assert!(d > -13.95 && d < -12.45, "{d}");
        }
    }

    #[test]
    fn a_tenth_of_a_second_ahead_is_where_the_plant_goes() {
        use bikebot_dynamics::{Integrator, Rk4, TwoLink, TwoLinkInput, TwoLinkState};
        let bike = BikeParams::default();
        let (offset, torque) = (0.15, 40.0);
        let model = RollModel::new(&bike, offset);
        let plant = TwoLink::new(&bike, offset);
        let mut state = TwoLinkState {
            roll: 0.08,
            balancer: 0.4,
            roll_rate: -0.1,
            balancer_rate: 6.0,
        };
        let start = Trouble {
            roll: state.roll,
            momentum: model.momentum(&state),
            balancer: state.balancer,
            balancer_rate: state.balancer_rate,
            ..Trouble::default()
        };
        let mut at = None;
        let mut passed = 0.0;
        roll_out(&model, &start, &[torque; UNKNOWNS], None, |node| {
            passed += node.step;
            if passed < 0.1105 {
                at = Some(node.state);
            }
        });
        for _ in 0..110 {
            let input = TwoLinkInput {
                balancer_torque: torque,
                roll_moment: 0.0,
            };
            state = Rk4.step(&plant, 0.0, &state, &input, 1e-3);
        }
        let [p, sigma, beta, nu] = at.unwrap();
        // Steps of 20 ms at up to 15 rad/s, second order; gravity linear.
        assert!((p - model.inertia.value(beta) - state.roll).abs() < 2e-3);
        assert!((sigma - model.momentum(&state)).abs() < 0.02);
        assert!((beta - state.balancer).abs() < 0.01 && (nu - state.balancer_rate).abs() < 0.2);
    }
}
