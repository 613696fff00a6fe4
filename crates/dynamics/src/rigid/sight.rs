//! Rays against the bodies that stand around the bike.
//!
//! The engine keeps a tree of its own, but only from its first step on and for all of its bodies; the few questions of a
//! laser are asked of one that holds what can be seen.

use rapier3d_f64::parry::partitioning::{Bvh, BvhBuildStrategy};
use rapier3d_f64::prelude as rapier;
use rapier3d_f64::prelude::{Aabb, Collider, Shape, SharedShape};

use crate::laser::Ray;

/// The bodies that stand, as far as they can be seen.
pub(super) struct Sight {
    /// Bounded bodies where they stand.
    bodies: Vec<(SharedShape, rapier::Pose)>,
    boxes: Vec<Aabb>,
    tree: Bvh,
    /// The edges of the field: half-spaces without end upwards.
    walls: Vec<(SharedShape, rapier::Pose)>,
    /// How high the edges of the field are seen, m; none around a grid map, beyond which nothing is known.
    pub(super) wall_height: Option<f64>,
}

impl Default for Sight {
    fn default() -> Self {
        Self {
            bodies: Vec::new(),
            boxes: Vec::new(),
            tree: Bvh::new(),
            walls: Vec::new(),
            wall_height: None,
        }
    }
}

impl Sight {
    /// Takes note of a body. It is seen once everything is [arranged](Self::arrange).
    pub(super) fn add(&mut self, collider: &Collider) {
        let body = (collider.shared_shape().clone(), *collider.position());
        if collider.shape().as_halfspace().is_some() {
            self.walls.push(body);
        } else {
            self.boxes.push(collider.compute_aabb());
            self.bodies.push(body);
        }
    }

    /// Builds the tree of what was added.
    pub(super) fn arrange(&mut self) {
        self.tree = Bvh::from_leaves(BvhBuildStrategy::default(), &self.boxes);
    }

    /// Range (m) along a ray to the nearest of the bodies, infinite beyond `max_range` (m).
    pub(super) fn cast(&self, ray: &Ray, max_range: f64) -> f64 {
        let mut nearest = f64::INFINITY;
        let wall_height = self.wall_height;
        if let Some((near, far)) = wall_height.and_then(|height| ray.between_ground_and(height)) {
            for (shape, position) in &self.walls {
                // From where the ray comes below the top of the edge, to where it leaves it.
                let from = Ray {
                    origin: ray.at(near),
                    ..*ray
                };
                let length = far.min(max_range).min(nearest) - near;
                nearest = nearest.min(near + cast_at(&**shape, position, &from, length));
            }
        }
        let limit = max_range.min(nearest);
        let hit = self.tree.cast_ray(&to_rapier(ray), limit, |leaf, best| {
            let (shape, position) = self.bodies.get(leaf as usize)?;
            let range = cast_at(&**shape, position, ray, best);
            range.is_finite().then_some(range)
        });
        hit.map_or(nearest, |(_, range)| range.min(nearest))
    }
}

/// Range (m) along a ray to a shape at a position, infinite beyond `max_range` (m) and where that is below zero.
pub(super) fn cast_at(
    shape: &dyn Shape,
    position: &rapier::Pose,
    ray: &Ray,
    max_range: f64,
) -> f64 {
    if max_range >= 0.0 {
        shape
            .cast_ray(position, &to_rapier(ray), max_range, true)
            .unwrap_or(f64::INFINITY)
    } else {
        f64::INFINITY
    }
}

fn to_rapier(ray: &Ray) -> rapier::Ray {
    let (origin, along) = (ray.origin, ray.direction);
    rapier::Ray::new(
        rapier::Vector::new(origin.x, origin.y, origin.z),
        rapier::Vector::new(along.x, along.y, along.z),
    )
}
