//! Curves joined end to end, travelled by one running arc length.

use crate::bernstein;
use crate::{ArcLength, FergusonCurve, GeometryError, ParametricCurve, Point2, Pose2, cross};

/// Largest distance between the end of one segment and the start of the next, m. Segments built
/// from shared nodes meet exactly; a micrometre allows for a file printed with few digits.
const MAX_GAP: f64 = 1e-6;

/// Most pieces one segment is sampled in, so that a step of nothing fills no memory.
const MAX_PIECES: f64 = 10_000.0;

/// A path of Ferguson–Coons segments, each starting where the one before ends.
///
/// Positions are continuous. Headings and curvature may jump at the joints;
/// [`Self::max_curvature_jump`] and [`Self::max_heading_jump`] say by how much.
#[derive(Debug, Clone, PartialEq)]
pub struct CurvePath {
    segments: Vec<FergusonCurve>,
    tables: Vec<ArcLength>,
    /// Arc length at the start of each segment, and at the end of the last, m.
    starts: Vec<f64>,
}

/// One place on a [`CurvePath`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathPoint {
    /// Position in the world frame, m.
    pub position: Point2,
    /// Direction of travel, rad, counter-clockwise from +x.
    pub heading: f64,
    /// Curvature σ, 1/m, positive to the left.
    pub curvature: f64,
    /// Arc length from the start of the path, m.
    pub s: f64,
}

/// The nearest place of a [`CurvePath`] to a given point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathProjection {
    /// The segment the foot lies on.
    pub segment: usize,
    /// Parameter `T` of the foot on that segment.
    pub t: f64,
    /// Arc length of the foot from the start of the path, m.
    pub s: f64,
    /// The nearest point itself, m.
    pub foot: Point2,
    /// Offset of the point from the path's tangent line at the foot, m, positive to the left.
    pub lateral: f64,
    /// Distance between the point and its foot, m.
    pub distance: f64,
}

impl CurvePath {
    /// Joins `segments` in the given order.
    ///
    /// # Errors
    ///
    /// [`GeometryError::Empty`] without a segment, [`GeometryError::NotFinite`] and
    /// [`GeometryError::NoLength`] for a segment that is no curve, [`GeometryError::Gap`] where
    /// two neighbours end and start more than a micrometre apart.
    pub fn new(segments: Vec<FergusonCurve>) -> Result<Self, GeometryError> {
        if segments.is_empty() {
            return Err(GeometryError::Empty { what: "path" });
        }
        let mut starts = Vec::with_capacity(segments.len() + 1);
        let mut tables = Vec::with_capacity(segments.len());
        let mut s = 0.0;
        starts.push(s);
        for (index, segment) in segments.iter().enumerate() {
            if !segment.is_finite() {
                return Err(GeometryError::NotFinite {
                    what: "path",
                    index,
                });
            }
            let table = ArcLength::new(segment);
            // Overflow of huge coordinates gives an infinite length: refused as well.
            if !(table.length() > 0.0 && table.length().is_finite()) {
                return Err(GeometryError::NoLength { index });
            }
            if index > 0 {
                let gap = (segment.start_point() - segments[index - 1].end_point()).norm();
                if gap > MAX_GAP {
                    return Err(GeometryError::Gap { index, gap });
                }
            }
            s += table.length();
            starts.push(s);
            tables.push(table);
        }
        Ok(Self {
            segments,
            tables,
            starts,
        })
    }

    /// The segments in order of travel.
    #[must_use]
    pub fn segments(&self) -> &[FergusonCurve] {
        &self.segments
    }

