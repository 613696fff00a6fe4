//! The edge of the field, which is a wall.

use bikebot_geometry::{Point2, Pose2, Vector2};

use crate::grid::OccupancyGrid;
use crate::obstacle::Bounds;
use crate::primitive::{Primitive, block_distance, inverse_direction, slab};

/// A rectangle in a frame of its own: a turned grid knows nothing beyond its own edge.
#[derive(Debug, Clone, Copy)]
struct Turned {
    origin: Point2,
    cos: f64,
    sin: f64,
    size: Point2,
}

impl Turned {
    fn to_local(self, v: Vector2) -> Vector2 {
        Vector2::new(
            self.cos * v.x + self.sin * v.y,
            self.cos * v.y - self.sin * v.x,
        )
    }

    fn to_world(self, v: Vector2) -> Vector2 {
        Vector2::new(
            self.cos * v.x - self.sin * v.y,
            self.sin * v.x + self.cos * v.y,
        )
    }
}

/// Where the field ends: an axis-aligned rectangle, cut by a turned one if a grid has a yaw.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FieldEdge {
    pub(crate) bounds: Bounds,
    turned: Option<Turned>,
}

impl FieldEdge {
    pub(crate) fn new(bounds: Bounds, grid: Option<&OccupancyGrid>) -> Self {
        let turned = grid.filter(|g| g.origin.heading != 0.0).map(|g| {
            let Pose2 { position, heading } = g.origin;
            let (sin, cos) = heading.sin_cos();
            Turned {
                origin: position,
                cos,
                sin,
                size: Point2::new(
                    g.width as f64 * g.resolution,
                    g.height as f64 * g.resolution,
                ),
            }
        });
        Self { bounds, turned }
    }

    /// Distance (m) from `p` to the edge, positive inside, negative outside.
    #[inline]
    pub(crate) fn distance(&self, p: Point2) -> f64 {
        let straight = -block_distance(self.bounds.min, self.bounds.max, p);
        match &self.turned {
            None => straight,
            Some(t) => {
                let local = Point2::from(t.to_local(p - t.origin));
                straight.min(-block_distance(Point2::origin(), t.size, local))
            }
        }
    }

    /// The point (m) of the edge nearest to `p`.
    pub(crate) fn nearest_point(&self, p: Point2) -> Point2 {
        let straight = Primitive::Block {
            min: self.bounds.min,
            max: self.bounds.max,
        }
        .nearest_boundary_point(p);
        match &self.turned {
            None => straight,
            Some(t) => {
                let local = Point2::from(t.to_local(p - t.origin));
                let near = Primitive::Block {
                    min: Point2::origin(),
                    max: t.size,
                }
                .nearest_boundary_point(local);
                let turned = t.origin + t.to_world(near.coords);
                let straight_distance = -block_distance(self.bounds.min, self.bounds.max, p);
                let turned_distance = -block_distance(Point2::origin(), t.size, local);
                if straight_distance <= turned_distance {
                    straight
                } else {
                    turned
                }
            }
        }
    }

    /// Distance (m) along the unit vector `direction` until the field is left; 0 from outside.
    pub(crate) fn exit(&self, origin: Point2, direction: Vector2) -> f64 {
        let leave = |min: Point2, max: Point2, o: Point2, d: Vector2| {
            let (near, far) = slab(min, max, o, inverse_direction(d));
            if near <= 0.0 { far.max(0.0) } else { 0.0 }
        };
        let straight = leave(self.bounds.min, self.bounds.max, origin, direction);
        match &self.turned {
            None => straight,
            Some(t) => straight.min(leave(
                Point2::origin(),
                t.size,
                Point2::from(t.to_local(origin - t.origin)),
                t.to_local(direction),
            )),
        }
    }
}
