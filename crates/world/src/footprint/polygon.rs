//! A footprint of any simple outline, rounded off by a radius or not.

use std::sync::{Arc, OnceLock};

use bikebot_geometry::Point2;

use super::disc_cover;
use super::{FootprintDisc, FootprintError, MAX_DIMENSION};
use crate::obstacle::{Bounds, self_crossing, signed_area};
use crate::primitive::{point_segment_distance_squared, ring_contains};
use crate::query::cut_into_convex;

/// Most vertices of an outline: every query walks all of them.
pub(crate) const MOST_VERTICES: usize = 256;

/// Most vertices of one convex part; a rounder part is cut once more.
pub(crate) const MOST_CORNERS: usize = 16;

/// An edge shorter than this part of the outline's extent has no length, and an outline thinner than it no area: below,
/// rounding decides on which side a point lies.
const LEAST_PART: f64 = 1e-9;

/// All points within a radius of a simple polygon, in the body frame. Cheap to clone.
#[derive(Debug, Clone)]
pub struct FootprintPolygon {
    shape: Arc<Shape>,
    rounding: f64,
}

#[derive(Debug)]
struct Shape {
    /// Counter-clockwise.
    vertices: Vec<Point2>,
    /// Convex, counter-clockwise, together the polygon; at most [`MOST_CORNERS`] vertices each.
    parts: Vec<Vec<Point2>>,
    /// Made when somebody first asks: a search by the exact shape alone does not.
    cover: OnceLock<Vec<FootprintDisc>>,
}

impl PartialEq for FootprintPolygon {
    fn eq(&self, other: &Self) -> bool {
        self.rounding == other.rounding && self.shape.vertices == other.shape.vertices
    }
}

