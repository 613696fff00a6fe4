//! `bikebot run --live`: what the command line promises of it; `tests/python/watch_live.py` is a viewer.
#![cfg(feature = "live")]

use std::net::TcpListener;

use crate::common::{call, err, folder, good, json, names, out};

#[test]
fn being_watched_does_not_change_a_ride() {
    let folder = folder();
    let path = folder.path();
    let alone = json(&good(path, "run short.toml -o alone.mcap --json"));
    let output = call(
        path,
        "run short.toml -o live.mcap --live :0 --speed max --json",
    );
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert!(
        err(&output).starts_with("live at ws://127.0.0.1:"),
        "{}",
        err(&output)
    );
    let watched = json(&out(&output));
    assert_eq!(watched["result_hash"], alone["result_hash"]);
    good(path, "log check live.mcap");
}

#[test]
fn a_speed_is_kept_to_and_changes_nothing_else() {
    let folder = folder();
    let path = folder.path();
    let fast = json(&good(path, "run short.toml -o fast.mcap --json"));
    let paced = json(&good(
        path,
        "run short.toml -o paced.mcap --speed 10 --json",
    ));
    assert_eq!(paced["result_hash"], fast["result_hash"]);
    // Two simulated seconds ten times as fast; never sooner, however busy the machine is.
    let wall = paced["metrics"]["wall_time_s"].as_f64().unwrap();
    assert!(wall > 0.19, "{wall}");
}

#[test]
fn a_port_that_is_taken_is_told_before_anything_is_ridden() {
    let folder = folder();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap();
    let before = names(folder.path());
    let output = call(folder.path(), &format!("run short.toml --live {address}"));
    assert_eq!(output.status.code(), Some(3));
    let said = err(&output);
    assert!(
        said.contains(&format!("cannot serve on {address}")) && said.contains("another port"),
        "{said}"
    );
    assert_eq!(names(folder.path()), before);
}
