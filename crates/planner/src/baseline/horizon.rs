//! One horizon of MPC as a quadratic programme about a trajectory, and its solution by Clarabel.
//!
//! Unknowns are the changes of the states, of the inputs and, where the horizon ends at the goal, of the length that all
//! its steps share, and one slack for all clearances. Lengths are in units of the planner's scale.
//!
//! ```text
//! minimise    Σ q_k |p_k − r_k|² + Σ σ_k² + r Σ u_k² + slack + length of the horizon, if that is free
//! subject to  the linearised motion; |σ_k| ≤ limit, |u_k| ≤ limit; clearance at ends and middles of steps ≥ margin − slack;
//!             the last state at the goal, if the horizon ends there
//! ```

use super::clothoid::{STATES, State, Step};
use crate::budget::Meter;
use crate::motion::MotionChecker;
use crate::params::MpcParams;
use bikebot_geometry::{Point2, Vector2, angle};
use bikebot_world::FootprintDisc;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver as _, SolverStatus, SupportedConeT,
};

/// Weight of the last position of a horizon relative to the others.
const LAST_WEIGHT: f64 = 5.0;
/// Price of a unit of slack: far above anything that a clearance can gain elsewhere.
const SLACK_PRICE: f64 = 1e3;
/// Clearances above the margin by more than this, in steps, are no concern of one round.
const REACH: f64 = 3.0;
/// How much the shared length of the steps may change in one round.
const LENGTH_CHANGE: f64 = 0.3;
/// Tolerance of the solver.
const TOLERANCE: f64 = 1e-8;

/// What does not change between horizons.
pub(crate) struct Task<'t, 'w> {
    pub checker: &'t MotionChecker<'w>,
    /// Discs that cover the footprint, in scales.
    pub discs: Vec<FootprintDisc>,
    /// m per unit of length here.
    pub scale: f64,
    /// Largest curvature of the knots, 1/scale.
    pub max_curvature: f64,
    /// Clearance asked for, in scales.
    pub margin: f64,
    pub params: &'t MpcParams,
}

/// A trajectory from a given state: inputs over steps of one length.
#[derive(Debug, Clone)]
pub(crate) struct Trajectory {
    pub start: State,
    pub rates: Vec<f64>,
    /// Length of each step, in scales.
    pub step: f64,
}

impl Trajectory {
    /// The states at the ends of the steps.
    pub fn states(&self) -> impl Iterator<Item = State> + '_ {
        self.rates.iter().scan(self.start, |state, &rate| {
            *state = state.after(rate, self.step);
            Some(*state)
        })
    }

    /// Where it ends.
    pub fn end(&self) -> State {
        self.states().last().unwrap_or(self.start)
    }
}

/// Where a horizon must end: position, in scales, and heading, rad, if it is prescribed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Terminal {
    pub position: Point2,
    pub heading: Option<f64>,
}

/// Sparse rows under construction.
#[derive(Default)]
struct Rows {
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
    right: Vec<f64>,
}

impl Rows {
    /// Appends `coefficients · x (= or ≤) right`.
    fn push(&mut self, coefficients: impl IntoIterator<Item = (usize, f64)>, right: f64) {
        for (column, value) in coefficients {
            self.rows.push(self.right.len());
            self.columns.push(column);
            self.values.push(value);
        }
        self.right.push(right);
    }
}

/// Columns of the unknowns of a horizon of `n` steps. The start is given and has none.
#[derive(Clone, Copy)]
struct Columns {
    n: usize,
}

impl Columns {
    /// Component `i` of the state after step `k`; `None` for the start, before step 0.
    fn state(self, k: Option<usize>, i: usize) -> Option<usize> {
        k.map(|k| STATES * k + i)
    }
    fn rate(self, k: usize) -> usize {
        STATES * self.n + k
    }
    fn slack(self) -> usize {
        (STATES + 1) * self.n
    }
    fn length(self) -> usize {
        (STATES + 1) * self.n + 1
    }
}

