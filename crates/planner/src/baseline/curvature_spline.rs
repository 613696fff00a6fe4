//! Ferguson pieces through given points with a second derivative that does not jump.
//!
//! The cubic spline over the arc lengths of its knots. Its second derivative is linear between knots, as the curvature of a
//! chain of clothoids is; so the spline through points of such a chain keeps to it in curvature too, and is a chain of curves
//! that can be checked exactly.

use bikebot_geometry::{FergusonCurve, Point2, Vector2};

/// The spline through `points` (m) at the strictly increasing arc lengths `knots` (m), with the unit tangents given at both ends.
/// Empty for fewer than two points.
pub(crate) fn through(
    points: &[Point2],
    knots: &[f64],
    [first, last]: [Vector2; 2],
) -> Vec<FergusonCurve> {
    let n = points.len();
    if n < 2 {
        return Vec::new();
    }
    let width = |i: usize| knots[i + 1] - knots[i];
    let slope = |i: usize| (points[i + 1] - points[i]) / width(i);
    // Equal second derivatives at inner knots: with widths a before and b after,
    // b m₋ + 2 (a + b) m + a m₊ = 3 (b d₋ + a d₊). Eliminated forwards, then solved backwards.
    let mut tangents = vec![first; n];
    tangents[n - 1] = last;
    let mut above = vec![0.0; n];
    for i in 1..n - 1 {
        let (a, b) = (width(i - 1), width(i));
        let right = (slope(i - 1) * b + slope(i) * a) * 3.0;
        let pivot = 2.0 * (a + b) - b * above[i - 1];
        above[i] = a / pivot;
        tangents[i] = (right - tangents[i - 1] * b) / pivot;
    }
    for i in (1..n - 1).rev() {
        let next = tangents[i + 1];
        tangents[i] -= next * above[i];
    }
    (0..n - 1)
        .map(|i| {
            FergusonCurve::from_ends(
                points[i],
                tangents[i] * width(i),
                points[i + 1],
                tangents[i + 1] * width(i),
            )
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::clothoid::State;
    use super::*;
    use bikebot_geometry::CurvePath;

    #[test]
    fn follows_a_chain_of_clothoids_without_jumps_of_curvature() {
        let mut state = State {
            position: Point2::new(1.0, -2.0),
            heading: 0.4,
            curvature: 0.0,
        };
        let mut points = vec![state.position];
        let mut knots = vec![0.0];
        let begins = Vector2::new(0.4f64.cos(), 0.4f64.sin());
        let mut bending = 0.0;
        for i in 0..40 {
            let (rate, h) = (0.1 * f64::from(i).sin(), if i < 25 { 0.5 } else { 0.35 });
            state = state.after(rate, h);
            points.push(state.position);
            knots.push(knots[knots.len() - 1] + h);
            bending += rate * rate * h;
        }
        let ends = Vector2::new(state.heading.cos(), state.heading.sin());
        let path = CurvePath::new(through(&points, &knots, [begins, ends])).unwrap();
        assert!(
            path.max_curvature_jump() < 1e-12,
            "{}",
            path.max_curvature_jump()
        );
        assert!((path.length() - knots[40]).abs() < 1e-5);
        // Half-metre steps: the figures of the clothoids to a percent.
        assert!(
            (path.bending() / bending - 1.0).abs() < 0.01,
            "{} {bending}",
            path.bending()
        );
    }

    #[test]
    fn two_points_are_one_piece_with_the_tangents_given() {
        let points = [Point2::new(0.0, 0.0), Point2::new(2.0, 0.0)];
        let ends = [Vector2::new(0.6, 0.8), Vector2::new(0.6, -0.8)];
        let curves = through(&points, &[0.0, 2.0], ends);
        assert_eq!(curves.len(), 1);
        assert_eq!(curves[0].start_tangent(), ends[0] * 2.0);
        assert_eq!(curves[0].end_tangent(), ends[1] * 2.0);
        assert!(through(&points[..1], &[0.0], ends).is_empty());
    }
}
