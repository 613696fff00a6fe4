//! `table2`, `eigenvalues` and the chunks of a sweep: questions that need many answers.

use std::time::Instant;

use bikebot_dynamics::whipple::{CriticalSpeeds, ParameterFile, SteeringAssembly};
use bikebot_dynamics::{BikeParams, Whipple, WhippleParams};
use bikebot_report::{EigenvalueFigure, svg};
use bikebot_sim::study::Table2Study;
use bikebot_sim::study::table2::{PAPER_MAP, PAPER_SCENARIO};
use bikebot_sim::sweep::{self, Case, Row, SweepError};
use bikebot_sim::{Metrics, Override, ScenarioFile, outcome::WALL_CLOCK_METRICS};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::arguments::{self, count};
use crate::errors::{self, kind, value};
use crate::json;
use crate::ride::reporter;
use crate::scenario::{Attached, Given, PyScenario};
use crate::work;

/// Largest parameter file, bytes.
const MAX_PARAMETER_BYTES: usize = 1 << 20;
/// Highest speed that is asked for, m/s, and most speeds in one table.
const MAX_SPEED: f64 = 1000.0;
const MAX_SPEEDS: usize = 100_000;
/// Points along each curve of the figure.
const CURVE_POINTS: usize = 301;

/// Every row of the paper's Table 2, measured: a dict, and the table as text and Markdown.
#[pyfunction]
#[pyo3(signature = (scenario, *, runs, seed, jobs, progress))]
pub fn _table2<'py>(
    py: Python<'py>,
    scenario: Option<&Bound<'py, PyAny>>,
    runs: &Bound<'py, PyAny>,
    seed: Option<&Bound<'py, PyAny>>,
    jobs: &Bound<'py, PyAny>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyAny>, String, String, String)> {
    let runs = count("runs", runs, 1, 1_000_000)?;
    let jobs = count("jobs", jobs, 1, 1024)? as usize;
    let seed = seed.map(arguments::seed).transpose()?;
    let is_paper = scenario.is_none();
    let given = match scenario {
        Some(scenario) => scenario
            .cast::<PyScenario>()
            .map_err(|_| {
                kind(format!(
                    "scenario takes a bikebot.Scenario, not {}",
                    arguments::type_name(scenario)
                ))
            })?
            .get()
            .0
            .clone(),
        None => {
            let attached = Attached::from([(PAPER_MAP.0.to_owned(), PAPER_MAP.1.to_vec())]);
            let text = PAPER_SCENARIO.to_owned();
            std::sync::Arc::new(Given::new(py, text, Vec::new(), None, None, attached)?)
        }
    };
    let progress = reporter(progress, "table 2")?;
    let its = given.clone();
    let measured = work::apart(py, progress, move |shared| {
        let given = its;
        let problem = given.setup.problem()?;
        let began = Instant::now();
        let clock = || began.elapsed().as_secs_f64();
        let stop = || shared.is_stopped();
        let study = Table2Study {
            problem: &problem,
            params: &given.setup.planner,
            runs,
            seed: seed.unwrap_or(given.setup.seed),
            jobs,
            clock: &clock,
            stop: &stop,
        };
        let total = study.plans().max(1) as f64;
        let done = AtomicU64::new(0);
        Some(study.measure(&mut || {
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            shared.set_done(done as f64 / total);
        }))
    })?;
    let table = measured
        .ok_or_else(|| {
            value("there is nothing to plan: the scenario has no map with a start and a goal")
        })?
        .map_err(|error| errors::plan(py, &error))?;
    Ok((
        json::to_python(py, &table)?,
        table.to_text(is_paper),
        table.to_markdown(is_paper),
        given.setup.name.clone(),
    ))
}

