//! The numbers of a banded problem, and products with them.

use super::cholesky::BandedCholesky;
use crate::equalities::Equalities;
use crate::interior_point::Program;
use crate::scaling::{NaturalLength, Scaling, power_of_two};

/// H by columns of its lower band, g, the rows as windows of W coefficients, and the equalities.
/// Vectors of unknowns are W longer than the number of unknowns; see [`super::cholesky`].
#[derive(Debug, Clone)]
pub(super) struct BandedData<const W: usize> {
    pub unknowns: usize,
    pub hessian: Vec<[f64; W]>,
    pub gradient: Vec<f64>,
    pub first: Vec<usize>,
    pub coefficients: Vec<[f64; W]>,
    pub bounds: Vec<f64>,
    pub weights: Vec<f64>,
    pub equalities: Equalities,
}

impl<const W: usize> BandedData<W> {
    pub fn with_capacity(unknowns: usize, rows: usize, equalities: usize) -> Self {
        Self {
            unknowns,
            hessian: vec![[0.0; W]; unknowns + W],
            gradient: vec![0.0; unknowns + W],
            first: Vec::with_capacity(rows),
            coefficients: Vec::with_capacity(rows),
            bounds: Vec::with_capacity(rows),
            weights: Vec::with_capacity(rows),
            equalities: Equalities::with_capacity(unknowns + W, equalities),
        }
    }

    /// The empty problem of this size, within the capacity.
    pub fn reset(&mut self, unknowns: usize) {
        self.unknowns = unknowns;
        self.hessian.clear();
        self.hessian.resize(unknowns + W, [0.0; W]);
        self.gradient.clear();
        self.gradient.resize(unknowns + W, 0.0);
        self.clear_rows();
    }

    pub fn clear_rows(&mut self) {
        self.first.clear();
        self.coefficients.clear();
        self.bounds.clear();
        self.weights.clear();
        self.equalities.clear();
    }

    /// Writes this problem, scaled ([`crate::scaling`]), into `scaled`. Returns whether every
    /// number of it is finite and every diagonal entry of H positive.
    pub fn scale(&self, scaling: &mut Scaling, scaled: &mut Self) -> bool {
        let n = self.unknowns;
        scaled.reset(n);
        let d = &mut scaling.unknowns;
        for (d, column) in d.iter_mut().zip(&self.hessian[..n]) {
            if column[0] <= 0.0 || column[0].is_nan() {
                return false;
            }
            *d = 1.0 / power_of_two(column[0].sqrt());
        }
        let mut length = NaturalLength::new();
        for j in 0..n {
            for k in 0..W.min(n - j) {
                scaled.hessian[j][k] = self.hessian[j][k] * d[j] * d[j + k];
            }
            scaled.gradient[j] = self.gradient[j] * d[j];
            length.gradient(scaled.gradient[j]);
        }
        for (k, (&first, row)) in self.first.iter().zip(&self.coefficients).enumerate() {
            let mut a = [0.0; W];
            for ((a, row), d) in a.iter_mut().zip(row).zip(&d[first..n]) {
                *a = row * d;
            }
            let norm = power_of_two(a.iter().map(|a| a * a).sum::<f64>().sqrt());
            a.iter_mut().for_each(|a| *a /= norm);
            scaling.rows[k] = norm;
            let (bound, weight) = (self.bounds[k] / norm, self.weights[k] * norm);
            length.row(bound, weight);
            scaled.first.push(first);
            scaled.coefficients.push(a);
            scaled.bounds.push(bound);
            scaled.weights.push(weight);
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
        scaling.length = length.get();
        let t = scaling.length;
        scaled.gradient.iter_mut().for_each(|g| *g /= t);
        scaled.bounds.iter_mut().for_each(|b| *b /= t);
        scaled.weights.iter_mut().for_each(|w| *w /= t);
        scaled.equalities.divide_targets(t);
        scaled.is_finite()
    }

    fn is_finite(&self) -> bool {
        let numbers = self.hessian.iter().chain(&self.coefficients).flatten();
        numbers
            .chain(&self.gradient)
            .chain(&self.bounds)
            .all(|v| v.is_finite())
            && self.weights.iter().all(|w| *w > 0.0)
            && self.equalities.is_finite()
    }
}

impl<const W: usize> Program for BandedData<W> {
    type Factor = BandedCholesky<W>;

    fn padded(&self) -> usize {
        self.unknowns + W
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
        // what is still to be added to the next W entries of the result
        let mut ahead = [0.0; W];
        for (j, column) in self.hessian[..self.unknowns].iter().enumerate() {
            let x = &x[j..j + W];
            let mut sum = ahead[0];
            for k in 0..W {
                sum += column[k] * x[k];
            }
            out[j] = sum;
            for k in 1..W {
                ahead[k - 1] = ahead[k] + column[k] * x[0];
            }
            ahead[W - 1] = 0.0;
        }
    }

    fn rows_times(&self, x: &[f64], out: &mut [f64]) {
        for ((out, a), &first) in out.iter_mut().zip(&self.coefficients).zip(&self.first) {
            let x = &x[first..first + W];
            *out = 0.0;
            for k in 0..W {
                *out += a[k] * x[k];
            }
        }
    }

    fn add_rows_transposed(&self, z: &[f64], out: &mut [f64]) {
        for ((&z, a), &first) in z.iter().zip(&self.coefficients).zip(&self.first) {
            let out = &mut out[first..first + W];
            for k in 0..W {
                out[k] += a[k] * z;
            }
        }
    }

    fn place_fixed(&self, _: &mut [f64]) {}

    fn clear_fixed(&self, _: &mut [f64]) {}

    fn is_convex(&self, factor: &mut BandedCholesky<W>) -> bool {
        factor.load(&self.hessian, self.unknowns);
        factor.factorise()
    }

    fn factorise(&self, d: &[f64], factor: &mut BandedCholesky<W>) {
        let columns = factor.load(&self.hessian, self.unknowns);
        for ((&d, a), &first) in d.iter().zip(&self.coefficients).zip(&self.first) {
            let columns = &mut columns[first..first + W];
            for k in 0..W {
                let weighted = d * a[k];
                for i in 0..W - k {
                    columns[k][i] += weighted * a[k + i];
                }
            }
        }
        factor.factorise();
    }
}
