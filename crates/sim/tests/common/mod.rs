//! Scenarios resolved and ridden, for tests of whole rides.

// Every test file takes what it needs of this module.
#![allow(dead_code)]

use bikebot_sim::clock::SimTime;
use bikebot_sim::record::{Event, NoticeKind, RecordError, Recorder, Trace};
use bikebot_sim::{
    Error, Override, RunControl, RunReport, ScenarioError, ScenarioFile, Setup, SetupError, run,
};

/// The shipped scenarios, and the maps they name.
pub const SCENARIOS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/");

/// The scenario `text` with `key=value` changes.
pub fn parse(text: &str, changes: &[&str]) -> Result<ScenarioFile, ScenarioError> {
    let overrides: Vec<Override> = changes
        .iter()
        .map(|change| change.parse().expect("key=value"))
        .collect();
    ScenarioFile::parse(text, &overrides)
}

/// What it means; files are looked for beside the shipped scenarios.
pub fn resolve(text: &str, changes: &[&str]) -> Result<Setup, SetupError> {
    Setup::resolve(&parse(text, changes)?, &mut |name| {
        std::fs::read(format!("{SCENARIOS}{name}")).map_err(|error| error.to_string())
    })
}

/// As [`resolve`], where it has to succeed.
#[track_caller]
pub fn setup(text: &str, changes: &[&str]) -> Setup {
    resolve(text, changes).unwrap_or_else(|error| panic!("{changes:?}: {error}"))
}

/// Rides it to its end, without a clock: what is measured of the program itself is left out.
pub fn try_ride(setup: &Setup, recorder: &mut dyn Recorder) -> Result<RunReport, Error> {
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    run(setup, recorder, control)
}

/// As [`try_ride`], where it has to succeed.
#[track_caller]
pub fn ride(setup: &Setup, recorder: &mut dyn Recorder) -> RunReport {
    try_ride(setup, recorder).unwrap_or_else(|error| panic!("{error}"))
}

/// A ride and its numbers.
#[track_caller]
pub fn traced(setup: &Setup) -> (RunReport, Trace) {
    let mut trace = Trace::default();
    let report = ride(setup, &mut trace);
    (report, trace)
}

/// Keeps the notices of a ride: time in s, kind, text, value.
#[derive(Debug, Default)]
pub struct Notices(pub Vec<(f64, NoticeKind, String, f64)>);

impl Recorder for Notices {
    fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
        if let Event::Notice { kind, text, value } = event {
            self.0
                .push((time.seconds(), *kind, (*text).to_owned(), *value));
        }
        Ok(())
    }
}

impl Notices {
    /// How many were of this kind.
    pub fn count(&self, kind: NoticeKind) -> usize {
        self.0.iter().filter(|notice| notice.1 == kind).count()
    }
}

/// A ride and what it had to say.
#[track_caller]
pub fn noticed(setup: &Setup) -> (RunReport, Notices) {
    let mut notices = Notices::default();
    let report = ride(setup, &mut notices);
    (report, notices)
}
