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

use crate::bernstein;
use crate::curve::ParametricCurve;
use crate::quadrature::{self, GaussLegendre};
use crate::{Point2, Pose2, Vector2, cross};

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

/// `P′(T) = A T² + B T + c`.
#[derive(Clone, Copy)]
struct Hodograph {
    a: Vector2,
    b: Vector2,
    c: Vector2,
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

impl Hodograph {
    #[inline]
    fn at(&self, t: f64) -> Vector2 {
        (self.a * t + self.b) * t + self.c
    }

    #[inline]
    fn slope(&self, t: f64) -> Vector2 {
        self.a * (2.0 * t) + self.b
    }

    /// Bernstein control points of `P′` on `[t0, t1]`.
    #[inline]
    fn control(&self, t0: f64, t1: f64) -> [Vector2; 3] {
        [
            self.at(t0),
            self.a * (t0 * t1) + self.b * (0.5 * (t0 + t1)) + self.c,
            self.at(t1),
        ]
    }

    /// Power coefficients of `N = P′ × P″`, constant first.
    #[inline]
    fn turn(&self) -> [f64; 3] {
        [
            cross(self.c, self.b),
            2.0 * cross(self.c, self.a),
            -cross(self.a, self.b),
        ]
    }

    /// Power coefficients of `D = |P′|²`, constant first.
    #[inline]
    fn speed_squared(&self) -> [f64; 5] {
        [
            self.c.dot(&self.c),
            2.0 * self.b.dot(&self.c),
            self.b.dot(&self.b) + 2.0 * self.a.dot(&self.c),
            2.0 * self.a.dot(&self.b),
            self.a.dot(&self.a),
        ]
    }

    /// Power coefficients of `D′`.
    fn speed_squared_slope(&self) -> [f64; 4] {
        let d = self.speed_squared();
        [d[1], 2.0 * d[2], 3.0 * d[3], 4.0 * d[4]]
    }

    /// Power coefficients of `Q = N′D − (3/2) N D′`.
    fn curvature_slope(&self, n: &[f64; 3]) -> [f64; 6] {
        let d = self.speed_squared();
        let d_slope = [1.5 * d[1], 3.0 * d[2], 4.5 * d[3], 6.0 * d[4]];
        let n_slope = [n[1], 2.0 * n[2]];
        let mut q = [0.0; 6];
        for (i, x) in n_slope.iter().enumerate() {
            for (j, y) in d.iter().enumerate() {
                q[i + j] += x * y;
            }
        }
        for (i, x) in n.iter().enumerate() {
            for (j, y) in d_slope.iter().enumerate() {
                q[i + j] -= x * y;
            }
        }
        q
    }

