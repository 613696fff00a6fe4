//! One bike on a course, step by step.

use super::course::{Course, Track};
use super::{Ending, EpisodeError, PREVIEW, Task};
use crate::chance::{Component, episode_stream};
use crate::clock::SimTime;
use crate::closed_loop::at_rest;
use crate::fall_cause::is_beyond_recovery;
use crate::monitor::FallMonitor;
use crate::scenario::PlantModel;
use crate::true_bike::TrueBike;
use bikebot_control::external::{Declined, External, FollowerCommand, FollowerView};
use bikebot_control::{ControlError, RideController};
use bikebot_dynamics::{BikeState, Command, Measurement, Offset};
use bikebot_geometry::{Pose2, angle};
use std::sync::Arc;

/// Beside the curve by more than this, the path is left, m.
const LEFT: f64 = 1.0;
/// Past the end by more than this, the goal is missed, m.
const PAST: f64 = 0.5;
/// How far along the curve the nearest point may move in a step, m, beyond twice the way ridden.
const REACH: f64 = 0.1;
/// The same for a pose that comes late.
const MEASURED_REACH: f64 = 0.5;

/// What became of one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// What it was worth.
    pub reward: f64,
    /// Why the episode ended with it, if it did.
    pub ending: Ending,
}

/// One bike on a course.
#[derive(Debug)]
pub struct Episode {
    course: Arc<Course>,
    seed: u64,
    number: u64,
    bike: TrueBike,
    controller: Option<RideController>,
    falls: FallMonitor,
    measured: Measurement,
    /// Foot of the true followed point on the curve, m, and its distance beside it.
    foot: (f64, f64),
    resting: SimTime,
    step: u64,
    is_over: bool,
}

impl Episode {
    /// The first episode of `seed` on a course.
    ///
    /// # Errors
    ///
    /// Where the bike cannot be built, as of rigid bodies with impossible parts.
    pub fn new(course: &Arc<Course>, seed: u64) -> Result<Self, EpisodeError> {
        Self::number(course, seed, 0)
    }

    /// Episode `number` of `seed`.
    fn number(course: &Arc<Course>, seed: u64, number: u64) -> Result<Self, EpisodeError> {
        let state = course.start(seed, number);
        let noise = episode_stream(seed, Component::Sensors, number);
        let bike = TrueBike::new(&course.setup, state, offset(course), noise)
            .map_err(crate::error::Error::from)?;
        let mut episode = Self {
            seed,
            number,
            measured: Measurement::ideal(&state, 0.0),
            controller: match (course.task(), &course.track) {
                (Task::Follow, Some(track)) => Some(track.controller.clone()),
                _ => None,
            },
            falls: FallMonitor::new(course.setup.control),
            foot: (0.0, 0.0),
            resting: SimTime::ZERO,
            step: 0,
            is_over: false,
            course: course.clone(),
            bike,
        };
        if let Some(track) = &course.track {
            let ahead = track.controller.own_point().distance;
            episode.foot = foot(track, &state.pose, ahead, MEASURED_REACH);
        }
        episode.sense();
        Ok(episode)
    }

    /// Begins the first episode of `seed`.
    ///
    /// # Errors
    ///
    /// As [`Episode::new`].
    pub fn reset(&mut self, seed: u64) -> Result<(), EpisodeError> {
        *self = Self::number(&self.course, seed, 0)?;
        Ok(())
    }

    /// Begins the next episode of the same seed.
    ///
    /// # Errors
    ///
    /// As [`Episode::new`].
    pub fn reset_next(&mut self) -> Result<(), EpisodeError> {
        *self = Self::number(&self.course, self.seed, self.number + 1)?;
        Ok(())
    }

    /// The true state.
    #[must_use]
    pub fn state(&self) -> &BikeState {
        &self.bike.state
    }

    /// What the sensors said at the beginning of the coming step.
    #[must_use]
    pub fn measured(&self) -> &Measurement {
        &self.measured
    }

