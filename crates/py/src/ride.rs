//! `Ride`: what happened; riding and recording; recordings read back.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use bikebot_report::{Ground, Ride as Picture, RideFigure, axis::significant, svg};
use bikebot_sim::plan_file::Times;
use bikebot_sim::record::{McapRecorder, RecordError, Recorder, ResultInfo, RunInfo, Trace, log};
use bikebot_sim::setup::PathSource;
use bikebot_sim::{Error, ExpectCheck, Progress, RunControl, RunReport, Setup};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple, PyType};

use crate::arguments;
use crate::errors::{self, value};
use crate::own::Own;
use crate::plan::PyPlan;
use crate::scenario::{Given, PyScenario};
use crate::trace::{PyTrace, path_array};
use crate::work;
use crate::world::tidy;

/// How a ride ended.
#[derive(Clone)]
struct Ended {
    outcome: String,
    reason: String,
    passed: bool,
    metrics: Vec<(String, f64)>,
    expect: Vec<ExpectCheck>,
    result_hash: String,
}

impl From<&RunReport> for Ended {
    fn from(report: &RunReport) -> Self {
        Self {
            outcome: report.outcome.name().to_owned(),
            reason: report.reason.clone(),
            passed: report.passed(),
            metrics: report
                .metrics
                .iter()
                .map(|(name, value)| (name.to_owned(), value))
                .collect(),
            expect: report.expect.clone(),
            result_hash: report.result_hash.clone(),
        }
    }
}

/// What happened on a ride.
///
/// `outcome` is "arrived", "fell", "collided", "no_path", "timed_out" or "stopped" ("cut" for a recording that broke off), `reason`
/// why; `metrics` a dict of numbers whose names carry their units, where what does not apply is absent; `trace` every sample as
/// numpy arrays.
#[pyclass(name = "Ride", module = "bikebot", frozen)]
pub struct PyRide {
    given: Arc<Given>,
    result: Ended,
    trace: Arc<Trace>,
    plan: Option<Py<PyPlan>>,
    /// Read from a recording, at its rates.
    recorded: bool,
    /// Ridden with controllers of the caller's own.
    own: bool,
}

/// A recording under way: written beside its name, which it gets when it is whole.
struct Recording {
    part: PathBuf,
    path: PathBuf,
    recorder: McapRecorder<BufWriter<File>>,
}

impl Recording {
    fn begin(path: &Path, given: &Given) -> Result<Self, Failure> {
        let mut part = path.as_os_str().to_owned();
        part.push(".part");
        let part = PathBuf::from(part);
        let file = File::create(&part).map_err(|error| Failure::File(part.clone(), error))?;
        let info = RunInfo::of(&given.setup, &given.changes);
        // As the program records: at the rates of the scenario.
        let recorder = McapRecorder::begin(BufWriter::new(file), &info, &given.setup.record)
            .map_err(Failure::Record)?;
        Ok(Self {
            part,
            path: path.to_owned(),
            recorder,
        })
    }

    fn finish(mut self, report: &RunReport) -> Result<(), Failure> {
        self.recorder
            .finish(&ResultInfo::of(report))
            .map_err(Failure::Record)?;
        drop(self.recorder);
        std::fs::rename(&self.part, &self.path).map_err(|error| Failure::File(self.path, error))
    }
}

/// Why there is no ride.
enum Failure {
    Run(Error),
    Raised(PyErr),
    Record(RecordError),
    File(PathBuf, std::io::Error),
}

impl Failure {
    fn told(self, py: Python<'_>) -> PyErr {
        match self {
            Self::Run(error) => errors::run(py, &error),
            Self::Raised(error) => error,
            Self::Record(error) => pyo3::exceptions::PyOSError::new_err(error.to_string()),
            Self::File(path, error) => errors::file(&path, error),
        }
    }
}