    /// σ² at `t`; zero for a straight line even where it stands still.
    #[inline]
    fn curvature_squared(&self, turn: &[f64; 3], t: f64) -> f64 {
        let n = quadratic(turn, t);
        if n == 0.0 {
            return 0.0;
        }
        let d = self.at(t).norm_squared();
        n * n / (d * d * d)
    }
}

#[inline]
fn quadratic(p: &[f64; 3], t: f64) -> f64 {
    (p[2] * t + p[1]) * t + p[0]
}

/// max |p| on `[t0, t1]`: at an end or at the vertex of the parabola.
#[inline]
fn max_abs_quadratic(p: &[f64; 3], t0: f64, t1: f64) -> f64 {
    let mut largest = quadratic(p, t0).abs().max(quadratic(p, t1).abs());
    if p[2] != 0.0 {
        let vertex = -0.5 * p[1] / p[2];
        if vertex > t0 && vertex < t1 {
            largest = largest.max(quadratic(p, vertex).abs());
        }
    }
    largest
}

/// A bound of a quotient by D, of which `slowest` is a lower bound; infinite where that excludes nothing.
fn over_slowest(numerator: f64, slowest: f64) -> f64 {
    if slowest <= 0.0 {
        f64::INFINITY
    } else {
        numerator / slowest
    }
}

/// Bernstein coefficients of |q|² for a quadratic `q` with control points `q`.
#[inline]
fn squared_norm_coefficients(q: &[Vector2; 3]) -> [f64; 5] {
    [
        q[0].dot(&q[0]),
        q[0].dot(&q[1]),
        (q[0].dot(&q[2]) + 2.0 * q[1].dot(&q[1])) / 3.0,
        q[1].dot(&q[2]),
        q[2].dot(&q[2]),
    ]
}

#[inline]
fn minimum(b: &[f64; 5]) -> f64 {
    b.iter().copied().fold(f64::INFINITY, f64::min)
}

#[inline]
fn maximum(b: &[f64; 5]) -> f64 {
    b.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    /// Random edges as the search meets them: chord-sized tangents, any headings.
    fn edge() -> impl Strategy<Value = FergusonCurve> {
        (0.5..8.0_f64, -PI..PI, -PI..PI, 0.3..2.0_f64, -PI..PI).prop_map(
            |(chord, start, end, k, tilt)| {
                let from = Pose2::new(1.0, -2.0, tilt + start);
                let to = Pose2 {
                    position: from.position + Pose2::new(0.0, 0.0, tilt).direction() * chord,
                    heading: tilt + end,
                };
                FergusonCurve::between(from, to, k * chord)
            },
        )
    }

    /// Any cubic, with tangents of any size down to nothing.
    fn cubic() -> impl Strategy<Value = FergusonCurve> {
        prop::array::uniform8(-3.0..3.0_f64).prop_map(FergusonCurve::from_array)
    }

    fn sampled_max_curvature(curve: &FergusonCurve, samples: u32) -> f64 {
        (0..=samples)
            .map(|i| curve.curvature(f64::from(i) / f64::from(samples)).abs())
            .fold(0.0, f64::max)
    }

    proptest! {
        #[test]
        fn the_ends_rule_out_only_curves_that_exceed_the_limit(
            curve in prop_oneof![edge(), cubic()],
            limit in 0.05..5.0_f64,
        ) {
            let ends = curve.curvature(0.0).abs().max(curve.curvature(1.0).abs());
            if curve.exceeds_curvature_at_an_end(limit) {
                prop_assert!(!curve.is_within_curvature(limit));
            } else {
                // Rounding of two formulas for one number; a cusp at an end is left for the exact test.
                prop_assert!(ends <= limit * (1.0 + 1e-6) || !ends.is_finite());
            }
        }
    }

    #[test]
    fn end_curvature_matches_the_closed_form() {
        // σ(0) = −6 d sin α / k² − 2 sin(β − α)/k for chord d, start angle α and end angle β.
        for (d, k, alpha, beta) in [
            (5.0, 1.0, 0.1, -0.2),
            (5.0, 5.0, 0.3, 0.4),
            (2.0, 1.5, -1.1, 0.7),
            (0.4, 0.5, 2.0, -2.5),
        ] {
            let curve =
                FergusonCurve::between(Pose2::new(0.0, 0.0, alpha), Pose2::new(d, 0.0, beta), k);
            let expected = -6.0 * d * f64::sin(alpha) / (k * k) - 2.0 * f64::sin(beta - alpha) / k;
            assert!((curve.curvature(0.0) - expected).abs() < 1e-12 * (1.0 + expected.abs()));
        }
    }

    #[test]
    fn the_literal_tangent_admits_only_nearly_straight_edges() {
        // k = 1 on a 5 m chord: about 30 sin α, so 1 per metre is reached at 1.9°.
        let at = |degrees: f64| {
            let heading = degrees.to_radians();
            FergusonCurve::between(
                Pose2::new(0.0, 0.0, heading),
                Pose2::new(5.0, 0.0, heading),
                1.0,
            )
        };
        assert!(at(1.8).is_within_curvature(1.0));
        assert!(!at(2.1).is_within_curvature(1.0));
    }

    #[test]
    fn matches_the_reference_vectors() {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../tests/data/vectors/pvfc.json"
        );
        let text = std::fs::read_to_string(path).expect("the vector file belongs to the tests");
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        let cases = json["ferguson"].as_array().unwrap();
        assert!(cases.len() >= 3);
        let number = |v: &serde_json::Value| v.as_f64().unwrap();
        for case in cases {
            let pose = |x: &str, theta: &str| {
                Pose2::new(
                    number(&case[x][0]),
                    number(&case[x][1]),
                    number(&case[theta]),
                )
            };
            let curve = FergusonCurve::between(
                pose("x0", "theta0"),
                pose("x1", "theta1"),
                number(&case["k"]),
            );
            for (i, t) in case["T"].as_array().unwrap().iter().enumerate() {
                let t = number(t);
                let expect = |key: &str, value: Vector2| {
                    let known = Vector2::new(number(&case[key][i][0]), number(&case[key][i][1]));
                    // Double precision on both sides, numbers up to 30.
                    assert!(
                        (value - known).norm() < 1e-12,
                        "{key} at {t}: {value} {known}"
                    );
                };
                expect("P", curve.point(t).coords);
                expect("dP", curve.derivative(t));
                expect("ddP", curve.second_derivative(t));
                let known = number(&case["curvature"][i]);
                assert!((curve.curvature(t) - known).abs() < 1e-12 * (1.0 + known.abs()));
            }
        }
    }

