//! What stands in a recording, and that it is read back.

use std::collections::BTreeMap;
use std::io::Cursor;

use super::super::log::{LogError, check, inspect, read_attachment, read_run, read_trace};
use super::*;

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
        ("/bike/model", "foxglove.SceneUpdate", 1),
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
    // The field in cells; all its shapes lie outside.
    let map = read.map.unwrap();
    assert!(map.cells.iter().all(|cell| *cell == Cell::Free));
    assert!((map.resolution * map.width as f64 - 2.5).abs() < 2.0 * map.resolution);
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
