//! The figures of shipped scenarios are, byte for byte, those that were looked at.
//!
//! Kept is a digest of each; what differs is written to a folder to be looked at, and `BLESS=1` keeps it.
//! Fig. 5 to 8 of the paper are kept likewise, by the tests of `report::reproduction`.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use bikebot_sim::record::sha256_hex;
use serde_json::Value;

const KEPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/figures/shipped.txt");

fn scenario(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../scenarios")
        .join(name)
}

fn good(folder: &Path, line: &str) {
    let output = Command::new(assert_cmd::cargo::cargo_bin!("bikebot"))
        .env_remove("BIKEBOT_SEED")
        .current_dir(folder)
        .args(line.split_whitespace())
        .arg("-q")
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{line}\n{told}");
}

/// Wall-clock times are those of the machine: none stand in a picture made of this.
fn without_times(plan: &mut Value) {
    let Some(entries) = plan.as_object_mut() else {
        return;
    };
    for key in ["time_s", "first_s", "prepare_s"] {
        entries.remove(key);
    }
    let trace = entries.get_mut("trace").and_then(Value::as_array_mut);
    for (index, improvement) in trace.into_iter().flatten().enumerate() {
        improvement["time_s"] = Value::from(1e-3 * (index + 1) as f64);
    }
}

fn plan(folder: &Path, name: &str) {
    let of = scenario(&format!("planning/{name}.toml"));
    good(folder, &format!("plan {} -o {name}.json", of.display()));
    let path = folder.join(format!("{name}.json"));
    let mut plan: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    without_times(&mut plan);
    fs::write(&path, plan.to_string()).unwrap();
    good(folder, &format!("plot {name}.json --separate -o pictures"));
}

fn ride(folder: &Path, name: &str, at: Option<&str>) {
    let of = scenario(&format!("{name}.toml"));
    good(folder, &format!("run {} -o {name}.mcap", of.display()));
    good(folder, &format!("plot {name}.mcap -o pictures"));
    if let Some(at) = at {
        good(folder, &format!("plot {name}.mcap --at {at} -o pictures"));
    }
}

#[test]
#[expect(clippy::print_stdout, reason = "a test that is skipped says so")]
fn figures_of_shipped_scenarios_are_those_that_were_looked_at() {
    if !cfg!(all(target_arch = "x86_64", target_os = "linux")) {
        println!("skipped: sines of another platform may differ in their last bit");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    plan(path, "maze");
    plan(path, "narrow");
    plan(path, "fig6");
    ride(path, "fig7", None);
    ride(path, "figure-eight", None);
    ride(path, "push", None);
    ride(path, "blocked-way", Some("1,5,9,16"));
    ride(path, "crossing", Some("5,12,20"));
    let of = scenario("fig7.toml");
    let line = format!("eigenvalues {} -o pictures/eigenvalues.svg", of.display());
    good(path, &line);
    let of = scenario("balance-recover.toml");
    let varied = "--vary start.roll_deg=0:12:5 --vary start.roll_rate_radps=-0.4:0.4:5";
    let line = format!(
        "sweep {} {varied} -o envelope.csv --map pictures/envelope.svg",
        of.display()
    );
    good(path, &line);
    good(
        path,
        "plot fig7.mcap --format png --zoom 0.5 -o pictures/png",
    );
    assert!(path.join("pictures/png/fig7.png").exists());

    let mut now = BTreeMap::new();
    for entry in fs::read_dir(path.join("pictures")).unwrap() {
        let picture = entry.unwrap().path();
        if picture.extension().is_some_and(|it| it == "svg") {
            let bytes = fs::read(&picture).unwrap();
            let text = String::from_utf8_lossy(&bytes);
            assert!(!text.contains("NaN") && !text.contains("inf\""));
            let name = picture.file_name().unwrap().to_str().unwrap().to_owned();
            now.insert(name, (sha256_hex(&bytes), bytes));
        }
    }
    let lines: String = now
        .iter()
        .map(|(name, (digest, bytes))| format!("{digest} {:7} {name}\n", bytes.len()))
        .collect();
    let kept = fs::read_to_string(KEPT).unwrap_or_default();
    if lines == kept {
        return;
    }
    let shown = Path::new(env!("CARGO_TARGET_TMPDIR")).join("figures");
    fs::create_dir_all(&shown).unwrap();
    let mut differ = Vec::new();
    for (name, (digest, bytes)) in &now {
        if !kept.contains(digest.as_str()) {
            fs::write(shown.join(name), bytes).unwrap();
            differ.push(name.as_str());
        }
    }
    if std::env::var_os("BLESS").is_some() {
        fs::write(KEPT, lines).unwrap();
        return;
    }
    panic!(
        "these figures are not those that were looked at: {differ:?}; they lie in {}; look at them, then keep them: \
         BLESS=1 cargo test -p bikebot-cli --test figures",
        shown.display()
    );
}
