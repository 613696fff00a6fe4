//! Whole recordings: what stands in them, and what is left when they are broken.

use std::collections::BTreeMap;
use std::io::{self, Cursor, Seek, SeekFrom, Write};

use bikebot_geometry::Pose2;
use bikebot_world::{Cell, OccupancyGrid};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::log::{LogError, check, inspect, read_attachment, read_run, read_trace, recover};
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

#[test]
fn every_topic_has_the_promised_schema_and_rate() {
    let bytes = recording(3.0);
    let promised = [
        ("/tf", "foxglove.FrameTransforms", 301),
        ("/map", "foxglove.Grid", 1),
        ("/map/occupancy", "foxglove.Grid", 1),
        ("/plan/path", "foxglove.PosesInFrame", 1),
        ("/plan/scene", "foxglove.SceneUpdate", 2),
        ("/plan/samples", "pathtable.PathTable", 1),
        ("/plan/followed", "pathtable.PathTable", 1),
        ("/bike/pose", "foxglove.PoseInFrame", 151),
        ("/bike/joints", "foxglove.JointStates", 301),
        ("/bike/state", "bikestate.BikeState", 301),
        ("/control/debug", "controldebug.ControlDebug", 301),
        ("/bike/footprint", "foxglove.SceneUpdate", 61),
        ("/obstacles", "foxglove.SceneUpdate", 62),
        ("/scan", "foxglove.LaserScan", 31),
        ("/belief", "foxglove.Grid", 7),
        ("/events", "runevent.RunEvent", 1),
        ("/log", "foxglove.Log", 1),
    ];
    let info = inspect(&mut Cursor::new(&bytes)).unwrap();
    assert_eq!(info.topics.len(), promised.len());
    for (topic, schema, messages) in promised {
        let found = info.topic(topic).unwrap();
        assert_eq!(
            (found.schema.as_str(), found.messages),
            (schema, messages),
            "{topic}"
        );
        assert_eq!(
            (found.schema_encoding.as_str(), found.encoding.as_str()),
            ("protobuf", "protobuf")
        );
    }
    assert_eq!(info.span, Some((SimTime::ZERO, SimTime::from_seconds(3.0))));
    assert_eq!((info.profile.as_str(), info.closed), ("bikebot", true));
    assert_eq!(info.damage, None);
}

#[test]
fn the_mcap_crates_own_reader_sees_the_same_messages_in_order_of_time() {
    let bytes = recording(2.5);
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let stats = summary.stats.unwrap();
    let mut count = 0;
    let (mut last, mut first_topic) = (0, None);
    let mut sequences = BTreeMap::<String, u32>::new();
    let mut placed = None;
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        assert_eq!(message.log_time, message.publish_time);
        assert!(message.log_time >= last);
        last = message.log_time;
        count += 1;
        first_topic.get_or_insert(message.channel.topic.clone());
        // A viewer at this stamp finds the transforms it needs.
        match message.channel.topic.as_str() {
            "/tf" => assert_ne!(
                placed,
                Some(last),
                "a message before the transforms of its stamp"
            ),
            "/scan" | "/map" | "/plan/scene" | "/bike/pose" | "/bike/footprint" => {
                placed = Some(last);
            }
            _ => {}
        }
        let sequence = sequences.entry(message.channel.topic.clone()).or_default();
        assert_eq!(message.sequence, *sequence);
        *sequence += 1;
    }
    // Frames come before the map and the plan, although those were known earlier.
    assert_eq!(first_topic.as_deref(), Some("/tf"));
    assert_eq!(count, inspect(&mut Cursor::new(&bytes)).unwrap().messages);
    assert_eq!(stats.message_count, count);
    // One chunk per simulated second at least.
    assert!(stats.chunk_count >= 3);
}

#[test]
fn a_whole_recording_passes_the_check_and_says_how_it_ended() {
    let bytes = recording(1.0);
    let report = check(&mut Cursor::new(&bytes)).unwrap();
    assert_eq!(report.problems, []);
    assert!(report.is_whole());
    assert_eq!(report.decoded, report.info.messages);
    assert_eq!(report.not_decoded, 0);
    let result = report.info.result().unwrap();
    assert_eq!(result["outcome"], "arrived");
    assert_eq!(result["metrics.distance_m"].parse::<f64>(), Ok(0.1 + 0.2));
    assert_eq!(result["expect.outcome"], "true");
    assert_eq!(report.info.run().unwrap()["plant"], "bike3d");
    assert_eq!(report.info.host(), None);
}

