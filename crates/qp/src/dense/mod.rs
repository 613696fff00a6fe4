//! Small dense quadratic programmes with boxes, general rows and equalities.
//!
//! ```text
//!     minimise  ½ xᵀHx + gᵀx + Σ ρ_k e_k
//!     subject to  l ≤ x ≤ u                    (boxes, sides may be infinite)
//!                 a_k·x ≤ b_k + e_k, e_k ≥ 0   (elastic rows)
//!                 a_k·x ≤ b_k                  (hard rows)
//!                 A x = c                      (equalities)
//! ```
//!
//! H is symmetric positive semidefinite; where it is singular the rows should hold x, or the solve
//! ends as [`Status::Unbounded`](crate::Status::Unbounded) if the objective falls that way, and in
//! *a* minimiser if it does not. A box of no width takes its unknown out of the problem: such a
//! pair of rows has no interior for an interior point to be in.

pub(crate) mod cholesky;
mod data;

use self::data::{DenseData, DenseFactor};
use crate::answer::{Answer, number};
use crate::error::{QpError, finite, finite_values, positive_weight, room};
use crate::interior_point::InteriorPoint;
use crate::outcome::{Breakdown, Settings, Summary};
use crate::scaling::Scaling;

/// A dense problem together with everything its solution needs; made once, then refilled and
/// solved again without touching the heap.
///
/// ```
/// use bikebot_qp::{DenseQp, Settings};
///
/// // the point of the line x₀ + x₁ = 1 nearest to (2, 1) with x₀ ≤ 0.75
/// let mut qp = DenseQp::new(2, 0, 1);
/// qp.set_hessian(&[1.0, 0.0, 0.0, 1.0])?;
/// qp.set_gradient(&[-2.0, -1.0])?;
/// qp.set_box(0, f64::NEG_INFINITY, 0.75)?;
/// qp.add_equality(&[1.0, 1.0], 1.0)?;
/// assert!(qp.solve(&Settings::default()).is_solved());
/// assert!((qp.x()[0] - 0.75).abs() < 1e-9 && (qp.x()[1] - 0.25).abs() < 1e-9);
/// # Ok::<(), bikebot_qp::QpError>(())
/// ```
#[derive(Debug, Clone)]
pub struct DenseQp {
    capacity: Capacity,
    lower: Vec<f64>,
    upper: Vec<f64>,
    given: DenseData,
    scaled: DenseData,
    scaling: Scaling,
    factor: DenseFactor,
    interior_point: InteriorPoint,
    answer: Answer,
    box_multipliers: Vec<f64>,
    warm: bool,
}

/// What room was set aside for.
#[derive(Debug, Clone, Copy)]
struct Capacity {
    rows: usize,
    equalities: usize,
}

impl DenseQp {
    /// The empty problem (H = 0, g = 0, no boxes) of `unknowns` unknowns, at least one, with room
    /// for `rows` inequality rows and `equalities` equality rows.
    #[must_use]
    pub fn new(unknowns: usize, rows: usize, equalities: usize) -> Self {
        let n = unknowns.max(1);
        let all = rows + 2 * n;
        Self {
            capacity: Capacity { rows, equalities },
            lower: vec![f64::NEG_INFINITY; n],
            upper: vec![f64::INFINITY; n],
            given: DenseData::with_capacity(n, rows, equalities),
            scaled: DenseData::with_capacity(n, rows, equalities),
            scaling: Scaling::with_capacity(n, all, equalities),
            factor: DenseFactor::with_capacity(n),
            interior_point: InteriorPoint::with_capacity(n, all, equalities),
            answer: Answer::with_capacity(n, all, equalities),
            box_multipliers: vec![0.0; n],
            warm: false,
        }
    }