/// Rides, with the controllers that `own` lends; `is_stopped` is asked often, `done` told the share of the way.
fn ride(
    given: &Given,
    own: &Own,
    is_stopped: &(dyn Fn() -> bool + Sync),
    done: &mut dyn FnMut(f64),
    scans: bool,
    record: Option<&Path>,
) -> Result<(RunReport, Trace), Failure> {
    let setup: &Setup = &given.setup;
    let trace = if scans {
        Trace::with_scans()
    } else {
        Trace::default()
    };
    let recording = record
        .map(|path| Recording::begin(path, given))
        .transpose()?;
    let began = Instant::now();
    let duration = setup.duration.seconds().max(f64::MIN_POSITIVE);
    let control = RunControl {
        stop: is_stopped,
        progress: &mut |progress| {
            if let Progress::Riding {
                time,
                distance,
                length,
            } = progress
            {
                done(if length > 0.0 {
                    distance / length
                } else {
                    time / duration
                });
            }
        },
        clock: Some(&|| began.elapsed().as_secs_f64()),
    };
    let (report, trace) = match recording {
        None => {
            let mut trace = trace;
            let report = run_with(setup, own, &mut trace, control)?;
            (report, trace)
        }
        Some(Recording {
            part,
            path,
            recorder,
        }) => {
            let mut both = (trace, recorder);
            let report = run_with(setup, own, &mut both, control);
            let (trace, recorder) = both;
            let recording = Recording {
                part,
                path,
                recorder,
            };
            let report = match report {
                Ok(report) if !is_stopped() => report,
                Ok(_) | Err(_) => {
                    let part = recording.part.clone();
                    drop(recording);
                    // What nobody waits for any more leaves nothing behind.
                    let _ = std::fs::remove_file(part);
                    match report {
                        Ok(report) => return Ok((report, trace)),
                        Err(failure) => return Err(failure),
                    }
                }
            };
            recording.finish(&report)?;
            (report, trace)
        }
    };
    Ok((report, trace))
}

/// Runs; what a callable raised comes before what became of the ride.
fn run_with(
    setup: &Setup,
    own: &Own,
    recorder: &mut dyn Recorder,
    control: RunControl<'_>,
) -> Result<RunReport, Failure> {
    own.lend(|external| bikebot_sim::run_with(setup, recorder, control, external))
        .map_err(Failure::Raised)?
        .map_err(Failure::Run)
}

/// A function of the share done, out of what `progress=` takes.
pub fn reporter(progress: Option<&Bound<'_, PyAny>>, what: &str) -> PyResult<Option<Py<PyAny>>> {
    let Some(progress) = progress else {
        return Ok(None);
    };
    let made = progress
        .py()
        .import("bikebot._progress")?
        .getattr("reporter")?
        .call1((progress, what))?;
    Ok((!made.is_none()).then(|| made.unbind()))
}

/// `Scenario.run`.
pub fn run(
    py: Python<'_>,
    given: Arc<Given>,
    progress: Option<&Bound<'_, PyAny>>,
    record: Option<&Path>,
    scans: bool,
    own: &Own,
) -> PyResult<PyRide> {
    if own.follower.is_some() && given.setup.path == PathSource::Standing {
        return Err(value(
            "follower: the scenario has no path to follow; give it a [map] and a [goal], or a [path], and plant.model = \"bike3d\"",
        ));
    }
    let progress = reporter(progress, &given.setup.name)?;
    let ridden = if own.is_empty() {
        work::aside(py, progress, |shared| {
            let is_stopped = || shared.is_stopped();
            let mut done = |share| shared.set_done(share);
            ride(&given, own, &is_stopped, &mut done, scans, record)
        })?
    } else {
        work::beside(py, progress, |watch, done| {
            let is_stopped = || watch.is_stopped();
            ride(&given, own, &is_stopped, done, scans, record)
        })?
    };
    let (mut report, trace) = ridden.map_err(|failure| failure.told(py))?;
    if let Some(failure) = report.recording_failed.take() {
        return Err(pyo3::exceptions::PyOSError::new_err(failure));
    }
    let result = Ended::from(&report);
    // A plan made on what the laser had shown is not one on the map.
    let plan = match (report.plan.take(), given.asked()) {
        (Some(plan), Some((asked, start, goal))) if given.setup.online.is_none() => {
            let goal = asked.goal(goal);
            let times = Times {
                plan: report.metrics.plan_time_s.unwrap_or(0.0),
                ..Times::default()
            };
            Some(Py::new(py, PyPlan::made(plan, times, asked, start, goal))?)
        }
        _ => None,
    };
    Ok(PyRide {
        given,
        result,
        trace: Arc::new(trace),
        plan,
        recorded: false,
        own: !own.is_empty(),
    })
}

