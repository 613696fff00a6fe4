//! The numbers of a dense problem, and products with them.

use super::cholesky;
use crate::equalities::{Equalities, LANES, Triangular, dot};
use crate::interior_point::Program;
use crate::scaling::{NaturalLength, Scaling, power_of_two};

/// H and the general rows by rows, g, and the boxes. `bounds` and `weights` list the general rows
/// first and then, in `sides`, each finite side of a box as a row of its own with a coefficient of
/// ±1.
#[derive(Debug, Clone)]
pub(super) struct DenseData {
    pub unknowns: usize,
    pub hessian: Vec<f64>,
    pub gradient: Vec<f64>,
    pub rows: Vec<f64>,
    pub bounds: Vec<f64>,
    pub weights: Vec<f64>,
    pub sides: Vec<Side>,
    /// Where an unknown stands whose box has no width.
    pub fixed: Vec<Option<f64>>,
    pub equalities: Equalities,
}

/// sign · x_index ≤ bound.
#[derive(Debug, Clone, Copy)]
pub(super) struct Side {
    pub index: usize,
    pub sign: f64,
}

/// Raise of H's diagonal (which is of order one) inside the factorisation only: keeps K definite
/// where H is singular and rows leave a direction almost free. The residuals do not contain it,
/// so it slows convergence along such directions but moves no limit.
const PROXIMAL: f64 = 1e-12;
/// H may be this much less than semidefinite, which is its rounding.
const SEMIDEFINITE: f64 = 1e-10;

impl DenseData {
    pub fn with_capacity(unknowns: usize, rows: usize, equalities: usize) -> Self {
        Self {
            unknowns,
            hessian: vec![0.0; unknowns * unknowns],
            gradient: vec![0.0; unknowns],
            rows: Vec::with_capacity(rows * unknowns),
            bounds: Vec::with_capacity(rows + 2 * unknowns),
            weights: Vec::with_capacity(rows + 2 * unknowns),
            sides: Vec::with_capacity(2 * unknowns),
            fixed: vec![None; unknowns],
            equalities: Equalities::with_capacity(unknowns, equalities),
        }
    }

    /// Number of general rows.
    pub fn general(&self) -> usize {
        self.bounds.len() - self.sides.len()
    }

    pub fn clear_rows(&mut self) {
        self.rows.clear();
        self.bounds.clear();
        self.weights.clear();
        self.sides.clear();
        self.equalities.clear();
    }

    /// Lists the finite sides of the boxes behind the general rows.
    pub fn set_sides(&mut self, lower: &[f64], upper: &[f64]) {
        self.clear_sides();
        for (index, (&lower, &upper)) in lower.iter().zip(upper).enumerate() {
            self.fixed[index] = (lower == upper).then_some(lower);
            if lower == upper {
                continue;
            }
            for (sign, bound) in [(1.0, upper), (-1.0, -lower)] {
                if bound.is_finite() {
                    self.push_side(Side { index, sign }, bound);
                }
            }
        }
    }

    /// Removes the sides again, so that general rows can be added.
    pub fn clear_sides(&mut self) {
        let general = self.general();
        self.bounds.truncate(general);
        self.weights.truncate(general);
        self.sides.clear();
    }

    fn push_side(&mut self, side: Side, bound: f64) {
        self.sides.push(side);
        self.bounds.push(bound);
        self.weights.push(f64::INFINITY);
    }

