//! A chain of straight segments: the coarse path and the guide of Algorithm 1.

use crate::{GeometryError, Point2};

/// Vertices joined by straight segments, with the running length.
///
/// Segment `i` runs from vertex `i` to vertex `i + 1`.
#[derive(Debug, Clone, PartialEq)]
pub struct Polyline {
    vertices: Vec<Point2>,
    /// Arc length at each vertex, m.
    cumulative: Vec<f64>,
}

/// The nearest point of a [`Polyline`] to a given point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// The segment the foot lies on.
    pub segment: usize,
    /// Arc length of the foot along the polyline, m.
    pub s: f64,
    /// The nearest point itself, m.
    pub foot: Point2,
    /// Distance between the point and its foot, m.
    pub distance: f64,
}

impl Polyline {
    /// A polyline through `vertices` (m). Repetitions of a vertex directly after itself are
    /// dropped, so every segment has a length and a heading.
    ///
    /// # Errors
    ///
    /// [`GeometryError::Empty`] without a vertex, [`GeometryError::NotFinite`] for a coordinate
    /// that is not finite.
    pub fn new(vertices: Vec<Point2>) -> Result<Self, GeometryError> {
        if vertices.is_empty() {
            return Err(GeometryError::Empty { what: "polyline" });
        }
        if let Some(index) = vertices
            .iter()
            .position(|p| !(p.x.is_finite() && p.y.is_finite()))
        {
            return Err(GeometryError::NotFinite {
                what: "polyline",
                index,
            });
        }
        let mut vertices = vertices;
        vertices.dedup();
        let mut cumulative = Vec::with_capacity(vertices.len());
        let mut s = 0.0;
        cumulative.push(s);
        for pair in vertices.windows(2) {
            s += (pair[1] - pair[0]).norm();
            cumulative.push(s);
        }
        Ok(Self {
            vertices,
            cumulative,
        })
    }

    /// The vertices in order of travel, m.
    #[must_use]
    pub fn vertices(&self) -> &[Point2] {
        &self.vertices
    }

    /// Number of segments: one less than vertices.
    #[must_use]
    pub fn segment_count(&self) -> usize {
        self.vertices.len() - 1
    }

