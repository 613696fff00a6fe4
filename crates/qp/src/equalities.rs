//! The few equality rows A x = c, met exactly through a small Schur complement.
//!
//! Each Newton step solves
//!
//! ```text
//!     [ K  Aᵀ ] [ dx ]   [ r ]          K = H + GᵀDG = L Lᵀ
//!     [ A  0  ] [ dy ] = [ −p ]
//! ```
//!
//! With V = L⁻¹Aᵀ: S = VᵀV = A K⁻¹ Aᵀ, S dy = Vᵀ(L⁻¹r) + p, dx = L⁻ᵀ(L⁻¹r − V dy). For E equalities that is
//! E forward substitutions and an E × E Cholesky factor on top of the banded one: at E = 6 about
//! as much as the factorisation itself, and the rows may touch any unknowns without widening
//! the band.
//!
//! *Why not a large weight:* with 1e6 on the rows the answer misses them by 1e-6 times their multiplier, K's
//! condition number is multiplied by the weight, and the caller has to repair the answer, which
//! moves it off the optimum and off other rows. Here they hold to rounding.
//!
//! *Redundant rows* make S singular. Its diagonal is raised by the relative 1e-12, which is the proximal method
//! of multipliers: p is measured afresh at every iteration, so the limit is unchanged, independent
//! directions converge by a factor of some 1e-12 per step, and along the dependent ones dy stays 0.

use crate::dense::cholesky;

/// The triangular solves with the factor L of K.
pub(crate) trait Triangular {
    /// v ← L⁻¹ v, where v is known to be zero before `first`.
    fn forward(&self, v: &mut [f64], first: usize);
    /// v ← L⁻ᵀ v.
    fn backward(&self, v: &mut [f64]);
}

/// Coefficients and right-hand sides, each row stored densely but worked on over its span only.
#[derive(Debug, Clone)]
pub(crate) struct Equalities {
    stride: usize,
    coefficients: Vec<f64>,
    spans: Vec<(usize, usize)>,
    targets: Vec<f64>,
}

impl Equalities {
    pub fn with_capacity(stride: usize, capacity: usize) -> Self {
        Self {
            stride,
            coefficients: Vec::with_capacity(stride * capacity),
            spans: Vec::with_capacity(capacity),
            targets: Vec::with_capacity(capacity),
        }
    }

    pub fn len(&self) -> usize {
        self.targets.len()
    }

    pub fn clear(&mut self) {
        self.coefficients.clear();
        self.spans.clear();
        self.targets.clear();
    }

    /// Adds the row Σ value·x_index = target; entries naming the same unknown add up.
    pub fn push(&mut self, entries: impl Iterator<Item = (usize, f64)>, target: f64) {
        let start = self.coefficients.len();
        self.coefficients.resize(start + self.stride, 0.0);
        let row = &mut self.coefficients[start..];
        let (mut first, mut end) = (self.stride, 0);
        for (index, value) in entries {
            row[index] += value;
            first = first.min(index);
            end = end.max(index + 1);
        }
        self.spans.push((first.min(end), end));
        self.targets.push(target);
    }

    /// Coefficients of row `k` over its span, and the span's first unknown.
    pub fn row(&self, k: usize) -> (usize, &[f64]) {
        let (first, end) = self.spans[k];
        let start = k * self.stride;
        (first, &self.coefficients[start + first..start + end])
    }

    pub fn target(&self, k: usize) -> f64 {
        self.targets[k]
    }

    pub fn targets(&self) -> &[f64] {
        &self.targets
    }

    /// Divides every target, once the common length of the problem is known.
    pub fn divide_targets(&mut self, by: f64) {
        self.targets.iter_mut().for_each(|c| *c /= by);
    }

    pub fn is_finite(&self) -> bool {
        self.coefficients
            .iter()
            .chain(&self.targets)
            .all(|v| v.is_finite())
    }

    /// out = A x − c.
    pub fn residual(&self, x: &[f64], out: &mut [f64]) {
        for (k, out) in out.iter_mut().enumerate().take(self.len()) {
            let (first, row) = self.row(k);
            *out = dot(row, &x[first..]) - self.targets[k];
        }
    }

    /// out += Aᵀ y.
    pub fn add_transposed(&self, y: &[f64], out: &mut [f64]) {
        for (k, &y) in y.iter().enumerate().take(self.len()) {
            let (first, row) = self.row(k);
            for (out, a) in out[first..].iter_mut().zip(row) {
                *out += a * y;
            }
        }
    }
}

/// Workspace of the Schur complement.
#[derive(Debug, Clone)]
pub(crate) struct SchurComplement {
    stride: usize,
    /// V, one column per equality, contiguous.
    reduced: Vec<f64>,
    /// Cholesky factor of S.
    factor: Vec<f64>,
}

impl SchurComplement {
    /// Relative raise of S's diagonal; far above its rounding (1e-15), far below what would slow
    /// convergence down.
    const RAISE: f64 = 1e-12;

    pub fn with_capacity(stride: usize, capacity: usize) -> Self {
        Self {
            stride,
            reduced: vec![0.0; stride * capacity],
            factor: vec![0.0; capacity * capacity],
        }
    }

    /// Forms V and the factor of S for the current L.
    pub fn factorise(&mut self, equalities: &Equalities, l: &impl Triangular) {
        let count = equalities.len();
        for k in 0..count {
            let v = &mut self.reduced[k * self.stride..(k + 1) * self.stride];
            v.fill(0.0);
            let (first, row) = equalities.row(k);
            v[first..first + row.len()].copy_from_slice(row);
            l.forward(v, first);
        }
        for i in 0..count {
            for j in 0..=i {
                // V is zero above the span of either row
                let start = equalities.row(i).0.max(equalities.row(j).0);
                let s = dot(&self.column(i)[start..], &self.column(j)[start..]);
                self.factor[i * count + j] = s;
            }
            let diagonal = &mut self.factor[i * count + i];
            *diagonal += if *diagonal > 0.0 {
                Self::RAISE * *diagonal
            } else {
                Self::RAISE
            };
        }
        cholesky::factorise(&mut self.factor[..count * count], count);
    }

    fn column(&self, k: usize) -> &[f64] {
        &self.reduced[k * self.stride..(k + 1) * self.stride]
    }

    /// On entry `dx` = r and `dy` = p; on return the step.
    pub fn solve(&self, l: &impl Triangular, dx: &mut [f64], dy: &mut [f64]) {
        let count = dy.len();
        l.forward(dx, 0);
        if count > 0 {
            for (k, dy) in dy.iter_mut().enumerate() {
                *dy += dot(self.column(k), dx);
            }
            let factor = &self.factor[..count * count];
            cholesky::forward(factor, count, dy);
            cholesky::backward(factor, count, dy);
            for (k, &dy) in dy.iter().enumerate() {
                for (dx, v) in dx.iter_mut().zip(self.column(k)) {
                    *dx -= v * dy;
                }
            }
        }
        l.backward(dx);
    }
}

/// Σ a_i b_i over the shorter of the two, in four independent sums: always the same order, and no
/// chain of dependent additions.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let length = a.len().min(b.len());
    let (a, b) = (a[..length].chunks_exact(4), b[..length].chunks_exact(4));
    let rest: f64 = a
        .remainder()
        .iter()
        .zip(b.remainder())
        .map(|(a, b)| a * b)
        .sum();
    let mut sums = [0.0; 4];
    for (a, b) in a.zip(b) {
        for i in 0..4 {
            sums[i] += a[i] * b[i];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}
