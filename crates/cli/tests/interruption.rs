//! Runs that do not end by themselves: Ctrl-C, a kill, a full disk.
#![cfg(unix)]

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

/// A day of standing still: nobody waits for its end.
const ENDLESS: &str = "\
format = 1
name = \"endless\"
start.roll_deg = 1
plant = { model = \"two_link\", step_s = 0.001, control_s = 0.002 }
run.duration_s = 86400
";

fn bikebot(folder: &Path, line: &str) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("bikebot"));
    command.current_dir(folder).args(line.split_whitespace());
    command
}

fn call(folder: &Path, line: &str) -> (Option<i32>, String) {
    let output = bikebot(folder, line).output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(text).unwrap())
}

/// Starts a run that does not end, and waits until some of it is on the disk.
fn start(folder: &Path) -> Child {
    fs::write(folder.join("endless.toml"), ENDLESS).unwrap();
    let mut child = bikebot(folder, "run endless.toml -o ride.mcap --json")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let part = folder.join("ride.mcap.part");
    for _ in 0..600 {
        if fs::metadata(&part).is_ok_and(|facts| facts.len() > 20_000) {
            return child;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    panic!("nothing was recorded within half a minute");
}

fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill")
        .args([name, &child.id().to_string()])
        .status()
        .unwrap();
    assert!(sent.success());
}

fn end(child: Child) -> Output {
    child.wait_with_output().unwrap()
}

#[test]
fn ctrl_c_closes_the_recording_and_ends_with_130() {
    for name in ["-INT", "-TERM"] {
        let folder = tempfile::tempdir().unwrap();
        let child = start(folder.path());
        signal(&child, name);
        let output = end(child);
        assert_eq!(output.status.code(), Some(130));
        let run: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(run["outcome"], "interrupted");
        assert!(folder.path().join("ride.mcap").exists());
        assert!(!folder.path().join("ride.mcap.part").exists());
        let (code, text) = call(folder.path(), "log check ride.mcap");
        assert_eq!(code, Some(0), "{text}");
        let (_, text) = call(folder.path(), "info ride.mcap");
        assert!(text.contains("interrupted"), "{text}");
    }
}

#[test]
fn a_killed_run_leaves_a_part_that_can_be_saved() {
    for round in 0..10 {
        let folder = tempfile::tempdir().unwrap();
        let child = start(folder.path());
        // Different moments, in and between the writes.
        std::thread::sleep(Duration::from_micros(1_700 * round));
        signal(&child, "-KILL");
        end(child);
        assert!(
            !folder.path().join("ride.mcap").exists(),
            "half a file has the final name"
        );
        let (code, text) = call(folder.path(), "log recover ride.mcap.part -o ride.mcap");
        assert!(matches!(code, Some(0 | 3)), "{text}");
        let (code, text) = call(folder.path(), "log check ride.mcap");
        assert_eq!(code, Some(0), "{text}");
        // What was saved can be run again.
        let (code, text) = call(
            folder.path(),
            "run --from ride.mcap --set run.duration_s=1 -o again.mcap",
        );
        assert_eq!(code, Some(0), "{text}");
    }
}

/// A file that may not grow stands for a disk that is full: no special rights are needed for it.
#[test]
fn a_full_disk_is_told_and_the_result_is_not_lost() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("ride.toml"),
        ENDLESS.replace("86400", "60"),
    )
    .unwrap();
    let binary = assert_cmd::cargo::cargo_bin!("bikebot");
    let output = Command::new("sh")
        .current_dir(folder.path())
        .arg("-c")
        .arg(format!(
            "trap '' XFSZ; ulimit -f 64; exec '{}' run ride.toml -o ride.mcap",
            binary.display()
        ))
        .output()
        .unwrap();
    let (out, err) = (
        String::from_utf8_lossy(&output.stdout).into_owned(),
        String::from_utf8_lossy(&output.stderr).into_owned(),
    );
    assert_eq!(output.status.code(), Some(3), "{out}{err}");
    assert!(out.starts_with("endless: arrived"), "{out}{err}");
    assert!(
        err.starts_with("error: cannot record to ride.mcap: "),
        "{err}"
    );
    assert!(err.contains("log recover ride.mcap.part"), "{err}");
    assert!(!folder.path().join("ride.mcap").exists());
    let (code, text) = call(folder.path(), "log recover ride.mcap.part -o saved.mcap");
    assert_eq!(code, Some(3), "{text}");
    let (code, text) = call(folder.path(), "log check saved.mcap");
    assert_eq!(code, Some(0), "{text}");
}

/// A CARMEN log of a robot that stands in a wide ring and looks around: long to enter into cells.
fn long_log() -> String {
    let ranges = vec!["30.00"; 181].join(" ");
    let mut text = String::new();
    for scan in 0..6000 {
        text += &format!("FLASER 181 {ranges} 0 0 0 0 0 0 {scan}.5 host {scan}.5\n");
    }
    text
}

#[test]
fn a_map_that_is_interrupted_leaves_no_part_of_it_and_keeps_the_old_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("ring.log"), long_log()).unwrap();
    for name in ["-INT", "-TERM"] {
        fs::write(path.join("ring.yaml"), "old").unwrap();
        let child = bikebot(
            path,
            "map build ring.log -o ring.yaml --resolution 0.01 --force",
        )
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
        // The files are opened after the handler is in place.
        let part = path.join("ring.yaml.part");
        for _ in 0..6000 {
            if part.exists() {
                break;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        signal(&child, name);
        let output = end(child);
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(130), "{told}");
        assert_eq!(told, "interrupted: no map was written\n");
        assert!(output.stdout.is_empty());
        let mut left: Vec<_> = fs::read_dir(path)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        left.sort();
        assert_eq!(left, ["ring.log", "ring.yaml"]);
        assert_eq!(fs::read(path.join("ring.yaml")).unwrap(), b"old");
    }
}

#[test]
fn a_plan_that_is_interrupted_tells_what_it_has() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("yard.json"),
        r#"{"name": "yard", "unit": "m", "width": 10, "height": 10, "start": [1, 1, 0], "goal": [8, 8, 90], "obstacles": []}"#,
    )
    .unwrap();
    let child = bikebot(
        folder.path(),
        "plan yard.json --method paper --set planner.iterations=1000000000 --json",
    )
    .stdout(Stdio::piped())
    .stderr(Stdio::piped())
    .spawn()
    .unwrap();
    // Long enough to have installed the handler; too early a signal would only kill.
    std::thread::sleep(Duration::from_secs(2));
    signal(&child, "-INT");
    let output = end(child);
    assert_eq!(output.status.code(), Some(130));
    let plan: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    // What was found until then is told; it was not searched to the end.
    assert!(
        plan["reason"] == "found" || plan["reason"] == "cancelled",
        "{plan}"
    );
    assert!(plan["iterations"].as_u64() < Some(1_000_000_000));
}
