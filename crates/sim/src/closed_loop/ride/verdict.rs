//! How a ride ends: by a fall or a collision, at rest, or when its time is over.

use super::{Facts, Ride};
use crate::clock::SimTime;
use crate::error::Error;
use crate::fall_cause::is_beyond_recovery;
use crate::monitor::Verdict;
use crate::outcome::RunOutcome;
use crate::pilot::PilotOutput;
use crate::record::{Event, NoticeKind, Recorder};
use crate::scenario::PlantModel;
use bikebot_dynamics::BikeState;
use bikebot_planner::EndPose;

/// |roll| (rad) and |roll rate| (rad/s) below which a standing bike counts as recovered.
const RECOVERED: (f64, f64) = (0.5 * std::f64::consts::PI / 180.0, 0.05);
/// How long the bike has to be at rest before the ride ends, s.
pub(crate) const REST_TIME: f64 = 0.5;
/// At rest: not farther than this from where it came to rest, m, nor faster than this, m/s (a noisy encoder
/// makes the drive tremble), upright within this, rad, and turning over at less than this, rad/s. A roll sensor with a bias, or a moment that the balancer cannot hold, is met by a lean of a few degrees.
const REST_DISTANCE: f64 = 0.003;
const REST_SPEED: f64 = 0.02;
const REST_ROLL: f64 = 5.0 * std::f64::consts::PI / 180.0;
const REST_ROLL_RATE: f64 = 0.05;

impl Ride<'_> {
    pub(super) fn judge(
        &mut self,
        time: SimTime,
        state: &BikeState,
        facts: Facts,
        recorder: &mut dyn Recorder,
    ) -> Result<Option<Verdict>, Error> {
        let verdict = self
            .falls
            .judge(state, facts.contact.as_ref(), self.bike.friction);
        let certain = matches!(self.setup.plant, PlantModel::TwoLink | PlantModel::Bike3d)
            && is_beyond_recovery(self.bike.plant.params(), state, &self.bike.input);
        let given_up = self.falls.give_up(certain);
        let verdict = verdict.or(given_up).or_else(|| {
            // The next state has to be finite before anything else looks at it.
            (!self.bike.state.is_finite()).then_some(Verdict {
                outcome: RunOutcome::Fell,
                reason: "not_finite",
            })
        });
        self.fall_cause.watch(state.roll, facts.balancer_at_limit);
        let verdict = verdict.map(|verdict| match verdict.reason {
            "roll" => Verdict {
                reason: self
                    .fall_cause
                    .name(&self.bike.disturbances, time.seconds()),
                ..verdict
            },
            _ => verdict,
        });
        let verdict = verdict.or_else(|| {
            let overlaps = facts.clearance.is_some_and(|clearance| clearance < 0.0);
            (overlaps || self.bike.plant.has_touched_an_obstacle()).then_some(Verdict {
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
                    let first = [state, &self.bike.state].into_iter().find_map(not_finite);
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
    pub(super) fn at_rest(
        &mut self,
        time: SimTime,
        output: &PilotOutput,
        recorder: &mut dyn Recorder,
    ) -> Result<Option<(RunOutcome, &'static str)>, Error> {
        let state = &self.bike.state;
        let at_rest = output.holds
            && at_rest(state)
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
        let error = (self.bike.state.pose.position - goal.0.position).norm();
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
    pub(super) fn target(&self) -> Option<(EndPose, f64)> {
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

    pub(super) fn at_the_end_of_time(&self) -> (RunOutcome, &'static str) {
        if self.setup.plant != PlantModel::TwoLink {
            return (RunOutcome::TimedOut, "duration");
        }
        let (roll, rate) = RECOVERED;
        if self.bike.state.roll.abs() < roll && self.bike.state.roll_rate.abs() < rate {
            (RunOutcome::Arrived, "recovered")
        } else {
            (RunOutcome::TimedOut, "not_recovered")
        }
    }
}

/// Whether the bike stands still and upright.
pub(crate) fn at_rest(state: &BikeState) -> bool {
    state.speed.abs() < REST_SPEED
        && state.roll.abs() < REST_ROLL
        && state.roll_rate.abs() < REST_ROLL_RATE
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

fn fall_in_words(reason: &str) -> &'static str {
    match reason {
        "balancer_stuck" => "the bike fell: its balancer was stuck",
        "steering_stuck" => "the bike fell: its steering was stuck",
        "sensor_fault" => "the bike fell: a sensor was faulty",
        "balancer_saturated" => "the bike fell: its balancer was at its limits",
        _ => "the bike fell",
    }
}
