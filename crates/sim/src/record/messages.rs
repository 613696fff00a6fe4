//! What is on the wire: topics, their schemas, and events turned into messages.
//!
//! Well-known Foxglove messages where one fits, so that viewers draw them unasked;
//! flat messages of our own where numbers are all there is. Units are SI.

mod bike_model;
mod frames;
mod grids;
mod scenes;
#[cfg(test)]
mod tests;
mod topic;

use foxglove::messages::{LaserScan, Log, Pose, PosesInFrame, Quaternion, Timestamp, Vector3, log};

pub(super) use bike_model::bike_model;
pub(super) use frames::{bike_pose, frames, joints};
pub(super) use grids::{map_colour, map_occupancy};
pub(super) use scenes::{MOVING, STANDING, followed_scene, footprint, obstacles, plan_scene};
pub(super) use topic::{RunEvent, Topic, path_table};

use super::event::{LogLevel, PathSample, ScanSample};
use crate::clock::SimTime;

/// The fixed frame of the world.
pub(super) const MAP: &str = "map";
/// The bike's own frame, at the rear contact.
pub(super) const BASE: &str = "base_link";
/// The frame of the laser.
pub(super) const LASER: &str = "laser";

/// Lines on the ground are drawn this far above it, m, so that the map does not hide them.
const ABOVE_GROUND: f64 = 0.02;

pub(super) fn timestamp(time: SimTime) -> Timestamp {
    let nanoseconds = time.nanoseconds();
    // The message counts 136 years; a simulation ends before that.
    let seconds = u32::try_from(nanoseconds / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new(seconds, (nanoseconds % 1_000_000_000) as u32)
}

fn vector(x: f64, y: f64, z: f64) -> Vector3 {
    Vector3 { x, y, z }
}

/// Turn about z by `yaw`, then about the turned x by `roll`.
fn turn(yaw: f64, roll: f64) -> Quaternion {
    let (sin_yaw, cos_yaw) = (0.5 * yaw).sin_cos();
    let (sin_roll, cos_roll) = (0.5 * roll).sin_cos();
    Quaternion {
        x: cos_yaw * sin_roll,
        y: sin_yaw * sin_roll,
        z: sin_yaw * cos_roll,
        w: cos_yaw * cos_roll,
    }
}

fn pose(position: Vector3, orientation: Quaternion) -> Pose {
    Pose {
        position: Some(position),
        orientation: Some(orientation),
    }
}

pub(super) fn plan_path(time: SimTime, path: &[PathSample]) -> PosesInFrame {
    PosesInFrame {
        timestamp: Some(timestamp(time)),
        frame_id: MAP.to_owned(),
        poses: path
            .iter()
            .map(|it| pose(vector(it.x, it.y, ABOVE_GROUND), turn(it.heading, 0.0)))
            .collect(),
    }
}

pub(super) fn scan(scan: &ScanSample<'_>) -> LaserScan {
    let steps = scan.ranges.len().saturating_sub(1) as f64;
    LaserScan {
        timestamp: Some(timestamp(scan.stamp)),
        frame_id: LASER.to_owned(),
        pose: Some(pose(vector(0.0, 0.0, 0.0), turn(0.0, 0.0))),
        start_angle: scan.start_angle,
        end_angle: scan.start_angle + scan.angle_step * steps,
        ranges: scan.ranges.to_vec(),
        intensities: Vec::new(),
    }
}

pub(super) fn log_line(time: SimTime, level: LogLevel, text: &str) -> Log {
    let level = match level {
        LogLevel::Debug => log::Level::Debug,
        LogLevel::Info => log::Level::Info,
        LogLevel::Warning => log::Level::Warning,
        LogLevel::Error => log::Level::Error,
    };
    Log {
        timestamp: Some(timestamp(time)),
        level: level as i32,
        message: text.to_owned(),
        name: "bikebot".to_owned(),
        file: String::new(),
        line: 0,
    }
}
