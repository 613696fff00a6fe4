//! What a laser on the true bike looks at.

use crate::setup::Setup;
use crate::traffic::Traffic;
use crate::true_plant::TruePlant;
use bikebot_dynamics::laser::{Prisms, Ray, RayScene};
#[cfg(feature = "rapier")]
use bikebot_dynamics::rigid::RigidBike;

/// The true world: what stands, and what moves where it is at the time of each beam.
pub struct TrueScene<'a> {
    standing: Standing<'a>,
    traffic: &'a Traffic,
}

/// Who answers for what stands there.
enum Standing<'a> {
    /// The map, its obstacles as prisms.
    Map(Prisms<'a>),
    /// The bodies of the engine the bike rides in. Those that move are asked too, where they are at the time of the beam.
    #[cfg(feature = "rapier")]
    Bodies(&'a RigidBike),
}

impl<'a> TrueScene<'a> {
    /// What there is to look at, if there is a map: for a bike of rigid bodies the bodies around it.
    #[must_use]
    pub fn new(setup: &'a Setup, plant: &'a TruePlant) -> Option<Self> {
        let world = setup.world.as_ref()?;
        let map = Standing::Map(Prisms {
            world,
            height: setup.laser.obstacle_height,
        });
        #[cfg(feature = "rapier")]
        let standing = plant.bodies().map_or(map, Standing::Bodies);
        #[cfg(not(feature = "rapier"))]
        let (standing, _) = (map, plant);
        Some(Self {
            standing,
            traffic: &setup.traffic,
        })
    }
}

impl RayScene for TrueScene<'_> {
    fn cast(&self, ray: &Ray, time: f64, max_range: f64) -> f64 {
        match &self.standing {
            Standing::Map(map) => (map, self.traffic).cast(ray, time, max_range),
            #[cfg(feature = "rapier")]
            Standing::Bodies(bike) => self.traffic.near_ray(ray, time, max_range).fold(
                bike.cast_ray(ray, max_range),
                |nearest, (index, pose)| {
                    nearest.min(bike.cast_ray_at_moving(index, &pose, ray, max_range.min(nearest)))
                },
            ),
        }
    }
}
