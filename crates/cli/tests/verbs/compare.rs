//! `bikebot compare`: one scenario, every combination.

use std::collections::BTreeSet;
use std::fs;

use crate::common::{call, err, folder, good, json, keys, out};

/// A short straight ride without a map.
const STRAIGHT: &str = "\
format = 1
name = \"straight\"
start.speed_mps = 0.5
path = { waypoints = [[0, 0, 0], [3, 0, 0]], tangent_per_chord = 1 }
run.duration_s = 20
";

#[test]
fn a_comparison_tables_every_combination() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("straight.toml"), STRAIGHT).unwrap();
    let line = "compare straight.toml --plants bike3d,two_link,kinematic";
    let text = good(path, line);
    assert!(text.starts_with("straight: 3 runs at seed 1"), "{text}");
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    for part in [
        "bike3d",
        "drive work, J",
        "two_link stands still",
        "the same",
    ] {
        assert!(text.contains(part), "`{part}` is not in:\n{text}");
    }
    let found = json(&good(path, &format!("{line} --json --jobs 1")));
    assert_eq!(
        keys(&found),
        BTreeSet::from(["scenario", "seed", "columns", "interrupted", "version"])
    );
    let columns = found["columns"].as_array().unwrap();
    assert_eq!(columns.len(), 3);
    for column in columns {
        assert_eq!(column["outcome"], "arrived", "{column}");
        assert!(column["metrics"].is_object() && column["difference"].is_object());
    }
    assert_eq!(
        found,
        json(&good(path, &format!("{line} --format json --jobs 3")))
    );
    good(path, &format!("{line} --format csv -o table.csv"));
    let csv = fs::read_to_string(path.join("table.csv")).unwrap();
    assert_eq!(csv.lines().count(), 4);
    assert!(good(path, &format!("{line} --format markdown")).starts_with("| plant | `bike3d` |"));
}

#[test]
fn a_comparison_of_nonsense_is_refused() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("straight.toml"), STRAIGHT).unwrap();
    for (flags, code, part) in [
        ("", 2, "nothing to compare"),
        ("--plants bike3d", 2, "nothing to compare"),
        (
            "--plants bike3d,bike4d",
            2,
            "`bike4d` is no plant; known are ",
        ),
        ("--plants bike3d,bike3d", 2, "`bike3d` is named twice"),
        (
            "--controllers pid,pvfc",
            2,
            "`pid` is no path follower or balance law; known are ",
        ),
        (
            "--controllers lqr,pvfc",
            2,
            "lqr+ for the path follower, +lqr for the balance law",
        ),
        ("--controllers pvfc+,pvfc", 2, "named twice"),
        (
            "--plants bike3d,kinematic --set run.duration_s=-1",
            2,
            "run.duration_s",
        ),
        (
            "--plants bike3d,kinematic -o no/such/place.txt",
            3,
            "no folder",
        ),
    ] {
        let output = call(path, &format!("compare straight.toml {flags}"));
        assert_eq!(
            output.status.code(),
            Some(code),
            "{flags}\n{}{}",
            out(&output),
            err(&output)
        );
        assert!(err(&output).contains(part), "{flags}\n{}", err(&output));
    }
}