#[test]
fn the_same_run_gives_the_same_bytes_and_host_facts_change_one_record_only() {
    let bytes = recording(2.0);
    assert_eq!(sha256_hex(&bytes), sha256_hex(&recording(2.0)));

    let output = Cursor::new(Vec::new());
    let mut recorder = McapRecorder::begin(output, &run_info(), &RecordOptions::default()).unwrap();
    ride(&mut recorder, 2.0).unwrap();
    let mut result = result_info();
    result
        .host
        .insert("wall_time_s".to_owned(), "0.7".to_owned());
    recorder.finish(&result).unwrap();
    let with_host = recorder.into_inner().into_inner();
    let host = inspect(&mut Cursor::new(&with_host))
        .unwrap()
        .host()
        .unwrap()
        .clone();
    assert_eq!(host["wall_time_s"], "0.7");
    // All messages and attachments stand before it.
    let result_at = bytes
        .windows(14)
        .position(|it| it == b"bikebot.result")
        .unwrap();
    assert_eq!(bytes[..result_at], with_host[..result_at]);
}

#[test]
fn a_recording_carries_what_is_needed_to_run_it_again() {
    let bytes = recording(0.5);
    let source = read_run(&mut Cursor::new(&bytes)).unwrap();
    let info = run_info();
    assert_eq!(source.scenario_text, info.scenario_text);
    assert_eq!((source.seed, source.scenario.as_str()), (7, "test"));
    assert_eq!(source.overrides, info.overrides);
    assert_eq!(source.file("maps/yard.pgm"), Some(&*info.files[0].data));
    assert_eq!(source.file("../etc/passwd"), None);
    assert_eq!(source.result.unwrap()["result_hash"], "00ff");
    let plan = read_attachment(&mut Cursor::new(&bytes), "plan.json").unwrap();
    assert_eq!(plan, b"{\"outcome\": \"found\"}");
    assert!(matches!(
        read_attachment(&mut Cursor::new(&bytes), "nothing"),
        Err(LogError::Missing { .. })
    ));
}

#[test]
fn a_recording_that_was_killed_can_be_run_again_from_its_first_second() {
    let bytes = recording(3.0);
    let cut = &bytes[..bytes.len() / 3];
    let source = read_run(&mut Cursor::new(cut)).unwrap();
    assert_eq!(source.scenario_text, SCENARIO);
    assert_eq!(source.result, None);
}

#[test]
fn a_changed_scenario_is_noticed() {
    let mut bytes = recording(0.2);
    let at = bytes
        .windows(10)
        .position(|it| it == b"format = 1")
        .unwrap();
    bytes[at + 9] = b'2';
    let report = check(&mut Cursor::new(&bytes)).unwrap();
    assert!(!report.is_whole());
    assert!(matches!(
        read_run(&mut Cursor::new(&bytes)),
        Err(LogError::Missing {
            damage: Some(_),
            ..
        })
    ));
}

#[test]
fn a_trace_read_back_is_the_trace_of_the_run_at_the_recorded_rate() {
    let output = Cursor::new(Vec::new());
    let options = RecordOptions {
        state: 1000.0,
        ..RecordOptions::default()
    };
    let mut recorder = McapRecorder::begin(output, &run_info(), &options).unwrap();
    let mut pair = (&mut recorder, Trace::with_scans());
    ride(&mut pair, 1.0).unwrap();
    let live = pair.1;
    recorder.finish(&result_info()).unwrap();
    let bytes = recorder.into_inner().into_inner();
    let read = read_trace(&mut Cursor::new(&bytes), Trace::with_scans()).unwrap();
    for name in Trace::names() {
        let bits = |trace: &Trace| -> Vec<u64> {
            trace
                .column(name)
                .unwrap()
                .1
                .iter()
                .map(|it| it.to_bits())
                .collect()
        };
        assert_eq!(bits(&read), bits(&live), "{name}");
    }
    assert_eq!(read.plans, live.plans);
    assert_eq!(read.followed, live.followed);
    assert_eq!(read.notices, live.notices);
    assert_eq!(read.lines, live.lines);
    assert_eq!(read.scans.len(), live.scans.len());
    assert_eq!(read.scans[3].time_s, live.scans[3].time_s);
    assert_eq!(read.scans[3].ranges, live.scans[3].ranges);
    assert!((read.scans[3].angle_step - live.scans[3].angle_step).abs() < 1e-15);
}

