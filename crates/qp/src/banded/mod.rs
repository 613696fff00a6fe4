//! Quadratic programmes whose Hessian is a band and whose rows each touch a window of it.
//!
//! ```text
//!     minimise  ½ xᵀHx + gᵀx + Σ ρ_k e_k
//!     subject to  a_k·x ≤ b_k + e_k, e_k ≥ 0   (elastic rows)
//!                 a_k·x ≤ b_k                  (hard rows)
//!                 A x = c                      (a few equalities, on any unknowns)
//! ```
//!
//! H_ij = 0 unless |i − j| < W, and a_k touches at most W consecutive unknowns, so that GᵀDG keeps
//! the band and an iteration costs n·W² operations. A cubic spline in the plane, its control points
//! interleaved as x₀ y₀ x₁ y₁ …, has W = 8: a segment is decided by four control points.

mod cholesky;
mod data;

use self::cholesky::BandedCholesky;
use self::data::BandedData;
use crate::answer::Answer;
use crate::error::{QpError, finite, finite_values, positive_weight, room};
use crate::interior_point::InteriorPoint;
use crate::outcome::{Breakdown, Settings, Summary};
use crate::scaling::Scaling;

/// A banded problem together with everything its solution needs; made once, then refilled and
/// solved again without touching the heap.
///
/// ```
/// use bikebot_qp::{BandedQp, Settings};
///
/// // a chain x₀ … x₄ pulled straight between two ends, kept below 0.5 at cost
/// let mut qp = BandedQp::<2>::new(5, 8, 2);
/// for i in 0..4 {
///     qp.add_square(i, &[-1.0, 1.0], 0.0, 1.0)?;
/// }
/// qp.add_diagonal(1e-9)?;
/// qp.add_equality(&[(0, 1.0)], 0.0)?;
/// qp.add_equality(&[(4, 1.0)], 1.0)?;
/// qp.add_elastic_row(3, &[1.0], 0.5, 100.0)?;
/// let summary = qp.solve(&Settings::default());
/// assert!(summary.is_solved());
/// assert!((qp.x()[3] - 0.5).abs() < 1e-6 && (qp.x()[0]).abs() < 1e-12);
/// # Ok::<(), bikebot_qp::QpError>(())
/// ```
#[derive(Debug, Clone)]
pub struct BandedQp<const W: usize> {
    capacity: Capacity,
    given: BandedData<W>,
    scaled: BandedData<W>,
    scaling: Scaling,
    factor: BandedCholesky<W>,
    interior_point: InteriorPoint,
    answer: Answer,
    warm: bool,
}

/// What room was set aside for.
#[derive(Debug, Clone, Copy)]
struct Capacity {
    unknowns: usize,
    rows: usize,
    equalities: usize,
}

impl<const W: usize> BandedQp<W> {
    /// Room for problems of up to `unknowns` unknowns, `rows` inequality rows and `equalities`
    /// equality rows; holds the empty problem (H = 0) of `unknowns` unknowns. A window of W = 0
    /// does not compile; no unknowns at all are taken as one.
    #[must_use]
    pub fn new(unknowns: usize, rows: usize, equalities: usize) -> Self {
        const { assert!(W > 0, "the window holds at least the diagonal") }
        let unknowns = unknowns.max(1);
        Self {
            capacity: Capacity {
                unknowns,
                rows,
                equalities,
            },
            given: BandedData::with_capacity(unknowns, rows, equalities),
            scaled: BandedData::with_capacity(unknowns, rows, equalities),
            scaling: Scaling::with_capacity(unknowns, rows, equalities),
            factor: BandedCholesky::with_capacity(unknowns),
            interior_point: InteriorPoint::with_capacity(unknowns + W, rows, equalities),
            answer: Answer::with_capacity(unknowns + W, rows, equalities),
            warm: false,
        }
    }

