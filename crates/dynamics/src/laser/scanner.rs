//! From the bike to its beams and back: the geometry of the mount, and one scan at a time.

use bikebot_geometry::{Point2, Pose2, Vector2};
use bikebot_world::World;
use nalgebra::{Point3, Vector3};
use rand_chacha::ChaCha8Rng;

use super::params::{LaserParams, NoReturn};
use super::ray::{Prisms, Ray, RayScene};
use super::scan::LaserScan;
use crate::chance::{standard_normals, uniform};
use crate::error::DynamicsError;

/// The scanner, ready to look at worlds.
#[derive(Debug, Clone, PartialEq)]
pub struct LaserScanner {
    params: LaserParams,
    angle_min: f64,
    angle_step: f64,
    beam_period: f64,
    /// Sine and cosine of the mount's yaw and pitch.
    yaw: (f64, f64),
    pitch: (f64, f64),
}

impl LaserScanner {
    /// A scanner with these parameters.
    ///
    /// # Errors
    ///
    /// [`DynamicsError::EmptyRange`] when the least range is not below the largest,
    /// [`DynamicsError::NoBeams`] without a beam.
    pub fn new(params: &LaserParams) -> Result<Self, DynamicsError> {
        let (min, max) = (params.range_min, params.range_max);
        let possible = min < max;
        if !possible {
            return Err(DynamicsError::EmptyRange { min, max });
        }
        let fov = params.fov_deg.to_radians();
        let (angle_min, angle_step) = match params.beams {
            0 => return Err(DynamicsError::NoBeams),
            1 => (0.0, 0.0),
            beams => (-0.5 * fov, fov / f64::from(beams - 1)),
        };
        let beam_period = if params.sweep {
            angle_step / std::f64::consts::TAU / params.rate
        } else {
            0.0
        };
        Ok(Self {
            params: *params,
            angle_min,
            angle_step,
            beam_period,
            yaw: params.mount_yaw_deg.to_radians().sin_cos(),
            pitch: params.mount_pitch_deg.to_radians().sin_cos(),
        })
    }

    /// The parameters of this scanner.
    #[must_use]
    pub fn params(&self) -> &LaserParams {
        &self.params
    }

    /// Whether a range (m) of a scan says that something was met there. Anything else leaves it open why: nothing within
    /// the largest range, something nearer than the least, or a beam that was lost.
    #[must_use]
    pub fn is_return(&self, range: f64) -> bool {
        match self.params.no_return {
            NoReturn::Infinity => range.is_finite(),
            NoReturn::RangeMax => range < self.params.range_max,
        }
    }

    /// Where the scanner is and where its middle beam points, over ground, on a bike at
    /// `pose` with `roll` (rad, positive to the right).
    #[must_use]
    pub fn mount(&self, pose: &Pose2, roll: f64) -> Pose2 {
        let position = pose.transform(self.mount_over_ground(roll));
        let middle = self.projection(0.0, roll);
        let heading = pose.heading + middle.y.atan2(middle.x);
        Pose2::new(position.x, position.y, heading)
    }

    /// The mount over ground in the heading frame, m.
    fn mount_over_ground(&self, roll: f64) -> Point2 {
        let p = &self.params;
        let (sin, cos) = roll.sin_cos();
        Point2::new(p.mount_x, p.mount_y * cos - p.mount_z * sin)
    }

    /// Height (m) of the mount above the ground.
    #[must_use]
    pub fn mount_height(&self, roll: f64) -> f64 {
        let (sin, cos) = roll.sin_cos();
        self.params.mount_y * sin + self.params.mount_z * cos
    }

