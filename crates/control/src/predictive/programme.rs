//! The quadratic programme of a tick.

use bikebot_dynamics::{BalancerMode, BikeParams};
use bikebot_qp::{DenseQp, Settings, Status};
use nalgebra::{Matrix4, Vector4};

use super::prediction::{
    BLOCKS, MOVES, Node, STEERS, SteeringRoom, Trouble, UNKNOWNS, roll_out, steer_duration,
};
use crate::error::ControlError;
use crate::lqr;
use crate::params::BalanceParams;
use crate::roll_model::RollModel;

/// Share of the greatest balancer speed that is planned with: a tick of full torque stays below it.
const SPEED_SHARE: f64 = 0.9875;
/// Share of the speed in hand that the end of the horizon may count on to capture the rest.
const CAPTURE_SHARE: f64 = 0.5;
/// Prices of the limits, beside a cost in (rad/s^2)^2 s: speed per rad/s, capture per rad.
const SPEED_PRICE: f64 = 1e3;
const CAPTURE_PRICE: f64 = 1e6;
/// Curvature of the price on steering, s^-1 per (rad/s)^2: it makes the answer unique.
const STEER_CURVATURE: f64 = 10.0;
/// Torques are asked for to a few mN m: tenfold finer than any motor.
const SETTINGS: Settings = Settings {
    residual_tolerance: 1e-6,
    gap_tolerance: 1e-7,
    max_iterations: 25,
};

/// What the law wants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Predicted {
    /// Joint torque with the held part, N m.
    pub torque: f64,
    /// Steering rate to add to the follower's, rad/s.
    pub steer_rate: f64,
    /// Iterations of the solver.
    pub iterations: u32,
}

/// The averaged roll of one offset: what is left when the balancer's turns are smoothed out.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Averaged {
    offset: f64,
    m11: f64,
    /// `s`: lean per balancer angle, over a whole turn.
    ripple_free: f64,
    /// `lambda`, 1/s.
    rate: f64,
    cost_to_go: Matrix4<f64>,
}

impl Averaged {
    fn new(model: &RollModel, weights: &Weights) -> Result<Self, ControlError> {
        use std::f64::consts::{FRAC_PI_2, TAU};
        let m11 = model.inertia.m11(FRAC_PI_2);
        let stiffness = model.toppling_stiffness() - model.balancer_stiffness();
        let s = model.inertia.value(TAU) / TAU;
        #[rustfmt::skip]
        let a = Matrix4::new(
            0.0, 1.0 / m11, 0.0, 0.0,
            stiffness, 0.0, -stiffness * s, 0.0,
            0.0, 0.0, 0.0, 1.0,
            0.0, 0.0, 0.0, 0.0,
        );
        let input = Matrix4::from_diagonal(&Vector4::new(0.0, 0.0, 0.0, 1.0));
        let lean = Vector4::new(1.0, 0.0, -s, 0.0);
        let cost = lean * lean.transpose() * weights.lean
            + Matrix4::from_diagonal(&Vector4::new(0.0, 0.0, weights.angle, weights.rate));
        let cost_to_go =
            lqr::riccati(&a, &input, &cost).ok_or(ControlError::NoStabilisingGain {
                residual: f64::INFINITY,
            })?;
        Ok(Self {
            offset: model.offset,
            m11,
            ripple_free: s,
            rate: (stiffness / m11).sqrt(),
            cost_to_go,
        })
    }

    fn between(a: &Self, b: &Self, offset: f64) -> Self {
        let span = b.offset - a.offset;
        let share = if span == 0.0 {
            0.0
        } else {
            ((offset - a.offset) / span).clamp(0.0, 1.0)
        };
        let mix = |x: f64, y: f64| x + (y - x) * share;
        Self {
            offset,
            m11: mix(a.m11, b.m11),
            ripple_free: mix(a.ripple_free, b.ripple_free),
            rate: mix(a.rate, b.rate),
            cost_to_go: a.cost_to_go + (b.cost_to_go - a.cost_to_go) * share,
        }
    }

    /// `e = p - s beta`.
    fn lean(&self, z: &[f64; 4]) -> f64 {
        z[0] - self.ripple_free * z[2]
    }

