//! `plan`, `Planner` and the iterator of better and better paths.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;

use bikebot_geometry::FergusonCurve;
use bikebot_planner::{Better, EndPose, PlanError, PlanReport, TraceEntry};
use bikebot_sim::plan_file::Times;
use pyo3::prelude::*;

use crate::arguments::{self, type_name};
use crate::errors::{self, kind, value};
use crate::plan::PyPlan;
use crate::search::{self, Asked, Limits, Terms};
use crate::work;
use crate::world::PyWorld;

/// The world argument.
fn world<'a, 'py>(object: &'a Bound<'py, PyAny>) -> PyResult<&'a Bound<'py, PyWorld>> {
    object.cast::<PyWorld>().map_err(|_| {
        kind(format!(
            "world takes a bikebot.World, not {}: make one by World.load, World.from_array, World.from_shapes or World.from_text",
            type_name(object)
        ))
    })
}

/// Plans a path of continuous, bounded curvature from `start` to `goal`.
///
/// `start` and `goal` are (x, y), (x, y, heading) or (x, y, None) in metres and radians; without a heading any will do. The other
/// arguments, all optional: `max_curvature` in 1/m (default 0.8); `footprint`, what must not touch anything: "point" (default), "bike",
/// "disc:0.4", "capsule:1.8x0.6", "box:1.8x0.6", or the vertices of a polygon as an (n, 2) array, x forward, in metres; `method`
/// (default "full"); `seed`; `time_limit` in seconds and `iterations` end the search with the best so far; `target_cost` ends it as soon as
/// a path costs no more, though not before `min_time` seconds; `threads` search at the same time, with the same result for any number;
/// `margin` is the clearance to keep and `tolerance` the radius of the goal ball, in metres; `settings` are further keys of a scenario's
/// `[planner]` as a dict.
///
/// Equal arguments give an equal path, bit for bit, unless a clock ended the search. A search in vain is an outcome. Raises
/// `PlanError` (with `.reason`) for a start or goal in an obstacle or off the map, `ValueError` or `TypeError` naming the argument.
///
/// >>> import math
/// >>> world = World.from_shapes((0, 0, 20, 20), discs=[(10, 10, 4)])
/// >>> p = plan(world, (2, 2, 0.0), (18, 18, math.pi / 2), max_curvature=0.5, footprint="disc:0.3")
/// >>> p.found and p.max_curvature <= 0.5
/// True
#[pyfunction]
#[pyo3(signature = (world, start, goal, *, max_curvature=None, footprint=None, method=None, seed=None, time_limit=None, iterations=None, target_cost=None, min_time=None, threads=None, margin=None, tolerance=None, settings=None))]
#[allow(clippy::too_many_arguments, reason = "keywords of Python")]
pub fn plan<'py>(
    py: Python<'py>,
    world: &Bound<'py, PyAny>,
    start: &Bound<'py, PyAny>,
    goal: &Bound<'py, PyAny>,
    max_curvature: Option<&Bound<'py, PyAny>>,
    footprint: Option<&Bound<'py, PyAny>>,
    method: Option<&Bound<'py, PyAny>>,
    seed: Option<&Bound<'py, PyAny>>,
    time_limit: Option<&Bound<'py, PyAny>>,
    iterations: Option<&Bound<'py, PyAny>>,
    target_cost: Option<&Bound<'py, PyAny>>,
    min_time: Option<&Bound<'py, PyAny>>,
    threads: Option<&Bound<'py, PyAny>>,
    margin: Option<&Bound<'py, PyAny>>,
    tolerance: Option<&Bound<'py, PyAny>>,
    settings: Option<&Bound<'py, PyAny>>,
) -> PyResult<PyPlan> {
    let field = self::world(world)?.get().field.clone();
    let start = arguments::end("start", start)?;
    let goal = arguments::end("goal", goal)?;
    let terms = Terms {
        max_curvature,
        footprint,
        method,
        margin,
        tolerance,
        settings,
    };
    let limits = Limits::new(seed, time_limit, iterations, target_cost, min_time, threads)?;
    search::plan(py, Asked::new(field, &terms)?, start, goal, &limits)
}

