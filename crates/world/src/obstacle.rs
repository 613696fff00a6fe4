//! Discs, polygons and blocks in the world frame.

use bikebot_geometry::Point2;

use crate::error::{MAX_COORDINATE, MIN_EXTENT, WorldError};

/// An axis-aligned rectangle: the field, or the extent of something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Lower-left corner, m.
    pub min: Point2,
    /// Upper-right corner, m.
    pub max: Point2,
}

impl Bounds {
    /// The rectangle from `(min_x, min_y)` to `(max_x, max_y)`, m.
    #[must_use]
    pub fn new(min_x: f64, min_y: f64, max_x: f64, max_y: f64) -> Self {
        Self {
            min: Point2::new(min_x, min_y),
            max: Point2::new(max_x, max_y),
        }
    }

    /// The smallest rectangle around `points`; `None` if there are none.
    #[must_use]
    pub fn around(points: impl IntoIterator<Item = Point2>) -> Option<Self> {
        let mut points = points.into_iter();
        let first = points.next()?;
        let start = Self {
            min: first,
            max: first,
        };
        Some(points.fold(start, |b, p| Self {
            min: Point2::new(b.min.x.min(p.x), b.min.y.min(p.y)),
            max: Point2::new(b.max.x.max(p.x), b.max.y.max(p.y)),
        }))
    }

    /// Extent along x, m.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.max.x - self.min.x
    }

    /// Extent along y, m.
    #[must_use]
    pub fn height(&self) -> f64 {
        self.max.y - self.min.y
    }

    /// Centre, m.
    #[must_use]
    pub fn centre(&self) -> Point2 {
        nalgebra::center(&self.min, &self.max)
    }

    /// Squared distance (m²) from `p` (m); 0 inside.
    #[inline]
    pub(crate) fn distance_squared(&self, p: Point2) -> f64 {
        let dx = (self.min.x - p.x).max(p.x - self.max.x).max(0.0);
        let dy = (self.min.y - p.y).max(p.y - self.max.y).max(0.0);
        dx * dx + dy * dy
    }

    /// Whether `p` (m) lies inside or on the edge.
    #[must_use]
    pub fn contains(&self, p: Point2) -> bool {
        p.x >= self.min.x && p.x <= self.max.x && p.y >= self.min.y && p.y <= self.max.y
    }

    /// The common part of two rectangles; `None` if it has no area.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Option<Self> {
        let common = Self {
            min: Point2::new(self.min.x.max(other.min.x), self.min.y.max(other.min.y)),
            max: Point2::new(self.max.x.min(other.max.x), self.max.y.min(other.max.y)),
        };
        (common.width() > 0.0 && common.height() > 0.0).then_some(common)
    }

    pub(crate) fn check(&self) -> Result<(), WorldError> {
        let usable = [self.min.x, self.min.y, self.max.x, self.max.y]
            .iter()
            .all(|v| v.abs() <= MAX_COORDINATE);
        if usable && self.width() >= MIN_EXTENT && self.height() >= MIN_EXTENT {
            Ok(())
        } else {
            Err(WorldError::Bounds {
                min_x: self.min.x,
                min_y: self.min.y,
                max_x: self.max.x,
                max_y: self.max.y,
            })
        }
    }
}

/// A solid thing that stands still.
#[derive(Debug, Clone, PartialEq)]
pub enum Obstacle {
    /// All points within `radius` of `center`.
    Disc {
        /// m.
        center: Point2,
        /// m, above 0.
        radius: f64,
    },
    /// A simple polygon, convex or not, in either orientation; the last vertex joins the first.
    Polygon {
        /// m. Repeated neighbours (and a repeated first vertex at the end) are allowed.
        vertices: Vec<Point2>,
    },
    /// An axis-aligned rectangle.
    Block {
        /// Lower-left corner, m.
        min: Point2,
        /// Upper-right corner, m.
        max: Point2,
    },
}

impl Obstacle {
    /// The smallest axis-aligned rectangle around the obstacle, m. A polygon without vertices
    /// has none.
    #[must_use]
    pub fn bounds(&self) -> Option<Bounds> {
        match self {
            Self::Disc { center, radius } => Some(Bounds::new(
                center.x - radius,
                center.y - radius,
                center.x + radius,
                center.y + radius,
            )),
            Self::Polygon { vertices } => Bounds::around(vertices.iter().copied()),
            Self::Block { min, max } => Some(Bounds {
                min: *min,
                max: *max,
            }),
        }
    }

