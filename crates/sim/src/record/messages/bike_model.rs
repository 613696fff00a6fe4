//! The bike as people know one: wheels, frame, fork, handlebar, saddle, laser and balancer, out of lines and simple bodies.
//!
//! Each part hangs in its own frame (`base_link`, `fork`, `balancer`) and is locked to it: sent once, it leans, steers and swings with
//! the transforms. The model has a vertical steering axis through the front contact, and so has the picture.

use std::f64::consts::{FRAC_PI_2, TAU};

use foxglove::messages::{
    Color, CubePrimitive, CylinderPrimitive, LinePrimitive, Point3, Pose, Quaternion, SceneEntity,
    SceneUpdate, line_primitive,
};

use super::super::event::BikeGeometry;
use super::frames::{BALANCER, FORK};
use super::{BASE, pose, timestamp, turn, vector};
use crate::clock::SimTime;

const TYRE: [f64; 4] = [0.13, 0.14, 0.16, 1.0];
const SPOKE: [f64; 4] = [0.62, 0.65, 0.68, 1.0];
const TUBE: [f64; 4] = [0.0, 0.45, 0.70, 1.0];
const BLACK: [f64; 4] = [0.10, 0.10, 0.11, 1.0];
const MASS: [f64; 4] = [0.90, 0.62, 0.0, 1.0];
const LASER_BODY: [f64; 4] = [0.84, 0.37, 0.0, 1.0];

/// Thickness of a tyre and of a tube, m.
const TYRE_WIDTH: f64 = 0.045;
const TUBE_WIDTH: f64 = 0.035;
/// Legs of a wheel's circle, and its spokes.
const CIRCLE: u32 = 40;
const SPOKES: u32 = 10;
/// The disc of the balancer, m.
const DISC_RADIUS: f64 = 0.20;

/// A place in a part's own frame, m: x forward, y left, z up.
type Place = [f64; 3];

fn color([r, g, b, a]: [f64; 4]) -> Color {
    Color { r, g, b, a }
}

fn points(places: &[Place]) -> Vec<Point3> {
    let point = |&[x, y, z]: &Place| Point3 { x, y, z };
    places.iter().map(point).collect()
}

fn lines(
    kind: line_primitive::Type,
    places: &[Place],
    width: f64,
    rgba: [f64; 4],
) -> LinePrimitive {
    LinePrimitive {
        r#type: kind as i32,
        pose: Some(pose(vector(0.0, 0.0, 0.0), turn(0.0, 0.0))),
        thickness: width,
        scale_invariant: false,
        points: points(places),
        color: Some(color(rgba)),
        ..LinePrimitive::default()
    }
}

/// Straight tubes from each place to the one after it in its pair.
fn tubes(pairs: &[[Place; 2]], width: f64, rgba: [f64; 4]) -> LinePrimitive {
    let places: Vec<Place> = pairs.iter().flatten().copied().collect();
    lines(line_primitive::Type::LineList, &places, width, rgba)
}

fn lying(at: Place, orientation: Quaternion) -> Option<Pose> {
    Some(pose(vector(at[0], at[1], at[2]), orientation))
}

/// Turns the axis of a cylinder, which stands up, to the side or forward.
fn axis(about: [f64; 2]) -> Quaternion {
    let (sin, cos) = (0.5 * FRAC_PI_2).sin_cos();
    Quaternion {
        x: sin * about[0],
        y: sin * about[1],
        z: 0.0,
        w: cos,
    }
}

fn cylinder(
    at: Place,
    orientation: Quaternion,
    diameter: f64,
    length: f64,
    rgba: [f64; 4],
) -> CylinderPrimitive {
    CylinderPrimitive {
        pose: lying(at, orientation),
        size: Some(vector(diameter, diameter, length)),
        bottom_scale: 1.0,
        top_scale: 1.0,
        color: Some(color(rgba)),
    }
}

