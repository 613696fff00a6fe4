//! A curve with continuous curvature through points of a given one.
//!
//! Joined Ferguson–Coons curves agree in heading but jump in curvature. The refit takes points of such a
//! path at equal distances along it and lays the clamped cubic spline of uniform parameter through them:
//! with points `p_i` and tangents `m_i`,
//!
//! ```text
//! m_(i-1) + 4 m_i + m_(i+1) = 3 (p_(i+1) - p_(i-1)),
//! ```
//!
//! the ends keeping their directions. Its pieces are Ferguson–Coons curves that agree in their second
//! derivative, too, so the curvature is continuous; between the points it leaves the given path by about
//! the jump times the square of the distance over fifty.

use bikebot_geometry::{CurvePath, FergusonCurve, GeometryError, Point2, Vector2};

/// The refit of `path` through points about `spacing` m apart; at least two pieces, and at most a hundred
/// thousand.
///
/// # Errors
///
/// As [`CurvePath::new`].
pub fn refit(path: &CurvePath, spacing: f64) -> Result<CurvePath, GeometryError> {
    let pieces = (path.length() / spacing).round().clamp(2.0, 1e5) as usize;
    let step = path.length() / pieces as f64;
    let points: Vec<Point2> = (0..=pieces)
        .map(|i| path.at(i as f64 * step).position)
        .collect();
    let tangents = clamped_tangents(
        &points,
        path.start_pose().direction() * step,
        path.end_pose().direction() * step,
    );
    CurvePath::new(
        (0..pieces)
            .map(|i| {
                FergusonCurve::from_ends(points[i], tangents[i], points[i + 1], tangents[i + 1])
            })
            .collect(),
    )
}

/// The tangents that make the second derivative continuous, by elimination down and substitution up.
fn clamped_tangents(points: &[Point2], first: Vector2, last: Vector2) -> Vec<Vector2> {
    let n = points.len();
    let mut tangents = vec![first; n];
    let mut factors = vec![0.0; n];
    for i in 1..n - 1 {
        let right = (points[i + 1] - points[i - 1]) * 3.0;
        let pivot = 4.0 - factors[i - 1];
        factors[i] = 1.0 / pivot;
        tangents[i] = (right - tangents[i - 1]) / pivot;
    }
    tangents[n - 1] = last;
    for i in (1..n - 1).rev() {
        let ahead = tangents[i + 1];
        tangents[i] -= ahead * factors[i];
    }
    tangents
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::Pose2;

    fn course() -> CurvePath {
        let poses = [
            Pose2::new(1.0, 1.0, 0.0),
            Pose2::new(4.8, 2.2, 0.96),
            Pose2::new(7.0, 5.6, 0.52),
            Pose2::new(8.0, 8.0, 1.57),
        ];
        let curve = |p: &[Pose2]| {
            FergusonCurve::between(p[0], p[1], 1.2 * (p[1].position - p[0].position).norm())
        };
        CurvePath::new(poses.windows(2).map(curve).collect()).unwrap()
    }

    #[test]
    fn has_no_jump_of_curvature_and_stays_by_the_path() {
        let path = course();
        assert!(path.max_curvature_jump() > 0.5);
        let smooth = refit(&path, 0.5).unwrap();
        assert!(smooth.max_curvature_jump() < 1e-9 && smooth.max_heading_jump() < 1e-9);
        for place in smooth.sample(0.02) {
            let distance = path.project(place.position, 0.0, path.length()).distance;
            assert!(distance < 0.006, "{distance} at {}", place.s);
        }
        let (start, end) = (smooth.start_pose(), smooth.end_pose());
        assert!((start.heading - path.start_pose().heading).abs() < 1e-12);
        assert!((end.heading - path.end_pose().heading).abs() < 1e-12);
        assert!((end.position - path.end_pose().position).norm() < 1e-12);
    }

    #[test]
    fn a_straight_stays_one() {
        let path = CurvePath::new(vec![FergusonCurve::straight(
            Point2::new(0.0, 0.0),
            Point2::new(3.0, 4.0),
        )])
        .unwrap();
        let smooth = refit(&path, 0.7).unwrap();
        assert!((smooth.length() - 5.0).abs() < 1e-12 && smooth.max_curvature() < 1e-12);
    }
}
