//! `bikebot init`: a folder, a scenario, and a ride from it.

use std::collections::BTreeSet;

use crate::common::{call, good, names};

#[test]
fn the_scenario_of_init_runs_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    assert_eq!(good(path, "init"), "wrote scenario.toml\n");
    assert_eq!(good(path, "check scenario.toml"), "scenario.toml: ok\n");
    let summary = good(path, "run scenario.toml");
    assert!(summary.starts_with("yard: arrived"), "{summary}");
    for line in summary.lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
    assert_eq!(
        names(path),
        BTreeSet::from(["scenario.toml".into(), "yard-1.mcap".into()])
    );
}

#[test]
fn init_makes_the_folder_it_is_told() {
    let folder = tempfile::tempdir().unwrap();
    good(folder.path(), "init a/b");
    assert!(folder.path().join("a/b/scenario.toml").is_file());
    assert_eq!(call(folder.path(), "init a/b").status.code(), Some(2));
    good(folder.path(), "init a/b --force");
}