    #[test]
    fn a_straight_line_has_no_curvature_and_its_own_length() {
        let line = FergusonCurve::straight(Point2::new(1.0, 2.0), Point2::new(4.0, 6.0));
        assert_eq!(line.max_curvature(), 0.0);
        assert!(line.is_within_curvature(0.0));
        let (length, bending) = line.length_and_bending();
        assert!((length - 5.0).abs() < 1e-14);
        assert_eq!(bending, 0.0);
        assert!((line.speed_bound() - 5.0).abs() < 1e-14);
        assert_eq!(line.heading_rate_bound(0.0, 1.0), 0.0);
    }

    #[test]
    fn a_quarter_circle_is_matched_to_the_cubic_s_accuracy() {
        // The classical cubic quarter circle (Bézier handle 0.5523 R) is off by 2.7e-4 R.
        let radius = 2.0;
        let handle = 4.0 / 3.0 * (PI / 8.0).tan();
        let arc = FergusonCurve::between(
            Pose2::new(0.0, 0.0, 0.0),
            Pose2::new(radius, radius, PI / 2.0),
            3.0 * handle * radius,
        );
        let centre = Point2::new(0.0, radius);
        for i in 0..=100 {
            let off = (arc.point(f64::from(i) / 100.0) - centre).norm() - radius;
            assert!(off.abs() < 2.8e-4 * radius, "{off}");
        }
        assert!((arc.max_curvature() * radius - 1.0).abs() < 0.02);
        assert!((arc.length() - radius * PI / 2.0).abs() < 3e-4 * radius);
    }

    #[test]
    fn a_cusp_has_infinite_curvature() {
        // P' = ((2T − 1), 3T(T − ½))-like: made to vanish at T = ½ exactly.
        let at = |a: Vector2, b: Vector2| {
            // P'(T) = a (T − ½)² + b (T − ½)
            let c = 0.25 * a - 0.5 * b;
            let end = 0.25 * a + 0.5 * b;
            let x1 = a / 12.0; // ∫ a (T − ½)² over [0, 1]
            FergusonCurve::from_ends(Point2::origin(), c, Point2::from(x1), end)
        };
        let cusp = at(Vector2::new(1.0, 3.0), Vector2::new(2.0, -1.0));
        assert!(cusp.derivative(0.5).norm() < 1e-15);
        assert_eq!(cusp.max_curvature(), f64::INFINITY);
        assert!(!cusp.is_within_curvature(1e6));

        // Straight back along the same line: no turning, yet nothing can ride it.
        let back = FergusonCurve::from_ends(
            Point2::origin(),
            Vector2::new(1.0, 0.0),
            Point2::origin(),
            Vector2::new(-1.0, 0.0),
        );
        assert_eq!(back.max_curvature(), f64::INFINITY);
        assert_eq!(back.heading_rate_bound(0.0, 1.0), f64::INFINITY);

        let point = FergusonCurve::straight(Point2::origin(), Point2::origin());
        assert_eq!(point.max_curvature(), f64::INFINITY);
        assert!(!point.is_within_curvature(10.0));
    }

    #[test]
    fn beside_a_cusp_the_peak_is_found_although_no_sample_hits_it() {
        // Almost straight back: a hairpin of micrometres.
        let hairpin = FergusonCurve::from_ends(
            Point2::origin(),
            Vector2::new(1.0, 1e-4),
            Point2::new(0.01, 0.0),
            Vector2::new(-1.0, 1e-4),
        );
        let exact = hairpin.max_curvature();
        assert!(exact >= sampled_max_curvature(&hairpin, 200_000) * (1.0 - 1e-12));
        assert!(exact > 1e3);
    }

