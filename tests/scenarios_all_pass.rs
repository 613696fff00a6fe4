//! Every shipped scenario resolves, runs, and meets its own expectations.

mod common;

use bikebot::planner::Outcome;

fn shipped(folder: &str) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(common::root().join("scenarios").join(folder))
        .expect("the scenarios")
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name.ends_with(".toml"))
        .map(|name| {
            if folder.is_empty() {
                name
            } else {
                format!("{folder}/{name}")
            }
        })
        .collect();
    names.sort();
    names
}

#[test]
fn each_ride_meets_its_expectations() {
    let names = shipped("");
    assert!(names.len() >= 6, "{names:?}");
    for name in names {
        let (report, _) = common::ride(&name, &[]);
        assert!(!report.expect.is_empty(), "{name} expects nothing");
        assert!(
            report.passed(),
            "{name}: {} ({}): {:#?}",
            report.outcome,
            report.reason,
            report.expect
        );
    }
}

#[test]
fn each_fall_happens_for_its_reason() {
    let names = shipped("falls");
    assert!(names.len() >= 3, "{names:?}");
    for name in names {
        let (report, _) = common::ride(&name, &[]);
        assert!(
            report.passed(),
            "{name}: {} ({}): {:#?}",
            report.outcome,
            report.reason,
            report.expect
        );
        // Without the expectation it is a failure like any other: exit code 1.
        let (plain, _) = common::ride(&name, &["expect={}"]);
        assert!(!plain.passed(), "{name}");
    }
}

#[test]
fn each_planning_scene_is_planned_but_the_one_read_to_the_letter() {
    let names = shipped("planning");
    assert_eq!(names.len(), 8, "{names:?}");
    for name in names {
        let setup = common::setup(&name, &[]);
        let report = bikebot::sim::plan(&setup, &|| false).expect("a problem that makes sense");
        let wanted = if name.ends_with("as-printed.toml") {
            Outcome::Exhausted
        } else {
            Outcome::Found
        };
        assert_eq!(report.outcome, wanted, "{name}: {:?}", report.reason);
    }
}
