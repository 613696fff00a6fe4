//! Whole recordings: what stands in them, and what is left when they are broken.

mod broken;
mod hostile;
mod viewers;
mod written;

use std::collections::BTreeMap;
use std::io::Cursor;

use bikebot_geometry::Pose2;
use bikebot_world::{Cell, OccupancyGrid};

use super::scene::capsule_outline;
use super::*;
use crate::clock::{Period, SimTime};

const SCENARIO: &str = "format = 1\nname = \"test\"\n";

fn run_info() -> RunInfo {
    RunInfo {
        version: "0.1.0".to_owned(),
        scenario: "test".to_owned(),
        scenario_text: SCENARIO.to_owned(),
        seed: 7,
        overrides: vec!["run.seed=7".to_owned(), "bike.mode=\"balancer\"".to_owned()],
        files: vec![SourceFile {
            name: "maps/yard.pgm".to_owned(),
            data: b"P5\n2 1\n255\n\x00\xff".to_vec(),
        }],
        more: BTreeMap::from([("plant".to_owned(), "bike3d".to_owned())]),
    }
}

fn result_info() -> ResultInfo {
    ResultInfo {
        outcome: "arrived".to_owned(),
        reason: "goal".to_owned(),
        result_hash: "00ff".to_owned(),
        metrics: BTreeMap::from([("distance_m".to_owned(), 0.1 + 0.2)]),
        expect: vec![("outcome".to_owned(), true)],
        host: BTreeMap::new(),
    }
}

fn bike() -> BikeGeometry {
    BikeGeometry {
        wheelbase: 1.12,
        wheel_radius: 0.33,
        pivot_x: 0.3,
        pivot_height: 0.8,
        laser_position: [0.9, 0.0, 0.6],
        laser_yaw: 0.0,
        laser_pitch: 0.0,
        laser_is_level: false,
        footprint: capsule_outline(-0.04, 1.16, 0.3),
    }
}

fn plan_path() -> Vec<PathSample> {
    (0..=40)
        .map(|i| {
            let s = 0.2 * f64::from(i);
            PathSample {
                x: 1.0 + s,
                y: 1.0,
                heading: 0.0,
                curvature: 0.01 * s,
                s,
                speed: 1.5,
            }
        })
        .collect()
}

fn state_at(time: SimTime) -> StateSample {
    let t = time.seconds();
    StateSample {
        x_m: 1.0 + t,
        y_m: 1.0 + 0.01 * t.sin(),
        heading_rad: 0.01 * t.cos(),
        steer_rad: 0.05 * t.sin(),
        roll_rad: 0.02 * (3.0 * t).sin(),
        balancer_rad: 0.3 * (3.0 * t).cos(),
        speed_mps: 1.0,
        distance_m: t,
        clearance_m: 0.4,
        ..StateSample::default()
    }
}

/// Rides for so many seconds at 200 Hz and tells the recorder of everything.
fn ride(recorder: &mut dyn Recorder, seconds: f64) -> Result<(), RecordError> {
    let tick = Period::from_seconds(0.005).unwrap();
    let scan_period = Period::from_hertz(10.0).unwrap();
    let shapes = [
        Shape::Disc {
            center: [5.0, 5.0],
            radius: 1.0,
        },
        Shape::Polygon {
            vertices: vec![[7.0, 2.0], [9.0, 2.0], [8.0, 4.0]],
        },
        Shape::Block {
            min: [1.0, 7.0],
            max: [3.0, 8.0],
        },
    ];
    let path = plan_path();
    let start = SimTime::ZERO;
    recorder.record(start, &Event::Bike(&bike()))?;
    recorder.record(
        start,
        &Event::Map(MapEvent {
            bounds: [[0.0; 2], [2.5, 2.0]],
            shapes: &shapes,
            grid: None,
        }),
    )?;
    recorder.record(
        start,
        &Event::Plan(PlanEvent {
            path: &path,
            tree: &[[[1.0, 1.0], [2.0, 1.5]], [[2.0, 1.5], [3.0, 0.0]]],
            coarse: &[[1.0, 1.0], [9.0, 1.0]],
            guide: &[[1.0, 1.0], [5.0, 0.0], [9.0, 1.0]],
            corridor_half_width: Some(0.75),
            goal: Some(GoalSample {
                position: [9.0, 1.0],
                heading: Some(0.1),
                tolerance: 0.3,
            }),
        }),
    )?;
    recorder.record(
        start,
        &Event::Attachment {
            name: "plan.json",
            media_type: "application/json",
            data: b"{\"outcome\": \"found\"}",
        },
    )?;
    recorder.record(start, &Event::FollowedPath(&path))?;
    let corner = Pose2::new(-1.0, 2.0, 0.0);
    let mut belief = OccupancyGrid::filled(3, 2, 0.5, corner, Cell::Unknown).unwrap();
    belief.set(0, 0, Cell::Free);
    belief.set(2, 0, Cell::Occupied);
    for step in 0.. {
        let time = tick.times(step);
        if time > SimTime::from_seconds(seconds) {
            break;
        }
        // The laser looks before the state is recorded, as a loop may have it.
        if scan_period.is_due(time) {
            let ranges: Vec<f64> = (0..181)
                .map(|beam| {
                    if beam % 9 == 0 {
                        f64::INFINITY
                    } else {
                        2.0 + 0.01 * f64::from(beam)
                    }
                })
                .collect();
            let scan = ScanSample {
                stamp: time,
                start_angle: -1.5,
                angle_step: 3.0 / 180.0,
                ranges: &ranges,
            };
            recorder.record(time, &Event::Scan(scan))?;
        }
        let state = state_at(time);
        recorder.record(time, &Event::State(&state))?;
        let control = ControlSample {
            lateral_error_m: 0.001 * time.seconds(),
            phase: RidePhase::Cruise,
            ..ControlSample::default()
        };
        recorder.record(time, &Event::Control(&control))?;
        recorder.record(time, &Event::Belief(&belief))?;
        let shape = Shape::Disc {
            center: [4.0, time.seconds()],
            radius: 0.2,
        };
        recorder.record(time, &Event::MovingObstacles(&[shape]))?;
        if step == 100 {
            recorder.record(
                time,
                &Event::Log {
                    level: LogLevel::Warning,
                    text: "careful",
                },
            )?;
            recorder.record(
                time,
                &Event::Notice {
                    kind: NoticeKind::Saturated,
                    text: "balancer",
                    value: 70.0,
                },
            )?;
        }
    }
    Ok(())
}

fn recording(seconds: f64) -> Vec<u8> {
    let output = Cursor::new(Vec::new());
    let mut recorder = McapRecorder::begin(output, &run_info(), &RecordOptions::default()).unwrap();
    ride(&mut recorder, seconds).unwrap();
    recorder.finish(&result_info()).unwrap();
    recorder.finish(&result_info()).unwrap();
    let count = recorder.bytes_written();
    let bytes = recorder.into_inner().into_inner();
    assert_eq!(count, bytes.len() as u64);
    bytes
}
