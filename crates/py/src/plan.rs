//! `Plan`: what planning came to.

use std::sync::OnceLock;

use bikebot_planner::report::sampling_step;
use bikebot_planner::{
    EndPose, GoalMode, GoalRegion, Outcome, PathKind, PlanReport, PlannedPath, PlanningProblem,
    Promises, Terms as Claims, verify,
};
use bikebot_report::{Ground, PlanFigure, PlanFile as Picture, PlanStyle, PlanView, svg};
use bikebot_sim::plan_file::{PlanFile, PlanJson, StoredPlan, StoredProblem, Times, plan_hash};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use serde_json::Value;

use crate::arguments::{self, count, number};
use crate::arrays::{lend, lend_rows};
use crate::errors::{self, kind, value};
use crate::files;
use crate::json;
use crate::search::{self, Asked};
use crate::work;
use crate::world::{PyWorld, tidy};

/// Spacing of samples where a plan file carries none, as a part of the smallest turning radius.
const STEP_OF_RADIUS: f64 = 0.05;

/// Points along the path.
struct Samples {
    xy: Vec<f64>,
    heading: Vec<f64>,
    curvature: Vec<f64>,
    s: Vec<f64>,
}

impl FromIterator<[f64; 5]> for Samples {
    fn from_iter<I: IntoIterator<Item = [f64; 5]>>(rows: I) -> Self {
        let mut samples = Self {
            xy: Vec::new(),
            heading: Vec::new(),
            curvature: Vec::new(),
            s: Vec::new(),
        };
        for [x, y, heading, curvature, s] in rows {
            samples.xy.extend([x, y]);
            samples.heading.push(heading);
            samples.curvature.push(curvature);
            samples.s.push(s);
        }
        samples
    }
}

/// Where a plan comes from.
enum Source {
    /// Planned here.
    Made(Box<Asked>),
    /// Read from a file, with the world if the caller had it.
    Read {
        text: String,
        stored: Box<StoredPlan>,
        world: Option<Box<PyWorld>>,
    },
}

/// A planned path, or the word that there is none.
///
/// `outcome` is "found", "no_path" (proved), "exhausted" or "timed_out", `reason` why. The arrays are float64, read-only, and lie
/// in the plan's own memory: `xy` (n, 2) m, `heading` (n,) rad, `curvature` (n,) 1/m positive to the left, `s` (n,) m, dense
/// enough to show the curvature; empty where nothing was found. Figures that do not apply are NaN.
///
/// >>> world = World.from_shapes((0, 0, 10, 10), boxes=[(4, 0, 5, 7)])
/// >>> p = plan(world, (1, 1, 0.0), (9, 1), max_curvature=0.8)
/// >>> p.outcome, p.xy.shape[1], p.found
/// ('found', 2, True)
/// >>> bool(abs(p.s[-1] - p.length) < 1e-9)
/// True
#[pyclass(name = "Plan", module = "bikebot", frozen)]
pub struct PyPlan {
    report: PlanReport,
    times: Times,
    start: EndPose,
    goal: GoalRegion,
    source: Source,
    samples: OnceLock<Samples>,
    segments: OnceLock<Vec<f64>>,
}

impl PyPlan {
    /// A plan made here.
    pub fn made(
        report: PlanReport,
        times: Times,
        asked: Asked,
        start: EndPose,
        goal: GoalRegion,
    ) -> Self {
        Self {
            report,
            times,
            start,
            goal,
            source: Source::Made(Box::new(asked)),
            samples: OnceLock::new(),
            segments: OnceLock::new(),
        }
    }

    /// The path's curves, bit for bit.
    pub fn same_path(&self, other: &PlanReport) -> bool {
        plan_hash(&self.report) == plan_hash(other)
    }

