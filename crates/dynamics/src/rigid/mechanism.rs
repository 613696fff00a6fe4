//! The bicycle as bodies and joints in a Rapier world, and one step of it.
//!
//! What has to be so, because it was measured (design note, §3):
//!
//! * reduced coordinates, with the frame as a free root: pin joints that cannot drift apart;
//! * knife-edge wheels: any visible tread width is another bicycle;
//! * Rapier's silent damping of 0.1 N m s/rad on every joint taken out;
//! * every body's origin in its centre of gravity: the root's coordinates integrate the velocity of that point;
//! * four solver iterations with friction inside Coulomb's cone.
//!
//! Joints that are held (steering, the offset, a locked balancer) are viscous servos: damping inside the mass
//! matrix, and the torque that drives it at the wanted rate. Both act between two links of the same mechanism,
//! so they leave its momentum alone, and being implicit they may be as stiff as one likes.

use nalgebra::{Matrix3, Rotation3, SymmetricEigen, Unit, UnitQuaternion, Vector2, Vector3};
use rapier3d_f64::prelude as rapier;
use rapier3d_f64::prelude::{
    ColliderBuilder, ColliderHandle, Group, InteractionGroups, InteractionTestMode, MassProperties,
    Multibody, MultibodyIndex, PhysicsWorld, PrismaticJointBuilder, RevoluteJointBuilder,
    RigidBodyBuilder, RigidBodyHandle,
};

mod surroundings;

use self::surroundings::MovingBody;
use super::parts::{BicycleParts, Part};
use super::sight::Sight;

/// Half the width of a tyre, m. A tenth of a millimetre already moves the weave speed by 6 %.
const HALF_TREAD: f64 = 1e-6;
/// Share of the balancer's mass in the arm that the rest slides along: a link cannot weigh nothing.
const ARM_SHARE: f64 = 1e-6;
/// Time in which a held joint takes on its rate, s. Short, so that the balancer's weight does not press its offset
/// in by more than 10 µm/s: the offset's rate times the balancer's acts as a moment.
const SERVO_TIME: f64 = 1e-6;

/// Stiffness of the springs that carry joint torques, N m/rad and N/m: over a step it changes nothing.
const SPRING: f64 = 1e-3;
/// Steps in which the solver finds the wheels' loads.
const WARM_UP: usize = 6;

/// Who meets whom: wheels roll on the ground, the hull meets obstacles, nothing else.
const GROUND: Group = Group::GROUP_1;
const TYRE: Group = Group::GROUP_2;
const HULL: Group = Group::GROUP_3;
const OBSTACLE: Group = Group::GROUP_4;

fn groups(member: Group, meets: Group) -> InteractionGroups {
    InteractionGroups::new(member, meets, InteractionTestMode::And)
}

/// How a joint is driven.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Drive {
    /// By a torque (N m) or force (N) between its two links.
    Torque(f64),
    /// Held at a rate (rad/s or m/s).
    Rate(f64),
}

/// What acts on the bicycle during a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loads {
    /// Acceleration of gravity in the world frame, m/s²; tilted on a slope.
    pub gravity: Vector3<f64>,
    /// Force on the frame's centre of gravity in the world frame, N.
    pub force: Vector3<f64>,
    /// Moment on the frame in the world frame, N m.
    pub moment: Vector3<f64>,
    /// Torque of the frame on the rear wheel, N m, positive forward.
    pub wheel: f64,
    /// The handlebar, about the upward steering axis: positive turns left.
    pub steering: Drive,
    /// The balancer, about the frame's x axis.
    pub balancer: Drive,
    /// The balancer's offset along its arm.
    pub shift: f64,
}

