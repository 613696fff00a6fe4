//! One seed, one result: the same scenario twice gives the same recording, byte for byte, and the
//! recording itself is enough to ride again.

mod common;

use bikebot::sim::record::{McapRecorder, RecordOptions, ResultInfo, RunInfo};
use std::io::Cursor;

/// Rides into memory; the file's bytes and the result's hash.
fn record(scenario: &str, overrides: &[&str]) -> (Vec<u8>, String) {
    let setup = common::setup(scenario, overrides);
    let info = RunInfo {
        version: bikebot::sim::VERSION.to_owned(),
        scenario: setup.name.clone(),
        scenario_text: setup.scenario_text.clone(),
        seed: setup.seed,
        ..RunInfo::default()
    };
    let mut recorder =
        McapRecorder::begin(Cursor::new(Vec::new()), &info, &RecordOptions::default())
            .expect("memory takes it");
    let report = common::play(&setup, &mut recorder);
    let result = ResultInfo {
        outcome: report.outcome.name().to_owned(),
        reason: report.reason.clone(),
        result_hash: report.result_hash.clone(),
        ..ResultInfo::default()
    };
    recorder.finish(&result).expect("memory takes it");
    (recorder.into_inner().into_inner(), report.result_hash)
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let (first, hash) = record("laser-yard.toml", &[]);
    let (second, again) = record("laser-yard.toml", &[]);
    assert_eq!(hash, again);
    assert!(first == second, "two recordings of one seed differ");
}

#[test]
fn another_seed_gives_another_ride() {
    let (_, one) = record("fig7.toml", &["run.seed=1"]);
    let (_, two) = record("fig7.toml", &["run.seed=2"]);
    assert_ne!(one, two);
}

#[test]
fn runs_on_other_threads_change_nothing() {
    let alone = record("fig7.toml", &[]);
    let beside = std::thread::scope(|scope| {
        let other = scope.spawn(|| record("course.toml", &[]));
        let this = scope.spawn(|| record("fig7.toml", &[]));
        let _ = other.join().expect("no panic");
        this.join().expect("no panic")
    });
    assert!(alone == beside, "a ride beside another one differs");
}

#[test]
fn an_added_laser_beam_does_not_change_the_plan() {
    let first_plan = |overrides: &[&str]| {
        let setup = common::setup("laser-yard.toml", overrides);
        let report = bikebot::sim::plan(&setup, &|| false).expect("a plan");
        report.path.expect("found").segments()
    };
    assert_eq!(first_plan(&[]), first_plan(&["laser.beams=362"]));
}