    fn problem(&self) -> Option<PlanningProblem<'_>> {
        match &self.source {
            Source::Made(asked) => Some(PlanningProblem {
                world: asked.field.world(),
                footprint: asked.footprint.clone(),
                start: self.start,
                goal: self.goal,
                max_curvature: asked.params.max_curvature,
            }),
            Source::Read { .. } => None,
        }
    }

    fn samples(&self) -> &Samples {
        self.samples.get_or_init(|| {
            let Some(path) = &self.report.path else {
                return Samples::from_iter([]);
            };
            let step = match &self.source {
                Source::Read { stored, .. } => match &stored.path {
                    Some(path) => return path.iter().copied().collect(),
                    None => STEP_OF_RADIUS / stored.problem.max_curvature_per_m.max(1e-6),
                },
                Source::Made(_) => self
                    .problem()
                    .map_or(STEP_OF_RADIUS, |it| sampling_step(&it)),
            };
            let points = path.sample(step);
            points
                .iter()
                .map(|p| [p.position.x, p.position.y, p.heading, p.curvature, p.s])
                .collect()
        })
    }

    fn metric(&self, pick: impl FnOnce(&bikebot_planner::PathMetrics) -> Option<f64>) -> f64 {
        self.report
            .metrics
            .as_ref()
            .and_then(pick)
            .unwrap_or(f64::NAN)
    }

    /// The plan as `bikebot plan -o` writes it.
    pub fn text(&self) -> Result<String, serde_json::Error> {
        match (&self.source, self.problem()) {
            (Source::Made(asked), Some(problem)) => {
                let plan = PlanJson::new(&self.report, &problem, &self.times);
                let name = asked.field.name().map(str::to_owned);
                let file = PlanFile::new(&plan, &self.report, &problem, &asked.params, name);
                let mut text = serde_json::to_string(&file)?;
                text.push('\n');
                Ok(text)
            }
            (Source::Read { text, .. }, _) => Ok(text.clone()),
            (Source::Made(_), None) => Ok(String::new()),
        }
    }

    /// A plan out of a file's text.
    pub fn read(py: Python<'_>, text: String, world: Option<PyWorld>) -> PyResult<Self> {
        let made = work::here(py, |_| {
            let stored = StoredPlan::parse(text.as_bytes())?;
            let report = stored.report()?;
            Ok((text, stored, report))
        })?;
        let (text, stored, report) = made.map_err(|error: bikebot_sim::plan_file::PlanFileError| {
            value(format!(
                "the text is no plan: {error}; it takes one written by Plan.to_json or `bikebot plan -o`"
            ))
        })?;
        Ok(Self {
            times: Times {
                prepare: stored.prepare_s,
                plan: stored.time_s,
                trace: stored.trace_times().collect(),
            },
            start: stored.problem.start(),
            goal: stored.problem.goal(),
            report,
            source: Source::Read {
                text,
                stored: Box::new(stored),
                world: world.map(Box::new),
            },
            samples: OnceLock::new(),
            segments: OnceLock::new(),
        })
    }

    fn world(&self) -> Option<PyWorld> {
        match &self.source {
            Source::Made(asked) => Some(asked.field.clone().into()),
            Source::Read { world, .. } => world.as_ref().map(|it| it.field.clone().into()),
        }
    }

    fn stored_problem(&self) -> Option<StoredProblem> {
        match &self.source {
            Source::Made(asked) => {
                let name = asked.field.name().map(str::to_owned);
                Some(StoredProblem::of(&self.problem()?, &asked.params, name))
            }
            Source::Read { stored, .. } => Some(stored.problem.clone()),
        }
    }

    fn draw(&self, view: PlanView, by_curvature: bool) -> Result<String, String> {
        let text = self.text().map_err(|error| error.to_string())?;
        let picture = Picture::parse(&text).map_err(|error| error.to_string())?;
        let world = self.world();
        let obstacles = picture.obstacles();
        let ground = match &world {
            Some(world) => Ground::from(world.field.world()),
            None => Ground {
                bounds: picture.bounds(),
                obstacles: obstacles.as_deref().unwrap_or_default(),
                grid: None,
            },
        };
        let title = world
            .as_ref()
            .map_or_else(|| "plan".into(), |it| it.field.title());
        let style = PlanStyle {
            colour_by_curvature: by_curvature,
        };
        let figure =
            PlanFigure::new(&picture, ground, title, style).map_err(|error| error.to_string())?;
        Ok(svg::write(&figure.draw(view)))
    }
}

