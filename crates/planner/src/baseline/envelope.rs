//! Cholesky factors of a sparse symmetric matrix within its envelope: per row, from the first entry to the diagonal.
//!
//! Elimination fills nothing outside the envelope, so rows numbered along the shorter side of a grid keep it as narrow as
//! that side. For the M-matrices of a Laplace equation (positive diagonal, nothing positive beside it, dominant) no
//! step but the forming of pivots subtracts, and pivots stay of the order of the diagonal. Solutions for a right-hand side
//! without negative entries are therefore accurate *relative to each unknown*, be it 1 or 1e-200, which no iteration
//! that watches a norm gives.

use crate::budget::Meter;

/// A symmetric positive definite matrix, then its factor, row by row.
#[derive(Debug)]
pub(crate) struct Envelope {
    /// Column of the first entry of each row.
    first: Vec<usize>,
    /// Where each row begins among the values, and where the last ends.
    begin: Vec<usize>,
    values: Vec<f64>,
}

impl Envelope {
    /// A matrix of zeros in which row `i` reaches from column `first[i]` ≤ i to the diagonal.
    pub fn new(first: Vec<usize>) -> Self {
        let mut begin = Vec::with_capacity(first.len() + 1);
        let mut length = 0;
        begin.push(length);
        for (i, column) in first.iter().enumerate() {
            length += i - column + 1;
            begin.push(length);
        }
        Self {
            first,
            begin,
            values: vec![0.0; length],
        }
    }

    /// The entry at `row` and `column` ≤ `row`, which must lie within the envelope.
    pub fn entry(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.values[self.begin[row] + column - self.first[row]]
    }

    /// Replaces the matrix by its factor L with L Lᵀ = A. `false` if the matrix is not positive definite, or the budget
    /// ended: each row is an iteration.
    pub fn factor(&mut self, meter: &mut Meter<'_>) -> bool {
        for i in 0..self.first.len() {
            if !meter.step() {
                return false;
            }
            let first = self.first[i];
            let (above, rest) = self.values.split_at_mut(self.begin[i]);
            let row = &mut rest[..=i - first];
            for j in first..i {
                let from = first.max(self.first[j]);
                let other = &above[self.begin[j]..self.begin[j + 1]];
                let overlap = &other[from - self.first[j]..j - self.first[j]];
                let sum = dot(&row[from - first..j - first], overlap);
                let pivot = other[other.len() - 1];
                row[j - first] = (row[j - first] - sum) / pivot;
            }
            let (diagonal, before) = match row.split_last_mut() {
                Some(parts) => parts,
                None => return false,
            };
            let pivot = *diagonal - dot(before, before);
            if pivot <= 0.0 || pivot.is_nan() {
                return false;
            }
            *diagonal = pivot.sqrt();
        }
        true
    }

    /// Solves A x = b in place, after [`Envelope::factor`].
    pub fn solve(&self, b: &mut [f64]) {
        for i in 0..self.first.len() {
            let row = &self.values[self.begin[i]..self.begin[i + 1]];
            let (pivot, before) = (row[row.len() - 1], &row[..row.len() - 1]);
            b[i] = (b[i] - dot(before, &b[self.first[i]..i])) / pivot;
        }
        for i in (0..self.first.len()).rev() {
            let row = &self.values[self.begin[i]..self.begin[i + 1]];
            let x = b[i] / row[row.len() - 1];
            b[i] = x;
            for (l, b) in row[..row.len() - 1].iter().zip(&mut b[self.first[i]..i]) {
                *b -= l * x;
            }
        }
    }
}

/// Sum of products, in four running sums: one alone would wait for each addition.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (fours_a, fours_b) = (a.chunks_exact(4), b.chunks_exact(4));
    let tail: f64 = fours_a
        .remainder()
        .iter()
        .zip(fours_b.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in fours_a.zip(fours_b) {
        for ((sum, x), y) in sums.iter_mut().zip(x).zip(y) {
            *sum += x * y;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + tail
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;

    /// −u'' on a line, absorbed at both ends, with u = 1 beyond the last.
    #[test]
    fn a_line_of_cells_has_the_straight_solution() {
        let n = 50;
        let mut matrix = Envelope::new((0..n).map(|i: usize| i.saturating_sub(1)).collect());
        for i in 0..n {
            *matrix.entry(i, i) = 2.0;
            if i > 0 {
                *matrix.entry(i, i - 1) = -1.0;
            }
        }
        assert!(matrix.factor(&mut Meter::new(&Budget::unlimited())));
        let mut u = vec![0.0; n];
        u[n - 1] = 1.0;
        matrix.solve(&mut u);
        for (i, u) in u.iter().enumerate() {
            let exact = (i + 1) as f64 / (n + 1) as f64;
            // Condition number 1e3 on rounding of 1e-16.
            assert!((u - exact).abs() < 1e-13, "{i}: {u}");
        }
    }

    /// 4 u_i = u_{i-1} + u_{i+1}: decays by 2 − √3 a cell, to 1e-171 over 300.
    #[test]
    fn tiny_values_keep_their_digits() {
        let n = 300;
        let mut matrix = Envelope::new((0..n).map(|i: usize| i.saturating_sub(1)).collect());
        for i in 0..n {
            *matrix.entry(i, i) = 4.0;
            if i > 0 {
                *matrix.entry(i, i - 1) = -1.0;
            }
        }
        assert!(matrix.factor(&mut Meter::new(&Budget::unlimited())));
        let mut u = vec![0.0; n];
        u[n - 1] = 1.0;
        matrix.solve(&mut u);
        // sinh((i + 1) a) / sinh((n + 1) a) with cosh a = 2; for small i the quotient is taken to the next cell.
        let a = 2f64.acosh();
        for i in [0usize, 1, 10, 200] {
            let exact = ((i + 2) as f64 * a).sinh() / ((i + 1) as f64 * a).sinh();
            assert!((u[i + 1] / u[i] / exact - 1.0).abs() < 1e-12, "{i}");
        }
        assert!(u[0] < 1e-169 && u[0] > 0.0);
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_is_refused() {
        let mut matrix = Envelope::new(vec![0, 0]);
        *matrix.entry(0, 0) = 1.0;
        *matrix.entry(1, 0) = 2.0;
        *matrix.entry(1, 1) = 1.0;
        assert!(!matrix.factor(&mut Meter::new(&Budget::unlimited())));
    }

    #[test]
    fn a_general_matrix_is_solved() {
        // A = M Mᵀ + I with a full envelope.
        let n = 9;
        let m = |i: usize, j: usize| ((i * 7 + j * 3) % 5) as f64 - 2.0;
        let entry = |i: usize, j: usize| {
            (0..n).map(|k| m(i, k) * m(j, k)).sum::<f64>() + if i == j { 1.0 } else { 0.0 }
        };
        let mut matrix = Envelope::new(vec![0; n]);
        for i in 0..n {
            for j in 0..=i {
                *matrix.entry(i, j) = entry(i, j);
            }
        }
        assert!(matrix.factor(&mut Meter::new(&Budget::unlimited())));
        let x: Vec<f64> = (0..n).map(|i| i as f64 - 3.5).collect();
        let mut b: Vec<f64> = (0..n)
            .map(|i| (0..n).map(|j| entry(i, j) * x[j]).sum())
            .collect();
        matrix.solve(&mut b);
        for (x, b) in x.iter().zip(&b) {
            // Condition number below 1e3.
            assert!((x - b).abs() < 1e-12, "{x} {b}");
        }
    }
}
