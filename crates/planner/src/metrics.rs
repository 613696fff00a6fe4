//! The numbers by which paths are compared, with their definitions written out (planning choice D7).
//!
//! * **length**: by quadrature on curves, by summation on polylines.
//! * **roughness** of curves: J / L² with J = ∫ (dσ/ds)² ds, the integral of Eq. (5) over the whole path, 1/m⁵.
//! * **roughness** of polylines, on their own vertices: σ_i = turning angle over the mean of the adjacent lengths,
//!   σ = 0 at the ends, J = Σ (σ_{i+1} − σ_i)² / |leg|, over L². It grows as the inverse cube of the spacing, so a few close
//!   vertices dominate it; that is how the paper's shortcut row comes out roughest.
//! * **roughness at a fixed step**: any path resampled at [`FIXED_STEP`] (as nearly as divides its length), then the same formula.
//!   The fair comparison between polylines and curves.
//! * **max curvature**: exact on curves; a polyline has none.
//! * **jump**: largest |σ(1⁻) − σ(0⁺)| between neighbouring curves. A curvature that jumps cannot be steered exactly.
//! * **least clearance** of the swept footprint: a proven lower bound.

use crate::motion::{MotionChecker, Tolerance};
use crate::report::PlannedPath;
use bikebot_geometry::{Point2, Vector2, cross};
use serde::{Deserialize, Serialize};

/// Spacing at which paths of different kinds are compared, m.
pub const FIXED_STEP: f64 = 0.5;

/// Most pieces a path is resampled in: 500 km at the fixed step. Beyond, one figure would take longer than the plan.
const MOST_PIECES: f64 = 1e6;

/// Figures of one path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PathMetrics {
    /// Arc length L, m.
    #[serde(rename = "length_m")]
    pub length: f64,
    /// No path can be shorter than this, m: the exact shortest length for the largest disc about the footprint's reference point, headings and
    /// curvature ignored, or what was proven of it in the time there was. Absent where the search was cut short before it was asked for.
    #[serde(rename = "lower_bound_m", skip_serializing_if = "Option::is_none")]
    pub lower_bound: Option<f64>,
    /// Distance from the path's end to the goal's position, m.
    #[serde(rename = "goal_gap_m")]
    pub goal_gap: f64,
    /// J / L², 1/m⁵: on the curves themselves, or on a polyline's own vertices.
    pub roughness: f64,
    /// The same after resampling at [`FIXED_STEP`].
    pub roughness_fixed_step: f64,
    /// Largest |σ|, 1/m; absent for a polyline.
    #[serde(
        rename = "max_curvature_per_m",
        skip_serializing_if = "Option::is_none"
    )]
    pub max_curvature: Option<f64>,
    /// Largest jump of σ between neighbouring curves, 1/m; absent for a polyline.
    #[serde(
        rename = "curvature_jump_per_m",
        skip_serializing_if = "Option::is_none"
    )]
    pub curvature_jump: Option<f64>,
    /// The clearance of what was planned for is nowhere below this, m: of the footprint on curves, of the largest disc
    /// about its reference point on polylines, which have no heading to turn an outline to.
    #[serde(rename = "min_clearance_m")]
    pub min_clearance: f64,
}

impl PathMetrics {
    /// Measures `path`. The least clearance is found to within `tolerance`.
    #[must_use]
    pub fn of(
        path: &PlannedPath,
        checker: &MotionChecker<'_>,
        goal: Point2,
        lower_bound: Option<f64>,
        tolerance: Tolerance,
    ) -> Self {
        let length = path.length();
        let end = path.end();
        let goal_gap = (end - goal).norm();
        let roughness_fixed_step = roughness_at(path, FIXED_STEP);
        match path {
            PlannedPath::Polyline(line) => Self {
                length,
                lower_bound,
                goal_gap,
                roughness: roughness_of_vertices(line.vertices()),
                roughness_fixed_step,
                max_curvature: None,
                curvature_jump: None,
                min_clearance: checker
                    .inscribed()
                    .least_clearance_of_polyline(line.vertices(), tolerance),
            },
            PlannedPath::Curves(curves) => Self {
                length,
                lower_bound,
                goal_gap,
                roughness: over_square(curves.bending(), length),
                roughness_fixed_step,
                max_curvature: Some(curves.max_curvature()),
                curvature_jump: Some(curves.max_curvature_jump()),
                min_clearance: checker.least_clearance_of_path(curves, tolerance),
            },
        }
    }
}

/// J / L², 0 for a path without length.
fn over_square(bending: f64, length: f64) -> f64 {
    if length > 0.0 {
        bending / (length * length)
    } else {
        0.0
    }
}

