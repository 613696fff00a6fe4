//! The closed loop: plan, then sense ▶ follow ▶ balance ▶ integrate, tick by tick, and record it all.
//!
//! ```text
//!   plan ─▶ ┌ sensors ▶ laser ▶ controller ▶ actuators ▶ plant (n steps) ▶ monitors ┐ ─▶ verdict
//!           └───────────────────────── one tick ◀──────────────────────────────────┘
//! ```
//!
//! This is the only place where planner, dynamics and control meet. Each stage takes what it needs by
//! reference and returns a value; the order above is the order of the calls in `Ride::tick`.

mod ride;

pub(crate) use self::ride::{REST_TIME, at_rest};
use self::ride::{Ridden, Ride};
use crate::clock::SimTime;
use crate::error::Error;
use crate::online::Lookout;
use crate::outcome::{ExpectCheck, Metrics, RunOutcome};
use crate::picture;
use crate::record::{Event, LogLevel, NoticeKind, RecordError, Recorder, ResultHasher};
use crate::setup::{PathSource, Setup};
use bikebot_control::External;
use bikebot_geometry::CurvePath;
use bikebot_planner::{Budget, Outcome, PlanReport, PlannedPath, Stage};

/// How far a run has come, for a progress display.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Progress {
    /// A path is being planned.
    Planning,
    /// The search has come forward: a stage's product, or a better path.
    Searched {
        /// The stage at work.
        stage: Stage,
        /// Length of what it then has, m.
        length: f64,
    },
    /// The bike rides.
    Riding {
        /// Simulated time, s.
        time: f64,
        /// Way covered, m.
        distance: f64,
        /// Length of the path, m; zero when standing.
        length: f64,
    },
}

/// What the caller lends to a run: a way to stop it, to watch it, and a clock.
pub struct RunControl<'a> {
    /// Asked at least every tenth of a simulated second and inside the planner; `true` ends the run.
    pub stop: &'a (dyn Fn() -> bool + Sync),
    /// Told of progress ten times per simulated second.
    pub progress: &'a mut dyn FnMut(Progress),
    /// Seconds since some fixed moment; only for the metrics that measure the program itself.
    pub clock: Option<&'a dyn Fn() -> f64>,
}

/// How a run ended, with everything it measured.
#[derive(Debug, Clone)]
pub struct RunReport {
    /// How it ended.
    pub outcome: RunOutcome,
    /// One of a closed list of reasons.
    pub reason: String,
    /// What was measured.
    pub metrics: Metrics,
    /// Each expectation of the scenario; empty where it has none.
    pub expect: Vec<ExpectCheck>,
    /// SHA-256 over outcome, reason and the state at each control tick, hexadecimal.
    pub result_hash: String,
    /// Control ticks that were run.
    pub ticks: u64,
    /// The plan, where one was made.
    pub plan: Option<PlanReport>,
    /// What the recorder said when it first failed. The ride went on without it.
    pub recording_failed: Option<String>,
}

impl RunReport {
    /// What decides the exit code: every expectation holds, or, without any, the bike arrived.
    #[must_use]
    pub fn passed(&self) -> bool {
        if self.expect.is_empty() {
            self.outcome == RunOutcome::Arrived
        } else {
            self.expect.iter().all(|check| check.ok)
        }
    }
}

/// Runs a scenario: plan, ride, record.
///
/// # Errors
///
/// [`Error`] where the question makes no sense, such as a start that stands in an obstacle. A bike that falls or
/// a search that ends empty is an outcome; a recorder that fails costs the recording and not the result
/// ([`RunReport::recording_failed`]).
pub fn run(
    setup: &Setup,
    recorder: &mut dyn Recorder,
    control: RunControl<'_>,
) -> Result<RunReport, Error> {
    run_with(setup, recorder, control, External::default())
}

