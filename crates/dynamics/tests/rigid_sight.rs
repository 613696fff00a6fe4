//! Rays against Rapier's bodies and rays through the plane world have to meet the same things.
#![cfg(feature = "rapier")]

use bikebot_dynamics::laser::{Prisms, Ray, RayScene};
use bikebot_dynamics::rigid::{RigidBike, RigidStep};
use bikebot_dynamics::{
    BikeParams, BikeState, LaserParams, LaserScanner, Offset, SteeringGeometry,
};
use bikebot_geometry::{Point2, Pose2};
use bikebot_world::{Bounds, Cell, Footprint, Obstacle, OccupancyGrid, World};

/// How far the two may differ, m: the engine finds a cylinder's surface by iteration.
const AGREE: f64 = 1e-6;
const RANGE_MAX: f64 = 30.0;

fn bike_at(pose: Pose2) -> RigidBike {
    let state = BikeState {
        pose,
        steer: 0.0,
        roll: 0.0,
        balancer: 0.0,
        speed: 1.0,
        roll_rate: 0.0,
        balancer_rate: 0.0,
    };
    RigidBike::new(
        &BikeParams::default(),
        SteeringGeometry::Matched,
        &state,
        &Offset::fixed(0.0),
        RigidStep::default(),
    )
    .expect("the default bike")
}

fn yard() -> World {
    let ring = [
        (-6.0, 2.0),
        (-3.0, 2.0),
        (-3.0, 5.0),
        (-4.0, 3.0),
        (-5.5, 6.0),
    ];
    let obstacles = vec![
        Obstacle::Disc {
            center: Point2::new(4.0, 1.0),
            radius: 0.8,
        },
        Obstacle::Disc {
            center: Point2::new(-2.0, -6.0),
            radius: 0.15,
        },
        Obstacle::Block {
            min: Point2::new(2.0, -5.0),
            max: Point2::new(3.5, -2.0),
        },
        Obstacle::Polygon {
            vertices: ring.map(|(x, y)| Point2::new(x, y)).to_vec(),
        },
    ];
    World::new(Bounds::new(-9.0, -9.0, 9.0, 9.0), obstacles).expect("a yard")
}

fn map() -> World {
    let origin = Pose2::new(-5.0, -4.0, 0.0);
    let mut grid = OccupancyGrid::filled(100, 80, 0.1, origin, Cell::Free).expect("a grid");
    for (x0, y0, x1, y1) in [(60, 30, 70, 50), (20, 60, 50, 62), (75, 10, 80, 15)] {
        for y in y0..y1 {
            for x in x0..x1 {
                grid.set(x, y, Cell::Occupied);
            }
        }
    }
    World::from_grid(grid).expect("a map")
}

/// Every beam of scans from several places at several rolls; returns how many met something.
fn assert_agree(world: &World, height: f64, places: &[Pose2]) -> usize {
    let mut bike = bike_at(places[0]);
    bike.surround(world, &Footprint::bike(), height);
    let scanner = LaserScanner::new(&LaserParams::default()).expect("a scanner");
    let prisms = Prisms { world, height };
    let (mut met, mut differing) = (0, 0);
    for pose in places {
        for roll in [0.0, 0.05, -0.3] {
            for i in 0..360 {
                let ray: Ray = scanner.ray(f64::from(i).to_radians(), pose, roll);
                let limit = RANGE_MAX.min(ray.ground_range());
                let plane = prisms.cast(&ray, 0.0, limit);
                let bodies = bike.cast_ray(&ray, limit);
                met += usize::from(plane.is_finite());
                // A beam along a rim or over an edge may fall either way.
                let same = plane == bodies || (plane - bodies).abs() <= AGREE;
                differing += usize::from(!same);
            }
        }
    }
    assert!(differing <= 2, "{differing} beams of {met} differ");
    met
}

#[test]
fn beams_meet_rapiers_bodies_where_they_meet_the_plane_worlds_prisms() {
    let places = [
        Pose2::new(0.0, 0.0, 0.3),
        Pose2::new(6.5, 5.0, -2.0),
        Pose2::new(-7.0, -3.0, 1.0),
    ];
    assert!(assert_agree(&yard(), 2.0, &places) > 2000);
    assert!(assert_agree(&yard(), 1.1, &places) > 1500);
    let places = [Pose2::new(-2.0, 0.0, 0.3), Pose2::new(3.5, 2.0, -2.0)];
    assert!(assert_agree(&map(), 2.0, &places) > 100);
}

#[test]
fn a_moving_body_is_seen_where_it_would_be_and_touched_where_it_is() {
    let world = World::new(Bounds::new(-50.0, -50.0, 50.0, 50.0), vec![]).expect("a field");
    let mut bike = bike_at(Pose2::new(0.0, 0.0, 0.0));
    bike.surround(&world, &Footprint::bike(), 2.0);
    let outline = Obstacle::Block {
        min: Point2::new(-0.5, -0.3),
        max: Point2::new(0.5, 0.3),
    };
    bike.add_moving_obstacle(&outline, 1.5);
    let scanner = LaserScanner::new(&LaserParams::default()).expect("a scanner");
    let ray = scanner.ray(0.0, &Pose2::new(0.0, 0.0, 0.0), 0.0);
    let seen = |bike: &RigidBike, x: f64| {
        bike.cast_ray_at_moving(
            0,
            &Pose2::new(x, 0.0, 0.5 * std::f64::consts::PI),
            &ray,
            30.0,
        )
    };
    // Across the way: its near side is 0.3 m nearer, and the laser 1.2 m ahead.
    assert!((seen(&bike, 6.0) - (6.0 - 0.3 - 1.2)).abs() < AGREE);
    assert_eq!(seen(&bike, 40.0), f64::INFINITY);
    assert_eq!(
        bike.cast_ray_at_moving(7, &Pose2::new(3.0, 0.0, 0.0), &ray, 30.0),
        f64::INFINITY
    );
    // It is not there until it is put somewhere, not even where the bike is.
    for _ in 0..20 {
        bike.move_obstacles([None]);
        bike.step(&Default::default());
    }
    assert!(!bike.has_touched_an_obstacle());
    // It comes from the left at 2 m/s and meets the hull's flank, 0.3 m beside the middle, after 0.7 m.
    let mut touched = None;
    for step in 0..800 {
        let y = 2.0 - 0.002 * f64::from(step);
        bike.move_obstacles([Some(Pose2::new(0.6, y, 0.0))]);
        bike.step(&Default::default());
        if bike.has_touched_an_obstacle() {
            touched = Some(y);
            break;
        }
    }
    assert_eq!(bike.touched_moving_obstacle(), Some(0));
    let y = touched.expect("it came to the bike");
    assert!((y - 0.6).abs() < 0.02, "{y}");
}
