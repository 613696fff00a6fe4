//! The primal–dual interior point with predictor and corrector (S. Mehrotra, *On the implementation
//! of a primal–dual interior point method*, SIAM J. Optim. 2, 1992), for
//!
//! ```text
//!     minimise  ½ xᵀHx + gᵀx + Σ ρ_k e_k    subject to   G x + s = b + e,   A x = c,   s, e ≥ 0,
//! ```
//!
//! common to the banded and the dense solver, which differ only in how they multiply and factorise.
//! Rows are eliminated in [`crate::row`], equalities in [`crate::equalities`]. One iteration:
//! residuals and stopping test; D and K = H + GᵀDG = LLᵀ; *predictor* towards zero complementarity,
//! whose success sets σ = (μ_aff/μ)³; *corrector* towards σμ with the second-order terms, by the
//! same factor; one common step length for primal and dual, since H ties them together.
//!
//! One departure from the paper: the second-order terms are multiplied by the predictor's step
//! length. They are exact for a full predictor step; after a short one they overshoot and make the
//! iteration cycle.

use crate::equalities::{Equalities, SchurComplement, Triangular, dot};
use crate::outcome::{Breakdown, Settings, Status};
use crate::row::Row;

/// A quadratic programme as the interior point sees it: products and one factorisation.
///
/// Vectors of unknowns may be longer than the number of unknowns (padding of the band); what lies
/// beyond is zero and stays so.
pub(crate) trait Program {
    /// L of K = LLᵀ.
    type Factor: Triangular;
    /// Number of unknowns including padding.
    fn padded(&self) -> usize;
    /// g.
    fn gradient(&self) -> &[f64];
    /// b.
    fn bounds(&self) -> &[f64];
    /// ρ, infinite for hard rows.
    fn weights(&self) -> &[f64];
    /// A and c.
    fn equalities(&self) -> &Equalities;
    /// out = H x.
    fn hessian_times(&self, x: &[f64], out: &mut [f64]);
    /// out = G x.
    fn rows_times(&self, x: &[f64], out: &mut [f64]);
    /// out += Gᵀ z.
    fn add_rows_transposed(&self, z: &[f64], out: &mut [f64]);
    /// Sets unknowns that may not move to where they are fixed.
    fn place_fixed(&self, x: &mut [f64]);
    /// Zeroes the entries of unknowns that may not move.
    fn clear_fixed(&self, v: &mut [f64]);
    /// Whether H alone is as definite as the solver asks for.
    fn is_convex(&self, factor: &mut Self::Factor) -> bool;
    /// Factorises H + Gᵀ diag(d) G.
    fn factorise(&self, d: &[f64], factor: &mut Self::Factor);
}

/// Iterate and scratch memory; sized once.
#[derive(Debug, Clone)]
pub(crate) struct InteriorPoint {
    /// x, padded.
    pub x: Vec<f64>,
    /// y.
    pub y: Vec<f64>,
    rows: Vec<Row>,
    dx: Vec<f64>,
    dy: Vec<f64>,
    hx: Vec<f64>,
    stationarity: Vec<f64>,
    equality_residual: Vec<f64>,
    /// A vector over rows, for products with G and Gᵀ.
    over_rows: Vec<f64>,
    schur: SchurComplement,
}

/// What the stopping tests look at.
struct Measures {
    stationarity: f64,
    stationarity_scale: f64,
    feasibility: f64,
    size: f64,
    complementarity: f64,
    /// ½ xᵀHx, gᵀx.
    quadratic: f64,
    linear: f64,
}

impl Measures {
    fn within(&self, settings: &Settings) -> bool {
        let tolerance = settings.residual_tolerance;
        self.stationarity <= tolerance * (1.0 + self.stationarity_scale)
            && self.feasibility <= tolerance * (1.0 + self.size)
            && self.complementarity <= self.least_complementarity(settings.gap_tolerance)
    }

    fn least_complementarity(&self, tolerance: f64) -> f64 {
        tolerance * (1.0 + self.quadratic + self.linear.abs())
    }

    /// The μ below which nothing is gained: a thirtieth of what the stopping test asks for. Aiming
    /// lower while another residual still needs iterations would drive slacks into underflow.
    fn least_mu(&self, tolerance: f64, pairs: f64) -> f64 {
        self.least_complementarity(tolerance) / (30.0 * pairs)
    }
}