    /// Writes this problem, scaled ([`crate::scaling`]), into `scaled`. Returns whether every
    /// number of it is finite and no diagonal entry of H negative.
    pub fn scale(&self, scaling: &mut Scaling, scaled: &mut Self) -> bool {
        let n = self.unknowns;
        scaled.clear_rows();
        for i in 0..n {
            let diagonal = self.hessian[i * n + i];
            if diagonal < 0.0 || diagonal.is_nan() {
                return false;
            }
            // an unknown without curvature takes its scale from the rows it is in
            scaling.unknowns[i] = 1.0
                / power_of_two(if diagonal > 0.0 {
                    diagonal.sqrt()
                } else {
                    self.rows
                        .iter()
                        .skip(i)
                        .step_by(n)
                        .fold(0.0f64, |m, a| m.max(a.abs()))
                });
        }
        let d = &scaling.unknowns;
        let mut length = NaturalLength::new();
        for i in 0..n {
            for j in 0..n {
                scaled.hessian[i * n + j] = self.hessian[i * n + j] * d[i] * d[j];
            }
            scaled.gradient[i] = self.gradient[i] * d[i];
            length.gradient(scaled.gradient[i]);
        }
        for (k, row) in self.rows.chunks_exact(n).enumerate() {
            let along = || row.iter().zip(d).map(|(a, d)| a * d);
            let norm = power_of_two(along().map(|a| a * a).sum::<f64>().sqrt());
            scaled.rows.extend(along().map(|a| a / norm));
            scaling.rows[k] = norm;
            let (bound, weight) = (self.bounds[k] / norm, self.weights[k] * norm);
            length.row(bound, weight);
            scaled.bounds.push(bound);
            scaled.weights.push(weight);
        }
        let general = self.general();
        for (k, side) in self.sides.iter().enumerate() {
            let norm = d[side.index];
            scaling.rows[general + k] = norm;
            let bound = self.bounds[general + k] / norm;
            length.row(bound, f64::INFINITY);
            scaled.push_side(*side, bound);
        }
        for k in 0..self.equalities.len() {
            let (first, row) = self.equalities.row(k);
            let along = || row.iter().zip(&d[first..]).map(|(a, d)| a * d);
            let norm = power_of_two(along().map(|a| a * a).sum::<f64>().sqrt());
            scaling.equalities[k] = norm;
            let target = self.equalities.target(k) / norm;
            length.equality(target);
            let entries = along().enumerate().map(|(i, a)| (first + i, a / norm));
            scaled.equalities.push(entries, target);
        }
        for ((fixed, given), d) in scaled.fixed.iter_mut().zip(&self.fixed).zip(d) {
            *fixed = given.map(|x| x / d);
            fixed.iter().for_each(|&x| length.equality(x));
        }
        scaling.length = length.get();
        let t = scaling.length;
        scaled.gradient.iter_mut().for_each(|g| *g /= t);
        scaled.bounds.iter_mut().for_each(|b| *b /= t);
        scaled.weights.iter_mut().for_each(|w| *w /= t);
        scaled.fixed.iter_mut().flatten().for_each(|x| *x /= t);
        scaled.equalities.divide_targets(t);
        scaled.is_finite()
    }

    fn is_finite(&self) -> bool {
        let numbers = self.hessian.iter().chain(&self.rows).chain(&self.gradient);
        numbers
            .chain(&self.bounds)
            .chain(self.fixed.iter().flatten())
            .all(|v| v.is_finite())
            && self.weights.iter().all(|w| *w > 0.0)
            && self.equalities.is_finite()
    }
}

/// L of K, with the fixed unknowns left out (their rows and columns are those of the unit matrix).
#[derive(Debug, Clone)]
pub(super) struct DenseFactor {
    unknowns: usize,
    lower: Vec<f64>,
    fixed: Vec<bool>,
}

impl DenseFactor {
    pub fn with_capacity(unknowns: usize) -> Self {
        Self {
            unknowns,
            lower: vec![0.0; unknowns * unknowns],
            fixed: vec![false; unknowns],
        }
    }

    /// Loads H with `raise` on the diagonal.
    fn load(&mut self, data: &DenseData, raise: f64) {
        let n = self.unknowns;
        self.lower.copy_from_slice(&data.hessian);
        for i in 0..n {
            self.lower[i * n + i] += raise;
            self.fixed[i] = data.fixed[i].is_some();
        }
    }

