//! What a round minimises: length and bending, as a quadratic in the step d of all control points.
//!
//! *Length* is majorised: |v| ≤ |v|²/(2s) + s/2, with equality at |v| = s. With s_q = |P'(T_q)| of the current curve,
//!
//! ```text
//!     Σ_seg Σ_q ω_q |P'(T_q)|² / (2 s_q)
//! ```
//!
//! lies, but for a constant, above the length and touches it at the current curve. *Bending*, J = ∫ (dσ/ds)² ds, has two models:
//!
//! * [`Bending::Jerk`], as if travelled at the constant speed h: Σ_seg |c_{i+3} − 3c_{i+2} + 3c_{i+1} − c_i|²/h⁵. Convex wherever it starts
//!   from, so it makes good curves of bad ones; but where the curve is as tight as its segments are long it is
//!   another quantity than J, by the term σ⁴ and by the speed's fifth power.
//! * [`Bending::GaussNewton`], ρ = dσ/ds linearised at the Gauss nodes: Σ ω_q s_q (ρ_q + ∂ρ_q·d)², with the exact gradient of J. It
//!   continues where the first model's minimiser is no improvement any more.

use super::spline::{Basis, Spline};
use bikebot_geometry::Vector2;
use bikebot_qp::{BandedQp, QpError};

/// Third difference of control points: P''' on a segment.
const JERK: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];

/// Speeds below this part of h count as it: where the curve nearly stands still the majoriser would become infinitely stiff.
const SLOWEST: f64 = 0.05;

/// How much of the jerk's stiffness stays beside the linearised bending: it holds control points in place along the curve, where
/// neither length nor bending do.
const STIFFNESS: f64 = 0.1;

/// Gauss–Legendre nodes and weights on [0, 1].
const NODES: [(f64, f64); 3] = [
    (0.112_701_665_379_258_3, 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// Which model of J a round uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bending {
    /// Jerk at constant speed.
    Jerk,
    /// dσ/ds linearised.
    GaussNewton,
}

/// The quadratic's parameters.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Objective {
    /// w_J, m⁴.
    pub jerk_weight: f64,
    /// h, m.
    pub spacing: f64,
}

/// Hessian and gradient on the four control points of a segment, x and y of each in turn.
struct Block {
    hessian: [[f64; 8]; 8],
    gradient: [f64; 8],
}

impl Block {
    /// Adds ½ `weight` (a·d)², with a the weights on x alone and on y alone.
    fn add_both(&mut self, a: &[f64; 4], weight: f64) {
        for i in 0..4 {
            for j in 0..4 {
                let by = weight * a[i] * a[j];
                self.hessian[2 * i][2 * j] += by;
                self.hessian[2 * i + 1][2 * j + 1] += by;
            }
        }
    }

    /// Adds the gradient of ½ `weight` |v|² for v = Σ a_k c_k.
    fn pull_both(&mut self, a: &[f64; 4], v: Vector2, weight: f64) {
        for (pair, a) in self.gradient.chunks_exact_mut(2).zip(a) {
            pair[0] += weight * a * v.x;
            pair[1] += weight * a * v.y;
        }
    }

    /// Adds ½ `weight` (a·d)².
    fn add(&mut self, a: &[f64; 8], weight: f64) {
        for i in 0..8 {
            for j in 0..8 {
                self.hessian[i][j] += weight * a[i] * a[j];
            }
        }
    }
}

impl Objective {
    /// Adds the quadratic for steps from `spline`, with the trust term (μ/2)|d|², to an empty programme.
    pub fn add_to(
        &self,
        qp: &mut BandedQp<8>,
        spline: &Spline,
        bending: Bending,
        mu: f64,
    ) -> Result<(), QpError> {
        let nodes = NODES.map(|(t, omega)| (Basis::at(t), omega));
        for segment in 0..spline.segments() {
            let block = self.block(spline, segment, bending, &nodes);
            let first = 2 * segment;
            for i in 0..8 {
                qp.add_gradient(first + i, block.gradient[i])?;
                for j in i..8 {
                    if block.hessian[i][j] != 0.0 {
                        qp.add_hessian(first + i, first + j, block.hessian[i][j])?;
                    }
                }
            }
        }
        qp.add_diagonal(mu)
    }

