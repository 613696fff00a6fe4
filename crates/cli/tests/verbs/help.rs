//! The examples of the help run as they are written there, and the manual pages hold the same.

#![allow(clippy::print_stdout, reason = "a test says what it skips")]

use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::Command;

use crate::common::{SCENE, bikebot, call, err, folder, good, names, out};
use crate::eigenvalues::MEASURED;

/// Every verb that does something.
pub const VERBS: [&str; 21] = [
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
    "map info",
    "map build",
    "info",
    "log check",
    "log recover",
    "completions",
    "man",
];

/// Examples that this test only leaves to the one which parses them all, and why.
const NOT_RUN: [(&str, &str); 6] = [
    ("--live", "lasts as long as the ride does"),
    (
        "bikebot reproduce",
        "20 s on two cores; `tests/browser/reproduce.py` runs it",
    ),
    (
        "bikebot table2",
        "4 s to a minute; `verbs/table2.rs` runs it on a coarser grid",
    ),
    ("sweep push.toml", "81 rides"),
    (
        "bikebot map build",
        "asks for logs that are not ours; `verbs/map.rs` makes some",
    ),
    (
        "unknown-yard-1.mcap",
        "a ride of 40 s with its laser; `verbs/plot.rs` draws such moments",
    ),
];

/// The lines below "Examples:".
fn examples(verb: &str) -> Vec<String> {
    let help = good(Path::new("."), &format!("{verb} --help")).replace("\\\n", " ");
    let (_, rest) = help.split_once("Examples:\n").expect("there are examples");
    rest.lines()
        .take_while(|line| !line.is_empty())
        .map(|line| line.trim().to_owned())
        .collect()
}

/// A picture of two by two white points.
const FLOOR: &[u8] = b"\x89\x50\x4e\x47\x0d\x0a\x1a\x0a\x00\x00\x00\x0d\x49\x48\x44\x52\x00\x00\x00\x02\x00\x00\x00\x02\
    \x08\x00\x00\x00\x00\x57\xdd\x52\xf8\x00\x00\x00\x11\x49\x44\x41\x54\x78\x01\x01\x06\x00\xf9\xff\
    \x00\xff\xff\x00\xff\xff\x0b\xfa\x03\xfd\x19\x89\xd3\x56\x00\x00\x00\x00\x49\x45\x4e\x44\xae\x42\
    \x60\x82";

/// A home with everything that the examples name.
fn home() -> tempfile::TempDir {
    let folder = folder();
    let path = folder.path();
    let write = |name: &str, bytes: &[u8]| fs::write(path.join(name), bytes).unwrap();
    good(path, "init");
    let mut image = b"P5 10 10 255\n".to_vec();
    image.extend([255_u8; 100]);
    write("yard.pgm", &image);
    write("floor.png", FLOOR);
    write("scene.json", SCENE.as_bytes());
    write(
        "yard.yaml",
        b"image: yard.pgm\nresolution: 1.0\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
    );
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = here.ancestors().nth(2).unwrap();
    fs::create_dir(path.join("scenarios")).unwrap();
    copy(&root.join("scenarios"), &path.join("scenarios"));
    write("BrowserBenchmark.txt", MEASURED.as_bytes());
    good(path, "plan scene.json -o plan.json");
    good(path, "run short.toml -o ride.mcap");
    for name in ["fig7-1.mcap", "pvfc.mcap", "stanley.mcap", "cut.mcap.part"] {
        fs::copy(path.join("ride.mcap"), path.join(name)).unwrap();
    }
    // Cut in the middle, as a crash leaves it.
    let whole = fs::read(path.join("ride.mcap")).unwrap();
    for name in ["ride.mcap.part", "cut.mcap.part"] {
        write(name, &whole[..whole.len() / 2]);
    }
    for name in [
        ".local/share/bash-completion/completions",
        ".zfunc",
        ".config/fish/completions",
    ] {
        fs::create_dir_all(path.join(name)).unwrap();
    }
    folder
}

fn copy(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let to = to.join(entry.file_name());
        if entry.path().is_dir() {
            fs::create_dir(&to).unwrap();
            copy(&entry.path(), &to);
        } else {
            fs::copy(entry.path(), &to).unwrap();
        }
    }
}

/// Whether the machine has a program.
fn is_there(name: &str) -> bool {
    Command::new("sh")
        .args(["-c", &format!("command -v {name}")])
        .output()
        .is_ok_and(|output| output.status.success())
}

