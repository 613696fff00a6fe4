//! The closed loop: plan, then sense ▶ follow ▶ balance ▶ integrate, tick by tick, and record it all.
//!
//! ```text
//!   plan ─▶ ┌ sensors ▶ laser ▶ controller ▶ actuators ▶ plant (n steps) ▶ monitors ┐ ─▶ verdict
//!           └───────────────────────── one tick ◀──────────────────────────────────┘
//! ```
//!
//! This is the only place where planner, dynamics and control meet. Each stage takes what it needs by
//! reference and returns a value; the order above is the order of the calls in `Ride::tick`.

use crate::chance::{Component, stream};
use crate::clock::SimTime;
use crate::disturbance::{Disturbances, MotorFaults, SensorFaults, Turn};
use crate::error::Error;
use crate::fall_cause::{FallCause, is_beyond_recovery};
use crate::monitor::{Edge, FallMonitor, PassivityMonitor, Verdict};
use crate::online::{Course, Decision, Lookout, Motion, Order, Riding, Status};
use crate::outcome::{ExpectCheck, Metrics, RunOutcome};
use crate::picture;
use crate::pilot::{Pilot, PilotOutput};
use crate::record::{
    ControlSample, Event, LogLevel, NoticeKind, RecordError, Recorder, ResultHasher, ScanSample,
    StateSample,
};
use crate::ride_metrics::{RideMetrics, TickFacts};
use crate::scenario::PlantModel;
use crate::setup::{PathSource, Setup};
use crate::true_plant::{TruePlant, true_offset};
use crate::true_scene::TrueScene;
use bikebot_control::Intervention;
use bikebot_dynamics::{
    Actuators, BikeInput, BikeState, Command, LaserScan, LaserScanner, Measurement, Saturation,
    Sensors, SweepingLaser,
};
use bikebot_geometry::{CurvePath, Point2};
use bikebot_planner::{Budget, EndPose, Outcome, PlanReport, PlannedPath};

/// |roll| (rad) and |roll rate| (rad/s) below which a standing bike counts as recovered.
const RECOVERED: (f64, f64) = (0.5 * std::f64::consts::PI / 180.0, 0.05);
/// Spacing at which the followed curve is recorded, m.
const FOLLOWED_STEP: f64 = 0.05;
/// How long the bike has to be at rest before the ride ends, s.
const REST_TIME: f64 = 0.5;
/// At rest: not farther than this from where it came to rest, m, nor faster than this, m/s (a noisy encoder
/// makes the drive tremble), upright within this, rad, and turning over at less than this, rad/s. A roll sensor with a bias, or a moment that the balancer cannot hold, is met by a lean of a few degrees.
const REST_DISTANCE: f64 = 0.003;
const REST_SPEED: f64 = 0.02;
const REST_ROLL: f64 = 5.0 * std::f64::consts::PI / 180.0;
const REST_ROLL_RATE: f64 = 0.05;

/// How far a run has come, for a progress display.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Progress {
    /// A path is being planned.
    Planning,
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
            let report = plan(setup, control.stop)?;
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
    let problem = setup.problem().ok_or(Error::NothingToPlan)?;
    let cancelled = || stop().then_some(bikebot_planner::StopReason::Cancelled);
    let budget = Budget::until(&cancelled);
    Ok(bikebot_planner::plan(
        &problem,
        &setup.planner,
        setup.seed,
        &budget,
    )?)
}

/// The curves of a plan, if it found any the bike can follow.
fn ridden_path(report: &PlanReport) -> Option<CurvePath> {
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

struct Ridden {
    outcome: RunOutcome,
    reason: String,
    metrics: Metrics,
    ticks: u64,
    /// Wall-clock time of planning while riding, s.
    replanning: f64,
}

/// One ride: the true bike, everything mounted on it, and what watches it.
struct Ride<'s> {
    setup: &'s Setup,
    path: Option<CurvePath>,
    lookout: Option<Lookout>,
    clock: Option<&'s dyn Fn() -> f64>,
    /// Wall-clock time of planning, s.
    replanning: f64,
    plant: TruePlant,
    state: BikeState,
    input: BikeInput,
    /// Friction of the ground under the rear and the front wheel.
    friction: [f64; 2],
    disturbances: Disturbances,
    actuators: Actuators,
    motor_faults: MotorFaults,
    sensors: Sensors,
    sensor_faults: SensorFaults,
    laser: Option<SweepingLaser>,
    pilot: Pilot,
    falls: FallMonitor,
    fall_cause: FallCause,
    passivity: PassivityMonitor,
    metrics: RideMetrics,
    distance: f64,
    /// For how long the bike has been at rest, and where.
    resting: SimTime,
    rest: Point2,
    edges: Edges,
}