/// Where the bicycle starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Point under the rear contact, m.
    pub position: Vector2<f64>,
    /// rad, counter-clockwise from x.
    pub heading: f64,
    /// rad, positive to the right.
    pub roll: f64,
    /// Handlebar angle, rad, positive to the left.
    pub steer: f64,
    /// Balancer angle, rad.
    pub balancer: f64,
    /// Offset of the balancer's centre of gravity along its arm, m.
    pub offset: f64,
    /// m/s.
    pub offset_rate: f64,
    /// Speed of the rear contact along the heading, m/s.
    pub speed: f64,
    /// rad/s.
    pub roll_rate: f64,
    /// rad/s.
    pub yaw_rate: f64,
    /// rad/s.
    pub steer_rate: f64,
    /// rad/s.
    pub balancer_rate: f64,
}

impl Placement {
    /// Upright at the origin, heading along x, rolling at `speed` (m/s).
    #[must_use]
    pub fn rolling(speed: f64) -> Self {
        Self {
            position: Vector2::zeros(),
            heading: 0.0,
            roll: 0.0,
            steer: 0.0,
            balancer: 0.0,
            offset: 0.0,
            offset_rate: 0.0,
            speed,
            roll_rate: 0.0,
            yaw_rate: 0.0,
            steer_rate: 0.0,
            balancer_rate: 0.0,
        }
    }
}

/// Orientation and motion of the rear wheel's plane, from which the bike's state is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RearMotion {
    /// Rear contact in the plane, m.
    pub contact: Vector2<f64>,
    /// rad.
    pub heading: f64,
    /// rad.
    pub roll: f64,
    /// Nose-down angle of the frame in the wheel's plane, rad.
    pub pitch: f64,
    /// Speed of the contact point along the heading, m/s.
    pub speed: f64,
    /// Speed of the contact point to the left of the heading, m/s: sideways slip.
    pub side_speed: f64,
    /// rad/s.
    pub roll_rate: f64,
    /// rad/s.
    pub yaw_rate: f64,
    /// Spin of the wheel relative to the frame, rad/s.
    pub spin: f64,
}

/// Force of the ground on one tyre over the last step, mean, in the world frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TyreForce {
    /// Along the ground, N.
    pub along: Vector2<f64>,
    /// Upwards, N. Zero where the tyre does not touch.
    pub up: f64,
}

/// One joint coordinate: its link, its place among the generalised velocities, and which of the joint's six it is.
struct Coordinate {
    link: usize,
    index: usize,
    axis: usize,
}

/// Of a joint's six coordinates, the slide along its axis …
const SLIDE: usize = 0;
/// … and the turn about it.
const TURN: usize = 3;

struct Balancer {
    turn: Coordinate,
    shift: Option<Coordinate>,
    /// Where its centre of gravity sits when it cannot be shifted, m.
    offset: f64,
    moment: f64,
    weight: f64,
}

/// A bicycle in its own Rapier world.
pub struct Mechanism {
    parts: BicycleParts,
    world: PhysicsWorld,
    multibody: MultibodyIndex,
    frame: RigidBodyHandle,
    rear_wheel: RigidBodyHandle,
    fork: RigidBodyHandle,
    front_wheel: RigidBodyHandle,
    rear_spin: Coordinate,
    steer: Coordinate,
    front_spin: Coordinate,
    balancer: Option<Balancer>,
    rear_tyre: ColliderHandle,
    front_tyre: ColliderHandle,
    ground: ColliderHandle,
    hull: Vec<ColliderHandle>,
    step: (f64, usize),
    friction: [f64; 2],
    /// What surrounds the bicycle, and its hull, as they were built.
    surroundings: (Vec<ColliderBuilder>, Vec<ColliderBuilder>),
    sight: Sight,
    moving: Vec<MovingBody>,
    /// Inertia the steering servo is sized for, kg m².
    steer_inertia: f64,
    /// Torque of the steering servo in the last step, N m.
    steer_torque: f64,
}

impl std::fmt::Debug for Mechanism {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Mechanism")
            .field("parts", &self.parts)
            .finish_non_exhaustive()
    }
}

fn to_rapier(v: &Vector3<f64>) -> rapier::Vector {
    rapier::Vector::new(v.x, v.y, v.z)
}