impl Task<'_, '_> {
    /// One round: linearises about `about`, solves, and integrates the new inputs. `references` are the positions to
    /// stay near, one per step. `None` if there is no solution, or the budget ended first: each round is an iteration.
    pub fn improve(
        &self,
        about: &Trajectory,
        references: &[Point2],
        terminal: Option<&Terminal>,
        meter: &mut Meter<'_>,
    ) -> Option<Trajectory> {
        if !meter.step_dearly() {
            return None;
        }
        let n = about.rates.len();
        let columns = Columns { n };
        let unknowns = (STATES + 1) * n + 1 + usize::from(terminal.is_some());
        let mut equal = Rows::default();
        let mut below = Rows::default();
        // Diagonal of the Hessian, and the gradient.
        let (mut square, mut linear) = (vec![0.0; unknowns], vec![0.0; unknowns]);

        let mut before = about.start;
        let mut last = before;
        for (k, &rate) in about.rates.iter().enumerate() {
            let step = before.step(rate, about.step);
            let from = k.checked_sub(1);
            motion_rows(&mut equal, columns, k, &step, 1.0, terminal.is_some());
            let halfway = before.step(rate, 0.5 * about.step);
            self.clearance_rows(
                &mut below,
                &halfway,
                &through(columns, from, k, &halfway, 0.5, terminal.is_some()),
                columns,
            );
            let own = |i: usize| vec![(STATES * k + i, 1.0)];
            let itself: [Vec<(usize, f64)>; 3] = [own(0), own(1), own(2)];
            self.clearance_rows(&mut below, &step, &itself, columns);

            let end = step.end;
            let share = if k + 1 == n { LAST_WEIGHT } else { 1.0 };
            let weight = 2.0 * share * self.params.position_weight;
            let off = end.position - references[k];
            for (i, off) in [off.x, off.y].into_iter().enumerate() {
                square[STATES * k + i] = weight;
                linear[STATES * k + i] = weight * off;
            }
            square[STATES * k + 3] = 2.0;
            linear[STATES * k + 3] = 2.0 * end.curvature;
            let u = columns.rate(k);
            square[u] = 2.0 * self.params.rate_weight;
            linear[u] = square[u] * rate;
            for sign in [1.0, -1.0] {
                let room = self.max_curvature - sign * end.curvature;
                below.push([(STATES * k + 3, sign)], room);
                let room = self.params.max_curvature_rate - sign * rate;
                below.push([(u, sign)], room);
            }
            last = end;
            before = end;
        }
        let slack = columns.slack();
        linear[slack] = SLACK_PRICE;
        below.push([(slack, -1.0)], 0.0);

        if let Some(terminal) = terminal {
            let at = |i: usize| STATES * (n - 1) + i;
            let gap = terminal.position - last.position;
            equal.push([(at(0), 1.0)], gap.x);
            equal.push([(at(1), 1.0)], gap.y);
            if let Some(heading) = terminal.heading {
                equal.push([(at(2), 1.0)], angle::difference(heading, last.heading));
            }
            let length = columns.length();
            linear[length] = self.params.length_weight * n as f64;
            let most = (LENGTH_CHANGE * about.step).min(self.params.step_scales - about.step);
            below.push([(length, 1.0)], most.max(0.0));
            below.push([(length, -1.0)], LENGTH_CHANGE * about.step);
        }

        let x = solve(square, linear, equal, below)?;
        let rates = about
            .rates
            .iter()
            .enumerate()
            .map(|(k, rate)| {
                let most = self.params.max_curvature_rate;
                (rate + x[columns.rate(k)]).clamp(-most, most)
            })
            .collect();
        let step = match terminal {
            Some(_) => about.step + x[columns.length()],
            None => about.step,
        };
        Some(Trajectory {
            start: about.start,
            rates,
            step,
        })
    }