    fn factorise(&mut self) -> bool {
        let n = self.unknowns;
        for (i, _) in self.fixed.iter().enumerate().filter(|(_, fixed)| **fixed) {
            for j in 0..n {
                self.lower[i * n + j] = 0.0;
                self.lower[j * n + i] = 0.0;
            }
            self.lower[i * n + i] = 1.0;
        }
        cholesky::factorise(&mut self.lower, n)
    }
}

impl Triangular for DenseFactor {
    fn forward(&self, v: &mut [f64]) {
        for (v, fixed) in v.iter_mut().zip(&self.fixed) {
            if *fixed {
                *v = 0.0;
            }
        }
        cholesky::forward(&self.lower, self.unknowns, v);
    }

    fn forward_block(&self, v: &mut [[f64; LANES]], _: usize) {
        for (v, fixed) in v.iter_mut().zip(&self.fixed) {
            if *fixed {
                *v = [0.0; LANES];
            }
        }
        cholesky::forward_block(&self.lower, self.unknowns, v);
    }

    fn backward(&self, v: &mut [f64]) {
        cholesky::backward(&self.lower, self.unknowns, v);
    }
}

impl Program for DenseData {
    type Factor = DenseFactor;

    fn padded(&self) -> usize {
        self.unknowns
    }

    fn gradient(&self) -> &[f64] {
        &self.gradient
    }

    fn bounds(&self) -> &[f64] {
        &self.bounds
    }

    fn weights(&self) -> &[f64] {
        &self.weights
    }

    fn equalities(&self) -> &Equalities {
        &self.equalities
    }

    fn hessian_times(&self, x: &[f64], out: &mut [f64]) {
        for (out, row) in out.iter_mut().zip(self.hessian.chunks_exact(self.unknowns)) {
            *out = dot(row, x);
        }
    }

    fn rows_times(&self, x: &[f64], out: &mut [f64]) {
        let (general, sides) = out.split_at_mut(self.general());
        for (out, row) in general
            .iter_mut()
            .zip(self.rows.chunks_exact(self.unknowns))
        {
            *out = dot(row, x);
        }
        for (out, side) in sides.iter_mut().zip(&self.sides) {
            *out = side.sign * x[side.index];
        }
    }

    fn add_rows_transposed(&self, z: &[f64], out: &mut [f64]) {
        let (general, sides) = z.split_at(self.general());
        for (&z, row) in general.iter().zip(self.rows.chunks_exact(self.unknowns)) {
            for (out, a) in out.iter_mut().zip(row) {
                *out += a * z;
            }
        }
        for (z, side) in sides.iter().zip(&self.sides) {
            out[side.index] += side.sign * z;
        }
    }

    fn place_fixed(&self, x: &mut [f64]) {
        for (x, fixed) in x.iter_mut().zip(&self.fixed) {
            if let Some(at) = *fixed {
                *x = at;
            }
        }
    }

    fn clear_fixed(&self, v: &mut [f64]) {
        for (v, fixed) in v.iter_mut().zip(&self.fixed) {
            if fixed.is_some() {
                *v = 0.0;
            }
        }
    }

    fn is_convex(&self, factor: &mut DenseFactor) -> bool {
        factor.load(self, SEMIDEFINITE);
        factor.factorise()
    }

    fn factorise(&self, d: &[f64], factor: &mut DenseFactor) {
        let n = self.unknowns;
        factor.load(self, PROXIMAL);
        let (general, sides) = d.split_at(self.general());
        for (&d, row) in general.iter().zip(self.rows.chunks_exact(n)) {
            for (i, &a) in row.iter().enumerate() {
                // rows of a predicted state are zero beyond its own time
                if a != 0.0 {
                    let weighted = d * a;
                    let target = &mut factor.lower[i * n..=i * n + i];
                    for (k, a) in target.iter_mut().zip(row) {
                        *k += weighted * a;
                    }
                }
            }
        }
        for (d, side) in sides.iter().zip(&self.sides) {
            factor.lower[side.index * n + side.index] += d;
        }
        factor.factorise();
    }
}
