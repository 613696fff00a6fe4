//! The bike robot on rigid bodies: from [`BikeInput`] to forces, and from bodies to [`BikeState`].

use bikebot_geometry::Pose2;
use bikebot_world::{Footprint, Obstacle, World};
use nalgebra::{Vector2, Vector3};

use super::mechanism::{Drive, Loads, Mechanism, Placement, RearMotion};
use super::parts::BicycleParts;
use super::steering::FrontAxle;
use crate::bike::{BikeAcceleration, BikeInput, BikeState};
use crate::constants::GRAVITY;
use crate::contact::ContactForces;
use crate::error::DynamicsError;
use crate::laser::Ray;
use crate::params::{BikeParams, Offset};
use crate::steering_geometry::SteeringGeometry;

/// How fast a wrong offset is corrected, 1/s.
const SHIFT_GAIN: f64 = 20.0;
/// How far the offset may be from where it is wanted before the balancer is given its slide, m.
const OFFSET_SLACK: f64 = 1e-6;
/// Share of the friction cone from which on a tyre counts as sliding, together with a sliding speed: the solver
/// keeps the force inside the cone, so that its share alone never exceeds one.
const SLIDING_SHARE: f64 = 0.99;
/// m/s.
const SLIDING_SPEED: f64 = 0.02;

/// How finely the rigid bodies are stepped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidStep {
    /// Length of a step, s.
    pub duration: f64,
    /// Solver iterations in it, each with its own integration.
    pub iterations: usize,
}

impl Default for RigidStep {
    fn default() -> Self {
        Self {
            duration: 1e-3,
            iterations: 4,
        }
    }
}

/// The bike robot in a Rapier world of its own. Unlike the other plants it owns its state.
#[derive(Debug)]
pub struct RigidBike {
    mechanism: Mechanism,
    axis: Vector3<f64>,
    step: f64,
    friction: (f64, f64),
    /// Ground-projected steering angle the servo stands at, rad.
    steer: f64,
    motion: RearMotion,
    state: BikeState,
    acceleration: BikeAcceleration,
    contact: ContactForces,
    has_touched: bool,
    touched_moving: Option<usize>,
}

impl RigidBike {
    /// The bike with wheels, fork and steering axis of `geometry`, put down in `state` with its balancer at
    /// `offset`.
    ///
    /// # Errors
    ///
    /// [`DynamicsError::NothingLeftForTheFrame`] where wheels and fork exceed the parameters' link 1.
    pub fn new(
        params: &BikeParams,
        geometry: SteeringGeometry,
        state: &BikeState,
        offset: &Offset,
        step: RigidStep,
    ) -> Result<Self, DynamicsError> {
        let mut parts = BicycleParts::robot(params, geometry)?;
        if let Some(balancer) = &mut parts.balancer {
            balancer.slides = offset.rate != 0.0;
        }
        let axis = parts.steering_axis();
        let placement = Placement {
            position: Vector2::new(state.pose.position.x, state.pose.position.y),
            heading: state.pose.heading,
            roll: state.roll,
            steer: FrontAxle::new(state.roll, 0.0, &axis).handlebar(state.steer),
            balancer: state.balancer,
            offset: offset.d,
            offset_rate: offset.rate,
            speed: state.speed,
            roll_rate: state.roll_rate,
            yaw_rate: state.speed * state.steer.tan() / params.wheelbase,
            steer_rate: 0.0,
            balancer_rate: state.balancer_rate,
        };
        let mechanism = Mechanism::new(
            &parts,
            step.duration,
            step.iterations,
            params.friction,
            &placement,
        );
        let motion = mechanism.rear();
        Ok(Self {
            axis,
            step: step.duration,
            friction: (params.friction, params.friction),
            steer: state.steer,
            motion,
            state: *state,
            acceleration: BikeAcceleration {
                speed: 0.0,
                yaw: 0.0,
                roll: 0.0,
                balancer: 0.0,
            },
            contact: ContactForces {
                drive: 0.0,
                rear_lateral: 0.0,
                front_normal: 0.0,
                rear_load: 0.0,
                front_load: 0.0,
                slides: false,
            },
            has_touched: false,
            touched_moving: None,
            mechanism,
        })
    }

