//! Pieces of curve, enclosed by intervals.

use super::interval::{Bernstein, Interval};
use bikebot_geometry::{FergusonCurve, Point2, Vector2, cross};

/// P, P′ and P″ at `t`, from the Hermite basis.
pub(super) fn at(curve: &FergusonCurve, t: f64) -> (Point2, Vector2, Vector2) {
    let (x0, v0) = (curve.start_point(), curve.start_tangent());
    let (x1, v1) = (curve.end_point(), curve.end_tangent());
    let (u, chord) = (1.0 - t, x1 - x0);
    let point = x0 + chord * (t * t * (3.0 - 2.0 * t)) + v0 * (t * u * u) - v1 * (t * t * u);
    let middle = chord * 3.0 - v0 - v1;
    let first = v0 * (u * u) + middle * (2.0 * u * t) + v1 * (t * t);
    let second = (middle - v0) * (2.0 * u) + (v1 - middle) * (2.0 * t);
    (point, first, second)
}

/// σ at `t`, 1/m; not a number where the curve stands still.
pub(super) fn curvature(curve: &FergusonCurve, t: f64) -> f64 {
    let (_, first, second) = at(curve, t);
    cross(first, second) / first.norm().powi(3)
}

/// Enclosures of a piece of curve. The derivatives are those by the parameter of the whole curve.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    pub(super) segment: usize,
    pub(super) from: f64,
    pub(super) to: f64,
    /// P′, by coordinates.
    pub(super) first: [Bernstein<3>; 2],
    /// N = P′ × P″.
    pub(super) turn: Bernstein<4>,
    /// D = |P′|².
    pub(super) squared: Bernstein<5>,
}

impl Piece {
    pub(super) fn whole(segment: usize, curve: &FergusonCurve) -> Self {
        let (x0, v0) = (curve.start_point(), curve.start_tangent());
        let (x1, v1) = (curve.end_point(), curve.end_tangent());
        let first = [0, 1].map(|i| {
            let [x0, v0, x1, v1] = [x0[i], v0[i], x1[i], v1[i]].map(Interval::of);
            Bernstein([v0, Interval::of(3.0) * (x1 - x0) - v0 - v1, v1])
        });
        let second = first.map(|f| {
            let two = Interval::of(2.0);
            Bernstein([two * (f.0[1] - f.0[0]), two * (f.0[2] - f.0[1])])
        });
        let [left, right]: [Bernstein<4>; 2] =
            [first[0].times(&second[1]), first[1].times(&second[0])];
        let [xx, yy]: [Bernstein<5>; 2] = [first[0].times(&first[0]), first[1].times(&first[1])];
        Self {
            segment,
            from: 0.0,
            to: 1.0,
            first,
            turn: Bernstein(std::array::from_fn(|i| left.0[i] - right.0[i])),
            squared: Bernstein(std::array::from_fn(|i| xx.0[i] + yy.0[i])),
        }
    }

    pub(super) fn halves(&self) -> [Self; 2] {
        let middle = 0.5 * (self.from + self.to);
        let first = self.first.map(|f| f.halves());
        let (turn, squared) = (self.turn.halves(), self.squared.halves());
        [0, 1].map(|k| Self {
            segment: self.segment,
            from: if k == 0 { self.from } else { middle },
            to: if k == 0 { middle } else { self.to },
            first: [first[0][k], first[1][k]],
            turn: turn[k],
            squared: squared[k],
        })
    }

    pub(super) fn middle(&self) -> f64 {
        0.5 * (self.from + self.to)
    }

    /// A point `reach` (m) from the reference point leaves the straight way between its places at both ends by no more
    /// than this, m.
    pub(super) fn deviation(&self, reach: f64) -> f64 {
        let h = self.to - self.from;
        // Derivatives by the piece's own parameter are h times those by T.
        let steps = |b: &Bernstein<3>| {
            (b.0[1] - b.0[0])
                .magnitude()
                .max((b.0[2] - b.0[1]).magnitude())
        };
        let second = 2.0 * h * steps(&self.first[0]).hypot(steps(&self.first[1]));
        if reach == 0.0 {
            return 0.125 * second * (1.0 + 1e-12);
        }
        let squared = self.squared.hull();
        // Not a number is no proof of motion either.
        if squared.lo.is_nan() || squared.lo <= 0.0 {
            return f64::INFINITY;
        }
        let slope = |c: &[Interval]| {
            let steps = c.windows(2).map(|w| (w[1] - w[0]).magnitude());
            (c.len() - 1) as f64 * steps.fold(0.0, f64::max)
        };
        let turn = self.turn.hull().magnitude();
        let rate = h * turn / squared.lo;
        let change = h * (slope(&self.turn.0) * squared.hi + turn * slope(&self.squared.0))
            / (squared.lo * squared.lo);
        // and the direction at both ends is right to rounding of P′ only
        let largest = self.first[0].hull().magnitude() + self.first[1].hull().magnitude();
        let rounding = 16.0 * f64::EPSILON * largest / squared.lo.sqrt();
        (0.125 * (second + reach * (change + rate * rate)) + reach * rounding) * (1.0 + 1e-12)
    }
}