    /// Length, m.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.cumulative[self.cumulative.len() - 1]
    }

    /// Arc length at vertex `i`, m.
    ///
    /// # Panics
    ///
    /// If there is no vertex `i`.
    #[must_use]
    pub fn cumulative(&self, i: usize) -> f64 {
        self.cumulative[i]
    }

    /// The point at arc length `s` (m), clamped to the ends.
    #[must_use]
    pub fn point_at(&self, s: f64) -> Point2 {
        let Some(i) = self.segment_at(s) else {
            return self.vertices[0];
        };
        let length = self.cumulative[i + 1] - self.cumulative[i];
        let t = ((s - self.cumulative[i]) / length).clamp(0.0, 1.0);
        // A leg too short to lengthen the running sum has no inside: the ratio is 0/0 there.
        if t == 1.0 || length == 0.0 {
            return self.vertices[i + 1];
        }
        self.vertices[i] + (self.vertices[i + 1] - self.vertices[i]) * t
    }

    /// Heading at arc length `s`, rad; at a vertex that of the segment ahead. Zero for a polyline
    /// of one vertex.
    #[must_use]
    pub fn heading_at(&self, s: f64) -> f64 {
        self.segment_at(s).map_or(0.0, |i| self.segment_heading(i))
    }

    /// Heading of segment `i`, rad, in (−π, π].
    ///
    /// # Panics
    ///
    /// If there is no segment `i`.
    #[must_use]
    pub fn segment_heading(&self, i: usize) -> f64 {
        let d = self.vertices[i + 1] - self.vertices[i];
        d.y.atan2(d.x)
    }

    /// The segment that holds arc length `s`, clamped; `None` for a polyline of one vertex.
    #[must_use]
    pub fn segment_at(&self, s: f64) -> Option<usize> {
        let last = self.segment_count().checked_sub(1)?;
        let after = self.cumulative.partition_point(|&c| c <= s);
        Some(after.saturating_sub(1).min(last))
    }

    /// The point of the polyline nearest to `p`; the first of several.
    #[must_use]
    pub fn project(&self, p: Point2) -> Projection {
        let mut best = Projection {
            segment: 0,
            s: 0.0,
            foot: self.vertices[0],
            distance: (p - self.vertices[0]).norm_squared(),
        };
        for (i, pair) in self.vertices.windows(2).enumerate() {
            let d = pair[1] - pair[0];
            let squared = d.norm_squared();
            // The square of a leg below 1e-162 m is zero, and either end of it will do.
            let t = if squared > 0.0 {
                ((p - pair[0]).dot(&d) / squared).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let foot = if t == 1.0 { pair[1] } else { pair[0] + d * t };
            let squared = (p - foot).norm_squared();
            if squared < best.distance {
                let length = self.cumulative[i + 1] - self.cumulative[i];
                best = Projection {
                    segment: i,
                    s: self.cumulative[i] + t * length,
                    foot,
                    distance: squared,
                };
            }
        }
        best.distance = best.distance.sqrt();
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::FRAC_PI_2;

    fn corner() -> Polyline {
        Polyline::new(vec![
            Point2::new(0.0, 0.0),
            Point2::new(3.0, 0.0),
            Point2::new(3.0, 4.0),
        ])
        .unwrap()
    }

    #[test]
    fn lengths_and_headings_are_those_of_the_segments() {
        let p = corner();
        assert_eq!(p.length(), 7.0);
        assert_eq!(p.cumulative(1), 3.0);
        assert_eq!(p.segment_heading(0), 0.0);
        assert_eq!(p.segment_heading(1), FRAC_PI_2);
        assert_eq!(p.heading_at(3.0), FRAC_PI_2);
        assert_eq!(p.point_at(5.0), Point2::new(3.0, 2.0));
        assert_eq!(p.point_at(-1.0), Point2::new(0.0, 0.0));
        assert_eq!(p.point_at(99.0), Point2::new(3.0, 4.0));
    }

    /// Found in review: 0/0 at the end of a line whose last leg drowns in the rounding of its length.
    #[test]
    fn a_leg_lost_in_the_rounding_of_the_length_is_no_hole() {
        for tiny in [1e-17, 1e-170] {
            let line = Polyline::new(vec![
                Point2::new(0.0, 0.0),
                Point2::new(1.0, 0.0),
                Point2::new(1.0, tiny),
            ])
            .unwrap();
            assert_eq!(line.point_at(line.length()), Point2::new(1.0, tiny));
            let foot = line.project(Point2::new(1.5, 0.0));
            assert_eq!((foot.s, foot.distance), (1.0, 0.5));
        }
        let dot = Polyline::new(vec![Point2::origin(), Point2::new(0.0, 1e-170)]).unwrap();
        assert_eq!(dot.project(Point2::new(1.0, 0.0)).distance, 1.0);
        assert!(dot.point_at(0.0).y <= 1e-170);
    }

    #[test]
    fn nothing_and_nonsense_are_refused() {
        assert_eq!(
            Polyline::new(vec![]),
            Err(GeometryError::Empty { what: "polyline" })
        );
        let bad = vec![Point2::origin(), Point2::new(f64::NAN, 0.0)];
        assert_eq!(
            Polyline::new(bad),
            Err(GeometryError::NotFinite {
                what: "polyline",
                index: 1
            })
        );
    }

    #[test]
    fn repeated_vertices_are_dropped_and_one_vertex_is_a_point() {
        let p = Polyline::new(vec![Point2::new(1.0, 1.0); 3]).unwrap();
        assert_eq!(p.vertices().len(), 1);
        assert_eq!(p.length(), 0.0);
        assert_eq!(p.point_at(0.5), Point2::new(1.0, 1.0));
        assert_eq!(p.project(Point2::new(4.0, 5.0)).distance, 5.0);
    }

    #[test]
    fn the_foot_is_on_the_nearer_leg_or_the_corner() {
        let p = corner();
        let on_leg = p.project(Point2::new(2.0, 0.5));
        assert_eq!((on_leg.segment, on_leg.s, on_leg.distance), (0, 2.0, 0.5));
        let at_corner = p.project(Point2::new(4.0, -1.0));
        assert_eq!(at_corner.foot, Point2::new(3.0, 0.0));
        assert!((at_corner.distance - 2.0_f64.sqrt()).abs() < 1e-15);
    }

    proptest! {
        #[test]
        fn no_point_of_the_line_is_nearer_than_the_foot(
            points in prop::collection::vec((-9.0..9.0_f64, -9.0..9.0_f64), 1..8),
            x in -12.0..12.0_f64,
            y in -12.0..12.0_f64,
            u in 0.0..=1.0_f64,
        ) {
            let line = Polyline::new(points.iter().map(|&(x, y)| Point2::new(x, y)).collect()).unwrap();
            let p = Point2::new(x, y);
            let foot = line.project(p);
            prop_assert!((line.point_at(foot.s) - foot.foot).norm() < 1e-9);
            prop_assert!(((p - foot.foot).norm() - foot.distance).abs() < 1e-12);
            let other = line.point_at(u * line.length());
            prop_assert!((p - other).norm() >= foot.distance - 1e-12);
        }
    }
}
