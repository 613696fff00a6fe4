//! An outline as rounded boxes, and how near a square cell comes to it.
//!
//! A rounded box is all points within `radius` of a rectangle with sides along the body's axes, which may have shrunk to a line or a
//! point: capsules, discs and rectangles are one of them exactly. A polygon is covered by discs that stick out of it a
//! little.

use bikebot_geometry::Vector2;
use bikebot_world::Footprint;

/// All points within `radius` of a rectangle in the body frame. In whatever unit of length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RoundedBox {
    pub rear: f64,
    pub front: f64,
    pub right: f64,
    pub left: f64,
    pub radius: f64,
}

impl RoundedBox {
    /// The boxes that together hold `outline` and all points within `grown` of it, m.
    pub fn of(outline: &Footprint, grown: f64) -> Vec<Self> {
        let bare = match *outline {
            Footprint::Point => vec![Self::disc(0.0, 0.0, 0.0)],
            Footprint::Disc { radius } => vec![Self::disc(0.0, 0.0, radius)],
            Footprint::Capsule {
                rear,
                front,
                radius,
            } => vec![Self {
                front,
                ..Self::disc(rear, 0.0, radius)
            }],
            Footprint::Rectangle {
                rear,
                front,
                half_width,
            } => vec![Self {
                rear,
                front,
                right: -half_width,
                left: half_width,
                radius: 0.0,
            }],
            _ => outline
                .discs()
                .iter()
                .map(|disc| Self::disc(disc.offset, disc.lateral, disc.radius))
                .collect(),
        };
        bare.into_iter()
            .map(|part| Self {
                radius: part.radius + grown,
                ..part
            })
            .collect()
    }

    fn disc(x: f64, y: f64, radius: f64) -> Self {
        Self {
            rear: x,
            front: x,
            right: y,
            left: y,
            radius,
        }
    }

    /// The same in another unit of length.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            rear: factor * self.rear,
            front: factor * self.front,
            right: factor * self.right,
            left: factor * self.left,
            radius: factor * self.radius,
        }
    }

    /// How far no point of it moves beyond, per length of way, while the body rides a way with curvature up to `curvature`.
    pub fn speed_bound(&self, curvature: f64) -> f64 {
        let ahead = self.rear.abs().max(self.front.abs()) + self.radius;
        let aside = self.right.abs().max(self.left.abs()) + self.radius;
        (1.0 + curvature * aside).hypot(curvature * ahead)
    }

    /// Distance of a point of the body frame from the rectangle, without the radius.
    fn distance(&self, x: f64, y: f64) -> f64 {
        let dx = (self.rear - x).max(x - self.front).max(0.0);
        let dy = (self.right - y).max(y - self.left).max(0.0);
        dx.hypot(dy)
    }
}

/// A rounded box with the body at a place of the plane, among unit squares.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Posed {
    part: RoundedBox,
    origin: Vector2,
    cos: f64,
    sin: f64,
}

impl Posed {
    /// With the body's reference point at `origin` and its x axis along (cos, sin).
    pub fn new(part: RoundedBox, origin: Vector2, (sin, cos): (f64, f64)) -> Self {
        Self {
            part,
            origin,
            cos,
            sin,
        }
    }

    /// The smallest rectangle around it: least and greatest x, least and greatest y.
    pub fn extent(&self) -> [f64; 4] {
        let part = &self.part;
        let middle = self.out(
            0.5 * (part.rear + part.front),
            0.5 * (part.right + part.left),
        );
        let (ahead, aside) = (
            0.5 * (part.front - part.rear),
            0.5 * (part.left - part.right),
        );
        let (cos, sin) = (self.cos.abs(), self.sin.abs());
        let dx = cos * ahead + sin * aside + part.radius;
        let dy = sin * ahead + cos * aside + part.radius;
        [middle.x - dx, middle.x + dx, middle.y - dy, middle.y + dy]
    }

    fn out(&self, x: f64, y: f64) -> Vector2 {
        self.origin + Vector2::new(self.cos * x - self.sin * y, self.sin * x + self.cos * y)
    }

    /// Distance of a point from it, negative within the radius.
    pub fn gap(&self, p: Vector2) -> f64 {
        self.distance(p) - self.part.radius
    }

    fn distance(&self, p: Vector2) -> f64 {
        let d = p - self.origin;
        self.part.distance(
            self.cos * d.x + self.sin * d.y,
            self.cos * d.y - self.sin * d.x,
        )
    }

    /// Whether it meets the unit square whose lower left corner is (x, y).
    pub fn meets(&self, x: f64, y: f64) -> bool {
        let radius = self.part.radius;
        let centre = self.distance(Vector2::new(x + 0.5, y + 0.5));
        // The disc in the square, and the disc around it, decide all but a ring.
        if centre <= radius + 0.5 {
            return true;
        }
        if centre > radius + std::f64::consts::FRAC_1_SQRT_2 {
            return false;
        }
        // Of two convex polygons that do not meet, a corner of one is nearest to the other.
        let of_square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
            .into_iter()
            .map(|(dx, dy)| self.distance(Vector2::new(x + dx, y + dy)))
            .fold(f64::INFINITY, f64::min);
        if of_square <= radius {
            return true;
        }
        let part = &self.part;
        [
            (part.rear, part.right),
            (part.front, part.right),
            (part.front, part.left),
            (part.rear, part.left),
        ]
        .into_iter()
        .any(|(bx, by)| {
            let corner = self.out(bx, by);
            let dx = (x - corner.x).max(corner.x - x - 1.0).max(0.0);
            let dy = (y - corner.y).max(corner.y - y - 1.0).max(0.0);
            dx.hypot(dy) <= radius
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::{Point2, Pose2};
    use bikebot_world::{Bounds, Obstacle, World};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_square_is_met_where_the_exact_clearance_says_so(
            x in -3.0..3.0_f64,
            y in -3.0..3.0_f64,
            heading in -4.0..4.0_f64,
            shape in 0..3_usize,
        ) {
            let outline = [
                Footprint::Capsule { rear: -0.4, front: 1.16, radius: 0.6 },
                Footprint::Rectangle { rear: -0.7, front: 1.3, half_width: 0.4 },
                Footprint::Disc { radius: 0.8 },
            ][shape].clone();
            let square = Obstacle::Block { min: Point2::new(0.0, 0.0), max: Point2::new(1.0, 1.0) };
            let world = World::new(Bounds::new(-9.0, -9.0, 9.0, 9.0), vec![square]).unwrap();
            let pose = Pose2::new(x, y, heading);
            let clearance = world.footprint_clearance(&outline, &pose);
            let meets = RoundedBox::of(&outline, 0.0).into_iter().any(|part| {
                Posed::new(part, Vector2::new(x, y), heading.sin_cos()).meets(0.0, 0.0)
            });
            // Rounding decides only where they just touch.
            prop_assume!(clearance.abs() > 1e-9);
            prop_assert_eq!(meets, clearance < 0.0, "clearance {}", clearance);
        }
    }

    #[test]
    fn its_extent_is_that_of_the_outline() {
        let part = RoundedBox::of(&Footprint::bike(), 0.1)[0];
        let along = Posed::new(part, Vector2::new(2.0, 3.0), 0.0_f64.sin_cos()).extent();
        for (found, expected) in along.into_iter().zip([1.56, 3.56, 2.6, 3.4]) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }
}