#[test]
fn the_last_state_is_recorded_even_if_its_turn_had_not_come() {
    // 1.005 s lies between two samples at 100 Hz.
    let bytes = recording(1.005);
    let read = read_trace(&mut Cursor::new(&bytes), Trace::default()).unwrap();
    assert_eq!(read.state.time_s.last(), Some(&1.005));
    assert_eq!(read.control.time_s.last(), Some(&1.005));
    assert!(check(&mut Cursor::new(&bytes)).unwrap().is_whole());
}

#[test]
fn a_run_without_a_path_is_a_whole_recording_too() {
    let mut recorder = McapRecorder::begin(
        Cursor::new(Vec::new()),
        &run_info(),
        &RecordOptions::default(),
    )
    .unwrap();
    let cells = [CellState::Free; 6];
    let grid = GridSample {
        width: 3,
        height: 2,
        resolution: 1.0,
        origin: [0.0; 2],
        yaw: 0.0,
        cells: &cells,
    };
    let map = MapEvent {
        bounds: [[0.0; 2], [3.0, 2.0]],
        shapes: &[],
        grid: Some(grid),
    };
    recorder.record(SimTime::ZERO, &Event::Map(map)).unwrap();
    recorder.finish(&result_info()).unwrap();
    let bytes = recorder.into_inner().into_inner();
    let report = check(&mut Cursor::new(&bytes)).unwrap();
    assert_eq!(report.problems, []);
    assert_eq!(report.info.topic("/map").unwrap().messages, 1);
}

#[test]
fn misuse_is_an_error_and_leaves_the_recording_whole() {
    let mut recorder = McapRecorder::begin(
        Cursor::new(Vec::new()),
        &run_info(),
        &RecordOptions::default(),
    )
    .unwrap();
    let grid = GridSample {
        width: usize::MAX,
        height: 2,
        resolution: 1.0,
        origin: [0.0; 2],
        yaw: 0.0,
        cells: &[CellState::Free],
    };
    let map = MapEvent {
        bounds: [[0.0; 2], [1.0; 2]],
        shapes: &[],
        grid: Some(grid),
    };
    let late = SimTime::from_seconds(1.0);
    assert!(matches!(
        recorder.record(late, &Event::Map(map)),
        Err(RecordError::GridSize { .. })
    ));
    let state = StateSample::default();
    assert!(matches!(
        recorder.record(SimTime::ZERO, &Event::State(&state)),
        Err(RecordError::TimeWentBack { .. })
    ));
    let data = vec![0; wire::RECORD_LIMIT as usize];
    let event = Event::Attachment {
        name: "large",
        media_type: "",
        data: &data,
    };
    assert!(matches!(
        recorder.record(late, &event),
        Err(RecordError::AttachmentTooLarge { .. })
    ));
    recorder.record(late, &Event::State(&state)).unwrap();
    recorder.finish(&result_info()).unwrap();
    assert!(matches!(
        recorder.record(late, &Event::State(&state)),
        Err(RecordError::Finished)
    ));
    recorder.flush().unwrap();
    let bytes = recorder.into_inner().into_inner();
    assert!(check(&mut Cursor::new(&bytes)).unwrap().is_whole());
}

/// Fails at its n-th write, and from then on or that once only.
struct Failing {
    inner: Cursor<Vec<u8>>,
    writes_left: usize,
    heals: bool,
    failed: bool,
}

impl Write for Failing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.writes_left == 0 && !(self.failed && self.heals) {
            self.failed = true;
            return Err(io::Error::new(io::ErrorKind::StorageFull, "no space left"));
        }
        self.writes_left = self.writes_left.saturating_sub(1);
        self.inner.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Failing {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.inner.seek(position)
    }
}