    /// Unit vector, in the heading frame, along a beam at `angle` (rad) from the scanner's x axis.
    #[must_use]
    pub fn beam(&self, angle: f64, roll: f64) -> Vector3<f64> {
        let (sin, cos) = angle.sin_cos();
        let ((sin_yaw, cos_yaw), (sin_pitch, cos_pitch)) = (self.yaw, self.pitch);
        let ahead = cos * cos_pitch;
        let (x, y, z) = (
            cos_yaw * ahead - sin_yaw * sin,
            sin_yaw * ahead + cos_yaw * sin,
            -cos * sin_pitch,
        );
        if !self.params.tilts_with_roll {
            return Vector3::new(x, y, z);
        }
        let (sin, cos) = roll.sin_cos();
        Vector3::new(x, y * cos - z * sin, y * sin + z * cos)
    }

    /// Projection on the ground, in the heading frame, of the unit vector along a beam at
    /// `angle` (rad) from the scanner's x axis.
    #[must_use]
    pub fn projection(&self, angle: f64, roll: f64) -> Vector2 {
        self.beam(angle, roll).xy()
    }

    /// The beam at `angle` (rad) from the scanner's x axis as a ray in the world, for a bike at `pose` with `roll` (rad).
    #[must_use]
    pub fn ray(&self, angle: f64, pose: &Pose2, roll: f64) -> Ray {
        let (sin, cos) = pose.heading.sin_cos();
        let turn = |x: f64, y: f64| (cos * x - sin * y, sin * x + cos * y);
        let (mount, beam) = (self.mount_over_ground(roll), self.beam(angle, roll));
        let (x, y) = turn(mount.x, mount.y);
        let (along_x, along_y) = turn(beam.x, beam.y);
        Ray {
            origin: Point3::new(
                pose.position.x + x,
                pose.position.y + y,
                self.mount_height(roll),
            ),
            direction: Vector3::new(along_x, along_y, beam.z),
        }
    }

    /// The point in space at which beam `index` of `scan` met something, for a bike that was at `pose` with `roll` (rad)
    /// at the time of that beam; `None` for no return or no such beam.
    #[must_use]
    pub fn hit(
        &self,
        scan: &LaserScan,
        index: usize,
        pose: &Pose2,
        roll: f64,
    ) -> Option<Point3<f64>> {
        let range = *scan.ranges.get(index)?;
        self.is_return(range)
            .then(|| self.ray(scan.beam_angle(index), pose, roll).at(range))
    }

    /// The point over ground at which beam `index` of `scan` met something, for a bike at
    /// `pose` with `roll` (rad); `None` for no return or no such beam.
    #[must_use]
    pub fn hit_point(
        &self,
        scan: &LaserScan,
        index: usize,
        pose: &Pose2,
        roll: f64,
    ) -> Option<Point2> {
        self.hit(scan, index, pose, roll)
            .map(|point| Point2::new(point.x, point.y))
    }

    /// A scan without ranges, its first beam fired at `start` (s).
    pub(super) fn blank(&self, start: f64) -> LaserScan {
        LaserScan {
            start,
            beam_period: self.beam_period,
            angle_min: self.angle_min,
            angle_step: self.angle_step,
            ranges: Vec::with_capacity(self.params.beams as usize),
        }
    }

    /// One scan that begins at `start` (s), each beam from where `motion` says the bike is at the beam's own time (s): its
    /// pose and its roll (rad). Noise and dropouts are drawn from `rng`; a scanner without them draws nothing.
    #[must_use]
    pub fn sweep(
        &self,
        scene: &(impl RayScene + ?Sized),
        start: f64,
        motion: impl Fn(f64) -> (Pose2, f64),
        rng: &mut ChaCha8Rng,
    ) -> LaserScan {
        let mut scan = self.blank(start);
        for beam in 0..self.params.beams as usize {
            let time = scan.beam_time(beam);
            let (pose, roll) = motion(time);
            let range = self.fire(scene, time, scan.beam_angle(beam), &pose, roll, rng);
            scan.ranges.push(range);
        }
        scan
    }

    /// One beam: what it says.
    pub(super) fn fire(
        &self,
        scene: &(impl RayScene + ?Sized),
        time: f64,
        angle: f64,
        pose: &Pose2,
        roll: f64,
        rng: &mut ChaCha8Rng,
    ) -> f64 {
        let mut range = self.true_range(scene, time, &self.ray(angle, pose, roll));
        self.disturb(rng, std::slice::from_mut(&mut range));
        range
    }