/// A planner prepared once and asked often: a world, an outline and the settings of the search.
///
/// The arguments are those of `plan`.
///
/// >>> planner = Planner(World.from_shapes((0, 0, 20, 20), boxes=[(9, 0, 11, 15)]), max_curvature=0.8, footprint="disc:0.3")
/// >>> paths = list(planner.refine((2, 2, 0.0), (18, 2, None), iterations=2000))
/// >>> all(better.found for better in paths) and len(paths) > 0
/// True
#[pyclass(name = "Planner", module = "bikebot", frozen)]
pub struct PyPlanner {
    asked: Asked,
}

#[pymethods]
impl PyPlanner {
    #[new]
    #[pyo3(signature = (world, *, max_curvature=None, footprint=None, method=None, margin=None, tolerance=None, settings=None))]
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    fn new<'py>(
        py: Python<'py>,
        world: &Bound<'py, PyAny>,
        max_curvature: Option<&Bound<'py, PyAny>>,
        footprint: Option<&Bound<'py, PyAny>>,
        method: Option<&Bound<'py, PyAny>>,
        margin: Option<&Bound<'py, PyAny>>,
        tolerance: Option<&Bound<'py, PyAny>>,
        settings: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let field = self::world(world)?.get().field.clone();
        let terms = Terms {
            max_curvature,
            footprint,
            method,
            margin,
            tolerance,
            settings,
        };
        let asked = Asked::new(field, &terms)?;
        work::here(py, |watch| {
            asked.planner().prepare(&|| watch.is_stopped());
        })?;
        Ok(Self { asked })
    }

    /// The world planned on.
    #[getter]
    fn world(&self) -> PyWorld {
        self.asked.field.clone().into()
    }

    /// The outline planned for.
    #[getter]
    fn footprint(&self) -> String {
        self.asked.footprint.to_string()
    }

    /// The curvature limit, 1/m.
    #[getter]
    fn max_curvature(&self) -> f64 {
        self.asked.params.max_curvature
    }

    /// The method.
    #[getter]
    fn method(&self) -> &'static str {
        self.asked.params.method.name()
    }

    /// A path from `start` to `goal`: see `plan`.
    #[pyo3(signature = (start, goal, *, seed=None, time_limit=None, iterations=None, target_cost=None, min_time=None, threads=None))]
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    fn plan<'py>(
        &self,
        py: Python<'py>,
        start: &Bound<'py, PyAny>,
        goal: &Bound<'py, PyAny>,
        seed: Option<&Bound<'py, PyAny>>,
        time_limit: Option<&Bound<'py, PyAny>>,
        iterations: Option<&Bound<'py, PyAny>>,
        target_cost: Option<&Bound<'py, PyAny>>,
        min_time: Option<&Bound<'py, PyAny>>,
        threads: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<PyPlan> {
        let start = arguments::end("start", start)?;
        let goal = arguments::end("goal", goal)?;
        let limits = Limits::new(seed, time_limit, iterations, target_cost, min_time, threads)?;
        search::plan(py, self.asked.clone(), start, goal, &limits)
    }

    /// Better and better paths from `start` to `goal`, each valid: an iterator of `Plan`, while the search goes on behind it.
    ///
    /// It ends when the search does: at `time_limit` seconds, after `iterations`, or when nothing better is to be expected. The last path
    /// is the one `plan` gives. Leaving the loop ends the search; `result` then tells how it ended.
    #[pyo3(signature = (start, goal, *, seed=None, time_limit=None, iterations=None, threads=None))]
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    fn refine<'py>(
        &self,
        start: &Bound<'py, PyAny>,
        goal: &Bound<'py, PyAny>,
        seed: Option<&Bound<'py, PyAny>>,
        time_limit: Option<&Bound<'py, PyAny>>,
        iterations: Option<&Bound<'py, PyAny>>,
        threads: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Refinement> {
        let py = start.py();
        let start = arguments::end("start", start)?;
        let goal = arguments::end("goal", goal)?;
        let limits = Limits::new(seed, time_limit, iterations, None, None, threads)?;
        // A question that makes no sense is told now, not at the first path.
        let problem = self.asked.planner().problem(start, self.asked.goal(goal));
        problem
            .check(self.asked.params.margin)
            .map_err(|error| errors::plan(py, &error))?;
        Refinement::begin(self.asked.clone(), start, goal, limits)
    }

    fn __repr__(&self) -> String {
        format!(
            "Planner({}, {}, curvature up to {} /m)",
            self.asked.params.method,
            self.asked.footprint,
            crate::world::tidy(self.asked.params.max_curvature)
        )
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let params = toml::Table::try_from(&*self.asked.params)
            .map_err(|error| errors::bikebot(py, &error.to_string()))?;
        let settings = crate::json::to_python(py, &params)?;
        let state = (
            self.world(),
            self.asked.footprint.to_string(),
            self.asked.tolerance,
            settings,
        );
        let restore = py.get_type::<Self>().getattr("_restore")?;
        Ok((restore, state.into_pyobject(py)?.into_any()))
    }

    /// What pickling calls.
    #[classmethod]
    fn _restore<'py>(
        _class: &Bound<'py, pyo3::types::PyType>,
        py: Python<'py>,
        world: &Bound<'py, PyAny>,
        footprint: &Bound<'py, PyAny>,
        tolerance: &Bound<'py, PyAny>,
        settings: &Bound<'py, PyAny>,
    ) -> PyResult<Self> {
        Self::new(
            py,
            world,
            None,
            Some(footprint),
            None,
            None,
            Some(tolerance),
            Some(settings),
        )
    }
}

