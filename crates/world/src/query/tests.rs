//! The closed forms against parry's own pair queries, which share no code with them.

use super::*;
use crate::Footprint;
use crate::world::World;
use bikebot_geometry::Pose2;
use parry2d_f64::math::Pose;
use parry2d_f64::query;
use parry2d_f64::shape::{Capsule, Compound, Cuboid, Segment, SharedShape};

fn p(x: f64, y: f64) -> Point2 {
    Point2::new(x, y)
}

fn to_parry(v: Point2) -> ParryVector {
    ParryVector::new(v.x, v.y)
}

fn obstacles() -> Vec<Obstacle> {
    let ring = [
        (2.0, 2.0),
        (7.0, 1.0),
        (6.0, 4.0),
        (8.0, 7.0),
        (4.5, 4.5),
        (2.5, 8.0),
    ];
    vec![
        Obstacle::Polygon {
            vertices: ring.map(|(x, y)| p(x, y)).to_vec(),
        },
        Obstacle::Disc {
            center: p(11.0, 3.0),
            radius: 1.5,
        },
        Obstacle::Block {
            min: p(10.0, 8.0),
            max: p(14.0, 9.0),
        },
    ]
}

/// The same obstacles as parry's own shapes.
fn compound() -> Compound {
    let mut parts = Vec::new();
    for obstacle in obstacles() {
        match obstacle {
            Obstacle::Polygon { vertices } => {
                for part in convex_parts(&vertices) {
                    let points = part.into_iter().map(to_parry).collect();
                    let shape = SharedShape::convex_polyline(points).expect("convex");
                    parts.push((Pose::identity(), shape));
                }
            }
            Obstacle::Disc { center, radius } => {
                parts.push((
                    Pose::translation(center.x, center.y),
                    SharedShape::ball(radius),
                ));
            }
            Obstacle::Block { min, max } => {
                let (centre, half) = (nalgebra::center(&min, &max), (max - min) / 2.0);
                parts.push((
                    Pose::translation(centre.x, centre.y),
                    SharedShape::cuboid(half.x, half.y),
                ));
            }
        }
    }
    Compound::new(parts)
}

fn far_world() -> World {
    World::new(Bounds::new(-100.0, -100.0, 100.0, 100.0), obstacles()).expect("valid")
}

fn poses() -> impl Iterator<Item = Pose2> {
    (0..3_000).map(|k| {
        let t = f64::from(k);
        // Irrational strides fill the plane evenly.
        Pose2::new(
            16.0 * (t * 0.754_877_666).fract() - 0.5,
            11.0 * (t * 0.569_840_290).fract() - 0.5,
            t * 0.37,
        )
    })
}

#[test]
fn convex_parts_fill_the_polygon_and_nothing_else() {
    let Obstacle::Polygon { vertices } = &obstacles()[0] else {
        panic!("the first obstacle is a polygon");
    };
    let area = |ring: &[Point2]| -> f64 {
        (0..ring.len())
            .map(|i| ring[i].coords.perp(&ring[(i + 1) % ring.len()].coords) / 2.0)
            .sum()
    };
    let parts = convex_parts(vertices);
    let sum: f64 = parts.iter().map(|part| area(part)).sum();
    assert!((sum - area(vertices)).abs() < 1e-12);
    for part in &parts {
        assert!(ring_edges(part, 0).count() >= 3);
        let n = part.len();
        for i in 0..n {
            let (a, b, c) = (part[i], part[(i + 1) % n], part[(i + 2) % n]);
            assert!((b - a).perp(&(c - b)) >= 0.0);
        }
    }
}

#[test]
fn point_distances_agree_with_parry_to_rounding() {
    let (world, compound) = (far_world(), compound());
    for pose in poses() {
        let found = world.clearance(pose.position);
        let oracle =
            query::PointQuery::distance_to_local_point(&compound, to_parry(pose.position), true);
        assert!((found.max(0.0) - oracle).abs() < 1e-9, "{pose:?}");
    }
}

