//! The Ferguson–Coons curve that joins two tree nodes — Sect. 3.2, Eq. (3)–(4).
//!
//! A cubic fixed by its two end points and its two end tangents. Textbooks also
//! call it the cubic Hermite segment. The parameter `T` runs over `[0, 1]` and is
//! not arc length; [`crate::ArcLength`] converts between the two, Eq. (6)–(7).
//!
//! Curvature is treated exactly. With `P′ = A T² + B T + c` the cross product
//! `N = P′ × P″` is a quadratic and `D = |P′|²` a quartic; σ = N D^(−3/2), and
//! dσ/dT = Q D^(−5/2) with the quintic `Q = N′D − (3/2) N D′`. The largest |σ| is at an end
//! or at a root of `Q`, and the roots come from [`crate::bernstein`].

mod hodograph;

use crate::bernstein;
use crate::curve::ParametricCurve;
use crate::quadrature::{self, GaussLegendre};
use crate::{Point2, Pose2, Vector2, cross};
use hodograph::{
    Hodograph, max_abs_quadratic, maximum, minimum, over_slowest, quadratic,
    squared_norm_coefficients,
};

/// Square of the speed, relative to the largest on the curve, below which the curve counts as
/// standing still: at a millionth of the speed a metre-sized cubic turns within a micrometre.
const STANDSTILL: f64 = 1e-12;

/// Of the curvature at an end, squared and relative, by the short formula: never refuse what the long one accepts.
const ROUNDING: f64 = 1e-9;

/// One cubic segment `P(T) = a T³ + b T² + c T + d`.
#[doc(alias = "hermite")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FergusonCurve {
    x0: Point2,
    v0: Vector2,
    x1: Point2,
    v1: Vector2,
}

impl FergusonCurve {
    /// Eq. (3) for arbitrary end points (m) and end tangents (m per unit of `T`).
    #[must_use]
    pub fn from_ends(x0: Point2, v0: Vector2, x1: Point2, v1: Vector2) -> Self {
        Self { x0, v0, x1, v1 }
    }

    /// Joins `from` to `to`, leaving and arriving along their headings, Eq. (4).
    ///
    /// `tangent_speed` is the paper's `k`: the length of `dP/dT` at both ends, in
    /// metres per unit of `T`. A larger value swings wider before turning.
    #[must_use]
    pub fn between(from: Pose2, to: Pose2, tangent_speed: f64) -> Self {
        Self::from_ends(
            from.position,
            from.direction() * tangent_speed,
            to.position,
            to.direction() * tangent_speed,
        )
    }

    /// The straight segment from `a` to `b`, at constant speed.
    #[must_use]
    pub fn straight(a: Point2, b: Point2) -> Self {
        Self::from_ends(a, b - a, b, b - a)
    }

    /// From `[x0, y0, vx0, vy0, x1, y1, vx1, vy1]`; the inverse of [`Self::to_array`].
    #[must_use]
    pub fn from_array(v: [f64; 8]) -> Self {
        Self::from_ends(
            Point2::new(v[0], v[1]),
            Vector2::new(v[2], v[3]),
            Point2::new(v[4], v[5]),
            Vector2::new(v[6], v[7]),
        )
    }

    /// End points (m) and end tangents (m per unit of `T`) as
    /// `[x0, y0, vx0, vy0, x1, y1, vx1, vy1]`. Nothing is lost: the way back is exact.
    #[must_use]
    pub fn to_array(&self) -> [f64; 8] {
        [
            self.x0.x, self.x0.y, self.v0.x, self.v0.y, self.x1.x, self.x1.y, self.v1.x, self.v1.y,
        ]
    }

    /// Where the curve starts, m. Exactly as given.
    #[must_use]
    pub fn start_point(&self) -> Point2 {
        self.x0
    }

    /// Where the curve ends, m. Exactly as given.
    #[must_use]
    pub fn end_point(&self) -> Point2 {
        self.x1
    }

    /// `dP/dT` at the start, m per unit of `T`.
    #[must_use]
    pub fn start_tangent(&self) -> Vector2 {
        self.v0
    }

    /// `dP/dT` at the end, m per unit of `T`.
    #[must_use]
    pub fn end_tangent(&self) -> Vector2 {
        self.v1
    }

    /// Position and heading at the start.
    #[must_use]
    pub fn start_pose(&self) -> Pose2 {
        Pose2 {
            position: self.x0,
            heading: self.heading(0.0),
        }
    }

    /// Position and heading at the end.
    #[must_use]
    pub fn end_pose(&self) -> Pose2 {
        let heading = if self.v1 == Vector2::zeros() {
            // Arriving at a standstill: the last direction is against the second derivative.
            let back = self.second_derivative(1.0);
            (-back.y).atan2(-back.x)
        } else {
            self.v1.y.atan2(self.v1.x)
        };
        Pose2 {
            position: self.x1,
            heading,
        }
    }