/// Reads a recording (.mcap) as a ride.
///
/// The arrays of `trace` are at the rates of the recording; `scans` has the laser's sweeps. What broke off before its end has the
/// outcome "cut" and all that can be read of it.
///
/// Raises `OSError` for a file that cannot be read, `ValueError` for one that is no recording of a ride.
#[pyfunction]
pub fn read_log(py: Python<'_>, path: &Bound<'_, PyAny>) -> PyResult<PyRide> {
    let path = arguments::path("path", path)?;
    // A clear word for what is missing, a folder, or no file.
    if !path.is_file() {
        crate::files::read(&path)?;
        return Err(value(format!("{} is not a regular file", path.display())));
    }
    let read = work::aside(py, None, |_| {
        let open = || File::open(&path).map(std::io::BufReader::new);
        let source = log::read_run(&mut open()?)?;
        let trace = log::read_trace(&mut open()?, Trace::with_scans())?;
        Ok::<_, log::LogError>((source, trace))
    })?;
    let (source, trace) = read.map_err(|error| match error {
        log::LogError::File(error) => errors::file(&path, error),
        other => value(format!("{}: {other}", path.display())),
    })?;
    let attached = source
        .files
        .iter()
        .map(|file| (file.name.clone(), file.data.clone()))
        .collect();
    let name = format!("{}#scenario.toml", path.display());
    let given = Given::new(
        py,
        source.scenario_text.clone(),
        Vec::new(),
        Some(name),
        None,
        attached,
    )?;
    let mut result = Ended {
        outcome: "cut".into(),
        reason: "the recording broke off".into(),
        passed: false,
        metrics: Vec::new(),
        expect: Vec::new(),
        result_hash: String::new(),
    };
    for (key, text) in source.result.iter().flatten() {
        match key.as_str() {
            "outcome" => result.outcome.clone_from(text),
            "reason" => result.reason.clone_from(text),
            "result_hash" => result.result_hash.clone_from(text),
            _ => {
                if let Some(metric) = key.strip_prefix("metrics.") {
                    if let Ok(number) = text.parse() {
                        result.metrics.push((metric.to_owned(), number));
                    }
                } else if let Some(check) = key.strip_prefix("expect.") {
                    result.expect.push(ExpectCheck {
                        check: check.to_owned(),
                        ok: text == "true",
                    });
                }
            }
        }
    }
    result.passed = if result.expect.is_empty() {
        result.outcome == "arrived"
    } else {
        result.expect.iter().all(|check| check.ok)
    };
    Ok(PyRide {
        given: Arc::new(given),
        result,
        trace: Arc::new(trace),
        plan: None,
        recorded: true,
        own: false,
    })
}

impl PyRide {
    fn metric(&self, name: &str) -> Option<f64> {
        let metrics = &self.result.metrics;
        metrics.iter().find(|it| it.0 == name).map(|it| it.1)
    }

    fn draw(&self) -> Result<String, String> {
        let setup = &self.given.setup;
        let picture =
            Picture::new(&self.trace, &setup.footprint).map_err(|error| error.to_string())?;
        let mut facts = vec![self.result.outcome.replace('_', " ")];
        for (name, before, after) in [
            ("time_s", "", " s"),
            ("distance_m", "", " m"),
            ("lateral_error_max_m", "lateral error up to ", " m"),
            ("roll_max_deg", "roll up to ", "°"),
            ("min_clearance_m", "clearance ", " m"),
        ] {
            let metric = self.metric(name);
            facts.extend(metric.map(|value| format!("{before}{}{after}", significant(value, 3))));
        }
        facts.push(format!("seed {}", setup.seed));
        let ground = setup.world.as_ref().map(Ground::from);
        let title = format!("{} · ride", setup.name);
        Ok(svg::write(
            &RideFigure::new(&picture, ground, title, facts.join("  ·  ")).draw(),
        ))
    }
}