impl InteriorPoint {
    pub fn with_capacity(padded: usize, rows: usize, equalities: usize) -> Self {
        Self {
            x: Vec::with_capacity(padded),
            y: Vec::with_capacity(equalities),
            rows: Vec::with_capacity(rows),
            dx: Vec::with_capacity(padded),
            dy: Vec::with_capacity(equalities),
            hx: Vec::with_capacity(padded),
            stationarity: Vec::with_capacity(padded),
            equality_residual: Vec::with_capacity(equalities),
            over_rows: Vec::with_capacity(rows),
            schur: SchurComplement::with_capacity(padded, equalities),
        }
    }

    /// z of every row.
    pub fn duals(&self) -> impl Iterator<Item = f64> {
        self.rows.iter().map(Row::dual)
    }

    /// Sizes every vector for `program`, within the capacity, and clears it.
    pub fn resize<P: Program>(&mut self, program: &P) {
        let (rows, equalities) = (program.bounds().len(), program.equalities().len());
        for v in [
            &mut self.x,
            &mut self.dx,
            &mut self.hx,
            &mut self.stationarity,
        ] {
            v.clear();
            v.resize(program.padded(), 0.0);
        }
        for v in [&mut self.y, &mut self.dy, &mut self.equality_residual] {
            v.clear();
            v.resize(equalities, 0.0);
        }
        self.rows.clear();
        self.rows.resize(rows, Row::default());
        self.over_rows.clear();
        self.over_rows.resize(rows, 0.0);
    }

    /// Minimises from scratch, or from what `self.x` holds if `warm`.
    pub fn solve<P: Program>(
        &mut self,
        program: &P,
        factor: &mut P::Factor,
        settings: &Settings,
        warm: bool,
        go_on: &dyn Fn() -> bool,
    ) -> (Status, u32) {
        if !program.is_convex(factor) {
            return (Status::NumericalError(Breakdown::NotPositiveDefinite), 0);
        }
        // Each of these factorises once: on long problems that is worth a question.
        if !go_on() {
            program.place_fixed(&mut self.x);
            return (Status::MaxIterations, 0);
        }
        self.start(program, factor, warm);

        let mut iteration = 0;
        loop {
            let measures = self.measure(program);
            if measures.within(settings) {
                return (Status::Solved, iteration);
            }
            if self.proves_infeasible(program) {
                return (Status::Infeasible, iteration);
            }
            if self.proves_unbounded(program, &measures) {
                return (Status::Unbounded, iteration);
            }
            if iteration >= settings.max_iterations || !go_on() {
                return (Status::MaxIterations, iteration);
            }

            self.factorise(program, factor);
            let pairs = self.pairs();
            let mu = measures.complementarity / pairs;

            // predictor
            self.rows.iter_mut().for_each(Row::aim_at_zero);
            self.newton_step(program, factor);
            let reach = self.longest_step().min(1.0);
            let centring = self.centring(mu, reach);

            // corrector
            let target = (centring * mu).max(measures.least_mu(settings.gap_tolerance, pairs));
            self.rows
                .iter_mut()
                .for_each(|row| row.aim_at_path(target, reach));
            self.newton_step(program, factor);

            if !self.step_is_finite() {
                return (Status::NumericalError(Breakdown::NotFinite), iteration);
            }
            // a predictor that went nearly all the way vouches for a longer step
            let fraction = reach.clamp(CAUTIOUS_FRACTION, BOLD_FRACTION);
            self.advance((fraction * self.longest_step()).min(1.0));
            iteration += 1;
        }
    }

    /// The first point: x minimises the objective with every row replaced by a spring ½D(a·x − b)²,
    /// then each row is put on the central path of height μ.
    fn start<P: Program>(&mut self, program: &P, factor: &mut P::Factor, warm: bool) {
        program.place_fixed(&mut self.x);
        if !warm {
            self.over_rows.fill(START_STIFFNESS);
            program.factorise(&self.over_rows, factor);
            self.schur.factorise(program.equalities(), factor);
            // Gᵀ D (G x − b) + H x + g
            program.rows_times(&self.x, &mut self.over_rows);
            for (v, b) in self.over_rows.iter_mut().zip(program.bounds()) {
                *v = START_STIFFNESS * (*v - b);
            }
            program.hessian_times(&self.x, &mut self.dx);
            for (dx, g) in self.dx.iter_mut().zip(program.gradient()) {
                *dx += g;
            }
            program.add_rows_transposed(&self.over_rows, &mut self.dx);
            self.dx.iter_mut().for_each(|v| *v = -*v);
            program.clear_fixed(&mut self.dx);
            program.equalities().residual(&self.x, &mut self.dy);
            self.schur.solve(factor, &mut self.dx, &mut self.dy);
            add(1.0, &self.dx, &mut self.x);
            add(1.0, &self.dy, &mut self.y);
        }
        program.rows_times(&self.x, &mut self.over_rows);
        let mut violation = 0.0f64;
        for (v, b) in self.over_rows.iter_mut().zip(program.bounds()) {
            *v = b - *v;
            violation = violation.max(-*v);
        }
        let least = if warm { WARM_DISTANCE } else { START_DISTANCE };
        let mu = violation.max(least).powi(2);
        for ((row, &margin), &weight) in self
            .rows
            .iter_mut()
            .zip(&self.over_rows)
            .zip(program.weights())
        {
            *row = Row::centred(margin, weight, mu);
        }
    }

