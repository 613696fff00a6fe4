//! The laser against closed forms.

use super::*;
use crate::error::DynamicsError;
use crate::params::BikeParams;
use bikebot_geometry::{Point2, Pose2, Vector2};
use bikebot_world::{Bounds, Obstacle, World};
use nalgebra::{Point3, Rotation3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

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

fn assert_ranges(scan: &LaserScan, mut expected: impl FnMut(f64) -> f64) {
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

/// Height of the obstacles of the default laser, m.
const HEIGHT: f64 = 2.0;

/// Range along a ray from below the obstacles' tops, in a square room with discs: the nearest of the discs and walls
/// it meets between ground and top, else the ground, else nothing.
fn in_space(ray: &Ray, half: f64, discs: &[(Point2, f64)]) -> f64 {
    let (origin, direction) = (ray.origin, ray.direction);
    let length = direction.xy().norm();
    let (from, along) = (Point2::new(origin.x, origin.y), direction.xy() / length);
    let solid = discs
        .iter()
        .map(|(center, radius)| to_circle(from, along, *center, *radius))
        .chain([to_walls(from, along, half)])
        .map(|over_ground| over_ground / length)
        .filter(|range| (0.0..=HEIGHT).contains(&(origin.z + direction.z * range)))
        .fold(f64::INFINITY, f64::min);
    if solid.is_finite() || direction.z >= 0.0 {
        solid
    } else {
        origin.z / -direction.z
    }
}

/// The beam at `angle` of a mount, by rotations in space: heading about up, roll about ahead, yaw about the mast, pitch
/// about the yawed left.
fn by_rotations(params: &LaserParams, angle: f64, pose: &Pose2, roll: f64) -> Ray {
    let bike = Rotation3::from_euler_angles(roll, 0.0, pose.heading);
    let head = Rotation3::from_euler_angles(
        0.0,
        params.mount_pitch_deg.to_radians(),
        params.mount_yaw_deg.to_radians(),
    );
    let mount = Vector3::new(params.mount_x, params.mount_y, params.mount_z);
    let contact = Vector3::new(pose.position.x, pose.position.y, 0.0);
    Ray {
        origin: Point3::from(contact + bike * mount),
        direction: bike * head * Vector3::new(angle.cos(), angle.sin(), 0.0),
    }
}

/// Beyond the largest range there is no return.
fn within(params: &LaserParams, range: f64) -> f64 {
    if range <= params.range_max {
        range
    } else {
        f64::INFINITY
    }
}

#[test]
fn a_leaning_turned_and_pitched_mount_sees_sides_ground_and_sky_as_rigid_geometry_says() {
    let discs = [
        (Point2::new(1.0, 6.0), 2.0),
        (Point2::new(9.0, -3.0), 0.5),
        (Point2::new(-4.0, -5.0), 1.0),
    ];
    let world = room(
        20.0,
        discs
            .iter()
            .map(|&(center, radius)| Obstacle::Disc { center, radius })
            .collect(),
    );
    let pose = Pose2::new(0.5, -2.0, 0.7);
    let (mut sides, mut ground, mut sky) = (0, 0, 0);
    for (roll, pitch) in [
        (0.0, 0.0),
        (0.3, 0.0),
        (-0.2, 0.0),
        (0.1, 4.0),
        (-0.05, -6.0),
    ] {
        let params = LaserParams {
            mount_x: 1.1,
            mount_y: 0.2,
            mount_z: 0.9,
            mount_yaw_deg: 35.0,
            mount_pitch_deg: pitch,
            ..LaserParams::default()
        };
        let scan = scanner(params).scan(&world, &pose, roll, &mut rng());
        assert_ranges(&scan, |angle| {
            let ray = by_rotations(&params, angle, &pose, roll);
            let range = within(&params, in_space(&ray, 20.0, &discs));
            let z = ray.at(range).z;
            if range.is_infinite() {
                sky += 1;
            } else if z.abs() < 1e-6 {
                ground += 1;
            } else {
                sides += 1;
            }
            range
        });
    }
    // Every kind of return was looked at.
    assert!(
        sides > 1000 && ground > 500 && sky > 500,
        "{sides} {ground} {sky}"
    );
}

#[test]
fn a_beam_over_the_top_of_an_obstacle_meets_what_stands_behind_it() {
    // 10 m off, a beam from 1 m that rises by 12 % passes at 2.2 m.
    let low = Obstacle::Block {
        min: Point2::new(10.0, -1.0),
        max: Point2::new(11.0, 1.0),
    };
    let world = room(100.0, vec![low]);
    for (height, expected) in [(2.0, f64::INFINITY), (2.5, 10.0)] {
        let params = LaserParams {
            beams: 1,
            mount_x: 0.0,
            mount_z: 1.0,
            mount_pitch_deg: -(0.12_f64.atan().to_degrees()),
            obstacle_height: height,
            ..LaserParams::default()
        };
        let pose = Pose2::new(0.0, 0.0, 0.0);
        let range = scanner(params).scan(&world, &pose, 0.0, &mut rng()).ranges[0];
        let expected = expected * 0.12_f64.hypot(1.0);
        assert!(
            range == expected || (range - expected).abs() < EXACT,
            "{range}"
        );
    }
}

#[test]
fn a_laser_on_a_mast_sees_the_tops_from_above() {
    let block = Obstacle::Block {
        min: Point2::new(3.0, -1.0),
        max: Point2::new(5.0, 1.0),
    };
    let world = room(100.0, vec![block]);
    // From 4 m down at 45° to a top 2 m high: 2 m ahead, 3 m ahead, 6 m ahead.
    for (x, expected) in [
        (2.0, 2.0 * 2.0_f64.sqrt()),
        (0.5, 2.5 * 2.0_f64.sqrt()),
        (4.0, 4.0 * 2.0_f64.sqrt()),
    ] {
        let params = LaserParams {
            beams: 1,
            mount_x: 0.0,
            mount_z: 4.0,
            mount_pitch_deg: 45.0,
            ..LaserParams::default()
        };
        let pose = Pose2::new(x, 0.0, 0.0);
        let range = scanner(params).scan(&world, &pose, 0.0, &mut rng()).ranges[0];
        assert!((range - expected).abs() < EXACT, "from {x}: {range}");
    }
}

#[test]
fn ground_that_swallows_the_light_gives_no_return() {
    let world = room(100.0, vec![]);
    let one = |ground_returns| {
        let params = LaserParams {
            beams: 1,
            mount_yaw_deg: -90.0,
            mount_x: 0.0,
            mount_z: 0.7,
            ground_returns,
            ..LaserParams::default()
        };
        let pose = Pose2::new(0.0, 0.0, 0.3);
        scanner(params).scan(&world, &pose, 0.1, &mut rng()).ranges[0]
    };
    // Leaning right by 0.1 rad, a beam to the right falls with sin 0.1 from 0.7 cos 0.1.
    assert!((one(true) - 0.7 * 0.1_f64.cos() / 0.1_f64.sin()).abs() < EXACT);
    assert_eq!(one(false), f64::INFINITY);
}

#[test]
fn into_a_corner_the_range_is_that_of_the_nearer_wall() {
    let world = room(7.0, vec![]);
    let pose = Pose2::new(3.0, 4.0, 0.9);
    let scan = scanner(bare()).scan(&world, &pose, 0.0, &mut rng());
    assert_ranges(&scan, |angle| {
        let (sin, cos) = (pose.heading + angle).sin_cos();
        to_walls(pose.position, Vector2::new(cos, sin), 7.0)
    });
    // The corner itself, 4 m to the right and 3 m ahead in the world.
    let into = LaserParams {
        beams: 1,
        mount_yaw_deg: (3.0_f64.atan2(4.0) - pose.heading).to_degrees(),
        ..bare()
    };
    let range = scanner(into).scan(&world, &pose, 0.0, &mut rng()).ranges[0];
    assert!((range - 5.0).abs() < EXACT, "{range}");
}

/// A bike that goes straight on at a speed while it turns and rolls over at steady rates: every pose between two ticks is
/// exactly in the middle of them.
fn motion(time: f64) -> (Pose2, f64) {
    (
        Pose2::new(-3.0 + 2.0 * time, 1.0 - 0.7 * time, 0.4 + 1.5 * time),
        0.05 - 0.3 * time,
    )
}

fn moving() -> LaserParams {
    LaserParams {
        mount_y: -0.1,
        mount_yaw_deg: 10.0,
        ..LaserParams::default()
    }
}

fn assert_each_beam_from_its_own_pose(scan: &LaserScan, params: &LaserParams) {
    let discs = [(Point2::new(4.0, 1.0), 1.5)];
    for (i, &range) in scan.ranges.iter().enumerate() {
        let (pose, roll) = motion(scan.beam_time(i));
        let ray = by_rotations(params, scan.beam_angle(i), &pose, roll);
        let expected = within(params, in_space(&ray, 12.0, &discs));
        let same = range == expected || (range - expected).abs() <= EXACT;
        assert!(same, "beam {i}: {range} m, expected {expected} m");
    }
}

fn room_with_a_disc() -> World {
    room(
        12.0,
        vec![Obstacle::Disc {
            center: Point2::new(4.0, 1.0),
            radius: 1.5,
        }],
    )
}

#[test]
fn each_beam_of_a_sweep_looks_from_where_the_bike_is_at_its_own_time() {
    let (world, params) = (room_with_a_disc(), moving());
    let scanner = scanner(params);
    let scene = Prisms {
        world: &world,
        height: HEIGHT,
    };
    let scan = scanner.sweep(&scene, 0.3, motion, &mut rng());
    assert_eq!(scan.start, 0.3);
    // 270° of a turn that takes 50 ms.
    assert!((scan.end() - 0.3 - 0.0375).abs() < 1e-12);
    assert_each_beam_from_its_own_pose(&scan, &params);
    // And it matters: seen at a glance the same walls are elsewhere.
    let (pose, roll) = motion(0.3);
    let glance = scanner.scan(&world, &pose, roll, &mut rng());
    let moved = scan
        .ranges
        .iter()
        .zip(&glance.ranges)
        .filter(|(a, b)| (*a - *b).abs() > 0.05)
        .count();
    assert!(moved > 300, "{moved}");
}

#[test]
fn a_sweeping_laser_told_of_every_tick_fires_each_beam_between_the_ticks_about_it() {
    let (world, params) = (room_with_a_disc(), moving());
    let scene = Prisms {
        world: &world,
        height: HEIGHT,
    };
    let mut laser = SweepingLaser::new(scanner(params), rng());
    let mut scans = Vec::new();
    for tick in 0..=100 {
        let time = f64::from(tick) * 0.005;
        let (pose, roll) = motion(time);
        if let Some(scan) = laser.advance(&scene, time, &pose, roll) {
            // The first tick after its last beam: no sooner, no later.
            assert!(scan.end() <= time + 1e-9 && scan.end() > time - 0.005);
            scans.push(scan);
        }
    }
    assert_eq!(scans.len(), 10);
    for (k, scan) in scans.iter().enumerate() {
        assert!((scan.start - 0.05 * k as f64).abs() < 1e-15);
        assert_eq!(scan.ranges.len(), 1081);
        assert_each_beam_from_its_own_pose(scan, &params);
    }
}

#[test]
fn a_scan_is_handed_out_when_its_latency_is_over() {
    let world = room(10.0, vec![]);
    let scene = Prisms {
        world: &world,
        height: HEIGHT,
    };
    for (sweep, latency, first) in [
        (false, 0.0, 0.0),
        (false, 0.12, 0.12),
        (true, 0.0, 0.04),
        (true, 0.2, 0.24),
    ] {
        let params = LaserParams {
            beams: 11,
            sweep,
            latency,
            ..LaserParams::default()
        };
        let mut laser = SweepingLaser::new(scanner(params), rng());
        let pose = Pose2::new(0.0, 0.0, 0.0);
        let given: Vec<(f64, f64)> = (0..100)
            .filter_map(|tick| {
                let time = f64::from(tick) * 0.005;
                let scan = laser.advance(&scene, time, &pose, 0.0)?;
                Some((time, scan.start))
            })
            .collect();
        assert!((given[0].0 - first).abs() < 1e-9, "{:?}", given[0]);
        for (k, (time, start)) in given.iter().enumerate() {
            assert!((start - 0.05 * k as f64).abs() < 1e-12);
            assert!((time - start - first).abs() < 1e-9);
        }
    }
}

#[test]
fn at_rest_a_sweep_says_what_a_glance_says_noise_included() {
    let world = room_with_a_disc();
    let pose = Pose2::new(-1.0, 2.0, 2.0);
    for (roll, sigma) in [(0.0, 0.0), (0.2, 0.0), (0.0, 0.02), (0.1, 0.02)] {
        let params = LaserParams {
            range_sigma: sigma,
            dropout_probability: sigma,
            ..LaserParams::default()
        };
        let glance = scanner(params).scan(&world, &pose, roll, &mut rng());
        let scene = Prisms {
            world: &world,
            height: HEIGHT,
        };
        let mut laser = SweepingLaser::new(scanner(params), rng());
        let scan = (0..9)
            .find_map(|tick| laser.advance(&scene, f64::from(tick) * 0.005, &pose, roll))
            .expect("a scan within 40 ms");
        for (a, b) in scan.ranges.iter().zip(&glance.ranges) {
            // A direction and its angle round differently.
            assert!(a == b || (a - b).abs() < 1e-12, "{a} {b}");
        }
    }
}

#[test]
fn a_laser_switched_on_while_riding_begins_with_the_next_whole_scan() {
    let world = room(10.0, vec![]);
    let scene = Prisms {
        world: &world,
        height: HEIGHT,
    };
    let mut laser = SweepingLaser::new(scanner(LaserParams::default()), rng());
    let pose = Pose2::new(0.0, 0.0, 0.0);
    let scan = (0..40).find_map(|tick| {
        let time = 7.02 + f64::from(tick) * 0.005;
        laser.advance(&scene, time, &pose, 0.0)
    });
    assert!((scan.expect("a scan").start - 7.05).abs() < 1e-12);
    // A clock that is none, or goes back, fires nothing.
    for time in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1.0] {
        assert_eq!(laser.advance(&scene, time, &pose, 0.0), None);
    }
}

#[test]
fn a_device_that_reports_its_largest_range_for_nothing_is_read_as_nothing() {
    let world = room(50.0, vec![]);
    let params = LaserParams {
        no_return: NoReturn::RangeMax,
        ..bare()
    };
    let scanner = scanner(params);
    let pose = Pose2::new(30.0, 0.0, 0.0);
    let scan = scanner.scan(&world, &pose, 0.0, &mut rng());
    let told: Vec<f64> = scan.ranges.clone();
    assert!(told.iter().all(|range| *range <= 30.0));
    let nothing = told.iter().filter(|range| **range == 30.0).count();
    assert!(nothing > 300);
    for (i, range) in told.iter().enumerate() {
        assert_eq!(scanner.is_return(*range), *range < 30.0);
        assert_eq!(
            scanner.hit_point(&scan, i, &pose, 0.0).is_some(),
            *range < 30.0
        );
    }
}

#[test]
fn refuses_a_laser_without_beams_and_one_inside_the_bike() {
    let none = LaserParams {
        beams: 0,
        ..LaserParams::default()
    };
    assert_eq!(LaserScanner::new(&none), Err(DynamicsError::NoBeams));
    let bike = BikeParams::default();
    let at = |mount_x, mount_y, mount_z| {
        let params = LaserParams {
            mount_x,
            mount_y,
            mount_z,
            ..LaserParams::default()
        };
        match params.check_mount(&bike) {
            Ok(()) => "",
            Err(DynamicsError::LaserInside { part, .. }) => part,
            Err(other) => panic!("{other}"),
        }
    };
    // Above the front hub, inside the planning outline: fine. So are a mast, a mount beside a wheel and the ground.
    assert_eq!(at(1.2, 0.0, 0.7), "");
    assert_eq!(at(0.3, 0.0, 1.2), "");
    assert_eq!(at(1.12, 0.1, 0.3), "");
    assert_eq!(at(0.0, 0.0, 0.0), "");
    assert_eq!(at(0.1, 0.0, 0.4), "the rear wheel");
    assert_eq!(at(1.2, 0.01, 0.3), "the front wheel");
    assert_eq!(at(0.48, 0.0, 0.5), "the frame");
    assert_eq!(at(0.48, 0.2, 0.5), "");
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
    let mut hits = 0;
    for i in 0..scan.ranges.len() {
        let Some(point) = scanner.hit(&scan, i, &pose, roll) else {
            continue;
        };
        hits += 1;
        let on_disc = ((point.xy() - center).norm() - 2.0).abs() < EXACT;
        let on_wall = (point.x.abs().max(point.y.abs()) - 15.0).abs() < EXACT;
        let on_ground = point.z.abs() < EXACT;
        assert!(on_disc || on_wall || on_ground, "beam {i} at {point}");
        assert!((-EXACT..=HEIGHT).contains(&point.z), "beam {i} at {point}");
        let over_ground = scanner.hit_point(&scan, i, &pose, roll).unwrap();
        assert_eq!(over_ground, point.xy());
    }
    assert!(hits > 500, "{hits}");
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