#[pymethods]
impl PyRide {
    /// How it ended.
    #[getter]
    fn outcome(&self) -> &str {
        &self.result.outcome
    }

    /// Why it ended so: one of a closed list.
    #[getter]
    fn reason(&self) -> &str {
        &self.result.reason
    }

    /// Whether every expectation of the scenario holds, or, without any, the bike arrived.
    #[getter]
    fn passed(&self) -> bool {
        self.result.passed
    }

    /// What was measured, by name; what does not apply is absent.
    #[getter]
    fn metrics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let metrics = PyDict::new(py);
        for (name, value) in &self.result.metrics {
            metrics.set_item(name, value)?;
        }
        Ok(metrics)
    }

    /// Each expectation of the scenario in words, and whether it holds.
    #[getter]
    fn expect(&self) -> Vec<(String, bool)> {
        let checks = self.result.expect.iter();
        checks.map(|it| (it.check.clone(), it.ok)).collect()
    }

    /// Every sample, by name.
    #[getter]
    fn trace(&self) -> PyTrace {
        PyTrace(self.trace.clone())
    }

    /// What a program may want to find, such as falls, mode changes and new paths, in order.
    #[getter]
    fn events<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.trace().events(py)
    }

    /// Time (s), level and text of every line written for people.
    #[getter]
    fn log(&self) -> Vec<(f64, &'static str, String)> {
        self.trace().lines()
    }

    /// The planned path of the rear contact, the last one where there were several: (n, 6) with x, y, heading, curvature, s, speed
    /// (NaN where the plan has none) in SI units; None where nothing was planned.
    #[getter]
    fn planned<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let last = self.trace.plans.last();
        last.map(|plan| path_array(py, &plan.path)).transpose()
    }

    /// The curve that was followed, the last one where there were several: as `planned`.
    #[getter]
    fn followed<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let last = self.trace.followed.last();
        last.map(|it| path_array(py, &it.path)).transpose()
    }

    /// The laser's sweeps, if they were kept: a list of (time s, bearing of the first beam rad, bearing step rad, ranges m).
    #[getter]
    #[allow(clippy::type_complexity, reason = "a tuple of Python")]
    fn scans<'py>(&self, py: Python<'py>) -> Vec<(f64, f64, f64, Bound<'py, PyArray1<f64>>)> {
        let scans = self.trace.scans.iter();
        scans
            .map(|it| {
                let ranges = PyArray1::from_slice(py, &it.ranges);
                (it.time_s, it.start_angle, it.angle_step, ranges)
            })
            .collect()
    }

    /// The plan that was ridden; None where the path was given, nothing was ridden, the map was not known, or the ride was read from
    /// a recording.
    #[getter]
    fn plan(&self, py: Python<'_>) -> Option<Py<PyPlan>> {
        self.plan.as_ref().map(|plan| plan.clone_ref(py))
    }

    /// The scenario ridden.
    #[getter]
    fn scenario(&self) -> PyScenario {
        PyScenario(self.given.clone())
    }

    /// SHA-256 over outcome, reason and the state at each control tick: the same from Python, Rust and the command line.
    #[getter]
    fn result_hash(&self) -> &str {
        &self.result.result_hash
    }

    /// Whether it was read from a recording, and the trace is at the recording's rates.
    #[getter]
    fn recorded(&self) -> bool {
        self.recorded
    }

    /// Writes the recording (.mcap) of this ride, which opens in Foxglove and runs again by `bikebot run --from`.
    ///
    /// The ride is made again while it is written, and is the same to the last bit; `Scenario.run(record=…)` writes at once.
    ///
    /// Raises `OSError` where it cannot be written, `BikebotError` where the ride was another, as of a recording made by another
    /// version, `ValueError` where controllers of your own rode.
    #[pyo3(signature = (path, *, progress=None))]
    fn write_mcap(
        &self,
        py: Python<'_>,
        path: &Bound<'_, PyAny>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let path = arguments::path("path", path)?;
        if self.own {
            return Err(value(
                "write_mcap would ride again without your own controllers: give Scenario.run(record=path, …), which writes while it rides",
            ));
        }
        let own = Own::default();
        let again = run(py, self.given.clone(), progress, Some(&path), false, &own)?;
        let hash = &self.result.result_hash;
        if !hash.is_empty() && again.result.result_hash != *hash {
            return Err(errors::bikebot(
                py,
                &format!(
                    "{} was written, but the ride came out otherwise than this one: was it made by another version, or with controllers of your own?",
                    path.display()
                ),
            ));
        }
        Ok(())
    }

    /// The ride as an SVG picture: the paths on the map; speed, roll and lateral error against time.
    ///
    /// Raises `ValueError` where nothing was ridden.
    fn svg(&self, py: Python<'_>) -> PyResult<String> {
        work::here(py, |_| self.draw())?.map_err(value)
    }

    fn _repr_svg_(&self, py: Python<'_>) -> PyResult<Option<String>> {
        // Where nothing was ridden the text says so.
        work::here(py, |_| self.draw().ok())
    }

    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        let picture = self._repr_svg_(py)?.unwrap_or_default();
        let mut rows = String::new();
        for (name, value) in &self.result.metrics {
            rows.push_str(&format!(
                "<tr><td>{name}</td><td style=\"text-align:right\">{}</td></tr>",
                tidy(*value)
            ));
        }
        let setup = &self.given.setup;
        Ok(format!(
            "<div><b>{}</b>: {} ({}), seed {}{picture}<table>{rows}</table></div>",
            escaped(&setup.name),
            self.result.outcome,
            escaped(&self.result.reason),
            setup.seed
        ))
    }

    fn __repr__(&self) -> String {
        let mut text = format!(
            "Ride({:?}: {} ({})",
            self.given.setup.name, self.result.outcome, self.result.reason
        );
        for (name, unit) in [("time_s", "s"), ("distance_m", "m")] {
            if let Some(value) = self.metric(name) {
                text.push_str(&format!(", {} {unit}", significant(value, 4)));
            }
        }
        text.push_str(&format!(", seed {})", self.given.setup.seed));
        text
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let result = &self.result;
        let state = (
            self.scenario(),
            self.trace(),
            self.plan(py),
            self.recorded,
            (
                result.outcome.clone(),
                result.reason.clone(),
                result.passed,
                result.metrics.clone(),
                self.expect(),
                result.result_hash.clone(),
            ),
            self.own,
        );
        let restore = py.get_type::<Self>().getattr("_restore")?;
        Ok((restore, state.into_pyobject(py)?))
    }

    /// What pickling calls.
    #[classmethod]
    #[allow(clippy::type_complexity, reason = "a tuple of Python")]
    fn _restore(
        _class: &Bound<'_, PyType>,
        scenario: &Bound<'_, PyScenario>,
        trace: &Bound<'_, PyTrace>,
        plan: Option<Py<PyPlan>>,
        recorded: bool,
        result: (
            String,
            String,
            bool,
            Vec<(String, f64)>,
            Vec<(String, bool)>,
            String,
        ),
        own: bool,
    ) -> Self {
        let (outcome, reason, passed, metrics, expect, result_hash) = result;
        Self {
            given: scenario.get().0.clone(),
            result: Ended {
                outcome,
                reason,
                passed,
                metrics,
                expect: expect
                    .into_iter()
                    .map(|(check, ok)| ExpectCheck { check, ok })
                    .collect(),
                result_hash,
            },
            trace: trace.get().0.clone(),
            plan,
            recorded,
            own,
        }
    }
}

/// Text inside HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}
