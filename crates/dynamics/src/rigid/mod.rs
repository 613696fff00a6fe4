//! The bike as rigid bodies, joints and wheel contact: the plant that shares no equation with the others.
mod mechanism;
mod parts;
mod steering;

pub use mechanism::{Drive, Loads, Mechanism, Placement, RearMotion, TyreForce};
pub use parts::{BalancerPart, BicycleParts, Part, SteeringGeometry, Wheel};