fn cube(at: Place, size: Place, rgba: [f64; 4]) -> CubePrimitive {
    CubePrimitive {
        pose: lying(at, turn(0.0, 0.0)),
        size: Some(vector(size[0], size[1], size[2])),
        color: Some(color(rgba)),
    }
}

/// A wheel that stands on the frame's origin.
fn wheel(radius: f64, part: &mut SceneEntity) {
    let rim = radius - 0.5 * TYRE_WIDTH;
    let at = |share: f64, r: f64| {
        let (sin, cos) = (TAU * share).sin_cos();
        [r * cos, 0.0, radius + r * sin]
    };
    let circle: Vec<Place> = (0..CIRCLE)
        .map(|leg| at(f64::from(leg) / f64::from(CIRCLE), rim))
        .collect();
    let spokes: Vec<[Place; 2]> = (0..SPOKES)
        .map(|spoke| {
            [
                [0.0, 0.0, radius],
                at(f64::from(spoke) / f64::from(SPOKES), rim),
            ]
        })
        .collect();
    part.lines.push(lines(
        line_primitive::Type::LineLoop,
        &circle,
        TYRE_WIDTH,
        TYRE,
    ));
    part.lines.push(tubes(&spokes, 0.006, SPOKE));
    part.cylinders.push(cylinder(
        [0.0, 0.0, radius],
        axis([1.0, 0.0]),
        0.07,
        0.11,
        SPOKE,
    ));
}

fn part(time: SimTime, id: &str, frame: &str) -> SceneEntity {
    SceneEntity {
        timestamp: Some(timestamp(time)),
        frame_id: frame.to_owned(),
        id: id.to_owned(),
        frame_locked: true,
        ..SceneEntity::default()
    }
}

/// All parts of the bike.
pub(in crate::record) fn bike_model(time: SimTime, bike: &BikeGeometry) -> SceneUpdate {
    SceneUpdate {
        deletions: Vec::new(),
        entities: vec![
            frame_and_rear(time, bike),
            front(time, bike),
            balancer(time),
        ],
    }
}

fn frame_and_rear(time: SimTime, bike: &BikeGeometry) -> SceneEntity {
    let (base, radius) = (bike.wheelbase, bike.wheel_radius);
    let mut body = part(time, "frame", BASE);
    wheel(radius, &mut body);
    let hub = [0.0, 0.0, radius];
    let crank = [0.46 * base, 0.0, 0.85 * radius];
    let seat = [0.50 * base, 0.0, 2.35 * radius];
    let saddle = [0.51 * base, 0.0, 2.75 * radius];
    let [head_below, head_above] = [2.25, 2.75].map(|height| [base, 0.0, height * radius]);
    body.lines.push(tubes(
        &[
            [hub, crank],
            [hub, seat],
            [crank, saddle],
            [crank, head_below],
            [seat, head_above],
            [head_below, head_above],
        ],
        TUBE_WIDTH,
        TUBE,
    ));
    body.cubes.push(cube(saddle, [0.26, 0.14, 0.05], BLACK));
    body.cylinders
        .push(cylinder(crank, axis([1.0, 0.0]), 0.16, 0.05, BLACK));
    // The rack that carries the balancer's pivot.
    let pivot = [bike.pivot_x, 0.0, bike.pivot_height];
    body.lines.push(tubes(
        &[[hub, pivot], [seat, pivot]],
        0.6 * TUBE_WIDTH,
        BLACK,
    ));
    body.cylinders
        .push(cylinder(pivot, axis([0.0, 1.0]), 0.09, 0.16, BLACK));
    let laser = bike.laser_position;
    body.lines.push(tubes(
        &[[
            laser,
            [base, 0.0, laser[2].clamp(2.25 * radius, 2.75 * radius)],
        ]],
        0.02,
        BLACK,
    ));
    body.cylinders
        .push(cylinder(laser, turn(0.0, 0.0), 0.08, 0.07, LASER_BODY));
    body
}

