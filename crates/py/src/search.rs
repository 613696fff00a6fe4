//! A question to the planner, from Python arguments to a report.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use bikebot_planner::{
    Better, Budget, EndPose, Enough, GoalRegion, PlanError, PlanReport, Planner, PlannerParams,
    StopReason,
};
use bikebot_sim::plan_file::Times;
use bikebot_sim::{Override, ScenarioFile, Setup};
use bikebot_world::Footprint;
use pyo3::prelude::*;

use crate::arguments::{self, count, not_negative, number, positive};
use crate::errors::{self, value};
use crate::plan::PyPlan;
use crate::toml_value;
use crate::work;
use crate::world::Field;

/// Goal tolerance where none is given, m: that of scenarios.
const TOLERANCE: f64 = 0.3;
/// A scenario that plans nothing, to read planner settings with.
const BLANK: &str = "format = 1\nname = \"settings\"\n[plant]\nmodel = \"two_link\"\n";

/// Everything of a question but its ends and its budget.
#[derive(Clone)]
pub struct Asked {
    /// Where.
    pub field: Field,
    /// What must fit.
    pub footprint: Footprint,
    /// How.
    pub params: Arc<PlannerParams>,
    /// Radius of the goal ball, m.
    pub tolerance: f64,
}

/// The arguments that make an [`Asked`].
pub struct Terms<'a, 'py> {
    pub max_curvature: Option<&'a Bound<'py, PyAny>>,
    pub footprint: Option<&'a Bound<'py, PyAny>>,
    pub method: Option<&'a Bound<'py, PyAny>>,
    pub margin: Option<&'a Bound<'py, PyAny>>,
    pub tolerance: Option<&'a Bound<'py, PyAny>>,
    pub settings: Option<&'a Bound<'py, PyAny>>,
}

/// The bike's outline as planning takes it: grown by what the follower is allowed on a path of this curvature, 1/m.
pub fn bike(max_curvature: f64) -> Footprint {
    // The last one asked for: it takes a scenario to know it.
    static LAST: Mutex<Option<(f64, Footprint)>> = Mutex::new(None);
    let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((curvature, footprint)) = &*last
        && *curvature == max_curvature
    {
        return footprint.clone();
    }
    let changes = [
        Override::new("planner.footprint", "\"bike\""),
        Override::new("planner.max_curvature_per_m", format!("{max_curvature:?}")),
    ];
    let setup = ScenarioFile::parse(BLANK, &changes)
        .ok()
        .and_then(|file| Setup::resolve(&file, &mut |_| Err(String::new())).ok());
    let footprint = setup.map_or_else(Footprint::bike, |setup| setup.planning_footprint);
    *last = Some((max_curvature, footprint.clone()));
    footprint
}

fn params_of(settings: &Bound<'_, PyAny>) -> PyResult<PlannerParams> {
    let changes = toml_value::changes(settings)?;
    let changes: Vec<Override> = changes
        .into_iter()
        .map(|change| Override::new(format!("planner.{}", change.key), change.value))
        .collect();
    ScenarioFile::parse(BLANK, &changes)
        .map(|file| file.scenario.planner)
        .map_err(|error| errors::scenario(settings.py(), &error, Some("settings"), BLANK))
}

impl Asked {
    /// From the arguments of a call.
    pub fn new(field: Field, terms: &Terms<'_, '_>) -> PyResult<Self> {
        let mut params = match terms.settings {
            Some(settings) => params_of(settings)?,
            None => PlannerParams::default(),
        };
        if let Some(most) = terms.max_curvature {
            params.max_curvature = positive("max_curvature", most)?;
        }
        if let Some(method) = terms.method {
            params.method = arguments::method(method)?;
        }
        if let Some(margin) = terms.margin {
            params.margin = not_negative("margin", margin)?;
        }
        Ok(Self {
            field,
            footprint: match terms.footprint {
                Some(footprint) => arguments::footprint(footprint, || bike(params.max_curvature))?,
                None => Footprint::Point,
            },
            params: Arc::new(params),
            tolerance: match terms.tolerance {
                Some(tolerance) => not_negative("tolerance", tolerance)?,
                None => TOLERANCE,
            },
        })
    }

    /// The planner.
    pub fn planner(&self) -> Planner<'_> {
        Planner::new(
            self.field.world(),
            self.footprint.clone(),
            PlannerParams::clone(&self.params),
        )
    }

    /// The goal with its tolerance.
    pub fn goal(&self, end: EndPose) -> GoalRegion {
        GoalRegion {
            position: end.position,
            heading: end.heading,
            tolerance: self.tolerance,
        }
    }
}

