//! `bikebot run`: what it tells, what it records, how it ends.

use std::fs;

use crate::common::{SCENE, SHORT, call, folder, good, json, names, out};

#[test]
fn a_run_as_json_has_the_promised_keys() {
    let folder = folder();
    let run = json(&good(folder.path(), "run short.toml --seed 5 --json"));
    for key in [
        "outcome",
        "reason",
        "scenario",
        "seed",
        "plant",
        "mode",
        "log",
        "result_hash",
        "run_id",
        "metrics",
        "expect",
    ] {
        assert!(run.get(key).is_some(), "{key} is missing in {run}");
    }
    assert_eq!(run["outcome"], "arrived");
    assert_eq!(run["seed"], 5);
    assert_eq!(run["plant"], "two_link");
    assert_eq!(run["log"], "short-5.mcap");
    // Nothing was followed, so nothing is said of following: absent, not zero.
    assert!(run["metrics"].get("lateral_error_max_m").is_none());
    assert!(run["metrics"]["roll_max_deg"].as_f64().unwrap() >= 1.0);
}

#[test]
fn recordings_without_a_name_are_numbered_and_never_replaced() {
    let folder = folder();
    for _ in 0..3 {
        good(folder.path(), "run short.toml");
    }
    let names = names(folder.path());
    for name in ["short-1.mcap", "short-1.2.mcap", "short-1.3.mcap"] {
        assert!(names.contains(name), "{names:?}");
    }
    assert!(names.iter().all(|name| !name.ends_with(".part")));
}

#[test]
fn an_existing_recording_is_replaced_only_by_force() {
    let folder = folder();
    let path = folder.path().join("a.mcap");
    fs::write(&path, "old").unwrap();
    assert_eq!(
        call(folder.path(), "run short.toml -o a.mcap")
            .status
            .code(),
        Some(2)
    );
    assert_eq!(fs::read(&path).unwrap(), b"old");
    good(folder.path(), "run short.toml -o a.mcap --force");
    assert_ne!(fs::read(&path).unwrap(), b"old");
}

#[test]
fn a_recording_runs_again_to_the_same_bits() {
    let folder = folder();
    let first = json(&good(
        folder.path(),
        "run short.toml --seed 3 --set start.roll_deg=1.5 -o a.mcap --json",
    ));
    fs::remove_file(folder.path().join("short.toml")).unwrap();
    let again = json(&good(folder.path(), "run --from a.mcap -o b.mcap --json"));
    assert_eq!(first["result_hash"], again["result_hash"]);
    assert_eq!(first["run_id"], again["run_id"]);
    let other = json(&good(
        folder.path(),
        "run --from a.mcap --set start.roll_deg=2 -o c.mcap --json",
    ));
    assert_ne!(first["result_hash"], other["result_hash"]);
}

#[test]
fn a_recording_carries_the_map_it_was_run_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::create_dir(path.join("maps")).unwrap();
    fs::write(path.join("maps/yard.json"), SCENE).unwrap();
    let scenario = "format = 1\nname = \"mapped\"\nmap.file = \"maps/yard.json\"\nrun.duration_s = 1\n\
                    start.speed_mps = 0.3\nexpect.outcome = \"timed_out\"\n";
    fs::write(path.join("ride.toml"), scenario).unwrap();
    let first = json(&good(path, "run ride.toml -o a.mcap --json"));
    fs::remove_dir_all(path.join("maps")).unwrap();
    fs::remove_file(path.join("ride.toml")).unwrap();
    let again = json(&good(path, "run --from a.mcap -o b.mcap --json"));
    assert_eq!(first["result_hash"], again["result_hash"]);
}

#[test]
fn an_expectation_that_fails_is_told_and_ends_with_one() {
    let folder = folder();
    let output = call(
        folder.path(),
        "run short.toml --set expect.roll_max_deg=0.5",
    );
    assert_eq!(output.status.code(), Some(1));
    assert!(out(&output).contains("FAILED"), "{}", out(&output));
    let output = call(folder.path(), "run short.toml --set expect.outcome=fell");
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn a_fall_that_was_expected_is_a_success() {
    let folder = folder();
    let line = "run short.toml --set start.roll_deg=35 --set run.duration_s=5";
    assert_eq!(call(folder.path(), line).status.code(), Some(1));
    good(folder.path(), &format!("{line} --set expect.outcome=fell"));
}

#[test]
fn a_recording_is_as_dense_as_the_scenario_says() {
    let folder = folder();
    let dense =
        format!("{SHORT}[record]\nstate_hz = 20\npose_hz = 10\nframes_hz = 4\nscene_hz = 1\n");
    fs::write(folder.path().join("dense.toml"), dense).unwrap();
    let counts = |line: &str| {
        good(folder.path(), line);
        let info = json(&good(folder.path(), "info a.mcap --json"));
        let topics = info["topics"].as_array().unwrap().clone();
        [
            "/bike/state",
            "/control/debug",
            "/bike/pose",
            "/tf",
            "/bike/joints",
            "/bike/footprint",
        ]
        .map(|name| {
            let topic = topics.iter().find(|topic| topic["topic"] == name);
            topic.unwrap()["messages"].as_u64().unwrap()
        })
    };
    // Two seconds, and the first instant.
    assert_eq!(counts("run dense.toml -o a.mcap"), [41, 41, 21, 9, 9, 3]);
    assert_eq!(
        counts(
            "run dense.toml -o a.mcap --force --set record.state_hz=5 --set record.pose_hz=1000"
        ),
        // A rate above that of the control is every tick: 2 ms here.
        [11, 11, 1001, 9, 9, 3]
    );
    assert_eq!(
        counts("run short.toml -o a.mcap --force"),
        [201, 201, 101, 201, 201, 41]
    );
}
