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
}

/// The outline of a rounded box with the body at a place of the plane, ready to be cut into rows of unit squares.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Rim {
    radius: f64,
    /// Corners of the rectangle, the rear right one first.
    corners: [[f64; 2]; 4],
    /// How many corners differ: one of a disc, two of a capsule.
    distinct: usize,
    /// Its sides, moved out by the radius: from, to.
    sides: [[[f64; 2]; 2]; 4],
    side_count: usize,
    /// Least and greatest y.
    pub low: f64,
    pub high: f64,
}

impl Rim {
    pub fn of(posed: &Posed) -> Self {
        let part = &posed.part;
        let radius = part.radius;
        let mut rim = Self {
            radius,
            ..Self::default()
        };
        let ways = [
            (part.rear, part.right),
            (part.front, part.right),
            (part.front, part.left),
            (part.rear, part.left),
        ];
        for (i, &(x, y)) in ways.iter().enumerate() {
            let corner = posed.out(x, y);
            if !ways[..i].contains(&(x, y)) {
                rim.corners[rim.distinct] = [corner.x, corner.y];
                rim.distinct += 1;
            }
            let (to_x, to_y) = ways[(i + 1) % 4];
            let (dx, dy) = (to_x - x, to_y - y);
            if dx != 0.0 || dy != 0.0 {
                // The outward normal of a side that goes round counter-clockwise.
                let (nx, ny) = (radius * dy.signum() * f64::from(dx == 0.0), {
                    -radius * dx.signum() * f64::from(dy == 0.0)
                });
                let from = posed.out(x + nx, y + ny);
                let to = posed.out(to_x + nx, to_y + ny);
                rim.sides[rim.side_count] = [[from.x, from.y], [to.x, to.y]];
                rim.side_count += 1;
            }
        }
        let heights = rim.corners[..rim.distinct].iter().map(|corner| corner[1]);
        (rim.low, rim.high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| {
            (low.min(y), high.max(y))
        });
        rim.low -= radius;
        rim.high += radius;
        rim
    }

    /// Least and greatest x of what lies between the heights `y` and `y` + 1; `None` if nothing does.
    ///
    /// The rim is made of arcs about the corners and of the sides moved out. All of these belong to the outline, which is convex, so what lies
    /// farthest to either side in the row is on one of them.
    pub fn row(&self, y: f64) -> Option<(f64, f64)> {
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for [cx, cy] in &self.corners[..self.distinct] {
            let off = cy.clamp(y, y + 1.0) - cy;
            let square = self.radius * self.radius - off * off;
            if square >= 0.0 {
                let half = square.sqrt();
                least = least.min(cx - half);
                most = most.max(cx + half);
            }
        }
        for [[ax, ay], [bx, by]] in &self.sides[..self.side_count] {
            let (low, high) = (y.max(ay.min(*by)), (y + 1.0).min(ay.max(*by)));
            if low > high {
                continue;
            }
            let rise = by - ay;
            let at = |h: f64| {
                if rise == 0.0 {
                    *ax
                } else {
                    ax + (bx - ax) * ((h - ay) / rise)
                }
            };
            // A level side is all in one row.
            let ends = if rise == 0.0 {
                [*ax, *bx]
            } else {
                [at(low), at(high)]
            };
            least = least.min(ends[0].min(ends[1]));
            most = most.max(ends[0].max(ends[1]));
        }
        (least <= most).then_some((least, most))
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
                let rim = Rim::of(&Posed::new(part, Vector2::new(x, y), heading.sin_cos()));
                rim.row(0.0).is_some_and(|(least, most)| least <= 1.0 && most >= 0.0)
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
