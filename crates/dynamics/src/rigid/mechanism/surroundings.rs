//! What stands and moves around the bicycle: obstacles as bodies in its world, its hull, and what a ray meets.

use bikebot_geometry::Pose2;
use bikebot_world::Obstacle;
use nalgebra::{UnitQuaternion, Vector3};
use rapier3d_f64::prelude as rapier;
use rapier3d_f64::prelude::{ColliderBuilder, ColliderHandle, RigidBodyBuilder, RigidBodyHandle};

use super::super::obstacles;
use super::super::sight;
use super::{HULL, Mechanism, OBSTACLE, groups, rotation};
use crate::laser::Ray;

/// An obstacle that is moved from outside.
pub(super) struct MovingBody {
    pub(super) body: RigidBodyHandle,
    /// None for an outline that is no body.
    pub(super) collider: Option<ColliderHandle>,
    pub(super) built: Option<ColliderBuilder>,
    /// Where it is, or will be at the end of the next step; `None` while it is not there.
    pub(super) pose: Option<Pose2>,
}

impl Mechanism {
    /// Puts the world's obstacles around the bicycle, as high as `height` (m), and the footprint's hull on its frame.
    pub fn surround(
        &mut self,
        world: &bikebot_world::World,
        footprint: &bikebot_world::Footprint,
        height: f64,
    ) {
        self.sight.wall_height = world.grid().is_none().then_some(height);
        self.surround_with((
            obstacles::colliders(world, height),
            obstacles::hull(footprint, &self.parts.frame.centre),
        ));
    }

    pub(super) fn surround_with(
        &mut self,
        surroundings: (Vec<ColliderBuilder>, Vec<ColliderBuilder>),
    ) {
        for obstacle in surroundings.0.iter().cloned() {
            let collider = obstacle.collision_groups(groups(OBSTACLE, HULL)).build();
            self.sight.add(&collider);
            self.world.colliders.insert(collider);
        }
        self.sight.arrange();
        for part in surroundings.1.iter().cloned() {
            let collider = self.world.colliders.insert_with_parent(
                part.density(0.0).collision_groups(groups(HULL, OBSTACLE)),
                self.frame,
                &mut self.world.bodies,
            );
            self.hull.push(collider);
        }
        self.surroundings = surroundings;
    }

    /// Adds an obstacle that will be moved, with this outline (m, about its own reference point) and height (m). Until it is
    /// moved somewhere it is not there.
    pub fn add_moving_obstacle(&mut self, outline: &Obstacle, height: f64) {
        let built = obstacles::prism(outline, height);
        self.add_moving_body(built, None);
    }

    pub(super) fn add_moving_body(&mut self, built: Option<ColliderBuilder>, pose: Option<Pose2>) {
        let at = pose.unwrap_or(Pose2::new(0.0, 0.0, 0.0));
        let body = RigidBodyBuilder::kinematic_position_based()
            .pose(upright(&at))
            .enabled(pose.is_some());
        let body = self.world.insert_body(body);
        let collider = built.clone().map(|shape| {
            self.world.colliders.insert_with_parent(
                shape.collision_groups(groups(OBSTACLE, HULL)),
                body,
                &mut self.world.bodies,
            )
        });
        self.moving.push(MovingBody {
            body,
            collider,
            built,
            pose,
        });
    }

    /// Says where the moving obstacles, in the order they were added, will be at the end of the next step; `None` for one
    /// that is not there. What was not there before is there at once.
    pub fn move_obstacles(&mut self, poses: impl IntoIterator<Item = Option<Pose2>>) {
        for (moving, pose) in self.moving.iter_mut().zip(poses) {
            let body = &mut self.world.bodies[moving.body];
            match (moving.pose, pose) {
                (Some(_), Some(pose)) => body.set_next_kinematic_position(upright(&pose)),
                (None, Some(pose)) => {
                    body.set_enabled(true);
                    body.set_position(upright(&pose), true);
                    body.set_next_kinematic_position(upright(&pose));
                }
                (Some(_), None) => body.set_enabled(false),
                (None, None) => {}
            }
            moving.pose = pose;
        }
    }

    /// Range (m) along a ray to the first body that stands there, infinite beyond `max_range` (m). The edge of the field is
    /// as high as its obstacles; polygons have walls and no top.
    #[must_use]
    pub fn cast_ray(&self, ray: &Ray, max_range: f64) -> f64 {
        self.sight.cast(ray, max_range)
    }

    /// Range (m) along a ray to the body of the moving obstacle of this index, were it at `pose`; infinite beyond
    /// `max_range` (m).
    #[must_use]
    pub fn cast_ray_at_moving(&self, index: usize, pose: &Pose2, ray: &Ray, max_range: f64) -> f64 {
        let collider = self.moving.get(index).and_then(|moving| moving.collider);
        let Some(collider) = collider.and_then(|handle| self.world.colliders.get(handle)) else {
            return f64::INFINITY;
        };
        let on_body = collider.position_wrt_parent().copied().unwrap_or_default();
        sight::cast_at(collider.shape(), &(upright(pose) * on_body), ray, max_range)
    }

    /// Whether the hull overlaps an obstacle, or is held off one.
    #[must_use]
    pub fn touches_an_obstacle(&self) -> bool {
        self.touched().next().is_some()
    }

    /// The moving obstacle that the hull overlaps, or is held off, by the order they were added.
    #[must_use]
    pub fn touches_moving_obstacle(&self) -> Option<usize> {
        self.touched().find_map(|pair| {
            self.moving.iter().position(|moving| {
                moving
                    .collider
                    .is_some_and(|it| it == pair.collider1 || it == pair.collider2)
            })
        })
    }

    /// The pairs of the hull and an obstacle that touch.
    fn touched(&self) -> impl Iterator<Item = &rapier::ContactPair> {
        self.hull
            .iter()
            .flat_map(|part| self.world.narrow_phase.contact_pairs_with(*part))
            .filter(|pair| {
                pair.rigid().is_some_and(|contacts| {
                    contacts
                        .manifolds
                        .iter()
                        .flat_map(|manifold| &manifold.points)
                        .any(|point| point.dist < 0.0 || point.data.impulse > 0.0)
                })
            })
    }
}

/// Where a body upright on the ground is when its origin is at `pose`.
fn upright(pose: &Pose2) -> rapier::Pose {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), pose.heading);
    rapier::Pose::from_parts(
        rapier::Vector::new(pose.position.x, pose.position.y, 0.0),
        rotation(&turn),
    )
}
