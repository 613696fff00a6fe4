//! Cholesky factorisation of a symmetric positive definite band, n·W² operations.
//!
//! Storage by columns of the lower triangle: column j holds A_jj, A_{j+1,j}, …, A_{j+W−1,j}. There
//! are W more columns of zeros than unknowns, so that no loop needs to know where the matrix ends
//! and all run over exactly W entries.

use crate::equalities::{LANES, Triangular};

/// Least pivot. H, with a diagonal of order one, is accepted only with pivots above it; adding
/// GᵀDG can only raise them, so that a smaller one in K is rounding and may be lifted to it.
pub(crate) const LEAST_PIVOT: f64 = 1e-14;

/// L of K = LLᵀ, kept as the reciprocals 1/L_jj of its diagonal and, in place of K, its columns
/// divided by L_jj. So the chain from one unknown to the next, which is what a triangular solve
/// waits for, is one product and one difference; the diagonal is applied in a sweep of its own.
#[derive(Debug, Clone)]
pub(crate) struct BandedCholesky<const W: usize> {
    unknowns: usize,
    columns: Vec<[f64; W]>,
    reciprocals: Vec<f64>,
}

impl<const W: usize> BandedCholesky<W> {
    pub fn with_capacity(unknowns: usize) -> Self {
        Self {
            unknowns,
            columns: vec![[0.0; W]; unknowns + W],
            reciprocals: vec![0.0; unknowns],
        }
    }

    /// The columns, to be filled with the lower band of a matrix of this size.
    pub fn load(&mut self, band: &[[f64; W]], unknowns: usize) -> &mut [[f64; W]] {
        self.unknowns = unknowns;
        let columns = &mut self.columns[..unknowns + W];
        columns.copy_from_slice(&band[..unknowns + W]);
        columns
    }

    /// Factorises in place, column by column, each updating the W − 1 that follow. Returns whether
    /// all pivots were above [`LEAST_PIVOT`]; those that were not are raised to it.
    pub fn factorise(&mut self) -> bool {
        let mut definite = true;
        for j in 0..self.unknowns {
            let (done, rest) = self.columns.split_at_mut(j + 1);
            let column = &mut done[j];
            let mut pivot = column[0];
            let positive = pivot > LEAST_PIVOT;
            if !positive {
                definite = false;
                pivot = LEAST_PIVOT;
            }
            let reciprocal = 1.0 / pivot;
            let unscaled = *column;
            for l in &mut column[1..] {
                *l *= reciprocal;
            }
            for k in 1..W {
                let target = &mut rest[k - 1];
                for i in 0..W - k {
                    target[i] -= unscaled[k] * column[k + i];
                }
            }
            self.reciprocals[j] = reciprocal.sqrt();
        }
        definite
    }
}

impl<const W: usize> BandedCholesky<W> {
    /// L⁻¹ on several right-hand sides at once, row by row: x_j = v_j − Σ_k L_{j,j−k} x_{j−k}, the
    /// youngest x last and out of a register, so that nothing else is waited for.
    fn forward_lanes<const L: usize>(&self, v: &mut [[f64; L]], first: usize) {
        let v = &mut v[..self.unknowns];
        let mut youngest = [0.0; L];
        for j in first..self.unknowns {
            let windows = (
                self.columns[..=j].last_chunk::<W>(),
                v[..=j].last_chunk::<W>(),
            );
            let mut x = v[j];
            if let (Some(columns), Some(solved)) = windows {
                for k in (2..W).rev() {
                    subtract(&mut x, columns[W - 1 - k][k], &solved[W - 1 - k]);
                }
            } else {
                for k in (2..=j).rev() {
                    subtract(&mut x, self.columns[j - k][k], &v[j - k]);
                }
            }
            if W > 1 && j > 0 {
                subtract(&mut x, self.columns[j - 1][1], &youngest);
            }
            v[j] = x;
            youngest = x;
        }
        for (v, scale) in v[first..].iter_mut().zip(&self.reciprocals[first..]) {
            *v = v.map(|v| v * scale);
        }
    }
}

/// x ← x − l y.
#[inline(always)]
fn subtract<const L: usize>(x: &mut [f64; L], l: f64, y: &[f64; L]) {
    for (x, y) in x.iter_mut().zip(y) {
        *x -= l * y;
    }
}

impl<const W: usize> Triangular for BandedCholesky<W> {
    fn forward(&self, v: &mut [f64]) {
        self.forward_lanes(v.as_chunks_mut::<1>().0, 0);
    }

    fn forward_block(&self, v: &mut [[f64; LANES]], first: usize) {
        self.forward_lanes(v, first);
    }

    fn backward(&self, v: &mut [f64]) {
        for (v, scale) in v.iter_mut().zip(&self.reciprocals[..self.unknowns]) {
            *v *= scale;
        }
        let mut youngest = 0.0;
        for (j, column) in self.columns[..self.unknowns].iter().enumerate().rev() {
            let window = &mut v[j..j + W];
            let mut x = window[0];
            for k in (2..W).rev() {
                x -= column[k] * window[k];
            }
            if W > 1 {
                x -= column[1] * youngest;
            }
            window[0] = x;
            youngest = x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn solving_undoes_multiplying(
            entries in proptest::collection::vec([-1.0..1.0f64, -1.0..1.0, -1.0..1.0, -1.0..1.0], 1..20),
            x in proptest::collection::vec(-5.0..5.0f64, 20),
        ) {
            let n = entries.len();
            // diagonally dominant, hence definite
            let mut band: Vec<[f64; 4]> = entries.iter().map(|e| [7.0 + e[0], e[1], e[2], e[3]]).collect();
            for (j, column) in band.iter_mut().enumerate() {
                for (k, entry) in column.iter_mut().enumerate().skip(1) {
                    if j + k >= n { *entry = 0.0; }
                }
            }
            band.resize(n + 4, [0.0; 4]);
            let mut v = vec![0.0; n + 4];
            for j in 0..n {
                for k in 0..4.min(n - j) {
                    v[j + k] += band[j][k] * x[j];
                    if k > 0 { v[j] += band[j][k] * x[j + k]; }
                }
            }
            let mut factor = BandedCholesky::with_capacity(n);
            factor.load(&band, n);
            prop_assert!(factor.factorise());
            factor.forward(&mut v);
            factor.backward(&mut v);
            for (v, x) in v.iter().zip(&x[..n]) {
                prop_assert!((v - x).abs() <= 1e-12);
            }
        }
    }

    #[test]
    fn an_indefinite_band_is_refused_and_its_factor_stays_finite() {
        let mut factor = BandedCholesky::<2>::with_capacity(2);
        factor.load(&[[1.0, 2.0], [1.0, 0.0], [0.0; 2], [0.0; 2]], 2);
        assert!(!factor.factorise());
        let mut v = [1.0, 1.0, 0.0, 0.0];
        factor.forward(&mut v);
        factor.backward(&mut v);
        assert!(v.iter().all(|v| v.is_finite()));
    }
}