#[derive(Default)]
struct Edges {
    saturated: Edge,
    passivity: Edge,
    decoupling: Edge,
    mode_change: Edge,
}

/// What one tick leaves for the recorder and the verdict.
struct Tick {
    verdict: Option<Verdict>,
    arrived: Option<(RunOutcome, &'static str)>,
}

impl<'s> Ride<'s> {
    fn new(
        setup: &'s Setup,
        path: Option<CurvePath>,
        lookout: Option<Lookout>,
        clock: Option<&'s dyn Fn() -> f64>,
    ) -> Result<Self, Error> {
        let mut state = setup.start;
        if let (Some(path), true) = (
            &path,
            setup
                .start_pose
                .is_some_and(|start| start.heading.is_none()),
        ) {
            // A free heading is the one the plan chose.
            state.pose.heading = path.start_pose().heading;
        }
        let sensors = Sensors::new(
            &setup.noise,
            &setup.bike,
            setup.control.seconds(),
            stream(setup.seed, Component::Sensors),
        );
        let measured = Measurement::ideal(&state, 0.0);
        let pilot = Pilot::new(setup, path.as_ref(), &measured)?;
        let offset = true_offset(&setup.bike, &setup.true_bike, setup.mode, pilot.offset());
        let plant = TruePlant::new(setup, &state, offset)?;
        let laser = match (setup.laser.enabled, &setup.world) {
            (true, Some(_)) => Some(SweepingLaser::new(
                LaserScanner::new(&setup.laser)?,
                stream(setup.seed, Component::Laser),
            )),
            _ => None,
        };
        Ok(Self {
            actuators: Actuators::new(plant.params()),
            motor_faults: MotorFaults::new(plant.params()),
            disturbances: Disturbances::new(&setup.disturbances, plant.params()),
            friction: [plant.params().friction; 2],
            sensor_faults: SensorFaults::new(
                &setup.disturbances,
                setup.control,
                setup.bike.wheelbase,
                setup.noise.odometry_replay,
            ),
            falls: FallMonitor::new(setup.control),
            fall_cause: FallCause::default(),
            passivity: PassivityMonitor::default(),
            metrics: RideMetrics::new(setup.plant, path.as_ref()),
            input: BikeInput {
                offset,
                ..BikeInput::default()
            },
            distance: 0.0,
            resting: SimTime::ZERO,
            rest: state.pose.position,
            edges: Edges::default(),
            setup,
            path,
            lookout,
            clock,
            replanning: 0.0,
            plant,
            state,
            sensors,
            laser,
            pilot,
        })
    }

