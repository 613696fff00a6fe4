//! Rays in space, and what they can be cast through.

use bikebot_geometry::Point2;
use bikebot_world::World;
use nalgebra::{Point3, Vector3};

/// Half a line in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it begins, world frame, m; z above the ground.
    pub origin: Point3<f64>,
    /// Where it goes, world frame, of length one.
    pub direction: Vector3<f64>,
}

impl Ray {
    /// The point (m) this far (m) along the ray.
    #[must_use]
    pub fn at(&self, range: f64) -> Point3<f64> {
        self.origin + self.direction * range
    }

    /// Range (m) at which the ray meets the ground, z = 0; infinite for one that is level or rises, zero below the ground.
    #[must_use]
    pub fn ground_range(&self) -> f64 {
        if self.origin.z < 0.0 {
            0.0
        } else if self.direction.z < 0.0 {
            self.origin.z / -self.direction.z
        } else {
            f64::INFINITY
        }
    }

    /// The ranges (m) between which the ray is no lower than the ground and no higher than `height` (m), if it ever is.
    #[must_use]
    pub fn between_ground_and(&self, height: f64) -> Option<(f64, f64)> {
        let (z, rise) = (self.origin.z, self.direction.z);
        let (near, far) = if rise > 0.0 {
            (-z / rise, (height - z) / rise)
        } else if rise < 0.0 {
            ((height - z) / rise, -z / rise)
        } else if (0.0..=height).contains(&z) {
            (0.0, f64::INFINITY)
        } else {
            return None;
        };
        (far >= 0.0).then_some((near.max(0.0), far))
    }
}

/// Whatever a laser can look at: the true world, what moves in it, the bodies of a physics engine.
///
/// The ground is no part of it; the scanner knows it.
pub trait RayScene {
    /// Range (m) along the ray to the first thing it meets at `time` (s), infinite where that is farther than `max_range` (m)
    /// or nothing at all; zero from inside something.
    fn cast(&self, ray: &Ray, time: f64, max_range: f64) -> f64;
}

impl<S: RayScene + ?Sized> RayScene for &S {
    fn cast(&self, ray: &Ray, time: f64, max_range: f64) -> f64 {
        (**self).cast(ray, time, max_range)
    }
}

/// Two scenes in one: the nearer of what either shows.
impl<A: RayScene, B: RayScene> RayScene for (A, B) {
    fn cast(&self, ray: &Ray, time: f64, max_range: f64) -> f64 {
        let first = self.0.cast(ray, time, max_range);
        first.min(self.1.cast(ray, time, max_range.min(first)))
    }
}

/// A world of prisms: its obstacles and the edge of its field stand on the ground and reach up to one height.
#[derive(Debug, Clone, Copy)]
pub struct Prisms<'w> {
    /// What stands there.
    pub world: &'w World,
    /// How high, m.
    pub height: f64,
}

impl RayScene for Prisms<'_> {
    fn cast(&self, ray: &Ray, _time: f64, max_range: f64) -> f64 {
        let Some((near, far)) = ray.between_ground_and(self.height) else {
            return f64::INFINITY;
        };
        let far = far.min(max_range);
        // Written so that NaN is out of sight.
        let in_sight = near <= far;
        if !in_sight {
            return f64::INFINITY;
        }
        let over_ground = ray.direction.xy().norm();
        let (from, along) = (ray.at(near), ray.direction.y.atan2(ray.direction.x));
        let from = Point2::new(from.x, from.y);
        // A ray that stands upright, or ends where it enters, still meets what it begins in.
        let length = ((far - near) * over_ground).max(f64::MIN_POSITIVE);
        match self.world.cast_ray(from, along, length) {
            Some(0.0) => near,
            Some(distance) if over_ground > 0.0 => near + distance / over_ground,
            _ => f64::INFINITY,
        }
    }
}
