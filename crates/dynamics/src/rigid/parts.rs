//! The rigid bodies a bicycle is made of, and how the lumped link 1 of [`BikeParams`] is taken apart.
//!
//! All of it is written in the bicycle's own frame, upright and steering straight: origin at the rear contact,
//! x forward, y left, z up.

use nalgebra::{Matrix3, Vector3};

use crate::error::DynamicsError;
use crate::params::BikeParams;
use crate::steering_geometry::SteeringGeometry;
use crate::whipple::{FrameBody, SteeringAssembly, WheelBody, WheelInertia, WhippleParams};

/// A rigid body: how heavy, where, and how spread out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Mass, kg.
    pub mass: f64,
    /// Centre of gravity, m.
    pub centre: Vector3<f64>,
    /// Inertia tensor about the centre of gravity, kg m²: products of inertia enter with a minus sign.
    pub inertia: Matrix3<f64>,
}

impl Part {
    /// Inertia tensor about `point` (m), kg m².
    #[must_use]
    pub fn inertia_about(&self, point: &Vector3<f64>) -> Matrix3<f64> {
        let r = self.centre - point;
        self.inertia + self.mass * (Matrix3::identity() * r.norm_squared() - r * r.transpose())
    }

    /// One body made of all of `parts`.
    #[must_use]
    pub fn joined(parts: &[Self]) -> Self {
        let mass: f64 = parts.iter().map(|part| part.mass).sum();
        let moment: Vector3<f64> = parts.iter().map(|part| part.mass * part.centre).sum();
        let centre = moment / mass;
        Self {
            mass,
            centre,
            inertia: parts.iter().map(|part| part.inertia_about(&centre)).sum(),
        }
    }

    /// What is left of this body when `parts` are taken out of it.
    #[must_use]
    pub fn without(&self, parts: &[Self]) -> Self {
        let holes: Vec<Self> = parts
            .iter()
            .map(|part| Self {
                mass: -part.mass,
                centre: part.centre,
                inertia: -part.inertia,
            })
            .chain([*self])
            .collect();
        Self::joined(&holes)
    }
}

/// From the signs of the Whipple bicycle, whose z points down.
impl From<&FrameBody> for Part {
    fn from(body: &FrameBody) -> Self {
        Self {
            mass: body.mass,
            centre: Vector3::new(body.x, 0.0, -body.z),
            inertia: tensor(body.ixx, body.iyy, body.izz, body.ixz),
        }
    }
}

/// Inertia tensor of a body symmetric about the plane of the bicycle, from its moments and `∫ x z dm`, z up.
fn tensor(xx: f64, yy: f64, zz: f64, product: f64) -> Matrix3<f64> {
    #[rustfmt::skip]
    let tensor = Matrix3::new(
        xx, 0.0, -product,
        0.0, yy, 0.0,
        -product, 0.0, zz,
    );
    tensor
}

/// A wheel with a knife edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wheel {
    /// Mass, kg.
    pub mass: f64,
    /// m.
    pub radius: f64,
    /// Moment of inertia about a diameter, kg m².
    pub across: f64,
    /// Moment of inertia about the axle, kg m².
    pub axial: f64,
}

impl Wheel {
    /// The wheel as a body standing on the ground at `x` (m).
    #[must_use]
    pub fn at(&self, x: f64) -> Part {
        Part {
            mass: self.mass,
            centre: Vector3::new(x, 0.0, self.radius),
            inertia: Matrix3::from_diagonal(&Vector3::new(self.across, self.axial, self.across)),
        }
    }
}

impl From<&WheelBody> for Wheel {
    fn from(body: &WheelBody) -> Self {
        Self {
            mass: body.mass,
            radius: body.radius,
            across: body.ixx,
            axial: body.iyy,
        }
    }
}

/// The balancer: a body on an axis parallel to the frame's x axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BalancerPart {
    /// Mass, kg.
    pub mass: f64,
    /// Distance of the axis' point above the rear contact ahead of it, m.
    pub x: f64,
    /// Height of the axis, m.
    pub height: f64,
    /// Moments of inertia about the centre of gravity, along x, y and the arm, kg m².
    pub moments: Vector3<f64>,
    /// Whether its centre of gravity can be shifted along the arm; where it cannot it stays where it is placed,
    /// and the mechanism has a link and a coordinate less to carry along.
    pub slides: bool,
}

/// Everything a rigid-body bicycle is built from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BicycleParts {
    /// Frame with everything fixed to it.
    pub frame: Part,
    /// Stands on the origin.
    pub rear_wheel: Wheel,
    /// Fork, handlebar and stem.
    pub fork: Part,
    /// Stands on the ground at `wheelbase`.
    pub front_wheel: Wheel,
    /// Distance between the contacts, m.
    pub wheelbase: f64,
    /// How far the steering axis meets the ground ahead of the front contact, m.
    pub trail: f64,
    /// How far the steering axis leans back from the vertical, rad.
    pub tilt: f64,
    /// None on an ordinary bicycle.
    pub balancer: Option<BalancerPart>,
}

