//! The motion model of MPC: arc length as time, the rate of curvature as input.
//!
//! With a constant input over a step the curve is a piece of clothoid, integrated to rounding by Gauss quadrature. Its
//! derivatives with respect to the state, the input and the length of the step are those of the same integral.

use bikebot_geometry::{Point2, Vector2, quadrature};

/// Position, heading (rad), curvature; lengths in whatever unit the caller measures in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct State {
    pub position: Point2,
    pub heading: f64,
    pub curvature: f64,
}

/// Components of a [`State`], in this order: x, y, θ, σ.
pub(crate) const STATES: usize = 4;

/// Where a step ends, and how that depends on what it is made from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Step {
    pub end: State,
    /// ∂end/∂start, row by row. What is not listed is that of the identity: only θ and σ of the start act on others.
    pub by_heading: Vector2,
    /// ∂(x, y, θ)/∂σ.
    pub by_curvature: [f64; 3],
    /// ∂(x, y, θ, σ)/∂u.
    pub by_rate: [f64; STATES],
    /// ∂(x, y, θ, σ)/∂h.
    pub by_length: [f64; STATES],
}

impl State {
    /// The state after a step of length `h` with dσ/ds = `rate`.
    pub fn after(&self, rate: f64, h: f64) -> Self {
        self.step(rate, h).end
    }

    /// The same with its derivatives.
    pub fn step(&self, rate: f64, h: f64) -> Step {
        let rule = &quadrature::EIGHT;
        let heading_at = |s: f64| self.heading + (self.curvature + 0.5 * rate * s) * s;
        let mut moved = Vector2::zeros();
        let mut by_heading = Vector2::zeros();
        let mut by_curvature = Vector2::zeros();
        let mut by_rate = Vector2::zeros();
        for (node, weight) in rule.nodes.iter().zip(&rule.weights) {
            let s = h * node;
            let (sin, cos) = heading_at(s).sin_cos();
            moved += Vector2::new(cos, sin) * (weight * h);
            let turned = Vector2::new(-sin, cos) * (weight * h);
            by_heading += turned;
            by_curvature += turned * s;
            by_rate += turned * (0.5 * s * s);
        }
        let end = Self {
            position: self.position + moved,
            heading: heading_at(h),
            curvature: self.curvature + rate * h,
        };
        let (sin, cos) = end.heading.sin_cos();
        Step {
            end,
            by_heading,
            by_curvature: [by_curvature.x, by_curvature.y, h],
            by_rate: [by_rate.x, by_rate.y, 0.5 * h * h, h],
            by_length: [cos, sin, end.curvature, rate],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn state(x: [f64; 4]) -> State {
        State {
            position: Point2::new(x[0], x[1]),
            heading: x[2],
            curvature: x[3],
        }
    }

    fn array(s: State) -> [f64; 4] {
        [s.position.x, s.position.y, s.heading, s.curvature]
    }

    #[test]
    fn without_input_it_is_a_circular_arc() {
        let end = state([1.0, 2.0, 0.3, 0.5]).after(0.0, 1.2);
        let (from, to) = (0.3f64, 0.3f64 + 0.6);
        let exact = [
            1.0 + 2.0 * (to.sin() - from.sin()),
            2.0 - 2.0 * (to.cos() - from.cos()),
            to,
            0.5,
        ];
        for (a, b) in array(end).iter().zip(exact) {
            assert!((a - b).abs() < 1e-14, "{a} {b}");
        }
    }

    proptest! {
        #[test]
        fn derivatives_are_those_of_differences(x in prop::array::uniform4(-1.0..1.0_f64), rate in -0.5..0.5_f64, h in 0.2..1.0_f64) {
            let step = state(x).step(rate, h);
            // Central differences over 1e-6: good to 1e-9.
            let difference = |plus: State, minus: State, column: [f64; 4]| {
                for ((p, m), exact) in array(plus).iter().zip(array(minus)).zip(column) {
                    prop_assert!(((p - m) / 2e-6 - exact).abs() < 1e-8);
                }
                Ok(())
            };
            let moved = |i: usize, by: f64| { let mut y = x; y[i] += by; state(y).after(rate, h) };
            let b = step.by_heading;
            difference(moved(2, 1e-6), moved(2, -1e-6), [b.x, b.y, 1.0, 0.0])?;
            let [cx, cy, ct] = step.by_curvature;
            difference(moved(3, 1e-6), moved(3, -1e-6), [cx, cy, ct, 1.0])?;
            difference(state(x).after(rate + 1e-6, h), state(x).after(rate - 1e-6, h), step.by_rate)?;
            difference(state(x).after(rate, h + 1e-6), state(x).after(rate, h - 1e-6), step.by_length)?;
        }
    }
}
