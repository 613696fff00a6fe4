//! A planar laser scanner on the bike: beams cast through a world.
//!
//! The mount rolls with the bike about the line through the wheel contacts, so it moves
//! sideways by `y cos α − z sin α`, and the plane of the beams tilts. Obstacles are prisms
//! without end upwards, so a beam at angle `b` from the heading meets what its projection on
//! the ground, `(cos b, sin b cos α)`, meets; its range is the distance over ground divided
//! by the length of that projection. The ground itself gives no return.

use bikebot_geometry::{Point2, Pose2, Vector2};
use bikebot_world::World;
use rand_chacha::ChaCha8Rng;

use crate::chance::{standard_normals, uniform};
use crate::error::DynamicsError;

/// The scanner: its beams, its mount on the bike and its errors. The default is an ideal
/// scanner of 1081 beams over 270°, 30 m far, above the front wheel.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(default, deny_unknown_fields)]
pub struct LaserParams {
    /// Whether the bike carries a laser.
    pub enabled: bool,
    /// Number of beams of one scan.
    #[schemars(range(min = 1, max = 100_000))]
    pub beams: u32,
    /// Angle between the first and the last beam, degrees, half of it to either side.
    #[schemars(range(min = 0.0, max = 360.0))]
    pub fov_deg: f64,
    /// Least range, m: anything nearer gives no return.
    #[serde(rename = "range_min_m")]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub range_min: f64,
    /// Largest range, m: anything farther gives no return.
    #[serde(rename = "range_max_m")]
    #[schemars(range(max = 10000.0), extend("exclusiveMinimum" = 0.0))]
    pub range_max: f64,
    /// Scans per second, Hz.
    #[serde(rename = "rate_hz")]
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub rate: f64,
    /// Mount ahead of the rear contact, m: above the front hub.
    #[serde(rename = "mount_x_m")]
    #[schemars(range(min = -5.0, max = 5.0))]
    pub mount_x: f64,
    /// Mount to the left of the bike's plane of symmetry, m.
    #[serde(rename = "mount_y_m")]
    #[schemars(range(min = -5.0, max = 5.0))]
    pub mount_y: f64,
    /// Height of the mount above the ground, m: it decides how far roll shifts the scan.
    #[serde(rename = "mount_z_m")]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub mount_z: f64,
    /// Direction of the middle beam, degrees to the left of straight ahead.
    #[schemars(range(min = -180.0, max = 180.0))]
    pub mount_yaw_deg: f64,
    /// Whether the plane of the beams tilts with the bike; false for a mount that keeps it
    /// level. The mount shifts sideways either way.
    pub tilts_with_roll: bool,
    /// Constant part of the range's standard deviation, m.
    #[serde(rename = "range_sigma_m")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub range_sigma: f64,
    /// Part of the range's standard deviation that grows with the range, m per m.
    #[serde(rename = "range_sigma_m_per_m")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub range_sigma_per_range: f64,
    /// Probability that a beam gives no return although it hit something.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub dropout_probability: f64,
}

impl Default for LaserParams {
    fn default() -> Self {
        Self {
            enabled: true,
            beams: 1081,
            fov_deg: 270.0,
            range_min: 0.1,
            range_max: 30.0,
            rate: 20.0,
            mount_x: 1.2,
            mount_y: 0.0,
            mount_z: 0.7,
            mount_yaw_deg: 0.0,
            tilts_with_roll: true,
            range_sigma: 0.0,
            range_sigma_per_range: 0.0,
            dropout_probability: 0.0,
        }
    }
}

/// One turn of the scanner: ranges along beams in the scanner's own plane.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LaserScan {
    /// Angle of the first beam from the scanner's x axis, rad, counter-clockwise.
    pub angle_min: f64,
    /// Angle from one beam to the next, rad; zero for a single beam.
    pub angle_step: f64,
    /// Range of each beam, m; `f64::INFINITY` for no return.
    pub ranges: Vec<f64>,
}

/// The scanner, ready to look at worlds.
#[derive(Debug, Clone, PartialEq)]
pub struct LaserScanner {
    params: LaserParams,
    angle_min: f64,
    angle_step: f64,
}

impl LaserScanner {
    /// A scanner with these parameters.
    ///
    /// # Errors
    ///
    /// [`DynamicsError::EmptyRange`] when the least range is not below the largest.
    pub fn new(params: &LaserParams) -> Result<Self, DynamicsError> {
        let (min, max) = (params.range_min, params.range_max);
        let possible = min < max;
        if !possible {
            return Err(DynamicsError::EmptyRange { min, max });
        }
        let fov = params.fov_deg.to_radians();
        let (angle_min, angle_step) = match params.beams {
            0 | 1 => (0.0, 0.0),
            beams => (-0.5 * fov, fov / f64::from(beams - 1)),
        };
        Ok(Self {
            params: *params,
            angle_min,
            angle_step,
        })
    }

