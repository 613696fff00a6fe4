//! What every curve of the plane can be asked, whatever its formula.

use crate::{Point2, Vector2, cross};

/// A three times differentiable plane curve `P(T)`.
///
/// The parameter `T` is not arc length. Curvature is positive to the left.
pub trait ParametricCurve {
    /// `P(T)`, m.
    fn point(&self, t: f64) -> Point2;

    /// `dP/dT`, m per unit of `T`.
    fn derivative(&self, t: f64) -> Vector2;

    /// `d²P/dT²`, m per unit of `T` squared.
    fn second_derivative(&self, t: f64) -> Vector2;

    /// `d³P/dT³`, m per unit of `T` cubed.
    fn third_derivative(&self, t: f64) -> Vector2;

    /// Direction of travel, rad, in [−π, π].
    ///
    /// Where the curve stands still for a moment (`dP/dT = 0`) it is the direction in which it
    /// leaves, given by the second derivative.
    fn heading(&self, t: f64) -> f64 {
        let mut d = self.derivative(t);
        if d.x == 0.0 && d.y == 0.0 {
            d = self.second_derivative(t);
        }
        d.y.atan2(d.x)
    }

    /// Curvature σ = (P′ × P″)/|P′|³, 1/m. NaN where `dP/dT = 0`.
    fn curvature(&self, t: f64) -> f64 {
        let d1 = self.derivative(t);
        let squared = d1.norm_squared();
        cross(d1, self.second_derivative(t)) / (squared * squared.sqrt())
    }

    /// Rate of curvature along the curve, dσ/ds, 1/m². NaN where `dP/dT = 0`.
    fn curvature_rate(&self, t: f64) -> f64 {
        let d1 = self.derivative(t);
        let d2 = self.second_derivative(t);
        let squared = d1.norm_squared();
        let turn = cross(d1, d2);
        let turn_rate = cross(d1, self.third_derivative(t));
        (turn_rate * squared - 3.0 * turn * d1.dot(&d2)) / (squared * squared * squared)
    }
}
