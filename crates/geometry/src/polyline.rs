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
        if t == 1.0 {
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
            let t = ((p - pair[0]).dot(&d) / d.norm_squared()).clamp(0.0, 1.0);
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