    /// Number of unknowns of the problem held.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.given.unknowns
    }

    /// Number of inequality rows of the problem held.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.given.bounds.len()
    }

    /// Starts over with the empty problem of `unknowns` unknowns: H = 0, g = 0, no rows.
    pub fn reset(&mut self, unknowns: usize) -> Result<(), QpError> {
        if unknowns == 0 {
            return Err(QpError::NoUnknowns);
        }
        room("unknowns", unknowns - 1, self.capacity.unknowns)?;
        self.given.reset(unknowns);
        self.answer.reset(unknowns + W, 0, 0);
        self.warm = false;
        Ok(())
    }

    /// Removes all rows and equalities; the objective stays.
    pub fn clear_rows(&mut self) {
        self.given.clear_rows();
    }

    /// H_ij += `value`, and H_ji with it. Needs |i − j| < W.
    pub fn add_hessian(&mut self, i: usize, j: usize, value: f64) -> Result<(), QpError> {
        let value = finite("a Hessian entry", value)?;
        self.index(i)?;
        self.index(j)?;
        let (low, apart) = (i.min(j), i.abs_diff(j));
        if apart >= W {
            return Err(QpError::OutsideBand {
                row: i,
                column: j,
                window: W,
            });
        }
        self.given.hessian[low][apart] += value;
        Ok(())
    }

    /// H_ii += `value` for every i: the proximal term ½ `value` |x|².
    pub fn add_diagonal(&mut self, value: f64) -> Result<(), QpError> {
        let value = finite("a Hessian entry", value)?;
        let n = self.given.unknowns;
        self.given.hessian[..n]
            .iter_mut()
            .for_each(|c| c[0] += value);
        Ok(())
    }

    /// g_i += `value`.
    pub fn add_gradient(&mut self, i: usize, value: f64) -> Result<(), QpError> {
        let value = finite("a gradient entry", value)?;
        self.index(i)?;
        self.given.gradient[i] += value;
        Ok(())
    }

    /// Adds ½ `weight` (a·x − `target`)² to the objective, less its constant, with a on the
    /// unknowns from `first` on. A negative weight is allowed as long as the sum stays convex.
    pub fn add_square(
        &mut self,
        first: usize,
        a: &[f64],
        target: f64,
        weight: f64,
    ) -> Result<(), QpError> {
        self.window(first, a)?;
        finite("a target", target)?;
        finite("a weight", weight)?;
        for (k, &ak) in a.iter().enumerate() {
            let column = &mut self.given.hessian[first + k];
            for (entry, ai) in column.iter_mut().zip(&a[k..]) {
                *entry += weight * ak * ai;
            }
            self.given.gradient[first + k] -= weight * target * ak;
        }
        Ok(())
    }

    /// Adds the hard row a·x ≤ `bound` on the unknowns from `first` on; returns its index.
    pub fn add_row(&mut self, first: usize, a: &[f64], bound: f64) -> Result<usize, QpError> {
        self.push_row(first, a, bound, f64::INFINITY)
    }

    /// Adds the elastic row a·x ≤ `bound` + e at the price `weight`·e; returns its index.
    pub fn add_elastic_row(
        &mut self,
        first: usize,
        a: &[f64],
        bound: f64,
        weight: f64,
    ) -> Result<usize, QpError> {
        self.push_row(first, a, bound, positive_weight(weight)?)
    }

    /// Adds the equality Σ value·x_index = `target`, on any unknowns; returns its index. Entries
    /// naming the same unknown add up.
    pub fn add_equality(
        &mut self,
        entries: &[(usize, f64)],
        target: f64,
    ) -> Result<usize, QpError> {
        let index = self.given.equalities.len();
        room("equality rows", index, self.capacity.equalities)?;
        finite("an equality's right-hand side", target)?;
        for &(i, value) in entries {
            self.index(i)?;
            finite("an equality's coefficient", value)?;
        }
        self.given.equalities.push(entries.iter().copied(), target);
        Ok(index)
    }

    /// Lets the next solve start at `x` instead of at a point of its own choice: worthwhile where
    /// `x` nearly meets the rows, as the previous curve does in a sequence of programmes.
    pub fn start_from(&mut self, x: &[f64]) -> Result<(), QpError> {
        let n = self.given.unknowns;
        finite_values("the starting point", x, n)?;
        self.answer.x[..n].copy_from_slice(x);
        self.warm = true;
        Ok(())
    }

    /// Minimises. Deterministic to the last bit; takes no memory.
    pub fn solve(&mut self, settings: &Settings) -> Summary {
        self.solve_while(settings, &|| true)
    }

    /// [`BandedQp::solve`], as long as `go_on` says so: it is asked before every iteration, and an answer of `false` ends the solve as if
    /// that many iterations were all that is allowed.
    pub fn solve_while(&mut self, settings: &Settings, go_on: &dyn Fn() -> bool) -> Summary {
        let n = self.given.unknowns;
        let warm = std::mem::take(&mut self.warm);
        if !self.given.scale(&mut self.scaling, &mut self.scaled) {
            let curved = self.given.hessian[..n].iter().all(|c| c[0] > 0.0);
            let broken = if curved {
                Breakdown::NotFinite
            } else {
                Breakdown::NotPositiveDefinite
            };
            return self.answer.give_up(&self.given, broken);
        }
        self.interior_point.resize(&self.scaled);
        if warm {
            let t = self.scaling.length;
            let start = self.answer.x[..n].iter().zip(&self.scaling.unknowns);
            for (x, (given, d)) in self.interior_point.x.iter_mut().zip(start) {
                *x = given / d / t;
            }
        }
        let ended =
            self.interior_point
                .solve(&self.scaled, &mut self.factor, settings, warm, go_on);
        self.answer
            .take(&self.given, &self.interior_point, &self.scaling, ended)
    }

    /// The minimiser found by the last solve.
    #[must_use]
    pub fn x(&self) -> &[f64] {
        &self.answer.x[..self.given.unknowns]
    }

    /// Multiplier z of every inequality row, in [0, ρ] for elastic ones.
    #[must_use]
    pub fn multipliers(&self) -> &[f64] {
        &self.answer.z
    }

    /// Multiplier y of every equality; its sign is that of Hx + g + Gᵀz + Aᵀy = 0.
    #[must_use]
    pub fn equality_multipliers(&self) -> &[f64] {
        &self.answer.y
    }

    fn push_row(
        &mut self,
        first: usize,
        a: &[f64],
        bound: f64,
        weight: f64,
    ) -> Result<usize, QpError> {
        let index = self.given.bounds.len();
        room("rows", index, self.capacity.rows)?;
        self.window(first, a)?;
        finite("a row's bound", bound)?;
        let mut coefficients = [0.0; W];
        coefficients[..a.len()].copy_from_slice(a);
        self.given.first.push(first);
        self.given.coefficients.push(coefficients);
        self.given.bounds.push(bound);
        self.given.weights.push(weight);
        Ok(index)
    }

    fn index(&self, index: usize) -> Result<(), QpError> {
        let unknowns = self.given.unknowns;
        if index < unknowns {
            Ok(())
        } else {
            Err(QpError::IndexOutOfRange { index, unknowns })
        }
    }

    fn window(&self, first: usize, a: &[f64]) -> Result<(), QpError> {
        let unknowns = self.given.unknowns;
        let fits = a.len() <= W && first < unknowns && a.len() <= unknowns - first;
        if !fits {
            return Err(QpError::WindowOutOfRange {
                first,
                length: a.len(),
                window: W,
                unknowns,
            });
        }
        finite_values("a row", a, a.len())
    }
}
