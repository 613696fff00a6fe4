//! Linear-quadratic feedback for the roll model, upright.
//!
//! The continuous algebraic Riccati equation is solved through the matrix sign function of
//! its Hamiltonian: `Z <- (Z/c + c Z^-1)/2` converges quadratically to `sign(H)`, whose
//! eigenvalue `-1` marks the stable subspace `[I; P]`. The result serves as the answer of
//! last resort where the decoupling term of [`crate::output_zeroing`] nearly vanishes, and as
//! a law of its own.

use nalgebra::{Matrix4, SMatrix, Vector4};

use bikebot_dynamics::{Linearisation, TwoLink};

use crate::error::ControlError;

/// Weights of the quadratic cost on `(alpha, beta, alpha', beta')` and on the torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Diagonal of `Q`.
    pub state: Vector4<f64>,
    /// `R`.
    pub torque: f64,
}

/// The stabilising feedback `tau = -k . x` of least quadratic cost.
///
/// # Errors
///
/// [`ControlError::NoStabilisingGain`] when the equation has no stabilising solution.
pub fn gain(model: &TwoLink, weights: &Weights) -> Result<Vector4<f64>, ControlError> {
    let Linearisation { a, b } = model.linearisation();
    let q = Matrix4::from_diagonal(&weights.state);
    let s = b * b.transpose() / weights.torque;
    let p = riccati(&a, &s, &q).ok_or(ControlError::NoStabilisingGain {
        residual: f64::INFINITY,
    })?;
    let residual = (a.transpose() * p + p * a - p * s * p + q).norm() / q.norm().max(1.0);
    // The sign iteration is good to about the square root of the condition number times
    // machine precision; a gain from a residual above this is not to be trusted.
    if residual.is_finite() && residual < 1e-5 {
        Ok(p * b / weights.torque)
    } else {
        Err(ControlError::NoStabilisingGain { residual })
    }
}

/// The stabilising solution of `A' P + P A - P S P + Q = 0`, if the iteration finds one.
pub(crate) fn riccati(
    a: &Matrix4<f64>,
    s: &Matrix4<f64>,
    q: &Matrix4<f64>,
) -> Option<Matrix4<f64>> {
    let mut z = SMatrix::<f64, 8, 8>::zeros();
    z.fixed_view_mut::<4, 4>(0, 0).copy_from(a);
    z.fixed_view_mut::<4, 4>(0, 4).copy_from(&(-s));
    z.fixed_view_mut::<4, 4>(4, 0).copy_from(&(-q));
    z.fixed_view_mut::<4, 4>(4, 4).copy_from(&(-a.transpose()));
    for _ in 0..100 {
        let inverse = z.try_inverse()?;
        // Balancing by the norms brings eigenvalues of all sizes to one at the same pace.
        let c = (z.norm() / inverse.norm()).sqrt();
        let next = (z / c + inverse * c) * 0.5;
        let change = (next - z).norm();
        z = next;
        if change <= 1e-13 * z.norm() {
            break;
        }
    }
    let mut left = SMatrix::<f64, 8, 4>::zeros();
    let mut right = SMatrix::<f64, 8, 4>::zeros();
    left.fixed_view_mut::<4, 4>(0, 0)
        .copy_from(&z.fixed_view::<4, 4>(0, 4));
    left.fixed_view_mut::<4, 4>(4, 0)
        .copy_from(&(z.fixed_view::<4, 4>(4, 4) + Matrix4::identity()));
    right
        .fixed_view_mut::<4, 4>(0, 0)
        .copy_from(&(-(z.fixed_view::<4, 4>(0, 0) + Matrix4::identity())));
    right
        .fixed_view_mut::<4, 4>(4, 0)
        .copy_from(&(-z.fixed_view::<4, 4>(4, 0)));
    let normal = left.transpose() * left;
    let p = normal.lu().solve(&(left.transpose() * right))?;
    let mut p = (p + p.transpose()) * 0.5;
    // Newton's correction on the Riccati residual removes what the normal equations lost.
    for _ in 0..2 {
        let closed = a - s * p;
        let residual = a.transpose() * p + p * a - p * s * p + q;
        p += lyapunov(&closed, &residual)?;
        p = (p + p.transpose()) * 0.5;
    }
    Some(p)
}

/// Solves `A' X + X A + Q = 0` by its 16 linear equations.
fn lyapunov(a: &Matrix4<f64>, q: &Matrix4<f64>) -> Option<Matrix4<f64>> {
    let mut system = SMatrix::<f64, 16, 16>::zeros();
    let mut right = SMatrix::<f64, 16, 1>::zeros();
    for i in 0..4 {
        for j in 0..4 {
            let row = 4 * i + j;
            for k in 0..4 {
                system[(row, 4 * k + j)] += a[(k, i)];
                system[(row, 4 * i + k)] += a[(k, j)];
            }
            right[row] = -q[(i, j)];
        }
    }
    let x = system.lu().solve(&right)?;
    Some(Matrix4::from_fn(|i, j| x[4 * i + j]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_dynamics::BikeParams;

    fn weights(offset: f64) -> Weights {
        Weights {
            state: Vector4::new(100.0, if offset == 0.0 { 0.01 } else { 1.0 }, 10.0, 0.1),
            torque: 0.1,
        }
    }

    #[test]
    fn closes_the_loop_stably_in_both_modes() {
        for offset in [0.0, 0.15] {
            let model = TwoLink::new(&BikeParams::default(), offset);
            let Linearisation { a, b } = model.linearisation();
            let k = gain(&model, &weights(offset)).unwrap();
            let closed = a - b * k.transpose();
            let slowest = closed
                .complex_eigenvalues()
                .iter()
                .map(|e| e.re)
                .fold(f64::NEG_INFINITY, f64::max);
            assert!(slowest < -0.05, "offset {offset}: slowest pole {slowest}");
        }
    }

    #[test]
    fn solves_the_double_integrator_in_closed_form() {
        // Two decoupled double integrators with Q = I, R = 1: P = [[sqrt 3, 1], [1, sqrt 3]].
        let mut a = Matrix4::zeros();
        a[(0, 2)] = 1.0;
        a[(1, 3)] = 1.0;
        let s = Matrix4::from_diagonal(&Vector4::new(0.0, 0.0, 1.0, 1.0));
        let p = riccati(&a, &s, &Matrix4::identity()).unwrap();
        for (i, j, expected) in [
            (0, 0, 3f64.sqrt()),
            (0, 2, 1.0),
            (2, 2, 3f64.sqrt()),
            (0, 1, 0.0),
            (1, 3, 1.0),
        ] {
            assert!((p[(i, j)] - expected).abs() < 1e-10);
        }
    }
}