/// Name, parameters, and the standard deviations of those that were measured.
type Bicycle = (String, WhippleParams, Vec<(&'static str, f64)>);

/// The bicycle asked for: a preset, a parameter file, a scenario's bike, or values by symbol.
fn bicycle(parameters: &Bound<'_, PyAny>) -> PyResult<Bicycle> {
    let robot = |name: String, bike: &BikeParams, mode| {
        WhippleParams::from_bike(bike, bike.offset(mode), &SteeringAssembly::e_bike())
            .map(|params| (name.clone(), params, Vec::new()))
            .map_err(|error| value(format!("{name}: {error}")))
    };
    if let Ok(scenario) = parameters.cast::<PyScenario>() {
        let setup = &scenario.get().0.setup;
        return robot(setup.name.clone(), &setup.bike, setup.mode);
    }
    if let Ok(name) = parameters.extract::<String>() {
        if name == "benchmark" {
            return Ok((name, WhippleParams::benchmark(), Vec::new()));
        }
        if let Some(bike) = BikeParams::preset(&name) {
            return robot(name, &bike, bikebot_dynamics::BalancerMode::Flywheel);
        }
    }
    let path = arguments::path("parameters", parameters)?;
    let name = path
        .file_stem()
        .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    if !path.exists() && path.extension().is_none() {
        let presets = BikeParams::PRESETS.join("\", \"");
        return Err(value(format!(
            "parameters is {:?}, which is neither a file nor a preset: presets are \"benchmark\", \"{presets}\"",
            path.display()
        )));
    }
    let bytes = crate::files::read(&path)?;
    let text = String::from_utf8(bytes)
        .ok()
        .filter(|text| text.len() <= MAX_PARAMETER_BYTES)
        .ok_or_else(|| value(format!("{} is no parameter file", path.display())))?;
    let file = ParameterFile::parse(&text).map_err(|error| {
        let line = error
            .line
            .map_or_else(String::new, |line| format!(":{line}"));
        let help = error
            .help
            .map_or_else(String::new, |help| format!("; {help}"));
        value(format!("{}{line}: {}{help}", path.display(), error.message))
    })?;
    Ok((name, file.params, file.deviations))
}

/// Critical speeds and modes: a dict of arrays.
#[pyfunction]
#[pyo3(signature = (parameters, *, speeds))]
pub fn _eigenvalues<'py>(
    py: Python<'py>,
    parameters: &Bound<'py, PyAny>,
    speeds: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (name, params, deviations) = bicycle(parameters)?;
    let refused = |error: bikebot_dynamics::DynamicsError| value(format!("{name}: {error}"));
    let whipple = Whipple::new(&params).map_err(refused)?;
    let critical = whipple.critical_speeds();
    let spread = CriticalSpeeds::deviations(&params, &deviations);
    let speeds = match speeds {
        Some(speeds) => speeds_of(speeds)?,
        None => critical.usual_speeds(),
    };
    let table = work::here(py, |_| whipple.modes(&speeds))?.map_err(refused)?;
    let found = PyDict::new(py);
    let column = |pick: &dyn Fn(&bikebot_dynamics::whipple::Modes) -> f64| {
        PyArray1::from_iter(py, table.iter().map(pick))
    };
    found.set_item("name", name.as_str())?;
    found.set_item("speed", PyArray1::from_vec(py, speeds))?;
    for (key, index) in [("weave", 0), ("weave2", 1)] {
        found.set_item(format!("{key}_re"), column(&|m| m.weave[index].re))?;
        found.set_item(format!("{key}_im"), column(&|m| m.weave[index].im))?;
    }
    found.set_item("capsize_re", column(&|m| m.capsize.re))?;
    found.set_item("capsize_im", column(&|m| m.capsize.im))?;
    found.set_item("caster_re", column(&|m| m.caster.re))?;
    found.set_item("caster_im", column(&|m| m.caster.im))?;
    found.set_item(
        "stable",
        PyArray1::from_iter(py, table.iter().map(|m| m.is_stable())),
    )?;
    found.set_item("weave_speed", critical.weave)?;
    found.set_item("capsize_speed", critical.capsize)?;
    let measured = !deviations.is_empty();
    found.set_item("weave_speed_deviation", spread[0].filter(|_| measured))?;
    found.set_item("capsize_speed_deviation", spread[1].filter(|_| measured))?;
    found.set_item("stable_ranges", json::to_python(py, &critical.stable)?)?;
    for (key, matrix) in [
        ("M", &whipple.mass),
        ("C1", &whipple.damping),
        ("K0", &whipple.gravity_stiffness),
        ("K2", &whipple.speed_stiffness),
    ] {
        let rows = [
            [matrix[(0, 0)], matrix[(0, 1)]],
            [matrix[(1, 0)], matrix[(1, 1)]],
        ];
        found.set_item(key, rows)?;
    }
    found.set_item("parameters", json::to_python(py, &params)?)?;
    found.set_item("remarks", params.remarks())?;
    let (from, to) = table
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), m| {
            (a.min(m.speed), b.max(m.speed))
        });
    let picture = if from < to {
        let curves = whipple
            .mode_curves(from, to, CURVE_POINTS)
            .map_err(refused)?;
        let title = format!("{name} · eigenvalues");
        let facts = format!("{:.4} kg", params.mass());
        Some(svg::write(
            &EigenvalueFigure::new(&curves, &critical, title, facts).draw(),
        ))
    } else {
        None
    };
    found.set_item("svg", picture)?;
    Ok(found)
}

