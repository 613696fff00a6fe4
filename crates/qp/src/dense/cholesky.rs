//! Cholesky factorisation of a small symmetric matrix, row by row, in place.
//!
//! Row-major, lower triangle; on return L with the reciprocals of its diagonal in place of the
//! diagonal. What lies above the diagonal is neither read nor written.

use crate::equalities::dot;

/// A pivot below this part of its diagonal entry is rounding, and is raised to it.
const LEAST_PIVOT: f64 = 1e-15;

/// Factorises the n × n matrix `a`. Returns whether every pivot was positive beyond rounding.
pub(crate) fn factorise(a: &mut [f64], n: usize) -> bool {
    let mut definite = true;
    for i in 0..n {
        let (above, rest) = a.split_at_mut(i * n);
        let row = &mut rest[..n];
        for j in 0..i {
            let other = &above[j * n..j * n + j + 1];
            row[j] = (row[j] - dot(&row[..j], &other[..j])) * other[j];
        }
        let mut pivot = row[i] - dot(&row[..i], &row[..i]);
        let least = LEAST_PIVOT * row[i].abs();
        let positive = pivot > least;
        if !positive {
            definite = false;
            pivot = least;
        }
        row[i] = 1.0 / pivot.sqrt();
    }
    definite
}

/// v ← L⁻¹ v.
pub(crate) fn forward(l: &[f64], n: usize, v: &mut [f64]) {
    for i in 0..n {
        let row = &l[i * n..i * n + i + 1];
        v[i] = (v[i] - dot(&row[..i], &v[..i])) * row[i];
    }
}

/// v ← L⁻¹ v for several right-hand sides at once.
pub(crate) fn forward_block<const L: usize>(l: &[f64], n: usize, v: &mut [[f64; L]]) {
    for i in 0..n {
        let row = &l[i * n..i * n + i + 1];
        let mut sum = v[i];
        for (v, l) in v[..i].iter().zip(row) {
            for lane in 0..L {
                sum[lane] -= l * v[lane];
            }
        }
        v[i] = sum.map(|v| v * row[i]);
    }
}

/// v ← L⁻ᵀ v.
pub(crate) fn backward(l: &[f64], n: usize, v: &mut [f64]) {
    for i in (0..n).rev() {
        let row = &l[i * n..i * n + i + 1];
        let x = v[i] * row[i];
        v[i] = x;
        for (v, l) in v[..i].iter_mut().zip(row) {
            *v -= l * x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factor_of_a_textbook_matrix() {
        // [[4,12,-16],[12,37,-43],[-16,-43,98]] = LLᵀ, L = [[2],[6,1],[-8,5,3]]
        let mut a = [4.0, 0.0, 0.0, 12.0, 37.0, 0.0, -16.0, -43.0, 98.0];
        assert!(factorise(&mut a, 3));
        assert_eq!(a, [0.5, 0.0, 0.0, 6.0, 1.0, 0.0, -8.0, 5.0, 1.0 / 3.0]);
        let mut v = [4.0, 13.0, -11.0]; // A (1, 0, 0) + (0, 1, 5)
        let b = v;
        forward(&a, 3, &mut v);
        backward(&a, 3, &mut v);
        let product = [
            4.0 * v[0] + 12.0 * v[1] - 16.0 * v[2],
            12.0 * v[0] + 37.0 * v[1] - 43.0 * v[2],
            -16.0 * v[0] - 43.0 * v[1] + 98.0 * v[2],
        ];
        for (p, b) in product.iter().zip(&b) {
            assert!((p - b).abs() < 1e-10);
        }
    }

    #[test]
    fn an_indefinite_matrix_is_reported() {
        let mut a = [1.0, 0.0, 2.0, 1.0];
        assert!(!factorise(&mut a, 2));
    }
}