impl BicycleParts {
    /// The bike robot with the wheels, fork and steering axis of `geometry`. Frame, fork and wheels together have
    /// exactly the mass, centre of gravity and inertia of the parameters' link 1.
    ///
    /// # Errors
    ///
    /// [`DynamicsError::NothingLeftForTheFrame`] where wheels and fork alone would exceed link 1.
    pub fn robot(params: &BikeParams, geometry: SteeringGeometry) -> Result<Self, DynamicsError> {
        Self::with_assembly(
            params,
            &geometry.assembly(params),
            geometry.wheel_radius(params),
        )
    }

    /// As [`BicycleParts::robot`], of any assembly and any radius (m) of both wheels.
    ///
    /// # Errors
    ///
    /// As [`BicycleParts::robot`].
    pub fn with_assembly(
        params: &BikeParams,
        assembly: &SteeringAssembly,
        wheel_radius: f64,
    ) -> Result<Self, DynamicsError> {
        let BikeParams { m1, wheelbase, .. } = *params;
        let link = Part {
            mass: m1,
            centre: Vector3::new(params.x1, 0.0, params.h1),
            inertia: tensor(params.i1x, params.i1y, params.i1z, params.i1xz),
        };
        let wheel = |inertia: &WheelInertia| Wheel {
            mass: inertia.mass,
            radius: wheel_radius,
            across: inertia.ixx,
            axial: inertia.iyy,
        };
        let (rear_wheel, front_wheel) = (wheel(&assembly.rear_wheel), wheel(&assembly.front_wheel));
        let fork = Part::from(&FrameBody {
            x: wheelbase + assembly.fork.x,
            ..assembly.fork
        });
        let frame = link.without(&[rear_wheel.at(0.0), fork, front_wheel.at(wheelbase)]);
        let least = frame.inertia.symmetric_eigenvalues().min();
        // Written so that NaN is refused.
        let some = frame.mass > 0.0 && least > 0.0;
        if !some {
            return Err(DynamicsError::NothingLeftForTheFrame {
                mass: frame.mass,
                least_moment: least,
            });
        }
        Ok(Self {
            frame,
            rear_wheel,
            fork,
            front_wheel,
            wheelbase,
            trail: assembly.trail,
            tilt: assembly.tilt,
            balancer: Some(BalancerPart {
                mass: params.m2,
                x: params.x2,
                height: params.l,
                moments: Vector3::new(params.i2x, params.i2y, params.i2z),
                slides: false,
            }),
        })
    }

    /// Frame, fork and wheels as one body.
    #[must_use]
    pub fn lumped(&self) -> Part {
        Part::joined(&[
            self.frame,
            self.fork,
            self.rear_wheel.at(0.0),
            self.front_wheel.at(self.wheelbase),
        ])
    }

    /// Mass of everything, kg.
    #[must_use]
    pub fn mass(&self) -> f64 {
        self.frame.mass
            + self.fork.mass
            + self.rear_wheel.mass
            + self.front_wheel.mass
            + self.balancer.map_or(0.0, |balancer| balancer.mass)
    }

    /// The steering axis, pointing up; turning about it steers left.
    #[must_use]
    pub fn steering_axis(&self) -> Vector3<f64> {
        Vector3::new(-self.tilt.sin(), 0.0, self.tilt.cos())
    }
}

/// An ordinary bicycle: no balancer.
impl From<&WhippleParams> for BicycleParts {
    fn from(params: &WhippleParams) -> Self {
        Self {
            frame: (&params.rear_frame).into(),
            rear_wheel: (&params.rear_wheel).into(),
            fork: (&params.front_frame).into(),
            front_wheel: (&params.front_wheel).into(),
            wheelbase: params.wheelbase,
            trail: params.trail,
            tilt: params.tilt,
            balancer: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_fork_and_wheels_together_are_link_one() {
        for i1xz in [0.0, 0.2] {
            let params = BikeParams {
                i1xz,
                ..BikeParams::default()
            };
            for geometry in [SteeringGeometry::Matched, SteeringGeometry::Realistic] {
                let parts = BicycleParts::robot(&params, geometry).unwrap();
                let link = parts.lumped();
                // A dozen products of order ten: rounding only.
                assert!((link.mass - params.m1).abs() < 1e-12);
                assert!((link.centre - Vector3::new(params.x1, 0.0, params.h1)).norm() < 1e-13);
                assert!((link.inertia[(0, 0)] - params.i1x).abs() < 1e-12);
                assert!((link.inertia[(1, 1)] - params.i1y).abs() < 1e-12);
                assert!((link.inertia[(2, 2)] - params.i1z).abs() < 1e-12);
                assert!((link.inertia[(0, 2)] + i1xz).abs() < 1e-12);
                assert!((parts.mass() - params.mass()).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_link_without_room_for_its_wheels_is_refused() {
        // A wheel of 5 kg alone has more inertia than this body.
        let thin = BikeParams {
            i1x: 0.05,
            i1y: 0.1,
            i1z: 0.06,
            ..BikeParams::default()
        };
        assert_eq!(thin.check(), Ok(()));
        assert!(matches!(
            BicycleParts::robot(&thin, SteeringGeometry::Realistic),
            Err(DynamicsError::NothingLeftForTheFrame { .. })
        ));
    }
}