    /// The obstacle stretched about the world's origin by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        match self {
            Self::Disc { center, radius } => Self::Disc {
                center: center * factor,
                radius: radius * factor,
            },
            Self::Polygon { vertices } => Self::Polygon {
                vertices: vertices.iter().map(|v| v * factor).collect(),
            },
            Self::Block { min, max } => Self::Block {
                min: min * factor,
                max: max * factor,
            },
        }
    }

    /// Checks the obstacle, and returns it in the form the queries work on: polygons
    /// counter-clockwise without repeated vertices, axis-aligned rectangles as blocks.
    pub(crate) fn normalised(&self, index: usize) -> Result<Self, WorldError> {
        let coordinate = |value: f64| {
            if value.abs() <= MAX_COORDINATE {
                Ok(())
            } else {
                Err(WorldError::Coordinate {
                    obstacle: index,
                    value,
                })
            }
        };
        match self {
            Self::Disc { center, radius } => {
                coordinate(center.x)?;
                coordinate(center.y)?;
                if !(*radius > 0.0 && *radius <= MAX_COORDINATE) {
                    return Err(WorldError::Radius {
                        obstacle: index,
                        radius: *radius,
                    });
                }
                Ok(self.clone())
            }
            Self::Block { min, max } => {
                for value in [min.x, min.y, max.x, max.y] {
                    coordinate(value)?;
                }
                let (width, height) = (max.x - min.x, max.y - min.y);
                if !(width > 0.0 && height > 0.0) {
                    return Err(WorldError::EmptyBlock {
                        obstacle: index,
                        width,
                        height,
                    });
                }
                Ok(self.clone())
            }
            Self::Polygon { vertices } => {
                for v in vertices {
                    coordinate(v.x)?;
                    coordinate(v.y)?;
                }
                let mut ring: Vec<Point2> = Vec::with_capacity(vertices.len());
                for v in vertices {
                    if ring.last() != Some(v) {
                        ring.push(*v);
                    }
                }
                while ring.len() > 1 && ring.first() == ring.last() {
                    ring.pop();
                }
                let area = signed_area(&ring);
                if ring.len() < 3 || area == 0.0 {
                    return Err(WorldError::EmptyPolygon {
                        obstacle: index,
                        vertices: ring.len(),
                        area: area.abs(),
                    });
                }
                if area < 0.0 {
                    ring.reverse();
                }
                if let Some((first, second, at)) = self_crossing(&ring) {
                    return Err(WorldError::SelfCrossing {
                        obstacle: index,
                        first,
                        second,
                        x: at.x,
                        y: at.y,
                    });
                }
                Ok(as_block(&ring).unwrap_or(Self::Polygon { vertices: ring }))
            }
        }
    }
}

/// Enclosed area (m²), positive for a counter-clockwise ring.
pub(crate) fn signed_area(ring: &[Point2]) -> f64 {
    let Some(base) = ring.first() else {
        return 0.0;
    };
    ring.windows(2)
        .map(|w| (w[0] - base).perp(&(w[1] - base)))
        .sum::<f64>()
        / 2.0
}

/// A counter-clockwise ring of four axis-parallel edges is a block, whose distance has a
/// cheaper closed form.
fn as_block(ring: &[Point2]) -> Option<Obstacle> {
    if ring.len() != 4 {
        return None;
    }
    let axis_parallel = (0..4).all(|i| {
        let (a, b) = (ring[i], ring[(i + 1) % 4]);
        a.x == b.x || a.y == b.y
    });
    let bounds = Bounds::around(ring.iter().copied())?;
    axis_parallel.then_some(Obstacle::Block {
        min: bounds.min,
        max: bounds.max,
    })
}

/// The first pair of edges that share a point they should not, and that point.
///
/// Edges are visited in order of their least x, so that only pairs overlapping in x are tried; of their least y where the
/// edges run along x, as in a comb, and would all overlap.
pub(crate) fn self_crossing(ring: &[Point2]) -> Option<(usize, usize, Point2)> {
    let extent = Bounds::around(ring.iter().copied())?;
    let run = ring.windows(2).fold((0.0, 0.0), |(x, y), w| {
        (x + (w[1].x - w[0].x).abs(), y + (w[1].y - w[0].y).abs())
    });
    // Edges that a line across the sweep meets on average: the run along an axis over the extent.
    if run.0 * extent.height() > run.1 * extent.width() {
        let turned: Vec<_> = ring.iter().map(|v| Point2::new(v.y, v.x)).collect();
        return self_crossing_along_x(&turned).map(|(i, j, at)| (i, j, Point2::new(at.y, at.x)));
    }
    self_crossing_along_x(ring)
}

