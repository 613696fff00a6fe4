//! Plant models of the bike robot, its actuators and sensors.
//!
//! A *plant* says how fast its state changes ([`plant::Plant`]); an *integrator* moves the
//! state along that rate ([`integrator::Integrator`]); neither knows the other's insides.
//!
//! | file | holds |
//! |---|---|
//! | [`params`] | [`BikeParams`] and the numbers derived from it |
//! | [`two_link`] | roll and balancer: `M(q) q̈ + h(q, q̇) = B τ` |
//! | [`bike`] | the simplified 3D bike: plane motion, steering, roll, balancer |
//! | [`contact`] | tyre forces and wheel loads of the simplified bike |
//! | [`kinematic`] | plane motion without slip, nothing else |
//! | [`rigid`] | the same bike as rigid bodies on wheel contact (feature `rapier`, on by default) |
//! | [`steering_geometry`] | trail, axis, wheels and fork of the rigid bodies |
//! | [`actuator`] | every limit and every lag, in one place |
//! | [`sensor`] | what the bike believes of its own state |
//! | [`laser`] | a scanner that sweeps its beams through whatever it is carried past |
//! | [`whipple`] | the linear benchmark bicycle: matrices, critical speeds, modes |
//!
//! SI units and radians throughout. Frames and signs are written down once, in
//! `docs/frames.md`: roll is positive to the right, steer and yaw are positive to the left.

#![cfg_attr(not(test), warn(clippy::unwrap_used, clippy::expect_used))]

pub mod actuator;
pub mod bike;
mod chance;
pub mod constants;
pub mod contact;
mod error;
mod inertia;
pub mod integrator;
pub mod kinematic;
pub mod laser;
pub mod params;
pub mod plant;
#[cfg(feature = "rapier")]
pub mod rigid;
pub mod sensor;
pub mod steering_geometry;
pub mod two_link;
pub mod whipple;

pub use actuator::{Actuators, Applied, Command, Saturation};
pub use bike::{Bike, BikeAcceleration, BikeInput, BikeState, Push};
pub use contact::ContactForces;
pub use error::DynamicsError;
pub use integrator::{ExplicitEuler, Integrator, Rk4};
pub use kinematic::{Kinematic, KinematicInput, KinematicState};
pub use laser::{LaserParams, LaserScan, LaserScanner, RayScene, SweepingLaser};
pub use params::{BalancerMode, BikeParams, LeanCoefficients, Lumped, ModeChangeCondition, Offset};
pub use plant::{Plant, State};
pub use sensor::{Measurement, SensorParams, Sensors};
pub use steering_geometry::SteeringGeometry;
pub use two_link::{Linearisation, TwoLink, TwoLinkInput, TwoLinkState};
pub use whipple::{Whipple, WhippleParams};
