//! What holds for every verb: help, streams, seeds, colours, names.

use std::fs;
use std::path::Path;
use std::process::Stdio;

use crate::common::{bikebot, call, err, folder, good, json, out};

#[test]
fn every_shell_gets_its_completions() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        assert!(good(Path::new("."), &format!("completions {shell}")).contains("recover"));
    }
}

#[test]
fn help_of_every_verb_fits_a_hundred_columns() {
    for verb in [
        "",
        "run",
        "plan",
        "verify",
        "table2",
        "reproduce",
        "plot",
        "report",
        "sweep",
        "compare",
        "eigenvalues",
        "check",
        "explain",
        "schema",
        "init",
        "map",
        "map info",
        "map build",
        "info",
        "log",
        "log check",
        "log recover",
        "completions",
        "man",
    ] {
        for flag in ["-h", "--help"] {
            let text = good(Path::new("."), &format!("{verb} {flag}"));
            for line in text.lines() {
                assert!(line.chars().count() <= 100, "{verb}: {line}");
            }
        }
    }
}

#[test]
fn the_seed_may_come_from_the_environment_and_the_flag_wins() {
    let folder = folder();
    let seed = |line: &str| {
        let output = bikebot(folder.path())
            .env("BIKEBOT_SEED", "42")
            .args(line.split_whitespace())
            .output()
            .unwrap();
        json(&out(&output))["seed"].as_u64()
    };
    assert_eq!(seed("run short.toml --json"), Some(42));
    assert_eq!(seed("run short.toml --seed 3 --json"), Some(3));
}

#[test]
fn a_scenario_may_come_from_standard_input() {
    let folder = folder();
    let file = fs::File::open(folder.path().join("short.toml")).unwrap();
    let output = bikebot(folder.path())
        .args(["check", "-"])
        .stdin(Stdio::from(file))
        .output()
        .unwrap();
    assert_eq!(out(&output), "<stdin>: ok\n", "{}", err(&output));
}

#[test]
fn messages_are_coloured_only_on_demand() {
    let folder = folder();
    let plain = call(folder.path(), "check nowhere.toml");
    assert!(!err(&plain).contains('\u{1b}'));
    let coloured = call(folder.path(), "check nowhere.toml --color always");
    assert!(err(&coloured).contains('\u{1b}'));
}

#[test]
fn a_closed_pipe_is_no_error() {
    let folder = folder();
    good(folder.path(), "run short.toml -o a.mcap");
    for line in [
        "schema",
        "explain short.toml",
        "info a.mcap",
        "plan yard.json --json",
        "completions zsh",
    ] {
        let mut child = bikebot(folder.path())
            .args(line.split_whitespace())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{line}");
        assert_eq!(err(&output), "", "{line}");
    }
}

#[test]
fn quiet_says_nothing_on_standard_error() {
    let folder = folder();
    for line in [
        "run short.toml -q",
        "sweep short.toml -o a.csv -q",
        "init x -q",
        "plan yard.json -q",
    ] {
        let output = call(folder.path(), line);
        assert_eq!(output.status.code(), Some(0), "{line}: {}", err(&output));
        assert_eq!(err(&output), "", "{line}");
    }
}

#[test]
fn a_bad_seed_of_the_environment_is_told_as_such() {
    let output = bikebot(Path::new("."))
        .env("BIKEBOT_SEED", "many")
        .args(["check", "x.toml"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(err(&output).contains("BIKEBOT_SEED"), "{}", err(&output));
}

#[test]
fn more_is_logged_on_demand() {
    let folder = folder();
    fs::write(
        folder.path().join("ride.toml"),
        "format = 1\nname = \"ride\"\nmap.file = \"yard.json\"\n",
    )
    .unwrap();
    assert_eq!(err(&call(folder.path(), "check ride.toml")), "");
    assert!(err(&call(folder.path(), "check ride.toml -v")).contains("reading yard.json"));
    let output = bikebot(folder.path())
        .env("BIKEBOT_LOG", "info")
        .args(["check", "ride.toml"])
        .output()
        .unwrap();
    assert!(err(&output).contains("reading yard.json"));
}

#[cfg(unix)]
#[test]
fn names_that_are_not_utf_8_are_names_too() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = folder();
    let name = OsStr::from_bytes(b"ride\xff.toml");
    fs::copy(folder.path().join("short.toml"), folder.path().join(name)).unwrap();
    let output = bikebot(folder.path())
        .arg("run")
        .arg(name)
        .arg("-o")
        .arg(OsStr::from_bytes(b"\xfe.mcap"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert!(folder.path().join(OsStr::from_bytes(b"\xfe.mcap")).exists());
}
