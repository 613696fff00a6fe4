//! What moves in the true world, appears in it or is hidden from the planner: exact, and the same for everyone.
//!
//! Each obstacle is a rigid outline that follows its [`Itinerary`]. Distances and rays are asked of a [`World`] that holds
//! this one outline in its own frame, so that they are as exact as those of the map.

mod itinerary;

use bikebot_dynamics::laser::{Prisms, Ray, RayScene};
use bikebot_geometry::{Point2, Pose2};
use bikebot_world::{Bounds, Footprint, Obstacle, World, WorldError};
use nalgebra::{Point3, Vector3};

pub use itinerary::Itinerary;

use crate::record::Shape;

/// How far the outline of an obstacle may reach from its reference point, m.
pub const MOST_REACH: f64 = 100.0;
/// Half the side of the field an outline stands in in its own frame, m: no beam comes to its edge.
const FIELD: f64 = 4e4;
/// Farther than this the distance to an outline is bounded and not measured, m.
const FAR: f64 = 2e4;

/// One obstacle that is not, or not always, part of the known map.
#[derive(Debug)]
pub struct MovingObstacle {
    outline: Obstacle,
    /// The outline alone, in its own frame.
    solid: World,
    reach: f64,
    height: f64,
    itinerary: Itinerary,
}

impl MovingObstacle {
    /// An obstacle with this outline (m, about its own reference point) and height (m).
    ///
    /// # Errors
    ///
    /// [`WorldError`] for an outline that encloses nothing, crosses itself, or is too large.
    pub fn new(outline: Obstacle, height: f64, itinerary: Itinerary) -> Result<Self, WorldError> {
        let field = Bounds::new(-FIELD, -FIELD, FIELD, FIELD);
        let solid = World::new(field, vec![outline.clone()])?;
        Ok(Self {
            reach: reach(&outline),
            outline,
            solid,
            height,
            itinerary,
        })
    }

    /// Its outline about its own reference point, m.
    #[must_use]
    pub fn outline(&self) -> &Obstacle {
        &self.outline
    }

    /// Distance (m) from its reference point to the farthest point of its outline.
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// How high it is, m.
    #[must_use]
    pub fn height(&self) -> f64 {
        self.height
    }

    /// When and where it is.
    #[must_use]
    pub fn itinerary(&self) -> &Itinerary {
        &self.itinerary
    }

    /// Its outline in the world frame at `time` (s); `None` while it is not there.
    #[must_use]
    pub fn outline_at(&self, time: f64) -> Option<Obstacle> {
        Some(placed(&self.outline, &self.itinerary.pose(time)?))
    }

    /// Signed distance (m) to a footprint carried by `pose`, negative where they overlap; infinite while it is not
    /// there. Beyond 20 km a number that is not larger.
    #[must_use]
    pub fn clearance(&self, footprint: &Footprint, pose: &Pose2, time: f64) -> f64 {
        let Some(own) = self.itinerary.pose(time) else {
            return f64::INFINITY;
        };
        let seen = own.inverse().compose(pose);
        let away = seen.position.coords.norm();
        if away > FAR {
            away - self.reach - footprint.reach()
        } else {
            self.solid.footprint_clearance(footprint, &seen)
        }
    }

    /// A number not above [`clearance`](Self::clearance), for little.
    fn least_clearance(&self, footprint: &Footprint, pose: &Pose2, time: f64) -> f64 {
        self.itinerary.pose(time).map_or(f64::INFINITY, |own| {
            (own.position - pose.position).norm() - self.reach - footprint.reach()
        })
    }

    /// Where the obstacle is, if that is so near to the ray that they have to be looked at closer.
    fn near_ray(&self, ray: &Ray, time: f64, max_range: f64) -> Option<Pose2> {
        let own = self.itinerary.pose(time)?;
        let to = own.position - Point2::new(ray.origin.x, ray.origin.y);
        let along = ray.direction.xy();
        let squared = along.norm_squared();
        let nearest = if squared > 0.0 {
            (to.dot(&along) / squared).max(0.0).min(max_range)
        } else {
            0.0
        };
        // The hair more keeps a beam that grazes the rim.
        let near = self.reach * (1.0 + 1e-9);
        let comes_near = (to - along * nearest).norm_squared() <= near * near;
        comes_near.then_some(own)
    }
}

impl RayScene for MovingObstacle {
    fn cast(&self, ray: &Ray, time: f64, max_range: f64) -> f64 {
        let Some(own) = self.near_ray(ray, time, max_range) else {
            return f64::INFINITY;
        };
        let prism = Prisms {
            world: &self.solid,
            height: self.height,
        };
        prism.cast(&seen_from(&own, ray), time, max_range)
    }
}

/// Everything that moves, appears or is hidden, in the order of the scenario.
#[derive(Debug, Default)]
pub struct Traffic {
    obstacles: Vec<MovingObstacle>,
    /// Which `[[obstacle]]` of the scenario each of them is, counted from zero.
    numbers: Vec<usize>,
}