    fn block(
        &self,
        spline: &Spline,
        segment: usize,
        bending: Bending,
        nodes: &[(Basis, f64); 3],
    ) -> Block {
        let window = &spline.control[segment..segment + 4];
        let sum = |weights: &[f64; 4]| {
            window
                .iter()
                .zip(weights)
                .fold(Vector2::zeros(), |sum, (c, w)| sum + c.coords * *w)
        };
        let third = sum(&JERK);
        let stiffness = 2.0 * self.jerk_weight / self.spacing.powi(5);
        let mut block = Block {
            hessian: [[0.0; 8]; 8],
            gradient: [0.0; 8],
        };
        match bending {
            Bending::Jerk => {
                block.add_both(&JERK, stiffness);
                block.pull_both(&JERK, third, stiffness);
            }
            Bending::GaussNewton => block.add_both(&JERK, STIFFNESS * stiffness),
        }
        for (basis, omega) in nodes {
            let velocity = sum(&basis.first);
            let speed = velocity.norm().max(SLOWEST * self.spacing);
            block.add_both(&basis.first, omega / speed);
            block.pull_both(&basis.first, velocity, omega / speed);
            if bending == Bending::GaussNewton {
                let derivatives = [velocity, sum(&basis.second), third];
                let (rate, slope) = curvature_rate_and_gradient(basis, &derivatives);
                let weight = 2.0 * self.jerk_weight * omega;
                block.add(&slope, weight * speed);
                // ∂(ρ² s) = 2 ρ s ∂ρ + ρ² ∂s
                for (entry, slope) in block.gradient.iter_mut().zip(slope) {
                    *entry += weight * rate * speed * slope;
                }
                block.pull_both(&basis.first, velocity, 0.5 * weight * rate * rate / speed);
            }
        }
        block
    }
}

/// dσ/ds and its gradient by x and y of the four control points, from P', P'', P''':
///
/// ```text
///     dσ/ds = (P'×P''')/D² − 3 (P'×P'')(P'·P'')/D³,      D = |P'|²
/// ```
pub(crate) fn curvature_rate_and_gradient(
    basis: &Basis,
    [d1, d2, d3]: &[Vector2; 3],
) -> (f64, [f64; 8]) {
    let square = d1.norm_squared();
    let (turn, turn_rate, gain) = (d1.perp(d2), d1.perp(d3), d1.dot(d2));
    let (square_2, square_3) = (square * square, square * square * square);
    let rate = turn_rate / square_2 - 3.0 * turn * gain / square_3;
    let mut gradient = [0.0; 8];
    for k in 0..4 {
        let (b1, b2, b3) = (basis.first[k], basis.second[k], JERK[k]);
        // How a·x, a×x and x×a change with x and y of the control point.
        let cross_left = |b: f64, a: &Vector2| Vector2::new(b * a.y, -b * a.x);
        let cross_right = |a: &Vector2, b: f64| Vector2::new(-a.y * b, a.x * b);
        let turn_rate_slope = cross_left(b1, d3) + cross_right(d1, b3);
        let turn_slope = cross_left(b1, d2) + cross_right(d1, b2);
        let gain_slope = d2 * b1 + d1 * b2;
        let square_slope = d1 * (2.0 * b1);
        let by = turn_rate_slope / square_2
            - (turn_slope * gain + gain_slope * turn) * (3.0 / square_3)
            + square_slope * ((9.0 * turn * gain / square - 2.0 * turn_rate) / square_3);
        gradient[2 * k] = by.x;
        gradient[2 * k + 1] = by.y;
    }
    (rate, gradient)
}
