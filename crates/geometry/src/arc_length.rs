//! Arc length of a curve and its inverse — Eq. (6)–(7).
//!
//! s(T) = ∫ |dP/dT| dT has no closed form for a cubic. A table of s at equal steps of T is
//! integrated once; between table entries the same quadrature continues, so s(T) is as accurate
//! as the table, and the inverse is a Newton iteration kept inside its table interval.

use crate::{FergusonCurve, ParametricCurve, quadrature};

/// Most table intervals. With eight nodes each, the length of any curve within a curvature limit is
/// exact to rounding; near cusps the error stays below a millionth of the length.
const MOST_INTERVALS: usize = 32;
/// Intervals where the speed |P'| changes by no more than the factor [`EVEN`]: most pieces of a refined path.
const FEW_INTERVALS: usize = 4;
/// So even a speed has no complex zero near the interval, and eight nodes on a quarter of it are exact to rounding.
const EVEN: f64 = 1.5;

/// A Newton step of T no longer than this is the last.
const SURE: f64 = 1e-8;

/// The table s(T) of one curve.
#[derive(Debug, Clone, PartialEq)]
pub struct ArcLength {
    curve: FergusonCurve,
    intervals: usize,
    /// s at T = i / `intervals`, m; what follows is not used.
    table: [f64; MOST_INTERVALS + 1],
}

impl ArcLength {
    /// Integrates the table for `curve`.
    #[must_use]
    pub fn new(curve: &FergusonCurve) -> Self {
        let intervals = if curve.speed_bound() <= EVEN * curve.least_speed_bound() {
            FEW_INTERVALS
        } else {
            MOST_INTERVALS
        };
        let mut table = Self {
            curve: *curve,
            intervals,
            table: [0.0; MOST_INTERVALS + 1],
        };
        for i in 0..intervals {
            let piece = integrate(curve, table.knot(i), table.knot(i + 1));
            table.table[i + 1] = table.table[i] + piece;
        }
        table
    }

    fn knot(&self, i: usize) -> f64 {
        i as f64 / self.intervals as f64
    }

    /// The curve the table belongs to.
    #[must_use]
    pub fn curve(&self) -> &FergusonCurve {
        &self.curve
    }

    /// Length `L` of the whole curve, m.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.table[self.intervals]
    }

    /// s(T), m. `t` is clamped to [0, 1].
    #[must_use]
    pub fn arc_length_at(&self, t: f64) -> f64 {
        let t = t.clamp(0.0, 1.0);
        let i = ((t * self.intervals as f64) as usize).min(self.intervals - 1);
        if t == self.knot(i) {
            return self.table[i];
        }
        if t >= 1.0 {
            return self.length();
        }
        self.table[i] + integrate(&self.curve, self.knot(i), t)
    }

    /// T at arc length `s` (m); `s` is clamped to [0, L], and NaN counts as 0.
    #[must_use]
    pub fn parameter_at(&self, s: f64) -> f64 {
        let is_ahead = s > 0.0 && self.length() > 0.0;
        if !is_ahead {
            return 0.0;
        }
        if s >= self.length() {
            return 1.0;
        }
        let known = &self.table[..=self.intervals];
        let i = (known.partition_point(|&x| x <= s) - 1).min(self.intervals - 1);
        let (mut low, mut high) = (self.knot(i), self.knot(i + 1));
        let (s_low, s_high) = (self.table[i], self.table[i + 1]);
        let mut t = low + (high - low) * (s - s_low) / (s_high - s_low);
        // Speed changes little over an interval: two or three steps reach rounding. The cap
        // is for curves with a standstill, where the bracket still halves each time.
        for _ in 0..60 {
            let error = s_low + integrate(&self.curve, self.knot(i), t) - s;
            if error.abs() <= 1e-15 * self.length() {
                return t;
            }
            if error > 0.0 {
                high = t;
            } else {
                low = t;
            }
            let newton = t - error / self.curve.derivative(t).norm();
            let next = if newton > low && newton < high {
                // What is left after such a step is of the order of its square.
                if (newton - t).abs() <= SURE {
                    return newton;
                }
                newton
            } else {
                0.5 * (low + high)
            };
            if (next - t).abs() <= 1e-15 {
                return next;
            }
            t = next;
        }
        t
    }
}