#[test]
fn a_failing_disk_is_reported_once_and_again_at_the_end_and_nothing_follows_the_tear() {
    let whole = recording(1.2);
    let mut succeeded = false;
    for writes_left in 0..800 {
        let heals = writes_left % 2 == 0;
        let mut failing = Failing {
            inner: Cursor::new(Vec::new()),
            writes_left,
            heals,
            failed: false,
        };
        let options = RecordOptions::default();
        let mut recorder = match McapRecorder::begin(&mut failing, &run_info(), &options) {
            Ok(recorder) => recorder,
            Err(error) => {
                assert!(matches!(error, RecordError::Write { .. }), "{error}");
                continue;
            }
        };
        let mut reported = 0;
        // A loop that goes on whatever the recorder says.
        struct Counting<'r, R>(&'r mut R, &'r mut usize);
        impl<R: Recorder> Recorder for Counting<'_, R> {
            fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
                if let Err(error) = self.0.record(time, event) {
                    assert!(matches!(error, RecordError::Write { .. }), "{error}");
                    *self.1 += 1;
                }
                Ok(())
            }
        }
        ride(&mut Counting(&mut recorder, &mut reported), 1.2).unwrap();
        let end = recorder.finish(&result_info());
        let again = recorder.finish(&result_info());
        let written = recorder.bytes_written();
        // Not even a recorder that goes out of scope may write any more.
        drop(recorder);
        let bytes = failing.inner.into_inner();
        assert_eq!(written, bytes.len() as u64);
        match end {
            Ok(()) => {
                assert_eq!(reported, 0);
                assert!(again.is_ok());
                assert_eq!(bytes, whole);
                succeeded = true;
                break;
            }
            Err(RecordError::Incomplete { reason }) => {
                assert_eq!(reported, 1);
                assert!(reason.contains("no space left"), "{reason}");
            }
            Err(RecordError::Write { .. }) => assert_eq!(reported, 0),
            Err(other) => panic!("{other}"),
        }
        assert!(matches!(again, Err(RecordError::Incomplete { .. })) || again.is_ok());
        assert_eq!(
            bytes,
            whole[..bytes.len()],
            "nothing but the beginning of the whole file"
        );
        if bytes.len() >= 8 {
            let saved = recover(&mut Cursor::new(&bytes), &mut Cursor::new(Vec::new())).unwrap();
            assert!(saved.written.is_whole());
        }
    }
    assert!(succeeded, "the file takes fewer writes than were tried");
}

#[test]
fn a_file_cut_anywhere_is_read_up_to_its_last_whole_chunk() {
    let bytes = recording(4.0);
    let whole = inspect(&mut Cursor::new(&bytes)).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut cuts: Vec<usize> = (0..150)
        .map(|_| (rng.next_u64() % bytes.len() as u64) as usize)
        .collect();
    cuts.extend([
        0,
        1,
        7,
        8,
        9,
        16,
        bytes.len() - 1,
        bytes.len() - 8,
        bytes.len() - 9,
    ]);
    let mut best = 0;
    for cut in cuts {
        let part = &bytes[..cut];
        if cut < 8 {
            assert!(
                matches!(check(&mut Cursor::new(part)), Err(LogError::NotMcap)),
                "{cut}"
            );
            continue;
        }
        let report = check(&mut Cursor::new(part)).unwrap();
        assert!(!report.is_whole(), "{cut}");
        assert!(report.problems[0].offset <= cut as u64);
        let _ = read_trace(&mut Cursor::new(part), Trace::default()).unwrap();
        let mut output = Cursor::new(Vec::new());
        let saved = recover(&mut Cursor::new(part), &mut output).unwrap();
        assert_eq!(saved.written.problems, [], "cut at {cut}");
        assert_eq!(saved.messages, saved.written.info.messages);
        assert_eq!(saved.messages, report.decoded);
        assert_eq!(saved.source_bytes, cut as u64);
        let stopped = saved.stopped.unwrap();
        assert_eq!(stopped, report.problems[0]);
        if saved.nothing_lost {
            assert_eq!(saved.messages, whole.messages);
            assert_eq!(saved.written.info.result(), whole.result());
        }
        best = best.max(saved.messages);
        let recovered = output.into_inner();
        assert_eq!(
            inspect(&mut Cursor::new(&recovered)).unwrap().metadata["bikebot.recovered"]["stopped_at_byte"],
            stopped.offset.to_string()
        );
        // mcap's own reader agrees.
        let count = mcap::MessageStream::new(&recovered)
            .unwrap()
            .map(Result::unwrap)
            .count();
        assert_eq!(count as u64, saved.messages);
    }
    assert_eq!(best, whole.messages);
}

