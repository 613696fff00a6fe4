//! What others make of a recording: frames that hang together, the shipped layout, Python.

use std::collections::BTreeMap;
use std::io::{self, Cursor, Write};

use super::super::log::check;
use super::*;

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