#[cfg(unix)]
#[test]
fn the_examples_of_the_help_run_as_they_are_written() {
    let program = Path::new(assert_cmd::cargo::cargo_bin!("bikebot")).to_owned();
    let mut paths = OsString::from(program.parent().unwrap());
    paths.push(":");
    paths.push(std::env::var_os("PATH").unwrap_or_default());
    let template = home();
    let (mut ran, mut left) = (0, 0);
    for verb in VERBS {
        let examples = examples(verb);
        assert!((2..=6).contains(&examples.len()), "{verb}: {examples:?}");
        for line in examples {
            if NOT_RUN.iter().any(|(part, _)| line.contains(part)) {
                left += 1;
                continue;
            }
            if let Some(tool) = ["jq", "man"]
                .into_iter()
                .find(|tool| line.contains(&format!("| {tool} ")) && !is_there(tool))
            {
                println!("skipped: no {tool} on this machine for: {line}");
                continue;
            }
            let home = tempfile::tempdir().unwrap();
            copy(template.path(), home.path());
            // What the line writes is not there yet.
            let mut words = line.split_whitespace().skip_while(|word| *word != "-o");
            let mut written: Vec<&str> = words.nth(1).into_iter().collect();
            match verb {
                "init" if line != "bikebot run scenario.toml" => written.push("scenario.toml"),
                "log recover" => written.push("ride.mcap"),
                "log check" => {}
                _ => written.push("ride.mcap.part"),
            }
            for name in written {
                let _ = fs::remove_file(home.path().join(name));
            }
            let output = Command::new("sh")
                .args(["-c", &line])
                .current_dir(home.path())
                .env("PATH", &paths)
                .env("HOME", home.path())
                .env_remove("BIKEBOT_SEED")
                .output()
                .unwrap();
            // A cut log is said to be cut, a plan fails its check for another footprint, and a slow machine may find
            // nothing in time.
            let may_fail = [".part", "verify plan.json", "--time-limit"]
                .iter()
                .any(|part| line.contains(part));
            let code = output.status.code();
            assert!(
                code == Some(0) || may_fail && matches!(code, Some(1 | 3)),
                "{line}: {code:?}\n{}{}",
                out(&output),
                err(&output)
            );
            ran += 1;
        }
    }
    assert!(ran >= 40, "{ran} ran and {left} did not");
}

#[test]
fn every_verb_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    let whole = good(folder.path(), "man");
    for verb in VERBS {
        let name = verb.replace(' ', "-");
        let first = name.split('-').next().unwrap();
        assert!(whole.contains(&format!("bikebot\\-{first}(1)")), "{verb}");
    }
    assert!(whole.contains("Exit codes") && whole.contains("BIKEBOT_SEED"));
    good(folder.path(), "man -o pages");
    let pages = names(&folder.path().join("pages"));
    // And those of the whole, of `map` and of `log`.
    assert_eq!(pages.len(), VERBS.len() + 3, "{pages:?}");
    for verb in VERBS {
        let name = format!("bikebot-{}.1", verb.replace(' ', "-"));
        let page = fs::read_to_string(folder.path().join("pages").join(&name)).unwrap();
        assert!(
            page.contains(".SH SYNOPSIS") && page.contains(".SH EXAMPLES\n.nf\n"),
            "{name}"
        );
        assert_eq!(page, good(folder.path(), &format!("man {verb}")), "{name}");
    }
    let again = call(folder.path(), "man -o pages");
    assert_eq!(again.status.code(), Some(2), "{}", err(&again));
    good(folder.path(), "man -o pages --force");
    let unknown = call(folder.path(), "man walk");
    assert_eq!(unknown.status.code(), Some(2));
    assert!(err(&unknown).contains("there is no verb `walk`"));
}

/// What a command leaves on a terminal of 80 columns, and its exit code; `None` where there is no `script` to make one.
#[cfg(unix)]
fn on_a_terminal(folder: &Path, line: &str) -> Option<String> {
    if !is_there("script") {
        println!("skipped: no `script` on this machine to make a terminal");
        return None;
    }
    let program = assert_cmd::cargo::cargo_bin!("bikebot");
    let line = format!("stty cols 80; '{}' {line}", program.display());
    let output = Command::new("script")
        .args(["-qec", &line, "/dev/null"])
        .current_dir(folder)
        .env("TERM", "xterm")
        .env_remove("NO_COLOR")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{line}: {}", out(&output));
    Some(out(&output))
}

#[cfg(unix)]
#[test]
fn progress_is_shown_on_a_terminal_and_changes_no_result() {
    let folder = folder();
    let path = folder.path();
    let hash = |name: &str| {
        let text = fs::read_to_string(path.join(name)).unwrap();
        let text = &text[text.find("result_hash").expect("a hash")..];
        text[..90].to_owned()
    };
    for (verb, seen, rest) in [
        ("run short.toml", "s simulated", "-o a.mcap --force"),
        ("plan yard.json", "planning: ", ""),
    ] {
        let line = format!("{verb} {rest} --json");
        let Some(shown) = on_a_terminal(path, &format!("{line} > watched.json")) else {
            return;
        };
        assert!(shown.contains(seen), "{line}: {shown}");
        fs::write(path.join("plain.json"), good(path, &line)).unwrap();
        assert_eq!(hash("watched.json"), hash("plain.json"), "{line}");
        for flag in ["-q", "--no-progress"] {
            let shown = on_a_terminal(path, &format!("{line} {flag} > quiet.json")).unwrap();
            assert_eq!(shown, "", "{line} {flag}");
        }
    }
    let sweep = "sweep short.toml --vary start.roll_deg=0:2:3 -o a.csv --force";
    let shown = on_a_terminal(path, &format!("{sweep} > summary.txt")).unwrap();
    assert!(shown.contains("/3, ") && shown.contains("to go"), "{shown}");
}

#[test]
fn nothing_is_shown_where_standard_error_is_no_terminal() {
    let folder = folder();
    for line in [
        "run short.toml -o a.mcap",
        "plan yard.json",
        "sweep short.toml --runs 3 -o a.csv",
        "table2 --runs 1 --set planner.grid.cell_scales=4",
    ] {
        let output = bikebot(folder.path())
            .args(line.split_whitespace())
            .output()
            .unwrap();
        assert_eq!(err(&output), "", "{line}");
    }
}