    #[test]
    fn never_below_twenty_thousand_samples_and_hardly_above() {
        use proptest::strategy::ValueTree;
        use proptest::test_runner::TestRunner;
        let mut runner = TestRunner::deterministic();
        let mut worst: f64 = 0.0;
        for _ in 0..300 {
            let curve = edge().new_tree(&mut runner).unwrap().current();
            let exact = curve.max_curvature();
            let sampled = sampled_max_curvature(&curve, 20_000);
            // Evaluating σ at the same place by two formulas differs by rounding, which grows
            // with the cancellation in P' where the curve is slow.
            let slowest = (0..=1000)
                .map(|i| curve.derivative(f64::from(i) / 1000.0).norm())
                .fold(f64::INFINITY, f64::min);
            let rounding = 1e-13 * (curve.speed_bound() / slowest).powi(2);
            assert!(
                exact >= sampled * (1.0 - rounding),
                "{curve:?}: {exact} below {sampled}"
            );
            if slowest > 0.2 * curve.speed_bound() {
                worst = worst.max(exact / sampled - 1.0);
            }
        }
        // Samples 5e-5 apart miss a peak of half width 0.05 by at most (2.5e-5/0.05)²/2 = 1.25e-7.
        assert!(worst < 1.25e-7, "{worst:e} above");
    }

    #[test]
    fn eight_nodes_are_enough_for_the_edges_of_a_search() {
        // Tangents as long as the chord, headings within 40° of it: what σ_MAX = 1 leaves of
        // edges up to 5 m.
        let (mut length_error, mut bending_error) = (0.0_f64, 0.0_f64);
        for i in 0..=16 {
            for j in 0..=16 {
                let angle = |k: u32| (f64::from(k) / 8.0 - 1.0) * 0.7;
                let curve = FergusonCurve::between(
                    Pose2::new(0.0, 0.0, angle(i)),
                    Pose2::new(5.0, 0.0, angle(j)),
                    5.0,
                );
                let (length, bending) = curve.length_and_bending();
                let (fine, bending_fine) = curve.length_and_bending_fine();
                length_error = length_error.max((length / fine - 1.0).abs());
                if bending_fine > 0.0 {
                    bending_error = bending_error.max((bending / bending_fine - 1.0).abs());
                }
            }
        }
        assert!(length_error < 1e-6, "{length_error:e}");
        assert!(bending_error < 0.02, "{bending_error:e}");
    }

    #[test]
    fn reads_back_exactly_what_it_writes() {
        let numbers = [0.1, -2.3, 4.5, 0.7, 8.1, -0.3, 1.0 / 3.0, 2.0 / 7.0];
        let curve = FergusonCurve::from_array(numbers);
        assert_eq!(curve.to_array(), numbers);
        assert_eq!(curve.end_point(), Point2::new(8.1, -0.3));
    }