    /// `xi = e + e'/lambda`.
    fn divergent(&self, z: &[f64; 4]) -> f64 {
        self.lean(z) + (z[1] / self.m11 - self.ripple_free * z[3]) / self.rate
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Weights {
    lean: f64,
    angle: f64,
    rate: f64,
}

/// Weights and steering price of one mode.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Mode {
    weights: Weights,
    steering_price: f64,
    averaged: Averaged,
}

/// The law with its plan of the tick before.
#[derive(Debug, Clone)]
pub struct Predictive {
    modes: [Mode; 2],
    torque_max: f64,
    speed_max: f64,
    steers: bool,
    moves: [f64; UNKNOWNS],
    qp: DenseQp,
    hessian: Vec<f64>,
    gradient: Vec<f64>,
}

impl PartialEq for Predictive {
    fn eq(&self, other: &Self) -> bool {
        // The programme is filled afresh in every tick.
        self.modes == other.modes
            && self.torque_max == other.torque_max
            && self.speed_max == other.speed_max
            && self.steers == other.steers
            && self.moves == other.moves
    }
}

impl Predictive {
    /// For `bike`, with the steering among what may be chosen if `params` ask for the assist.
    ///
    /// # Errors
    ///
    /// [`ControlError::NoStabilisingGain`] if the weights have no cost to go.
    pub fn new(bike: &BikeParams, params: &BalanceParams) -> Result<Self, ControlError> {
        let mode = |mode: BalancerMode| {
            let (angle, rate, steering_price) = match mode {
                BalancerMode::Flywheel => (
                    params.mpc_balancer_flywheel,
                    params.mpc_rate_flywheel,
                    params.assist_price_flywheel,
                ),
                BalancerMode::Balancer => (
                    params.mpc_balancer_balancer,
                    params.mpc_rate_balancer,
                    params.assist_price_balancer,
                ),
            };
            let weights = Weights {
                lean: params.mpc_lean,
                angle,
                rate,
            };
            Averaged::new(&RollModel::new(bike, bike.offset(mode)), &weights).map(|averaged| Mode {
                weights,
                steering_price,
                averaged,
            })
        };
        let steers = params.steering_assist;
        let unknowns = if steers { UNKNOWNS } else { MOVES };
        let rows = 2 * MOVES + 2 + 2 * STEERS;
        Ok(Self {
            modes: [mode(BalancerMode::Flywheel)?, mode(BalancerMode::Balancer)?],
            torque_max: bike.balancer_torque_max,
            speed_max: SPEED_SHARE * bike.balancer_speed_max,
            steers,
            moves: [0.0; UNKNOWNS],
            qp: DenseQp::new(unknowns, rows, 0),
            hessian: vec![0.0; unknowns * unknowns],
            gradient: vec![0.0; unknowns],
        })
    }

    /// Forgets the plan: the next tick starts from no torque.
    pub fn reset(&mut self) {
        self.moves = [0.0; UNKNOWNS];
    }

    /// The torque and the steering rate of this tick, `dt` seconds after the last; `None` if the
    /// state is not finite or the solver failed on it. Takes no memory.
    pub fn tick(
        &mut self,
        model: &RollModel,
        trouble: &Trouble,
        room: Option<&SteeringRoom>,
        dt: f64,
    ) -> Option<Predicted> {
        let room = room.filter(|_| self.steers);
        let [low, high] = [-1.0, 1.0].map(|side: f64| side * self.torque_max - trouble.held_torque);
        for torque in &mut self.moves[..MOVES] {
            *torque = torque.clamp(low, high);
        }
        if room.is_none() {
            self.moves[MOVES..].fill(0.0);
        }
        self.fill(model, trouble, room).ok()?;
        let n = self.qp.unknowns();
        for i in 0..n {
            let (lower, upper) = if i < MOVES {
                (low, high)
            } else {
                room.map_or((0.0, 0.0), |room| room.range)
            };
            self.qp.set_box(i, lower, upper).ok()?;
        }
        let summary = self.qp.solve(&SETTINGS);
        let x = self.qp.x();
        let usable = matches!(summary.status, Status::Solved | Status::MaxIterations)
            && x.iter().all(|value| value.is_finite());
        if !usable {
            self.reset();
            return None;
        }
        let mut next = [0.0; UNKNOWNS];
        next[..n].copy_from_slice(x);
        let answer = Predicted {
            torque: next[0].clamp(low, high) + trouble.held_torque,
            steer_rate: room.map_or(0.0, |room| next[MOVES].clamp(room.range.0, room.range.1)),
            iterations: summary.iterations,
        };
        // The plan as the next tick sees it: every torque begins `dt` earlier.
        for j in 0..MOVES - 1 {
            let passed = (dt / BLOCKS[j]).min(1.0);
            next[j] += passed * (next[j + 1] - next[j]);
        }
        self.moves = next;
        Some(answer)
    }