    fn run(
        mut self,
        recorder: &mut dyn Recorder,
        hasher: &mut ResultHasher,
        stop: &(dyn Fn() -> bool + Sync),
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Ridden, Error> {
        let control = self.setup.control;
        // A tenth of a simulated second, in ticks.
        let look_up = (100_000_000 / control.nanoseconds()).max(1);
        let followed = self.pilot.followed_path(FOLLOWED_STEP);
        if !followed.is_empty() {
            recorder.record(SimTime::ZERO, &Event::FollowedPath(&followed))?;
        }
        let mut tick = 0;
        loop {
            let time = control.times(tick);
            if tick % look_up == 0 {
                if stop() {
                    recorder.record(
                        time,
                        &Event::Notice {
                            kind: NoticeKind::Interrupted,
                            text: "stopped from outside",
                            value: 0.0,
                        },
                    )?;
                    return Ok(self.ended(time, tick, RunOutcome::Interrupted, "interrupted"));
                }
                progress(Progress::Riding {
                    time: time.seconds(),
                    distance: self.distance,
                    length: self.path.as_ref().map_or(0.0, CurvePath::length),
                });
            }
            hash_state(hasher, &self.state);
            let done = self.tick(time, recorder)?;
            if let Some(verdict) = done.verdict {
                return Ok(self.ended(time, tick, verdict.outcome, verdict.reason));
            }
            if let Some((outcome, reason)) = done.arrived {
                return Ok(self.ended(time, tick, outcome, reason));
            }
            if time >= self.setup.duration {
                let (outcome, reason) = self.at_the_end_of_time();
                if outcome == RunOutcome::TimedOut {
                    recorder.record(
                        time,
                        &Event::Notice {
                            kind: NoticeKind::TimedOut,
                            text: "the scenario's duration is over",
                            value: time.seconds(),
                        },
                    )?;
                }
                return Ok(self.ended(time, tick, outcome, reason));
            }
            tick += 1;
        }
    }

    /// One control period.
    fn tick(&mut self, time: SimTime, recorder: &mut dyn Recorder) -> Result<Tick, Error> {
        // Sense.
        let t = time.seconds();
        self.disturb(time, recorder)?;
        let measured = self
            .sensors
            .measure(t, &self.state, self.actuators.steer_rate());
        let measured = self.sensor_faults.bend(&self.disturbances, t, &measured);
        let scan = self.sense(time, recorder)?;
        self.look_ahead(time, &measured, scan.as_ref(), recorder)?;

        // Follow and balance.
        let output = match self.pilot.tick(t, &measured) {
            Ok(output) => output,
            Err(error) => {
                let text = error.to_string();
                recorder.record(
                    time,
                    &Event::Notice {
                        kind: NoticeKind::ControlFailed,
                        text: &text,
                        value: 0.0,
                    },
                )?;
                let verdict = Some(Verdict {
                    outcome: RunOutcome::Fell,
                    reason: "control_failed",
                });
                return Ok(Tick {
                    verdict,
                    arrived: None,
                });
            }
        };

        // Act, and let the world answer. The input that holds at the tick itself is what is recorded.
        let before = self.state;
        let saturation = self.integrate(t, &output.command, &output);

        // Judge and write down.
        let facts = self.record(time, &before, &measured, &output, saturation, recorder)?;
        let verdict = self.judge(time, &before, facts, recorder)?;
        Ok(Tick {
            verdict,
            arrived: self.at_rest(time, &output, recorder)?,
        })
    }

    /// Tells of the disturbances that have come or gone.
    fn disturb(&mut self, time: SimTime, recorder: &mut dyn Recorder) -> Result<(), Error> {
        let mut told = Ok(());
        let progress = self.metrics.progress();
        self.disturbances
            .advance(time.seconds(), progress, |Turn { text, size }| {
                if told.is_ok() {
                    told = recorder.record(
                        time,
                        &Event::Notice {
                            kind: NoticeKind::Disturbance,
                            text: &text,
                            value: size,
                        },
                    );
                }
            });
        Ok(told?)
    }

    fn integrate(&mut self, t: f64, command: &Command, output: &PilotOutput) -> Saturation {
        let dt = self.setup.step.seconds();
        let steps = self.setup.control.nanoseconds() / self.setup.step.nanoseconds();
        let mut saturation = Saturation::default();
        let setup = self.setup;
        let offset = true_offset(&setup.bike, &setup.true_bike, setup.mode, output.offset);
        let mass = self.plant.params().mass();
        self.plant.begin_tick();
        for step in 0..steps {
            let t = t + step as f64 * dt;
            let bent = self.motor_faults.bend(&self.disturbances, t, dt, command);
            let applied = self.actuators.apply(
                &bent.command,
                self.state.steer,
                self.state.balancer_rate,
                dt,
            );
            saturation = saturation.or(applied.saturation).or(bent.saturation);
            let loads = self.disturbances.at(t, dt, &self.state);
            let mut input = loads.on(
                BikeInput {
                    drive_force: applied.drive_force,
                    steer_rate: applied.steer_rate,
                    balancer_torque: applied.balancer_torque,
                    offset,
                    ..BikeInput::default()
                },
                mass,
            );
            if bent.steering_is_stuck {
                input.steer_rate = 0.0;
                self.actuators.stop_steering();
            }
            if bent.balancer_is_stuck {
                input.balancer_torque = self.plant.jamming_torque(&self.state, &input, dt);
            }
            if step == 0 {
                self.input = input;
                self.friction = loads.friction;
            }
            let before = self.state;
            if !setup.traffic.is_empty() {
                self.plant.move_obstacles(&setup.traffic, t + dt);
            }
            self.state = self.plant.step(t, &before, &input, loads.friction, dt);
            self.metrics.work(&before, &self.state, &input, dt);
            // What is no number is not stepped any further: the judge names it.
            if !self.state.is_finite() {
                break;
            }
        }
        saturation
    }

    /// Lets the laser look from where the bike truly is. A scan that is handed out now, its latency over, is written down
    /// and belongs to whoever steers by it.
    fn sense(
        &mut self,
        time: SimTime,
        recorder: &mut dyn Recorder,
    ) -> Result<Option<LaserScan>, Error> {
        let scene = TrueScene::new(self.setup, &self.plant);
        let (Some(laser), Some(scene)) = (&mut self.laser, scene) else {
            return Ok(None);
        };
        let state = &self.state;
        let scan = laser.advance(&scene, time.seconds(), &state.pose, state.roll);
        if let Some(scan) = &scan {
            recorder.record(
                time,
                &Event::Scan(ScanSample {
                    stamp: SimTime::from_seconds(scan.middle()),
                    start_angle: scan.angle_min,
                    angle_step: scan.angle_step,
                    ranges: &scan.ranges,
                }),
            )?;
        }
        Ok(scan)
    }

    /// Plans from what the laser has shown, where the scenario asks for it, and tells the pilot how far that carries.
    fn look_ahead(
        &mut self,
        time: SimTime,
        measured: &Measurement,
        scan: Option<&LaserScan>,
        recorder: &mut dyn Recorder,
    ) -> Result<(), Error> {
        let Some(lookout) = &mut self.lookout else {
            return Ok(());
        };
        lookout.note(time.seconds(), measured);
        if let Some(scan) = scan {
            // What cannot be placed says nothing; that the sensors fail is the controller's to report.
            if lookout.hear(scan).is_ok() {
                recorder.record(time, &Event::Belief(lookout.belief()))?;
            }
        }
        let speed = measured.speed.max(0.0);
        let motion = Motion {
            time: time.seconds(),
            s: self.pilot.arc_length(),
            speed,
            stopping_distance: self.pilot.stopping_distance(speed),
        };
        let began = self.clock.map(|clock| clock());
        let pilot = &self.pilot;
        let riding = Riding {
            profile: &|s| pilot.profile_speed(s),
            braking: pilot.braking_limits(),
            acceleration: self.setup.follow.longitudinal_acceleration,
        };
        let (order, before) = lookout.order(&motion, &riding);
        if let (true, Some(began), Some(clock)) = (order.searches > 0, began, self.clock) {
            self.replanning += clock() - began;
        }
        if let Some(new) = &order.path {
            if let Err(error) = self.pilot.replace_path(&new.curves, motion.s) {
                lookout.navigator().refuse();
                let text = format!("the new path is not ridden: {error}");
                let level = LogLevel::Warning;
                recorder.record(time, &Event::Log { level, text: &text })?;
                return Ok(());
            }
            self.metrics.replace_path(&new.curves);
        }
        self.pilot.set_stop(order.stop_at);
        self.pilot.set_speed_cap(lookout.counsel().speed_cap);
        for turn in &lookout.counsel().turns {
            let (kind, text, value) = giving_way_in_words(turn);
            let text = &text;
            recorder.record(time, &Event::Notice { kind, text, value })?;
        }
        self.tell_of(time, &order, before, &motion, recorder)?;
        if let Some(new) = order.path {
            self.path = Some(new.curves);
        }
        Ok(())
    }

    /// Writes down what has changed with an order.
    fn tell_of(
        &self,
        time: SimTime,
        order: &Order,
        before: Status,
        motion: &Motion,
        recorder: &mut dyn Recorder,
    ) -> Result<(), Error> {
        if let Some(new) = &order.path {
            let text = format!("{}, from {:.2} m on", new.cause.name(), new.joint);
            recorder.record(
                time,
                &Event::Notice {
                    kind: NoticeKind::Replanned,
                    text: &text,
                    value: new.curves.length(),
                },
            )?;
            picture::plan(self.setup, None, Some(&new.curves), time, recorder)?;
            recorder.record(
                time,
                &Event::FollowedPath(&self.pilot.followed_path(FOLLOWED_STEP)),
            )?;
        }
        let mut notice =
            |kind, text: &str, value| recorder.record(time, &Event::Notice { kind, text, value });
        if order.is_emergency {
            notice(
                NoticeKind::Emergency,
                "what was believed free is so no more",
                order.stop_at.map_or(f64::NAN, |stop| stop - motion.s),
            )?;
        }
        match (before, order.status) {
            (Status::Halted(old), Status::Halted(new)) if old == new => {}
            (_, Status::Halted(halt)) => notice(
                NoticeKind::Halted,
                halt.in_words(),
                order.stop_at.unwrap_or(f64::NAN),
            )?,
            (Status::Halted(_), _) => notice(NoticeKind::Resumed, "on the way again", motion.s)?,
            _ => {}
        }
        Ok(())
    }

    /// Writes one tick down; returns the clearance and the contact forces it found on the way.
    fn record(
        &mut self,
        time: SimTime,
        state: &BikeState,
        measured: &Measurement,
        output: &PilotOutput,
        saturation: Saturation,
        recorder: &mut dyn Recorder,
    ) -> Result<Facts, Error> {
        let plant = &self.plant;
        let input = self.input;
        let contact = plant.contact(state, &input);
        let acceleration = plant.accelerations(state, &input);
        let yaw_rate = plant.yaw_rate(state);
        let setup = self.setup;
        let standing = setup
            .world
            .as_ref()
            .filter(|_| self.path.is_some())
            .map(|world| world.footprint_clearance(&setup.footprint, &state.pose));
        let moving = standing.and_then(|standing| {
            let (footprint, pose) = (&setup.footprint, &state.pose);
            setup
                .traffic
                .nearest(footprint, pose, time.seconds(), standing)
        });
        let clearance = moving.map(|(_, clearance)| clearance).or(standing);
        let following = self.pilot.true_following(state);
        let lateral_error = following.map(|following| following.lateral_error);
        let friction = self.friction;
        let rear_error = self.metrics.add(
            &TickFacts {
                state,
                yaw_rate,
                contact: contact.as_ref(),
                friction,
                balancer_torque: input.balancer_torque,
                lateral_error,
                followed_point: following.map(|following| (following.point, following.look_ahead)),
                clearance,
                decoupling: output.decoupling,
                fallback: output.fallback,
            },
            self.path.as_ref(),
        );
        let distance = self.distance;
        self.distance += (self.state.pose.position - state.pose.position).norm();

        let sample = StateSample {
            x_m: state.pose.position.x,
            y_m: state.pose.position.y,
            heading_rad: state.pose.heading,
            steer_rad: state.steer,
            roll_rad: state.roll,
            balancer_rad: state.balancer,
            speed_mps: state.speed,
            yaw_rate_radps: yaw_rate,
            roll_rate_radps: state.roll_rate,
            balancer_rate_radps: state.balancer_rate,
            steer_rate_radps: input.steer_rate,
            acceleration_mps2: acceleration.speed,
            yaw_acceleration_radps2: acceleration.yaw,
            roll_acceleration_radps2: acceleration.roll,
            balancer_acceleration_radps2: acceleration.balancer,
            curvature_per_m: plant.curvature(state),
            distance_m: distance,
            balancer_offset_m: input.offset.d,
            drive_force_n: input.drive_force,
            balancer_torque_nm: input.balancer_torque,
            roll_moment_nm: input.roll_moment + input.push.roll_moment(state.roll),
            slope_force_n: input.slope_force + input.push.forward,
            rear_lateral_force_n: contact.map_or(f64::NAN, |c| c.rear_lateral),
            front_lateral_force_n: contact.map_or(f64::NAN, |c| c.front_normal),
            rear_load_n: contact.map_or(f64::NAN, |c| c.rear_load),
            front_load_n: contact.map_or(f64::NAN, |c| c.front_load),
            friction_use_rear: contact.map_or(f64::NAN, |c| c.friction_use_rear(friction[0])),
            friction_use_front: contact.map_or(f64::NAN, |c| c.friction_use_front(friction[1])),
            energy_j: plant.energy(state, &input),
            clearance_m: clearance.unwrap_or(f64::NAN),
        };
        recorder.record(time, &Event::State(&sample))?;
        if !setup.traffic.is_empty() {
            let shapes = setup.traffic.shapes(time.seconds());
            recorder.record(time, &Event::MovingObstacles(&shapes))?;
        }

        let excess = output
            .energy
            .and_then(|account| self.passivity.check(&account, self.setup.control.seconds()));
        let mut control = output.sample;
        control.drive_saturated = saturation.drive_force;
        control.steer_saturated = saturation.steer_rate || saturation.steer_stop;
        control.balancer_saturated = saturation.balancer_torque || saturation.balancer_speed;
        control.rear_error_m = rear_error.unwrap_or(f64::NAN);
        control.lateral_error_m = lateral_error.unwrap_or(f64::NAN);
        control.passivity_excess_j = excess.unwrap_or(0.0);
        with_measurement(&mut control, measured);
        recorder.record(time, &Event::Control(&control))?;

        let mut notice = |edge: bool, kind, text: &str, value: f64| {
            if edge {
                recorder.record(time, &Event::Notice { kind, text, value })
            } else {
                Ok(())
            }
        };
        notice(
            self.edges.saturated.rises(control.balancer_saturated),
            NoticeKind::Saturated,
            "the balancer's torque or speed is at its limit",
            input.balancer_torque,
        )?;
        notice(
            self.edges.passivity.rises(excess.is_some()),
            NoticeKind::Passivity,
            "the follower stored energy that nobody supplied",
            excess.unwrap_or(0.0),
        )?;
        notice(
            self.edges.decoupling.rises(output.fallback),
            NoticeKind::Decoupling,
            "the balance law is near its singularity and its guard took over",
            output.decoupling.unwrap_or(0.0),
        )?;
        notice(
            self.edges.mode_change.rises(output.offset.rate != 0.0),
            NoticeKind::ModeChange,
            "the balancer's offset is being shifted",
            output.offset.d,
        )?;
        if let Some(intervention) = output.intervention {
            let (text, used) = match intervention {
                Intervention::ToFlywheel(margin, used) => (
                    format!("to flywheel mode: {} runs out", margin.words()),
                    used,
                ),
                Intervention::SlowDown(margin, used) => {
                    (format!("slower: {} runs out", margin.words()), used)
                }
                Intervention::SpeedUp => ("back to speed: every margin is open".to_owned(), 0.0),
            };
            recorder.record(
                time,
                &Event::Notice {
                    kind: NoticeKind::Supervisor,
                    text: &text,
                    value: used,
                },
            )?;
        }
        Ok(Facts {
            contact,
            clearance,
            moving: moving
                .filter(|(_, clearance)| *clearance < 0.0)
                .map(|(index, _)| index)
                .or(self.plant.touched_moving_obstacle()),
            balancer_at_limit: control.balancer_saturated || self.balancer_is_at_limit(state),
        })
    }

    /// A law that knows the limits asks for no more, so that nothing is cut: the limit is seen in what is given.
    fn balancer_is_at_limit(&self, state: &BikeState) -> bool {
        const NEARLY: f64 = 0.999;
        let bike = self.plant.params();
        self.input.balancer_torque.abs() >= NEARLY * bike.balancer_torque_max
            || state.balancer_rate.abs() >= NEARLY * bike.balancer_speed_max
    }

    fn judge(
        &mut self,
        time: SimTime,
        state: &BikeState,
        facts: Facts,
        recorder: &mut dyn Recorder,
    ) -> Result<Option<Verdict>, Error> {
        let verdict = self
            .falls
            .judge(state, facts.contact.as_ref(), self.friction);
        let certain = matches!(self.setup.plant, PlantModel::TwoLink | PlantModel::Bike3d)
            && is_beyond_recovery(self.plant.params(), state, &self.input);
        let given_up = self.falls.give_up(certain);
        let verdict = verdict.or(given_up).or_else(|| {
            // The next state has to be finite before anything else looks at it.
            (!self.state.is_finite()).then_some(Verdict {
                outcome: RunOutcome::Fell,
                reason: "not_finite",
            })
        });
        self.fall_cause.watch(state.roll, facts.balancer_at_limit);
        let verdict = verdict.map(|verdict| match verdict.reason {
            "roll" => Verdict {
                reason: self.fall_cause.name(&self.disturbances, time.seconds()),
                ..verdict
            },
            _ => verdict,
        });
        let verdict = verdict.or_else(|| {
            let overlaps = facts.clearance.is_some_and(|clearance| clearance < 0.0);
            (overlaps || self.plant.has_touched_an_obstacle()).then_some(Verdict {
                outcome: RunOutcome::Collided,
                reason: if facts.moving.is_some() {
                    "moving_obstacle"
                } else {
                    "obstacle"
                },
            })
        });
        if let Some(verdict) = verdict {
            let told: String;
            let (kind, text, value) = match verdict.reason {
                "slip" => (NoticeKind::Slip, "a tyre slipped", f64::NAN),
                "wheel_lift" => (NoticeKind::WheelLift, "a wheel left the ground", f64::NAN),
                "not_finite" => {
                    let first = [state, &self.state].into_iter().find_map(not_finite);
                    let (name, value) = first.unwrap_or(("state", f64::NAN));
                    told = format!("{name} is not finite");
                    (NoticeKind::NonFinite, told.as_str(), value)
                }
                "obstacle" => (
                    NoticeKind::Collision,
                    "the outline met an obstacle",
                    facts.clearance.unwrap_or(f64::NAN),
                ),
                "moving_obstacle" => {
                    let number = facts
                        .moving
                        .and_then(|index| self.setup.traffic.number(index));
                    told = format!(
                        "the outline met obstacle {}, which the map does not know",
                        number.unwrap_or_default() + 1
                    );
                    let clearance = facts.clearance.unwrap_or(f64::NAN);
                    (NoticeKind::Collision, told.as_str(), clearance)
                }
                reason => {
                    told = fall_in_words(reason).to_owned();
                    (NoticeKind::Fell, told.as_str(), state.roll)
                }
            };
            recorder.record(time, &Event::Notice { kind, text, value })?;
        }
        Ok(verdict)
    }

    /// The ride is over when the bike has stood still and upright for a while, in truth: a noisy roll sensor
    /// is never still for long.
    fn at_rest(
        &mut self,
        time: SimTime,
        output: &PilotOutput,
        recorder: &mut dyn Recorder,
    ) -> Result<Option<(RunOutcome, &'static str)>, Error> {
        let state = &self.state;
        let at_rest = output.holds
            && state.speed.abs() < REST_SPEED
            && state.roll.abs() < REST_ROLL
            && state.roll_rate.abs() < REST_ROLL_RATE
            && (state.pose.position - self.rest).norm() < REST_DISTANCE;
        if self.path.is_none() || !at_rest {
            self.resting = SimTime::ZERO;
            self.rest = state.pose.position;
            return Ok(None);
        }
        self.resting = self.resting + self.setup.control;
        if self.resting < SimTime::from_seconds(REST_TIME) {
            return Ok(None);
        }
        let Some(goal) = self.target() else {
            return Ok(None);
        };
        let error = (self.state.pose.position - goal.0.position).norm();
        if error <= goal.1 {
            recorder.record(
                time,
                &Event::Notice {
                    kind: NoticeKind::GoalReached,
                    text: "at rest at the goal",
                    value: error,
                },
            )?;
            Ok(Some((RunOutcome::Arrived, "at_goal")))
        } else if let Some(lookout) = &self.lookout
            && lookout.waits()
        {
            Ok(lookout
                .gives_up()
                .map(|halt| (RunOutcome::Stopped, halt.name())))
        } else {
            Ok(Some((RunOutcome::Stopped, "short_of_goal")))
        }
    }

    /// Where to come to rest, the goal or else the path's end, and how far from it is near enough, m.
    fn target(&self) -> Option<(EndPose, f64)> {
        let end = self.path.as_ref()?.end_pose();
        let target = self.setup.goal.map_or(
            EndPose {
                position: end.position,
                heading: Some(end.heading),
                curvature: None,
            },
            |goal| goal.end(),
        );
        Some((target, self.setup.goal_tolerance))
    }

    fn at_the_end_of_time(&self) -> (RunOutcome, &'static str) {
        if self.setup.plant != PlantModel::TwoLink {
            return (RunOutcome::TimedOut, "duration");
        }
        let (roll, rate) = RECOVERED;
        if self.state.roll.abs() < roll && self.state.roll_rate.abs() < rate {
            (RunOutcome::Arrived, "recovered")
        } else {
            (RunOutcome::TimedOut, "not_recovered")
        }
    }

    fn ended(self, time: SimTime, ticks: u64, outcome: RunOutcome, reason: &str) -> Ridden {
        let at_rest = matches!(outcome, RunOutcome::Arrived | RunOutcome::Stopped)
            .then(|| self.target())
            .flatten()
            .map(|(target, _)| (&self.state.pose, target.position, target.heading));
        let passivity = self.path.as_ref().map(|_| self.passivity.violations());
        Ridden {
            outcome,
            reason: reason.to_owned(),
            metrics: self.metrics.finish(time.seconds(), at_rest, passivity),
            ticks,
            replanning: self.replanning,
        }
    }
}

struct Facts {
    contact: Option<bikebot_dynamics::ContactForces>,
    clearance: Option<f64>,
    /// The moving obstacle that the outline has met, deeper than anything that stands.
    moving: Option<usize>,
    balancer_at_limit: bool,
}

/// The first number of a state that is none, by the name it has in a recording.
fn not_finite(state: &BikeState) -> Option<(&'static str, f64)> {
    [
        ("x_m", state.pose.position.x),
        ("y_m", state.pose.position.y),
        ("heading_rad", state.pose.heading),
        ("steer_rad", state.steer),
        ("roll_rad", state.roll),
        ("balancer_rad", state.balancer),
        ("speed_mps", state.speed),
        ("roll_rate_radps", state.roll_rate),
        ("balancer_rate_radps", state.balancer_rate),
    ]
    .into_iter()
    .find(|(_, value)| !value.is_finite())
}

/// What is done about something that moves, as a notice.
fn giving_way_in_words(turn: &Decision) -> (NoticeKind, String, f64) {
    let Decision {
        id,
        contact,
        way,
        stopping_distance,
        ..
    } = *turn;
    match turn.course {
        Course::Clear | Course::Pass => (
            NoticeKind::Pass,
            format!("goes before mover {id}, which may be {way:.1} m ahead in {contact:.1} s"),
            contact,
        ),
        Course::SlowDown => (
            NoticeKind::Yield,
            format!("slows down to go behind mover {id}, {way:.1} m ahead in {contact:.1} s"),
            contact,
        ),
        Course::Yield => (
            NoticeKind::Yield,
            format!("stops for mover {id}, {way:.1} m ahead in {contact:.1} s"),
            contact,
        ),
        Course::Unavoidable => (
            NoticeKind::Unavoidable,
            format!(
                "mover {id} may be met in {contact:.2} s, {way:.2} m ahead, and stopping takes {stopping_distance:.2} m"
            ),
            contact,
        ),
    }
}

fn fall_in_words(reason: &str) -> &'static str {
    match reason {
        "balancer_stuck" => "the bike fell: its balancer was stuck",
        "steering_stuck" => "the bike fell: its steering was stuck",
        "sensor_fault" => "the bike fell: a sensor was faulty",
        "balancer_saturated" => "the bike fell: its balancer was at its limits",
        _ => "the bike fell",
    }
}

fn with_measurement(sample: &mut ControlSample, measured: &Measurement) {
    sample.measured_x_m = measured.pose.position.x;
    sample.measured_y_m = measured.pose.position.y;
    sample.measured_heading_rad = measured.pose.heading;
    sample.measured_speed_mps = measured.speed;
    sample.measured_steer_rad = measured.steer;
    sample.measured_roll_rad = measured.roll;
    sample.measured_roll_rate_radps = measured.roll_rate;
    sample.measured_balancer_rad = measured.balancer;
    sample.measured_balancer_rate_radps = measured.balancer_rate;
}

fn hash_state(hasher: &mut ResultHasher, state: &BikeState) {
    hasher.values(&[
        state.pose.position.x,
        state.pose.position.y,
        state.pose.heading,
        state.steer,
        state.roll,
        state.balancer,
        state.speed,
        state.roll_rate,
        state.balancer_rate,
    ]);
}
