//! What the README and the book say one can type works as it is written there: commands run in a scratch folder, scenarios
//! are read, and code is that of `examples/`. What is left out, and why, stands in [`LEFT_OUT`] and nowhere else.
#![cfg(unix)]
#![allow(clippy::print_stdout, reason = "a test says what it leaves out")]

use std::ffi::OsString;
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;

use bikebot_sim::ScenarioFile;

/// Parts of commands that are not run here, with the reason.
const LEFT_OUT: [(&str, &str); 14] = [
    ("cargo test", "it is what runs this"),
    (
        "cargo bench",
        "minutes each; their results are in docs/performance.md",
    ),
    ("cargo install", "builds the program a second time"),
    (
        "cargo run --release --example",
        "campaigns of minutes; `.ci/run` runs the short examples",
    ),
    ("mdbook", "`.ci/run` builds the book"),
    ("pip install", "`.ci/run` installs the package"),
    ("pytest", "`.ci/run` runs it"),
    ("python ", "`.ci/run` runs the Python scripts of tests/"),
    (
        "--live",
        "lasts as long as the ride does; tests/python/watch_live.py watches one",
    ),
    (
        "reproduce",
        "20 s on two cores; tests/browser/reproduce.py runs it",
    ),
    ("--runs 100", "campaigns of 200 rides and of 1000 plans"),
    ("--vary disturbance.0.impulse_ns", "a campaign of 306 rides"),
    (
        "map build",
        "asks for logs that are not ours; crates/cli/tests/verbs/map.rs makes some",
    ),
    (
        "/tmp/",
        "makes the pictures of the book anew, outside of any scratch folder",
    ),
];

fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).expect("crates/cli").to_owned()
}

/// The README and every page of the book, each with its text.
fn pages() -> Vec<(String, String)> {
    let root = root();
    let mut names = vec!["README.md".to_owned()];
    let docs = fs::read_dir(root.join("docs")).unwrap();
    let mut inside: Vec<String> = docs
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".md"))
        .map(|name| format!("docs/{name}"))
        .collect();
    inside.sort();
    names.extend(inside);
    names
        .into_iter()
        .map(|name| {
            let text = fs::read_to_string(root.join(&name)).unwrap();
            (name, text)
        })
        .collect()
}

/// The fenced blocks of one language.
fn blocks(text: &str, language: &str) -> Vec<String> {
    let mut blocks = Vec::new();
    let mut open: Option<(bool, String)> = None;
    for line in text.lines() {
        match (&mut open, line.strip_prefix("```")) {
            (None, Some(tag)) => {
                let tag = tag.split(',').next().unwrap_or_default();
                open = Some((tag == language, String::new()));
            }
            (Some((wanted, block)), Some(_)) => {
                if *wanted {
                    blocks.push(block.clone());
                }
                open = None;
            }
            (Some((_, block)), None) => {
                block.push_str(line);
                block.push('\n');
            }
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "a block is not closed");
    blocks
}

/// The commands of a block: continued lines and loops are one.
fn commands(block: &str) -> Vec<String> {
    let mut commands: Vec<String> = Vec::new();
    let mut is_open = false;
    for line in block.lines() {
        if is_open {
            let last = commands.last_mut().expect("one was begun");
            last.push('\n');
            last.push_str(line);
        } else if line.trim().is_empty() || line.starts_with('#') {
            continue;
        } else {
            commands.push(line.to_owned());
        }
        let whole = commands.last().expect("one was begun");
        is_open = line.ends_with('\\') || whole.starts_with("for ") && line != "done";
    }
    commands
}

/// A folder as a clone of the repository, without its sources: what is written into it is gone with it.
fn scratch() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    for name in ["scenarios", "layouts", "examples"] {
        symlink(root().join(name), path.join(name)).unwrap();
    }
    fs::create_dir_all(path.join("docs/figures")).unwrap();
    let mut image = b"P5 200 100 255\n".to_vec();
    image.extend(vec![255_u8; 20_000]);
    fs::write(path.join("my_map.pgm"), image).unwrap();
    fs::write(
        path.join("my_map.yaml"),
        "image: my_map.pgm\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
    )
    .unwrap();
    // `cargo run --release -- VERB` is the program that is built already.
    fs::create_dir(path.join(".bin")).unwrap();
    let cargo = path.join(".bin/cargo");
    fs::write(
        &cargo,
        "#!/bin/sh\n[ \"$1 $2 $3\" = 'run --release --' ] || { echo \"not here: cargo $*\"; exit 9; }\nshift 3\nexec bikebot \"$@\"\n",
    )
    .unwrap();
    fs::set_permissions(&cargo, fs::Permissions::from_mode(0o755)).unwrap();
    folder
}

fn run_commands_of(is_wanted: impl Fn(&str) -> bool) -> usize {
    let program = Path::new(assert_cmd::cargo::cargo_bin!("bikebot")).to_owned();
    let mut ran = 0;
    for (name, text) in pages() {
        if !is_wanted(&name) {
            continue;
        }
        let folder = scratch();
        let mut paths = OsString::from(folder.path().join(".bin"));
        paths.push(":");
        paths.push(program.parent().unwrap());
        paths.push(":");
        paths.push(std::env::var_os("PATH").unwrap_or_default());
        for command in blocks(&text, "sh").iter().flat_map(|block| commands(block)) {
            if let Some((_, reason)) = LEFT_OUT.iter().find(|(part, _)| command.contains(part)) {
                println!("left out of {name}: {command}: {reason}");
                continue;
            }
            let output = Command::new("sh")
                .args(["-c", &command])
                .current_dir(folder.path())
                .env("PATH", &paths)
                .env("HOME", folder.path())
                .env_remove("BIKEBOT_SEED")
                .output()
                .unwrap();
            assert!(
                output.status.success(),
                "{name}: {command}\n{}{}",
                String::from_utf8_lossy(&output.stdout),
                String::from_utf8_lossy(&output.stderr)
            );
            ran += 1;
        }
    }
    ran
}