fn speeds_of(object: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    const FORM: &str =
        "speeds takes numbers from 0 to 1000 m/s, as a list or a one-dimensional array";
    let refuse = || kind(format!("{FORM}, not {}", arguments::type_name(object)));
    if object.is_instance_of::<pyo3::types::PyString>() {
        return Err(refuse());
    }
    let mut found = Vec::new();
    for (index, item) in object.try_iter().map_err(|_| refuse())?.enumerate() {
        let speed = arguments::number(&format!("speeds[{index}]"), &item?)?;
        if !(0.0..=MAX_SPEED).contains(&speed) {
            return Err(value(format!("speeds[{index}] is {speed}: {FORM}")));
        }
        found.push(speed);
        if found.len() > MAX_SPEEDS {
            return Err(value(format!("more than {MAX_SPEEDS} speeds")));
        }
    }
    if found.is_empty() {
        return Err(value(format!("speeds is empty: {FORM}")));
    }
    Ok(found)
}

/// A TOML value, for the cases of a sweep.
#[pyfunction]
pub fn _toml(name: &str, object: &Bound<'_, PyAny>) -> PyResult<String> {
    Ok(crate::toml_value::of(name, object)?.to_string())
}

/// Names of the metrics that a row of a sweep has, in order.
#[pyfunction]
pub fn _metric_names() -> Vec<&'static str> {
    let names = Metrics::NAMES.iter().copied();
    names
        .filter(|name| !WALL_CLOCK_METRICS.contains(name))
        .collect()
}