impl FootprintPolygon {
    /// The polygon with these vertices (m, body frame, either orientation; the last joins the first).
    ///
    /// # Errors
    ///
    /// If there are fewer than 3 or more than 256 vertices, a number is not finite or beyond 1e6 m, two neighbours
    /// coincide, the outline crosses itself or encloses no area.
    pub fn new(vertices: &[Point2]) -> Result<Self, FootprintError> {
        let fail = |problem: String| {
            let most = vertices.len().min(8);
            let mut found = written(&vertices[..most], 0.0);
            if most < vertices.len() {
                found.push_str(";…");
            }
            FootprintError { found, problem }
        };
        let n = vertices.len();
        if n < 3 {
            return Err(fail(format!("a polygon has at least 3 vertices, not {n}")));
        }
        if n > MOST_VERTICES {
            return Err(fail(format!(
                "a polygon has at most {MOST_VERTICES} vertices, not {n}"
            )));
        }
        if let Some(i) = vertices
            .iter()
            .position(|v| !(v.x.abs() <= MAX_DIMENSION && v.y.abs() <= MAX_DIMENSION))
        {
            return Err(fail(format!(
                "vertex {} is ({}, {}): each number must be finite and at most 1e6 m",
                i + 1,
                vertices[i].x,
                vertices[i].y
            )));
        }
        let extent =
            Bounds::around(vertices.iter().copied()).map_or(0.0, |b| b.width().max(b.height()));
        let next = |i: usize| (i + 1) % n;
        let coincide =
            |i: &usize| (vertices[next(*i)] - vertices[*i]).norm() <= LEAST_PART * extent;
        if let Some(i) = (0..n).find(coincide) {
            let again = if next(i) == 0 {
                "; the outline closes by itself"
            } else {
                ""
            };
            return Err(fail(format!(
                "vertices {} and {} coincide{again}",
                i + 1,
                next(i) + 1
            )));
        }
        let no_area = || Err(fail("the outline encloses no area".to_owned()));
        let base = vertices[0];
        let farthest = vertices
            .iter()
            .map(|v| v - base)
            .max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))
            .unwrap_or_default();
        let on_a_line =
            |v: &Point2| farthest.perp(&(v - base)).abs() <= LEAST_PART * extent * extent;
        if vertices.iter().all(on_a_line) {
            return no_area();
        }
        if let Some((i, j, at)) = self_crossing(vertices) {
            return Err(fail(format!(
                "the outline crosses itself at ({:.3}, {:.3}): the edges after vertex {} and vertex {}",
                at.x,
                at.y,
                i + 1,
                j + 1
            )));
        }
        let area = signed_area(vertices);
        if area.abs() <= LEAST_PART * extent * extent {
            return no_area();
        }
        let mut ring = vertices.to_vec();
        if area < 0.0 {
            ring.reverse();
        }
        let parts = cut_into_convex(&ring)
            .filter(|parts| {
                let sum: f64 = parts.iter().map(|part| signed_area(part)).sum();
                // The parts are what is checked for collision: they must be all of it.
                (sum - area.abs()).abs() <= LEAST_PART * extent * extent
            })
            .ok_or_else(|| {
                fail("the outline is too thin somewhere to be cut into convex parts".to_owned())
            })?;
        Ok(Self {
            shape: Arc::new(Shape {
                parts: parts.into_iter().flat_map(few_corners).collect(),
                vertices: ring,
                cover: OnceLock::new(),
            }),
            rounding: 0.0,
        })
    }

    /// The vertices of the polygon, counter-clockwise, m.
    #[must_use]
    pub fn vertices(&self) -> &[Point2] {
        &self.shape.vertices
    }

    /// How far about the polygon the footprint reaches, m.
    #[must_use]
    pub fn rounding(&self) -> f64 {
        self.rounding
    }

    /// All points within `by` (m, above 0) of this shape: exact.
    pub(super) fn grown(&self, by: f64) -> Self {
        self.rounded(self.rounding + by)
    }

    /// The same polygon with another radius about it.
    pub(super) fn rounded(&self, rounding: f64) -> Self {
        Self {
            shape: Arc::clone(&self.shape),
            rounding,
        }
    }

    pub(super) fn reach(&self) -> f64 {
        let farthest = self.vertices().iter().map(|v| v.coords.norm());
        farthest.fold(0.0, f64::max) + self.rounding
    }

    pub(super) fn inscribed_radius(&self) -> f64 {
        (self.rounding - signed_distance(self.vertices(), Point2::origin())).max(0.0)
    }

    pub(super) fn discs(&self) -> Vec<FootprintDisc> {
        let cover = self
            .shape
            .cover
            .get_or_init(|| disc_cover::of(&self.shape.vertices));
        cover
            .iter()
            .map(|disc| FootprintDisc {
                radius: disc.radius + self.rounding,
                ..*disc
            })
            .collect()
    }

    pub(super) fn parts(&self) -> &[Vec<Point2>] {
        &self.shape.parts
    }

    /// As [`super::Footprint`] writes it.
    pub(super) fn text(&self) -> String {
        written(self.vertices(), self.rounding)
    }
}

fn written(vertices: &[Point2], rounding: f64) -> String {
    let vertices: Vec<String> = vertices
        .iter()
        .map(|v| format!("{},{}", v.x, v.y))
        .collect();
    let rounding = if rounding == 0.0 {
        String::new()
    } else {
        format!("~{rounding}")
    };
    format!("polygon:{}{rounding}", vertices.join(";"))
}

/// A convex part as fans of few corners from its first vertex.
fn few_corners(part: Vec<Point2>) -> Vec<Vec<Point2>> {
    if part.len() <= MOST_CORNERS {
        return vec![part];
    }
    let mut fans = Vec::new();
    let mut from = 1;
    while from + 1 < part.len() {
        let to = (from + MOST_CORNERS - 2).min(part.len() - 1);
        let mut fan = vec![part[0]];
        fan.extend_from_slice(&part[from..=to]);
        fans.push(fan);
        from = to;
    }
    fans
}