/// As [`run`], with the path follower or the balance law that `external` lends in place of ours.
///
/// A scenario says nothing of them, so a recording of such a ride is repeated only by whoever lends them
/// again; its log says so. The same controllers give the same bits.
///
/// # Errors
///
/// As [`run`]; what a lent controller declines or gives that is no number; a follower where there is no path.
pub fn run_with(
    setup: &Setup,
    recorder: &mut dyn Recorder,
    control: RunControl<'_>,
    mut external: External<'_>,
) -> Result<RunReport, Error> {
    if external.follower.is_some() && setup.path == PathSource::Standing {
        return Err(Error::NothingToFollow);
    }
    let now = || control.clock.map(|clock| clock());
    let began = now();
    let recorder = &mut Persevering {
        inner: recorder,
        failure: None,
    };
    let mut hasher = ResultHasher::new();
    picture::scene(setup, recorder)?;
    for warning in &setup.warnings {
        recorder.record(
            SimTime::ZERO,
            &Event::Log {
                level: LogLevel::Warning,
                text: warning,
            },
        )?;
    }

    for (name, is_lent) in [
        ("path follower", external.follower.is_some()),
        ("balance law", external.balancer.is_some()),
    ] {
        if is_lent {
            recorder.record(
                SimTime::ZERO,
                &Event::Log {
                    level: LogLevel::Info,
                    text: &format!("the {name} is not one of ours: the scenario alone does not repeat this ride"),
                },
            )?;
        }
    }

    let (plan, path, lookout, halt) = match (&setup.path, &setup.online) {
        (PathSource::Given(path), _) => (None, Some(path.clone()), None, None),
        (PathSource::Standing, _) => (None, None, None, None),
        (PathSource::Planned, Some(online)) => {
            (control.progress)(Progress::Planning);
            let (mut lookout, sighting) = Lookout::first_look(setup, online)?;
            let path = lookout.navigator().path().cloned();
            (sighting.plan, path, Some(lookout), sighting.halt)
        }
        (PathSource::Planned, None) => {
            (control.progress)(Progress::Planning);
            let report = search(setup, control.stop, control.progress)?;
            let path = ridden_path(&report);
            (Some(report), path, None, None)
        }
    };
    let planned = now();
    let said = what_is_ridden(setup, plan.as_ref(), path.as_ref());
    recorder.record(
        SimTime::ZERO,
        &Event::Log {
            level: LogLevel::Info,
            text: &said,
        },
    )?;
    picture::plan(setup, plan.as_ref(), path.as_ref(), SimTime::ZERO, recorder)?;
    if let Some(text) = path.as_ref().and_then(|path| too_tight(setup, path)) {
        recorder.record(
            SimTime::ZERO,
            &Event::Log {
                level: LogLevel::Warning,
                text: &text,
            },
        )?;
    }

    let ridden = if path.is_none() && setup.path == PathSource::Planned {
        let (outcome, reason) = match halt {
            Some(halt) => (RunOutcome::NoPath, halt.name().to_owned()),
            None => without_path(plan.as_ref()),
        };
        let kind = if outcome == RunOutcome::Interrupted {
            NoticeKind::Interrupted
        } else {
            NoticeKind::NoPath
        };
        recorder.record(
            SimTime::ZERO,
            &Event::Notice {
                kind,
                text: &reason,
                value: 0.0,
            },
        )?;
        Ridden {
            outcome,
            reason,
            metrics: Metrics::default(),
            ticks: 0,
            replanning: 0.0,
        }
    } else {
        Ride::new(setup, path, lookout, control.clock)?.run(
            recorder,
            &mut hasher,
            control.stop,
            control.progress,
            &mut external,
        )?
    };

    let mut metrics = ridden.metrics;
    if let (Some(began), Some(planned), Some(ended)) = (began, planned, now()) {
        metrics.plan_time_s = plan
            .is_some()
            .then_some(planned - began + ridden.replanning);
        metrics.wall_time_s = Some(ended - began);
        metrics.real_time_factor = metrics
            .time_s
            .map(|time| time / (ended - planned).max(1e-9));
    }
    let expect = setup
        .expect
        .as_ref()
        .map(|expect| expect.checks(ridden.outcome, &ridden.reason, &metrics))
        .unwrap_or_default();
    Ok(RunReport {
        outcome: ridden.outcome,
        result_hash: hasher.finish(ridden.outcome.name(), &ridden.reason),
        reason: ridden.reason,
        metrics,
        expect,
        ticks: ridden.ticks,
        plan,
        recording_failed: recorder.failure.take().map(|error| error.to_string()),
    })
}

