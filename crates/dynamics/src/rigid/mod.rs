//! The bike as rigid bodies, joints and wheel contact in Rapier: it shares no equation with the other plants.
//!
//! A [`Mechanism`] is any bicycle, passive or driven: frame, rear wheel, fork, front wheel and perhaps a balancer
//! as the links of one multibody on knife-edge wheels. [`RigidBike`] is the bike robot on it: it takes the same
//! [`BikeInput`](crate::BikeInput) and answers with the same [`BikeState`](crate::BikeState) and
//! [`ContactForces`](crate::ContactForces) as [`Bike`](crate::Bike), but owns its state and moves in steps of its own.
//!
//! | file | holds |
//! |---|---|
//! | [`parts`](BicycleParts) | masses, centres and inertias; link 1 taken apart into frame, fork and wheels |
//! | `mechanism` | bodies, joints, servos and tyres; one step; what the ground does |
//! | `steering` | handlebar angle and ground-projected angle |
//! | `obstacles` | a world's obstacles as prisms, the footprint as a hull |
//! | `sight` | rays cast against those prisms |
//! | `robot` | inputs to forces, bodies to state |
//!
//! What is measured of it stands in `docs/plants.md`; this folder is the only place that names Rapier.

mod mechanism;
mod obstacles;
mod parts;
mod robot;
mod sight;
mod steering;

pub use mechanism::{Drive, Loads, Mechanism, Placement, RearMotion, TyreForce};
pub use parts::{BalancerPart, BicycleParts, Part, Wheel};
pub use robot::{RigidBike, RigidStep};