/// Roughness of a polyline on its own vertices; coinciding neighbours count as one. 0 for a straight line.
#[must_use]
pub fn roughness_of_vertices(vertices: &[Point2]) -> f64 {
    let legs: Vec<Vector2> = vertices
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .filter(|leg| leg.norm_squared() > 0.0)
        .collect();
    let lengths: Vec<f64> = legs.iter().map(Vector2::norm).collect();
    let turn = |i: usize| {
        let (a, b) = (legs[i], legs[i + 1]);
        cross(a, b).atan2(a.dot(&b)) / (0.5 * (lengths[i] + lengths[i + 1]))
    };
    let mut bending = 0.0;
    let mut before = 0.0;
    for (i, leg) in lengths.iter().enumerate() {
        let after = if i + 1 < legs.len() { turn(i) } else { 0.0 };
        bending += (after - before) * (after - before) / leg;
        before = after;
    }
    over_square(bending, lengths.iter().sum())
}

/// Roughness of any path after resampling at about `step` (m): at the nearest step that divides its length, in a million
/// pieces at most.
#[must_use]
pub fn roughness_at(path: &PlannedPath, step: f64) -> f64 {
    let length = path.length();
    let pieces = (length / step).round().clamp(0.0, MOST_PIECES);
    if pieces.is_nan() || pieces < 1.0 {
        return 0.0;
    }
    let points: Vec<_> = (0..=pieces as usize)
        .map(|i| path.position_at(length * i as f64 / pieces))
        .collect();
    roughness_of_vertices(&points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::Polyline;

    #[test]
    fn a_straight_line_has_no_roughness() {
        let points: Vec<_> = (0..5)
            .map(|i| Point2::new(f64::from(i), 2.0 * f64::from(i)))
            .collect();
        // The turning angle of collinear legs is zero up to rounding.
        assert!(roughness_of_vertices(&points) < 1e-30);
        assert_eq!(roughness_of_vertices(&points[..1]), 0.0);
        assert_eq!(roughness_of_vertices(&[]), 0.0);
    }

    #[test]
    fn one_right_angle_between_unit_legs_has_the_roughness_computed_by_hand() {
        let points = [
            Point2::new(0.0, 0.0),
            Point2::new(1.0, 0.0),
            Point2::new(1.0, 1.0),
        ];
        // σ = 0, π/2, 0 on legs of 1 m: J = 2 (π/2)², L = 2.
        let expected = 2.0 * std::f64::consts::FRAC_PI_2.powi(2) / 4.0;
        assert!((roughness_of_vertices(&points) - expected).abs() < 1e-15);
    }

    #[test]
    fn coinciding_vertices_do_not_count() {
        let corner = [
            Point2::new(0.0, 0.0),
            Point2::new(1.0, 0.0),
            Point2::new(1.0, 1.0),
        ];
        let doubled = [corner[0], corner[0], corner[1], corner[1], corner[2]];
        assert_eq!(
            roughness_of_vertices(&corner),
            roughness_of_vertices(&doubled)
        );
    }

    #[test]
    fn roughness_of_vertices_falls_with_the_fifth_power_of_the_size() {
        let zigzag: Vec<_> = (0..9)
            .map(|i| Point2::new(f64::from(i), f64::from(i % 2)))
            .collect();
        let twice: Vec<_> = zigzag.iter().map(|p| p * 2.0).collect();
        let ratio = roughness_of_vertices(&zigzag) / roughness_of_vertices(&twice);
        assert!((ratio - 32.0).abs() < 1e-12, "{ratio}");
    }

    /// Found in review: 10⁸ points were made of a path of 50 000 km.
    #[test]
    fn a_path_of_thousands_of_kilometres_is_resampled_a_bounded_number_of_times() {
        let corners = [(0.0, 0.0), (4e7, 0.0), (4e7, 1e7)].map(|(x, y)| Point2::new(x, y));
        let line = PlannedPath::Polyline(Polyline::new(corners.to_vec()).unwrap());
        // A right angle between steps of 50 m: J = 2 (π/2)² / 50³.
        let expected = 2.0 * (std::f64::consts::FRAC_PI_2 / 50.0).powi(2) / 50.0 / 5e7_f64.powi(2);
        assert!((roughness_at(&line, FIXED_STEP) / expected - 1.0).abs() < 1e-6);
        assert_eq!(roughness_at(&line, f64::NAN), 0.0);
    }

    #[test]
    fn a_fixed_step_does_not_see_where_the_vertices_are() {
        let corner = vec![
            Point2::new(0.0, 0.0),
            Point2::new(4.0, 0.0),
            Point2::new(4.0, 4.0),
        ];
        let mut more = corner.clone();
        more.insert(1, Point2::new(3.999, 0.0));
        let at = |v: &[Point2]| {
            let line = Polyline::new(v.to_vec()).expect("finite vertices");
            roughness_at(&PlannedPath::Polyline(line), 0.5)
        };
        // Resampled points agree up to rounding.
        assert!((at(&corner) / at(&more) - 1.0).abs() < 1e-9);
    }
}