    /// Range (m) to the nearer of the scene and the ground, infinite beyond the largest.
    fn true_range(&self, scene: &(impl RayScene + ?Sized), time: f64, ray: &Ray) -> f64 {
        let ground = ray.ground_range();
        let range_max = self.params.range_max;
        let hit = scene.cast(ray, time, range_max.min(ground));
        if hit.is_finite() {
            hit
        } else if ground <= range_max && self.params.ground_returns {
            ground
        } else {
            f64::INFINITY
        }
    }

    /// One scan of `world` at a glance, all beams from the bike at `pose` with `roll` (rad, positive to the right): what a
    /// sweep of a bike at rest would say, as of time zero. Obstacles have the height of the parameters.
    /// Noise and dropouts are drawn from `rng`; a scanner without them draws nothing.
    #[must_use]
    pub fn scan(&self, world: &World, pose: &Pose2, roll: f64, rng: &mut ChaCha8Rng) -> LaserScan {
        let mut scan = LaserScan::default();
        self.scan_into(world, pose, roll, rng, &mut scan);
        scan
    }

    /// [`scan`](Self::scan) into a scan whose memory is used again.
    pub fn scan_into(
        &self,
        world: &World,
        pose: &Pose2,
        roll: f64,
        rng: &mut ChaCha8Rng,
        scan: &mut LaserScan,
    ) {
        scan.start = 0.0;
        scan.beam_period = 0.0;
        scan.angle_min = self.angle_min;
        scan.angle_step = self.angle_step;
        scan.ranges.clear();
        scan.ranges
            .resize(self.params.beams as usize, f64::INFINITY);
        self.cast(world, pose, roll, &mut scan.ranges);
        self.disturb(rng, &mut scan.ranges);
    }

    /// True ranges along the beams, infinite beyond the largest.
    fn cast(&self, world: &World, pose: &Pose2, roll: f64, ranges: &mut [f64]) {
        let p = &self.params;
        let level = (!p.tilts_with_roll || roll == 0.0) && p.mount_pitch_deg == 0.0;
        let among_obstacles = (0.0..=p.obstacle_height).contains(&self.mount_height(roll));
        if level && among_obstacles {
            // Neighbouring beams of a fan find what they meet faster.
            let mount = self.mount(pose, roll);
            let first = mount.heading + self.angle_min;
            world.cast_fan(mount.position, first, self.angle_step, p.range_max, ranges);
            return;
        }
        let prisms = Prisms {
            world,
            height: p.obstacle_height,
        };
        for (i, range) in ranges.iter_mut().enumerate() {
            let ray = self.ray(self.angle_min + self.angle_step * i as f64, pose, roll);
            *range = self.true_range(&prisms, 0.0, &ray);
        }
    }

    /// Adds noise, drops beams, and lets the scanner say what it says of what gives no return. Every beam draws the same
    /// numbers whether it hit something or not, so that one beam's noise does not depend on what others see.
    fn disturb(&self, rng: &mut ChaCha8Rng, ranges: &mut [f64]) {
        let p = &self.params;
        let constant = p.range_sigma;
        let proportional = p.range_sigma_per_range;
        let is_ideal = constant == 0.0 && proportional == 0.0 && p.dropout_probability == 0.0;
        let no_return = match p.no_return {
            NoReturn::Infinity => f64::INFINITY,
            NoReturn::RangeMax => p.range_max,
        };
        for range in ranges {
            if !is_ideal {
                let (normal, _) = standard_normals(rng);
                let dropped = uniform(rng) < p.dropout_probability;
                if dropped {
                    *range = f64::INFINITY;
                } else if range.is_finite() {
                    *range += constant.hypot(proportional * *range) * normal;
                }
            }
            if !(p.range_min..=p.range_max).contains(range) {
                *range = no_return;
            }
        }
    }
}
