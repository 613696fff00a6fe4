//! Where each beam of a scan went: through the plane, and how high above the ground.

use bikebot_dynamics::LaserParams;
use bikebot_geometry::{Point2, Pose2, Vector2};
use bikebot_world::Footprint;

use crate::outline::Outline;
use crate::params::MapperParams;

/// A range as near as this to the largest one, as a part of it, is a missing return.
const FULL: f64 = 1.0 - 1e-9;

/// Standard deviations of the range kept between what is cleared and what was hit.
const RANGE_SIGMAS: f64 = 2.0;

/// One beam over ground, and what it says.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Beam {
    /// The mount over ground when the beam was fired, m.
    pub(crate) origin: Point2,
    /// Unit vector over ground.
    pub(crate) direction: Vector2,
    /// Distance over ground to the obstacle met, m; infinite for none.
    pub(crate) met: f64,
    /// Distance over ground up to which nothing stands, as far as this beam alone can tell, m.
    pub(crate) clear: f64,
    /// Whether nothing came back.
    pub(crate) is_missing: bool,
    /// When it was fired, s.
    pub(crate) time: f64,
}

/// The device on the bike: turns ranges into [`Beam`]s.
#[derive(Debug, Clone)]
pub(crate) struct Device {
    laser: LaserParams,
    obstacle_height: f64,
    height_tolerance: f64,
    roll_tolerance: f64,
    no_return_clears: f64,
    ignore_within: f64,
    own: Outline,
    /// What the rays below are for: first angle, step.
    angles: Option<(f64, f64)>,
    rays: Vec<Ray>,
}

/// A beam in the frame of the upright bike.
#[derive(Debug, Clone, Copy)]
struct Ray {
    /// Unit vector: ahead, left, up.
    ahead: f64,
    left: f64,
    up: f64,
    /// Whether something too near to return would be seen otherwise, or be part of the bike.
    is_missing_telling: bool,
}

/// How the bike stood when a beam was fired.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Attitude {
    /// Mount over ground in the bike's frame, and its height, m.
    x: f64,
    y: f64,
    z: f64,
    pose: Pose2,
    forward: Vector2,
    /// Sine and cosine of the beams' tilt.
    tilt: (f64, f64),
}

impl Device {
    pub(crate) fn new(params: &MapperParams, laser: &LaserParams, own: Option<&Footprint>) -> Self {
        Self {
            laser: *laser,
            obstacle_height: params.obstacle_height,
            height_tolerance: params.height_tolerance,
            roll_tolerance: params.roll_tolerance(),
            no_return_clears: params.no_return_clears.min(laser.range_max),
            ignore_within: params.ignore_within,
            own: own.map(Outline::new).unwrap_or_default(),
            angles: None,
            rays: Vec::new(),
        }
    }

    /// Makes ready for scans of `count` beams from `angle_min` (rad) by `angle_step` (rad). `blind` (m): something nearer
    /// to the scanner than this may go unseen.
    pub(crate) fn prepare(&mut self, angle_min: f64, angle_step: f64, count: usize, blind: f64) {
        let angles = Some((angle_min, angle_step));
        if self.angles == angles && self.rays.len() == count {
            return;
        }
        self.angles = angles;
        self.rays.clear();
        let laser = self.laser;
        let (sin_yaw, cos_yaw) = laser.mount_yaw_deg.to_radians().sin_cos();
        let (sin_pitch, cos_pitch) = laser.mount_pitch_deg.to_radians().sin_cos();
        for i in 0..count {
            let (sin, cos) = (angle_min + angle_step * i as f64).sin_cos();
            let level = cos * cos_pitch;
            let ahead = cos_yaw * level - sin_yaw * sin;
            let left = sin_yaw * level + cos_yaw * sin;
            let least = laser.range_min;
            let nearest = Point2::new(laser.mount_x + ahead * least, laser.mount_y + left * least);
            self.rays.push(Ray {
                ahead,
                left,
                up: -cos * sin_pitch,
                is_missing_telling: least <= blind || self.own.contains(nearest),
            });
        }
    }

    pub(crate) fn attitude(&self, pose: &Pose2, roll: f64) -> Attitude {
        let (sin_roll, cos_roll) = roll.sin_cos();
        let laser = &self.laser;
        let tilt = if laser.tilts_with_roll {
            (sin_roll, cos_roll)
        } else {
            (0.0, 1.0)
        };
        Attitude {
            x: laser.mount_x,
            y: laser.mount_y * cos_roll - laser.mount_z * sin_roll,
            z: laser.mount_y * sin_roll + laser.mount_z * cos_roll,
            pose: *pose,
            forward: pose.direction(),
            tilt,
        }
    }

    /// Standard deviation of a range, m.
    fn range_sigma(&self, range: f64) -> f64 {
        self.laser
            .range_sigma
            .hypot(self.laser.range_sigma_per_range * range)
    }

    /// How far before a surface `distance` (m) away clearing ends, beyond what the position is uncertain by, m.
    pub(crate) fn range_margin(&self, distance: f64) -> f64 {
        RANGE_SIGMAS * self.range_sigma(distance)
    }

    /// What beam `index` says that measured `range` (m). `margin` (m) is kept before a return that is not believed.
    pub(crate) fn beam(
        &self,
        index: usize,
        range: f64,
        at: &Attitude,
        margin: f64,
        time: f64,
    ) -> Beam {
        let ray = self.rays[index];
        let turn = |v: Vector2| {
            Vector2::new(
                at.forward.x * v.x - at.forward.y * v.y,
                at.forward.y * v.x + at.forward.x * v.y,
            )
        };
        let (sin_tilt, cos_tilt) = at.tilt;
        let along = Vector2::new(ray.ahead, ray.left * cos_tilt - ray.up * sin_tilt);
        // Metres over ground for one of the beam, and how far it rises.
        let rise = ray.left * sin_tilt + ray.up * cos_tilt;
        let over_ground = along.norm().max(1e-9);
        let mut beam = Beam {
            origin: at.pose.position + turn(Vector2::new(at.x, at.y)),
            direction: turn(along / over_ground),
            met: f64::INFINITY,
            clear: 0.0,
            is_missing: false,
            time,
        };
        let laser = &self.laser;
        // Up to here the beam is for certain above the ground and below the top of what stands around.
        let blur = ray.left.abs() * self.roll_tolerance;
        let until = |room: f64, speed: f64| {
            if room <= 0.0 {
                0.0
            } else if speed > 0.0 {
                room / speed
            } else {
                f64::INFINITY
            }
        };
        let low = until(at.z - self.height_tolerance, blur - rise);
        let high = until(
            self.obstacle_height - at.z - self.height_tolerance,
            blur + rise,
        );
        let trusted = low.min(high);
        if range >= laser.range_max * FULL {
            beam.is_missing = true;
            if ray.is_missing_telling {
                beam.clear = self.no_return_clears.min(trusted) * over_ground;
            }
        } else if range >= laser.range_min && range > self.ignore_within {
            let body = Point2::new(at.x + along.x * range, at.y + along.y * range);
            if self.own.contains(body) {
                // A part of the bike, or something in touch with it: nothing to learn.
            } else if range < trusted {
                beam.met = range * over_ground;
                beam.clear = beam.met;
            } else {
                beam.clear = (trusted * over_ground).min(range * over_ground - margin);
            }
        }
        beam
    }
}
