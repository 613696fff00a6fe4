//! `bikebot sweep`: rows that do not depend on threads.

use std::fs;

use crate::common::{call, folder, good, json, out};

#[test]
fn a_sweep_has_the_same_bytes_for_any_number_of_jobs() {
    let folder = folder();
    let sweep = "sweep short.toml --vary start.roll_deg=0.5:2:4 --vary bike.mode=[\"flywheel\",\"balancer\"] --runs 2";
    good(folder.path(), &format!("{sweep} --jobs 1 -o one.csv"));
    good(folder.path(), &format!("{sweep} --jobs 4 -o four.csv"));
    let one = fs::read_to_string(folder.path().join("one.csv")).unwrap();
    assert_eq!(
        one,
        fs::read_to_string(folder.path().join("four.csv")).unwrap()
    );
    assert_eq!(one.lines().count(), 1 + 4 * 2 * 2);
    let columns = one.lines().next().unwrap().split(',').count();
    assert!(one.lines().all(|line| line.split(',').count() == columns));
    // The row of a run says what the run itself says.
    let line = "run short.toml --set start.roll_deg=2.0 --set bike.mode=balancer --seed 2 --json";
    let run = json(&out(&call(folder.path(), line)));
    assert!(
        one.lines()
            .last()
            .unwrap()
            .contains(run["result_hash"].as_str().unwrap())
    );
}

#[test]
fn a_sweep_into_a_folder_makes_a_table_there() {
    let folder = folder();
    let summary = json(&good(
        folder.path(),
        "sweep short.toml --runs 3 -o out/ --json",
    ));
    assert_eq!(summary["rows"], 3);
    assert_eq!(summary["passed"], 3);
    assert!(folder.path().join("out/sweep.csv").is_file());
}