    /// The parameters of this scanner.
    #[must_use]
    pub fn params(&self) -> &LaserParams {
        &self.params
    }

    /// Where the scanner is and where its middle beam points, over ground, on a bike at
    /// `pose` with `roll` (rad, positive to the right).
    #[must_use]
    pub fn mount(&self, pose: &Pose2, roll: f64) -> Pose2 {
        let p = &self.params;
        let (sin, cos) = roll.sin_cos();
        let position = pose.transform(Point2::new(p.mount_x, p.mount_y * cos - p.mount_z * sin));
        let middle = self.projection(0.0, roll);
        let heading = pose.heading + middle.y.atan2(middle.x);
        Pose2::new(position.x, position.y, heading)
    }

    /// Projection on the ground, in the heading frame, of the unit vector along a beam at
    /// `angle` (rad) from the scanner's x axis.
    #[must_use]
    pub fn projection(&self, angle: f64, roll: f64) -> Vector2 {
        let (sin, cos) = (self.params.mount_yaw_deg.to_radians() + angle).sin_cos();
        let tilt = if self.params.tilts_with_roll {
            roll.cos()
        } else {
            1.0
        };
        Vector2::new(cos, sin * tilt)
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
        let range = *scan.ranges.get(index)?;
        if !range.is_finite() {
            return None;
        }
        let angle = scan.angle_min + scan.angle_step * index as f64;
        let along = self.projection(angle, roll) * range;
        let p = &self.params;
        let (sin, cos) = roll.sin_cos();
        let lateral = p.mount_y * cos - p.mount_z * sin;
        Some(pose.transform(Point2::new(p.mount_x + along.x, lateral + along.y)))
    }