fn integrate(curve: &FergusonCurve, from: f64, to: f64) -> f64 {
    quadrature::EIGHT.integrate(from, to, |t| curve.derivative(t).norm())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Point2, Pose2, Vector2};
    use proptest::prelude::*;

    fn bend() -> impl Strategy<Value = FergusonCurve> {
        (1.0..8.0_f64, -1.2..1.2_f64, -1.2..1.2_f64, 0.5..1.5_f64).prop_map(|(d, a, b, k)| {
            FergusonCurve::between(Pose2::new(0.0, 0.0, a), Pose2::new(d, 0.0, b), k * d)
        })
    }

    #[test]
    fn a_straight_line_is_travelled_evenly() {
        let line = FergusonCurve::straight(Point2::new(0.0, 0.0), Point2::new(3.0, 4.0));
        let table = ArcLength::new(&line);
        assert!((table.length() - 5.0).abs() < 1e-14);
        assert!((table.arc_length_at(0.3) - 1.5).abs() < 1e-14);
        assert!((table.parameter_at(1.5) - 0.3).abs() < 1e-14);
    }

    #[test]
    fn a_parabola_has_the_length_of_its_closed_form() {
        // P = (T, T²): L = (2√5 + asinh 2)/4.
        let parabola = FergusonCurve::from_ends(
            Point2::origin(),
            Vector2::new(1.0, 0.0),
            Point2::new(1.0, 1.0),
            Vector2::new(1.0, 2.0),
        );
        let exact = (2.0 * 5.0_f64.sqrt() + 2.0_f64.asinh()) / 4.0;
        assert!((ArcLength::new(&parabola).length() - exact).abs() < 1e-14);
        assert!((parabola.length() - exact).abs() < 1e-13);
    }

    #[test]
    fn outside_the_curve_is_clamped() {
        let line = FergusonCurve::straight(Point2::new(0.0, 0.0), Point2::new(2.0, 0.0));
        let table = ArcLength::new(&line);
        assert_eq!(table.parameter_at(-1.0), 0.0);
        assert_eq!(table.parameter_at(9.0), 1.0);
        assert_eq!(table.parameter_at(f64::NAN), 0.0);
        assert_eq!(table.arc_length_at(-0.5), 0.0);
        assert_eq!(table.arc_length_at(1.5), table.length());
        let nothing = ArcLength::new(&FergusonCurve::straight(Point2::origin(), Point2::origin()));
        assert_eq!(nothing.parameter_at(0.5), 0.0);
    }

    proptest! {
        #[test]
        fn arc_length_grows_with_the_parameter(c in bend(), t0 in 0.0..1.0_f64, t1 in 0.0..1.0_f64) {
            let table = ArcLength::new(&c);
            let (low, high) = (t0.min(t1), t0.max(t1));
            prop_assert!(table.arc_length_at(low) <= table.arc_length_at(high));
            let chord = (c.point(high) - c.point(low)).norm();
            prop_assert!(table.arc_length_at(high) - table.arc_length_at(low) >= chord - 1e-12);
        }

        /// The twelfth part of a bend is ridden at an even speed; two panels of its halves are the other way to its length.
        #[test]
        fn few_intervals_are_as_good_as_many_where_the_speed_is_even(c in bend(), from in 0.0..0.9_f64) {
            let piece = c.sub_curve(from, from + 0.08);
            let table = ArcLength::new(&piece);
            prop_assume!(table.intervals == FEW_INTERVALS);
            let finely: f64 = (0..MOST_INTERVALS)
                .map(|i| [i, i + 1].map(|i| i as f64 / MOST_INTERVALS as f64))
                .map(|[from, to]| integrate(&piece, from, to))
                .sum();
            prop_assert!((table.length() / finely - 1.0).abs() < 1e-14);
        }

        #[test]
        fn the_inverse_returns_to_where_it_came_from(c in bend(), u in 0.0..=1.0_f64) {
            let table = ArcLength::new(&c);
            let s = u * table.length();
            prop_assert!((table.arc_length_at(table.parameter_at(s)) - s).abs() < 1e-12 * table.length());
        }
    }
}