    /// Steps made.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.step
    }

    /// Whether it has ended.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.is_over
    }

    fn sense(&mut self) {
        let t = self.course.time(self.step);
        self.bike.disturbances.advance(t, self.foot.0, |_| {});
        self.measured = self.bike.measure(t);
    }

    /// Writes the observation: [`Task::observations`], each within its bound.
    ///
    /// # Errors
    ///
    /// [`EpisodeError::Length`].
    pub fn observe(&self, out: &mut [f32]) -> Result<(), EpisodeError> {
        let described = self.course.task().observations();
        super::bikes::length("the observation", out.len(), described.len())?;
        let m = &self.measured;
        let mut values = [0.0; 15];
        values[..4].copy_from_slice(&[m.roll, m.balancer, m.roll_rate, m.balancer_rate]);
        if let Some(track) = &self.course.track {
            let curve = track.followed();
            let ahead = track.controller.own_point().distance;
            let point = m.pose.position + m.pose.direction() * ahead;
            let at = curve.project(point, self.foot.0, MEASURED_REACH);
            let here = curve.reference(at.s);
            values[4..].copy_from_slice(&[
                at.lateral,
                angle::wrap(m.pose.heading - here.heading),
                m.speed,
                here.speed,
                m.steer,
                m.steer_rate,
                here.curvature,
                curve.curvature(at.s + PREVIEW[0]),
                curve.curvature(at.s + PREVIEW[1]),
                curve.curvature(at.s + PREVIEW[2]),
                curve.remaining(m.pose.position, at.s),
            ]);
        }
        for ((out, value), (_, bound)) in out.iter_mut().zip(values).zip(described) {
            // A state that is no number is shown as its bound: the episode has ended.
            *out = if value.is_nan() {
                *bound as f32
            } else {
                value.clamp(-bound, *bound) as f32
            };
        }
        Ok(())
    }

    /// One control period under `action`, numbers from −1 to 1 (beyond them they are cut off).
    ///
    /// # Errors
    ///
    /// [`EpisodeError::Over`], [`EpisodeError::Length`], [`EpisodeError::ActionNotFinite`]; the bike has not
    /// moved then.
    pub fn step(&mut self, action: &[f32]) -> Result<Step, EpisodeError> {
        super::bikes::length(
            "the action",
            action.len(),
            self.course.task().actions().len(),
        )?;
        super::bikes::finite(action, action.len())?;
        if self.is_over {
            return Err(EpisodeError::Over { bike: 0 });
        }
        Ok(self.advance(action))
    }

    /// As [`Episode::step`], of an episode under way with an action that is sound.
    pub(super) fn advance(&mut self, action: &[f32]) -> Step {
        let t = self.course.time(self.step);
        let mut shares = [0.0; 3];
        for (share, number) in shares.iter_mut().zip(action) {
            *share = f64::from(number.clamp(-1.0, 1.0));
        }
        let commanded = self.command(t, &shares);
        let course = self.course.clone();
        let ending = match commanded {
            Ok((command, offset)) => {
                let before = self.bike.state;
                self.bike
                    .act(&course.setup, t, &command, offset, |_, _, _, _| {});
                self.step += 1;
                self.judge(&course, &before)
            }
            Err(_) => Ending::ControlFailed,
        };
        let progress = self.move_foot(&course, ending);
        let ending = match ending {
            Ending::None => self.ending_on_track(&course),
            ending => ending,
        };
        let ending = match ending {
            Ending::None if self.course.setup.control.times(self.step) >= course.setup.duration => {
                Ending::Duration
            }
            ending => ending,
        };
        self.is_over = ending != Ending::None;
        if self.bike.state.is_finite() {
            self.sense();
        }
        Step {
            reward: self.reward(&shares, progress),
            ending,
        }
    }

    fn command(&mut self, t: f64, shares: &[f64; 3]) -> Result<(Command, Offset), ControlError> {
        let course = &self.course;
        let bike = &course.setup.bike;
        let [first, second, third] = *shares;
        match (course.task(), &mut self.controller) {
            (Task::Follow, Some(controller)) => {
                let follow = &course.setup.follow;
                let most = if first < 0.0 {
                    follow.drive_deceleration
                } else {
                    follow.drive_acceleration
                };
                let mut agent = |_: &FollowerView<'_>| -> Result<FollowerCommand, Declined> {
                    Ok(FollowerCommand {
                        acceleration: first * most,
                        steer_rate: second * bike.steer_rate_max,
                    })
                };
                let mut external = External {
                    time: t,
                    follower: Some(&mut agent),
                    balancer: None,
                };
                let output = controller.tick_with(&self.measured, &mut external)?;
                Ok((output.command, output.offset))
            }
            (Task::Balance, _) => Ok((
                Command {
                    balancer_torque: first * bike.balancer_torque_max,
                    ..Command::default()
                },
                offset(course),
            )),
            (Task::Follow | Task::Ride, _) => Ok((
                Command {
                    drive_force: first * bike.drive_force_max,
                    steer_rate: second * bike.steer_rate_max,
                    balancer_torque: third * bike.balancer_torque_max,
                },
                offset(course),
            )),
        }
    }

    /// Whether the bike has fallen or met something.
    fn judge(&mut self, course: &Course, before: &BikeState) -> Ending {
        let setup = &course.setup;
        let bike = &self.bike;
        let contact = bike.plant.contact(before, &bike.input);
        let verdict = self
            .falls
            .judge(&bike.state, contact.as_ref(), bike.friction);
        let certain = setup.plant != PlantModel::Rapier3d
            && is_beyond_recovery(bike.plant.params(), &bike.state, &bike.input);
        let given_up = self.falls.give_up(certain);
        if let Some(verdict) = verdict.or(given_up) {
            return Ending::of_fall(verdict.reason);
        }
        let Some(world) = setup.world.as_ref().filter(|_| course.track.is_some()) else {
            return Ending::None;
        };
        let pose = &bike.state.pose;
        let standing = world.footprint_clearance(&setup.footprint, pose);
        let time = course.time(self.step);
        let moving = setup
            .traffic
            .nearest(&setup.footprint, pose, time, standing);
        if moving.is_some_and(|(_, clearance)| clearance < 0.0)
            || bike.plant.touched_moving_obstacle().is_some()
        {
            Ending::MovingObstacle
        } else if standing < 0.0 || bike.plant.has_touched_an_obstacle() {
            Ending::Obstacle
        } else {
            Ending::None
        }
    }

    /// Follows the true foot along the curve; returns the way made on it, m.
    fn move_foot(&mut self, course: &Course, ending: Ending) -> f64 {
        let Some(track) = &course.track else {
            return 0.0;
        };
        if matches!(ending, Ending::NotFinite | Ending::ControlFailed) {
            return 0.0;
        }
        let state = &self.bike.state;
        let way = 2.0 * state.speed.abs() * course.setup.control.seconds();
        let ahead = track.controller.own_point().distance;
        let point = state.pose.position + state.pose.direction() * ahead;
        let at = track.followed().project(point, self.foot.0, REACH + way);
        let progress = at.s - self.foot.0;
        self.foot = (at.s, at.lateral);
        progress
    }

    /// Whether the path has been left or the goal reached.
    fn ending_on_track(&mut self, course: &Course) -> Ending {
        let Some(track) = &course.track else {
            return Ending::None;
        };
        let state = &self.bike.state;
        if self.foot.1.abs() > LEFT {
            return Ending::LeftPath;
        }
        let remaining = track.followed().remaining(state.pose.position, self.foot.0);
        if remaining < -PAST {
            return Ending::PastGoal;
        }
        let end = track.path.end_pose().position;
        let goal = course.setup.goal.map_or(end, |goal| goal.position);
        let arrives =
            at_rest(state) && (state.pose.position - goal).norm() <= course.setup.goal_tolerance;
        self.resting = if arrives {
            self.resting + course.setup.control
        } else {
            SimTime::ZERO
        };
        if self.resting >= SimTime::from_seconds(crate::closed_loop::REST_TIME) {
            Ending::AtGoal
        } else {
            Ending::None
        }
    }

    /// What a step was worth. Balance: `1 − (α/0.7)² − 0.1 (β̇/β̇_max)² − 0.05 a²`; on a path: metres made
    /// along it, less `(e/0.2 m)²` per second beside it.
    fn reward(&self, shares: &[f64; 3], progress: f64) -> f64 {
        let state = &self.bike.state;
        if !state.is_finite() {
            return 0.0;
        }
        if self.course.track.is_none() {
            let roll = state.roll / crate::monitor::FALL_ROLL;
            let spin = state.balancer_rate / self.course.setup.bike.balancer_speed_max;
            1.0 - roll * roll - 0.1 * spin * spin - 0.05 * shares[0] * shares[0]
        } else {
            let beside = self.foot.1 / 0.2;
            progress - beside * beside * self.course.setup.control.seconds()
        }
    }
}

/// The balancer's offset at the start, which a task without mode changes keeps.
fn offset(course: &Course) -> Offset {
    Offset::fixed(course.setup.bike.offset(course.setup.mode))
}

/// Foot and lateral distance of the followed point of a bike at the start of the curve.
fn foot(track: &Track, pose: &Pose2, ahead: f64, reach: f64) -> (f64, f64) {
    let point = pose.position + pose.direction() * ahead;
    let at = track
        .followed()
        .project(point, ahead, 2.0 * ahead.max(reach));
    (at.s, at.lateral)
}