#[test]
fn the_commands_of_the_readme_run_as_they_are_written() {
    let ran = run_commands_of(|name| name == "README.md");
    assert!(ran >= 8, "only {ran} were run");
}

#[test]
fn the_commands_of_the_book_run_as_they_are_written() {
    let ran = run_commands_of(|name| name != "README.md");
    assert!(ran >= 15, "only {ran} were run");
}

#[test]
fn the_scenarios_of_the_readme_and_the_book_are_sound() {
    let mut seen = 0;
    for (name, text) in pages() {
        for block in blocks(&text, "toml") {
            // A part of a scenario is read as one that has nothing else.
            let whole = if block.contains("format = 1") {
                block.clone()
            } else {
                format!("format = 1\nname = \"part\"\n{block}")
            };
            if let Err(error) = ScenarioFile::parse(&whole, &[]) {
                panic!("{name}: {}\n{block}", error.message);
            }
            seen += 1;
        }
    }
    assert!(seen >= 4, "only {seen} were found");
}

/// Without indentation: a part of a function reads the same on a page.
fn flat(text: &str) -> String {
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    lines.collect::<Vec<_>>().join("\n")
}

#[test]
fn the_code_of_the_readme_and_the_book_is_that_of_the_examples() {
    let root = root();
    let mut sources = String::new();
    for entry in fs::read_dir(root.join("examples")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|kind| kind == "rs") {
            sources.push_str(&flat(&fs::read_to_string(path).unwrap()));
        }
    }
    for (name, text) in pages() {
        for block in blocks(&text, "rust") {
            let is_include = block.trim_start().starts_with("{{#include ../examples/");
            assert!(
                is_include || sources.contains(&flat(&block)),
                "{name}: this is in no example:\n{block}"
            );
        }
    }
}

/// The targets of the links and pictures of a page, without what stands in code.
fn links(text: &str) -> Vec<String> {
    let mut links = Vec::new();
    let mut is_code = false;
    for line in text.lines() {
        if line.starts_with("```") {
            is_code = !is_code;
        }
        if is_code {
            continue;
        }
        // Every second piece stands between backquotes.
        let plain: String = line.split('`').step_by(2).collect::<Vec<_>>().join("``");
        for piece in plain.split("](").skip(1) {
            links.push(piece.split(')').next().unwrap_or_default().to_owned());
        }
    }
    links
}

/// The anchors of a page's headings, as mdBook and GitHub make them.
fn anchors(text: &str) -> Vec<String> {
    let mut anchors = Vec::new();
    let mut is_code = false;
    for line in text.lines() {
        if line.starts_with("```") {
            is_code = !is_code;
        }
        if !is_code && line.starts_with('#') {
            let title = line.trim_start_matches('#').trim();
            let anchor = title.chars().filter_map(|c| match c {
                ' ' => Some('-'),
                c if c.is_alphanumeric() || "-_".contains(c) => c.to_lowercase().next(),
                _ => None,
            });
            anchors.push(anchor.collect());
        }
    }
    anchors
}

#[test]
fn every_link_picture_and_include_leads_somewhere() {
    let root = root();
    let mut seen = 0;
    for (name, text) in pages() {
        let file = root.join(&name);
        let folder = file.parent().unwrap();
        for link in links(&text) {
            seen += 1;
            if link.contains("://") || link.starts_with("mailto:") {
                continue;
            }
            let (path, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = if path.is_empty() {
                file.clone()
            } else {
                folder.join(path)
            };
            assert!(target.exists(), "{name}: {link} leads nowhere");
            if !anchor.is_empty() {
                let there = anchors(&fs::read_to_string(&target).unwrap());
                assert!(
                    there.iter().any(|it| it == anchor),
                    "{name}: {link}: {there:?}"
                );
            }
        }
        for include in text.split("{{#").skip(1) {
            seen += 1;
            let what = include.split("}}").next().unwrap_or_default();
            let (_, source) = what.split_once(' ').expect("a file is named");
            let (path, anchor) = source.split_once(':').unwrap_or((source, ""));
            let source = fs::read_to_string(folder.join(path))
                .unwrap_or_else(|error| panic!("{name}: {what}: {error}"));
            for end in ["ANCHOR", "ANCHOR_END"] {
                let mark = format!("// {end}: {anchor}\n");
                assert!(source.contains(&mark), "{name}: {what}: no {mark}");
            }
        }
    }
    assert!(seen > 60, "only {seen} were found");
}

#[test]
fn every_page_stands_in_the_summary_once() {
    let docs = root().join("docs");
    let summary = fs::read_to_string(docs.join("SUMMARY.md")).unwrap();
    for (name, _) in pages() {
        let Some(name) = name.strip_prefix("docs/") else {
            continue;
        };
        let count = summary.matches(&format!("]({name})")).count();
        let wanted = usize::from(name != "SUMMARY.md");
        assert_eq!(
            count, wanted,
            "{name} stands in docs/SUMMARY.md {count} times"
        );
    }
}