    /// Puts the world's obstacles around the bike, all as high as `height` (m), and the footprint's hull on its frame.
    pub fn surround(&mut self, world: &World, footprint: &Footprint, height: f64) {
        self.mechanism.surround(world, footprint, height);
    }

    /// Adds an obstacle that will be moved, with this outline (m, about its own reference point) and height (m). It is not
    /// there until [`move_obstacles`](Self::move_obstacles) says where.
    pub fn add_moving_obstacle(&mut self, outline: &Obstacle, height: f64) {
        self.mechanism.add_moving_obstacle(outline, height);
    }

    /// Says where the moving obstacles, in the order they were added, will be at the end of the next step; `None` for one
    /// that is not there. What was not there before is there at once.
    pub fn move_obstacles(&mut self, poses: impl IntoIterator<Item = Option<Pose2>>) {
        self.mechanism.move_obstacles(poses);
    }

    /// Range (m) along a ray to the first body that stands there, infinite beyond `max_range` (m).
    #[must_use]
    pub fn cast_ray(&self, ray: &Ray, max_range: f64) -> f64 {
        self.mechanism.cast_ray(ray, max_range)
    }

    /// Range (m) along a ray to the body of the moving obstacle of this index, were it at `pose`; infinite beyond
    /// `max_range` (m).
    #[must_use]
    pub fn cast_ray_at_moving(&self, index: usize, pose: &Pose2, ray: &Ray, max_range: f64) -> f64 {
        self.mechanism
            .cast_ray_at_moving(index, pose, ray, max_range)
    }

    /// Whether the hull has touched an obstacle.
    #[must_use]
    pub fn has_touched_an_obstacle(&self) -> bool {
        self.has_touched
    }

    /// The moving obstacle that the hull has touched first, by the order they were added.
    #[must_use]
    pub fn touched_moving_obstacle(&self) -> Option<usize> {
        self.touched_moving
    }

    /// Moves the bike on by one step under a held input.
    pub fn step(&mut self, input: &BikeInput) {
        let shifts = input.offset.rate != 0.0
            || (input.offset.d - self.mechanism.offset()).abs() > OFFSET_SLACK;
        if shifts && !self.mechanism.slides() {
            self.mechanism = self.mechanism.with_slide();
        }
        let (sin, cos) = self.motion.heading.sin_cos();
        let ahead = Vector3::new(cos, sin, 0.0);
        // The servo's target at the end of the step, seen from where the frame will lean then.
        self.steer += input.steer_rate * self.step;
        let roll = self.motion.roll + self.motion.roll_rate * self.step;
        let target = FrontAxle::new(roll, self.motion.pitch, &self.axis).handlebar(self.steer);
        let steer_rate = (target - self.mechanism.steer()) / self.step;
        let shift = input.offset.rate + SHIFT_GAIN * (input.offset.d - self.mechanism.offset());
        let mass = self.mechanism.parts().mass();
        // Forces from outside, moved to where the frame takes them.
        let left = Vector3::new(-sin, cos, 0.0);
        let force = ahead * input.push.forward + left * input.push.left;
        let about_contact = ahead * input.push.roll_moment(self.motion.roll)
            + left * input.push.pitch_moment(self.motion.roll)
            + Vector3::z() * input.push.yaw_moment(self.motion.roll);
        let contact = Vector3::new(self.motion.contact.x, self.motion.contact.y, 0.0);
        let moment = about_contact - (self.mechanism.frame_centre() - contact).cross(&force);
        self.mechanism.step(&Loads {
            gravity: ahead * (input.slope_force / mass) - Vector3::z() * GRAVITY,
            force,
            moment: ahead * input.roll_moment + moment,
            wheel: input.drive_force * self.mechanism.parts().rear_wheel.radius,
            steering: Drive::Rate(steer_rate),
            balancer: Drive::Torque(input.balancer_torque),
            shift,
        });
        self.read();
    }

