//! The report of a ride: one page of HTML that needs nothing but a browser.
//!
//! ```text
//! recording ─▶ Recording ┬▶ Verdict ─────────────▶ html ┐
//!                        ├▶ Rows, charts ─┐             ├▶ page
//!                        └▶ scene ────────┴▶ encoding ──┘   (+ report.js, report.css, uPlot)
//! ```
//!
//! Words and tables stand in the page as they are, so that it can be read, searched and printed without its script; the
//! script draws what moves, out of numbers that `encoding` packs. The page asks the network for nothing, and says so to
//! the browser. The same recording always gives the same bytes.

mod encoding;
mod histories;
mod html;
mod scene;
mod verdict;

use bikebot_sim::Setup;
use bikebot_sim::record::Trace;
use bikebot_sim::record::log::LogInfo;
use serde::Serialize;

pub(crate) use html::{SHEET, colours, escaped};

use histories::Rows;
use verdict::{Tone, Verdict};

/// Most rows of all rides of a page: two minutes at a hundred a second at full rate, alone.
const MAX_ROWS: usize = 12_000;
/// Text that the scans of all rides of a page may take, bytes.
const SCAN_BYTES: usize = 1_200_000;
/// Text that the beliefs of all rides of a page may take, bytes.
const BELIEF_BYTES: usize = 900_000;

/// A recording, as far as it could be read.
#[derive(Debug, Clone)]
pub struct Recording<'a> {
    /// The name of its file.
    pub file: String,
    /// What is in it.
    pub info: &'a LogInfo,
    /// Its numbers, with scans and beliefs where they are to be shown.
    pub trace: &'a Trace,
    /// The scenario it carries, as text.
    pub scenario_text: Option<&'a str>,
    /// What the scenario means.
    pub setup: Option<&'a Setup>,
    /// What is missing and why, a sentence each.
    pub missing: Vec<String>,
}

impl Recording<'_> {
    /// Whether there is anything at all to show: a state, a plan, a scenario, an event or a result.
    #[must_use]
    pub fn has_anything(&self) -> bool {
        !self.trace.state.is_empty()
            || !self.trace.plans.is_empty()
            || !self.trace.notices.is_empty()
            || self.scenario_text.is_some()
            || self.info.result().is_some()
    }
}

/// A ride, as html and script need it.
struct Ride<'a> {
    recording: &'a Recording<'a>,
    name: String,
    verdict: Verdict,
    rows: Rows,
    /// Of the last thing that was recorded, s.
    end: f64,
}

impl<'a> Ride<'a> {
    fn of(recording: &'a Recording<'a>, most_rows: usize) -> Self {
        let rows = Rows::of(recording.trace, recording.setup, most_rows);
        let trace = recording.trace;
        let named = recording.info.run().and_then(|run| run.get("scenario"));
        let stem = recording.file.strip_suffix(".mcap");
        let last = rows.time.last().copied();
        let notice = trace.notices.last().map(|notice| notice.time_s);
        Self {
            name: named.map_or_else(|| stem.unwrap_or(&recording.file).to_owned(), String::clone),
            verdict: Verdict::of(recording.info.result(), trace, recording.setup),
            end: last.or(notice).filter(|it| it.is_finite()).unwrap_or(0.0),
            rows,
            recording,
        }
    }
}

/// An event as the script needs it.
#[derive(Debug, Serialize)]
struct Mark {
    t: f64,
    grade: &'static str,
    kind: String,
}

/// A ride as the script needs it.
#[derive(Debug, Serialize)]
struct RideData {
    name: String,
    file: String,
    end: f64,
    extent: [f64; 4],
    /// Where it set off, m.
    start: Option<[f64; 2]>,
    bike: scene::BikeShape,
    map: Option<scene::Map>,
    moving: Vec<scene::Moving>,
    rows: histories::PackedRows,
    charts: Vec<histories::Chart>,
    plans: Vec<scene::Plan>,
    followed: Vec<scene::Followed>,
    beliefs: Vec<encoding::BeliefSheet>,
    scans: Option<encoding::Scans>,
    events: Vec<Mark>,
}

/// What the script reads.
#[derive(Debug, Serialize)]
struct PageData {
    /// Raised when the script of another page could not read this one's numbers.
    format: u32,
    rides: Vec<RideData>,
}

/// The page of `recordings`, side by side where there are several; `version` is that of the program that makes it.
#[must_use]
pub fn write(recordings: &[Recording<'_>], version: &str) -> String {
    let count = recordings.len().max(1);
    let rides: Vec<Ride<'_>> = recordings
        .iter()
        .map(|recording| Ride::of(recording, MAX_ROWS / count))
        .collect();
    let data = PageData {
        format: 1,
        rides: rides.iter().map(|ride| data(ride, count)).collect(),
    };
    html::page(&rides, &data, version)
}

fn data(ride: &Ride<'_>, count: usize) -> RideData {
    let Recording { trace, setup, .. } = *ride.recording;
    let marks = trace.notices.iter().map(|notice| Mark {
        t: notice.time_s,
        grade: grade(&notice.kind),
        kind: notice.kind.replace('_', " "),
    });
    RideData {
        name: ride.name.clone(),
        file: ride.recording.file.clone(),
        end: ride.end,
        extent: scene::extent(setup, trace),
        start: scene::start(setup, trace),
        bike: scene::BikeShape::of(setup),
        map: scene::Map::of(setup, trace),
        moving: setup.map_or_else(Vec::new, |setup| scene::moving(setup, ride.end)),
        rows: ride.rows.packed(),
        charts: histories::charts(&ride.rows, setup),
        plans: scene::plans(trace),
        followed: scene::followed(trace),
        beliefs: encoding::beliefs(&trace.beliefs, BELIEF_BYTES / count),
        scans: encoding::scans(&trace.scans, SCAN_BYTES / count),
        events: marks.take(html::MAX_EVENTS).collect(),
    }
}

/// How grave an event is: `good`, `bad`, `care` or `plain`.
fn grade(kind: &str) -> &'static str {
    match kind {
        "goal_reached" | "resumed" => "good",
        "collision" | "fell" | "slip" | "wheel_lift" | "passivity" | "no_path" | "non_finite"
        | "control_failed" | "timed_out" => "bad",
        "saturated" | "decoupling" | "supervisor" | "halted" | "emergency" | "unavoidable"
        | "yield" | "interrupted" => "care",
        _ => "plain",
    }
}

/// Three digits that count, and no zeros that do not.
fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let magnitude = value.abs().log10().floor();
    if !(-4.0..6.0).contains(&magnitude) {
        return format!("{value:.2e}");
    }
    let digits = (2.0 - magnitude).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests;