    /// Length of the whole path, m.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.starts[self.segments.len()]
    }

    /// Arc length at the start of segment `i`, m; with `i` equal to the number of segments, the
    /// length of the path.
    ///
    /// # Panics
    ///
    /// If `i` is larger than the number of segments.
    #[must_use]
    pub fn segment_start(&self, i: usize) -> f64 {
        self.starts[i]
    }

    /// The place at arc length `s` (m), clamped to the ends; at a joint that of the segment ahead.
    #[must_use]
    pub fn at(&self, s: f64) -> PathPoint {
        let (i, t) = self.locate(s);
        self.place(i, t, s.clamp(0.0, self.length()))
    }

    /// Segment and parameter at arc length `s` (m), clamped to the ends.
    #[must_use]
    pub fn locate(&self, s: f64) -> (usize, f64) {
        let after = self.starts.partition_point(|&x| x <= s);
        let i = after.saturating_sub(1).min(self.segments.len() - 1);
        (i, self.tables[i].parameter_at(s - self.starts[i]))
    }

    /// Pose at the start of the path.
    #[must_use]
    pub fn start_pose(&self) -> Pose2 {
        self.segments[0].start_pose()
    }

    /// Pose at the end of the path.
    #[must_use]
    pub fn end_pose(&self) -> Pose2 {
        self.segments[self.segments.len() - 1].end_pose()
    }

    /// The largest |σ| on any segment, 1/m, exact; infinite if one has a cusp.
    #[must_use]
    pub fn max_curvature(&self) -> f64 {
        self.segments
            .iter()
            .map(FergusonCurve::max_curvature)
            .fold(0.0, f64::max)
    }

    /// The largest jump of curvature at a joint, |σ(1⁻) − σ(0⁺)|, 1/m. Zero for one segment.
    #[must_use]
    pub fn max_curvature_jump(&self) -> f64 {
        self.segments
            .windows(2)
            .map(|pair| (pair[0].curvature(1.0) - pair[1].curvature(0.0)).abs())
            .fold(0.0, f64::max)
    }

    /// The largest jump of heading at a joint, rad. Zero for one segment.
    #[must_use]
    pub fn max_heading_jump(&self) -> f64 {
        self.segments
            .windows(2)
            .map(|pair| {
                let turn = pair[1].start_pose().heading - pair[0].end_pose().heading;
                crate::angle::wrap(turn).abs()
            })
            .fold(0.0, f64::max)
    }

    /// Bending `J = ∫ (dσ/ds)² ds` over all segments, 1/m³. Jumps at joints do not enter.
    #[must_use]
    pub fn bending(&self) -> f64 {
        self.segments
            .iter()
            .map(|c| c.length_and_bending_fine().1)
            .sum()
    }

    /// Places along the whole path, at most `max_step` (m) apart, with every joint and both ends.
    /// Each segment is divided evenly by arc length, into 10 000 pieces at most.
    #[must_use]
    pub fn sample(&self, max_step: f64) -> Vec<PathPoint> {
        let mut places = Vec::new();
        for (i, table) in self.tables.iter().enumerate() {
            let pieces = (table.length() / max_step).ceil().clamp(1.0, MAX_PIECES);
            // A step that is not a number asks for nothing between the joints.
            let pieces = if pieces.is_nan() { 1.0 } else { pieces };
            for k in 0..pieces as usize {
                let s = table.length() * k as f64 / pieces;
                places.push(self.place(i, table.parameter_at(s), self.starts[i] + s));
            }
        }
        places.push(self.place(self.segments.len() - 1, 1.0, self.length()));
        places
    }

    /// The place nearest to `p` among those with arc length between `s_from` and `s_to` (m); the
    /// first of several. Exact: the feet are roots of the quintic (P − p)·P′.
    ///
    /// A window that moves along with the traveller keeps the foot from jumping to a neighbouring
    /// lane of the path.
    #[must_use]
    pub fn project(&self, p: Point2, s_from: f64, s_to: f64) -> PathProjection {
        let (first, t_first) = self.locate(s_from);
        let (last, t_last) = self.locate(s_to.max(s_from));
        let (mut segment, mut t_best, mut squared) = (first, t_first, f64::INFINITY);
        for i in first..=last {
            let curve = &self.segments[i];
            let low = if i == first { t_first } else { 0.0 };
            let high = if i == last { t_last } else { 1.0 };
            let mut consider = |t: f64| {
                if t >= low && t <= high {
                    let d = (curve.point(t) - p).norm_squared();
                    if d < squared {
                        (segment, t_best, squared) = (i, t, d);
                    }
                }
            };
            consider(low);
            bernstein::for_each_root(&foot_polynomial(curve, p), &mut consider);
            consider(high);
        }
        let curve = &self.segments[segment];
        let foot = curve.point(t_best);
        let (sin, cos) = curve.heading(t_best).sin_cos();
        PathProjection {
            segment,
            t: t_best,
            s: self.starts[segment] + self.tables[segment].arc_length_at(t_best),
            foot,
            lateral: cross(crate::Vector2::new(cos, sin), p - foot),
            distance: squared.sqrt(),
        }
    }

    fn place(&self, segment: usize, t: f64, s: f64) -> PathPoint {
        let curve = &self.segments[segment];
        PathPoint {
            position: curve.point(t),
            heading: curve.heading(t),
            curvature: curve.curvature(t),
            s,
        }
    }
}

