//! Runs shipped scenarios the way the program does, in memory.

use bikebot::sim::record::{Recorder, Trace};
use bikebot::sim::{Override, RunControl, RunReport, ScenarioFile, Setup, run};
use std::path::{Path, PathBuf};

/// The repository's root.
pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Parses and resolves `scenarios/<name>` with overrides `key=value`.
pub fn setup(name: &str, overrides: &[&str]) -> Setup {
    let path = root().join("scenarios").join(name);
    let text = std::fs::read_to_string(&path).expect("a shipped scenario");
    let overrides: Vec<Override> = overrides
        .iter()
        .map(|text| text.parse().expect("key=value"))
        .collect();
    let file =
        ScenarioFile::parse(&text, &overrides).unwrap_or_else(|error| panic!("{name}: {error}"));
    let folder = path.parent().map(Path::to_owned).unwrap_or_default();
    Setup::resolve(&file, &mut |name| {
        std::fs::read(folder.join(name)).map_err(|error| error.to_string())
    })
    .unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Plays a setup into a recorder.
pub fn play(setup: &Setup, recorder: &mut dyn Recorder) -> RunReport {
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    run(setup, recorder, control).unwrap_or_else(|error| panic!("{}: {error}", setup.name))
}

/// Plays a shipped scenario; the report and everything that happened.
#[allow(
    dead_code,
    reason = "each test crate uses its own share of this module"
)]
pub fn ride(name: &str, overrides: &[&str]) -> (RunReport, Trace) {
    let setup = setup(name, overrides);
    let mut trace = Trace::default();
    let report = play(&setup, &mut trace);
    (report, trace)
}
