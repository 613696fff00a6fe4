//! The answer in the caller's units, and the report on it.

use crate::equalities::dot;
use crate::interior_point::{InteriorPoint, Program, largest};
use crate::outcome::{Breakdown, Status, Summary};
use crate::scaling::Scaling;

/// The answer of the last solve; sized once.
#[derive(Debug, Clone)]
pub(crate) struct Answer {
    /// Unknowns, padded.
    pub x: Vec<f64>,
    /// Multipliers of the rows.
    pub z: Vec<f64>,
    /// Multipliers of the equalities.
    pub y: Vec<f64>,
    /// Scratch over unknowns, rows and equalities.
    hx: Vec<f64>,
    stationarity: Vec<f64>,
    gx: Vec<f64>,
    residual: Vec<f64>,
}

impl Answer {
    pub fn with_capacity(padded: usize, rows: usize, equalities: usize) -> Self {
        Self {
            x: vec![0.0; padded],
            z: Vec::with_capacity(rows),
            y: Vec::with_capacity(equalities),
            hx: Vec::with_capacity(padded),
            stationarity: Vec::with_capacity(padded),
            gx: Vec::with_capacity(rows),
            residual: Vec::with_capacity(equalities),
        }
    }

    /// All zero, for a problem of these sizes (within the capacity).
    pub fn reset(&mut self, padded: usize, rows: usize, equalities: usize) {
        for (v, length) in [
            (&mut self.x, padded),
            (&mut self.hx, padded),
            (&mut self.stationarity, padded),
            (&mut self.z, rows),
            (&mut self.gx, rows),
            (&mut self.y, equalities),
            (&mut self.residual, equalities),
        ] {
            v.clear();
            v.resize(length, 0.0);
        }
    }

    /// H_ij x_j + g_i + Gᵀz + Aᵀy of one unknown in the last report, before fixed unknowns are left
    /// out: what a fixed unknown's own multiplier has to cancel.
    pub fn pull(&self, i: usize) -> f64 {
        self.stationarity[i]
    }

    /// Takes the iterate out of the scaled problem and reports on it, computed afresh from the
    /// caller's data. Whatever went wrong, no NaN leaves: an answer that is not finite becomes
    /// zero.
    pub fn take<P: Program>(
        &mut self,
        given: &P,
        solved: &InteriorPoint,
        scaling: &Scaling,
        ended: (Status, u32),
    ) -> Summary {
        let (mut status, iterations) = ended;
        self.reset(
            given.padded(),
            given.bounds().len(),
            given.equalities().len(),
        );
        let t = scaling.length;
        for ((x, scaled), d) in self.x.iter_mut().zip(&solved.x).zip(&scaling.unknowns) {
            *x = scaled * d * t;
        }
        for (k, (z, scaled)) in self.z.iter_mut().zip(solved.duals()).enumerate() {
            *z = scaling.multiplier(k, scaled);
        }
        for (k, (y, &scaled)) in self.y.iter_mut().zip(&solved.y).enumerate() {
            *y = scaling.equality_multiplier(k, scaled);
        }
        let answer = [&self.x, &self.z, &self.y];
        if !answer.into_iter().flatten().all(|v| v.is_finite()) {
            status = Status::NumericalError(Breakdown::NotFinite);
            for v in [&mut self.x, &mut self.z, &mut self.y] {
                v.fill(0.0);
            }
        }
        self.report(given, status, iterations)
    }

    /// Gives up before the first iteration.
    pub fn give_up<P: Program>(&mut self, given: &P, broken: Breakdown) -> Summary {
        self.reset(
            given.padded(),
            given.bounds().len(),
            given.equalities().len(),
        );
        self.report(given, Status::NumericalError(broken), 0)
    }

    fn report<P: Program>(&mut self, given: &P, status: Status, iterations: u32) -> Summary {
        let Self { x, z, y, .. } = self;
        given.hessian_times(x, &mut self.hx);
        let mut objective = 0.5 * dot(x, &self.hx) + dot(given.gradient(), x);
        for ((r, hx), g) in self
            .stationarity
            .iter_mut()
            .zip(&self.hx)
            .zip(given.gradient())
        {
            *r = hx + g;
        }
        given.add_rows_transposed(z, &mut self.stationarity);
        given.equalities().add_transposed(y, &mut self.stationarity);
        self.hx.copy_from_slice(&self.stationarity);
        given.clear_fixed(&mut self.hx);

        let (mut primal_residual, mut gap) = (0.0f64, 0.0);
        given.rows_times(x, &mut self.gx);
        let rows = self
            .gx
            .iter()
            .zip(given.bounds())
            .zip(given.weights())
            .zip(z.iter());
        for (((gx, b), &weight), z) in rows {
            let excess = gx - b;
            gap -= z * excess;
            if weight < f64::INFINITY {
                objective += weight * excess.max(0.0);
                gap += weight * excess.max(0.0);
            } else {
                primal_residual = primal_residual.max(excess);
            }
        }
        given.equalities().residual(x, &mut self.residual);
        gap -= dot(y, &self.residual);
        Summary {
            status,
            iterations,
            objective: number(objective),
            primal_residual: number(primal_residual.max(largest(&self.residual))),
            dual_residual: number(largest(&self.hx)),
            gap: number(gap),
        }
    }
}

/// A quantity that overflowed is infinite, never NaN.
pub(crate) fn number(x: f64) -> f64 {
    if x.is_nan() { f64::INFINITY } else { x }
}
