//! The bike robot as a Whipple bicycle.
//!
//! [`BikeParams`] knows the bike as two links: everything that leans with the frame, and the balancer. A Whipple
//! bicycle needs to know more of link 1: its wheels, its fork, its steering axis. A [`SteeringAssembly`] says so;
//! the rear frame is what remains of the two links once wheels and fork are taken out, the balancer locked upright
//! at an offset `d`. The whole bike's mass, centre and moments of inertia therefore are those of the two-link model
//! exactly, whatever the assembly.

use super::params::{FrameBody, WheelBody, WhippleParams};
use crate::constants::GRAVITY;
use crate::error::DynamicsError;
use crate::params::BikeParams;

/// The parts of link 1 that roll and steer, of the front contact's own size and place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteeringAssembly {
    /// `c`: trail, m.
    pub trail: f64,
    /// `λ`: tilt of the steering axis backwards, rad.
    pub tilt: f64,
    /// Rear wheel, with its hub motor: mass, kg, and moments about a diameter and about the axle, kg m².
    pub rear_wheel: WheelInertia,
    /// Front wheel.
    pub front_wheel: WheelInertia,
    /// Handlebar, fork and steering motor; `x` is measured **from the front contact**, m.
    pub fork: FrameBody,
}

/// What a wheel weighs; its radius is the bike's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelInertia {
    /// Mass, kg.
    pub mass: f64,
    /// About any diameter, kg m².
    pub ixx: f64,
    /// About the axle, kg m².
    pub iyy: f64,
}

impl SteeringAssembly {
    /// A 26-inch electric bicycle's: head angle 70°, 60 mm of trail, a rear wheel with a 250 W hub motor.
    ///
    /// A rim with tyre of 1.5 kg at 0.31 m makes the front wheel's 0.15 kg m²; the hub motor adds weight but hardly
    /// inertia. Fork and handlebar are as a city bicycle's measured ones, with a steering motor of 1 kg.
    #[must_use]
    pub fn e_bike() -> Self {
        Self {
            trail: 0.06,
            tilt: 20_f64.to_radians(),
            rear_wheel: WheelInertia {
                mass: 5.0,
                ixx: 0.09,
                iyy: 0.17,
            },
            front_wheel: WheelInertia {
                mass: 2.0,
                ixx: 0.08,
                iyy: 0.15,
            },
            fork: FrameBody {
                x: -0.25,
                z: -0.75,
                mass: 4.2,
                ixx: 0.30,
                iyy: 0.29,
                izz: 0.11,
                ixz: -0.08,
            },
        }
    }

    /// What the simplified bike of §5 assumes: a vertical steering axis through the front contact, wheels without
    /// spin. The masses are those of [`Self::e_bike`].
    #[must_use]
    pub fn simplified() -> Self {
        let mut assembly = Self::e_bike();
        assembly.trail = 0.0;
        assembly.tilt = 0.0;
        assembly.rear_wheel.iyy = 0.0;
        assembly.front_wheel.iyy = 0.0;
        assembly
    }
}

impl WhippleParams {
    /// The bike with its balancer locked upright at offset `d` (m) and wheels, fork and steering axis of `assembly`.
    ///
    /// # Errors
    ///
    /// [`DynamicsError::ImpossibleBicycle`] when nothing possible remains for the rear frame, as of a bike lighter
    /// than its wheels.
    pub fn from_bike(
        bike: &BikeParams,
        d: f64,
        assembly: &SteeringAssembly,
    ) -> Result<Self, DynamicsError> {
        let wheel = |inertia: &WheelInertia| WheelBody {
            radius: bike.wheel_radius,
            mass: inertia.mass,
            ixx: inertia.ixx,
            iyy: inertia.iyy,
        };
        let front_frame = FrameBody {
            x: bike.wheelbase + assembly.fork.x,
            ..assembly.fork
        };
        let (rear_wheel, front_wheel) = (wheel(&assembly.rear_wheel), wheel(&assembly.front_wheel));
        let at = |wheel: &WheelBody, x: f64| FrameBody {
            x,
            z: -wheel.radius,
            mass: wheel.mass,
            ixx: wheel.ixx,
            iyy: wheel.iyy,
            izz: wheel.ixx,
            ixz: 0.0,
        };
        let link1 = FrameBody {
            x: bike.x1,
            z: -bike.h1,
            mass: bike.m1,
            ixx: bike.i1x,
            iyy: bike.i1y,
            izz: bike.i1z,
            ixz: bike.i1xz,
        };
        let link2 = FrameBody {
            x: bike.x2,
            z: -(bike.l + d),
            mass: bike.m2,
            ixx: bike.i2x,
            iyy: bike.i2y,
            izz: bike.i2z,
            ixz: 0.0,
        };
        let rear_frame = combined(&[
            (1.0, link1),
            (1.0, link2),
            (-1.0, at(&rear_wheel, 0.0)),
            (-1.0, at(&front_wheel, bike.wheelbase)),
            (-1.0, front_frame),
        ]);
        let params = Self {
            wheelbase: bike.wheelbase,
            trail: assembly.trail,
            tilt: assembly.tilt,
            gravity: GRAVITY,
            rear_wheel,
            rear_frame,
            front_frame,
            front_wheel,
        };
        params.check()?;
        Ok(params)
    }
}

