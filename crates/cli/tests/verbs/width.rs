//! What people read fits 80 columns, on every shipped scenario.
#![cfg(unix)]

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{call, err, folder, out};

/// Columns of a terminal.
const WIDTH: usize = 80;

fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).unwrap().to_owned()
}

/// The shipped scenarios: to ride, and only to plan.
fn scenarios(folder: &str) -> Vec<String> {
    let mut found: Vec<String> = fs::read_dir(root().join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|kind| kind == "toml"))
        .map(|path| path.file_name().unwrap().to_str().unwrap().to_owned())
        .map(|name| format!("{folder}/{name}"))
        .collect();
    found.sort();
    found
}

fn fits(folder: &Path, line: &str) {
    let output = call(folder, line);
    assert!(
        matches!(output.status.code(), Some(0 | 1)),
        "{line}: {}",
        err(&output)
    );
    for text in out(&output).lines() {
        let columns = text.chars().count();
        assert!(columns <= WIDTH, "{line}: {columns} columns: {text}");
    }
}

#[test]
fn summaries_and_tables_of_every_shipped_scenario_fit_80_columns() {
    let folder = folder();
    let path = folder.path();
    // As a user has it: names relative to the folder.
    std::os::unix::fs::symlink(root().join("scenarios"), path.join("scenarios")).unwrap();
    for scenario in scenarios("scenarios")
        .iter()
        .chain(&scenarios("scenarios/falls"))
    {
        fits(path, &format!("check {scenario}"));
        // Two seconds are enough for a summary with every line that it can have; long rides are long.
        fits(
            path,
            &format!("run {scenario} -o ride.mcap --force --set run.duration_s=2"),
        );
        for verb in ["info", "log check"] {
            fits(path, &format!("{verb} ride.mcap"));
        }
    }
    for scenario in scenarios("scenarios/planning") {
        fits(path, &format!("check {scenario}"));
        fits(
            path,
            &format!("plan {scenario} --iterations 2000 -o plan.json --force"),
        );
        let plan = fs::read_to_string(path.join("plan.json")).unwrap();
        if plan.contains("\"outcome\":\"found\"") {
            fits(path, &format!("verify plan.json {scenario}"));
        }
        fits(path, &format!("plan {scenario} --iterations 500 --runs 2"));
    }
    for line in [
        "run scenarios/fig7.toml -o whole.mcap",
        "run scenarios/unknown-yard.toml -o online.mcap --set run.duration_s=10",
        "info whole.mcap",
        "compare scenarios/fig7.toml --controllers pvfc,pure_pursuit,stanley,lqr+ --set run.duration_s=2",
        "compare scenarios/fig7.toml --plants bike3d,two_link,kinematic --set run.duration_s=2",
        "sweep scenarios/balance-recover.toml --vary start.roll_deg=1:3:3 -o lean.csv",
        "eigenvalues benchmark",
        "eigenvalues default --speeds 0:10:11",
        "map info scenarios/maps/maze.json",
        "map info scenarios/maps/fig7-ride.json",
        "table2 --runs 2 --set planner.grid.cell_scales=2",
    ] {
        fits(path, line);
    }
}