/// Power coefficients of (P(T) − p)·P′(T), constant first.
fn foot_polynomial(curve: &FergusonCurve, p: Point2) -> [f64; 6] {
    let d3 = curve.third_derivative(0.0) / 6.0;
    let d2 = curve.second_derivative(0.0) / 2.0;
    let cubic = [curve.start_point() - p, curve.start_tangent(), d2, d3];
    let slope = [curve.start_tangent(), 2.0 * d2, 3.0 * d3];
    let mut q = [0.0; 6];
    for (i, a) in cubic.iter().enumerate() {
        for (j, b) in slope.iter().enumerate() {
            q[i + j] += a.dot(b);
        }
    }
    q
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vector2;
    use proptest::prelude::*;
    use std::f64::consts::FRAC_PI_2;

    /// Straight, a left bend, straight up.
    fn path() -> CurvePath {
        let a = Pose2::new(0.0, 0.0, 0.0);
        let b = Pose2::new(4.0, 0.0, 0.0);
        let c = Pose2::new(7.0, 3.0, FRAC_PI_2);
        let d = Pose2::new(7.0, 6.0, FRAC_PI_2);
        CurvePath::new(vec![
            FergusonCurve::between(a, b, 4.0),
            FergusonCurve::between(b, c, 4.9),
            FergusonCurve::between(c, d, 3.0),
        ])
        .unwrap()
    }

    #[test]
    fn places_are_continuous_across_joints() {
        let path = path();
        for i in 1..3 {
            let s = path.segment_start(i);
            let (before, after) = (path.at(s - 1e-9), path.at(s));
            assert!((before.position - after.position).norm() < 2e-9);
            assert!((before.heading - after.heading).abs() < 1e-8);
        }
        assert_eq!(path.at(-1.0).position, Point2::new(0.0, 0.0));
        assert!((path.at(1e9).position - Point2::new(7.0, 6.0)).norm() < 1e-14);
        assert_eq!(path.end_pose().position, Point2::new(7.0, 6.0));
    }

    #[test]
    fn the_figures_of_the_path_are_those_of_its_segments() {
        let path = path();
        let bend = &path.segments()[1];
        assert_eq!(path.max_curvature(), bend.max_curvature());
        assert!((path.length() - (7.0 + bend.length())).abs() < 1e-12);
        let jump = bend.curvature(0.0).abs().max(bend.curvature(1.0).abs());
        assert!((path.max_curvature_jump() - jump).abs() < 1e-12);
        assert!(path.max_heading_jump() < 1e-12);
        assert!((path.bending() - bend.length_and_bending_fine().1).abs() < 1e-12);
    }

    #[test]
    fn samples_keep_the_step_and_both_ends() {
        let path = path();
        let places = path.sample(0.25);
        assert_eq!(places[0].s, 0.0);
        assert_eq!(places[places.len() - 1].s, path.length());
        for pair in places.windows(2) {
            let step = pair[1].s - pair[0].s;
            assert!(step > 0.0 && step <= 0.25 + 1e-12);
            assert!((pair[1].position - pair[0].position).norm() <= step + 1e-12);
        }
    }

    #[test]
    fn a_step_of_nothing_is_no_endless_sampling() {
        let path = path();
        assert_eq!(path.sample(0.0).len(), 3 * 10_000 + 1);
        assert_eq!(path.sample(1e-300).len(), 3 * 10_000 + 1);
        for step in [f64::NAN, -1.0, f64::INFINITY] {
            assert_eq!(path.sample(step).len(), 4);
        }
        assert_eq!(path.at(f64::NAN).position, Point2::origin());
    }

    #[test]
    fn the_lateral_offset_is_positive_to_the_left() {
        let path = path();
        let left = path.project(Point2::new(2.0, 0.5), 0.0, path.length());
        assert!((left.lateral - 0.5).abs() < 1e-12 && (left.s - 2.0).abs() < 1e-12);
        let right = path.project(Point2::new(2.0, -0.5), 0.0, path.length());
        assert!((right.lateral + 0.5).abs() < 1e-12);
        // A window that excludes the nearest place is respected.
        let windowed = path.project(Point2::new(2.0, 0.5), 3.0, 5.0);
        assert!((windowed.s - 3.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_path_is_refused() {
        assert_eq!(
            CurvePath::new(vec![]),
            Err(GeometryError::Empty { what: "path" })
        );
        let a = FergusonCurve::straight(Point2::new(0.0, 0.0), Point2::new(1.0, 0.0));
        let far = FergusonCurve::straight(Point2::new(2.0, 0.0), Point2::new(3.0, 0.0));
        assert_eq!(
            CurvePath::new(vec![a, far]),
            Err(GeometryError::Gap { index: 1, gap: 1.0 })
        );
        let point = FergusonCurve::straight(Point2::origin(), Point2::origin());
        assert_eq!(
            CurvePath::new(vec![point]),
            Err(GeometryError::NoLength { index: 0 })
        );
        let infinite = FergusonCurve::straight(Point2::origin(), Point2::new(f64::INFINITY, 0.0));
        assert_eq!(
            CurvePath::new(vec![a, infinite]),
            Err(GeometryError::NotFinite {
                what: "path",
                index: 1
            })
        );
    }

    proptest! {
        #[test]
        fn no_place_in_the_window_is_nearer_than_the_foot(
            x in -2.0..9.0_f64,
            y in -2.0..8.0_f64,
            from in 0.0..1.0_f64,
            to in 0.0..1.0_f64,
            u in 0.0..=1.0_f64,
        ) {
            let path = path();
            let p = Point2::new(x, y);
            let (low, high) = (from.min(to) * path.length(), from.max(to) * path.length());
            let foot = path.project(p, low, high);
            prop_assert!(foot.s >= low - 1e-9 && foot.s <= high + 1e-9);
            prop_assert!((path.at(foot.s).position - foot.foot).norm() < 1e-9);
            let other = path.at(low + u * (high - low));
            prop_assert!((other.position - p).norm() >= foot.distance - 1e-9);
        }

        #[test]
        fn travelled_distance_is_the_running_arc_length(a in 0.0..1.0_f64, b in 0.0..1.0_f64) {
            let path = path();
            let (low, high) = (a.min(b) * path.length(), a.max(b) * path.length());
            let (p, q) = (path.at(low), path.at(high));
            prop_assert!((q.position - p.position).norm() <= high - low + 1e-9);
            let heading = Vector2::new(p.heading.cos(), p.heading.sin());
            let ahead = path.at(low + 1e-6);
            prop_assert!(((ahead.position - p.position).dot(&heading) - (ahead.s - p.s)).abs() < 1e-9);
        }
    }
}