/// Several bodies as one, each added (+1) or taken out (−1), with the inertia about the common centre of mass.
pub(super) fn combined(parts: &[(f64, FrameBody)]) -> FrameBody {
    let sum = |of: &dyn Fn(&FrameBody) -> f64| -> f64 {
        parts.iter().map(|(sign, body)| sign * of(body)).sum()
    };
    let mass = sum(&|b| b.mass);
    let x = sum(&|b| b.mass * b.x) / mass;
    let z = sum(&|b| b.mass * b.z) / mass;
    FrameBody {
        x,
        z,
        mass,
        ixx: sum(&|b| b.ixx + b.mass * (b.z - z).powi(2)),
        iyy: sum(&|b| b.iyy + b.mass * ((b.x - x).powi(2) + (b.z - z).powi(2))),
        izz: sum(&|b| b.izz + b.mass * (b.x - x).powi(2)),
        ixz: sum(&|b| b.ixz - b.mass * (b.x - x) * (b.z - z)),
    }
}

#[cfg(test)]
mod tests {
    use super::super::linear::Whipple;
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn the_whole_bike_is_that_of_the_two_link_model() {
        for (bike, d) in [(BikeParams::default(), 0.0), (BikeParams::default(), 0.15)] {
            let params = WhippleParams::from_bike(&bike, d, &SteeringAssembly::e_bike()).unwrap();
            let whipple = Whipple::new(&params).unwrap();
            let lumped = bike.lumped(d);
            // M11 with the balancer locked at β = 0, and the moment of gravity.
            let m11 = lumped.a0 + lumped.a2 + 2.0 * lumped.a3;
            assert_relative_eq!(whipple.mass[(0, 0)], m11, max_relative = 1e-14);
            let moment = -GRAVITY * whipple.gravity_stiffness[(0, 0)];
            assert_relative_eq!(moment, lumped.b1 + lumped.b2, max_relative = 1e-14);
        }
    }

    /// Design note §5.2, check W2: without trail, tilt and spin the lean equation is that of the simplified bike.
    #[test]
    fn without_trail_tilt_and_spin_the_lean_equation_is_that_of_the_simplified_bike() {
        let bike = BikeParams {
            i1xz: 0.2,
            ..BikeParams::default()
        };
        let params = WhippleParams::from_bike(&bike, 0.0, &SteeringAssembly::simplified()).unwrap();
        let whipple = Whipple::new(&params).unwrap();
        let lean = bike.lean_coefficients(0.0);
        let per_wheelbase = 1.0 / bike.wheelbase;
        assert_relative_eq!(
            whipple.damping[(0, 1)],
            lean.yaw * per_wheelbase,
            max_relative = 1e-14
        );
        assert_relative_eq!(
            whipple.speed_stiffness[(0, 1)],
            lean.centrifugal * per_wheelbase,
            max_relative = 1e-14
        );
    }

    #[test]
    fn every_preset_bike_has_a_whipple_bicycle() {
        for name in BikeParams::PRESETS {
            let bike = BikeParams::preset(name).unwrap();
            for d in [bike.flywheel_offset, bike.balancer_offset] {
                let params =
                    WhippleParams::from_bike(&bike, d, &SteeringAssembly::e_bike()).unwrap();
                assert!(
                    params.remarks().is_empty(),
                    "{name}: {:?}",
                    params.remarks()
                );
            }
        }
    }

    #[test]
    fn a_bike_lighter_than_its_wheels_is_refused() {
        let bike = BikeParams {
            m1: 5.0,
            m2: 1.0,
            ..BikeParams::default()
        };
        let text = WhippleParams::from_bike(&bike, 0.0, &SteeringAssembly::e_bike())
            .unwrap_err()
            .to_string();
        assert!(text.contains("mB = -5.2"), "{text}");
    }
}