fn front(time: SimTime, bike: &BikeGeometry) -> SceneEntity {
    let radius = bike.wheel_radius;
    let mut fork = part(time, "fork", FORK);
    wheel(radius, &mut fork);
    let crown = 2.15 * radius;
    let bar = 2.95 * radius;
    let mut legs = Vec::new();
    for side in [-1.0, 1.0] {
        legs.push([[0.0, 0.06 * side, radius], [0.0, 0.06 * side, crown]]);
    }
    legs.push([[0.0, -0.06, crown], [0.0, 0.06, crown]]);
    legs.push([[0.0, 0.0, crown], [0.0, 0.0, bar]]);
    fork.lines.push(tubes(&legs, 0.8 * TUBE_WIDTH, SPOKE));
    let grip = |side: f64| [-0.10, 0.30 * side, bar];
    let handlebar = [grip(-1.0), [0.0, -0.08, bar], [0.0, 0.08, bar], grip(1.0)];
    fork.lines.push(lines(
        line_primitive::Type::LineStrip,
        &handlebar,
        0.03,
        BLACK,
    ));
    fork
}

/// A disc about the pivot with a mass on its rim, so that one sees it turn.
fn balancer(time: SimTime) -> SceneEntity {
    let mut balancer = part(time, "balancer", BALANCER);
    balancer.cylinders.push(cylinder(
        [0.0, 0.0, 0.0],
        axis([0.0, 1.0]),
        2.0 * DISC_RADIUS,
        0.05,
        [0.55, 0.58, 0.62, 0.9],
    ));
    balancer.lines.push(tubes(
        &[[[0.0, 0.0, 0.0], [0.0, 0.0, DISC_RADIUS]]],
        0.05,
        MASS,
    ));
    balancer
        .cubes
        .push(cube([0.0, 0.0, DISC_RADIUS], [0.12, 0.12, 0.10], MASS));
    balancer
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bike() -> BikeGeometry {
        BikeGeometry {
            wheelbase: 1.12,
            wheel_radius: 0.33,
            pivot_x: 0.1,
            pivot_height: 0.95,
            laser_position: [1.2, 0.0, 0.6],
            laser_yaw: 0.0,
            laser_pitch: 0.0,
            laser_is_level: false,
            footprint: Vec::new(),
        }
    }

    #[test]
    fn each_part_is_locked_to_the_frame_that_moves_it() {
        let scene = bike_model(SimTime::ZERO, &bike());
        let frames: Vec<_> = scene
            .entities
            .iter()
            .map(|it| it.frame_id.as_str())
            .collect();
        assert_eq!(frames, [BASE, FORK, BALANCER]);
        assert!(
            scene
                .entities
                .iter()
                .all(|it| it.frame_locked && it.lifetime.is_none())
        );
        let ids: std::collections::BTreeSet<_> =
            scene.entities.iter().map(|it| it.id.as_str()).collect();
        assert_eq!(ids.len(), 3);
    }

    #[test]
    fn both_wheels_stand_on_the_ground_and_are_round() {
        let scene = bike_model(SimTime::ZERO, &bike());
        for part in &scene.entities[..2] {
            let tyre = &part.lines[0];
            let lowest = tyre
                .points
                .iter()
                .map(|it| it.z)
                .fold(f64::INFINITY, f64::min);
            assert!((lowest - 0.5 * tyre.thickness).abs() < 1e-12, "{lowest}");
            for point in &tyre.points {
                let radius = point.x.hypot(point.z - 0.33) + 0.5 * tyre.thickness;
                assert!((radius - 0.33).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn tubes_have_two_ends() {
        for part in bike_model(SimTime::ZERO, &bike()).entities {
            for line in &part.lines {
                let is_list = line.r#type == line_primitive::Type::LineList as i32;
                assert!(!is_list || line.points.len() % 2 == 0);
            }
        }
    }
}
