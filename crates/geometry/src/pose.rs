//! Position and heading in the plane: an element of SE(2).

use crate::{Point2, Vector2, angle};

/// Where something is and which way it points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose2 {
    /// Position in the world frame, m.
    pub position: Point2,
    /// Heading, rad, counter-clockwise from the world's +x.
    pub heading: f64,
}

impl Pose2 {
    /// The pose at (`x`, `y`), m, with `heading` in rad. The heading is kept as given, not wrapped.
    #[must_use]
    pub fn new(x: f64, y: f64, heading: f64) -> Self {
        Self {
            position: Point2::new(x, y),
            heading,
        }
    }

    /// Unit vector along the heading.
    #[must_use]
    pub fn direction(&self) -> Vector2 {
        let (sin, cos) = self.heading.sin_cos();
        Vector2::new(cos, sin)
    }

    /// Unit vector to the left of the heading.
    #[must_use]
    pub fn left_normal(&self) -> Vector2 {
        let (sin, cos) = self.heading.sin_cos();
        Vector2::new(-sin, cos)
    }

    /// A point given in this pose's own frame (x forward, y left), in the world frame, m.
    #[must_use]
    pub fn transform(&self, local: Point2) -> Point2 {
        self.position + self.rotate(local.coords)
    }

    /// The pose `local`, given in this pose's own frame, in the world frame. Heading in (−π, π].
    #[must_use]
    pub fn compose(&self, local: &Self) -> Self {
        Self {
            position: self.transform(local.position),
            heading: angle::wrap(self.heading + local.heading),
        }
    }

    /// The pose that undoes this one: `p.compose(&p.inverse())` is the identity.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let back = Self::new(0.0, 0.0, -self.heading);
        Self {
            position: Point2::from(-back.rotate(self.position.coords)),
            heading: angle::wrap(-self.heading),
        }
    }

    /// Whether all three numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.position.x.is_finite() && self.position.y.is_finite() && self.heading.is_finite()
    }

    fn rotate(&self, v: Vector2) -> Vector2 {
        let (sin, cos) = self.heading.sin_cos();
        Vector2::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::FRAC_PI_2;

    fn pose() -> impl Strategy<Value = Pose2> {
        (-50.0..50.0_f64, -50.0..50.0_f64, -7.0..7.0_f64).prop_map(|(x, y, h)| Pose2::new(x, y, h))
    }

    #[test]
    fn forward_is_x_and_left_is_y() {
        let p = Pose2::new(2.0, 3.0, FRAC_PI_2);
        let ahead = p.transform(Point2::new(1.0, 0.0));
        let left = p.transform(Point2::new(0.0, 1.0));
        assert!((ahead - Point2::new(2.0, 4.0)).norm() < 1e-15);
        assert!((left - Point2::new(1.0, 3.0)).norm() < 1e-15);
        assert!((p.direction() - Vector2::new(0.0, 1.0)).norm() < 1e-15);
        assert!((p.left_normal() - Vector2::new(-1.0, 0.0)).norm() < 1e-15);
    }

    #[test]
    fn a_number_that_is_not_finite_is_noticed() {
        assert!(Pose2::new(0.0, 0.0, 0.0).is_finite());
        assert!(!Pose2::new(0.0, f64::NAN, 0.0).is_finite());
        assert!(!Pose2::new(0.0, 0.0, f64::INFINITY).is_finite());
    }

    proptest! {
        #[test]
        fn a_pose_and_its_inverse_cancel(p in pose()) {
            let identity = p.compose(&p.inverse());
            // 50 m times one rounding of the rotation.
            prop_assert!(identity.position.coords.norm() < 1e-12);
            prop_assert!(identity.heading.abs() < 1e-12);
        }

        #[test]
        fn composition_is_associative(a in pose(), b in pose(), c in pose()) {
            let left = a.compose(&b).compose(&c);
            let right = a.compose(&b.compose(&c));
            prop_assert!((left.position - right.position).norm() < 1e-12);
            prop_assert!(angle::difference(left.heading, right.heading).abs() < 1e-12);
        }
    }
}