/// Distance (m) from `p` to a ring's boundary, negative inside.
pub(super) fn signed_distance(ring: &[Point2], p: Point2) -> f64 {
    let squared = (0..ring.len())
        .map(|i| point_segment_distance_squared(p, ring[i], ring[(i + 1) % ring.len()]))
        .fold(f64::INFINITY, f64::min);
    if ring_contains(ring, p) {
        -squared.sqrt()
    } else {
        squared.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn p(x: f64, y: f64) -> Point2 {
        Point2::new(x, y)
    }

    fn polygon(points: &[(f64, f64)]) -> Result<FootprintPolygon, FootprintError> {
        let vertices: Vec<_> = points.iter().map(|&(x, y)| p(x, y)).collect();
        FootprintPolygon::new(&vertices)
    }

    #[test]
    fn an_outline_that_is_no_polygon_is_refused_with_what_is_wrong() {
        for (points, problem) in [
            (vec![(0.0, 0.0), (1.0, 0.0)], "at least 3 vertices, not 2"),
            (vec![(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)], "encloses no area"),
            (
                vec![(0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (0.0, 1.0)],
                "vertices 2 and 3 coincide",
            ),
            (
                vec![(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.0, 0.0)],
                "vertices 4 and 1 coincide; the outline closes by itself",
            ),
            (
                vec![(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 1.0)],
                "crosses itself at (0.667, 0.667): the edges after vertex 1 and vertex 3",
            ),
            (
                vec![(0.0, 0.0), (f64::NAN, 0.0), (0.0, 1.0)],
                "vertex 2 is (NaN, 0)",
            ),
            (
                vec![(0.0, 0.0), (1.0, f64::INFINITY), (0.0, 1.0)],
                "must be finite",
            ),
            (vec![(0.0, 0.0), (1e7, 0.0), (0.0, 1.0)], "at most 1e6 m"),
            (vec![(0.0, 0.0), (1.0, 0.0), (0.5, 1e-12)], "no area"),
        ] {
            let error = polygon(&points).unwrap_err();
            assert!(error.problem.contains(problem), "{error}");
        }
        let many: Vec<_> = (0..257)
            .map(|i| f64::from(i) * std::f64::consts::TAU / 257.0)
            .map(|angle| (angle.cos(), angle.sin()))
            .collect();
        assert!(polygon(&many).unwrap_err().problem.contains("at most 256"));
        assert!(polygon(&many[..256]).is_ok());
    }

    #[test]
    fn a_round_part_is_cut_into_parts_of_few_corners_with_the_same_area() {
        let ring: Vec<_> = (0..100)
            .map(|i| f64::from(i) * std::f64::consts::TAU / 100.0)
            .map(|angle| (angle.cos(), angle.sin()))
            .collect();
        let shape = polygon(&ring).unwrap();
        assert!(shape.parts().iter().all(|part| part.len() <= MOST_CORNERS));
        let sum: f64 = shape.parts().iter().map(|part| signed_area(part)).sum();
        assert!((sum - signed_area(shape.vertices())).abs() < 1e-12);
    }

    #[test]
    fn reach_and_inscribed_radius_are_those_of_the_drawing() {
        // An L: 3 long, 2 high, arms 1 wide, the reference point 0.25 inside its lower-left corner.
        let l = polygon(&[
            (-0.25, -0.25),
            (2.75, -0.25),
            (2.75, 0.75),
            (0.75, 0.75),
            (0.75, 1.75),
            (-0.25, 1.75),
        ])
        .unwrap();
        assert_eq!(l.inscribed_radius(), 0.25);
        assert!((l.reach() - 2.75_f64.hypot(0.75)).abs() < 1e-15);
        assert_eq!(l.grown(0.5).inscribed_radius(), 0.75);
        let ahead = polygon(&[(1.0, -1.0), (2.0, -1.0), (2.0, 1.0), (1.0, 1.0)]).unwrap();
        assert_eq!(ahead.inscribed_radius(), 0.0);
        assert_eq!(ahead.grown(1.5).inscribed_radius(), 0.5);
    }

    #[test]
    fn either_orientation_is_the_same_footprint() {
        let one = polygon(&[(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]).unwrap();
        let other = polygon(&[(0.0, 1.0), (1.0, 0.0), (0.0, 0.0)]).unwrap();
        assert_eq!(signed_area(other.vertices()), 0.5);
        assert_eq!(one.reach(), other.reach());
    }
}
