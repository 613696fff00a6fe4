//! Traffic against closed forms and against a map that shows the same.

use super::*;
use crate::scenario::ObstacleSection;
use bikebot_geometry::Vector2;
use proptest::prelude::*;

/// Agreement with closed forms, m: rounding of lengths below 100 m in two frames.
const EXACT: f64 = 1e-9;

fn section(text: &str) -> ObstacleSection {
    toml::from_str(text).expect("a section")
}

fn obstacle(outline: Obstacle, height: f64, text: &str) -> MovingObstacle {
    let faces_ahead = !matches!(outline, Obstacle::Disc { .. });
    let itinerary = Itinerary::new(&section(text), faces_ahead);
    MovingObstacle::new(outline, height, itinerary).expect("an obstacle")
}

fn disc(radius: f64, text: &str) -> MovingObstacle {
    let center = Point2::origin();
    obstacle(Obstacle::Disc { center, radius }, 2.0, text)
}

fn block(length: f64, width: f64, text: &str) -> MovingObstacle {
    let half = Vector2::new(0.5 * length, 0.5 * width);
    let outline = Obstacle::Block {
        min: Point2::origin() - half,
        max: Point2::origin() + half,
    };
    obstacle(outline, 2.0, text)
}

fn hook(text: &str) -> MovingObstacle {
    let vertices = [
        (-0.5, -0.4),
        (1.0, -0.4),
        (1.0, 0.0),
        (0.1, 0.1),
        (0.1, 0.9),
        (-0.5, 0.9),
    ]
    .map(|(x, y)| Point2::new(x, y))
    .to_vec();
    obstacle(Obstacle::Polygon { vertices }, 2.0, text)
}

fn level(x: f64, y: f64, angle: f64) -> Ray {
    Ray {
        origin: Point3::new(x, y, 0.7),
        direction: Vector3::new(angle.cos(), angle.sin(), 0.0),
    }
}

#[test]
fn a_disc_that_walks_by_is_as_far_as_the_closed_form_says() {
    let walker = disc(
        0.3,
        "shape = \"disc:0.3\"\nwaypoints_m = [[5, -3], [5, 3]]\nspeed_mps = 1.5\nappear_s = 1",
    );
    let bike = Footprint::bike();
    let pose = Pose2::new(1.0, 0.5, 0.3);
    assert_eq!(walker.clearance(&bike, &pose, 0.5), f64::INFINITY);
    for i in 0..200 {
        let time = 1.0 + 0.02 * f64::from(i);
        let center = Point2::new(5.0, -3.0 + 1.5 * (time - 1.0));
        // The bike is a capsule about an axis from −0.04 to 1.16 m.
        let local = pose.inverse().transform(center);
        let axis = Point2::new(local.x.clamp(-0.04, 1.16), 0.0);
        let expected = (local - axis).norm() - 0.3 - 0.3;
        let clearance = walker.clearance(&bike, &pose, time);
        assert!((clearance - expected).abs() < EXACT, "{time}: {clearance}");
        assert!(walker.least_clearance(&bike, &pose, time) <= clearance);
        // A beam at its middle meets its rim.
        let to = center - pose.position;
        let ray = level(1.0, 0.5, to.y.atan2(to.x));
        let range = walker.cast(&ray, time, 30.0);
        assert!((range - (to.norm() - 0.3)).abs() < EXACT, "{time}: {range}");
        assert_eq!(walker.cast(&ray, time, 0.9 * range), f64::INFINITY);
    }
}

#[test]
fn a_low_obstacle_is_seen_only_by_beams_that_come_down_to_it() {
    let center = Point2::origin();
    let outline = Obstacle::Disc {
        center,
        radius: 0.5,
    };
    let low = obstacle(
        outline,
        0.4,
        "shape = \"disc:0.5\"\nwaypoints_m = [[6, 0]]\nhidden = true",
    );
    assert_eq!(low.cast(&level(0.0, 0.0, 0.0), 0.0, 30.0), f64::INFINITY);
    // From 0.7 m down to 0.4 m at 6 m: onto its top.
    let slope = -0.3 / 6.0;
    let direction = Vector3::new(1.0, 0.0, slope).normalize();
    let down = Ray {
        origin: Point3::new(0.0, 0.0, 0.7),
        direction,
    };
    let range = low.cast(&down, 0.0, 30.0);
    assert!((down.at(range) - Point3::new(6.0, 0.0, 0.4)).norm() < EXACT);
    // Steeper, against its side at 5.5 m.
    let direction = Vector3::new(1.0, 0.0, -0.1).normalize();
    let down = Ray { direction, ..down };
    let range = low.cast(&down, 0.0, 30.0);
    assert!((down.at(range) - Point3::new(5.5, 0.0, 0.15)).norm() < EXACT);
}