    /// Number of unknowns.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.given.unknowns
    }

    /// Number of inequality rows of the problem held, boxes not counted.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.given.general()
    }

    /// Sets H, row by row; n² values, symmetric to 1e-9 of the larger of the two diagonal entries
    /// concerned. What asymmetry there is, is averaged away.
    pub fn set_hessian(&mut self, h: &[f64]) -> Result<(), QpError> {
        let n = self.given.unknowns;
        finite_values("the Hessian", h, n * n)?;
        for i in 0..n {
            for j in 0..i {
                let by = h[i * n + j] - h[j * n + i];
                if by.abs() > 1e-9 * h[i * n + i].abs().max(h[j * n + j].abs()) {
                    return Err(QpError::NotSymmetric {
                        row: i,
                        column: j,
                        by,
                    });
                }
            }
        }
        for i in 0..n {
            for j in 0..n {
                self.given.hessian[i * n + j] = 0.5 * h[i * n + j] + 0.5 * h[j * n + i];
            }
        }
        Ok(())
    }

    /// Sets g.
    pub fn set_gradient(&mut self, g: &[f64]) -> Result<(), QpError> {
        finite_values("the gradient", g, self.given.unknowns)?;
        self.given.gradient.copy_from_slice(g);
        Ok(())
    }

    /// Sets the box of unknown `i`; sides may be infinite, and equal.
    pub fn set_box(&mut self, i: usize, lower: f64, upper: f64) -> Result<(), QpError> {
        if i >= self.given.unknowns {
            return Err(QpError::IndexOutOfRange {
                index: i,
                unknowns: self.given.unknowns,
            });
        }
        let holds_a_number = lower <= upper && lower < f64::INFINITY && upper > f64::NEG_INFINITY;
        if !holds_a_number {
            return Err(QpError::EmptyBox {
                index: i,
                lower,
                upper,
            });
        }
        self.lower[i] = lower;
        self.upper[i] = upper;
        Ok(())
    }

    /// Adds the hard row a·x ≤ `bound`; returns its index.
    pub fn add_row(&mut self, a: &[f64], bound: f64) -> Result<usize, QpError> {
        self.push_row(a, bound, f64::INFINITY)
    }

    /// Adds the elastic row a·x ≤ `bound` + e at the price `weight`·e; returns its index.
    pub fn add_elastic_row(
        &mut self,
        a: &[f64],
        bound: f64,
        weight: f64,
    ) -> Result<usize, QpError> {
        self.push_row(a, bound, positive_weight(weight)?)
    }

    /// Adds the equality a·x = `target`; returns its index.
    pub fn add_equality(&mut self, a: &[f64], target: f64) -> Result<usize, QpError> {
        let index = self.given.equalities.len();
        room("equality rows", index, self.capacity.equalities)?;
        finite_values("an equality", a, self.given.unknowns)?;
        finite("an equality's right-hand side", target)?;
        let entries = a.iter().copied().enumerate().filter(|(_, a)| *a != 0.0);
        self.given.equalities.push(entries, target);
        Ok(index)
    }

    /// Moves the bound of row `k`, whose coefficients stay: all that changes from tick to tick in
    /// linear predictive control.
    pub fn set_bound(&mut self, k: usize, bound: f64) -> Result<(), QpError> {
        finite("a row's bound", bound)?;
        if k >= self.rows() {
            return Err(QpError::NoSuchRow {
                index: k,
                rows: self.rows(),
            });
        }
        self.given.bounds[k] = bound;
        Ok(())
    }

    /// Removes all rows and equalities; objective and boxes stay.
    pub fn clear_rows(&mut self) {
        self.given.clear_rows();
    }

    /// Lets the next solve start at `x` instead of at a point of its own choice.
    pub fn start_from(&mut self, x: &[f64]) -> Result<(), QpError> {
        finite_values("the starting point", x, self.given.unknowns)?;
        self.answer.x.copy_from_slice(x);
        self.warm = true;
        Ok(())
    }

    /// Minimises. Deterministic to the last bit; takes no memory.
    pub fn solve(&mut self, settings: &Settings) -> Summary {
        let warm = std::mem::take(&mut self.warm);
        self.given.set_sides(&self.lower, &self.upper);
        let summary = self.solve_with_sides(settings, warm);
        self.collect_box_multipliers();
        self.given.clear_sides();
        summary
    }

    /// The minimiser found by the last solve.
    #[must_use]
    pub fn x(&self) -> &[f64] {
        &self.answer.x
    }

    /// Multiplier z of every inequality row, in [0, ρ] for elastic ones.
    #[must_use]
    pub fn multipliers(&self) -> &[f64] {
        let general = self.answer.z.len().min(self.rows());
        &self.answer.z[..general]
    }

    /// Multiplier of every box: positive where the upper side holds x back, negative at the lower
    /// side; of whatever sign where the box has no width, and infinite where it overflows.
    #[must_use]
    pub fn box_multipliers(&self) -> &[f64] {
        &self.box_multipliers
    }

    /// Multiplier y of every equality; its sign is that of Hx + g + Gᵀz + Aᵀy = 0.
    #[must_use]
    pub fn equality_multipliers(&self) -> &[f64] {
        &self.answer.y
    }

    fn solve_with_sides(&mut self, settings: &Settings, warm: bool) -> Summary {
        let n = self.given.unknowns;
        if !self.given.scale(&mut self.scaling, &mut self.scaled) {
            let negative = (0..n).any(|i| self.given.hessian[i * n + i] < 0.0);
            let broken = if negative {
                Breakdown::NotPositiveDefinite
            } else {
                Breakdown::NotFinite
            };
            return self.answer.give_up(&self.given, broken);
        }
        self.interior_point.resize(&self.scaled);
        if warm {
            let t = self.scaling.length;
            let start = self.answer.x.iter().zip(&self.scaling.unknowns);
            for (x, (given, d)) in self.interior_point.x.iter_mut().zip(start) {
                *x = given / d / t;
            }
        }
        let ended =
            self.interior_point
                .solve(&self.scaled, &mut self.factor, settings, warm, &|| true);
        self.answer
            .take(&self.given, &self.interior_point, &self.scaling, ended)
    }

    fn collect_box_multipliers(&mut self) {
        for (i, (multiplier, fixed)) in self
            .box_multipliers
            .iter_mut()
            .zip(&self.given.fixed)
            .enumerate()
        {
            *multiplier = if fixed.is_some() {
                number(-self.answer.pull(i))
            } else {
                0.0
            };
        }
        let sides = &self.answer.z[self.given.general()..];
        for (z, side) in sides.iter().zip(&self.given.sides) {
            self.box_multipliers[side.index] += side.sign * z;
        }
    }

    fn push_row(&mut self, a: &[f64], bound: f64, weight: f64) -> Result<usize, QpError> {
        let index = self.rows();
        room("rows", index, self.capacity.rows)?;
        finite_values("a row", a, self.given.unknowns)?;
        finite("a row's bound", bound)?;
        self.given.rows.extend_from_slice(a);
        self.given.bounds.push(bound);
        self.given.weights.push(weight);
        Ok(index)
    }
}
