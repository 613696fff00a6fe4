//! Edges, blocks and discs: the closed forms every distance comes down to.

use bikebot_geometry::{Point2, Vector2};

use crate::obstacle::Bounds;

/// How the solid turns where two edges join.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Corner {
    /// The solid fills less than a half turn: a point nearest to this corner is outside.
    Convex,
    /// The solid fills more than a half turn: a point nearest to this corner is inside.
    Reflex,
    /// The two edges continue each other; the side of either decides.
    Straight,
}

impl Corner {
    /// The corner between an edge along `before` and the next along `after`, solid on the left.
    pub(crate) fn between(before: Vector2, after: Vector2) -> Self {
        let cross = before.perp(&after);
        // Below the rounding error of the cross product itself the turn has no sign.
        let negligible = 1e-14 * before.norm() * after.norm();
        if cross.abs() <= negligible && before.dot(&after) > 0.0 {
            Self::Straight
        } else if cross >= 0.0 {
            Self::Convex
        } else {
            Self::Reflex
        }
    }
}

/// A directed piece of a solid's boundary, the solid on its left.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Edge {
    pub(crate) start: Point2,
    pub(crate) span: Vector2,
    inverse_length_squared: f64,
    /// Which shape of the scene this edge bounds.
    pub(crate) shape: u32,
    start_corner: Corner,
    end_corner: Corner,
}

impl Edge {
    pub(crate) fn new(
        start: Point2,
        end: Point2,
        shape: u32,
        start_corner: Corner,
        end_corner: Corner,
    ) -> Self {
        let span = end - start;
        let length_squared = span.norm_squared();
        Self {
            start,
            span,
            // An edge so short that its square underflows is a point: its start stands for it.
            inverse_length_squared: if length_squared > f64::MIN_POSITIVE {
                length_squared.recip()
            } else {
                0.0
            },
            shape,
            start_corner,
            end_corner,
        }
    }

    pub(crate) fn end(&self) -> Point2 {
        self.start + self.span
    }

    /// Whether the solid fills less than a half turn where the edge begins.
    pub(crate) fn begins_convex(&self) -> bool {
        self.start_corner == Corner::Convex
    }

    /// The parameter of the point of the edge nearest to `p`, in [0, 1].
    fn nearest_parameter(&self, offset: Vector2) -> f64 {
        (offset.dot(&self.span) * self.inverse_length_squared).clamp(0.0, 1.0)
    }

    /// Squared distance (m²) to `p`.
    #[inline]
    pub(crate) fn distance_squared(&self, p: Point2) -> f64 {
        let offset = p - self.start;
        let t = self.nearest_parameter(offset);
        (offset - self.span * t).norm_squared()
    }

    /// Squared distance (m²) to `p`, and whether `p` is on the solid side, given that this is
    /// the nearest edge of its solid.
    #[inline]
    pub(crate) fn distance_squared_and_side(&self, p: Point2) -> (f64, bool) {
        let offset = p - self.start;
        let t = self.nearest_parameter(offset);
        let corner = if t == 0.0 {
            self.start_corner
        } else if t == 1.0 {
            self.end_corner
        } else {
            Corner::Straight
        };
        let inside = match corner {
            Corner::Convex => false,
            Corner::Reflex => true,
            Corner::Straight => self.span.perp(&offset) > 0.0,
        };
        ((offset - self.span * t).norm_squared(), inside)
    }

    pub(crate) fn nearest_point(&self, p: Point2) -> Point2 {
        self.start + self.span * self.nearest_parameter(p - self.start)
    }

    /// Distance along the unit vector `direction` from `origin` to the edge.
    fn ray_hit(&self, origin: Point2, direction: Vector2) -> Option<f64> {
        let offset = self.start - origin;
        let determinant = direction.perp(&self.span);
        if determinant == 0.0 {
            // Parallel: the neighbours at the edge's ends are what the ray can meet.
            return None;
        }
        let along = offset.perp(&self.span) / determinant;
        let across = offset.perp(&direction) / determinant;
        // A ray aimed at the common corner of two edges must not slip between them.
        const SLACK: f64 = 1e-9;
        (along >= 0.0 && (-SLACK..=1.0 + SLACK).contains(&across)).then_some(along)
    }
}