fn from_rapier(v: rapier::Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn link(part: &Part) -> RigidBodyBuilder {
    // Principal axes by our own means: Rapier's swap two of them where two moments are equal.
    let principal = SymmetricEigen::new(part.inertia);
    let mut axes = principal.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(0).neg_mut();
    }
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    RigidBodyBuilder::dynamic()
        .translation(to_rapier(&part.centre))
        .can_sleep(false)
        .additional_mass_properties(MassProperties::with_principal_inertia_frame(
            rapier::Vector::ZERO,
            part.mass,
            to_rapier(&principal.eigenvalues),
            rotation(&turn),
        ))
}

fn rotation(turn: &UnitQuaternion<f64>) -> rapier::Rotation {
    rapier::Rotation::from_xyzw(turn.i, turn.j, turn.k, turn.w)
}

impl Mechanism {
    /// Builds the bicycle and puts it down on flat ground. A step lasts `step` seconds and has `iterations`
    /// solver iterations; `friction` is that of both tyres.
    #[must_use]
    pub fn new(
        parts: &BicycleParts,
        step: f64,
        iterations: usize,
        friction: f64,
        placement: &Placement,
    ) -> Self {
        let mut world = PhysicsWorld::new();
        let parameters = &mut world.integration_parameters;
        parameters.dt = step;
        parameters.num_solver_iterations = iterations;
        parameters.friction_model = rapier::FrictionModel::Coulomb;
        parameters.max_ccd_substeps = 0;
        // A rolling wheel meets the ground with another point at each step.
        parameters.contact_recycling = false;
        parameters.contact_clustering = false;

        let ground = world.colliders.insert(
            ColliderBuilder::halfspace(Unit::new_unchecked(rapier::Vector::Z))
                .friction(1e6)
                .collision_groups(groups(GROUND, TYRE)),
        );

        let rear = parts.rear_wheel.at(0.0);
        let front = parts.front_wheel.at(parts.wheelbase);
        let frame = world.insert_body(link(&parts.frame));
        let rear_wheel = world.insert_body(link(&rear));
        let fork = world.insert_body(link(&parts.fork));
        let front_wheel = world.insert_body(link(&front));

        let mut tyre = |body, radius| {
            world.colliders.insert_with_parent(
                ColliderBuilder::cylinder(HALF_TREAD, radius)
                    .density(0.0)
                    .friction(friction)
                    .friction_combine_rule(rapier::CoefficientCombineRule::Min)
                    .restitution(0.0)
                    .collision_groups(groups(TYRE, GROUND)),
                body,
                &mut world.bodies,
            )
        };
        let rear_tyre = tyre(rear_wheel, rear.centre.z);
        let front_tyre = tyre(front_wheel, front.centre.z);

        let hinge = |axis: &Vector3<f64>, point: &Vector3<f64>, of: &Part, on: &Part| {
            RevoluteJointBuilder::new(to_rapier(axis))
                .local_anchor1(to_rapier(&(point - on.centre)))
                .local_anchor2(to_rapier(&(point - of.centre)))
                .contacts_enabled(false)
                .build()
        };
        let axle = Vector3::y();
        let head = Vector3::new(parts.wheelbase + parts.trail, 0.0, 0.0);
        let axis = parts.steering_axis();
        world.insert_multibody_joint(
            frame,
            rear_wheel,
            hinge(&axle, &rear.centre, &rear, &parts.frame),
        );
        world.insert_multibody_joint(frame, fork, hinge(&axis, &head, &parts.fork, &parts.frame));
        world.insert_multibody_joint(
            fork,
            front_wheel,
            hinge(&axle, &front.centre, &front, &parts.fork),
        );

        let balancer = parts.balancer.map(|balancer| {
            let pivot = Vector3::new(balancer.x, 0.0, balancer.height);
            let whole = Part {
                mass: balancer.mass,
                centre: pivot,
                inertia: Matrix3::from_diagonal(&balancer.moments),
            };
            if !balancer.slides {
                let fixed = Part {
                    centre: pivot + Vector3::z() * placement.offset,
                    ..whole
                };
                let body = world.insert_body(link(&fixed));
                let turn = hinge(&Vector3::x(), &pivot, &fixed, &parts.frame);
                world.insert_multibody_joint(frame, body, turn);
                return (body, None, balancer.moments.x, balancer.mass);
            }
            let share = |share: f64| Part {
                mass: whole.mass * share,
                centre: pivot,
                inertia: whole.inertia * share,
            };
            let (arm_part, mass_part) = (share(ARM_SHARE), share(1.0 - ARM_SHARE));
            let arm = world.insert_body(link(&arm_part));
            let mass = world.insert_body(link(&mass_part));
            world.insert_multibody_joint(
                frame,
                arm,
                hinge(&Vector3::x(), &pivot, &arm_part, &parts.frame),
            );
            world.insert_multibody_joint(
                arm,
                mass,
                PrismaticJointBuilder::new(rapier::Vector::Z)
                    .contacts_enabled(false)
                    .build(),
            );
            (arm, Some(mass), balancer.moments.x, balancer.mass)
        });

        #[expect(clippy::expect_used, reason = "the joints were inserted above")]
        let multibody = world
            .multibody_joints
            .rigid_body_link(frame)
            .expect("the frame was just joined to its wheels")
            .multibody;
        #[expect(clippy::expect_used, reason = "the joints were inserted above")]
        let coordinate = |body: RigidBodyHandle, axis: usize| {
            let id = world
                .multibody_joints
                .rigid_body_link(body)
                .expect("every body was just joined to the frame")
                .id;
            let index = world
                .multibody_joints
                .get_multibody(multibody)
                .and_then(|whole| whole.link(id))
                .expect("the id of a link of this very multibody")
                .assembly_id();
            Coordinate {
                link: id,
                index,
                axis,
            }
        };
        let (rear_spin, steer, front_spin) = (
            coordinate(rear_wheel, TURN),
            coordinate(fork, TURN),
            coordinate(front_wheel, TURN),
        );
        let balancer = balancer.map(|(arm, mass, moment, weight)| Balancer {
            turn: coordinate(arm, TURN),
            shift: mass.map(|mass| coordinate(mass, SLIDE)),
            offset: placement.offset,
            moment,
            weight,
        });
        let front_assembly = Part::joined(&[parts.fork, front]);
        let steer_inertia = axis.dot(&(front_assembly.inertia_about(&head) * axis))
            + 1e-3 * parts.mass() * parts.wheelbase * parts.wheelbase;

        let mut mechanism = Self {
            parts: *parts,
            world,
            multibody,
            frame,
            rear_wheel,
            fork,
            front_wheel,
            rear_spin,
            steer,
            front_spin,
            balancer,
            rear_tyre,
            front_tyre,
            ground,
            hull: Vec::new(),
            step: (step, iterations),
            friction: [friction; 2],
            surroundings: (Vec::new(), Vec::new()),
            sight: Sight::default(),
            moving: Vec::new(),
            steer_inertia,
            steer_torque: 0.0,
        };
        mechanism.place(placement);
        // The solver finds the loads of the wheels within a few steps and starts from them ever after: without
        // this the bicycle would drop for half a millisecond.
        for _ in 0..WARM_UP {
            mechanism.step(&Loads {
                gravity: -Vector3::z() * crate::constants::GRAVITY,
                force: Vector3::zeros(),
                moment: Vector3::zeros(),
                wheel: 0.0,
                steering: Drive::Rate(0.0),
                balancer: Drive::Torque(0.0),
                shift: placement.offset_rate,
            });
        }
        mechanism.place(placement);
        mechanism
    }