/// Runs cases of a scenario on `threads` threads (0: one per core): a dict of columns, in the order of the cases.
///
/// A case is its changes, (key, value in TOML) each, and its seed.
#[pyfunction]
#[pyo3(signature = (scenario, varied, seeds, *, threads, progress))]
pub fn _run_cases<'py>(
    py: Python<'py>,
    scenario: &Bound<'py, PyScenario>,
    varied: Vec<Vec<(String, String)>>,
    seeds: Vec<u64>,
    threads: usize,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    if varied.len() != seeds.len() {
        return Err(value("as many seeds as cases are needed"));
    }
    let given = scenario.get().0.clone();
    let cases: Vec<Case> = varied
        .into_iter()
        .zip(seeds)
        .enumerate()
        .map(|(index, (varied, seed))| Case {
            index,
            varied: varied
                .into_iter()
                .map(|(key, value)| Override::new(key, value))
                .collect(),
            seed,
        })
        .collect();
    let total = cases.len().max(1) as f64;
    let progress = progress.map(|it| it.clone().unbind());
    let swept = work::aside(py, progress, |shared| {
        let mut rows: Vec<Row> = Vec::with_capacity(cases.len());
        sweep::sweep(
            &given.text,
            &given.changes,
            cases,
            &|name| given.read(name),
            threads,
            &|| shared.is_stopped(),
            &mut |row| {
                rows.push(row);
                shared.set_done(rows.len() as f64 / total);
            },
        )?;
        Ok(rows)
    })?;
    let rows = swept.map_err(|error: SweepError| match error {
        SweepError::Scenario(error) => {
            errors::scenario(py, &error, given.file.as_deref(), &given.text)
        }
        SweepError::Setup(error) => errors::setup(py, &error, given.file.as_deref(), &given.text),
        other => value(other.to_string()),
    })?;
    columns(py, &rows)
}

/// Parses every combination of changes, so that a bad value is found before the first run.
#[pyfunction]
pub fn _check_cases(
    py: Python<'_>,
    scenario: &Bound<'_, PyScenario>,
    varied: Vec<Vec<(String, String)>>,
) -> PyResult<()> {
    let given = &scenario.get().0;
    let checked = work::here(py, |watch| {
        for changes in varied {
            if watch.is_stopped() {
                break;
            }
            let mut all = given.changes.clone();
            let changes = changes.into_iter();
            all.extend(changes.map(|(key, value)| Override::new(key, value)));
            ScenarioFile::parse(&given.text, &all)?;
        }
        Ok(())
    })?;
    checked.map_err(|error| errors::scenario(py, &error, given.file.as_deref(), &given.text))
}

fn columns<'py>(py: Python<'py>, rows: &[Row]) -> PyResult<Bound<'py, PyDict>> {
    let table = PyDict::new(py);
    let text = |pick: &dyn Fn(&Row) -> String| PyList::new(py, rows.iter().map(pick));
    let of = |row: &Row, pick: &dyn Fn(&sweep::RowResult) -> String, other: &str| match &row.result
    {
        Ok(result) => pick(result),
        Err(_) => other.to_owned(),
    };
    table.set_item(
        "seed",
        PyArray1::from_iter(py, rows.iter().map(|row| row.case.seed as i64)),
    )?;
    table.set_item(
        "outcome",
        text(&|row| of(row, &|it| it.outcome.to_string(), "invalid"))?,
    )?;
    table.set_item("reason", text(&|row| of(row, &|it| it.reason.clone(), ""))?)?;
    table.set_item(
        "passed",
        PyArray1::from_iter(
            py,
            rows.iter()
                .map(|row| row.result.as_ref().is_ok_and(|it| it.passed)),
        ),
    )?;
    for name in _metric_names() {
        let values = rows.iter().map(|row| {
            let metrics = row.result.as_ref().ok().map(|it| &it.metrics);
            let found = metrics.and_then(|it| it.iter().find(|(key, _)| *key == name));
            found.map_or(f64::NAN, |(_, value)| value)
        });
        table.set_item(name, PyArray1::from_iter(py, values))?;
    }
    table.set_item(
        "result_hash",
        text(&|row| of(row, &|it| it.result_hash.clone(), ""))?,
    )?;
    let error = |row: &Row| row.result.as_ref().err().cloned().unwrap_or_default();
    table.set_item("error", text(&error)?)?;
    Ok(table)
}

/// Panics, to show that no panic crosses the border.
#[pyfunction]
pub fn _panic(py: Python<'_>, aside: bool) -> PyResult<()> {
    fn fail() {
        let nothing: [f64; 0] = [];
        let index = std::hint::black_box(3);
        std::hint::black_box(nothing[index]);
    }
    if aside {
        work::aside(py, None, |_| fail())
    } else {
        work::here(py, |_| fail())
    }
}