#[test]
fn a_killed_program_loses_no_more_than_the_last_second() {
    // So little is recorded that no chunk fills up: what counts is the clock.
    let sparse = RecordOptions {
        state: 20.0,
        frames: 20.0,
        pose: 10.0,
        scene: 1.0,
        belief: 1.0,
        flush: 1.0,
    };
    for options in [sparse, RecordOptions::default()] {
        for killed_at in [1.2, 2.995, 3.7] {
            let output = Cursor::new(Vec::new());
            let mut recorder = McapRecorder::begin(output, &run_info(), &options).unwrap();
            ride(&mut recorder, killed_at).unwrap();
            let on_disk = recorder.bytes_written() as usize;
            recorder.finish(&result_info()).unwrap();
            let bytes = recorder.into_inner().into_inner();
            let mut part = Cursor::new(&bytes[..on_disk]);
            let saved = recover(&mut part, &mut Cursor::new(Vec::new())).unwrap();
            let (_, last) = saved.written.info.span.unwrap();
            let lost = SimTime::from_seconds(killed_at).seconds_since(last);
            // A second, and the last sample before it was flushed is up to one period old.
            assert!(
                lost <= 1.0 + 1.0 / options.state,
                "{lost} s of {killed_at} s"
            );
        }
    }
}

#[test]
fn a_scan_has_transforms_of_its_own_stamp_however_rare_they_are() {
    let options = RecordOptions {
        frames: 3.0,
        ..RecordOptions::default()
    };
    let output = Cursor::new(Vec::new());
    let mut recorder = McapRecorder::begin(output, &run_info(), &options).unwrap();
    ride(&mut recorder, 1.0).unwrap();
    recorder.finish(&result_info()).unwrap();
    let bytes = recorder.into_inner().into_inner();
    let mut frames_at = None;
    let mut scans = 0;
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        match message.channel.topic.as_str() {
            "/tf" => frames_at = Some(message.log_time),
            "/scan" => {
                scans += 1;
                assert_eq!(frames_at, Some(message.log_time));
            }
            _ => {}
        }
    }
    assert_eq!(scans, 11);
}

#[test]
fn recovering_a_whole_file_loses_nothing_and_keeps_its_messages() {
    let bytes = recording(1.5);
    let mut output = Cursor::new(Vec::new());
    let saved = recover(&mut Cursor::new(&bytes), &mut output).unwrap();
    assert_eq!(saved.stopped, None);
    assert!(saved.nothing_lost && saved.written.is_whole());
    // Written by the same writer in the same chunks: the same file.
    assert_eq!(sha256_hex(&output.into_inner()), sha256_hex(&bytes));
}

#[test]
fn any_changed_byte_is_noticed_and_none_is_fatal() {
    let bytes = recording(0.6);
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..250 {
        let at = (rng.next_u64() % bytes.len() as u64) as usize;
        let flip = (rng.next_u64() % 255 + 1) as u8;
        let mut changed = bytes.clone();
        changed[at] ^= flip;
        match check(&mut Cursor::new(&changed)) {
            Ok(report) => assert!(!report.is_whole(), "byte {at} xor {flip:02x}"),
            Err(LogError::NotMcap) => assert!(at < 8),
            Err(other) => panic!("{other}"),
        }
        let _ = read_run(&mut Cursor::new(&changed));
        let _ = read_trace(&mut Cursor::new(&changed), Trace::with_scans());
        let mut output = Cursor::new(Vec::new());
        if let Ok(saved) = recover(&mut Cursor::new(&changed), &mut output) {
            // A changed message may be saved as it is; the container is whole.
            let count = mcap::MessageStream::new(output.get_ref()).unwrap();
            assert_eq!(count.map(Result::unwrap).count() as u64, saved.messages);
        }
    }
}

/// A file of the given records, unframed.
fn raw_file(records: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = mcap::MAGIC.to_vec();
    for (opcode, body) in records {
        bytes.push(*opcode);
        bytes.extend((body.len() as u64).to_le_bytes());
        bytes.extend(body);
    }
    bytes
}

