//! The few equality rows A x = c, met exactly through a small Schur complement.
//!
//! Each Newton step solves
//!
//! ```text
//!     [ K  Aᵀ ] [ dx ]   [ r ]          K = H + GᵀDG = L Lᵀ
//!     [ A  0  ] [ dy ] = [ −p ]
//! ```
//!
//! With V = L⁻¹Aᵀ: S = VᵀV = A K⁻¹ Aᵀ, S dy = Vᵀ(L⁻¹r) + p, dx = L⁻ᵀ(L⁻¹r − V dy). For E equalities
//! that is E forward substitutions and an E × E Cholesky factor on top of the banded one: at E = 6
//! about as much as the factorisation itself, and the rows may touch any unknowns without widening
//! the band.
//!
//! *Why not a large weight:* with 1e6 on the rows the answer misses them by 1e-6 times their
//! multiplier, K's condition number is multiplied by the weight, and the caller has to repair the
//! answer, which moves it off the optimum and off other rows. Here they hold to rounding.
//!
//! *Redundant rows* make S singular. Its diagonal is raised by the relative 1e-12, which is the
//! proximal method of multipliers: p is measured afresh at every iteration, so the limit is
//! unchanged, along dependent directions dy stays small, and one refinement removes its trace from
//! the others.

use crate::dense::cholesky;

/// Equalities whose columns of V are formed together: a triangular solve waits for its own results,
/// so that four cost little more than one.
pub(crate) const LANES: usize = 4;

/// The triangular solves with the factor L of K.
pub(crate) trait Triangular {
    /// v ← L⁻¹ v.
    fn forward(&self, v: &mut [f64]);
    /// V ← L⁻¹ V, where V is known to be zero before `first`.
    fn forward_block(&self, v: &mut [[f64; LANES]], first: usize);
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
    /// V in blocks of [`LANES`] columns, each block contiguous.
    reduced: Vec<[f64; LANES]>,
    /// Of each block, the unknown before which it is zero.
    starts: Vec<usize>,
    /// Cholesky factor of S with its diagonal raised.
    factor: Vec<f64>,
    /// By how much.
    raise: Vec<f64>,
    /// Scratch for the one refinement.
    correction: Vec<f64>,
}

impl SchurComplement {
    /// Relative raise of S's diagonal; far above its rounding (1e-15), far below what would slow
    /// convergence down.
    const RAISE: f64 = 1e-12;

    pub fn with_capacity(stride: usize, capacity: usize) -> Self {
        Self {
            stride,
            starts: vec![0; capacity.div_ceil(LANES)],
            reduced: vec![[0.0; LANES]; stride * capacity.div_ceil(LANES)],
            factor: vec![0.0; capacity * capacity],
            raise: vec![0.0; capacity],
            correction: vec![0.0; capacity],
        }
    }

    /// Forms V and the factor of S for the current L.
    pub fn factorise(&mut self, equalities: &Equalities, l: &impl Triangular) {
        let count = equalities.len();
        if count == 0 {
            return;
        }
        let blocks = count.div_ceil(LANES);
        for (block, v) in self
            .reduced
            .chunks_exact_mut(self.stride)
            .take(blocks)
            .enumerate()
        {
            v.fill([0.0; LANES]);
            let mut start = self.stride;
            for (lane, k) in (block * LANES..count.min((block + 1) * LANES)).enumerate() {
                let (first, row) = equalities.row(k);
                for (v, a) in v[first..].iter_mut().zip(row) {
                    v[lane] = *a;
                }
                start = start.min(first);
            }
            l.forward_block(v, start);
            self.starts[block] = start;
        }
        for i in 0..blocks {
            for j in 0..=i {
                let s = gram(
                    self.block(i),
                    self.block(j),
                    self.starts[i].max(self.starts[j]),
                );
                for (a, row) in s.iter().enumerate() {
                    for (b, &s) in row.iter().enumerate() {
                        let (k, l) = (i * LANES + a, j * LANES + b);
                        if k < count && l <= k {
                            self.factor[k * count + l] = s;
                        }
                    }
                }
            }
        }
        for k in 0..count {
            let diagonal = &mut self.factor[k * count + k];
            self.raise[k] = Self::RAISE * if *diagonal > 0.0 { *diagonal } else { 1.0 };
            *diagonal += self.raise[k];
        }
        cholesky::factorise(&mut self.factor[..count * count], count);
    }

    fn block(&self, i: usize) -> &[[f64; LANES]] {
        &self.reduced[i * self.stride..(i + 1) * self.stride]
    }

    /// On entry `dx` = r and `dy` = p; on return the step.
    pub fn solve(&mut self, l: &impl Triangular, dx: &mut [f64], dy: &mut [f64]) {
        let count = dy.len();
        l.forward(dx);
        if count > 0 {
            for (i, dy) in dy.chunks_mut(LANES).enumerate() {
                let mut sums = [0.0; LANES];
                for (v, dx) in self.block(i).iter().zip(dx.iter()).skip(self.starts[i]) {
                    for lane in 0..LANES {
                        sums[lane] += v[lane] * dx;
                    }
                }
                dy.iter_mut().zip(sums).for_each(|(dy, sum)| *dy += sum);
            }
            let factor = &self.factor[..count * count];
            cholesky::forward(factor, count, dy);
            cholesky::backward(factor, count, dy);
            // the raised S leaves the residual raise ∘ dy; one refinement takes it away
            let correction = &mut self.correction[..count];
            for ((c, raise), dy) in correction.iter_mut().zip(&self.raise).zip(dy.iter()) {
                *c = raise * dy;
            }
            cholesky::forward(factor, count, correction);
            cholesky::backward(factor, count, correction);
            dy.iter_mut().zip(correction).for_each(|(dy, c)| *dy += *c);
            for (i, dy) in dy.chunks(LANES).enumerate() {
                let mut factors = [0.0; LANES];
                factors[..dy.len()].copy_from_slice(dy);
                for (v, dx) in self.block(i).iter().zip(dx.iter_mut()).skip(self.starts[i]) {
                    let products = [0, 1, 2, 3].map(|lane: usize| v[lane] * factors[lane]);
                    *dx -= (products[0] + products[1]) + (products[2] + products[3]);
                }
            }
        }
        l.backward(dx);
    }
}

/// AᵀB from row `first` on.
fn gram(a: &[[f64; LANES]], b: &[[f64; LANES]], first: usize) -> [[f64; LANES]; LANES] {
    let mut sums = [[0.0; LANES]; LANES];
    for (a, b) in a.iter().zip(b).skip(first) {
        for (sums, a) in sums.iter_mut().zip(a) {
            for (sum, b) in sums.iter_mut().zip(b) {
                *sum += a * b;
            }
        }
    }
    sums
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