    /// Whether every number of the curve is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.to_array().iter().all(|v| v.is_finite())
    }

    /// The same points travelled the other way.
    #[must_use]
    pub fn reversed(&self) -> Self {
        Self::from_ends(self.x1, -self.v1, self.x0, -self.v0)
    }

    /// The piece between parameters `t0` and `t1`, again as a curve over `[0, 1]`.
    #[must_use]
    pub fn sub_curve(&self, t0: f64, t1: f64) -> Self {
        let scale = t1 - t0;
        Self::from_ends(
            self.point(t0),
            self.derivative(t0) * scale,
            self.point(t1),
            self.derivative(t1) * scale,
        )
    }

    /// The largest |σ| on the whole curve, 1/m, exact up to rounding.
    ///
    /// Infinite where the curve stands still or reverses (a cusp), and for a curve without length.
    #[must_use]
    pub fn max_curvature(&self) -> f64 {
        let h = self.hodograph();
        let control = h.control(0.0, 1.0);
        let speed_squared = squared_norm_coefficients(&control);
        let largest = maximum(&speed_squared);
        if !(largest.is_finite() && largest > 0.0) {
            return f64::INFINITY;
        }

        let turn = h.turn();
        let mut best = h.curvature_squared(&turn, 0.0);
        best = best.max(h.curvature_squared(&turn, 1.0));

        // A cusp needs a vanishing speed, which the Bernstein coefficients usually exclude.
        // Where they do not, the slowest points are candidates too: beside a near cusp the
        // peak of the curvature is narrower than the rounding of Q.
        if minimum(&speed_squared) <= 1e-3 * largest {
            let mut slowest = control[0].norm_squared().min(control[2].norm_squared());
            bernstein::for_each_root(&h.speed_squared_slope(), &mut |t| {
                slowest = slowest.min(h.at(t).norm_squared());
                best = best.max(h.curvature_squared(&turn, t));
            });
            if slowest <= STANDSTILL * largest {
                return f64::INFINITY;
            }
        }

        bernstein::for_each_root(&h.curvature_slope(&turn), &mut |t| {
            best = best.max(h.curvature_squared(&turn, t));
        });
        best.sqrt()
    }

    /// Whether |σ| ≤ `limit` (1/m) on the whole curve: the test of line 11, without tolerance.
    ///
    /// Refuses by three points and accepts by Bernstein bounds where that decides; only the rest
    /// pays for [`Self::max_curvature`].
    #[must_use]
    pub fn is_within_curvature(&self, limit: f64) -> bool {
        let h = self.hodograph();
        let turn = h.turn();
        let limit_squared = limit * limit;
        let control = h.control(0.0, 1.0);
        let speed_squared = squared_norm_coefficients(&control);
        let violates = |t: f64, d: f64| {
            let n = quadratic(&turn, t);
            n * n > limit_squared * d * d * d
        };
        if violates(0.0, speed_squared[0])
            || violates(1.0, speed_squared[4])
            || violates(0.5, h.at(0.5).norm_squared())
        {
            return false;
        }
        let slowest = minimum(&speed_squared);
        if slowest > 0.0 {
            let n = max_abs_quadratic(&turn, 0.0, 1.0);
            if n * n <= limit_squared * slowest * slowest * slowest {
                return true;
            }
        }
        self.max_curvature() <= limit
    }

    /// Whether |σ| > `limit` (1/m) at the start or the end: in a few operations, that a curve is out of question.
    #[must_use]
    #[inline]
    pub fn exceeds_curvature_at_an_end(&self, limit: f64) -> bool {
        // N = P′ × P″ with P″(0) = 2 (3 r − 2 v₀ − v₁) and P″(1) = 2 (v₀ + 2 v₁ − 3 r), r the chord.
        let chord = self.x1 - self.x0;
        let start = 2.0 * cross(self.v0, 3.0 * chord - self.v1);
        let end = 2.0 * cross(self.v1, self.v0 - 3.0 * chord);
        let exceeds = |n: f64, tangent: Vector2| {
            let d = tangent.norm_squared();
            n * n > limit * limit * d * d * d * (1.0 + ROUNDING)
        };
        exceeds(start, self.v0) || exceeds(end, self.v1)
    }

    /// Length, m, by four panels of eight Gauss–Legendre nodes.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.length_and_bending_fine().0
    }

    /// Length `L` in m and bending `J = ∫ (dσ/ds)² ds` in 1/m³ by eight Gauss–Legendre nodes.
    ///
    /// What the search uses: on curves within the curvature limit the length is off by at most
    /// 2e-7 and the bending by about one per cent. The bending of a curve that stands still at a
    /// node is infinite.
    #[must_use]
    pub fn length_and_bending(&self) -> (f64, f64) {
        self.length_and_bending_on(&quadrature::EIGHT, 1)
    }

    /// [`Self::length_and_bending`] with four panels: the numbers that reports print.
    #[must_use]
    pub fn length_and_bending_fine(&self) -> (f64, f64) {
        self.length_and_bending_on(&quadrature::EIGHT, 4)
    }

    /// An upper bound of |dP/dT| on the whole curve, m per unit of `T`: the largest Bernstein
    /// coefficient of the hodograph.
    #[must_use]
    pub fn speed_bound(&self) -> f64 {
        let control = self.hodograph().control(0.0, 1.0);
        control
            .iter()
            .map(Vector2::norm_squared)
            .fold(0.0, f64::max)
            .sqrt()
    }

    /// A lower bound of |dP/dT| on the whole curve, m per unit of `T`, from the Bernstein coefficients of its square; 0 where they
    /// cannot exclude a standstill.
    #[must_use]
    pub fn least_speed_bound(&self) -> f64 {
        minimum(&squared_norm_coefficients(
            &self.hodograph().control(0.0, 1.0),
        ))
        .max(0.0)
        .sqrt()
    }

    /// An upper bound of |dθ/dT| = |N|/D for `T` in `[t0, t1]`, rad per unit of `T`.
    ///
    /// Infinite where the bounds cannot exclude a standstill; a narrower interval may.
    #[must_use]
    pub fn heading_rate_bound(&self, t0: f64, t1: f64) -> f64 {
        let h = self.hodograph();
        let turn = max_abs_quadratic(&h.turn(), t0, t1);
        over_slowest(
            turn,
            minimum(&squared_norm_coefficients(&h.control(t0, t1))),
        )
    }

    /// Upper bounds of |dθ/dT| and of |d²θ/dT²| = |N′ − θ′ D′|/D for `T` in `[t0, t1]`, rad per unit of `T` and of its square.
    ///
    /// Infinite where [`Self::heading_rate_bound`] is.
    #[must_use]
    pub fn heading_bounds(&self, t0: f64, t1: f64) -> (f64, f64) {
        let h = self.hodograph();
        let turn = h.turn();
        let control = h.control(t0, t1);
        let slowest = minimum(&squared_norm_coefficients(&control));
        let rate = over_slowest(max_abs_quadratic(&turn, t0, t1), slowest);
        // N′ is linear, and so is P″; |P′| is at most the farthest of its control points.
        let n = |t: f64| (turn[1] + 2.0 * turn[2] * t).abs();
        let second = |t: f64| (2.0 * t * h.a + h.b).norm();
        let fastest = control.iter().map(|q| q.norm()).fold(0.0, f64::max);
        let widest = second(t0).max(second(t1));
        let change = if rate == 0.0 {
            n(t0).max(n(t1))
        } else {
            n(t0).max(n(t1)) + 2.0 * rate * fastest * widest
        };
        (rate, over_slowest(change, slowest))
    }

    /// `[a, b, c]` of Eq. (3) multiplied out; `d` is the start point.
    #[inline]
    fn coefficients(&self) -> [Vector2; 3] {
        let chord = self.x1 - self.x0;
        [
            self.v0 + self.v1 - 2.0 * chord,
            3.0 * chord - 2.0 * self.v0 - self.v1,
            self.v0,
        ]
    }

    #[inline]
    fn hodograph(&self) -> Hodograph {
        let [a, b, c] = self.coefficients();
        Hodograph {
            a: 3.0 * a,
            b: 2.0 * b,
            c,
        }
    }

    #[inline]
    fn length_and_bending_on<const N: usize>(
        &self,
        rule: &GaussLegendre<N>,
        panels: u32,
    ) -> (f64, f64) {
        let h = self.hodograph();
        let turn = h.turn();
        let panel = 1.0 / f64::from(panels);
        let (mut length, mut bending) = (0.0, 0.0);
        for k in 0..panels {
            for (node, weight) in rule.nodes.iter().zip(&rule.weights) {
                let t = (f64::from(k) + node) * panel;
                let d1 = h.at(t);
                let squared = d1.norm_squared();
                let speed = squared.sqrt();
                length += weight * speed;
                let slope = (turn[1] + 2.0 * turn[2] * t) * squared
                    - 3.0 * quadratic(&turn, t) * d1.dot(&h.slope(t));
                let squared_3 = squared * squared * squared;
                // Q² D^(−11/2) = (Q/D³)² √D
                let rate = slope / squared_3;
                bending += if squared_3 > 0.0 {
                    weight * rate * rate * speed
                } else {
                    f64::INFINITY
                };
            }
        }
        (length * panel, bending * panel)
    }
}

impl ParametricCurve for FergusonCurve {
    #[inline]
    fn point(&self, t: f64) -> Point2 {
        let [a, b, c] = self.coefficients();
        self.x0 + ((a * t + b) * t + c) * t
    }

    #[inline]
    fn derivative(&self, t: f64) -> Vector2 {
        self.hodograph().at(t)
    }

    #[inline]
    fn second_derivative(&self, t: f64) -> Vector2 {
        self.hodograph().slope(t)
    }

    #[inline]
    fn third_derivative(&self, _t: f64) -> Vector2 {
        2.0 * self.hodograph().a
    }
}

#[cfg(test)]
mod tests;
