//! The page of recordings made here: what it holds, and what it must never hold.

use std::collections::BTreeMap;

use bikebot_sim::clock::SimTime;
use bikebot_sim::record::log::LogInfo;
use bikebot_sim::record::{
    ControlSample, Event, LogLevel, NoticeKind, Recorder, StateSample, Trace,
};

use super::{Recording, number, write};

fn record(pairs: &[(&str, &str)]) -> BTreeMap<String, String> {
    let pairs = pairs.iter();
    pairs
        .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()))
        .collect()
}

fn info(name: &str) -> LogInfo {
    let mut info = LogInfo::default();
    info.metadata.insert(
        "bikebot.run".into(),
        record(&[("scenario", name), ("seed", "7"), ("version", "0.1.0")]),
    );
    info.metadata.insert(
        "bikebot.result".into(),
        record(&[
            ("outcome", "arrived"),
            ("reason", "at_goal"),
            ("result_hash", "abc"),
            ("metrics.time_s", "2"),
            ("metrics.distance_m", "2"),
            ("metrics.roll_max_deg", "3.5"),
            ("expect.outcome = arrived", "true"),
        ]),
    );
    info
}

fn trace(ticks: u64) -> Trace {
    let mut trace = Trace::with_scans().with_beliefs();
    for tick in 0..ticks {
        let time = SimTime::from_nanoseconds(10_000_000 * tick);
        let phase = 0.05 * tick as f64;
        let state = StateSample {
            x_m: 0.01 * tick as f64,
            y_m: phase.sin(),
            heading_rad: 0.1 * phase.cos(),
            roll_rad: 0.06 * phase.sin(),
            speed_mps: 1.0,
            steer_rad: 0.02,
            ..StateSample::default()
        };
        trace.record(time, &Event::State(&state)).unwrap();
        let control = ControlSample {
            roll_reference_rad: 0.05 * phase.sin(),
            ..ControlSample::default()
        };
        trace.record(time, &Event::Control(&control)).unwrap();
    }
    trace
}

fn recording<'a>(info: &'a LogInfo, trace: &'a Trace, text: Option<&'a str>) -> Recording<'a> {
    Recording {
        file: "ride.mcap".into(),
        info,
        trace,
        scenario_text: text,
        setup: None,
        missing: Vec::new(),
    }
}

#[test]
fn the_same_recording_gives_the_same_bytes() {
    let (info, trace) = (info("a"), trace(300));
    let page = || write(&[recording(&info, &trace, Some("format = 1\n"))], "0.1.0");
    let first = page();
    assert_eq!(first, page());
    assert!(first.starts_with("<!doctype html>") && first.ends_with("</html>\n"));
    assert!(first.contains("<h2 id=\"outcome\">Arrived</h2>"));
    assert!(first.contains("bikebot run --from ride.mcap"));
}

#[test]
fn nothing_in_a_recording_can_break_out_of_the_page() {
    let bad = "</script><script>alert(1)</script><!--\"'&";
    let mut info = info(bad);
    for metadata in info.metadata.values_mut() {
        metadata.insert(format!("metrics.{bad}"), "1".into());
        metadata.insert(format!("expect.{bad}"), "false".into());
        metadata.insert("reason".into(), bad.into());
        metadata.insert("overrides".into(), bad.into());
    }
    let mut trace = trace(10);
    let at = SimTime::from_nanoseconds(100_000_000);
    let notice = Event::Notice {
        kind: NoticeKind::Collision,
        text: bad,
        value: f64::NAN,
    };
    trace.record(at, &notice).unwrap();
    trace.notices[0].kind = bad.into();
    let line = Event::Log {
        level: LogLevel::Warning,
        text: bad,
    };
    trace.record(at, &line).unwrap();
    let one = Recording {
        file: format!("{bad}.mcap"),
        missing: vec![bad.into()],
        ..recording(&info, &trace, Some(bad))
    };
    let clean = {
        let info = super::tests::info("a");
        write(
            &[recording(&info, &trace_without(&trace), Some("a"))],
            "0.1.0",
        )
    };
    for page in [
        write(std::slice::from_ref(&one), "0.1.0"),
        write(&[one.clone(), one], bad),
    ] {
        assert!(!page.contains("alert(1)</script>") && !page.contains("<script>alert"));
        assert!(!page.contains("<!--"));
        // As many scripts begin and end as in a page without any of that.
        for tag in ["<script", "</script", "<style", "</style"] {
            assert_eq!(
                page.matches(tag).count(),
                clean.matches(tag).count(),
                "{tag}"
            );
        }
    }
}

fn trace_without(trace: &Trace) -> Trace {
    let mut trace = trace.clone();
    trace.notices.clear();
    trace.lines.clear();
    trace
}

#[test]
fn a_page_asks_the_network_for_nothing() {
    let (info, trace) = (info("a"), trace(50));
    let page = write(&[recording(&info, &trace, None)], "0.1.0");
    assert!(page.contains("default-src 'none'"));
    for asks in [
        "src=\"http",
        "@import",
        "url(http",
        "fetch(",
        "XMLHttpRequest",
        "import(",
    ] {
        assert!(!page.contains(asks), "{asks}");
    }
    // Links are there to be followed, not to be loaded.
    assert_eq!(page.matches("<link").count(), 1);
}

#[test]
fn a_recording_without_a_single_row_still_makes_a_page() {
    let (info, nothing) = (LogInfo::default(), Trace::default());
    let mut empty = recording(&info, &nothing, None);
    assert!(!empty.has_anything());
    empty
        .missing
        .push("It has no states: nothing was ridden.".into());
    let page = write(&[empty], "0.1.0");
    assert!(page.contains("nothing was ridden") && page.contains("Was cut off"));
    let scenario = recording(&info, &nothing, Some("format = 1"));
    assert!(scenario.has_anything());
}

#[test]
fn several_rides_stand_side_by_side() {
    let (a, b, trace) = (info("first"), info("second"), trace(100));
    let page = write(
        &[recording(&a, &trace, None), recording(&b, &trace, None)],
        "0.1.0",
    );
    assert!(page.contains("2 rides side by side") && page.contains("<table class=\"compare\">"));
    for name in ["first", "second"] {
        assert!(page.contains(name));
    }
}

#[test]
fn a_long_ride_stays_small() {
    let (info, trace) = (info("long"), trace(100_000));
    let page = write(&[recording(&info, &trace, None)], "0.1.0");
    assert!(page.len() < 3_000_000, "{}", page.len());
    assert!(page.contains("every 9th sample"));
}

#[test]
fn numbers_have_three_digits_and_no_idle_zeros() {
    for (value, text) in [
        (0.0, "0"),
        (12.0, "12"),
        (10.54, "10.5"),
        (0.72, "0.72"),
        (1234.5, "1234"),
        (-0.5, "-0.5"),
        (1e-9, "1.00e-9"),
        (100.0, "100"),
    ] {
        assert_eq!(number(value), text);
    }
}
