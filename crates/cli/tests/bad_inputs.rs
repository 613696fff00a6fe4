//! Bad input of every kind, each with its exact message and exit code.
//!
//! The cases stand in `tests/bad_inputs/*.txt`, one after another:
//!
//! ```text
//! === an unknown key names the nearest one
//! --- ride.toml
//! @base
//! [follow]
//! max_sped_mps = 1.5
//! $ bikebot check ride.toml
//! --- exit 2
//! error: unknown key `max_sped_mps` in [follow]
//! …
//! ```
//!
//! A file may hold the lines `@base` (a small sound scenario) and `@bytes HEX` (that
//! alone: raw bytes). `@recording N` alone is the first N bytes of a real recording, `@recording`
//! the whole of it; `@folder` alone makes a folder. A word of the command line is quoted with '…'.
//! The expected standard error follows `--- exit CODE`, the expected standard output
//! (none, if left out) follows `--- stdout`.
//!
//! After a change of wording: `BLESS=1 cargo test -p bikebot-cli --test bad_inputs`
//! writes what the program says now into the files; read the difference before committing it.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// A small sound scenario.
const BASE: &str = "\
format = 1
name = \"ride\"
map.bounds_m = [0, 0, 10, 10]
map.box = [{ min_m = [4, 0], max_m = [5, 4] }]
start = { x_m = 1, y_m = 1, heading_deg = 0 }
goal = { x_m = 8, y_m = 8 }
";

/// A ride of a second without a map: the shortest way to a recording.
const SHORT: &str = "\
format = 1
name = \"short\"
start.roll_deg = 1
plant = { model = \"two_link\", step_s = 0.001, control_s = 0.002 }
run.duration_s = 2
";

#[derive(Debug, Default)]
struct Case {
    title: String,
    /// Name and content as written in the case.
    files: Vec<(String, String)>,
    command: String,
    exit: i32,
    stderr: String,
    stdout: String,
}

fn parse(text: &str, path: &Path) -> Vec<Case> {
    enum Into_ {
        Nothing,
        File,
        Stderr,
        Stdout,
    }
    let mut cases: Vec<Case> = Vec::new();
    let mut into = Into_::Nothing;
    for (index, line) in text.lines().enumerate() {
        let place = || format!("{}:{}", path.display(), index + 1);
        if let Some(title) = line.strip_prefix("=== ") {
            cases.push(Case {
                title: title.into(),
                ..Case::default()
            });
            into = Into_::Nothing;
            continue;
        }
        let Some(case) = cases.last_mut() else {
            continue;
        };
        if let Some(code) = line.strip_prefix("--- exit ") {
            case.exit = code
                .parse()
                .unwrap_or_else(|_| panic!("{}: no exit code", place()));
            into = Into_::Stderr;
        } else if line == "--- stdout" {
            into = Into_::Stdout;
        } else if let Some(name) = line.strip_prefix("--- ") {
            case.files.push((name.into(), String::new()));
            into = Into_::File;
        } else if let Some(command) = line.strip_prefix("$ bikebot ") {
            case.command = command.into();
            into = Into_::Nothing;
        } else {
            let target = match into {
                Into_::File => &mut case.files.last_mut().expect("a file was opened").1,
                Into_::Stderr => &mut case.stderr,
                Into_::Stdout => &mut case.stdout,
                Into_::Nothing if line.trim().is_empty() => continue,
                Into_::Nothing => panic!("{}: what is this line for?", place()),
            };
            target.push_str(line);
            target.push('\n');
        }
    }
    for case in &mut cases {
        case.stderr.truncate(case.stderr.trim_end().len());
        case.stdout.truncate(case.stdout.trim_end().len());
    }
    cases
}

fn unparse(cases: &[Case]) -> String {
    let mut text = String::new();
    for case in cases {
        let _ = writeln!(text, "=== {}", case.title);
        for (name, content) in &case.files {
            let _ = writeln!(text, "--- {name}\n{}", content.trim_end_matches('\n'));
        }
        let _ = writeln!(text, "$ bikebot {}", case.command);
        let _ = writeln!(text, "--- exit {}\n{}", case.exit, case.stderr);
        if !case.stdout.is_empty() {
            let _ = writeln!(text, "--- stdout\n{}", case.stdout);
        }
        text.push('\n');
    }
    text.truncate(text.trim_end().len());
    text.push('\n');
    text
}

/// The words of a command line; '…' keeps blanks.
fn words(line: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut word = String::new();
    let (mut quoted, mut begun) = (false, false);
    for c in line.chars() {
        match c {
            '\'' => {
                quoted = !quoted;
                begun = true;
            }
            ' ' if !quoted => {
                if begun {
                    words.push(std::mem::take(&mut word));
                }
                begun = false;
            }
            _ => {
                word.push(c);
                begun = true;
            }
        }
    }
    if begun {
        words.push(word);
    }
    words
}

fn bikebot() -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("bikebot"));
    for name in ["BIKEBOT_SEED", "BIKEBOT_LOG", "COLUMNS"] {
        command.env_remove(name);
    }
    command
}