#[test]
fn the_nearest_of_several_is_named_and_what_is_not_there_is_not() {
    let mut traffic = Traffic::default();
    traffic.push(
        4,
        disc(
            0.3,
            "shape = \"disc:0.3\"\nwaypoints_m = [[9, 0]]\nhidden = true",
        ),
    );
    traffic.push(
        7,
        block(
            1.0,
            0.6,
            "shape = \"box:1.0x0.6\"\nwaypoints_m = [[4, 0]]\nappear_s = 2",
        ),
    );
    let (bike, pose) = (Footprint::bike(), Pose2::new(0.0, 0.0, 0.0));
    let (index, clearance) = traffic.nearest(&bike, &pose, 0.0, f64::INFINITY).unwrap();
    assert_eq!(traffic.number(index), Some(4));
    assert!((clearance - (9.0 - 0.3 - 1.46)).abs() < EXACT);
    let (index, clearance) = traffic.nearest(&bike, &pose, 2.0, f64::INFINITY).unwrap();
    assert_eq!(traffic.number(index), Some(7));
    assert!((clearance - (3.5 - 1.46)).abs() < EXACT);
    assert_eq!(traffic.nearest(&bike, &pose, 2.0, 1.0), None);
    assert_eq!(traffic.shapes(0.0).len(), 1);
    assert_eq!(traffic.shapes(2.0).len(), 2);
    let ahead = level(1.2, 0.0, 0.0);
    assert!((traffic.cast(&ahead, 0.0, 30.0) - (9.0 - 0.3 - 1.2)).abs() < EXACT);
    assert!((traffic.cast(&ahead, 2.0, 30.0) - (3.5 - 1.2)).abs() < EXACT);
    // Kilometres away it is no nearer than this.
    let far = Pose2::new(3e4, 0.0, 0.0);
    let away = traffic.clearance(&bike, &far, 2.0);
    assert!(away > 2.999e4 - 10.0 && away < 3e4);
}

proptest! {
    /// A thing on its way is, at each moment, what a map that shows it there would be.
    #[test]
    fn distances_and_rays_are_those_of_a_map_of_the_moment(
        kind in 0..3,
        time in 0.0..20.0_f64,
        (x, y, heading) in (-6.0..6.0_f64, -6.0..6.0_f64, -3.1..3.1_f64),
        roll in -0.3..0.3_f64,
    ) {
        let text = "shape = \"disc:1\"\nwaypoints_m = [[-3, 1], [2, 2], [1, -3]]\nrepeat = \"loop\"";
        let moving = match kind {
            0 => disc(0.7, text),
            1 => block(1.4, 0.5, text),
            _ => hook(text),
        };
        let outline = moving.outline_at(time).unwrap();
        let map = World::new(Bounds::new(-500.0, -500.0, 500.0, 500.0), vec![outline]).unwrap();
        let (pose, bike) = (Pose2::new(x, y, heading), Footprint::bike());
        let clearance = moving.clearance(&bike, &pose, time);
        prop_assert!((clearance - map.footprint_clearance(&bike, &pose)).abs() < EXACT);
        prop_assert!(moving.least_clearance(&bike, &pose, time) <= clearance + EXACT);
        let scanner = bikebot_dynamics::LaserScanner::new(&Default::default()).unwrap();
        let prisms = Prisms { world: &map, height: 2.0 };
        for i in 0..64 {
            let ray = scanner.ray(std::f64::consts::TAU * f64::from(i) / 64.0, &pose, roll);
            let (own, shown) = (moving.cast(&ray, time, 30.0), prisms.cast(&ray, time, 30.0));
            // A beam along the rim may fall either way: where it does, the rim is that near.
            let near = |range: f64| {
                let point = ray.at(range);
                map.clearance(Point2::new(point.x, point.y)).abs() < EXACT
            };
            prop_assert!(
                own == shown || (own - shown).abs() < EXACT
                    || (own.is_finite() && near(own)) || (shown.is_finite() && near(shown)),
                "{own} {shown}"
            );
        }
    }
}

#[test]
fn an_outline_is_turned_and_carried_with_its_area() {
    let pose = Pose2::new(3.0, -2.0, 0.7);
    let turned = placed(
        &Obstacle::Block {
            min: Point2::new(-1.0, -0.5),
            max: Point2::new(2.0, 0.5),
        },
        &pose,
    );
    let world = World::new(Bounds::new(-50.0, -50.0, 50.0, 50.0), vec![turned]).unwrap();
    for (local, expected) in [((0.5, 0.0), -0.5), ((2.5, 0.0), 0.5), ((0.0, 1.5), 1.0)] {
        let at = pose.transform(Point2::new(local.0, local.1));
        assert!((world.clearance(at) - expected).abs() < EXACT);
    }
}