/// One solid with a closed form, or one edge of a solid without.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Primitive {
    Block { min: Point2, max: Point2 },
    Disc { center: Point2, radius: f64 },
    Edge(Edge),
}

impl Primitive {
    pub(crate) fn bounds(&self) -> Bounds {
        match self {
            Self::Block { min, max } => Bounds {
                min: *min,
                max: *max,
            },
            Self::Disc { center, radius } => Bounds::new(
                center.x - radius,
                center.y - radius,
                center.x + radius,
                center.y + radius,
            ),
            Self::Edge(edge) => {
                let (a, b) = (edge.start, edge.end());
                Bounds::new(a.x.min(b.x), a.y.min(b.y), a.x.max(b.x), a.y.max(b.y))
            }
        }
    }

    /// Signed distance (m) of a solid, plain distance of an edge.
    #[inline]
    pub(crate) fn distance(&self, p: Point2) -> f64 {
        match self {
            Self::Block { min, max } => block_distance(*min, *max, p),
            Self::Disc { center, radius } => (p - center).norm() - radius,
            Self::Edge(edge) => edge.distance_squared(p).sqrt(),
        }
    }

    /// Squared distance (m²) from outside; 0 inside a solid.
    pub(crate) fn distance_squared_outside(&self, p: Point2) -> f64 {
        match self {
            Self::Edge(edge) => edge.distance_squared(p),
            Self::Block { min, max } => {
                let dx = (min.x - p.x).max(p.x - max.x).max(0.0);
                let dy = (min.y - p.y).max(p.y - max.y).max(0.0);
                dx * dx + dy * dy
            }
            Self::Disc { .. } => {
                let d = self.distance(p).max(0.0);
                d * d
            }
        }
    }

    /// The nearest point (m) of the boundary.
    pub(crate) fn nearest_boundary_point(&self, p: Point2) -> Point2 {
        match self {
            Self::Edge(edge) => edge.nearest_point(p),
            Self::Disc { center, radius } => {
                let offset = p - center;
                let distance = offset.norm();
                if distance > 0.0 {
                    center + offset * (radius / distance)
                } else {
                    // Every boundary point is equally near the centre.
                    Point2::new(center.x + radius, center.y)
                }
            }
            Self::Block { min, max } => {
                let clamped = Point2::new(p.x.clamp(min.x, max.x), p.y.clamp(min.y, max.y));
                if clamped != p {
                    return clamped;
                }
                let (left, right) = (p.x - min.x, max.x - p.x);
                let (down, up) = (p.y - min.y, max.y - p.y);
                let least = left.min(right).min(down).min(up);
                if least == left {
                    Point2::new(min.x, p.y)
                } else if least == right {
                    Point2::new(max.x, p.y)
                } else if least == down {
                    Point2::new(p.x, min.y)
                } else {
                    Point2::new(p.x, max.y)
                }
            }
        }
    }

    /// Distance (m) along the unit vector `direction` to the first point of the primitive.
    pub(crate) fn ray_hit(&self, origin: Point2, direction: Vector2) -> Option<f64> {
        match self {
            Self::Edge(edge) => edge.ray_hit(origin, direction),
            Self::Block { min, max } => {
                let (near, far) = slab(*min, *max, origin, inverse_direction(direction));
                (near <= far && far >= 0.0).then_some(near.max(0.0))
            }
            Self::Disc { center, radius } => {
                let offset = origin - center;
                let b = offset.dot(&direction);
                let c = offset.norm_squared() - radius * radius;
                if c <= 0.0 {
                    return Some(0.0);
                }
                let discriminant = b * b - c;
                if discriminant < 0.0 || b > 0.0 {
                    return None;
                }
                // c / (−b + √) rather than −b − √: no cancellation for a far disc.
                Some(c / (discriminant.sqrt() - b))
            }
        }
    }
}