/// From the search to the loop.
enum Message {
    Better(TraceEntry, Vec<FergusonCurve>, f64),
    Ended(Box<Result<(PlanReport, Times), PlanError>>),
    Broken,
}

/// What the search has to tell and the loop has not heard yet.
#[derive(Default)]
struct Queue {
    messages: Mutex<VecDeque<Message>>,
    arrived: Condvar,
}

impl Queue {
    fn send(&self, message: Message) {
        let mut messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        messages.push_back(message);
        self.arrived.notify_one();
    }

    /// The next message, if one comes before the next look for signals.
    fn wait(&self) -> Option<Message> {
        let messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut messages, _) = self
            .arrived
            .wait_timeout_while(messages, work::LOOK, |messages| messages.is_empty())
            .unwrap_or_else(PoisonError::into_inner);
        messages.pop_front()
    }
}

#[derive(Default)]
struct State {
    last: Option<Py<PyPlan>>,
    result: Option<Py<PyPlan>>,
    ended: bool,
    closed: bool,
}

/// An iterator of better and better plans: see `Planner.refine`.
#[pyclass(name = "Refinement", module = "bikebot", frozen)]
pub struct Refinement {
    asked: Asked,
    start: EndPose,
    goal: EndPose,
    seed: u64,
    stop: Arc<AtomicBool>,
    queue: Arc<Queue>,
    state: Mutex<State>,
}

