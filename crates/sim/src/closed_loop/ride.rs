//! One ride: the tick, stage by stage. What is written down of it stands in `account`, how it ends in `verdict`.

mod account;
mod verdict;

use self::account::giving_way_in_words;
pub(crate) use self::verdict::{REST_TIME, at_rest};
use super::Progress;
use crate::chance::{Component, stream};
use crate::clock::SimTime;
use crate::disturbance::Turn;
use crate::error::Error;
use crate::fall_cause::FallCause;
use crate::monitor::{Edge, FallMonitor, PassivityMonitor, Verdict};
use crate::online::{Lookout, Motion, Riding};
use crate::outcome::{Metrics, RunOutcome};
use crate::pilot::Pilot;
use crate::record::{Event, LogLevel, NoticeKind, OrderSample, Recorder, ResultHasher, ScanSample};
use crate::ride_metrics::RideMetrics;
use crate::setup::Setup;
use crate::true_bike::TrueBike;
use crate::true_scene::TrueScene;
use bikebot_control::External;
use bikebot_dynamics::{BikeState, LaserScan, LaserScanner, Measurement, SweepingLaser};
use bikebot_geometry::{CurvePath, Point2};

/// Spacing at which the followed curve is recorded, m.
const FOLLOWED_STEP: f64 = 0.05;

/// How a ride went.
pub(super) struct Ridden {
    pub(super) outcome: RunOutcome,
    pub(super) reason: String,
    pub(super) metrics: Metrics,
    pub(super) ticks: u64,
    /// Wall-clock time of planning while riding, s.
    pub(super) replanning: f64,
}

/// One ride: the true bike, everything mounted on it, and what watches it.
pub(super) struct Ride<'s> {
    setup: &'s Setup,
    path: Option<CurvePath>,
    lookout: Option<Lookout>,
    clock: Option<&'s dyn Fn() -> f64>,
    /// Wall-clock time of planning, s.
    replanning: f64,
    bike: TrueBike,
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

struct Facts {
    contact: Option<bikebot_dynamics::ContactForces>,
    clearance: Option<f64>,
    /// The moving obstacle that the outline has met, deeper than anything that stands.
    moving: Option<usize>,
    balancer_at_limit: bool,
}

impl<'s> Ride<'s> {
    pub(super) fn new(
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
        let measured = Measurement::ideal(&state, 0.0);
        let pilot = Pilot::new(setup, path.as_ref(), &measured)?;
        let noise = stream(setup.seed, Component::Sensors);
        let bike = TrueBike::new(setup, state, pilot.offset(), noise)?;
        let laser = match (setup.laser.enabled, &setup.world) {
            (true, Some(_)) => Some(SweepingLaser::new(
                LaserScanner::new(&setup.laser)?,
                stream(setup.seed, Component::Laser),
            )),
            _ => None,
        };
        Ok(Self {
            falls: FallMonitor::new(setup.control),
            fall_cause: FallCause::default(),
            passivity: PassivityMonitor::default(),
            metrics: RideMetrics::new(setup.plant, path.as_ref()),
            distance: 0.0,
            resting: SimTime::ZERO,
            rest: state.pose.position,
            edges: Edges::default(),
            setup,
            path,
            lookout,
            clock,
            replanning: 0.0,
            bike,
            laser,
            pilot,
        })
    }

    pub(super) fn run(
        mut self,
        recorder: &mut dyn Recorder,
        hasher: &mut ResultHasher,
        stop: &(dyn Fn() -> bool + Sync),
        progress: &mut dyn FnMut(Progress),
        external: &mut External<'_>,
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
            hash_state(hasher, &self.bike.state);
            let done = self.tick(time, recorder, external)?;
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
    fn tick(
        &mut self,
        time: SimTime,
        recorder: &mut dyn Recorder,
        external: &mut External<'_>,
    ) -> Result<Tick, Error> {
        // Sense.
        let t = time.seconds();
        self.disturb(time, recorder)?;
        let measured = self.bike.measure(t);
        let scan = self.sense(time, recorder)?;
        self.look_ahead(time, &measured, scan.as_ref(), recorder)?;

        // Follow and balance.
        let output = match self.pilot.tick(t, &measured, external) {
            Ok(output) => output,
            // No fault of the ride: whoever lent the controller is told.
            Err(error) if error.is_from_outside() => return Err(error.into()),
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
        let before = self.bike.state;
        let metrics = &mut self.metrics;
        let saturation = self.bike.act(
            self.setup,
            t,
            &output.command,
            output.offset,
            |from, to, input, dt| metrics.work(from, to, input, dt),
        );

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
        self.bike
            .disturbances
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

    /// Lets the laser look from where the bike truly is. A scan that is handed out now, its latency over, is written down
    /// and belongs to whoever steers by it.
    fn sense(
        &mut self,
        time: SimTime,
        recorder: &mut dyn Recorder,
    ) -> Result<Option<LaserScan>, Error> {
        let scene = TrueScene::new(self.setup, &self.bike.plant);
        let (Some(laser), Some(scene)) = (&mut self.laser, scene) else {
            return Ok(None);
        };
        let state = &self.bike.state;
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
        let clock = self.clock;
        let now = || clock.map_or(f64::NAN, |clock| clock());
        let began = now();
        let pilot = &self.pilot;
        let riding = Riding {
            profile: &|s| pilot.profile_speed(s),
            braking: pilot.braking_limits(),
            acceleration: self.setup.follow.longitudinal_acceleration,
        };
        let (order, before) = lookout.order(&motion, &riding);
        let took = now() - began;
        if order.search.is_some() && clock.is_some() {
            self.replanning += took;
        }
        let navigator = lookout.navigator();
        recorder.record(
            time,
            &Event::Order(OrderSample {
                is_fresh: scan.is_some(),
                s: motion.s,
                path: navigator.path(),
                world: navigator.world(),
                search: order.search,
                took,
            }),
        )?;
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

    fn ended(self, time: SimTime, ticks: u64, outcome: RunOutcome, reason: &str) -> Ridden {
        let at_rest = matches!(outcome, RunOutcome::Arrived | RunOutcome::Stopped)
            .then(|| self.target())
            .flatten()
            .map(|(target, _)| (&self.bike.state.pose, target.position, target.heading));
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