/// 1 / direction for [`slab`], kept finite: along an axis the ray is parallel to, the product
/// with a zero offset must be 0 and not NaN.
#[inline]
pub(crate) fn inverse_direction(direction: Vector2) -> Vector2 {
    direction.map(|d| {
        if d.abs() > 1e-300 {
            d.recip()
        } else {
            1e300_f64.copysign(d)
        }
    })
}

/// Where a ray enters and leaves an axis-aligned rectangle (m along the ray; either may be
/// negative). Enters after it leaves: it misses. `inverse` is [`inverse_direction`].
#[inline]
pub(crate) fn slab(min: Point2, max: Point2, origin: Point2, inverse: Vector2) -> (f64, f64) {
    let (x0, x1) = (
        (min.x - origin.x) * inverse.x,
        (max.x - origin.x) * inverse.x,
    );
    let (y0, y1) = (
        (min.y - origin.y) * inverse.y,
        (max.y - origin.y) * inverse.y,
    );
    (x0.min(x1).max(y0.min(y1)), x0.max(x1).min(y0.max(y1)))
}

/// Signed distance (m) of `p` to an axis-aligned rectangle, negative inside.
#[inline]
pub(crate) fn block_distance(min: Point2, max: Point2, p: Point2) -> f64 {
    let dx = (min.x - p.x).max(p.x - max.x);
    let dy = (min.y - p.y).max(p.y - max.y);
    if dx > 0.0 && dy > 0.0 {
        (dx * dx + dy * dy).sqrt()
    } else {
        dx.max(dy)
    }
}

/// Squared distance (m²) from `p` to the segment from `a` to `b`, which may be a point.
pub(crate) fn point_segment_distance_squared(p: Point2, a: Point2, b: Point2) -> f64 {
    let (span, offset) = (b - a, p - a);
    let length_squared = span.norm_squared();
    if length_squared == 0.0 {
        return offset.norm_squared();
    }
    let t = (offset.dot(&span) / length_squared).clamp(0.0, 1.0);
    (offset - span * t).norm_squared()
}

/// A common point of the closed segments a–b and c–d, if they have one.
///
/// Signs of exact-zero cross products are taken at their word: segments that miss each other
/// by less than rounding may be reported either way.
pub(crate) fn segments_meet(a: Point2, b: Point2, c: Point2, d: Point2) -> Option<Point2> {
    let (u, v) = (b - a, d - c);
    let c_side = u.perp(&(c - a));
    let d_side = u.perp(&(d - a));
    let a_side = v.perp(&(a - c));
    let b_side = v.perp(&(b - c));
    if c_side * d_side < 0.0 && a_side * b_side < 0.0 {
        return Some(a + u * (a_side / (a_side - b_side)));
    }
    let within = |p: Point2, s: Point2, e: Point2| {
        p.x >= s.x.min(e.x) && p.x <= s.x.max(e.x) && p.y >= s.y.min(e.y) && p.y <= s.y.max(e.y)
    };
    if c_side == 0.0 && within(c, a, b) {
        Some(c)
    } else if d_side == 0.0 && within(d, a, b) {
        Some(d)
    } else if a_side == 0.0 && within(a, c, d) {
        Some(a)
    } else if b_side == 0.0 && within(b, c, d) {
        Some(b)
    } else {
        None
    }
}

