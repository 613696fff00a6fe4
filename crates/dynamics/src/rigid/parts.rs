//! The rigid bodies a bicycle is made of, and how the lumped link 1 of [`BikeParams`] is taken apart.
//!
//! All of it is written in the bicycle's own frame, upright and steering straight: origin at the rear contact,
//! x forward, y left, z up.

use nalgebra::{Matrix3, Vector3};

use crate::error::DynamicsError;
use crate::params::BikeParams;

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

    fn ball(mass: f64, centre: Vector3<f64>, gyration: f64) -> Self {
        Self {
            mass,
            centre,
            inertia: Matrix3::identity() * (mass * gyration * gyration),
        }
    }
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
    /// A hoop of this mass (kg) and `radius` (m) whose mass sits at `gyration` times the radius.
    #[must_use]
    pub fn hoop(mass: f64, radius: f64, gyration: f64) -> Self {
        let axial = mass * (gyration * radius).powi(2);
        Self {
            mass,
            radius,
            across: 0.5 * axial,
            axial,
        }
    }

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
}

/// How the front wheel is hung.
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
    PartialEq,
    Eq,
    Hash,
    serde::Serialize,
    serde::Deserialize,
    schemars::JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum SteeringGeometry {
    /// What the simplified model assumes: no trail, a vertical steering axis, wheels that weigh nearly nothing.
    #[default]
    Matched,
    /// An electric bicycle's: 70° head angle, 60 mm trail, a hub motor in the rear wheel, rims and a fork that
    /// weigh what they weigh.
    Realistic,
}

impl SteeringGeometry {
    /// The name as written in a scenario.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Matched => "matched",
            Self::Realistic => "realistic",
        }
    }
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

/// Shares of link 1's mass in the realistic geometry: of 38 kg a rear wheel with hub motor of 4.6 kg, a front
/// wheel of 2.0 kg, and 3.8 kg of fork, stem and handlebar.
const REAR_WHEEL_SHARE: f64 = 0.12;
const FRONT_WHEEL_SHARE: f64 = 0.053;
const FORK_SHARE: f64 = 0.10;
/// Radii of gyration about the axle over the wheel radius: the hub motor sits near the axle, a rim does not.
const REAR_GYRATION: f64 = 0.55;
const FRONT_GYRATION: f64 = 0.82;
/// Share of link 1 given to each wheel and to the fork where they should weigh nothing: a multibody link needs
/// some mass, and a wheel's spin adds its inertia to the mass that the drive accelerates (0.1 % here).
const LIGHT_SHARE: f64 = 5e-4;

impl BicycleParts {
    /// The bike robot with steering geometry `geometry`. Frame, fork and wheels together have exactly the mass,
    /// centre of gravity and inertia of the parameters' link 1.
    ///
    /// # Errors
    ///
    /// [`DynamicsError::NothingLeftForTheFrame`] where wheels and fork alone would exceed link 1.
    pub fn robot(params: &BikeParams, geometry: SteeringGeometry) -> Result<Self, DynamicsError> {
        let BikeParams { m1, wheelbase, .. } = *params;
        let radius = params.wheel_radius;
        let link = Part {
            mass: m1,
            centre: Vector3::new(params.x1, 0.0, params.h1),
            inertia: Matrix3::new(
                params.i1x,
                0.0,
                -params.i1xz,
                0.0,
                params.i1y,
                0.0,
                -params.i1xz,
                0.0,
                params.i1z,
            ),
        };
        let (rear_wheel, front_wheel, trail, tilt, fork) = match geometry {
            SteeringGeometry::Matched => {
                let light = Wheel::hoop(LIGHT_SHARE * m1, radius, 1.0);
                let centre = Vector3::new(wheelbase, 0.0, radius);
                let fork = Part::ball(LIGHT_SHARE * m1, centre, 0.3 * radius);
                (light, light, 0.0, 0.0, fork)
            }
            SteeringGeometry::Realistic => {
                // Trail and the fork's centre scale with the wheel: 60 mm, 0.69 m for 26 inches.
                let (trail, tilt) = (radius * 0.06 / 0.33, 20f64.to_radians());
                let height = 2.1 * radius;
                let axis = wheelbase + trail - height * tilt.tan();
                let mass = FORK_SHARE * m1;
                // A slender body along the steering axis.
                let up = Vector3::new(-tilt.sin(), 0.0, tilt.cos());
                let (across, along) = (0.36 * radius, 0.13 * radius);
                let inertia = Matrix3::identity() * (mass * across * across)
                    - up * up.transpose() * (mass * (across * across - along * along));
                let fork = Part {
                    mass,
                    centre: Vector3::new(axis + 0.075 * radius, 0.0, height),
                    inertia,
                };
                (
                    Wheel::hoop(REAR_WHEEL_SHARE * m1, radius, REAR_GYRATION),
                    Wheel::hoop(FRONT_WHEEL_SHARE * m1, radius, FRONT_GYRATION),
                    trail,
                    tilt,
                    fork,
                )
            }
        };
        let frame = link.without(&[rear_wheel.at(0.0), fork, front_wheel.at(wheelbase)]);
        let least = frame.inertia.symmetric_eigenvalues().min();
        // Written so that NaN is refused.
        let some = frame.mass > 0.0 && least > 0.0;
        if !some {
            return Err(DynamicsError::NothingLeftForTheFrame {
                geometry: geometry.name(),
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
            trail,
            tilt,
            balancer: Some(BalancerPart {
                mass: params.m2,
                x: params.x2,
                height: params.l,
                moments: Vector3::new(params.i2x, params.i2y, params.i2z),
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
        // A hoop of 4.6 kg alone has more inertia than this body.
        let thin = BikeParams {
            i1x: 0.05,
            i1y: 0.1,
            i1z: 0.06,
            ..BikeParams::default()
        };
        assert_eq!(thin.check(), Ok(()));
        assert!(matches!(
            BicycleParts::robot(&thin, SteeringGeometry::Realistic),
            Err(DynamicsError::NothingLeftForTheFrame { geometry: "realistic", .. })
        ));
    }
}
