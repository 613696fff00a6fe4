//! The simulated truth: one state, moved by whichever model the scenario names.

use crate::scenario::PlantModel;
#[cfg(feature = "rapier")]
use crate::setup::PathSource;
use crate::setup::Setup;
use crate::traffic::Traffic;
#[cfg(feature = "rapier")]
use bikebot_dynamics::rigid::{RigidBike, RigidStep};
use bikebot_dynamics::{
    BalancerMode, Bike, BikeAcceleration, BikeInput, BikeParams, BikeState, ContactForces,
    DynamicsError, Integrator, Kinematic, KinematicInput, KinematicState, Offset, Rk4,
    SteeringGeometry, TwoLink, TwoLinkInput, TwoLinkState,
};

/// Where the true balancer is when the controller, which believes in other offsets, has it shifted to
/// `commanded`: the shift motor runs between the true ends.
#[must_use]
pub fn true_offset(
    believed: &BikeParams,
    truth: &BikeParams,
    mode: BalancerMode,
    commanded: Offset,
) -> Offset {
    let ends = |bike: &BikeParams| (bike.flywheel_offset, bike.balancer_offset);
    if ends(believed) == ends(truth) {
        return commanded;
    }
    let span = |bike: &BikeParams| bike.balancer_offset - bike.flywheel_offset;
    if span(believed) == 0.0 {
        return Offset::fixed(truth.offset(mode));
    }
    let stretch = span(truth) / span(believed);
    Offset {
        d: truth.flywheel_offset + stretch * (commanded.d - believed.flywheel_offset),
        rate: stretch * commanded.rate,
        acceleration: stretch * commanded.acceleration,
    }
}

/// Torque with which a jam holds the balancer, as a multiple of the motor's largest.
const JAM_STRENGTH: f64 = 10.0;

/// The true bike.
///
/// Every model shares [`BikeState`]; what a model does not move stays as it is: the two-link model
/// stands still, the kinematic one neither rolls nor has a balancer. The rigid-body model owns its state and has
/// to be stepped in order; the others are functions of the state they are given.
#[derive(Debug)]
pub struct TruePlant {
    model: PlantModel,
    bike: Bike,
    #[cfg(feature = "rapier")]
    rigid: Option<Box<Rigid>>,
}

/// The rigid bodies, and what they did when the present tick began.
#[cfg(feature = "rapier")]
#[derive(Debug)]
struct Rigid {
    bike: RigidBike,
    yaw_rate: f64,
    energy: f64,
}

/// Whether a bike can be built of rigid bodies with this steering geometry.
///
/// # Errors
///
/// Why not.
pub(crate) fn rigid_bodies(params: &BikeParams, geometry: SteeringGeometry) -> Result<(), String> {
    #[cfg(feature = "rapier")]
    {
        bikebot_dynamics::rigid::BicycleParts::robot(params, geometry)
            .map(drop)
            .map_err(|error| error.to_string())
    }
    #[cfg(not(feature = "rapier"))]
    {
        let _ = (params, geometry);
        Err("this program was built without the feature `rapier`".to_owned())
    }
}

impl TruePlant {
    /// The true bike of a scenario, put down in `state` with its balancer at `offset`.
    ///
    /// # Errors
    ///
    /// Where the bike cannot be built of rigid bodies; [`Setup::resolve`] has refused it before.
    pub fn new(setup: &Setup, state: &BikeState, offset: Offset) -> Result<Self, DynamicsError> {
        let params = setup.true_bike;
        #[cfg(feature = "rapier")]
        let rigid = if setup.plant == PlantModel::Rapier3d {
            let step = RigidStep {
                duration: setup.step.seconds(),
                ..RigidStep::default()
            };
            let mut bike = RigidBike::new(&params, setup.steering_geometry, state, &offset, step)?;
            if let (Some(world), true) = (&setup.world, setup.path != PathSource::Standing) {
                bike.surround(world, &setup.footprint, setup.laser.obstacle_height);
                for obstacle in setup.traffic.obstacles() {
                    bike.add_moving_obstacle(obstacle.outline(), obstacle.height());
                }
                bike.move_obstacles(setup.traffic.poses(0.0));
            }
            Some(Box::new(Rigid {
                yaw_rate: bike.yaw_rate(),
                energy: bike.energy(),
                bike,
            }))
        } else {
            None
        };
        #[cfg(not(feature = "rapier"))]
        let _ = (state, offset);
        Ok(Self {
            model: setup.plant,
            bike: Bike::new(params),
            #[cfg(feature = "rapier")]
            rigid,
        })
    }