    fn read(&mut self) {
        let motion = self.mechanism.rear();
        let old = self.state;
        let old_yaw = self.motion.yaw_rate;
        let steer =
            bikebot_geometry::angle::difference(self.mechanism.front_heading(), motion.heading);
        self.state = BikeState {
            pose: Pose2::new(motion.contact.x, motion.contact.y, motion.heading),
            steer,
            roll: motion.roll,
            balancer: self.mechanism.balancer(),
            speed: motion.speed,
            roll_rate: motion.roll_rate,
            balancer_rate: self.mechanism.balancer_rate(),
        };
        let per = 1.0 / self.step;
        self.acceleration = BikeAcceleration {
            speed: (self.state.speed - old.speed) * per,
            yaw: (motion.yaw_rate - old_yaw) * per,
            roll: (self.state.roll_rate - old.roll_rate) * per,
            balancer: (self.state.balancer_rate - old.balancer_rate) * per,
        };
        let (rear, front) = (self.mechanism.rear_force(), self.mechanism.front_force());
        let (sin, cos) = motion.heading.sin_cos();
        let (front_sin, front_cos) = self.mechanism.front_heading().sin_cos();
        self.contact = ContactForces {
            drive: rear.along.dot(&Vector2::new(cos, sin)),
            rear_lateral: rear.along.dot(&Vector2::new(-sin, cos)),
            front_normal: front.along.dot(&Vector2::new(-front_sin, front_cos)),
            rear_load: rear.up,
            front_load: front.up,
            slides: false,
        };
        self.contact.slides = self.slides();
        if !self.has_touched && self.mechanism.touches_an_obstacle() {
            self.has_touched = true;
            self.touched_moving = self.mechanism.touches_moving_obstacle();
        }
        self.motion = motion;
    }

    /// The state after the last step.
    #[must_use]
    pub fn state(&self) -> &BikeState {
        &self.state
    }

    /// Yaw rate, rad/s.
    #[must_use]
    pub fn yaw_rate(&self) -> f64 {
        self.motion.yaw_rate
    }

    /// Mean accelerations over the last step.
    #[must_use]
    pub fn accelerations(&self) -> BikeAcceleration {
        self.acceleration
    }

    /// Mean forces of the ground on the tyres over the last step.
    #[must_use]
    pub fn contact_forces(&self) -> ContactForces {
        self.contact
    }

    /// Offset of the balancer's centre of gravity, m.
    #[must_use]
    pub fn offset(&self) -> f64 {
        self.mechanism.offset()
    }

    /// Whether a loaded tyre's force fills the friction cone while its lowest point moves over the ground.
    fn slides(&self) -> bool {
        let (rear, front) = self.mechanism.sliding_speeds();
        let slides = |share: f64, speed: f64| share > SLIDING_SHARE && speed > SLIDING_SPEED;
        (self.contact.rear_load > 0.0
            && slides(self.contact.friction_use_rear(self.friction.0), rear))
            || (self.contact.front_load > 0.0
                && slides(self.contact.friction_use_front(self.friction.1), front))
    }

    /// Sets the friction coefficients under the rear and the front tyre.
    pub fn set_friction(&mut self, rear: f64, front: f64) {
        self.friction = (rear, front);
        self.mechanism.set_friction(rear, front);
    }

    /// Kinetic plus potential energy, J, zero with every centre of gravity at ground height.
    #[must_use]
    pub fn energy(&self) -> f64 {
        self.mechanism.energy(&(-Vector3::z() * GRAVITY))
    }

    /// The bodies.
    #[must_use]
    pub fn mechanism(&self) -> &Mechanism {
        &self.mechanism
    }
}