    /// One scan of `world` from a bike at `pose` with `roll` (rad, positive to the right).
    /// Noise and dropouts are drawn from `rng`; an ideal scanner draws nothing.
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
        scan.angle_min = self.angle_min;
        scan.angle_step = self.angle_step;
        scan.ranges.clear();
        scan.ranges
            .resize(self.params.beams as usize, f64::INFINITY);
        self.cast(world, pose, roll, &mut scan.ranges);
        self.disturb(rng, &mut scan.ranges);
        let within = self.params.range_min..=self.params.range_max;
        for range in &mut scan.ranges {
            if !within.contains(range) {
                *range = f64::INFINITY;
            }
        }
    }

    /// True ranges along the beams, infinite beyond the largest.
    fn cast(&self, world: &World, pose: &Pose2, roll: f64, ranges: &mut [f64]) {
        let mount = self.mount(pose, roll);
        let range_max = self.params.range_max;
        let level = !self.params.tilts_with_roll || roll == 0.0;
        if level {
            let first = mount.heading + self.angle_min;
            world.cast_fan(mount.position, first, self.angle_step, range_max, ranges);
            return;
        }
        for (i, range) in ranges.iter_mut().enumerate() {
            let over_ground = self.projection(self.angle_min + self.angle_step * i as f64, roll);
            let length = over_ground.norm();
            let angle = pose.heading + over_ground.y.atan2(over_ground.x);
            *range = match world.cast_ray(mount.position, angle, range_max * length) {
                Some(distance) => distance / length,
                None => f64::INFINITY,
            };
        }
    }

    /// Adds noise and drops beams. Every beam draws the same numbers whether it hit
    /// something or not, so that one beam's noise does not depend on what others see.
    fn disturb(&self, rng: &mut ChaCha8Rng, ranges: &mut [f64]) {
        let p = &self.params;
        let constant = p.range_sigma;
        let proportional = p.range_sigma_per_range;
        if constant == 0.0 && proportional == 0.0 && p.dropout_probability == 0.0 {
            return;
        }
        for range in ranges {
            let (normal, _) = standard_normals(rng);
            let dropped = uniform(rng) < p.dropout_probability;
            if dropped {
                *range = f64::INFINITY;
            } else if range.is_finite() {
                *range += constant.hypot(proportional * *range) * normal;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_world::{Bounds, Obstacle};
    use rand::SeedableRng;

    /// Agreement with closed forms, m: rounding of ranges below 100 m.
    const EXACT: f64 = 1e-9;

    fn rng() -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(3)
    }

    fn room(half: f64, obstacles: Vec<Obstacle>) -> World {
        let bounds = Bounds {
            min: Point2::new(-half, -half),
            max: Point2::new(half, half),
        };
        World::new(bounds, obstacles).unwrap()
    }

    fn scanner(params: LaserParams) -> LaserScanner {
        LaserScanner::new(&params).unwrap()
    }

    /// On the rear contact and on the ground, looking ahead.
    fn bare() -> LaserParams {
        LaserParams {
            mount_x: 0.0,
            mount_z: 0.0,
            ..LaserParams::default()
        }
    }

    /// Distance from `origin` along `direction` to a circle, if the ray meets it.
    fn to_circle(origin: Point2, direction: Vector2, center: Point2, radius: f64) -> f64 {
        let to = center - origin;
        let along = to.dot(&direction);
        let gap = radius * radius - (to.norm_squared() - along * along);
        if gap < 0.0 || along < 0.0 {
            f64::INFINITY
        } else {
            along - gap.sqrt()
        }
    }

    /// Distance from `origin` along `direction` to the inside of a square room.
    fn to_walls(origin: Point2, direction: Vector2, half: f64) -> f64 {
        let wall = |o: f64, u: f64| {
            if u == 0.0 {
                f64::INFINITY
            } else {
                (half.copysign(u) - o) / u
            }
        };
        wall(origin.x, direction.x).min(wall(origin.y, direction.y))
    }

    fn assert_ranges(scan: &LaserScan, expected: impl Fn(f64) -> f64) {
        for (i, &range) in scan.ranges.iter().enumerate() {
            let angle = scan.angle_min + scan.angle_step * i as f64;
            let want = expected(angle);
            let same = range == want || (range - want).abs() <= EXACT;
            assert!(
                same,
                "beam {i} at {angle} rad: {range} m, expected {want} m"
            );
        }
    }

    #[test]
    fn ranges_to_a_disc_and_the_walls_are_those_of_the_closed_form() {
        let center = Point2::new(4.0, 1.0);
        let world = room(
            20.0,
            vec![Obstacle::Disc {
                center,
                radius: 1.5,
            }],
        );
        let pose = Pose2::new(-1.0, 0.5, 0.4);
        let scan = scanner(bare()).scan(&world, &pose, 0.0, &mut rng());
        assert_eq!(scan.ranges.len(), 1081);
        assert!((scan.angle_min + 135_f64.to_radians()).abs() < 1e-15);
        assert_ranges(&scan, |angle| {
            let (sin, cos) = (pose.heading + angle).sin_cos();
            let direction = Vector2::new(cos, sin);
            let disc = to_circle(pose.position, direction, center, 1.5);
            disc.min(to_walls(pose.position, direction, 20.0))
        });
        let hits = scan.ranges.iter().filter(|range| **range < 5.0).count();
        assert!(hits > 50, "the disc is in view: {hits}");
    }

    #[test]
    fn mount_offset_yaw_and_roll_move_the_beams_as_rigid_geometry_says() {
        let center = Point2::new(1.0, 6.0);
        let world = room(
            20.0,
            vec![Obstacle::Disc {
                center,
                radius: 2.0,
            }],
        );
        let params = LaserParams {
            mount_x: 1.1,
            mount_y: 0.2,
            mount_z: 0.9,
            mount_yaw_deg: 35.0,
            // Everything returns: along a leaning beam the walls are more than 30 m away.
            range_max: 100.0,
            ..LaserParams::default()
        };
        let pose = Pose2::new(0.5, -2.0, 0.7);
        for roll in [0.0, 0.3, -0.2] {
            let scan = scanner(params).scan(&world, &pose, roll, &mut rng());
            // Rotations in space: heading about up, roll about ahead, yaw about the mast.
            let rotation = nalgebra::Rotation3::from_euler_angles(roll, 0.0, pose.heading);
            let mount = rotation * nalgebra::Vector3::new(1.1, 0.2, 0.9);
            let origin = pose.position + mount.xy();
            assert_ranges(&scan, |angle| {
                let yaw = 35_f64.to_radians() + angle;
                let beam = rotation * nalgebra::Vector3::new(yaw.cos(), yaw.sin(), 0.0);
                let length = beam.xy().norm();
                let over_ground = beam.xy() / length;
                let distance = to_circle(origin, over_ground, center, 2.0).min(to_walls(
                    origin,
                    over_ground,
                    20.0,
                ));
                distance / length
            });
        }
    }

    #[test]
    fn a_level_mount_shifts_but_does_not_tilt() {
        let world = room(10.0, vec![]);
        let params = LaserParams {
            mount_x: 0.0,
            mount_z: 0.8,
            tilts_with_roll: false,
            ..LaserParams::default()
        };
        let pose = Pose2::new(0.0, 0.0, 0.0);
        // Leaning right carries the mount to the right, negative y.
        let roll = 0.25_f64;
        let scan = scanner(params).scan(&world, &pose, roll, &mut rng());
        let origin = Point2::new(0.0, -0.8 * roll.sin());
        assert_ranges(&scan, |angle| {
            to_walls(origin, Vector2::new(angle.cos(), angle.sin()), 10.0)
        });
    }

    #[test]
    fn hit_points_of_a_scan_lie_on_what_was_hit() {
        let center = Point2::new(5.0, 0.0);
        let world = room(
            15.0,
            vec![Obstacle::Disc {
                center,
                radius: 2.0,
            }],
        );
        let scanner = scanner(LaserParams {
            mount_yaw_deg: -20.0,
            ..LaserParams::default()
        });
        let pose = Pose2::new(-1.0, 1.0, -0.3);
        let roll = -0.2;
        let scan = scanner.scan(&world, &pose, roll, &mut rng());
        for i in 0..scan.ranges.len() {
            let point = scanner.hit_point(&scan, i, &pose, roll).unwrap();
            let on_disc = ((point - center).norm() - 2.0).abs() < EXACT;
            let on_wall = (point.x.abs().max(point.y.abs()) - 15.0).abs() < EXACT;
            assert!(on_disc || on_wall, "beam {i} at {point}");
        }
        assert_eq!(scanner.hit_point(&scan, 1081, &pose, roll), None);
    }

    #[test]
    fn nothing_too_near_or_too_far_returns() {
        let center = Point2::new(4.0, 0.0);
        let world = room(
            50.0,
            vec![Obstacle::Disc {
                center,
                radius: 1.0,
            }],
        );
        let pose = Pose2::new(0.0, 0.0, 0.0);
        let single = |min, max| {
            let params = LaserParams {
                beams: 1,
                range_min: min,
                range_max: max,
                ..bare()
            };
            scanner(params).scan(&world, &pose, 0.0, &mut rng()).ranges[0]
        };
        assert!((single(0.1, 30.0) - 3.0).abs() < EXACT);
        assert_eq!(single(3.5, 30.0), f64::INFINITY);
        assert_eq!(single(0.1, 2.5), f64::INFINITY);
    }

    #[test]
    fn range_noise_has_the_spread_asked_for_and_grows_with_range() {
        let world = room(200.0, vec![]);
        let n = 100_000_u32;
        // σ = √(0.03² + (0.004 r)²): at 10 m 0.03 and 0.04 make 0.05, at 120 m 0.48 rules.
        for (distance, expected) in [(10.0, 0.05), (120.0, 0.480_936_586_256_442)] {
            // All beams look straight at the east wall.
            let params = LaserParams {
                beams: n,
                fov_deg: 0.0,
                range_max: 500.0,
                range_sigma: 0.03,
                range_sigma_per_range: 0.004,
                ..bare()
            };
            let pose = Pose2::new(200.0 - distance, 0.0, 0.0);
            let scan = scanner(params).scan(&world, &pose, 0.0, &mut rng());
            let count = f64::from(n);
            let mean = scan.ranges.iter().sum::<f64>() / count;
            let variance = scan
                .ranges
                .iter()
                .map(|r| (r - distance).powi(2))
                .sum::<f64>()
                / count;
            // Three standard errors of a mean and of a deviation.
            assert!((mean - distance).abs() < 3.0 * expected / count.sqrt());
            let spread = (variance.sqrt() - expected).abs();
            assert!(spread < 3.0 * expected / (2.0 * count).sqrt());
        }
    }

    #[test]
    fn beams_drop_out_at_the_rate_asked_for() {
        let world = room(10.0, vec![]);
        let params = LaserParams {
            beams: 100_000,
            dropout_probability: 0.2,
            ..LaserParams::default()
        };
        let pose = Pose2::new(0.0, 0.0, 0.0);
        let scan = scanner(params).scan(&world, &pose, 0.0, &mut rng());
        let lost = scan
            .ranges
            .iter()
            .filter(|range| range.is_infinite())
            .count();
        // Three standard errors of a share of 0.2 in 1e5.
        assert!((lost as f64 / 1e5 - 0.2).abs() < 3.0 * (0.16_f64 / 1e5).sqrt());
    }

    #[test]
    fn equal_generators_give_equal_scans_and_memory_is_used_again() {
        let world = room(10.0, vec![]);
        let scanner = scanner(LaserParams {
            range_sigma: 0.02,
            ..LaserParams::default()
        });
        let pose = Pose2::new(1.0, 2.0, 3.0);
        let first = scanner.scan(&world, &pose, 0.1, &mut rng());
        let mut again = first.clone();
        let memory = again.ranges.as_ptr();
        scanner.scan_into(&world, &pose, 0.1, &mut rng(), &mut again);
        assert_eq!(first, again);
        assert_eq!(memory, again.ranges.as_ptr());
    }

    #[test]
    fn refuses_an_empty_interval_of_ranges() {
        let params = LaserParams {
            range_min: 3.0,
            range_max: 3.0,
            ..LaserParams::default()
        };
        assert_eq!(
            LaserScanner::new(&params),
            Err(DynamicsError::EmptyRange { min: 3.0, max: 3.0 })
        );
    }
}