fn string(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

#[test]
fn declared_lengths_are_believed_only_as_far_as_the_file_reaches() {
    use mcap::records::op;
    let huge = u64::MAX.to_le_bytes();
    let chunk = |size: u64, compression: &str, length: u64, records: &[u8]| {
        let mut body = vec![0; 16];
        body.extend(size.to_le_bytes());
        body.extend([0; 4]);
        body.extend(string(compression));
        body.extend(length.to_le_bytes());
        body.extend(records);
        (op::CHUNK, body)
    };
    let header = (op::HEADER, [string("bikebot"), string("x")].concat());
    let mut files = vec![
        // A record longer than the file, and than anything.
        [mcap::MAGIC, &[op::MESSAGE], &huge].concat(),
        [mcap::MAGIC, &[op::CHUNK], &(u64::MAX - 8).to_le_bytes()].concat(),
        raw_file(&[(op::METADATA, [string("a"), vec![0xff; 4]].concat())]),
        raw_file(&[(op::CHANNEL, vec![0xff; 12])]),
        raw_file(&[(
            op::SCHEMA,
            [vec![1, 0], string("a"), string("b"), vec![0xff; 4]].concat(),
        )]),
        raw_file(&[(op::ATTACHMENT, vec![0; 3])]),
        raw_file(&[(
            op::ATTACHMENT,
            [vec![0; 16], string("a"), string("b"), huge.to_vec()].concat(),
        )]),
        raw_file(&[(op::FOOTER, vec![0; 3])]),
        raw_file(&[(op::DATA_END, vec![])]),
    ];
    for compression in ["", "zstd", "lz4", "nonsense"] {
        // A chunk that claims more than it has, inside and out.
        files.push(raw_file(&[chunk(u64::MAX, compression, 4, &[1, 2, 3, 4])]));
        files.push(raw_file(&[chunk(60 << 20, compression, 4, &[1, 2, 3, 4])]));
        files.push(raw_file(&[chunk(
            9,
            compression,
            9,
            &[op::MESSAGE, 255, 255, 255, 3, 0, 0, 0, 0],
        )]));
        files.push(raw_file(&[chunk(
            5,
            compression,
            5,
            &[op::MESSAGE, 40, 0, 0, 0],
        )]));
        files.push(raw_file(&[chunk(5, compression, u64::MAX, &[])]));
    }
    for mut records in files {
        let with_header = raw_file(std::slice::from_ref(&header));
        records.splice(..8, with_header);
        let report = check(&mut Cursor::new(&records)).unwrap();
        assert!(!report.is_whole());
        let saved = recover(&mut Cursor::new(&records), &mut Cursor::new(Vec::new())).unwrap();
        assert_eq!(saved.messages, 0);
        assert!(read_run(&mut Cursor::new(&records)).is_err());
    }
    assert!(matches!(
        inspect(&mut Cursor::new(b"ROSBAG")),
        Err(LogError::NotMcap)
    ));
    assert!(matches!(
        inspect(&mut Cursor::new(b"")),
        Err(LogError::NotMcap)
    ));
}

#[test]
fn a_chunk_that_unpacks_to_too_much_is_not_opened() {
    let options = mcap::WriteOptions::new()
        .chunk_size(None)
        .compression_threads(0);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let channel = writer
        .add_channel(0, "/zeros", "", &BTreeMap::new())
        .unwrap();
    let header = mcap::records::MessageHeader {
        channel_id: channel,
        sequence: 0,
        log_time: 0,
        publish_time: 0,
    };
    let mebibyte = vec![0; 1 << 20];
    for _ in 0..80 {
        writer.write_to_known_channel(&header, &mebibyte).unwrap();
    }
    writer.finish().unwrap();
    let bytes = writer.into_inner().into_inner();
    assert!(bytes.len() < 1 << 20);
    let report = check(&mut Cursor::new(&bytes)).unwrap();
    assert!(
        report.problems[0].text.contains("more than"),
        "{}",
        report.problems[0]
    );
    assert_eq!(report.info.messages, 0);
}

/// Asks everything of a file that may be anything.
fn ask_everything(bytes: &[u8]) {
    let _ = inspect(&mut Cursor::new(bytes));
    let _ = check(&mut Cursor::new(bytes));
    let _ = read_run(&mut Cursor::new(bytes));
    let _ = read_attachment(&mut Cursor::new(bytes), "plan.json");
    let _ = read_trace(&mut Cursor::new(bytes), Trace::with_scans());
    let mut output = Cursor::new(Vec::new());
    if let Ok(saved) = recover(&mut Cursor::new(bytes), &mut output) {
        assert_eq!(saved.messages, saved.written.info.messages);
    }
}

/// The recording with chunks packed so, and without their CRCs: what is inside is
/// believed and read.
fn repacked_without_crcs(bytes: &[u8], compression: Option<mcap::Compression>) -> Vec<u8> {
    let options = mcap::WriteOptions::new()
        .compression(compression)
        .compression_threads(0)
        .chunk_size(Some(20_000))
        .calculate_chunk_crcs(false)
        .calculate_data_section_crc(false);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    for message in mcap::MessageStream::new(bytes).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

#[test]
fn whatever_stands_in_a_chunk_does_no_harm() {
    let bytes = recording(0.3);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let packed = [
        None,
        Some(mcap::Compression::Zstd),
        Some(mcap::Compression::Lz4),
    ];
    for (compression, rounds) in packed.into_iter().zip([300, 150, 150]) {
        let file = repacked_without_crcs(&bytes, compression);
        assert_eq!(check(&mut Cursor::new(&file)).unwrap().problems, []);
        for _ in 0..rounds {
            let mut changed = file.clone();
            for _ in 0..1 + rng.next_u64() % 8 {
                let at = (rng.next_u64() % changed.len() as u64) as usize;
                // Lengths and counts above all: large, small, or anything.
                changed[at] = [0, 0xff, 0x7f, rng.next_u64() as u8][(rng.next_u64() % 4) as usize];
            }
            ask_everything(&changed);
        }
    }
}

#[test]
fn the_crc_of_a_chunk_is_checked_however_it_is_packed() {
    let bytes = recording(0.1);
    let packed = [
        None,
        Some(mcap::Compression::Zstd),
        Some(mcap::Compression::Lz4),
    ];
    for compression in packed {
        let options = mcap::WriteOptions::new()
            .compression(compression)
            .compression_threads(0)
            .calculate_data_section_crc(false);
        let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
        for message in mcap::MessageStream::new(&bytes).unwrap() {
            writer.write(&message.unwrap()).unwrap();
        }
        writer.finish().unwrap();
        let mut file = writer.into_inner().into_inner();
        assert_eq!(check(&mut Cursor::new(&file)).unwrap().problems, []);
        // The one chunk begins after the header; this lies well inside.
        file[500] ^= 1;
        let report = check(&mut Cursor::new(&file)).unwrap();
        assert!(!report.is_whole());
        assert_eq!(
            report.info.messages, 0,
            "nothing of a broken chunk is believed"
        );
    }
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(300))]

    #[test]
    fn records_of_any_content_do_no_harm(
        records in proptest::collection::vec(
            (0u8..20, proptest::collection::vec(proptest::prelude::any::<u8>(), 0..80)),
            0..8,
        ),
        zeros in 0usize..80,
    ) {
        let mut records: Vec<(u8, Vec<u8>)> = records;
        for (_, body) in &mut records {
            // Small lengths are what gets a reader far into a record.
            for byte in body.iter_mut().take(zeros) {
                *byte &= 3;
            }
        }
        ask_everything(&raw_file(&records));
    }
}