    /// Writes down the programme of this tick.
    fn fill(
        &mut self,
        model: &RollModel,
        trouble: &Trouble,
        room: Option<&SteeringRoom>,
    ) -> Result<(), bikebot_qp::QpError> {
        let [flywheel, balancer] = &self.modes;
        let averaged = Averaged::between(&flywheel.averaged, &balancer.averaged, model.offset);
        let nearer = if (model.offset - flywheel.averaged.offset).abs()
            <= (model.offset - balancer.averaged.offset).abs()
        {
            flywheel
        } else {
            balancer
        };
        let n = self.qp.unknowns();
        let (qp, moves) = (&mut self.qp, &self.moves);
        let (hessian, gradient) = (&mut self.hessian, &mut self.gradient);
        let speed_max = self.speed_max;
        hessian.fill(0.0);
        gradient.fill(0.0);
        qp.clear_rows();
        let mut outcome = Ok(());
        let end = roll_out(model, trouble, moves, room, |node| {
            add_cost(hessian, gradient, n, node, &averaged, &nearer.weights);
            let mut rows = || {
                if node.ends_block {
                    for side in [1.0, -1.0] {
                        let row: [f64; UNKNOWNS] =
                            std::array::from_fn(|i| side * node.columns[i][3]);
                        let bound = speed_max - side * node.state[3] + dot(&row, moves);
                        qp.add_elastic_row(&row[..n], bound, SPEED_PRICE)?;
                    }
                }
                Ok(())
            };
            if outcome.is_ok() {
                outcome = rows();
            }
        });
        outcome?;
        add_end_cost(hessian, gradient, n, &end, &averaged.cost_to_go);

        // Capture: |xi| within what the speed in hand can still stop.
        let share = CAPTURE_SHARE * averaged.ripple_free / averaged.rate;
        for side in [1.0, -1.0] {
            let reach = |z: &[f64; 4]| side * (averaged.divergent(z) + share * z[3]);
            let row: [f64; UNKNOWNS] = std::array::from_fn(|i| reach(&end.columns[i]));
            let bound = share * speed_max - reach(&end.state) + dot(&row, moves);
            qp.add_elastic_row(&row[..n], bound, CAPTURE_PRICE)?;
        }
        for k in 0..n - MOVES {
            let i = MOVES + k;
            let duration = steer_duration(k);
            hessian[i * n + i] += STEER_CURVATURE * duration;
            let mut row = [0.0; UNKNOWNS];
            for side in [1.0, -1.0] {
                row[i] = side;
                qp.add_elastic_row(&row[..n], 0.0, nearer.steering_price * duration)?;
            }
        }

        // The cost is quadratic about the plan; the programme wants it about zero.
        for i in 0..n {
            for k in 0..i {
                hessian[k * n + i] = hessian[i * n + k];
            }
        }
        for i in 0..n {
            let about: f64 = (0..n).map(|k| hessian[i * n + k] * moves[k]).sum();
            gradient[i] -= about;
        }
        qp.set_hessian(hessian)?;
        qp.set_gradient(gradient)
    }
}

fn dot(row: &[f64; UNKNOWNS], moves: &[f64; UNKNOWNS]) -> f64 {
    row.iter().zip(moves).map(|(a, b)| a * b).sum()
}

/// The running cost of one node, in the lower triangle.
fn add_cost(
    hessian: &mut [f64],
    gradient: &mut [f64],
    n: usize,
    node: &Node,
    averaged: &Averaged,
    weights: &Weights,
) {
    let h = node.step;
    let lean = averaged.lean(&node.state);
    let [_, _, beta, nu] = node.state;
    for i in 0..n {
        let c = &node.columns[i];
        let by_lean = h * weights.lean * averaged.lean(c);
        let by_angle = h * weights.angle * c[2];
        let by_rate = h * weights.rate * c[3];
        gradient[i] += by_lean * lean + by_angle * beta + by_rate * nu;
        let row = &mut hessian[i * n..=i * n + i];
        for (entry, other) in row.iter_mut().zip(&node.columns) {
            *entry += by_lean * averaged.lean(other) + by_angle * other[2] + by_rate * other[3];
        }
    }
    let j = node.block;
    gradient[j] += h * node.mobility * node.acceleration;
    hessian[j * n + j] += h * node.mobility * node.mobility;
}

/// The cost to go from the end of the horizon.
fn add_end_cost(
    hessian: &mut [f64],
    gradient: &mut [f64],
    n: usize,
    end: &Node,
    cost_to_go: &Matrix4<f64>,
) {
    let pull = cost_to_go * Vector4::from(end.state);
    for i in 0..n {
        let column = Vector4::from(end.columns[i]);
        gradient[i] += column.dot(&pull);
        let weighed = cost_to_go * column;
        let row = &mut hessian[i * n..=i * n + i];
        for (entry, other) in row.iter_mut().zip(&end.columns) {
            *entry += weighed.dot(&Vector4::from(*other));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::BalanceLawKind;
    use clarabel::algebra::CscMatrix;
    use clarabel::solver::{
        DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT,
    };

    fn law() -> (Predictive, RollModel) {
        let bike = BikeParams::default();
        let params = BalanceParams {
            controller: BalanceLawKind::Mpc,
            ..BalanceParams::default()
        };
        (
            Predictive::new(&bike, &params).unwrap(),
            RollModel::new(&bike, 0.0),
        )
    }

    fn leaning(model: &RollModel, degrees: f64, rate: f64) -> Trouble {
        Trouble {
            roll: degrees.to_radians(),
            momentum: model.inertia.m12(0.0) * rate,
            balancer_rate: rate,
            ..Trouble::default()
        }
    }

    /// Cost and limits of a plan, from the motion alone: none of the derivatives the law works with.
    /// Limits are `value <= 0` at a price.
    fn judge(law: &Predictive, model: &RollModel, trouble: &Trouble, plan: &[f64]) -> Vec<f64> {
        let mode = &law.modes[0];
        let (weights, averaged) = (&mode.weights, &mode.averaged);
        let mut moves = [0.0; UNKNOWNS];
        moves[..MOVES].copy_from_slice(plan);
        let mut cost = 0.0;
        let mut limits = Vec::new();
        let end = roll_out(model, trouble, &moves, None, |node| {
            let [_, _, beta, nu] = node.state;
            let lean = averaged.lean(&node.state);
            cost += 0.5
                * node.step
                * (weights.lean * lean * lean
                    + weights.angle * beta * beta
                    + weights.rate * nu * nu
                    + node.acceleration * node.acceleration);
            if node.ends_block {
                limits.push(nu - law.speed_max);
                limits.push(-nu - law.speed_max);
            }
        });
        let z = Vector4::from(end.state);
        cost += 0.5 * z.dot(&(averaged.cost_to_go * z));
        let xi = averaged.divergent(&end.state);
        let share = CAPTURE_SHARE * averaged.ripple_free / averaged.rate;
        limits.push(xi - share * (law.speed_max - end.state[3]));
        limits.push(-xi - share * (law.speed_max + end.state[3]));
        limits.insert(0, cost);
        limits
    }

    /// The same programme from second differences (exact: in flywheel mode the prediction is affine),
    /// solved by Clarabel.
    fn oracle(law: &Predictive, model: &RollModel, trouble: &Trouble) -> f64 {
        const STEP: f64 = 20.0;
        let n = MOVES;
        let at = |pushed: &[usize]| {
            let mut plan = vec![0.0; n];
            for i in pushed {
                plan[*i] += STEP;
            }
            judge(law, model, trouble, &plan)
        };
        let zero = at(&[]);
        let single: Vec<_> = (0..n).map(|i| at(&[i])).collect();
        let rows = zero.len() - 1;
        let (mut pi, mut pj, mut pv) = (vec![], vec![], vec![]);
        let mut q = vec![0.0; n + rows];
        for j in 0..n {
            for i in 0..=j {
                let h = (at(&[i, j])[0] - single[i][0] - single[j][0] + zero[0]) / (STEP * STEP);
                if i == j {
                    q[i] = (single[i][0] - zero[0]) / STEP - 0.5 * h * STEP;
                }
                pi.push(i);
                pj.push(j);
                pv.push(h);
            }
        }
        let (mut ai, mut aj, mut av, mut b) = (vec![], vec![], vec![], vec![]);
        for k in 0..rows {
            for (i, column) in single.iter().enumerate() {
                ai.push(2 * k);
                aj.push(i);
                av.push((column[k + 1] - zero[k + 1]) / STEP);
            }
            for row in [2 * k, 2 * k + 1] {
                ai.push(row);
                aj.push(n + k);
                av.push(-1.0);
            }
            b.extend([-zero[k + 1], 0.0]);
            q[n + k] = if k + 2 < rows {
                SPEED_PRICE
            } else {
                CAPTURE_PRICE
            };
        }
        for i in 0..n {
            for side in [1.0, -1.0] {
                ai.push(b.len());
                aj.push(i);
                av.push(side);
                b.push(law.torque_max);
            }
        }
        let settings = DefaultSettingsBuilder::default()
            .verbose(false)
            .tol_gap_rel(1e-10)
            .build()
            .unwrap();
        let mut solver = DefaultSolver::new(
            &CscMatrix::new_from_triplets(n + rows, n + rows, pi, pj, pv),
            &q,
            &CscMatrix::new_from_triplets(b.len(), n + rows, ai, aj, av),
            &b,
            &[SupportedConeT::NonnegativeConeT(b.len())],
            settings,
        )
        .unwrap();
        solver.solve();
        assert!(matches!(
            solver.solution.status,
            SolverStatus::Solved | SolverStatus::AlmostSolved
        ));
        solver.solution.x[0]
    }

    #[test]
    fn answers_as_clarabel_does_on_the_same_question() {
        // Free, at the torque limit, at the speed limit, on the way back, and beyond saving.
        for (degrees, rate) in [
            (0.5, 0.0),
            (-3.0, 4.0),
            (7.0, 0.0),
            (2.0, 38.0),
            (-1.0, 39.0),
            (14.0, 0.0),
        ] {
            let (mut law, model) = law();
            let trouble = leaning(&model, degrees, rate);
            let theirs = oracle(&law, &model, &trouble);
            let ours = law.tick(&model, &trouble, None, 0.005).unwrap();
            // The tick asks for a gap of 1e-7: three or four digits of the torque.
            assert!(
                (ours.torque - theirs).abs() < 0.05,
                "{degrees} deg, {rate} rad/s: {} against {theirs}",
                ours.torque
            );
        }
    }

    #[test]
    fn a_plan_that_is_kept_is_confirmed_by_the_next_tick() {
        // Nothing unforeseen happens: the second answer is the first one's continuation.
        let (mut law, model) = law();
        let trouble = leaning(&model, 1.0, 0.0);
        let first = law.tick(&model, &trouble, None, 0.0).unwrap();
        let second = law.tick(&model, &trouble, None, 0.0).unwrap();
        assert!((first.torque - second.torque).abs() < 0.05);
        // Two to eight degrees in balancer mode, where the prediction is not affine.
        let model = RollModel::new(&BikeParams::default(), 0.15);
        for degrees in [2.0, 8.0] {
            let (mut law, _) = super::tests::law();
            let trouble = leaning(&model, degrees, 0.0);
            let mut torques = Vec::new();
            for _ in 0..4 {
                torques.push(law.tick(&model, &trouble, None, 0.0).unwrap().torque);
            }
            assert!((torques[3] - torques[2]).abs() < 1.0, "{torques:?}");
        }
    }

    #[test]
    fn a_state_that_is_not_finite_is_refused_and_leaves_no_trace() {
        let (mut law, model) = law();
        let mut trouble = leaning(&model, 2.0, 0.0);
        let before = law.clone();
        trouble.roll = f64::NAN;
        assert_eq!(law.tick(&model, &trouble, None, 0.005), None);
        trouble.roll = 0.02;
        let (mut fresh, answer) = (before, law.tick(&model, &trouble, None, 0.005));
        let expected = fresh.tick(&model, &trouble, None, 0.005);
        assert_eq!(answer, expected);
    }
}