    /// Puts the bicycle down, both wheels on the ground, moving without slip.
    fn place(&mut self, at: &Placement) {
        let parts = self.parts;
        let rear_centre = Vector3::new(0.0, 0.0, parts.rear_wheel.radius);
        let front_centre = Vector3::new(parts.wheelbase, 0.0, parts.front_wheel.radius);
        let head = Vector3::new(parts.wheelbase + parts.trail, 0.0, 0.0);
        let upright = Rotation3::from_axis_angle(&Vector3::z_axis(), at.heading)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), at.roll);
        let steered = Rotation3::from_scaled_axis(parts.steering_axis() * at.steer);
        let rear_up = upright * Vector3::z();
        let contact = Vector3::new(at.position.x, at.position.y, 0.0);
        let hub = contact + rear_up * parts.rear_wheel.radius;
        // Height of the front wheel's lowest point when the frame is pitched about the rear axle.
        let lowest = |pitch: f64| {
            let frame = upright * Rotation3::from_axis_angle(&Vector3::y_axis(), pitch);
            let centre = hub + frame * (head + steered * (front_centre - head) - rear_centre);
            let axle = frame * (steered * Vector3::y());
            centre.z - parts.front_wheel.radius * axle.x.hypot(axle.y)
        };
        // The height falls by nearly a wheelbase per radian: the secant converges in a few steps.
        let mut pitch = 0.0;
        for _ in 0..20 {
            let height = lowest(pitch);
            let slope = (lowest(pitch + 1e-6) - height) / 1e-6;
            pitch -= height / slope;
        }
        let turn = upright * Rotation3::from_axis_angle(&Vector3::y_axis(), pitch);
        let centre = hub + turn * (parts.frame.centre - rear_centre);

        // Velocities of a bicycle that rolls without slip.
        let ahead = Rotation3::from_axis_angle(&Vector3::z_axis(), at.heading) * Vector3::x();
        let spin = ahead * at.roll_rate + Vector3::z() * at.yaw_rate;
        let contact_velocity = ahead * at.speed;
        let velocity = contact_velocity + spin.cross(&(centre - contact));
        let front_axle = turn * (steered * Vector3::y());
        let front_line = front_axle.cross(&Vector3::z()).normalize();
        let front_contact = contact + ahead * parts.wheelbase;
        let front_speed =
            (contact_velocity + spin.cross(&(front_contact - contact))).dot(&front_line);

        let pose = rapier::Pose::from_parts(
            to_rapier(&centre),
            rotation(&UnitQuaternion::from_rotation_matrix(&turn)),
        );
        let PhysicsWorld {
            bodies,
            colliders,
            multibody_joints,
            ..
        } = &mut self.world;
        let handles: Vec<RigidBodyHandle> = bodies.iter().map(|(handle, _)| handle).collect();
        for handle in handles {
            bodies[handle].recompute_mass_properties_from_colliders(colliders);
        }
        bodies[self.frame].set_position(pose, true);
        let Some(multibody) = multibody_joints.get_multibody_mut(self.multibody) else {
            return;
        };
        multibody.damping_mut().fill(0.0);
        // Read the frame's pose, and let Rapier count its coordinates.
        multibody.forward_kinematics(bodies, true);
        let mut displacement = vec![0.0; multibody.ndofs()];
        let coordinate = |of: &Coordinate| {
            multibody
                .link(of.link)
                .map_or(0.0, |link| link.joint().coords()[of.axis])
        };
        displacement[self.steer.index] = at.steer - coordinate(&self.steer);
        let mut rates = vec![0.0; multibody.ndofs()];
        rates[..3].copy_from_slice(velocity.as_slice());
        rates[3..6].copy_from_slice(spin.as_slice());
        rates[self.rear_spin.index] = at.speed / parts.rear_wheel.radius;
        rates[self.front_spin.index] = front_speed / parts.front_wheel.radius;
        rates[self.steer.index] = at.steer_rate;
        if let Some(balancer) = &self.balancer {
            displacement[balancer.turn.index] = at.balancer - coordinate(&balancer.turn);
            if let Some(shift) = &balancer.shift {
                displacement[shift.index] = at.offset - coordinate(shift);
                rates[shift.index] = at.offset_rate;
            }
            rates[balancer.turn.index] = at.balancer_rate;
        }
        multibody.apply_displacements(&displacement);
        multibody.generalized_velocity_mut().copy_from_slice(&rates);
        multibody.forward_kinematics(bodies, false);
        // One by one, so that Rapier moves their colliders along.
        for link in multibody.links() {
            bodies[link.rigid_body_handle()].set_position(*link.local_to_world(), true);
        }
    }

    /// Moves the bicycle on by one step.
    pub fn step(&mut self, loads: &Loads) {
        self.world.gravity = to_rapier(&loads.gravity);
        let frame = &mut self.world.bodies[self.frame];
        frame.reset_torques(true);
        frame.add_torque(to_rapier(&loads.moment), true);
        frame.reset_forces(true);
        frame.add_force(to_rapier(&loads.force), true);

        let steering = driven(loads.steering, self.steer_inertia / SERVO_TIME);
        if let Some(multibody) = self
            .world
            .multibody_joints
            .get_multibody_mut(self.multibody)
        {
            drive(multibody, &self.rear_spin, (loads.wheel, 0.0));
            drive(multibody, &self.steer, steering);
            if let Some(balancer) = &self.balancer {
                let turn = driven(loads.balancer, balancer.moment / SERVO_TIME);
                drive(multibody, &balancer.turn, turn);
                if let Some(slide) = &balancer.shift {
                    let shift = driven(Drive::Rate(loads.shift), balancer.weight / SERVO_TIME);
                    drive(multibody, slide, shift);
                }
            }
        }
        self.world.step();
        self.steer_torque = steering.0 - steering.1 * self.steer_rate();
    }

    fn axis(&self, body: RigidBodyHandle, local: &Vector3<f64>) -> Vector3<f64> {
        from_rapier(self.world.bodies[body].rotation() * to_rapier(local))
    }

    fn rate(&self, coordinate: &Coordinate) -> f64 {
        self.world
            .multibody_joints
            .get_multibody(self.multibody)
            .map_or(f64::NAN, |whole| {
                whole.generalized_velocity()[coordinate.index]
            })
    }

    fn position(&self, coordinate: &Coordinate) -> f64 {
        self.world
            .multibody_joints
            .get_multibody(self.multibody)
            .and_then(|whole| whole.link(coordinate.link))
            .map_or(f64::NAN, |link| link.joint().coords()[coordinate.axis])
    }

    /// What the bicycle is made of.
    #[must_use]
    pub fn parts(&self) -> &BicycleParts {
        &self.parts
    }

    /// Sets the friction coefficients of the rear and the front tyre.
    pub fn set_friction(&mut self, rear: f64, front: f64) {
        self.friction = [rear, front];
        for (tyre, friction) in [(self.rear_tyre, rear), (self.front_tyre, front)] {
            if self.world.colliders[tyre].friction() != friction {
                self.world.colliders[tyre].set_friction(friction);
            }
        }
    }

    /// Handlebar angle `δ`, rad, positive to the left.
    #[must_use]
    pub fn steer(&self) -> f64 {
        self.position(&self.steer)
    }

    /// Handlebar rate, rad/s.
    #[must_use]
    pub fn steer_rate(&self) -> f64 {
        self.rate(&self.steer)
    }

    /// Torque of frame on fork in the last step, N m.
    #[must_use]
    pub fn steer_torque(&self) -> f64 {
        self.steer_torque
    }

    /// Balancer angle, rad; counts turns. Zero without a balancer.
    #[must_use]
    pub fn balancer(&self) -> f64 {
        self.balancer
            .as_ref()
            .map_or(0.0, |balancer| self.position(&balancer.turn))
    }

    /// Balancer rate, rad/s.
    #[must_use]
    pub fn balancer_rate(&self) -> f64 {
        self.balancer
            .as_ref()
            .map_or(0.0, |balancer| self.rate(&balancer.turn))
    }

    /// Offset of the balancer's centre of gravity along its arm, m.
    #[must_use]
    pub fn offset(&self) -> f64 {
        self.balancer.as_ref().map_or(0.0, |balancer| {
            balancer
                .shift
                .as_ref()
                .map_or(balancer.offset, |slide| self.position(slide))
        })
    }

    /// The frame's centre of gravity in the world frame, m.
    #[must_use]
    pub fn frame_centre(&self) -> Vector3<f64> {
        from_rapier(self.world.bodies[self.frame].translation())
    }

    /// Where the rear wheel's plane is and how it moves.
    #[must_use]
    pub fn rear(&self) -> RearMotion {
        let axle = self.axis(self.frame, &Vector3::y());
        let ahead = axle.cross(&Vector3::z()).normalize();
        let left = Vector3::z().cross(&ahead);
        let roll = axle.z.atan2(axle.dot(&left));
        let wheel = &self.world.bodies[self.rear_wheel];
        let frame = &self.world.bodies[self.frame];
        // The frame's x axis, seen in the plane of the wheel, dips by the pitch.
        let up = ahead.cross(&axle);
        let along = self.axis(self.frame, &Vector3::x());
        let pitch = (-along.dot(&up)).atan2(along.dot(&ahead));
        let turn = from_rapier(frame.angvel());
        let roll_rate = turn.dot(&ahead);
        let yaw_rate = turn.dot(&up) / roll.cos();
        let radius = self.parts.rear_wheel.radius;
        let hub = from_rapier(wheel.translation());
        let velocity = from_rapier(wheel.linvel());
        // The contact point moves with the wheel's plane, not with the wheel's matter.
        let plane = ahead * roll_rate + Vector3::z() * yaw_rate;
        let contact = hub - up * radius;
        let contact_velocity = velocity - plane.cross(&(up * radius));
        RearMotion {
            contact: contact.xy(),
            heading: ahead.y.atan2(ahead.x),
            roll,
            pitch,
            speed: contact_velocity.dot(&ahead),
            side_speed: contact_velocity.dot(&left),
            roll_rate,
            yaw_rate,
            spin: self.rate(&self.rear_spin),
        }
    }

    /// Direction (rad) in which the front wheel's plane meets the ground.
    #[must_use]
    pub fn front_heading(&self) -> f64 {
        super::steering::ground_line(&self.axis(self.fork, &Vector3::y()))
    }

    /// Mean force of the ground on the rear tyre over the last step.
    #[must_use]
    pub fn rear_force(&self) -> TyreForce {
        self.tyre_force(self.rear_tyre)
    }

    /// Mean force of the ground on the front tyre over the last step.
    #[must_use]
    pub fn front_force(&self) -> TyreForce {
        self.tyre_force(self.front_tyre)
    }

    fn tyre_force(&self, tyre: ColliderHandle) -> TyreForce {
        let mut sum = TyreForce::default();
        let Some(pair) = self.world.narrow_phase.contact_pair(self.ground, tyre) else {
            return sum;
        };
        let Some(contacts) = pair.rigid() else {
            return sum;
        };
        // Impulses are those on the first collider.
        let sign = if pair.collider1 == tyre { 1.0 } else { -1.0 };
        for manifold in contacts.solver_manifolds() {
            let direction = -manifold.data.normal;
            // Rapier's own choice of a tangent for a vertical normal.
            let tangent = rapier::Vector::new(0.0, 1.0_f64.copysign(direction.z), 0.0);
            let other = direction.cross(tangent);
            for point in &manifold.points {
                let impulse = direction * point.data.impulse
                    + tangent * point.data.tangent_impulse.x
                    + other * point.data.tangent_impulse.y;
                sum.along += Vector2::new(impulse.x, impulse.y) * sign;
                sum.up += impulse.z * sign;
            }
        }
        let inverse = 1.0 / self.world.integration_parameters.dt;
        TyreForce {
            along: sum.along * inverse,
            up: sum.up * inverse,
        }
    }

    /// Speeds (m/s) at which the rear and the front tyre's lowest points move over the ground.
    #[must_use]
    pub fn sliding_speeds(&self) -> (f64, f64) {
        let sliding = |wheel: RigidBodyHandle, holder: RigidBodyHandle, radius: f64| {
            let body = &self.world.bodies[wheel];
            let axle = self.axis(holder, &Vector3::y());
            let up = (Vector3::z() - axle * axle.z).normalize();
            let velocity =
                from_rapier(body.linvel()) - from_rapier(body.angvel()).cross(&(up * radius));
            velocity.xy().norm()
        };
        (
            sliding(self.rear_wheel, self.frame, self.parts.rear_wheel.radius),
            sliding(self.front_wheel, self.fork, self.parts.front_wheel.radius),
        )
    }

    /// Whether the balancer's offset can be shifted.
    #[must_use]
    pub fn slides(&self) -> bool {
        self.parts.balancer.is_some_and(|balancer| balancer.slides)
    }

    /// The same bicycle in the same motion, its balancer able to slide along its arm.
    #[must_use]
    pub fn with_slide(&self) -> Self {
        let mut parts = self.parts;
        if let Some(balancer) = &mut parts.balancer {
            balancer.slides = true;
        }
        let rear = self.rear();
        let placement = Placement {
            position: rear.contact,
            heading: rear.heading,
            roll: rear.roll,
            steer: self.steer(),
            balancer: self.balancer(),
            offset: self.offset(),
            offset_rate: 0.0,
            speed: rear.speed,
            roll_rate: rear.roll_rate,
            yaw_rate: rear.yaw_rate,
            steer_rate: self.steer_rate(),
            balancer_rate: self.balancer_rate(),
        };
        let (step, iterations) = self.step;
        let mut sliding = Self::new(&parts, step, iterations, self.friction[0], &placement);
        sliding.set_friction(self.friction[0], self.friction[1]);
        sliding.sight.wall_height = self.sight.wall_height;
        sliding.surround_with(self.surroundings.clone());
        for moving in &self.moving {
            sliding.add_moving_body(moving.built.clone(), moving.pose);
        }
        sliding
    }

    /// Kinetic plus potential energy, J, above the ground.
    #[must_use]
    pub fn energy(&self, gravity: &Vector3<f64>) -> f64 {
        self.world
            .bodies
            .iter()
            .filter(|(_, body)| body.is_dynamic())
            .map(|(_, body)| {
                let mass = body.mass();
                let inertia = body.mass_properties().effective_angular_inertia();
                let spin = body.angvel();
                0.5 * mass * body.linvel().length_squared() + 0.5 * spin.dot(inertia * spin)
                    - mass * gravity.dot(&from_rapier(body.translation()))
            })
            .sum()
    }
}

/// Torque and damping that drive a joint.
fn driven(drive: Drive, damping: f64) -> (f64, f64) {
    match drive {
        Drive::Torque(torque) => (torque, 0.0),
        Drive::Rate(rate) => (damping * rate, damping),
    }
}

/// Lets a torque (or force) and a damping act on one joint coordinate until further notice.
///
/// Rapier knows torques on bodies only, fixed in the world while the joint's axis turns during a step: enough
/// to spoil a stiff servo. A soft spring with a far rest acts on the coordinate itself.
fn drive(multibody: &mut Multibody, at: &Coordinate, (torque, damping): (f64, f64)) {
    multibody.damping_mut()[at.index] = damping;
    if let Some(link) = multibody.link_mut(at.link) {
        let rest = link.joint.coords()[at.axis] + torque / SPRING;
        link.joint.set_spring(at.axis, SPRING, rest);
    }
}