    /// Residuals of the optimality conditions at the iterate.
    fn measure<P: Program>(&mut self, program: &P) -> Measures {
        program.hessian_times(&self.x, &mut self.hx);
        let quadratic = 0.5 * dot(&self.x, &self.hx);
        let linear = dot(program.gradient(), &self.x);

        for ((r, hx), g) in self
            .stationarity
            .iter_mut()
            .zip(&self.hx)
            .zip(program.gradient())
        {
            *r = hx + g;
        }
        for (z, row) in self.over_rows.iter_mut().zip(&self.rows) {
            *z = row.dual();
        }
        program.add_rows_transposed(&self.over_rows, &mut self.stationarity);
        program
            .equalities()
            .add_transposed(&self.y, &mut self.stationarity);
        program.clear_fixed(&mut self.stationarity);

        program.rows_times(&self.x, &mut self.over_rows);
        let (mut feasibility, mut complementarity) = (0.0f64, 0.0);
        for ((row, gx), b) in self
            .rows
            .iter_mut()
            .zip(&self.over_rows)
            .zip(program.bounds())
        {
            let residual = row.measure(b - gx);
            feasibility = feasibility.max(residual.abs() / (1.0 + b.abs()));
            complementarity += row.complementarity();
        }
        program
            .equalities()
            .residual(&self.x, &mut self.equality_residual);
        feasibility = feasibility.max(largest(&self.equality_residual));

        Measures {
            stationarity: largest(&self.stationarity),
            stationarity_scale: largest(&self.hx).max(largest(program.gradient())),
            feasibility,
            size: largest(&self.x),
            complementarity,
            quadratic,
            linear,
        }
    }

    /// Farkas: multipliers z ≥ 0 of the hard rows and y with Gᵀz + Aᵀy = 0 and bᵀz + cᵀy < 0 leave
    /// no x. Taken as proof when the first holds to 1e-8 of the second: no x of size below 1e8 then
    /// exists (scaled, where answers are of size one). Looked for only once multipliers have grown.
    fn proves_infeasible<P: Program>(&mut self, program: &P) -> bool {
        let mut grown = largest(&self.y);
        for (z, row) in self.over_rows.iter_mut().zip(&self.rows) {
            *z = if row.is_elastic() { 0.0 } else { row.dual() };
            grown = grown.max(*z);
        }
        if grown < CERTIFICATE_GATE {
            return false;
        }
        let combined = &mut self.dx;
        combined.fill(0.0);
        program.add_rows_transposed(&self.over_rows, combined);
        program.equalities().add_transposed(&self.y, combined);
        // fixed unknowns contribute a constant to the combined row
        let all = dot(combined, &self.x);
        program.clear_fixed(combined);
        let constant = all - dot(combined, &self.x);
        let excess = constant
            - dot(program.bounds(), &self.over_rows)
            - dot(program.equalities().targets(), &self.y);
        excess > 0.0 && largest(combined) <= CERTIFICATE * excess
    }

    /// A direction x with Hx = 0, Gx ≤ 0, Ax = 0 and gᵀx + Σ ρ max(0, Gx) < 0 lowers the objective
    /// without end. Tested on the iterate itself once it has grown; to 1e-8 as above.
    fn proves_unbounded<P: Program>(&mut self, program: &P, measures: &Measures) -> bool {
        if measures.size < CERTIFICATE_GATE || measures.linear >= 0.0 {
            return false;
        }
        let limit = -CERTIFICATE * measures.linear;
        if largest(&self.hx) > limit {
            return false;
        }
        program.rows_times(&self.x, &mut self.over_rows);
        let mut price = 0.0;
        for (&rise, &weight) in self.over_rows.iter().zip(program.weights()) {
            if weight < f64::INFINITY {
                price += weight * rise.max(0.0);
            } else if rise > limit {
                return false;
            }
        }
        let equal = self
            .equality_residual
            .iter()
            .zip(program.equalities().targets())
            .all(|(r, c)| (r + c).abs() <= limit);
        equal && measures.linear + price < 0.0
    }

