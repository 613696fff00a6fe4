//! A course: the task with everything that never changes from episode to episode.

use super::{EpisodeError, Task};
use crate::chance::{Component, episode_stream, uniform};
use crate::closed_loop::{plan, ridden_path};
use crate::scenario::PlantModel;
use crate::setup::{PathSource, Setup};
use bikebot_control::{FollowedPath, RideController};
use bikebot_dynamics::{BikeState, Measurement};
use bikebot_geometry::CurvePath;
use std::sync::Arc;

/// How far a start may lie from the scenario's to either side, evenly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Of the roll, rad.
    pub roll: f64,
    /// Of the roll rate, rad/s.
    pub roll_rate: f64,
    /// Of the balancer's angle, rad.
    pub balancer: f64,
    /// Of the balancer's rate, rad/s.
    pub balancer_rate: f64,
    /// Of the place across the heading, m; not for a bike that stands.
    pub lateral: f64,
    /// Of the heading, rad; not for a bike that stands.
    pub heading: f64,
}

impl Spread {
    /// Every episode starts as the scenario does.
    pub const NONE: Self = Self {
        roll: 0.0,
        roll_rate: 0.0,
        balancer: 0.0,
        balancer_rate: 0.0,
        lateral: 0.0,
        heading: 0.0,
    };

    /// A little of everything: what any of our laws catches with ease.
    #[must_use]
    pub fn of(task: Task) -> Self {
        match task {
            Task::Balance => Self {
                roll: 0.03,
                roll_rate: 0.05,
                balancer: 0.1,
                balancer_rate: 0.2,
                lateral: 0.0,
                heading: 0.0,
            },
            Task::Follow | Task::Ride => Self {
                roll: 0.01,
                roll_rate: 0.02,
                balancer: 0.05,
                balancer_rate: 0.1,
                lateral: 0.05,
                heading: 0.05,
            },
        }
    }

    fn check(&self) -> Result<(), EpisodeError> {
        for (name, value) in [
            ("roll", self.roll),
            ("roll_rate", self.roll_rate),
            ("balancer", self.balancer),
            ("balancer_rate", self.balancer_rate),
            ("lateral", self.lateral),
            ("heading", self.heading),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(EpisodeError::Spread { name, value });
            }
        }
        Ok(())
    }
}

/// The task of an episode: a scenario, what the agent does in it, and how its starts differ.
#[derive(Debug)]
pub struct Course {
    pub(super) setup: Arc<Setup>,
    task: Task,
    spread: Spread,
    /// Where every start is drawn around.
    start: BikeState,
    pub(super) track: Option<Track>,
}

/// What there is to follow.
#[derive(Debug)]
pub(super) struct Track {
    pub path: CurvePath,
    /// Our controller as it is before the first tick; its follower is never asked.
    pub controller: RideController,
}

impl Track {
    /// The curve of the followed point.
    pub fn followed(&self) -> &FollowedPath {
        self.controller.followed_path()
    }
}

impl Course {
    /// Lays a scenario out as a course; a path is planned where it says so, until `stop` does.
    ///
    /// # Errors
    ///
    /// Where the scenario does not fit the task, has no path for it, or makes no sense.
    pub fn new(
        setup: impl Into<Arc<Setup>>,
        task: Task,
        spread: Spread,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Result<Self, EpisodeError> {
        spread.check()?;
        let setup = setup.into();
        let refuse = |problem: String, remedy| Err(EpisodeError::Scenario { problem, remedy });
        let name = &setup.name;
        let path = match (&setup.path, task) {
            (PathSource::Standing, Task::Balance) => None,
            (_, Task::Balance) => {
                return refuse(
                    format!("the scenario {name:?} rides, and the task is to balance standing"),
                    "use a scenario with plant.model = \"two_link\"",
                );
            }
            (PathSource::Standing, Task::Follow | Task::Ride) => {
                return refuse(
                    format!("the scenario {name:?} has no path to follow"),
                    "give it a [map] and a [goal], or a [path], and plant.model = \"bike3d\"",
                );
            }
            _ if setup.plant == PlantModel::Kinematic => {
                return refuse(
                    format!(
                        "the plant of the scenario {name:?} is kinematic and neither rolls nor falls"
                    ),
                    "use plant.model = \"bike3d\"",
                );
            }
            _ if setup.online.is_some() => {
                return refuse(
                    format!(
                        "the scenario {name:?} finds its way while it rides (map.known = false)"
                    ),
                    "use one whose map is known",
                );
            }
            (PathSource::Given(path), _) => Some(path.clone()),
            (PathSource::Planned, _) => {
                let report = plan(&setup, stop)?;
                let Some(path) = ridden_path(&report) else {
                    return refuse(
                        format!("no path was found for the scenario {name:?}"),
                        "ride it with `bikebot run` to see why, or try another run.seed",
                    );
                };
                Some(path)
            }
        };
        let mut start = setup.start;
        if let (Some(path), true) = (
            &path,
            setup.start_pose.is_some_and(|pose| pose.heading.is_none()),
        ) {
            start.pose.heading = path.start_pose().heading;
        }
        let track = path
            .map(|path| {
                let controller = RideController::new(
                    &setup.bike,
                    setup.mode,
                    &setup.follow,
                    &setup.balance,
                    &path,
                    &Measurement::ideal(&start, 0.0),
                    setup.control.seconds(),
                )
                .map_err(crate::error::Error::from)?
                .guarded(&setup.supervisor);
                Ok::<_, EpisodeError>(Track { path, controller })
            })
            .transpose()?;
        Ok(Self {
            setup,
            task,
            spread,
            start,
            track,
        })
    }

    /// What the agent does.
    #[must_use]
    pub fn task(&self) -> Task {
        self.task
    }

    /// The scenario.
    #[must_use]
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The path of the rear contact, where there is one.
    #[must_use]
    pub fn path(&self) -> Option<&CurvePath> {
        self.track.as_ref().map(|track| &track.path)
    }

    /// Time at the beginning of a step, s.
    pub(super) fn time(&self, step: u64) -> f64 {
        self.setup.control.times(step).seconds()
    }

    /// Where episode `number` of `seed` starts.
    pub(super) fn start(&self, seed: u64, number: u64) -> BikeState {
        let mut rng = episode_stream(seed, Component::Start, number);
        // Always all numbers, in this order.
        let mut within = |spread: f64| spread * (2.0 * uniform(&mut rng) - 1.0);
        let s = &self.spread;
        let mut state = self.start;
        state.roll += within(s.roll);
        state.roll_rate += within(s.roll_rate);
        state.balancer += within(s.balancer);
        state.balancer_rate += within(s.balancer_rate);
        let (lateral, heading) = (within(s.lateral), within(s.heading));
        if self.track.is_some() {
            state.pose.position += state.pose.left_normal() * lateral;
            state.pose.heading = bikebot_geometry::angle::wrap(state.pose.heading + heading);
        }
        state
    }
}