    /// To be called before the steps of a control tick: what the tick's record says of its beginning is kept.
    pub fn begin_tick(&mut self) {
        #[cfg(feature = "rapier")]
        if let Some(rigid) = &mut self.rigid {
            rigid.yaw_rate = rigid.bike.yaw_rate();
            rigid.energy = rigid.bike.energy();
        }
    }

    /// Lets what moves be where it is at `time` (s), the end of the next step. Only the rigid-body model feels it.
    pub fn move_obstacles(&mut self, traffic: &Traffic, time: f64) {
        #[cfg(feature = "rapier")]
        if let Some(rigid) = &mut self.rigid {
            rigid.bike.move_obstacles(traffic.poses(time));
        }
        #[cfg(not(feature = "rapier"))]
        let _ = (traffic, time);
    }

    /// The bike of rigid bodies with all that stands around it, where the scenario has one.
    #[cfg(feature = "rapier")]
    #[must_use]
    pub fn bodies(&self) -> Option<&RigidBike> {
        self.rigid.as_ref().map(|rigid| &rigid.bike)
    }

    /// The moving obstacle that the bike's hull has touched, as an index into the traffic; only the rigid-body model knows.
    #[must_use]
    pub fn touched_moving_obstacle(&self) -> Option<usize> {
        #[cfg(feature = "rapier")]
        if let Some(rigid) = &self.rigid {
            return rigid.bike.touched_moving_obstacle();
        }
        None
    }

    /// Whether the bike's hull has touched an obstacle; only the rigid-body model knows.
    #[must_use]
    pub fn has_touched_an_obstacle(&self) -> bool {
        #[cfg(feature = "rapier")]
        if let Some(rigid) = &self.rigid {
            return rigid.bike.has_touched_an_obstacle();
        }
        false
    }

    /// The true parameters.
    #[must_use]
    pub fn params(&self) -> &BikeParams {
        &self.bike.params
    }

    /// The state `dt` seconds after `state` at time `t` (s), under a held input on ground with this friction
    /// under the rear and the front wheel. The rigid bodies go on from where they are, by the step of the setup.
    pub fn step(
        &mut self,
        t: f64,
        state: &BikeState,
        input: &BikeInput,
        friction: [f64; 2],
        dt: f64,
    ) -> BikeState {
        #[cfg(feature = "rapier")]
        if let Some(rigid) = &mut self.rigid {
            rigid.bike.set_friction(friction[0], friction[1]);
            rigid.bike.step(input);
            return *rigid.bike.state();
        }
        #[cfg(not(feature = "rapier"))]
        let _ = friction;
        match self.model {
            PlantModel::Bike3d | PlantModel::Rapier3d => Rk4.step(&self.bike, t, state, input, dt),
            PlantModel::TwoLink => {
                let plant = TwoLink::new(self.params(), input.offset);
                let moved = Rk4.step(
                    &plant,
                    t,
                    &TwoLinkState::from(state),
                    &two_link_input(state, input),
                    dt,
                );
                BikeState {
                    roll: moved.roll,
                    balancer: moved.balancer,
                    roll_rate: moved.roll_rate,
                    balancer_rate: moved.balancer_rate,
                    ..*state
                }
            }
            PlantModel::Kinematic => {
                let plant = Kinematic {
                    wheelbase: self.params().wheelbase,
                };
                let from = KinematicState {
                    pose: state.pose,
                    steer: state.steer,
                    speed: state.speed,
                };
                let input = KinematicInput {
                    acceleration: self.kinematic_acceleration(input),
                    steer_rate: input.steer_rate,
                };
                let moved = Rk4.step(&plant, t, &from, &input, dt);
                BikeState {
                    pose: moved.pose,
                    steer: moved.steer,
                    speed: moved.speed,
                    ..*state
                }
            }
        }
    }

