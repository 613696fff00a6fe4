//! Where the bike and its parts are: frames, pose, joints.

use foxglove::messages::{
    FrameTransform, FrameTransforms, JointState, JointStates, PoseInFrame, Quaternion,
};

use super::super::event::{BikeGeometry, StateSample};
use super::{BASE, LASER, MAP, pose, timestamp, turn, vector};
use crate::clock::SimTime;

/// The frame of the steered front end.
pub(super) const FORK: &str = "fork";

/// The frame of the balancer.
pub(super) const BALANCER: &str = "balancer";

/// Turn about z by `yaw`, then about the turned y by `pitch`, nose down.
fn yaw_and_pitch(yaw: f64, pitch: f64) -> Quaternion {
    let (sin_yaw, cos_yaw) = (0.5 * yaw).sin_cos();
    let (sin_pitch, cos_pitch) = (0.5 * pitch).sin_cos();
    Quaternion {
        x: -sin_yaw * sin_pitch,
        y: cos_yaw * sin_pitch,
        z: sin_yaw * cos_pitch,
        w: cos_yaw * cos_pitch,
    }
}

/// First turned by `b` in the frame that `a` has turned.
fn product(a: &Quaternion, b: &Quaternion) -> Quaternion {
    Quaternion {
        x: a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        y: a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        z: a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        w: a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    }
}

/// The angle of the handlebar about the body's own vertical.
///
/// `steer` is the angle between the wheels' tracks on the ground; the fork turns
/// about an axis that leans with the body: `tan psi_h = tan psi cos alpha`.
pub(super) fn handlebar_angle(steer: f64, roll: f64) -> f64 {
    (steer.tan() * roll.cos()).atan()
}

/// map → base_link → {laser, fork, balancer}.
pub(in crate::record) fn frames(
    time: SimTime,
    state: &StateSample,
    bike: &BikeGeometry,
) -> FrameTransforms {
    let frame = |parent: &str, child: &str, translation, rotation| FrameTransform {
        timestamp: Some(timestamp(time)),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(translation),
        rotation: Some(rotation),
    };
    let [x, y, z] = bike.laser_position;
    let on_mount = yaw_and_pitch(bike.laser_yaw, bike.laser_pitch);
    let laser = if bike.laser_is_level {
        product(&turn(0.0, -state.roll_rad), &on_mount)
    } else {
        on_mount
    };
    let fork = handlebar_angle(state.steer_rad, state.roll_rad);
    FrameTransforms {
        transforms: vec![
            frame(
                MAP,
                BASE,
                vector(state.x_m, state.y_m, 0.0),
                turn(state.heading_rad, state.roll_rad),
            ),
            frame(BASE, LASER, vector(x, y, z), laser),
            frame(
                BASE,
                FORK,
                vector(bike.wheelbase, 0.0, 0.0),
                turn(fork, 0.0),
            ),
            frame(
                BASE,
                BALANCER,
                vector(bike.pivot_x, 0.0, bike.pivot_height),
                turn(0.0, state.balancer_rad),
            ),
        ],
    }
}

pub(in crate::record) fn bike_pose(time: SimTime, state: &StateSample) -> PoseInFrame {
    PoseInFrame {
        timestamp: Some(timestamp(time)),
        frame_id: MAP.to_owned(),
        pose: Some(pose(
            vector(state.x_m, state.y_m, 0.0),
            turn(state.heading_rad, 0.0),
        )),
    }
}

pub(in crate::record) fn joints(
    time: SimTime,
    state: &StateSample,
    bike: &BikeGeometry,
) -> JointStates {
    // An absent quantity is left out, as the schema provides.
    let known = |value: f64| value.is_finite().then_some(value);
    let joint =
        |name: &str, position: f64, velocity: f64, acceleration: f64, effort: f64| JointState {
            name: name.to_owned(),
            position: known(position),
            velocity: known(velocity),
            acceleration: known(acceleration),
            effort: known(effort),
        };
    let radius = bike.wheel_radius;
    let absent = f64::NAN;
    JointStates {
        timestamp: Some(timestamp(time)),
        joints: vec![
            joint(
                "steer",
                state.steer_rad,
                state.steer_rate_radps,
                absent,
                absent,
            ),
            joint(
                "balancer",
                state.balancer_rad,
                state.balancer_rate_radps,
                state.balancer_acceleration_radps2,
                state.balancer_torque_nm,
            ),
            joint(
                "rear_wheel",
                state.distance_m / radius,
                state.speed_mps / radius,
                state.acceleration_mps2 / radius,
                state.drive_force_n * radius,
            ),
            // The front contact runs along the steered wheel without slip; how far it
            // has come depends on the way taken, which the state does not keep.
            joint(
                "front_wheel",
                absent,
                state.speed_mps / (radius * state.steer_rad.cos()),
                absent,
                absent,
            ),
        ],
    }
}
