//! Angles on the circle: wrapping, shortest difference, interpolation along the shorter arc.

use std::f64::consts::{PI, TAU};

/// The angle equal to `a` modulo 2π in (−π, π], rad. NaN for a value that is not finite.
#[must_use]
#[inline]
pub fn wrap(a: f64) -> f64 {
    if a > -PI && a <= PI {
        return a;
    }
    let wrapped = a - TAU * ((a - PI) / TAU).ceil();
    // Rounding may leave the half-open interval by one unit in the last place.
    if wrapped <= -PI || wrapped > PI {
        PI
    } else {
        wrapped
    }
}

/// The turn that takes heading `from` to heading `to` along the shorter arc, in (−π, π], rad.
#[must_use]
#[inline]
pub fn difference(to: f64, from: f64) -> f64 {
    wrap(to - from)
}

/// The angle a fraction `t` of the way from `a` to `b` along the shorter arc, in (−π, π], rad.
#[must_use]
pub fn interpolate(a: f64, b: f64, t: f64) -> f64 {
    wrap(a + t * difference(b, a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn half_a_turn_is_plus_pi_from_either_side() {
        assert_eq!(wrap(PI), PI);
        assert_eq!(wrap(-PI), PI);
        assert_eq!(wrap(3.0 * PI), PI);
        assert_eq!(wrap(0.0), 0.0);
    }

    #[test]
    fn the_shorter_arc_crosses_the_cut() {
        // From 170° to −170° is 20° to the left.
        let d = difference((-170.0_f64).to_radians(), 170.0_f64.to_radians());
        assert!((d - 20.0_f64.to_radians()).abs() < 1e-14);
        let half = interpolate(170.0_f64.to_radians(), (-170.0_f64).to_radians(), 0.5);
        assert!((half.abs() - PI).abs() < 1e-14);
    }

    #[test]
    fn what_is_not_finite_stays_visible() {
        assert!(wrap(f64::INFINITY).is_nan());
        assert!(wrap(f64::NAN).is_nan());
    }

    proptest! {
        #[test]
        fn wrapping_lands_in_the_interval_and_keeps_the_direction(a in -1e4..1e4_f64) {
            let w = wrap(a);
            prop_assert!(w > -PI && w <= PI);
            // An angle of 1e4 rad has 2e-12 rad of rounding in itself.
            prop_assert!((w.cos() - a.cos()).abs() < 1e-11 && (w.sin() - a.sin()).abs() < 1e-11);
            prop_assert_eq!(wrap(w), w);
        }

        #[test]
        fn adding_the_difference_arrives(a in -10.0..10.0_f64, b in -10.0..10.0_f64) {
            let arrived = interpolate(a, b, 1.0);
            prop_assert!(difference(arrived, b).abs() < 1e-13);
            prop_assert!(difference(b, a).abs() <= PI);
        }
    }
}