/// How long to search.
#[derive(Debug, Clone, Copy, Default)]
pub struct Limits {
    pub seed: u64,
    /// s.
    pub time: Option<f64>,
    pub iterations: Option<u64>,
    pub target_cost: Option<f64>,
    /// s.
    pub min_time: Option<f64>,
    pub threads: usize,
}

impl Limits {
    /// From the arguments of a call.
    pub fn new(
        seed: Option<&Bound<'_, PyAny>>,
        time_limit: Option<&Bound<'_, PyAny>>,
        iterations: Option<&Bound<'_, PyAny>>,
        target_cost: Option<&Bound<'_, PyAny>>,
        min_time: Option<&Bound<'_, PyAny>>,
        threads: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let limits = Self {
            seed: seed.map_or(Ok(1), arguments::seed)?,
            time: time_limit
                .map(|it| not_negative("time_limit", it))
                .transpose()?,
            iterations: iterations
                .map(|it| count("iterations", it, 1, u64::MAX))
                .transpose()?,
            target_cost: target_cost
                .map(|it| number("target_cost", it))
                .transpose()?,
            min_time: min_time
                .map(|it| not_negative("min_time", it))
                .transpose()?,
            threads: threads.map_or(Ok(1), |it| count("threads", it, 1, 1024))? as usize,
        };
        if limits.min_time.is_some() && limits.target_cost.is_none() {
            return Err(value(
                "min_time is for target_cost: the least time to look for what may be cheaper still",
            ));
        }
        if let (Some(least), Some(most)) = (limits.min_time, limits.time)
            && least > most
        {
            return Err(value(format!(
                "min_time is {least} s, longer than the time_limit of {most} s"
            )));
        }
        Ok(limits)
    }
}

/// Plans, asking `stopped` often; `on_better` hears of each better path as it is found, with the seconds since the search began.
pub fn search(
    asked: &Asked,
    start: EndPose,
    goal: GoalRegion,
    limits: &Limits,
    stopped: &(dyn Fn() -> bool + Sync),
    on_better: &mut dyn FnMut(Better<'_>, f64),
) -> Result<(PlanReport, Times), PlanError> {
    let planner = asked.planner();
    let began = Instant::now();
    // All that a second question would find ready; a search under a time limit prepares only what it comes by, within its limit.
    if limits.time.is_none() {
        planner.prepare(&stopped);
    }
    let mut times = Times {
        prepare: began.elapsed().as_secs_f64(),
        ..Times::default()
    };
    let began = Instant::now();
    let seconds = || began.elapsed().as_secs_f64();
    let is_settled = || limits.min_time.is_none_or(|least| seconds() >= least);
    let stop = || {
        if stopped() {
            Some(StopReason::Cancelled)
        } else if limits.time.is_some_and(|limit| seconds() >= limit) {
            Some(StopReason::Deadline)
        } else {
            None
        }
    };
    let budget = Budget {
        iterations: limits.iterations,
        stop: Some(&stop),
        enough: limits.target_cost.map(|cost| Enough {
            cost,
            settled: Some(&is_settled),
        }),
        threads: limits.threads,
    };
    let report = planner.observe(start, goal, limits.seed, &budget, &mut |_, better| {
        let now = seconds();
        times.trace.push(now);
        if let Some(better) = better {
            on_better(better, now);
        }
    })?;
    times.plan = seconds();
    Ok((report, times))
}

/// [`search`] from Python, with the interpreter's lock released.
pub fn plan(
    py: Python<'_>,
    asked: Asked,
    start: EndPose,
    goal: EndPose,
    limits: &Limits,
) -> PyResult<PyPlan> {
    let goal = asked.goal(goal);
    // A grid method's solver is not asked to stop within 50 ms; and the helpers of several threads do not look for signals.
    let found = if limits.threads > 1 || asked.params.method.is_deterministic() {
        let (its, limits) = (asked.clone(), *limits);
        work::apart(py, None, move |shared| {
            let stopped = || shared.is_stopped();
            search(&its, start, goal, &limits, &stopped, &mut |_, _| {})
        })?
    } else {
        work::here(py, |watch| {
            let stopped = || watch.is_stopped();
            search(&asked, start, goal, limits, &stopped, &mut |_, _| {})
        })?
    };
    let (report, times) = found.map_err(|error| errors::plan(py, &error))?;
    Ok(PyPlan::made(report, times, asked, start, goal))
}