    proptest! {
        #[test]
        fn ends_and_tangents_are_those_given(curve in cubic()) {
            prop_assert!((curve.point(0.0) - curve.start_point()).norm() == 0.0);
            prop_assert!((curve.point(1.0) - curve.end_point()).norm() < 1e-13);
            prop_assert!((curve.derivative(0.0) - curve.start_tangent()).norm() == 0.0);
            prop_assert!((curve.derivative(1.0) - curve.end_tangent()).norm() < 1e-13);
        }

        #[test]
        fn derivatives_match_finite_differences(curve in cubic(), t in 0.01..0.99_f64) {
            let h = 1e-5;
            let central = |f: &dyn Fn(f64) -> Vector2| (f(t + h) - f(t - h)) / (2.0 * h);
            // Truncation h² times the third derivative, here below 1e-8; rounding 1e-10.
            let d1 = central(&|t| curve.point(t).coords);
            prop_assert!((d1 - curve.derivative(t)).norm() < 1e-7);
            let d2 = central(&|t| curve.derivative(t));
            prop_assert!((d2 - curve.second_derivative(t)).norm() < 1e-7);
            let d3 = central(&|t| curve.second_derivative(t));
            prop_assert!((d3 - curve.third_derivative(t)).norm() < 1e-7);
        }

        #[test]
        fn curvature_is_the_rate_of_heading_and_its_rate_that_of_curvature(
            curve in edge(),
            t in 0.05..0.95_f64,
        ) {
            let h = 1e-6;
            let speed = curve.derivative(t).norm();
            prop_assume!(speed > 0.3);
            let turn = angle::difference(curve.heading(t + h), curve.heading(t - h)) / (2.0 * h);
            let sigma = curve.curvature(t);
            prop_assert!((turn / speed - sigma).abs() < 1e-5 * (1.0 + sigma.abs().powi(3)));
            let rate = (curve.curvature(t + h) - curve.curvature(t - h)) / (2.0 * h * speed);
            let exact = curve.curvature_rate(t);
            prop_assert!((rate - exact).abs() < 1e-4 * (1.0 + exact.abs() + sigma.abs().powi(4)));
        }

        #[test]
        fn the_limit_test_says_what_the_exact_maximum_says(
            curve in cubic(),
            limit in 0.05..20.0_f64,
        ) {
            let exact = curve.max_curvature();
            // Right at the limit the two may round differently.
            prop_assume!((exact - limit).abs() > 1e-9 * limit);
            prop_assert_eq!(curve.is_within_curvature(limit), exact <= limit);
        }

        #[test]
        fn the_maximum_is_never_below_a_sample(curve in cubic(), t in 0.0..=1.0_f64) {
            let speed = curve.derivative(t).norm() / curve.speed_bound();
            let rounding = 1e-13 / (speed * speed);
            prop_assert!(curve.curvature(t).abs() <= curve.max_curvature() * (1.0 + rounding));
        }

        #[test]
        fn turning_around_keeps_points_length_and_curvature(curve in edge(), t in 0.0..=1.0_f64) {
            let back = curve.reversed();
            prop_assert!((curve.point(t) - back.point(1.0 - t)).norm() < 1e-12);
            let (a, b) = (curve.max_curvature(), back.max_curvature());
            prop_assert!(a == b || (a - b).abs() < 1e-6 * a);
            prop_assert!((curve.length() - back.length()).abs() < 1e-12);
        }

        #[test]
        fn a_piece_has_the_points_of_the_whole(
            curve in cubic(),
            t0 in 0.0..0.5_f64,
            t1 in 0.5..1.0_f64,
            u in 0.0..=1.0_f64,
        ) {
            let piece = curve.sub_curve(t0, t1);
            prop_assert!((piece.point(u) - curve.point(t0 + u * (t1 - t0))).norm() < 1e-12);
        }

        #[test]
        fn the_bounds_hold(curve in cubic(), t0 in 0.0..0.9_f64, w in 0.0..0.1_f64, u in 0.0..=1.0_f64) {
            let t = t0 + w * u;
            let d1 = curve.derivative(t);
            prop_assert!(d1.norm() <= curve.speed_bound() * (1.0 + 1e-12));
            let rate = cross(d1, curve.second_derivative(t)).abs() / d1.norm_squared();
            prop_assert!(rate <= curve.heading_rate_bound(t0, t0 + w) * (1.0 + 1e-9));
            let (first, second) = curve.heading_bounds(t0, t0 + w);
            prop_assert_eq!(first, curve.heading_rate_bound(t0, t0 + w));
            // θ″ by a difference of θ′ on both sides, whose own error shrinks with the step.
            let step = 1e-5;
            let rate_at = |t: f64| {
                let d1 = curve.derivative(t);
                cross(d1, curve.second_derivative(t)) / d1.norm_squared()
            };
            let (a, b) = (t - step, t + step);
            if curve.heading_bounds(a, b).1.is_finite() && second.is_finite() {
                let change = (rate_at(b) - rate_at(a)).abs() / (2.0 * step);
                let wider = curve.heading_bounds(t0.min(a), (t0 + w).max(b)).1;
                prop_assert!(change <= wider * (1.0 + 1e-6) + 1e-6, "{change} {wider}");
            }
        }

        #[test]
        fn length_lies_between_the_chord_and_the_speed_bound(curve in cubic()) {
            let chord = (curve.end_point() - curve.start_point()).norm();
            let length = curve.length();
            // Quadrature error near a standstill.
            prop_assert!(length >= chord * (1.0 - 1e-3) && length <= curve.speed_bound() + 1e-12);
        }
    }
}
