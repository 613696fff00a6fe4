//! Where things lie, by the plane model and by the message.

use super::super::event::{BikeGeometry, CellState, GridSample, StateSample};
use super::frames::{BALANCER, FORK, handlebar_angle};
use super::scenes::offset_polyline;
use super::*;
use foxglove::messages::FrameTransform;
use std::f64::consts::FRAC_PI_2;

fn rotate(q: &Quaternion, v: [f64; 3]) -> [f64; 3] {
    let q =
        nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q.w, q.x, q.y, q.z));
    let v = q * nalgebra::Vector3::from(v);
    [v.x, v.y, v.z]
}

fn close(a: [f64; 3], b: [f64; 3]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
}

#[test]
fn a_point_of_the_body_lies_where_the_plane_model_puts_it() {
    // dynamics-and-control §1: at height h, Y = -h sin(roll), Z = h cos(roll).
    let (yaw, roll, height) = (0.7, 0.2, 0.52);
    let [x, y, z] = rotate(&turn(yaw, roll), [0.0, 0.0, height]);
    let left = -height * roll.sin();
    assert!(close(
        [x, y, z],
        [-yaw.sin() * left, yaw.cos() * left, height * roll.cos()]
    ));
    let forward = rotate(&turn(yaw, roll), [1.0, 0.0, 0.0]);
    assert!(close(forward, [yaw.cos(), yaw.sin(), 0.0]));
}

#[test]
fn the_fork_of_a_leaning_bike_points_along_the_wheels_track() {
    // Turned about the leaning vertical, the wheel's axis of travel must have the
    // ground direction of the ground-projected steering angle.
    let (roll, steer) = (0.3f64, 0.5f64);
    let [x, y, z] = rotate(&turn(handlebar_angle(steer, roll), 0.0), [1.0, 0.0, 0.0]);
    let [x, y, z] = rotate(&turn(0.0, roll), [x, y, z]);
    // The wheel's plane meets the ground along the cross product of its axle with z.
    let axle = rotate(
        &turn(0.0, roll),
        rotate(&turn(handlebar_angle(steer, roll), 0.0), [0.0, 1.0, 0.0]),
    );
    assert!((axle[0] * x + axle[1] * y + axle[2] * z).abs() < 1e-12);
    let track = [axle[1], -axle[0]];
    assert!(((track[1]).atan2(track[0]) - steer).abs() < 1e-12);
}

#[test]
fn frames_hang_together_from_the_map() {
    let bike = BikeGeometry {
        wheelbase: 1.12,
        wheel_radius: 0.33,
        pivot_x: 0.3,
        pivot_height: 0.8,
        laser_position: [0.9, 0.0, 0.6],
        laser_yaw: 0.1,
        laser_pitch: 0.0,
        laser_is_level: false,
        footprint: Vec::new(),
    };
    let sent = frames(SimTime::ZERO, &StateSample::default(), &bike);
    let names: Vec<_> = sent
        .transforms
        .iter()
        .map(|it| (it.parent_frame_id.as_str(), it.child_frame_id.as_str()))
        .collect();
    assert_eq!(
        names,
        [(MAP, BASE), (BASE, LASER), (BASE, FORK), (BASE, BALANCER)]
    );
}

#[test]
fn beams_in_the_frame_of_the_laser_lie_where_the_scanner_fires_them() {
    let pose = bikebot_geometry::Pose2::new(2.0, -1.0, 0.6);
    let state = StateSample {
        x_m: 2.0,
        y_m: -1.0,
        heading_rad: 0.6,
        roll_rad: 0.2,
        ..StateSample::default()
    };
    for tilts_with_roll in [true, false] {
        let params = bikebot_dynamics::LaserParams {
            mount_y: 0.1,
            mount_yaw_deg: 20.0,
            mount_pitch_deg: 5.0,
            tilts_with_roll,
            ..bikebot_dynamics::LaserParams::default()
        };
        let scanner = bikebot_dynamics::LaserScanner::new(&params).unwrap();
        let bike = BikeGeometry {
            wheelbase: 1.12,
            wheel_radius: 0.33,
            pivot_x: 0.3,
            pivot_height: 0.8,
            laser_position: [params.mount_x, params.mount_y, params.mount_z],
            laser_yaw: params.mount_yaw_deg.to_radians(),
            laser_pitch: params.mount_pitch_deg.to_radians(),
            laser_is_level: !tilts_with_roll,
            footprint: Vec::new(),
        };
        let sent = frames(SimTime::ZERO, &state, &bike);
        let place = |frame: &FrameTransform, at: [f64; 3]| {
            let from = frame.translation.as_ref().unwrap();
            let [x, y, z] = rotate(frame.rotation.as_ref().unwrap(), at);
            [from.x + x, from.y + y, from.z + z]
        };
        for angle in [-2.0_f64, 0.0, 1.2] {
            let at = [3.0 * angle.cos(), 3.0 * angle.sin(), 0.0];
            let at = place(&sent.transforms[0], place(&sent.transforms[1], at));
            let expected = scanner.ray(angle, &pose, 0.2).at(3.0);
            assert!(close(at, [expected.x, expected.y, expected.z]), "{angle}");
        }
    }
}

#[test]
fn the_map_keeps_its_rows_from_below_and_its_yaw() {
    let cells = [
        CellState::Free,
        CellState::Occupied,
        CellState::Unknown,
        CellState::Free,
        CellState::Free,
        CellState::Occupied,
    ];
    let map = GridSample {
        width: 3,
        height: 2,
        resolution: 0.5,
        origin: [1.0, -2.0],
        yaw: FRAC_PI_2,
        cells: &cells,
    };
    let numbers = map_occupancy(SimTime::ZERO, &map);
    assert_eq!(&numbers.data[..], [0, 100, 255, 0, 0, 100]);
    assert_eq!((numbers.column_count, numbers.row_stride), (3, 3));
    let colours = map_colour(SimTime::ZERO, &map);
    assert_eq!((colours.row_stride, colours.cell_stride), (12, 4));
    assert_eq!(&colours.data[4..8], [40, 40, 48, 255]);
    let corner = colours.pose.unwrap();
    let along = rotate(&corner.orientation.unwrap(), [1.0, 0.0, 0.0]);
    assert!(close(along, [0.0, 1.0, 0.0]));
}

#[test]
fn the_corridor_keeps_its_distance_from_a_bent_guide() {
    let guide = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]];
    let left = offset_polyline(&guide, 0.5);
    let expected = [[0.0, 0.5], [3.5, 0.5], [3.5, 3.0]];
    for (got, want) in left.iter().zip(expected) {
        assert!((got[0] - want[0]).hypot(got[1] - want[1]) < 1e-12);
    }
    assert!(offset_polyline(&guide[..1], 0.5).is_empty());
    assert!(offset_polyline(&[], 0.5).is_empty());
}

#[test]
fn an_absent_quantity_is_left_out_of_the_joints() {
    let bike = BikeGeometry {
        wheelbase: 1.0,
        wheel_radius: 0.5,
        pivot_x: 0.0,
        pivot_height: 0.0,
        laser_position: [0.0; 3],
        laser_yaw: 0.0,
        laser_pitch: 0.0,
        laser_is_level: false,
        footprint: Vec::new(),
    };
    let state = StateSample {
        speed_mps: 2.0,
        ..StateSample::default()
    };
    let sent = joints(SimTime::ZERO, &state, &bike);
    assert_eq!(sent.joints[2].velocity, Some(4.0));
    assert_eq!(sent.joints[2].position, None);
    assert_eq!(sent.joints[0].position, None);
}