fn self_crossing_along_x(ring: &[Point2]) -> Option<(usize, usize, Point2)> {
    let n = ring.len();
    let edge = |i: usize| (ring[i], ring[(i + 1) % n]);
    let mut order: Vec<usize> = (0..n).collect();
    let min_x = |i: usize| {
        let (a, b) = edge(i);
        a.x.min(b.x)
    };
    order.sort_by(|&i, &j| min_x(i).total_cmp(&min_x(j)).then(i.cmp(&j)));
    for (rank, &i) in order.iter().enumerate() {
        let (a, b) = edge(i);
        let (max_x, min_y, max_y) = (a.x.max(b.x), a.y.min(b.y), a.y.max(b.y));
        for &j in &order[rank + 1..] {
            if min_x(j) > max_x {
                break;
            }
            let (c, d) = edge(j);
            if c.y.min(d.y) > max_y || c.y.max(d.y) < min_y {
                continue;
            }
            let met = if (i + 1) % n == j {
                folds_back(a, b, d).then_some(b)
            } else if (j + 1) % n == i {
                folds_back(c, d, b).then_some(d)
            } else {
                crate::primitive::segments_meet(a, b, c, d)
            };
            if let Some(at) = met {
                return Some((i.min(j), i.max(j), at));
            }
        }
    }
    None
}

/// Whether the edge b→c runs back over the edge a→b.
fn folds_back(a: Point2, b: Point2, c: Point2) -> bool {
    let (u, v) = (b - a, c - b);
    u.perp(&v) == 0.0 && u.dot(&v) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(points: &[(f64, f64)]) -> Obstacle {
        Obstacle::Polygon {
            vertices: points.iter().map(|&(x, y)| Point2::new(x, y)).collect(),
        }
    }

    #[test]
    fn a_crossing_is_named_alike_whichever_way_the_edges_run() {
        // A bow tie among long edges along x, and the same turned by a right angle.
        let bow = [(0.0, 0.0), (9.0, 2.0), (9.0, 0.0), (0.0, 2.0), (-1.0, 1.0)];
        let ring = |turned: bool| -> Vec<Point2> {
            bow.iter()
                .map(|&(x, y)| {
                    if turned {
                        Point2::new(y, x)
                    } else {
                        Point2::new(x, y)
                    }
                })
                .collect()
        };
        let (i, j, at) = self_crossing(&ring(false)).unwrap();
        assert_eq!((i, j, at), (0, 2, Point2::new(4.5, 1.0)));
        assert_eq!(
            self_crossing(&ring(true)),
            Some((0, 2, Point2::new(1.0, 4.5)))
        );
    }

    #[test]
    fn a_rectangle_drawn_as_a_polygon_becomes_a_block() {
        let block = polygon(&[(0.0, 0.0), (0.0, 2.0), (3.0, 2.0), (3.0, 0.0), (0.0, 0.0)]);
        assert_eq!(
            block.normalised(0),
            Ok(Obstacle::Block {
                min: Point2::new(0.0, 0.0),
                max: Point2::new(3.0, 2.0)
            })
        );
    }

    #[test]
    fn a_clockwise_polygon_is_turned_round() {
        let Ok(Obstacle::Polygon { vertices }) =
            polygon(&[(0.0, 0.0), (1.0, 2.0), (2.0, 0.0)]).normalised(0)
        else {
            panic!("a triangle is a polygon");
        };
        assert!(signed_area(&vertices) > 0.0);
    }

    #[test]
    fn a_bow_tie_is_refused_with_both_edges_named() {
        let error = polygon(&[(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 3.0)]).normalised(4);
        assert!(matches!(
            error,
            Err(WorldError::SelfCrossing {
                obstacle: 4,
                first: 0,
                second: 2,
                ..
            })
        ));
    }

    #[test]
    fn a_polygon_that_touches_itself_is_refused() {
        let pinch = polygon(&[
            (0.0, 0.0),
            (2.0, 0.0),
            (1.0, 1.0),
            (2.0, 2.0),
            (0.0, 2.0),
            (1.0, 1.0),
        ]);
        assert!(matches!(
            pinch.normalised(0),
            Err(WorldError::SelfCrossing { .. })
        ));
    }

    #[test]
    fn a_spike_without_width_is_refused() {
        let spike = polygon(&[(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (4.0, 1.0), (1.0, 1.0)]);
        assert!(spike.normalised(0).is_err());
    }

    #[test]
    fn collinear_and_repeated_points_enclose_nothing() {
        for points in [
            &[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)][..],
            &[(0.0, 0.0), (0.0, 0.0), (1.0, 1.0), (0.0, 0.0)][..],
            &[][..],
        ] {
            assert!(matches!(
                polygon(points).normalised(0),
                Err(WorldError::EmptyPolygon { .. })
            ));
        }
    }

    #[test]
    fn numbers_that_are_not_coordinates_are_refused() {
        for bad in [f64::NAN, f64::INFINITY, 1e300] {
            assert!(
                polygon(&[(0.0, 0.0), (bad, 0.0), (0.0, 1.0)])
                    .normalised(0)
                    .is_err()
            );
            assert!(Bounds::new(0.0, 0.0, bad, 1.0).check().is_err());
            let disc = Obstacle::Disc {
                center: Point2::origin(),
                radius: bad,
            };
            assert!(disc.normalised(0).is_err());
        }
    }
}
