//! `bikebot reproduce`: the reduced form, made once, and the folder it goes to.

use std::fs;
use std::path::Path;
use std::process::Output;
use std::sync::OnceLock;

use crate::common::{call, err, good, json, keys, names, out};
use serde_json::Value;
use tempfile::TempDir;

struct Made {
    folder: TempDir,
    output: Output,
}

/// The reduced form, made once for all tests here.
fn made() -> &'static Made {
    static MADE: OnceLock<Made> = OnceLock::new();
    MADE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let output = call(folder.path(), "reproduce --quick -o paper --json");
        Made { folder, output }
    })
}

fn told() -> Value {
    json(&out(&made().output))
}

fn file(name: &str) -> String {
    fs::read_to_string(made().folder.path().join("paper").join(name)).unwrap()
}

#[test]
fn every_claim_has_a_verdict_and_the_exit_code_tells_of_them() {
    let told = told();
    assert_eq!(
        keys(&told),
        [
            "claims",
            "differs",
            "fails",
            "holds",
            "not_measured",
            "output",
            "rides",
            "runs",
            "seed",
            "version"
        ]
        .into()
    );
    let claims = told["claims"].as_array().unwrap();
    assert!(claims.len() >= 24);
    let count = |verdict: &str| claims.iter().filter(|it| it["verdict"] == verdict).count();
    for verdict in ["holds", "differs", "fails", "not_measured"] {
        assert_eq!(told[verdict], count(verdict), "{verdict}");
    }
    let code = i32::from(count("fails") > 0);
    assert_eq!(made().output.status.code(), Some(code));
    for claim in claims {
        // Times depend on what else the machine does; all else is the same everywhere.
        if !matches!(claim["id"].as_str(), Some("time" | "faster")) {
            assert_ne!(claim["verdict"], "fails", "{claim}");
        }
        assert!(claim["ours"].as_str().is_some_and(|text| !text.is_empty()));
        assert_eq!(
            claim["verdict"] == "differs",
            claim.get("difference").is_some()
        );
    }
}

#[test]
fn the_folder_holds_pages_figures_tables_and_what_the_commands_need() {
    let folder = made().folder.path().join("paper");
    let mut wanted: Vec<String> = [
        "index.html",
        "report.md",
        "table2.csv",
        "claims.json",
        "measured.json",
        "scenarios",
    ]
    .map(str::to_owned)
    .into();
    for number in 5..=8 {
        wanted.extend([format!("fig{number}.svg"), format!("fig{number}.png")]);
    }
    assert_eq!(names(&folder), wanted.into_iter().collect());
    assert!(file("index.html").contains("measured again"));
    let claims = json(&file("claims.json"));
    assert_eq!(claims["claims"], told()["claims"]);
    // A command of the page, in its folder, gives the ride that stands on it.
    let ride = json(&good(
        &folder,
        "run scenarios/fig7.toml --seed 2 -o ../ride.mcap --json",
    ));
    let measured = json(&file("measured.json"));
    assert_eq!(measured["flywheel"][1]["result_hash"], ride["result_hash"]);
}

#[test]
fn a_folder_that_is_not_empty_is_left_alone_unless_told_otherwise() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::create_dir(path.join("mine")).unwrap();
    fs::write(path.join("mine/notes.txt"), "mine").unwrap();
    let output = call(path, "reproduce --quick -o mine");
    assert_eq!(output.status.code(), Some(2));
    assert!(
        err(&output).contains("the folder mine is not empty"),
        "{}",
        err(&output)
    );
    assert_eq!(names(&path.join("mine")), ["notes.txt".to_owned()].into());
    fs::write(path.join("file"), "").unwrap();
    let output = call(path, "reproduce --quick -o file");
    assert_eq!(output.status.code(), Some(3));
    assert!(err(&output).contains("file is a file"), "{}", err(&output));
}

#[test]
fn few_runs_may_fail_and_then_the_exit_code_says_so() {
    let folder = tempfile::tempdir().unwrap();
    // Of one plan each the shortest is no claim of the paper's; which ones fail is chance, and always the same.
    let output = call(folder.path(), "reproduce --runs 1 --seed 1 --json -q");
    let told = json(&out(&output));
    let fails = told["fails"].as_u64().unwrap();
    assert_eq!(output.status.code(), Some(i32::from(fails > 0)));
    assert_eq!(told["output"], "reproduction");
    assert!(folder.path().join("reproduction/index.html").exists());
}

#[cfg(unix)]
#[test]
fn one_that_is_interrupted_leaves_nothing_behind() {
    use std::process::{Command, Stdio};
    use std::time::Duration;
    let folder = tempfile::tempdir().unwrap();
    let mut child = crate::common::bikebot(folder.path())
        .args(["reproduce", "--runs", "100000", "-o", "paper"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let is_there = |path: &Path| path.join("paper").exists();
    for _ in 0..600 {
        if is_there(folder.path()) {
            break;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    let sent = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(sent.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(!is_there(folder.path()), "{:?}", names(folder.path()));
}