/// Whether `p` lies in the ring of vertices (even-odd rule; on the boundary either answer).
pub(crate) fn ring_contains(ring: &[Point2], p: Point2) -> bool {
    let mut inside = false;
    let mut previous = match ring.last() {
        Some(last) => *last,
        None => return false,
    };
    for &vertex in ring {
        if (vertex.y > p.y) != (previous.y > p.y) {
            let side = (vertex - previous).perp(&(p - previous));
            if (side > 0.0) == (vertex.y > previous.y) {
                inside = !inside;
            }
        }
        previous = vertex;
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;

    fn p(x: f64, y: f64) -> Point2 {
        Point2::new(x, y)
    }

    #[test]
    fn block_distance_is_that_of_face_corner_and_depth() {
        let (min, max) = (p(1.0, 2.0), p(4.0, 4.0));
        assert_eq!(block_distance(min, max, p(0.0, 3.0)), 1.0);
        assert_eq!(block_distance(min, max, p(7.0, 8.0)), 5.0);
        assert_eq!(block_distance(min, max, p(2.0, 2.5)), -0.5);
        assert_eq!(block_distance(min, max, p(1.0, 3.0)), 0.0);
    }

    #[test]
    fn a_corner_decides_the_side_where_it_is_nearest() {
        // Solid to the left of both edges; the turn at (1, 0) is to the right: reflex.
        let corner = Corner::between(Vector2::new(1.0, 0.0), Vector2::new(0.0, -1.0));
        assert_eq!(corner, Corner::Reflex);
        let edge = Edge::new(p(0.0, 0.0), p(1.0, 0.0), 0, Corner::Convex, corner);
        assert_eq!(edge.distance_squared_and_side(p(2.0, 1.0)), (2.0, true));
        assert_eq!(edge.distance_squared_and_side(p(-1.0, 1.0)), (2.0, false));
        assert_eq!(edge.distance_squared_and_side(p(0.5, 1.0)), (1.0, true));
        assert_eq!(edge.distance_squared_and_side(p(0.5, -1.0)), (1.0, false));
    }

    #[test]
    fn a_disc_is_hit_where_the_quadratic_says() {
        let disc = Primitive::Disc {
            center: p(5.0, 0.0),
            radius: 1.0,
        };
        assert_eq!(disc.ray_hit(p(0.0, 0.0), Vector2::x()), Some(4.0));
        assert_eq!(disc.ray_hit(p(0.0, 0.0), -Vector2::x()), None);
        assert_eq!(disc.ray_hit(p(5.5, 0.0), Vector2::x()), Some(0.0));
        assert_eq!(disc.ray_hit(p(0.0, 2.0), Vector2::x()), None);
    }

    #[test]
    fn a_ray_along_a_face_hits_the_block() {
        let block = Primitive::Block {
            min: p(2.0, 1.0),
            max: p(3.0, 2.0),
        };
        assert_eq!(block.ray_hit(p(0.0, 1.0), Vector2::x()), Some(2.0));
        assert_eq!(block.ray_hit(p(0.0, 0.999), Vector2::x()), None);
    }

    #[test]
    fn crossing_touching_and_disjoint_segments_are_told_apart() {
        let meet = segments_meet(p(0.0, 0.0), p(2.0, 2.0), p(0.0, 2.0), p(2.0, 0.0));
        assert_eq!(meet, Some(p(1.0, 1.0)));
        let touch = segments_meet(p(0.0, 0.0), p(2.0, 0.0), p(1.0, 0.0), p(1.0, 5.0));
        assert_eq!(touch, Some(p(1.0, 0.0)));
        let overlap = segments_meet(p(0.0, 0.0), p(2.0, 0.0), p(1.0, 0.0), p(5.0, 0.0));
        assert_eq!(overlap, Some(p(1.0, 0.0)));
        let collinear = segments_meet(p(0.0, 0.0), p(1.0, 0.0), p(2.0, 0.0), p(3.0, 0.0));
        assert_eq!(collinear, None);
    }

    #[test]
    fn even_odd_containment_holds_for_a_non_convex_ring() {
        let ring = [
            p(0.0, 0.0),
            p(4.0, 0.0),
            p(4.0, 4.0),
            p(2.0, 1.0),
            p(0.0, 4.0),
        ];
        assert!(ring_contains(&ring, p(0.5, 2.0)));
        assert!(!ring_contains(&ring, p(2.0, 2.0)));
        assert!(ring_contains(&ring, p(2.0, 0.5)));
        assert!(!ring_contains(&ring, p(-1.0, 0.0)));
    }
}
