//! Which front end a rigid-body bike gets: the simplified model's or an electric bicycle's.

use crate::params::BikeParams;
use crate::whipple::{FrameBody, SteeringAssembly, WheelInertia};

/// Share of link 1 given to each wheel and to the fork where they should weigh nothing: a multibody link needs
/// some mass, and below this one the contact solver jitters in the wheels' spin. It adds 1 % to the mass that the
/// drive accelerates.
const LIGHT_SHARE: f64 = 5e-3;

/// Wheel radius where it should not matter, as a share of the bike's.
const SMALL_SHARE: f64 = 0.1;

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
    /// What the simplified model assumes: no trail, a vertical steering axis, wheels that weigh nearly nothing and
    /// touch the ground where the axis meets it. A wheel with a radius does not: turned on a leaning frame, its
    /// lowest point moves aside, and its load there rolls the bike. So these wheels are a tenth as large.
    #[default]
    Matched,
    /// An electric bicycle's: 70° head angle, 60 mm trail, a hub motor in the rear wheel, rims and a fork that
    /// weigh what they weigh ([`SteeringAssembly::e_bike`]).
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

    /// Radius of both wheels, m.
    #[must_use]
    pub fn wheel_radius(self, params: &BikeParams) -> f64 {
        match self {
            Self::Matched => SMALL_SHARE * params.wheel_radius,
            Self::Realistic => params.wheel_radius,
        }
    }

    /// Trail, axis, wheels and fork of this geometry for a bike.
    #[must_use]
    pub fn assembly(self, params: &BikeParams) -> SteeringAssembly {
        match self {
            Self::Realistic => SteeringAssembly::e_bike(),
            Self::Matched => {
                let mass = LIGHT_SHARE * params.m1;
                let radius = self.wheel_radius(params);
                let square = mass * radius.powi(2);
                let wheel = WheelInertia {
                    mass,
                    ixx: 0.5 * square,
                    iyy: square,
                };
                SteeringAssembly {
                    trail: 0.0,
                    tilt: 0.0,
                    rear_wheel: wheel,
                    front_wheel: wheel,
                    fork: FrameBody {
                        x: 0.0,
                        z: -radius,
                        mass,
                        ixx: 0.1 * square,
                        iyy: 0.1 * square,
                        izz: 0.1 * square,
                        ixz: 0.0,
                    },
                }
            }
        }
    }
}