    /// Number of barrier terms, at least one so that it can be divided by.
    fn pairs(&self) -> f64 {
        self.rows.iter().map(Row::pairs).sum::<f64>().max(1.0)
    }

    fn factorise<P: Program>(&mut self, program: &P, factor: &mut P::Factor) {
        for (d, row) in self.over_rows.iter_mut().zip(&mut self.rows) {
            *d = row.condense();
        }
        program.factorise(&self.over_rows, factor);
        self.schur.factorise(program.equalities(), factor);
    }

    /// Solves for (dx, dy) and the rows' steps, whatever the rows aim at.
    fn newton_step<P: Program>(&mut self, program: &P, factor: &P::Factor) {
        for (q, row) in self.over_rows.iter_mut().zip(&self.rows) {
            *q = row.push();
        }
        self.dx.copy_from_slice(&self.stationarity);
        program.add_rows_transposed(&self.over_rows, &mut self.dx);
        self.dx.iter_mut().for_each(|v| *v = -*v);
        program.clear_fixed(&mut self.dx);
        self.dy.copy_from_slice(&self.equality_residual);
        self.schur.solve(factor, &mut self.dx, &mut self.dy);

        program.rows_times(&self.dx, &mut self.over_rows);
        for (row, &along) in self.rows.iter_mut().zip(&self.over_rows) {
            row.step(along);
        }
    }

    /// σ = (μ_aff/μ)³: the better the predictor does, the less the corrector keeps to the middle.
    fn centring(&self, mu: f64, reach: f64) -> f64 {
        if self.rows.is_empty() {
            return 0.0;
        }
        let after: f64 = self
            .rows
            .iter()
            .map(|r| r.complementarity_after(reach))
            .sum();
        (after / self.pairs() / mu).clamp(0.0, 1.0).powi(3)
    }

    fn longest_step(&self) -> f64 {
        self.rows
            .iter()
            .map(Row::longest_step)
            .fold(f64::INFINITY, f64::min)
    }

    fn step_is_finite(&self) -> bool {
        self.dx.iter().chain(&self.dy).all(|v| v.is_finite())
            && self.rows.iter().all(Row::step_is_finite)
    }

    fn advance(&mut self, alpha: f64) {
        add(alpha, &self.dx, &mut self.x);
        add(alpha, &self.dy, &mut self.y);
        self.rows.iter_mut().for_each(|row| row.advance(alpha));
    }
}

/// Fraction of the way to the boundary a step may always go. 0.995 makes one random problem in some
/// five thousand cycle without converging, 0.99 none of 120 000.
const CAUTIOUS_FRACTION: f64 = 0.99;
/// The same when the predictor reached at least as far: saves one iteration at the end.
const BOLD_FRACTION: f64 = 0.9999;
/// Spring stiffness of the rows in the first point; anything from 1e-4 to 10 costs within half an
/// iteration of this.
const START_STIFFNESS: f64 = 1.0;
/// Least distance from the rows' boundaries to start with (μ is its square), unless rows are
/// violated by more.
const START_DISTANCE: f64 = 1e-2;
/// The same for a start the caller gave: nearer, since that point is worth something.
const WARM_DISTANCE: f64 = 1e-3;
/// Relative accuracy asked of a proof of infeasibility or unboundedness.
const CERTIFICATE: f64 = 1e-8;
/// Size of multipliers, or of x, below which no such proof is looked for.
const CERTIFICATE_GATE: f64 = 1e4;

/// y ← y + αx.
fn add(alpha: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += alpha * x;
    }
}

/// ‖v‖∞; NaN if any entry is.
pub(crate) fn largest(v: &[f64]) -> f64 {
    let (chunks, rest) = v.as_chunks::<4>();
    let (mut most, mut sums) = ([0.0f64; 4], [0.0; 4]);
    for chunk in chunks {
        for i in 0..4 {
            most[i] = if chunk[i].abs() > most[i] {
                chunk[i].abs()
            } else {
                most[i]
            };
            // NaN compares false above, but stays in a sum
            sums[i] += chunk[i];
        }
    }
    let sum = sums.iter().chain(rest).sum::<f64>();
    let most = most.iter().chain(rest).fold(0.0f64, |m, x| m.max(x.abs()));
    if sum.is_nan() { sum } else { most }
}