/// A file with frames as given, and a message in frame `drawn` before and after them.
fn frames_file(drawn: &str, links: &[(&str, &str)]) -> Vec<u8> {
    use foxglove::Encode;
    use foxglove::messages::{FrameTransform, FrameTransforms, PoseInFrame};
    let mut writer = mcap::WriteOptions::new()
        .compression_threads(0)
        .create(Cursor::new(Vec::new()))
        .unwrap();
    let mut send = |topic: &str, schema: foxglove::Schema, data: Vec<u8>| {
        let schema = writer
            .add_schema(&schema.name, &schema.encoding, &schema.data)
            .unwrap();
        let id = writer
            .add_channel(schema, topic, "protobuf", &BTreeMap::new())
            .unwrap();
        let header = mcap::records::MessageHeader {
            channel_id: id,
            sequence: 0,
            log_time: 5,
            publish_time: 5,
        };
        writer.write_to_known_channel(&header, &data).unwrap();
    };
    let mut data = Vec::new();
    let transforms = links
        .iter()
        .map(|(parent, child)| FrameTransform {
            parent_frame_id: (*parent).to_owned(),
            child_frame_id: (*child).to_owned(),
            ..FrameTransform::default()
        })
        .collect();
    FrameTransforms { transforms }.encode(&mut data).unwrap();
    send("/tf", FrameTransforms::get_schema().unwrap(), data);
    let mut data = Vec::new();
    let pose = PoseInFrame {
        frame_id: drawn.to_owned(),
        ..PoseInFrame::default()
    };
    pose.encode(&mut data).unwrap();
    send("/pose", PoseInFrame::get_schema().unwrap(), data);
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

#[test]
fn frames_that_do_not_hang_together_are_noticed() {
    let problems = |drawn: &str, links: &[(&str, &str)]| {
        check(&mut Cursor::new(frames_file(drawn, links)))
            .unwrap()
            .problems
    };
    assert_eq!(problems("laser", &[("map", "base"), ("base", "laser")]), []);
    assert_eq!(problems("map", &[]), []);
    assert!(
        problems("laser", &[("map", "base")])[0]
            .text
            .contains("laser")
    );
    assert!(
        problems("a", &[("map", "a"), ("world", "b")])[0]
            .text
            .contains("several roots")
    );
    assert!(
        problems("a", &[("map", "a"), ("b", "a")])[0]
            .text
            .contains("another frame")
    );
    // A circle has no root; it must end all the same.
    let _ = problems("a", &[("b", "a"), ("a", "b")]);
}

/// All strings under a key such as `value`, anywhere in some JSON.
fn strings_under<'j>(json: &'j serde_json::Value, keys: &[&str], found: &mut Vec<&'j str>) {
    match json {
        serde_json::Value::Object(map) => {
            for (key, inner) in map {
                match inner {
                    serde_json::Value::String(text) if keys.contains(&key.as_str()) => {
                        found.push(text);
                    }
                    inner => strings_under(inner, keys, found),
                }
            }
        }
        serde_json::Value::Array(items) => {
            for inner in items {
                strings_under(inner, keys, found);
            }
        }
        _ => {}
    }
}