fn recording() -> &'static [u8] {
    static RECORDING: OnceLock<Vec<u8>> = OnceLock::new();
    RECORDING.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("short.toml"), SHORT).unwrap();
        let output = bikebot()
            .current_dir(folder.path())
            .args(["run", "short.toml", "-o", "short.mcap"])
            .output()
            .unwrap();
        fs::read(folder.path().join("short.mcap"))
            .unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)))
    })
}

fn content(written: &str) -> Option<Vec<u8>> {
    let line = written.trim_end();
    if line == "@folder" {
        return None;
    }
    if let Some(digits) = line.strip_prefix("@bytes ") {
        let digits: Vec<u8> = digits.bytes().filter(u8::is_ascii_hexdigit).collect();
        return Some(
            digits
                .chunks(2)
                .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
                .collect(),
        );
    }
    if let Some(count) = line.strip_prefix("@recording") {
        let count = count.trim().parse().unwrap_or(usize::MAX);
        return Some(recording()[..count.min(recording().len())].to_vec());
    }
    Some(written.replace("@base\n", BASE).into_bytes())
}

fn names_in(folder: &Path) -> BTreeSet<PathBuf> {
    let mut names = BTreeSet::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path.clone());
            }
            names.insert(path);
        }
    }
    names
}

/// Runs the case; what the program said, with the folder's name taken out.
fn observe(case: &Case) -> (i32, String, String) {
    let folder = tempfile::tempdir().unwrap();
    for (name, written) in &case.files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        match content(written) {
            Some(bytes) => fs::write(path, bytes).unwrap(),
            None => fs::create_dir_all(path).unwrap(),
        }
    }
    let before = names_in(folder.path());
    let output = bikebot()
        .current_dir(folder.path())
        .args(words(&case.command))
        .output()
        .unwrap();
    let exit = output.status.code().unwrap_or(-1);
    if exit == 2 {
        assert_eq!(
            before,
            names_in(folder.path()),
            "{}: files were left behind",
            case.title
        );
    }
    let clean = |bytes: &[u8]| {
        let text = String::from_utf8(bytes.to_vec()).expect("messages are UTF-8");
        let text = text.replace(&folder.path().display().to_string(), "[FOLDER]");
        // Where a recording is cut depends on all that is recorded: not told exactly.
        let text = if case.command.contains("mcap") {
            without_numbers(&text)
        } else {
            text
        };
        let lines: Vec<&str> = text.lines().map(str::trim_end).collect();
        lines.join("\n").trim_end().to_owned()
    };
    (exit, clean(&output.stderr), clean(&output.stdout))
}

/// Numbers of two digits and more, with the blanks before them, as ` #`.
fn without_numbers(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let end = rest[start..]
            .find(|c: char| !(c.is_ascii_digit() || c == '.'))
            .map_or(rest.len(), |length| start + length);
        if end - start >= 2 {
            out.push_str(rest[..start].trim_end_matches(' '));
            out.push_str(" #");
        } else {
            out.push_str(&rest[..end]);
        }
        rest = &rest[end..];
    }
    out + rest
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad_inputs")
}

#[test]
fn every_bad_input_has_its_message_and_exit_code() {
    let bless = std::env::var_os("BLESS").is_some();
    let mut paths: Vec<PathBuf> = fs::read_dir(folder())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "txt"))
        .collect();
    paths.sort();
    let (mut count, mut failures) = (0, String::new());
    for path in paths {
        let mut cases = parse(&fs::read_to_string(&path).unwrap(), &path);
        count += cases.len();
        for case in &mut cases {
            let (exit, stderr, stdout) = observe(case);
            assert!(!stderr.contains("panicked"), "{}: {stderr}", case.title);
            let same = exit == case.exit && stderr == case.stderr && stdout == case.stdout;
            if !same && !bless {
                let _ = write!(
                    failures,
                    "\n=== {} ({})\n$ bikebot {}\n--- exit {exit}, expected {}\n{stderr}\n--- expected\n{}\n--- stdout\n{stdout}\n--- expected\n{}\n",
                    case.title,
                    path.display(),
                    case.command,
                    case.exit,
                    case.stderr,
                    case.stdout,
                );
            }
            (case.exit, case.stderr, case.stdout) = (exit, stderr, stdout);
        }
        if bless {
            fs::write(&path, unparse(&cases)).unwrap();
        }
    }
    assert!(failures.is_empty(), "{failures}");
    assert!(count >= 60, "only {count} cases");
}

#[test]
fn no_bad_input_succeeds() {
    for entry in fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        for case in parse(&fs::read_to_string(&path).unwrap(), &path) {
            assert!(case.exit != 0, "{}: {}", path.display(), case.title);
            // `log` tells what it found as a result; everything else is an error.
            let told = case.stderr.starts_with("error: ")
                || (case.command.starts_with("log ") && !case.stdout.is_empty());
            assert!(told, "{}: {}", path.display(), case.title);
        }
    }
}
