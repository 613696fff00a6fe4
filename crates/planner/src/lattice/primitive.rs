//! Short pieces of way with a curvature given at both ends, as single Ferguson curves.
//!
//! With tangents of the piece's length h at both ends, a chord (x, y) and a turn φ the curvatures at its ends are κ₀ and κ₁ where
//!
//! ```text
//! κ₀ h² = 6 y − 2 h sin φ,      κ₁ h² = 6 (x sin φ − y cos φ) − 2 h sin φ.
//! ```
//!
//! x is that of a way whose curvature goes linearly from κ₀ to κ₁; y and φ follow, near those of that way. So pieces joined end to end
//! have a continuous curvature, to rounding.

use bikebot_geometry::{FergusonCurve, Point2, Pose2, Vector2, cross};

/// Steps of the integration; a piece is short.
const STEPS: usize = 32;
/// Newton's steps: from so near they double the digits each.
const NEWTON: usize = 6;

/// A piece that begins at the origin along +x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Primitive {
    /// Its end.
    pub end: Pose2,
    /// κ at its end, 1/m.
    pub curvature: f64,
    /// m.
    pub length: f64,
}

impl Primitive {
    /// From curvature `from` to `to` (1/m) over `length` (m); `None` where no cubic does that, or it would bend more than `limit`
    /// on the way.
    #[must_use]
    pub fn new(from: f64, to: f64, length: f64, limit: f64) -> Option<Self> {
        let h = length / STEPS as f64;
        let heading = |s: f64| from * s + 0.5 * (to - from) * s * s / length;
        // By Simpson's rule.
        let along: f64 = (0..STEPS)
            .map(|i| {
                let s = h * i as f64;
                (heading(s).cos() + 4.0 * heading(s + 0.5 * h).cos() + heading(s + h).cos()) * h
                    / 6.0
            })
            .sum();
        let square = length * length;
        let mut turn = heading(length);
        let aside = |turn: f64| (from * square + 2.0 * length * turn.sin()) / 6.0;
        for _ in 0..NEWTON {
            let (sin, cos) = turn.sin_cos();
            let y = aside(turn);
            let error = 6.0 * (along * sin - y * cos) - 2.0 * length * sin - to * square;
            let slope =
                6.0 * (along * cos + y * sin) - 2.0 * length * cos * cos - 2.0 * length * cos;
            turn -= error / slope;
        }
        let end = Pose2::new(along, aside(turn), turn);
        let primitive = Self {
            end,
            curvature: to,
            length,
        };
        primitive
            .at(&Pose2::new(0.0, 0.0, 0.0))
            .is_within_curvature(limit)
            .then_some(primitive)
    }

    /// The same piece, begun at `pose`.
    #[must_use]
    pub fn at(&self, pose: &Pose2) -> FergusonCurve {
        let end = pose.compose(&self.end);
        let along = |pose: &Pose2, magnitude: f64| pose.direction() * magnitude;
        FergusonCurve::from_ends(
            pose.position,
            along(pose, self.length),
            end.position,
            along(&end, self.length),
        )
    }
}

/// Curves from `pose`, where the curvature is `curvature` (1/m), to `goal` with any heading: the fewer bends the sooner.
pub fn homing(pose: &Pose2, curvature: f64, goal: Point2) -> impl Iterator<Item = FergusonCurve> {
    let pose = *pose;
    let chord = pose.inverse().transform(goal).coords;
    let distance = chord.norm();
    let shares = [1.0, 0.7, 1.4];
    shares.into_iter().flat_map(move |start| {
        shares.into_iter().filter_map(move |end| {
            let a = start * distance;
            // The end tangent's part across is what gives the curvature at the start; the part along is free.
            let across = 3.0 * chord.y - 0.5 * curvature * a * a;
            let along = end * chord.x;
            let turned = pose.heading;
            let (sin, cos) = turned.sin_cos();
            let out = |v: Vector2| Vector2::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y);
            (along > 0.0).then(|| {
                FergusonCurve::from_ends(
                    pose.position,
                    pose.direction() * a,
                    goal,
                    out(Vector2::new(along, across)),
                )
            })
        })
    })
}

/// Curves from `pose`, where the curvature is `curvature` (1/m), to the pose `goal`.
pub fn arriving(pose: &Pose2, curvature: f64, goal: &Pose2) -> impl Iterator<Item = FergusonCurve> {
    let (pose, goal) = (*pose, *goal);
    let chord = goal.position - pose.position;
    let (u0, u1) = (pose.direction(), goal.direction());
    let (aside, turn, distance) = (cross(u0, chord), cross(u0, u1), chord.norm());
    [1.0, 0.7, 1.4, 0.5, 2.0]
        .into_iter()
        .filter_map(move |start| {
            let a = start * distance;
            let b = (6.0 * aside - curvature * a * a) / (2.0 * turn);
            let is_near = b > 0.3 * distance && b < 3.0 * distance;
            is_near.then(|| FergusonCurve::from_ends(pose.position, u0 * a, goal.position, u1 * b))
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_piece_begins_and_ends_with_the_curvatures_asked_for(
            from in -0.8..0.8_f64,
            change in -0.5..0.5_f64,
            length in 0.3..1.2_f64,
            heading in -3.0..3.0_f64,
        ) {
            let to = (from + change).clamp(-0.8, 0.8);
            let piece = Primitive::new(from, to, length, 1.0).expect("a gentle piece");
            let pose = Pose2::new(2.0, -1.0, heading);
            let curve = piece.at(&pose);
            use bikebot_geometry::ParametricCurve;
            prop_assert!((curve.curvature(0.0) - from).abs() < 1e-9, "{}", curve.curvature(0.0));
            prop_assert!((curve.curvature(1.0) - to).abs() < 1e-9, "{}", curve.curvature(1.0));
            // As long as asked for, to the difference between cubic and clothoid.
            prop_assert!((curve.length() - length).abs() < 1e-2 * length);
        }

        #[test]
        fn a_homing_curve_begins_as_steered_and_ends_there(
            curvature in -0.6..0.6_f64,
            ahead in 1.0..4.0_f64,
            aside in -1.0..1.0_f64,
        ) {
            use bikebot_geometry::ParametricCurve;
            let pose = Pose2::new(1.0, 2.0, 0.7);
            let goal = pose.transform(Point2::new(ahead, aside));
            let mut count = 0;
            for curve in homing(&pose, curvature, goal) {
                prop_assert!((curve.curvature(0.0) - curvature).abs() < 1e-9);
                prop_assert!((curve.end_point() - goal).norm() < 1e-12);
                count += 1;
            }
            prop_assert!(count == 9);
            let end = Pose2 { position: goal, heading: 1.3 };
            for curve in arriving(&pose, curvature, &end) {
                prop_assert!((curve.curvature(0.0) - curvature).abs() < 1e-9);
                prop_assert!((curve.end_pose().heading - 1.3).abs() < 1e-9);
            }
        }
    }
}
