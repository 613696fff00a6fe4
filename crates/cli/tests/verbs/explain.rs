//! `bikebot explain`: every value and its origin.

use crate::common::{bikebot, folder, good, json, out};

#[test]
fn explain_tells_every_value_and_where_it_comes_from() {
    let folder = folder();
    let explained = good(
        folder.path(),
        "explain short.toml --set start.roll_deg=1.25",
    );
    let line = |key: &str| {
        explained
            .lines()
            .find(|line| line.starts_with(key))
            .unwrap_or_else(|| panic!("{key} is missing"))
    };
    assert!(line("start.roll_deg ").ends_with("# --set"), "{explained}");
    assert!(line("run.duration_s ").ends_with("# line 5"), "{explained}");
    assert!(
        line("follow.max_speed_mps ").ends_with("# default"),
        "{explained}"
    );
    assert!(
        line("bike.m1_kg ").ends_with("# preset default"),
        "{explained}"
    );
    // What stands there can be given by --set, and changes nothing.
    let set: Vec<&str> = explained
        .lines()
        .filter_map(|line| line.split_once("  #"))
        // Asked for, a laser wants a map to look at; by default it does without.
        .filter(|(pair, _)| !pair.starts_with("laser.enabled"))
        .flat_map(|(pair, _)| ["--set", pair.trim()])
        .collect();
    let again = bikebot(folder.path())
        .args(["run", "short.toml", "--json"])
        .args(set)
        .output()
        .unwrap();
    let first = json(&good(
        folder.path(),
        "run short.toml --set start.roll_deg=1.25 --json",
    ));
    assert_eq!(first["result_hash"], json(&out(&again))["result_hash"]);
    let keys = json(&good(folder.path(), "explain short.toml --json"));
    assert!(keys["keys"].as_array().unwrap().len() > 50);
}