#[test]
fn footprint_distances_and_overlaps_agree_with_parry() {
    let (world, compound) = (far_world(), compound());
    let bike = Footprint::bike();
    let cart: Footprint = "box:1.8x0.6".parse().expect("valid");
    let capsule = Capsule::new(
        ParryVector::new(-0.04, 0.0),
        ParryVector::new(1.16, 0.0),
        0.3,
    );
    let cuboid = Cuboid::new(ParryVector::new(0.9, 0.3));
    for pose in poses() {
        let at = Pose::new(to_parry(pose.position), pose.heading);
        for (footprint, shape) in [
            (&bike, &capsule as &dyn parry2d_f64::shape::Shape),
            (&cart, &cuboid),
        ] {
            let found = world.footprint_clearance(footprint, &pose);
            let oracle = query::distance(&at, shape, &Pose::identity(), &compound)
                .expect("a supported pair")
                .distance;
            // parry's iterative pairs stop at about 1e-6 m.
            assert!(
                (found.max(0.0) - oracle).abs() < 1e-5,
                "{pose:?} {found} {oracle}"
            );
            if found.abs() > 1e-5 {
                let overlap = query::intersection_test(&at, shape, &Pose::identity(), &compound)
                    .expect("a supported pair")
                    .intersecting;
                assert_eq!(overlap, world.overlaps(footprint, &pose), "{pose:?}");
            }
        }
    }
}

#[test]
fn overlap_depths_agree_with_parry_against_single_convex_shapes() {
    let block = Obstacle::Block {
        min: p(0.0, 0.0),
        max: p(3.0, 2.0),
    };
    let world = World::new(Bounds::new(-50.0, -50.0, 50.0, 50.0), vec![block]).expect("valid");
    let cart: Footprint = "box:1.8x0.6".parse().expect("valid");
    let cuboid = Cuboid::new(ParryVector::new(0.9, 0.3));
    let wall = Cuboid::new(ParryVector::new(1.5, 1.0));
    let mut compared = 0;
    for pose in poses() {
        let at = Pose::new(to_parry(pose.position), pose.heading);
        let found = world.footprint_clearance(&cart, &pose);
        if found < -1e-6 {
            let contact = query::contact(&at, &cuboid, &Pose::translation(1.5, 1.0), &wall, 0.0)
                .expect("a supported pair")
                .expect("an overlap");
            assert!(
                (found - contact.dist).abs() < 1e-5,
                "{pose:?} {found} {}",
                contact.dist
            );
            compared += 1;
        }
    }
    assert!(compared > 50);
}

#[test]
fn ranges_agree_with_parry() {
    let (world, compound) = (far_world(), compound());
    for pose in poses() {
        let direction = pose.direction();
        let ray = query::Ray::new(
            to_parry(pose.position),
            ParryVector::new(direction.x, direction.y),
        );
        let oracle = query::RayCast::cast_local_ray(&compound, &ray, 40.0, true);
        let found = world.cast_ray(pose.position, pose.heading, 40.0);
        match (found, oracle) {
            (Some(a), Some(b)) => assert!((a - b).abs() < 1e-9, "{pose:?} {a} {b}"),
            (None, None) => {}
            other => panic!("{pose:?}: {other:?}"),
        }
    }
}

#[test]
fn two_segments_on_one_line_keep_their_gap() {
    let a = [p(0.0, 0.0), p(1.0, 0.0)];
    let b = [p(3.0, 0.0), p(4.0, 0.0)];
    assert_eq!(convex_distance_squared(&a, &b), 4.0);
    assert_eq!(
        convex_distance_squared(&a, &[p(0.5, 0.0), p(2.0, 0.0)]),
        0.0
    );
    let oracle = query::distance(
        &Pose::identity(),
        &Segment::new(to_parry(a[0]), to_parry(a[1])),
        &Pose::identity(),
        &Segment::new(to_parry(b[0]), to_parry(b[1])),
    );
    assert_eq!(oracle.map(|d| (d.distance - 2.0).abs() < 1e-5), Ok(true));
}
