//! How a solve is asked for and how it ended.

/// When the interior point stops.
///
/// The tests are made on the scaled problem (see `scaling` in the source), where row norms and the
/// Hessian's diagonal are of order one. With ε_r = `residual_tolerance` and ε_g = `gap_tolerance`
/// it stops as [`Status::Solved`] when all three hold:
///
/// * stationarity: ‖Hx + g + Gᵀz + Aᵀy‖∞ ≤ ε_r (1 + max(‖Hx‖∞, ‖g‖∞)),
/// * feasibility: each row's |a·x + s − e − b| ≤ ε_r (1 + ‖x‖∞) (1 + |b|), and each equality's
///   |a·x − c| ≤ ε_r (1 + ‖x‖∞),
/// * complementarity: Σ (s z + e v) ≤ ε_g (1 + ½ xᵀHx + |gᵀx|). This sum *is* the duality gap of a
///   point that meets the other two. The price of violated elastic rows is left out on the right,
///   so that a hopeless row with a high price does not loosen the answer for `x`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// ε_r. The default 1e-9 is usually undercut by far: full Newton steps leave rounding only. At
    /// or below 1e-14 rounding wins and solves end in [`Status::MaxIterations`].
    pub residual_tolerance: f64,
    /// ε_g. By strong convexity ½ |x − x*|²_H ≤ gap, so that the *square root* of this is what can
    /// be relied on in x: the default 1e-12 is a relative 1e-6 in the norm of H. Each power of a
    /// hundred costs an iteration at most.
    pub gap_tolerance: f64,
    /// The most Newton iterations, each one factorisation and two solves. The default 60 is some
    /// five times what ordinary problems take.
    pub max_iterations: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            residual_tolerance: 1e-9,
            gap_tolerance: 1e-12,
            max_iterations: 60,
        }
    }
}

/// How a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Status {
    /// Optimal within the tolerance.
    Solved,
    /// The hard rows, boxes and equalities exclude each other: multipliers were found that prove it
    /// (Farkas). Elastic rows can never cause this.
    Infeasible,
    /// The objective falls without end along a direction that no row stops: only where the Hessian
    /// is singular.
    Unbounded,
    /// Out of iterations, or told to stop. The answer is the last iterate; its residuals tell what it is worth.
    MaxIterations,
    /// Arithmetic broke down. The answer is the last finite iterate.
    NumericalError(Breakdown),
}

/// Where arithmetic broke down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Breakdown {
    /// The Hessian is not positive definite (banded) or not positive semidefinite (dense).
    NotPositiveDefinite,
    /// The data, or a step, overflowed.
    NotFinite,
}

/// What a solve reports. All quantities are in the caller's units and are computed afresh from the
/// caller's data, not carried along by the iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// How it ended.
    pub status: Status,
    /// Newton iterations taken.
    pub iterations: u32,
    /// ½ xᵀHx + gᵀx + Σ ρ_k max(0, a_k·x − b_k) over the elastic rows.
    pub objective: f64,
    /// Largest violation of a hard row, a box side or an equality.
    pub primal_residual: f64,
    /// ‖Hx + g + Gᵀz + Aᵀy‖∞ over the unknowns that are free to move.
    pub dual_residual: f64,
    /// Objective minus the Lagrangian at (x, z, y), which is the dual objective where the dual
    /// residual vanishes.
    pub gap: f64,
}

impl Summary {
    /// Whether the answer is optimal within the tolerance.
    #[must_use]
    pub fn is_solved(&self) -> bool {
        self.status == Status::Solved
    }
}