/// Lets a ride go on when its recorder fails, and remembers the failure.
struct Persevering<'r> {
    inner: &'r mut dyn Recorder,
    failure: Option<RecordError>,
}

impl Recorder for Persevering<'_> {
    fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
        if self.failure.is_none() {
            self.failure = self.inner.record(time, event).err();
        }
        Ok(())
    }
}

/// Plans the path of a scenario and nothing else, until done or until `stop` says so.
///
/// # Errors
///
/// [`Error::Plan`] where start or goal make no sense.
pub fn plan(setup: &Setup, stop: &(dyn Fn() -> bool + Sync)) -> Result<PlanReport, Error> {
    search(setup, stop, &mut |_| {})
}

/// [`plan`], telling how far the search has come.
fn search(
    setup: &Setup,
    stop: &(dyn Fn() -> bool + Sync),
    progress: &mut dyn FnMut(Progress),
) -> Result<PlanReport, Error> {
    let problem = setup.problem().ok_or(Error::NothingToPlan)?;
    let cancelled = || stop().then_some(bikebot_planner::StopReason::Cancelled);
    let budget = Budget::until(&cancelled);
    Ok(bikebot_planner::plan_observed(
        &problem,
        &setup.planner,
        setup.seed,
        &budget,
        &mut |entry, _| {
            progress(Progress::Searched {
                stage: entry.stage,
                length: entry.length,
            });
        },
    )?)
}

/// The curves of a plan, if it found any the bike can follow.
pub(crate) fn ridden_path(report: &PlanReport) -> Option<CurvePath> {
    match (&report.outcome, &report.path) {
        (Outcome::Found, Some(PlannedPath::Curves(path))) => Some(path.clone()),
        _ => None,
    }
}

/// The first line of a recording's log.
fn what_is_ridden(setup: &Setup, report: Option<&PlanReport>, path: Option<&CurvePath>) -> String {
    let name = &setup.name;
    match (report, path) {
        (Some(report), Some(path)) => format!(
            "{name}: planned {:.2} m by {} in {} iterations, curvature up to {:.3} per metre",
            path.length(),
            report.method.name(),
            report.iterations,
            path.max_curvature()
        ),
        (Some(report), None) => format!(
            "{name}: {} found no path in {} iterations",
            report.method.name(),
            report.iterations
        ),
        (None, Some(path)) => format!("{name}: a given path of {:.2} m", path.length()),
        (None, None) => format!("{name}: standing and balancing"),
    }
}

fn without_path(report: Option<&PlanReport>) -> (RunOutcome, String) {
    match report {
        Some(report) if report.outcome == Outcome::Found => {
            (RunOutcome::NoPath, "not_rideable".to_owned())
        }
        Some(report) if report.reason == bikebot_planner::Reason::Cancelled => {
            (RunOutcome::Interrupted, "cancelled".to_owned())
        }
        Some(report) => (RunOutcome::NoPath, reason_name(report.reason)),
        None => (RunOutcome::NoPath, "no_plan".to_owned()),
    }
}

/// The planner's reason in the words of `plan --json`.
fn reason_name(reason: bikebot_planner::Reason) -> String {
    match serde_json::to_value(reason) {
        Ok(serde_json::Value::String(name)) => name,
        _ => "no_path".to_owned(),
    }
}

/// What to say of a path that turns more tightly than the steering stops allow.
fn too_tight(setup: &Setup, path: &CurvePath) -> Option<String> {
    let (curvature, possible) = (
        path.max_curvature(),
        setup.bike.steer_max().tan() / setup.bike.wheelbase,
    );
    (curvature > possible).then(|| {
        format!(
            "the path turns with up to {curvature:.3} 1/m, but the steering allows no more than {possible:.3} 1/m"
        )
    })
}