impl Traffic {
    /// Adds an obstacle that is number `number` of the scenario, counted from zero.
    pub fn push(&mut self, number: usize, obstacle: MovingObstacle) {
        self.obstacles.push(obstacle);
        self.numbers.push(number);
    }

    /// All of them, in order.
    #[must_use]
    pub fn obstacles(&self) -> &[MovingObstacle] {
        &self.obstacles
    }

    /// Whether there is nothing that moves, appears or is hidden.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.obstacles.is_empty()
    }

    /// Which `[[obstacle]]` of the scenario the obstacle of this index is, counted from zero.
    #[must_use]
    pub fn number(&self, index: usize) -> Option<usize> {
        self.numbers.get(index).copied()
    }

    /// Poses of all of them at `time` (s); `None` for one that is not there.
    pub fn poses(&self, time: f64) -> impl Iterator<Item = Option<Pose2>> + '_ {
        self.obstacles
            .iter()
            .map(move |obstacle| obstacle.itinerary.pose(time))
    }

    /// Index of the obstacle nearest to a footprint at `time` (s), and the signed distance (m) to it, if that is below
    /// `limit` (m).
    #[must_use]
    pub fn nearest(
        &self,
        footprint: &Footprint,
        pose: &Pose2,
        time: f64,
        limit: f64,
    ) -> Option<(usize, f64)> {
        let mut least = limit;
        let mut nearest = None;
        for (index, obstacle) in self.obstacles.iter().enumerate() {
            if obstacle.least_clearance(footprint, pose, time) >= least {
                continue;
            }
            let clearance = obstacle.clearance(footprint, pose, time);
            if clearance < least {
                least = clearance;
                nearest = Some((index, clearance));
            }
        }
        nearest
    }

    /// Signed distance (m) from a footprint carried by `pose` to the nearest obstacle at `time` (s), negative where they
    /// overlap; infinite while none is there.
    #[must_use]
    pub fn clearance(&self, footprint: &Footprint, pose: &Pose2, time: f64) -> f64 {
        self.nearest(footprint, pose, time, f64::INFINITY)
            .map_or(f64::INFINITY, |(_, clearance)| clearance)
    }

    /// Indices and poses of the obstacles that a ray may meet at `time` (s) within `max_range` (m), and few others.
    pub fn near_ray<'a>(
        &'a self,
        ray: &'a Ray,
        time: f64,
        max_range: f64,
    ) -> impl Iterator<Item = (usize, Pose2)> + 'a {
        let obstacles = self.obstacles.iter().enumerate();
        obstacles.filter_map(move |(index, it)| Some((index, it.near_ray(ray, time, max_range)?)))
    }

    /// What is there at `time` (s), as recordings have it.
    #[must_use]
    pub fn shapes(&self, time: f64) -> Vec<Shape> {
        self.obstacles
            .iter()
            .filter_map(|obstacle| obstacle.outline_at(time))
            .map(|outline| crate::picture::shape(&outline))
            .collect()
    }
}

impl RayScene for Traffic {
    fn cast(&self, ray: &Ray, time: f64, max_range: f64) -> f64 {
        self.obstacles.iter().fold(f64::INFINITY, |nearest, it| {
            nearest.min(it.cast(ray, time, max_range.min(nearest)))
        })
    }
}

/// A ray of the world in the frame of something at `pose`.
fn seen_from(pose: &Pose2, ray: &Ray) -> Ray {
    let inverse = pose.inverse();
    let origin = inverse.transform(Point2::new(ray.origin.x, ray.origin.y));
    let (sin, cos) = inverse.heading.sin_cos();
    let along = ray.direction;
    Ray {
        origin: Point3::new(origin.x, origin.y, ray.origin.z),
        direction: Vector3::new(
            cos * along.x - sin * along.y,
            sin * along.x + cos * along.y,
            along.z,
        ),
    }
}

/// An outline put down at a pose.
#[must_use]
pub fn placed(outline: &Obstacle, pose: &Pose2) -> Obstacle {
    match outline {
        Obstacle::Disc { center, radius } => Obstacle::Disc {
            center: pose.transform(*center),
            radius: *radius,
        },
        Obstacle::Polygon { vertices } => Obstacle::Polygon {
            vertices: vertices.iter().map(|v| pose.transform(*v)).collect(),
        },
        Obstacle::Block { min, max } => Obstacle::Polygon {
            vertices: [
                *min,
                Point2::new(max.x, min.y),
                *max,
                Point2::new(min.x, max.y),
            ]
            .map(|corner| pose.transform(corner))
            .to_vec(),
        },
    }
}

/// Distance (m) from the origin to the farthest point of an outline.
fn reach(outline: &Obstacle) -> f64 {
    match outline {
        Obstacle::Disc { center, radius } => center.coords.norm() + radius,
        Obstacle::Polygon { vertices } => {
            vertices.iter().map(|v| v.coords.norm()).fold(0.0, f64::max)
        }
        Obstacle::Block { min, max } => {
            let x = min.x.abs().max(max.x.abs());
            let y = min.y.abs().max(max.y.abs());
            x.hypot(y)
        }
    }
}

#[cfg(test)]
mod tests;