    /// One row for each disc of the footprint that comes near anything at the end of `step`; `place` says how x, y and θ
    /// there hang on the unknowns.
    fn clearance_rows(
        &self,
        below: &mut Rows,
        step: &Step,
        place: &[Vec<(usize, f64)>; 3],
        columns: Columns,
    ) {
        let world = self.checker.world();
        let end = step.end;
        let (sin, cos) = end.heading.sin_cos();
        for disc in &self.discs {
            let centre = end.position
                + Vector2::new(cos, sin) * disc.offset
                + Vector2::new(-sin, cos) * disc.lateral;
            let metres = Point2::from(centre.coords * self.scale);
            let clearance = world.clearance(metres) / self.scale;
            let room = clearance - disc.radius - self.margin;
            if room > REACH || room.is_nan() {
                continue;
            }
            let away = metres - world.nearest_obstacle_point(metres);
            let distance = away.norm();
            if distance == 0.0 || distance.is_nan() {
                continue;
            }
            let n = away * (clearance.signum() / distance);
            let swing =
                disc.offset * (n.y * cos - n.x * sin) - disc.lateral * (n.x * cos + n.y * sin);
            let parts = [n.x, n.y, swing];
            let coefficients = place
                .iter()
                .zip(parts)
                .flat_map(|(place, part)| place.iter().map(move |&(c, v)| (c, -part * v)))
                .chain([(columns.slack(), -1.0)]);
            below.push(coefficients, room);
        }
    }
}

/// How x, y and θ at the end of a step of `part` of the shared length hang on the unknowns.
fn through(
    columns: Columns,
    from: Option<usize>,
    k: usize,
    step: &Step,
    part: f64,
    length_is_free: bool,
) -> [Vec<(usize, f64)>; 3] {
    let by_heading = [step.by_heading.x, step.by_heading.y, 1.0];
    std::array::from_fn(|i| {
        let own = columns
            .state(from, i)
            .filter(|_| i < 2)
            .map(|column| (column, 1.0));
        let heading = columns.state(from, 2).map(|c| (c, by_heading[i]));
        let curvature = columns.state(from, 3).map(|c| (c, step.by_curvature[i]));
        let rate = Some((columns.rate(k), step.by_rate[i]));
        let length = length_is_free.then(|| (columns.length(), part * step.by_length[i]));
        [own, heading, curvature, rate, length]
            .into_iter()
            .flatten()
            .collect()
    })
}

/// The four equations that a step imposes.
fn motion_rows(
    equal: &mut Rows,
    columns: Columns,
    k: usize,
    step: &Step,
    part: f64,
    length_is_free: bool,
) {
    let from = k.checked_sub(1);
    let place = through(columns, from, k, step, part, length_is_free);
    for (i, place) in place.into_iter().enumerate() {
        let moved = place.into_iter().map(|(column, value)| (column, -value));
        equal.push(moved.chain([(STATES * k + i, 1.0)]), 0.0);
    }
    let curvature = [
        columns.state(from, 3).map(|c| (c, -1.0)),
        Some((columns.rate(k), -step.by_rate[3])),
        length_is_free.then(|| (columns.length(), -part * step.by_length[3])),
        Some((STATES * k + 3, 1.0)),
    ];
    equal.push(curvature.into_iter().flatten(), 0.0);
}

/// Minimises ½ x·diag(square) x + linear·x subject to equal x = right and below x ≤ right.
fn solve(square: Vec<f64>, linear: Vec<f64>, equal: Rows, below: Rows) -> Option<Vec<f64>> {
    let n = square.len();
    let cones = [
        SupportedConeT::ZeroConeT(equal.right.len()),
        SupportedConeT::NonnegativeConeT(below.right.len()),
    ];
    let offset = equal.right.len();
    let mut rows = equal.rows;
    rows.extend(below.rows.iter().map(|row| row + offset));
    let (mut columns, mut values, mut right) = (equal.columns, equal.values, equal.right);
    columns.extend(below.columns);
    values.extend(below.values);
    right.extend(below.right);
    let matrix = CscMatrix::new_from_triplets(right.len(), n, rows, columns, values);
    let hessian = CscMatrix::new_from_triplets(n, n, (0..n).collect(), (0..n).collect(), square);
    let settings = DefaultSettings {
        verbose: false,
        presolve_enable: false,
        tol_gap_abs: TOLERANCE,
        tol_gap_rel: TOLERANCE,
        tol_feas: TOLERANCE,
        ..DefaultSettings::default()
    };
    let mut solver =
        DefaultSolver::new(&hessian, &linear, &matrix, &right, &cones, settings).ok()?;
    solver.solve();
    let is_solved = matches!(
        solver.solution.status,
        SolverStatus::Solved | SolverStatus::AlmostSolved
    );
    let x = std::mem::take(&mut solver.solution.x);
    (is_solved && x.iter().all(|x| x.is_finite())).then_some(x)
}
