//! A viewer of our own, over a real socket.

use super::super::{
    BikeGeometry, ControlSample, Event, LogLevel, MapEvent, McapRecorder, NoticeKind,
    RecordOptions, Recorder, ResultInfo, RunInfo, Shape, StateSample,
};
use super::*;
use std::collections::BTreeSet;
use std::io::Cursor;
use std::net::TcpStream;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

/// A viewer that subscribes to everything it is offered.
struct Viewer {
    socket: WebSocket<TcpStream>,
    /// Topic by subscription.
    topics: BTreeMap<u32, String>,
}

impl Viewer {
    fn connect(server: &LiveServer) -> Self {
        let stream = TcpStream::connect(server.address()).unwrap();
        // A test that hears nothing shall fail, not hang.
        stream
            .set_read_timeout(Some(Duration::from_secs(30)))
            .unwrap();
        let mut request = format!("ws://{}", server.address())
            .into_client_request()
            .unwrap();
        request
            .headers_mut()
            .insert("Sec-WebSocket-Protocol", "foxglove.sdk.v1".parse().unwrap());
        let (socket, response) = tungstenite::client(request, stream).unwrap();
        assert_eq!(
            response.headers()["Sec-WebSocket-Protocol"],
            "foxglove.sdk.v1"
        );
        let mut viewer = Self {
            socket,
            topics: BTreeMap::new(),
        };
        let mut subscriptions = Vec::new();
        while viewer.topics.len() < Topic::ALL.len() {
            let Message::Text(text) = viewer.socket.read().unwrap() else {
                continue;
            };
            let offered: serde_json::Value = serde_json::from_str(&text).unwrap();
            if offered["op"] != "advertise" {
                continue;
            }
            for channel in offered["channels"].as_array().unwrap() {
                assert_eq!(channel["encoding"], "protobuf");
                let id = viewer.topics.len() as u32 + 1;
                let topic = channel["topic"].as_str().unwrap();
                viewer.topics.insert(id, topic.to_owned());
                subscriptions.push(serde_json::json!({ "id": id, "channelId": channel["id"] }));
            }
        }
        let subscribe = serde_json::json!({ "op": "subscribe", "subscriptions": subscriptions });
        viewer
            .socket
            .send(Message::text(subscribe.to_string()))
            .unwrap();
        viewer
    }

    /// The next message: topic, time in ns, bytes.
    fn next(&mut self) -> (String, u64, Vec<u8>) {
        loop {
            let Message::Binary(bytes) = self.socket.read().unwrap() else {
                continue;
            };
            if bytes[0] != 1 {
                continue;
            }
            let number = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
            let time = u64::from_le_bytes(bytes[5..13].try_into().unwrap());
            return (self.topics[&number].clone(), time, bytes[13..].to_vec());
        }
    }
}

fn server(backlog: usize) -> LiveServer {
    LiveServer::start(&LiveOptions {
        address: SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 0),
        name: "a test".into(),
        backlog,
    })
    .unwrap()
}

fn recorder(server: &LiveServer) -> McapRecorder<Cursor<Vec<u8>>> {
    McapRecorder::begin(
        Cursor::new(Vec::new()),
        &RunInfo::default(),
        &RecordOptions::default(),
    )
    .unwrap()
    .with_live(server)
}

fn scene(recorder: &mut dyn Recorder) {
    let bike = BikeGeometry {
        wheelbase: 1.12,
        wheel_radius: 0.33,
        pivot_x: 0.3,
        pivot_height: 0.8,
        laser_position: [0.9, 0.0, 0.6],
        laser_yaw: 0.0,
        laser_pitch: 0.0,
        laser_is_level: false,
        footprint: vec![[0.0, -0.3], [1.2, -0.3], [1.2, 0.3], [0.0, 0.3]],
    };
    recorder.record(SimTime::ZERO, &Event::Bike(&bike)).unwrap();
    let map = MapEvent {
        bounds: [[0.0, 0.0], [4.0, 4.0]],
        shapes: &[Shape::Disc {
            center: [2.0, 2.0],
            radius: 0.5,
        }],
        grid: None,
    };
    recorder.record(SimTime::ZERO, &Event::Map(map)).unwrap();
}

fn tick(recorder: &mut dyn Recorder, step: u64) {
    let time = SimTime::from_nanoseconds(10_000_000 * step);
    let state = StateSample {
        x_m: 0.01 * step as f64,
        y_m: 1.0,
        heading_rad: 0.0,
        roll_rad: 0.05,
        steer_rad: 0.1,
        balancer_rad: 0.2,
        speed_mps: 1.0,
        ..StateSample::default()
    };
    recorder.record(time, &Event::State(&state)).unwrap();
    let control = ControlSample::default();
    recorder.record(time, &Event::Control(&control)).unwrap();
}

/// Topic, time and bytes of every message of a file.
fn written(file: &[u8]) -> Vec<(String, u64, Vec<u8>)> {
    mcap::MessageStream::new(file)
        .unwrap()
        .map(|message| {
            let message = message.unwrap();
            (
                message.channel.topic.clone(),
                message.log_time,
                message.data.into_owned(),
            )
        })
        .collect()
}