    /// Accelerations in this state under this input.
    #[must_use]
    pub fn accelerations(&self, state: &BikeState, input: &BikeInput) -> BikeAcceleration {
        #[cfg(feature = "rapier")]
        if let Some(rigid) = &self.rigid {
            return rigid.bike.accelerations();
        }
        self.modelled_accelerations(state, input)
    }

    /// Accelerations by the equations of the model, or of the simplified bike where there are none.
    fn modelled_accelerations(&self, state: &BikeState, input: &BikeInput) -> BikeAcceleration {
        match self.model {
            PlantModel::Bike3d | PlantModel::Rapier3d => self.bike.accelerations(state, input),
            PlantModel::TwoLink => {
                let plant = TwoLink::new(self.params(), input.offset);
                let second =
                    plant.accelerations(&TwoLinkState::from(state), &two_link_input(state, input));
                BikeAcceleration {
                    speed: 0.0,
                    yaw: 0.0,
                    roll: second[0],
                    balancer: second[1],
                }
            }
            PlantModel::Kinematic => {
                let speed = self.kinematic_acceleration(input);
                let curvature = self.bike.curvature(state.steer);
                let cos = state.steer.cos();
                BikeAcceleration {
                    speed,
                    yaw: curvature * speed
                        + state.speed * input.steer_rate / (self.params().wheelbase * cos * cos),
                    roll: 0.0,
                    balancer: 0.0,
                }
            }
        }
    }

    /// The balancer torque (N m) that brings a jammed balancer to rest against the frame within `dt` seconds, as
    /// far as the jam is that strong.
    #[must_use]
    pub fn jamming_torque(&self, state: &BikeState, input: &BikeInput, dt: f64) -> f64 {
        let spin = |torque: f64| {
            let input = BikeInput {
                balancer_torque: torque,
                ..*input
            };
            self.modelled_accelerations(state, &input).balancer
        };
        // The equations are linear in the torque.
        let (free, per_newton_metre) = (spin(0.0), spin(1.0) - spin(0.0));
        let strongest = JAM_STRENGTH * self.params().balancer_torque_max;
        let wanted = (-state.balancer_rate / dt - free) / per_newton_metre;
        if wanted.is_finite() {
            wanted.clamp(-strongest, strongest)
        } else {
            0.0
        }
    }

    /// Contact forces: of the simplified 3D bike in this state, of the rigid bodies over their last step.
    #[must_use]
    pub fn contact(&self, state: &BikeState, input: &BikeInput) -> Option<ContactForces> {
        #[cfg(feature = "rapier")]
        if let Some(rigid) = &self.rigid {
            return Some(rigid.bike.contact_forces());
        }
        (self.model == PlantModel::Bike3d).then(|| self.bike.contact_forces(state, input))
    }

    /// Yaw rate, rad/s.
    #[must_use]
    pub fn yaw_rate(&self, state: &BikeState) -> f64 {
        #[cfg(feature = "rapier")]
        if let Some(rigid) = &self.rigid {
            return rigid.yaw_rate;
        }
        self.bike.yaw_rate(state)
    }

    /// Curvature of the rear contact's way at this steering angle, 1/m.
    #[must_use]
    pub fn curvature(&self, state: &BikeState) -> f64 {
        self.bike.curvature(state.steer)
    }

    /// Mechanical energy, J; not defined for the kinematic model.
    #[must_use]
    pub fn energy(&self, state: &BikeState, input: &BikeInput) -> f64 {
        #[cfg(feature = "rapier")]
        if let Some(rigid) = &self.rigid {
            return rigid.energy;
        }
        match self.model {
            PlantModel::Bike3d | PlantModel::Rapier3d => self.bike.energy(state, &input.offset),
            PlantModel::TwoLink => {
                TwoLink::new(self.params(), input.offset).energy(&TwoLinkState::from(state))
            }
            PlantModel::Kinematic => f64::NAN,
        }
    }

    fn kinematic_acceleration(&self, input: &BikeInput) -> f64 {
        (input.drive_force + input.slope_force) / self.params().mass()
    }
}

fn two_link_input(state: &BikeState, input: &BikeInput) -> TwoLinkInput {
    TwoLinkInput {
        balancer_torque: input.balancer_torque,
        roll_moment: input.roll_moment + input.push.roll_moment(state.roll),
    }
}