impl Refinement {
    fn begin(asked: Asked, start: EndPose, goal: EndPose, limits: Limits) -> PyResult<Self> {
        let queue = Arc::new(Queue::default());
        let stop = Arc::new(AtomicBool::new(false));
        let this = Self {
            asked: asked.clone(),
            start,
            goal,
            seed: limits.seed,
            stop: stop.clone(),
            queue: queue.clone(),
            state: Mutex::default(),
        };
        let search = move || {
            let search = || {
                search::search(
                    &asked,
                    start,
                    asked.goal(goal),
                    &limits,
                    &|| stop.load(Ordering::Relaxed),
                    &mut |better, seconds| {
                        let curves = better.curves.to_vec();
                        queue.send(Message::Better(*better.entry, curves, seconds));
                    },
                )
            };
            queue.send(match catch_unwind(AssertUnwindSafe(search)) {
                Ok(ended) => Message::Ended(Box::new(ended)),
                Err(_) => Message::Broken,
            });
        };
        thread::Builder::new()
            .name("bikebot-refine".into())
            .spawn(search)
            .map_err(|error| pyo3::exceptions::PyOSError::new_err(error.to_string()))?;
        Ok(this)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn plan_of(
        &self,
        py: Python<'_>,
        entry: TraceEntry,
        curves: &[FergusonCurve],
        seconds: f64,
    ) -> PyResult<PyPlan> {
        let goal = self.asked.goal(self.goal);
        let report = work::here(py, |_| {
            let better = Better {
                entry: &entry,
                curves,
            };
            let planner = self.asked.planner();
            planner.report_of(better, self.start, goal, self.seed)
        })?;
        let report =
            report.ok_or_else(|| errors::bikebot(py, "the curves of a better path do not join"))?;
        let times = Times {
            plan: seconds,
            trace: vec![seconds],
            ..Times::default()
        };
        Ok(PyPlan::made(
            report,
            times,
            self.asked.clone(),
            self.start,
            goal,
        ))
    }

    /// Takes note of how the search ended; its path, if the loop has not seen it.
    fn end(
        &self,
        py: Python<'_>,
        ended: Result<(PlanReport, Times), PlanError>,
    ) -> PyResult<Option<Py<PyPlan>>> {
        let (report, times) = ended.map_err(|error| errors::plan(py, &error))?;
        let last = self.state().last.as_ref().map(|last| last.clone_ref(py));
        let is_new =
            report.path.is_some() && last.is_none_or(|last| !last.get().same_path(&report));
        let goal = self.asked.goal(self.goal);
        let plan = Py::new(
            py,
            PyPlan::made(report, times, self.asked.clone(), self.start, goal),
        )?;
        self.state().result = Some(plan.clone_ref(py));
        Ok(is_new.then_some(plan))
    }
}

impl Drop for Refinement {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

#[pymethods]
impl Refinement {
    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Py<PyPlan>>> {
        loop {
            {
                let state = self.state();
                if state.closed {
                    return Err(value(
                        "the refinement was closed: ask Planner.refine for another",
                    ));
                }
                if state.ended {
                    return Ok(None);
                }
            }
            let Some(message) = py.detach(|| self.queue.wait()) else {
                py.check_signals().inspect_err(|_| {
                    self.stop.store(true, Ordering::Relaxed);
                })?;
                continue;
            };
            match message {
                Message::Better(entry, curves, seconds) => {
                    let plan = Py::new(py, self.plan_of(py, entry, &curves, seconds)?)?;
                    self.state().last = Some(plan.clone_ref(py));
                    return Ok(Some(plan));
                }
                Message::Ended(ended) => {
                    self.state().ended = true;
                    return self.end(py, *ended);
                }
                Message::Broken => {
                    self.state().ended = true;
                    return Err(errors::bikebot(
                        py,
                        "a bug in bikebot, please report it: the search panicked",
                    ));
                }
            }
        }
    }

    /// Ends the search. The iterator gives nothing more.
    fn close(&self) {
        self.stop.store(true, Ordering::Relaxed);
        self.state().closed = true;
    }

    /// How the search ended; None while it goes on and the loop has not heard its end.
    #[getter]
    fn result(&self, py: Python<'_>) -> Option<Py<PyPlan>> {
        self.state().result.as_ref().map(|plan| plan.clone_ref(py))
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, _exception: &Bound<'_, pyo3::types::PyTuple>) {
        self.close();
    }

    fn __repr__(&self) -> String {
        let state = self.state();
        let word = match (state.closed, state.ended) {
            (true, _) => "closed",
            (_, true) => "ended",
            _ => "searching",
        };
        format!("Refinement({word})")
    }
}