#[test]
fn a_viewer_gets_the_bytes_of_the_recording_whenever_it_comes() {
    let server = server(10_000);
    let mut recorder = recorder(&server);
    let mut early = Viewer::connect(&server);
    // Heard from, so it has subscribed to the last topic too: subscriptions are taken in order.
    let heard = |viewer: &mut Viewer, recorder: &mut McapRecorder<_>| {
        let text = "here";
        let (mut got, mut tries) = (Vec::new(), 0);
        viewer
            .socket
            .get_ref()
            .set_read_timeout(Some(Duration::from_millis(50)))
            .unwrap();
        while got.is_empty() && tries < 600 {
            let event = Event::Log {
                level: LogLevel::Info,
                text,
            };
            recorder.record(SimTime::ZERO, &event).unwrap();
            if let Ok(Message::Binary(bytes)) = viewer.socket.read() {
                got = bytes.to_vec();
            }
            tries += 1;
        }
        assert!(!got.is_empty(), "no answer");
        viewer
            .socket
            .get_ref()
            .set_read_timeout(Some(Duration::from_secs(30)))
            .unwrap();
    };
    heard(&mut early, &mut recorder);
    scene(&mut recorder);
    for step in 0..50 {
        tick(&mut recorder, step);
    }
    let mut late = Viewer::connect(&server);
    let standing: BTreeSet<String> = (0..4).map(|_| late.next().0).collect();
    let wanted = ["/bike/model", "/map", "/map/occupancy", "/obstacles"];
    assert_eq!(standing, wanted.map(str::to_owned).into());
    let notice = Event::Notice {
        kind: NoticeKind::GoalReached,
        text: "there",
        value: 0.0,
    };
    let end = SimTime::from_nanoseconds(1_000_000_000);
    recorder.record(end, &notice).unwrap();
    recorder.finish(&ResultInfo::default()).unwrap();
    let file = recorder.into_inner().into_inner();
    // All but the calls that it took to be heard.
    let is_call = |message: &(String, u64, Vec<u8>)| message.0 == "/log";
    let mut wanted: Vec<_> = written(&file)
        .into_iter()
        .filter(|it| !is_call(it))
        .collect();
    let mut seen = Vec::new();
    while seen.len() < wanted.len() {
        let message = early.next();
        if !is_call(&message) {
            seen.push(message);
        }
    }
    // The order within a topic is kept; between topics the file is sorted by chunks.
    wanted.sort_by(|a, b| (&a.0, a.1).cmp(&(&b.0, b.1)));
    seen.sort_by(|a, b| (&a.0, a.1).cmp(&(&b.0, b.1)));
    assert!(seen == wanted, "{} against {}", seen.len(), wanted.len());
    assert!(wanted.iter().any(|it| it.0 == "/bike/state"));
    server.stop();
}

#[test]
fn nobody_waits_for_a_viewer_that_does_not_read_or_has_gone() {
    let server = server(16);
    let mut recorder = recorder(&server);
    let stuck = Viewer::connect(&server);
    let gone = Viewer::connect(&server);
    drop(gone);
    scene(&mut recorder);
    // Far more than any buffer on the way holds: without a reader this would never end.
    for step in 0..60_000 {
        tick(&mut recorder, step);
    }
    let mut fresh = Viewer::connect(&server);
    let (topic, ..) = fresh.next();
    assert!(topic == "/map" || topic.starts_with('/'), "{topic}");
    recorder.finish(&ResultInfo::default()).unwrap();
    server.stop();
    drop(stuck);
}

#[test]
fn an_address_that_is_taken_is_told() {
    let first = server(4);
    let options = LiveOptions {
        address: first.address(),
        ..LiveOptions::default()
    };
    let error = LiveServer::start(&options).unwrap_err().to_string();
    assert!(error.contains(&first.address().to_string()), "{error}");
}

/// The layout that comes with the program names topics, and of our own messages fields, that are there.
#[test]
fn the_layout_shows_what_there_is() {
    use super::super::{ControlSample, StateSample};
    let text = include_str!("../../../../../layouts/bikebot.json");
    let layout: serde_json::Value = serde_json::from_str(text).unwrap();
    let known: BTreeSet<&str> = Topic::ALL.iter().map(|topic| topic.name()).collect();
    fn strings<'v>(value: &'v serde_json::Value, into: &mut Vec<&'v str>) {
        match value {
            serde_json::Value::String(text) => into.push(text),
            serde_json::Value::Array(list) => list.iter().for_each(|it| strings(it, into)),
            serde_json::Value::Object(map) => {
                for (key, value) in map {
                    into.push(key);
                    strings(value, into);
                }
            }
            _ => {}
        }
    }
    let mut named = Vec::new();
    strings(&layout["configById"], &mut named);
    let mut shown = BTreeSet::new();
    for text in named.into_iter().filter(|text| text.starts_with('/')) {
        let (topic, field) = text.split_once('.').unwrap_or((text, ""));
        assert!(known.contains(topic), "{text}");
        shown.insert(topic);
        let fields = match topic {
            "/bike/state" => StateSample::FIELDS,
            "/control/debug" => ControlSample::FIELDS,
            _ => continue,
        };
        assert!(field.is_empty() || fields.contains(&field), "{text}");
    }
    for topic in [
        "/map",
        "/belief",
        "/scan",
        "/plan/scene",
        "/bike/footprint",
        "/bike/model",
        "/obstacles",
        "/bike/state",
        "/control/debug",
        "/events",
        "/log",
    ] {
        assert!(shown.contains(topic), "{topic} is not shown");
    }
}