fn name(value: &impl serde::Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(Value::String(name)) => name,
        _ => String::new(),
    }
}

type Triple = (f64, f64, Option<f64>);

#[pymethods]
impl PyPlan {
    /// How it ended: "found", "no_path", "exhausted" or "timed_out".
    #[getter]
    fn outcome(&self) -> String {
        name(&self.report.outcome)
    }

    /// Why it ended so: one of a closed list, such as "found", "disconnected", "curvature_infeasible", "deadline".
    #[getter]
    fn reason(&self) -> String {
        name(&self.report.reason)
    }

    /// Whether there is a path.
    #[getter]
    fn found(&self) -> bool {
        self.report.outcome == Outcome::Found
    }

    /// Which method planned.
    #[getter]
    fn method(&self) -> &'static str {
        self.report.method.name()
    }

    /// The seed it was given.
    #[getter]
    fn seed(&self) -> u64 {
        self.report.seed
    }

    /// Iterations of all stages. The same question and seed with this as `iterations` give the same path bit for bit, also where a
    /// clock ended this search.
    #[getter]
    fn iterations(&self) -> u64 {
        self.report.iterations
    }

    /// Length of the path, m.
    #[getter]
    fn length(&self) -> f64 {
        self.metric(|it| Some(it.length))
    }

    /// No path is shorter than this, m.
    #[getter]
    fn lower_bound(&self) -> f64 {
        self.metric(|it| it.lower_bound)
    }

    /// Largest curvature, 1/m, exact; NaN for methods that join straight legs.
    #[getter]
    fn max_curvature(&self) -> f64 {
        self.metric(|it| it.max_curvature)
    }

    /// Largest jump of curvature between neighbouring curves, 1/m.
    #[getter]
    fn curvature_jump(&self) -> f64 {
        self.metric(|it| it.curvature_jump)
    }

    /// The footprint's clearance is nowhere below this, m.
    #[getter]
    fn min_clearance(&self) -> f64 {
        self.metric(|it| Some(it.min_clearance))
    }

    /// Roughness, the integral of (dκ/ds)² over the path by the square of its length, 1/m⁵.
    #[getter]
    fn roughness(&self) -> f64 {
        self.metric(|it| Some(it.roughness))
    }

    /// Roughness after resampling at 0.5 m, 1/m⁵: comparable between curves and polylines.
    #[getter]
    fn roughness_fixed_step(&self) -> f64 {
        self.metric(|it| Some(it.roughness_fixed_step))
    }

    /// Cost of the path: its length in metres and a little for its bending; NaN where the search told none.
    #[getter]
    fn cost(&self) -> f64 {
        let found = self.report.path.is_some();
        let last = self.report.trace.iter().rev().find(|entry| entry.certified);
        last.filter(|_| found).map_or(f64::NAN, |entry| entry.cost)
    }

    /// What the search took, on a prepared world, s.
    #[getter]
    fn time(&self) -> f64 {
        self.times.plan
    }

    /// What was built before the search and the next one reuses, s.
    #[getter]
    fn prepare_time(&self) -> f64 {
        self.times.prepare
    }

    /// Positions of the footprint's reference point along the path, (n, 2), m.
    #[getter]
    fn xy<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        lend_rows(slf, &slf.get().samples().xy, 2)
    }

    /// Headings along the path, (n,), rad counter-clockwise from +x.
    #[getter]
    fn heading<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        lend(slf, &slf.get().samples().heading)
    }

    /// Curvatures along the path, (n,), 1/m, positive to the left.
    #[getter]
    fn curvature<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        lend(slf, &slf.get().samples().curvature)
    }

    /// Arc lengths along the path, (n,), m.
    #[getter]
    fn s<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        lend(slf, &slf.get().samples().s)
    }

    /// The Ferguson-Coons pieces themselves, (k, 8): x0, y0, vx0, vy0, x1, y1, vx1, vy1 in metres.
    #[getter]
    fn segments<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let this = slf.get();
        let segments = this.segments.get_or_init(|| {
            let path = this.report.path.as_ref();
            let segments = path.map(PlannedPath::segments).unwrap_or_default();
            segments.iter().flat_map(|it| it.to_array()).collect()
        });
        lend_rows(slf, segments, 8)
    }

    /// Start of the question as (x, y, heading), m and rad; heading None: any.
    #[getter]
    fn start(&self) -> Triple {
        (
            self.start.position.x,
            self.start.position.y,
            self.start.heading,
        )
    }

    /// Goal of the question as (x, y, heading), m and rad; heading None: any.
    #[getter]
    fn goal(&self) -> Triple {
        (
            self.goal.position.x,
            self.goal.position.y,
            self.goal.heading,
        )
    }

    /// The outline planned for, as scenarios and the command line write it.
    #[getter]
    fn footprint(&self) -> String {
        match &self.source {
            Source::Made(asked) => asked.footprint.to_string(),
            Source::Read { stored, .. } => stored.problem.footprint.clone(),
        }
    }

    /// The curvature limit of the question, 1/m.
    #[getter]
    fn curvature_limit(&self) -> f64 {
        match &self.source {
            Source::Made(asked) => asked.params.max_curvature,
            Source::Read { stored, .. } => stored.problem.max_curvature_per_m,
        }
    }

    /// The world planned on; None for a plan read from a file.
    #[getter(world)]
    fn py_world(&self) -> Option<PyWorld> {
        self.world()
    }

    /// How the search went: a dict of arrays `time_s`, `iteration`, `length_m`, `cost` and `certified`, and a list `stage`.
    #[getter]
    fn trace<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let trace = &self.report.trace;
        let table = PyDict::new(py);
        let mut times = self.times.trace.clone();
        times.resize(trace.len(), f64::NAN);
        table.set_item("time_s", PyArray1::from_vec(py, times))?;
        table.set_item(
            "iteration",
            PyArray1::from_iter(py, trace.iter().map(|it| it.iteration)),
        )?;
        let stages: Vec<String> = trace.iter().map(|it| name(&it.stage)).collect();
        table.set_item("stage", stages)?;
        table.set_item(
            "length_m",
            PyArray1::from_iter(py, trace.iter().map(|it| it.length)),
        )?;
        table.set_item(
            "cost",
            PyArray1::from_iter(py, trace.iter().map(|it| it.cost)),
        )?;
        table.set_item(
            "certified",
            PyArray1::from_iter(py, trace.iter().map(|it| it.certified)),
        )?;
        Ok(table)
    }

    /// SHA-256 over the bits of outcome, reason and segments: the same from Python, Rust and the command line.
    #[getter]
    fn result_hash(&self) -> String {
        plan_hash(&self.report)
    }

    /// `n` poses equally far apart along the path, both ends among them: (n, 3), x and y in metres, heading in radians.
    ///
    /// Raises `ValueError` for `n` below 1, or without a path.
    ///
    /// >>> p = plan(World.from_shapes((0, 0, 10, 10)), (1, 1, 0.0), (9, 1, 0.0))
    /// >>> p.sample(5)[:, 0]
    /// array([1., 3., 5., 7., 9.])
    fn sample<'py>(
        &self,
        py: Python<'py>,
        n: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let n = count("n", n, 1, 100_000_000)? as usize;
        let Some(path) = &self.report.path else {
            return Err(value(format!(
                "there is no path to sample: {}",
                self.outcome()
            )));
        };
        let rows = work::here(py, |_| {
            let length = path.length();
            let mut rows = Vec::with_capacity(3 * n);
            for i in 0..n {
                let s = match n {
                    1 => 0.0,
                    _ => length * i as f64 / (n - 1) as f64,
                };
                match path {
                    PlannedPath::Curves(curves) => {
                        let point = curves.at(s);
                        rows.extend([point.position.x, point.position.y, point.heading]);
                    }
                    PlannedPath::Polyline(line) => {
                        let at = line.point_at(s);
                        let heading = if line.segment_count() == 0 {
                            0.0
                        } else {
                            line.heading_at(s)
                        };
                        rows.extend([at.x, at.y, heading]);
                    }
                }
            }
            rows
        })?;
        use numpy::PyArrayMethods;
        PyArray1::from_vec(py, rows).reshape([n, 3])
    }

    /// The plan as JSON, as `bikebot plan -o plan.json` writes it: written to `path`, or returned where none is given.
    #[pyo3(signature = (path=None))]
    fn to_json(&self, py: Python<'_>, path: Option<&Bound<'_, PyAny>>) -> PyResult<Option<String>> {
        let path = path.map(|it| arguments::path("path", it)).transpose()?;
        let text = work::here(py, |_| self.text())?
            .map_err(|error| errors::bikebot(py, &error.to_string()))?;
        match path {
            None => Ok(Some(text)),
            Some(path) => {
                std::fs::write(&path, text).map_err(|error| errors::file(&path, error))?;
                Ok(None)
            }
        }
    }

    /// Reads a plan: `source` is the path of a file, or the JSON text itself (what begins with a brace).
    ///
    /// Raises `ValueError` for what is no plan, `OSError` for a file that cannot be read.
    #[staticmethod]
    fn from_json(py: Python<'_>, source: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(text) = source.extract::<String>()
            && text.trim_start().starts_with('{')
        {
            return Self::read(py, text, None);
        }
        let path = arguments::path("source", source)?;
        let bytes = files::read(&path)?;
        let text = String::from_utf8(bytes)
            .map_err(|_| value(format!("{} is no plan: it is not UTF-8", path.display())))?;
        Self::read(py, text, None)
    }

    /// The plan as an SVG picture: on its map, with curvature along the path and the search against time.
    ///
    /// `view` is "sheet" (all of it), "map", "curvature" or "search". `color_by_curvature` colours the path.
    #[pyo3(signature = (*, view="sheet", color_by_curvature=false))]
    fn svg(&self, py: Python<'_>, view: &str, color_by_curvature: bool) -> PyResult<String> {
        let view = match view {
            "sheet" => PlanView::Sheet,
            "map" => PlanView::Map,
            "curvature" => PlanView::Curvature,
            "search" => PlanView::Search,
            other => {
                return Err(value(format!(
                    "view is {other:?}: it takes \"sheet\", \"map\", \"curvature\" or \"search\""
                )));
            }
        };
        work::here(py, |_| self.draw(view, color_by_curvature))?.map_err(value)
    }

    fn _repr_svg_(&self, py: Python<'_>) -> PyResult<String> {
        self.svg(py, "sheet", false)
    }

    /// The plan held against `world` (its own where none is given) by code that shares nothing with the planner's checks: a dict.
    #[pyo3(signature = (world=None, *, max_curvature=None, footprint=None, margin=None))]
    fn _verify<'py>(
        &self,
        py: Python<'py>,
        world: Option<&Bound<'py, PyAny>>,
        max_curvature: Option<&Bound<'py, PyAny>>,
        footprint: Option<&Bound<'py, PyAny>>,
        margin: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let given = match world {
            Some(world) => Some(
                world
                    .cast::<PyWorld>()
                    .map_err(|_| {
                        kind(format!(
                            "world takes a World, not {}",
                            arguments::type_name(world)
                        ))
                    })?
                    .get()
                    .field
                    .clone()
                    .into(),
            ),
            None => self.world(),
        };
        let Some(given) = given else {
            return Err(value(
                "the plan was read from a file, which carries no map: give the world it was made on",
            ));
        };
        let (Some(path), Some(stored)) = (&self.report.path, self.stored_problem()) else {
            return Err(value(format!(
                "there is no path to verify: {}",
                self.outcome()
            )));
        };
        let limit = match max_curvature {
            Some(limit) => arguments::positive("max_curvature", limit)?,
            None => self.curvature_limit(),
        };
        let footprint = match (footprint, &self.source) {
            (Some(footprint), _) => arguments::footprint(footprint, || search::bike(limit))?,
            (None, Source::Made(asked)) => asked.footprint.clone(),
            (None, Source::Read { stored, .. }) => stored
                .problem
                .footprint
                .parse()
                .map_err(|error: bikebot_world::FootprintError| value(error.to_string()))?,
        };
        let margin = match margin {
            Some(margin) => number("margin", margin)?,
            None => stored.margin_m,
        };
        let in_ball = stored.ends_in.as_deref() == Some(&name(&GoalMode::Ball));
        let metrics = self.report.metrics.as_ref();
        let claims = Claims {
            kind: if self.report.method.is_curvature_limited() {
                PathKind::Curves
            } else {
                PathKind::Polyline
            },
            margin,
            goal_radius: if in_ball { self.goal.tolerance } else { 0.0 },
            promises: Promises {
                max_curvature: metrics.and_then(|it| it.max_curvature),
                curvature_jump: metrics.and_then(|it| it.curvature_jump),
                min_clearance: metrics.map(|it| it.min_clearance).filter(|it| !it.is_nan()),
                length: metrics.map(|it| it.length),
            },
        };
        let (verdict, mismatches) = work::aside(py, None, |_| {
            let problem = PlanningProblem {
                world: given.field.world(),
                footprint,
                start: self.start,
                goal: self.goal,
                max_curvature: limit,
            };
            let verdict = verify(&problem, &path.segments(), &claims);
            (verdict, stored.mismatches(&problem, margin))
        })?;
        let found = PyDict::new(py);
        found.set_item("holds", verdict.holds() && mismatches.is_empty())?;
        found.set_item("certificate", json::to_python(py, &verdict.certificate)?)?;
        found.set_item("violations", json::to_python(py, &verdict.violations)?)?;
        found.set_item("mismatches", json::to_python(py, &mismatches)?)?;
        Ok(found.into_any())
    }

    fn __repr__(&self) -> String {
        let Some(metrics) = &self.report.metrics else {
            return format!(
                "Plan({}: {}, {})",
                self.outcome(),
                self.reason(),
                self.method()
            );
        };
        let mut text = format!("Plan(found, {} m", tidy(metrics.length));
        if let Some(most) = metrics.max_curvature {
            text.push_str(&format!(", curvature up to {} /m", tidy(most)));
        }
        text.push_str(&format!(
            ", clearance {} m, {}, {} ms)",
            tidy(metrics.min_clearance),
            self.method(),
            tidy((1e6 * self.times.plan).round() / 1e3)
        ));
        text
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let text = self.to_json(py, None)?;
        let restore = py.get_type::<Self>().getattr("_restore")?;
        Ok((restore, (text, self.world()).into_pyobject(py)?))
    }

    /// What pickling calls.
    #[classmethod]
    fn _restore(
        _class: &Bound<'_, PyType>,
        py: Python<'_>,
        text: String,
        world: Option<&Bound<'_, PyWorld>>,
    ) -> PyResult<Self> {
        Self::read(py, text, world.map(|it| it.get().field.clone().into()))
    }
}
