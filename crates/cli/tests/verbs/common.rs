//! Calling the program, and what it is called on.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

/// A ride of two seconds without a map: the shortest there is.
pub const SHORT: &str = "\
format = 1
name = \"short\"
start.roll_deg = 1
plant = { model = \"two_link\", step_s = 0.001, control_s = 0.002 }
run.duration_s = 2
";

/// A field with one block.
pub const SCENE: &str = r#"{"name": "yard", "unit": "m", "width": 10, "height": 10,
"start": [1, 1, 0], "goal": [8, 8, 90], "obstacles": [{"polygon": [[4, 0], [5, 0], [5, 4], [4, 4]]}]}"#;

pub fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("short.toml"), SHORT).unwrap();
    fs::write(folder.path().join("yard.json"), SCENE).unwrap();
    folder
}

pub fn bikebot(folder: &Path) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("bikebot"));
    for name in ["BIKEBOT_SEED", "BIKEBOT_LOG", "NO_COLOR"] {
        command.env_remove(name);
    }
    command.current_dir(folder);
    command
}

pub fn call(folder: &Path, line: &str) -> Output {
    bikebot(folder)
        .args(line.split_whitespace())
        .output()
        .unwrap()
}

pub fn out(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

pub fn err(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Calls, and demands success.
pub fn good(folder: &Path, line: &str) -> String {
    let output = call(folder, line);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{line}\n{}{}",
        out(&output),
        err(&output)
    );
    out(&output)
}

pub fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

pub fn keys(value: &Value) -> BTreeSet<&str> {
    value
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect()
}

pub fn names(folder: &Path) -> BTreeSet<String> {
    fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}