#[test]
fn the_shipped_layout_shows_only_topics_and_fields_that_exist() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../layouts/bikebot.json");
    let layout: serde_json::Value = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
    let bytes = recording(0.6);
    let mut fields = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let channel = message.unwrap().channel;
        let schema = channel.schema.clone().unwrap();
        fields.entry(channel.topic.clone()).or_insert_with(|| {
            protobuf::Schema::parse(&schema.name, &schema.data)
                .unwrap()
                .fields()
        });
    }
    let configs = &layout["configById"];
    for topic in configs["3D!ride"]["topics"].as_object().unwrap().keys() {
        assert!(fields.contains_key(topic), "{topic}");
    }
    let mut paths = Vec::new();
    strings_under(
        configs,
        &["value", "topicPath", "topicToRender"],
        &mut paths,
    );
    assert!(paths.len() > 20);
    for path in paths {
        let (topic, field) = path.split_once('.').unwrap_or((path, ""));
        let known = fields.get(topic).unwrap_or_else(|| panic!("{path}"));
        let field = field.trim_end_matches("[:]");
        assert!(
            field.is_empty() || known.iter().any(|it| it == field),
            "{path}"
        );
    }
    // Every panel is placed once, and every place has its panel.
    let mut placed = Vec::new();
    strings_under(&layout["layout"], &["first", "second"], &mut placed);
    strings_under(
        &configs["Tab!numbers"],
        &["first", "second", "layout"],
        &mut placed,
    );
    let mut panels: Vec<&str> = configs
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect();
    placed.sort_unstable();
    panels.sort_unstable();
    assert_eq!(placed, panels);
}

/// The independent reader, where a Python with its packages is named by
/// `BIKEBOT_PYTHON`; continuous integration does so.
#[test]
fn the_python_packages_read_it_too() {
    let Ok(python) = std::env::var("BIKEBOT_PYTHON") else {
        let mut err = io::stderr().lock();
        let _ = writeln!(
            err,
            "skipped: BIKEBOT_PYTHON names no Python with the package mcap"
        );
        return;
    };
    let file = std::env::temp_dir().join(format!("bikebot-recording-{}.mcap", std::process::id()));
    std::fs::write(&file, recording(2.0)).unwrap();
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/python/read_recording.py"
    );
    let output = std::process::Command::new(python)
        .arg(script)
        .arg(&file)
        .output()
        .unwrap();
    std::fs::remove_file(&file).unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}
