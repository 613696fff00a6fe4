//! Circles, the sense in which a path goes around them, and the lines that touch two of them.
//!
//! A path that leaves a circle about c, radius r, at the outward normal u(φ) in sense s (+1: counter-clockwise) runs along the line
//! u(φ) · (x − c) = r in the direction u(φ + s π/2). It touches a second circle about c′, radius r′, in sense s′ if
//! u(φ) · (c′ − c) = r − s s′ r′, and then, with D and γ length and angle of c′ − c and x = r − s s′ r′,
//!
//! φ = γ − s arccos(x / D),  and its length is √(D² − x²).

use bikebot_geometry::{Point2, Vector2};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Counter-clockwise (+1) or clockwise (−1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sense {
    Left,
    Right,
}

impl Sense {
    pub(super) const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// s.
    #[inline]
    pub(super) fn sign(self) -> f64 {
        match self {
            Self::Left => 1.0,
            Self::Right => -1.0,
        }
    }
}

/// u(φ).
#[inline]
pub(super) fn unit(angle: f64) -> Vector2 {
    let (sin, cos) = angle.sin_cos();
    Vector2::new(cos, sin)
}

/// `angle` + 2πk within π of `middle`.
#[inline]
pub(super) fn wrap_about(angle: f64, middle: f64) -> f64 {
    angle - TAU * ((angle - middle) / TAU).round()
}

/// Normal angle at which the path meets the second circle, from the one at which it left the first.
#[inline]
pub(super) fn arrival_normal(departure: f64, from: Sense, to: Sense) -> f64 {
    if from == to {
        departure
    } else {
        departure + PI
    }
}

/// Where a circle is, how large, and which way round.
#[derive(Debug, Clone, Copy)]
pub(super) struct Round {
    pub(super) center: Point2,
    pub(super) radius: f64,
    pub(super) sense: Sense,
}

/// The ends (m) of the straight leg from one circle to the other; `None` if one lies within the other, or for different senses
/// if they overlap.
pub(super) fn bitangent(from: Round, to: Round) -> Option<(Point2, Point2)> {
    let (gamma, distance) = polar(to.center - from.center);
    let x = offset(from.radius, to.radius, from.sense == to.sense);
    if distance <= x.abs() {
        return None;
    }
    let normal = gamma - from.sense.sign() * (x / distance).acos();
    let arrival = arrival_normal(normal, from.sense, to.sense);
    Some((
        from.center + unit(normal) * from.radius,
        to.center + unit(arrival) * to.radius,
    ))
}

/// x = r − s s′ r′.
#[inline]
pub(super) fn offset(from: f64, to: f64, same_sense: bool) -> f64 {
    if same_sense { from - to } else { from + to }
}

/// Angle and length.
#[inline]
pub(super) fn polar(v: Vector2) -> (f64, f64) {
    (v.y.atan2(v.x), v.norm())
}

/// A piece of a circle, swept by the outward normal: from `alpha` on counter-clockwise by `width`, rad.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    pub(super) alpha: f64,
    pub(super) width: f64,
}

impl Span {
    pub(super) const FULL: Self = Self {
        alpha: -PI,
        width: TAU,
    };

    pub(super) fn is_full(&self) -> bool {
        self.width >= TAU
    }

    /// How far along the piece (rad), travelled in `sense`, the normal `angle` is: 0 to the width if it is on the piece; otherwise
    /// the nearer of before and after. On a full circle from 0 to 2π.
    #[inline]
    pub(super) fn progress(&self, angle: f64, sense: Sense) -> f64 {
        let raw = sense.sign() * angle + self.shift(sense);
        if self.is_full() {
            raw.rem_euclid(TAU)
        } else {
            wrap_about(raw, 0.5 * self.width)
        }
    }

    /// What to add to s φ to have the progress.
    #[inline]
    pub(super) fn shift(&self, sense: Sense) -> f64 {
        match sense {
            Sense::Left => -self.alpha,
            Sense::Right => self.alpha + self.width,
        }
    }

    /// Whether the normal `angle` is on the piece, give or take `slack` (rad).
    #[inline]
    pub(super) fn contains(&self, angle: f64, slack: f64) -> bool {
        let t = self.progress(angle, Sense::Left);
        t >= -slack && t <= self.width + slack
    }

    /// The normals of a convex corner between two sides of a solid, which lies on their left.
    pub(super) fn of_corner(before: Vector2, after: Vector2) -> Self {
        let turn = before.perp(&after).atan2(before.dot(&after));
        Self {
            alpha: before.y.atan2(before.x) - FRAC_PI_2,
            width: if turn < -FRAC_PI_2 { PI } else { turn.max(0.0) },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round(x: f64, y: f64, radius: f64, sense: Sense) -> Round {
        Round {
            center: Point2::new(x, y),
            radius,
            sense,
        }
    }

    #[test]
    fn the_four_tangents_of_two_circles_touch_both_and_leave_them_on_the_right_side() {
        for from in Sense::BOTH {
            for to in Sense::BOTH {
                let a = round(1.0, 2.0, 1.5, from);
                let b = round(7.0, -3.0, 0.5, to);
                let (p, q) = bitangent(a, b).unwrap();
                let along = (q - p).normalize();
                for (circle, touch) in [(a, p), (b, q)] {
                    let arm = touch - circle.center;
                    assert!((arm.norm() - circle.radius).abs() < 1e-12);
                    assert!(arm.dot(&along).abs() < 1e-12);
                    // Going counter-clockwise the centre is on the left.
                    assert!(along.perp(&-arm) * circle.sense.sign() > 0.0);
                }
            }
        }
    }

    #[test]
    fn circles_that_overlap_have_outer_tangents_only() {
        let a = round(0.0, 0.0, 1.0, Sense::Left);
        assert!(bitangent(a, round(1.5, 0.0, 1.0, Sense::Left)).is_some());
        assert!(bitangent(a, round(1.5, 0.0, 1.0, Sense::Right)).is_none());
        assert!(bitangent(a, round(0.2, 0.0, 0.5, Sense::Left)).is_none());
    }

    #[test]
    fn the_normals_of_a_right_angle_are_a_quarter_turn() {
        // The lower right corner of a block: along +x, then along +y.
        let span = Span::of_corner(Vector2::new(3.0, 0.0), Vector2::new(0.0, 1.0));
        assert!((span.alpha + FRAC_PI_2).abs() < 1e-15);
        assert!((span.width - FRAC_PI_2).abs() < 1e-15);
        assert!(span.contains(-0.1, 0.0) && !span.contains(0.1, 0.0));
        assert!((span.progress(-0.5, Sense::Right) - 0.5).abs() < 1e-15);
    }
}
