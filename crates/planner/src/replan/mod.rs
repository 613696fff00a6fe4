//! Replanning while riding: the world has changed, the path may not jump (planning note, 5).
//!
//! | step | when | cost on the yard |
//! |---|---|---|
//! | [`Validity`] of what is left of the old path | always; free → keep it | microseconds |
//! | something clearly better | only if asked for | a plan |
//! | local repair: round what is blocked, then [`refine`] all that is left | blocked | a few milliseconds |
//! | afresh, by [`full`](crate::Method::Full) | nothing repaired, or by a long detour | a plan |
//! | none of these | – | stop where the old path is still free |
//!
//! The new path begins on the old one, at the place where the robot will be when it takes it over, with the old position, heading
//! *and curvature*: a steering angle cannot jump. So what was ridden and what will be ridden are one curve of continuous
//! curvature. An old path is kept unless it is blocked or something clearly cheaper is found: of two nearly equal ways round an
//! obstacle a robot must choose one and stay with it.
//!
//! The new world is best made by [`World::with_changes`](bikebot_world::World::with_changes), which keeps what is known of the
//! places that the changes cannot reach.

mod near_and_far;
mod repair;
#[cfg(test)]
mod tests;
mod validity;

pub use self::validity::Validity;

use crate::budget::{Budget, CutShort, Meter};
use crate::error::PlanError;
use crate::full::Step;
use crate::metrics::PathMetrics;
use crate::motion::MotionChecker;
use crate::params::{GoalMode, Method, PlannerParams};
use crate::pipeline::{self, plan_metered};
use crate::problem::{EndPose, PlanningProblem};
use crate::refine;
use crate::report::{PlannedPath, Reason, Stage, TraceEntry};
use bikebot_geometry::{CurvePath, FergusonCurve, Vector2, angle};
use serde::{Deserialize, Serialize};

/// An old path leads to the goal if it ends as near as this, m, and with a heading as near as this, rad.
const SAME_PLACE: f64 = 1e-6;
/// A first piece shorter than this, m, is left out: the next one begins where it would.
const NO_PIECE: f64 = 1e-9;

/// How unwilling to leave a path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ReplanParams {
    /// Whether to look for a better path also where the old one is free. It takes as long as a plan.
    pub improve: bool,
    /// By which part of its cost a new path must be cheaper than a free old one to be taken. 5 %: less is not worth the
    /// change of mind.
    #[serde(rename = "gain")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gain: f64,
    /// By which part a repaired way may be longer than what was left of the old path. Beyond it a fresh plan is asked for as
    /// well, and taken if it is cheaper by this part. 5 %: a short way round is not worth a search of the whole map.
    #[serde(rename = "detour")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub detour: f64,
    /// How far ahead a new path is made with care, m; beyond it the first curve that is certified will do, for it is planned again before
    /// it is ridden. None: all the way.
    #[serde(rename = "horizon_m")]
    #[schemars(range(min = 1.0, max = 1e6))]
    pub horizon: Option<f64>,
    /// Whether to make what is left of a free path anew along the same way, with care as far as the horizon. So a robot comes never to what
    /// was only sketched.
    pub renew: bool,
    /// Whether to search with all that the method `full` has where a way round what blocks the path, and a way over the grid, are none. Only such
    /// a search proves that there is no way.
    pub thorough: bool,
}

impl Default for ReplanParams {
    fn default() -> Self {
        Self {
            improve: false,
            gain: 0.05,
            detour: 0.05,
            horizon: None,
            renew: false,
            thorough: true,
        }
    }
}

/// The path being ridden.
#[derive(Debug, Clone, Copy)]
pub struct Previous<'p> {
    /// Of continuous curvature, to the goal.
    pub curves: &'p CurvePath,
    /// Arc length of the robot now, m.
    pub now: f64,
    /// Arc length at which it can take over a new path, m: where it will be at t + latency. At least `now`.
    pub at: f64,
}

impl Previous<'_> {
    /// Where a new path begins.
    #[must_use]
    pub fn start(&self) -> EndPose {
        let place = self.curves.at(self.at);
        EndPose {
            position: place.position,
            heading: Some(place.heading),
            curvature: Some(place.curvature),
        }
    }

    fn check(&self) -> Result<(), PlanError> {
        for (name, value, least) in [("now_m", self.now, 0.0), ("at_m", self.at, self.now)] {
            let is_on_path = value >= least && value <= self.curves.length();
            if !is_on_path {
                return Err(PlanError::InvalidParameter {
                    name,
                    value,
                    expected: "an arc length on the path, and at_m not before now_m",
                });
            }
        }
        Ok(())
    }
}

/// What keeps the robot from going on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Blockage {
    /// The old path is blocked before a new one could be taken over, or there it leaves less than the margin.
    Ahead,
    /// The goal is in an obstacle.
    Goal,
    /// No way was found; whether there is none, or the budget ended, says the reason.
    NoPath(Reason),
}

/// What to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Decision {
    /// Ride on along the old path.
    Kept,
    /// Take the new path, which leaves the old one only near what blocks it.
    Repaired,
    /// Take the new path, planned from nothing because the old one is blocked or leads to another goal.
    Afresh,
    /// Take the new path: the old one is free, this one is clearly cheaper.
    Improved,
    /// Stop.
    Blocked {
        /// Arc length on the old path before which to stop, m: so far it is proved free.
        free_until: f64,
        /// Why.
        why: Blockage,
    },
}

/// The answer to one [`replan`].
#[derive(Debug, Clone)]
pub struct Replan {
    /// What to do.
    pub decision: Decision,
    /// The new path, from `at` on; `None` if the old one is kept or nothing was found.
    pub path: Option<CurvePath>,
    /// Figures of the new path.
    pub metrics: Option<PathMetrics>,
    /// How far the new path was made with care, m of its own arc length; `None`: all the way.
    pub careful_until: Option<f64>,
    /// w_p (L + w_J J) of the new path.
    pub cost: Option<f64>,
    /// How far ahead the old path is free.
    pub validity: Validity,
    /// Iterations of all stages together. With this as the budget the same replan comes out bit for bit.
    pub iterations: u64,
    /// What ended the search before it was done, if anything.
    pub cut_short: Option<CutShort>,
    /// How it went.
    pub trace: Vec<TraceEntry>,
}

/// Looks at what is left of the `previous` path in `problem.world`, and plans anew from `previous.at` on where that is needed.
///
/// `problem.start` is not read: the start is [`Previous::start`]. New paths are planned with the method `full`, whatever the parameters
/// name. Equal input, seed and iteration budget give an equal answer, bit for bit.
///
/// # Errors
///
/// Only for input that makes no sense. An obstacle on the robot or on the goal is an ordinary
/// result: see [`Blockage`].
pub fn replan(
    problem: &PlanningProblem<'_>,
    params: &PlannerParams,
    replanning: &ReplanParams,
    previous: &Previous<'_>,
    seed: u64,
    budget: &Budget<'_>,
) -> Result<Replan, PlanError> {
    previous.check()?;
    params.check()?;
    let problem = PlanningProblem {
        start: previous.start(),
        ..problem.clone()
    };
    let ends = match problem.check(params.margin) {
        Err(PlanError::StartInObstacle { .. }) => Err(Blockage::Ahead),
        Err(PlanError::GoalInObstacle { .. }) => Err(Blockage::Goal),
        other => Ok(other?),
    };
    let resolution = match ends {
        Ok(()) => pipeline::resolution(&problem, params),
        Err(_) => params.clearance_resolution(),
    };
    let checker = MotionChecker::new(problem.world, &problem.footprint, params.margin, resolution);
    let case = Case {
        params: PlannerParams {
            method: Method::Full,
            ..params.clone()
        },
        replanning,
        previous,
        seed,
        validity: Validity::of(previous.curves, previous.now, &checker),
        discs: checker.inscribed(),
        checker,
        problem,
    };
    case.decide(ends, Meter::new(budget))
}

/// Everything that does not change.
struct Case<'r, 'w> {
    problem: PlanningProblem<'w>,
    params: PlannerParams,
    replanning: &'r ReplanParams,
    previous: &'r Previous<'r>,
    seed: u64,
    validity: Validity,
    /// For the whole footprint.
    checker: MotionChecker<'w>,
    /// For its inscribed disc.
    discs: MotionChecker<'w>,
}

impl Case<'_, '_> {
    fn decide(&self, ends: Result<(), Blockage>, meter: Meter<'_>) -> Result<Replan, PlanError> {
        let leads_there = self.leads_to_the_goal();
        if self.validity.is_free() && leads_there {
            return self.improve(ends, meter);
        }
        if let Err(why) = ends {
            return Ok(self.blocked(why, &meter, Vec::new()));
        }
        if self.validity.free_until < self.previous.at {
            return Ok(self.blocked(Blockage::Ahead, &meter, Vec::new()));
        }
        self.plan(leads_there, meter)
    }

    /// The old path is free. What is better must be so clearly.
    fn improve(
        &self,
        ends: Result<(), Blockage>,
        mut meter: Meter<'_>,
    ) -> Result<Replan, PlanError> {
        let left = self.previous.curves.length() - self.previous.at;
        if let (true, Some(horizon), Ok(())) =
            (self.replanning.renew, self.replanning.horizon, ends)
        {
            let guide = (left > NO_PIECE)
                .then(|| repair::same_way(self.previous, &self.discs, &mut meter))
                .flatten();
            let renewed = guide.and_then(|guide| self.near_and_far(&guide, horizon, &mut meter));
            let decision = match renewed {
                Some(_) => Decision::Improved,
                None => Decision::Kept,
            };
            return Ok(self.answer(decision, renewed, &meter, Vec::new()));
        }
        if !self.replanning.improve || ends.is_err() || left <= NO_PIECE {
            return Ok(self.answer(Decision::Kept, None, &meter, Vec::new()));
        }
        let least = (1.0 - self.replanning.gain) * self.old_cost();
        let straight = match self.params.goal {
            GoalMode::Pose => self.problem.goal.position - self.problem.start.position,
            GoalMode::Ball => Vector2::zeros(),
        };
        if self.weight() * straight.norm() >= least {
            // Not even the straight line would do.
            return Ok(self.answer(Decision::Kept, None, &meter, Vec::new()));
        }
        let fresh = self.afresh(meter, Vec::new())?;
        let is_better = fresh.cost.is_some_and(|cost| cost < least);
        Ok(if is_better {
            Replan {
                decision: Decision::Improved,
                ..fresh
            }
        } else {
            Replan {
                decision: Decision::Kept,
                path: None,
                metrics: None,
                cost: None,
                ..fresh
            }
        })
    }

    /// The old path does not lead to the goal any more.
    fn plan(&self, leads_there: bool, mut meter: Meter<'_>) -> Result<Replan, PlanError> {
        let mut trace = Vec::new();
        let mut repaired = None;
        if leads_there && self.params.goal == GoalMode::Pose {
            repaired = self.repair(&mut meter, &mut trace);
        }
        let left = self.previous.curves.length() - self.previous.at;
        match repaired {
            Some((path, careful, taut))
                if taut <= (1.0 + self.replanning.detour) * left || meter.cut_short().is_some() =>
            {
                Ok(self.answer(Decision::Repaired, Some((path, careful)), &meter, trace))
            }
            Some((path, careful, _)) => {
                // A long detour: by chance, or because there is no shorter one.
                let path = Some((path, careful));
                let repaired = self.answer(Decision::Repaired, path, &meter, trace.clone());
                let fresh = self.afresh(meter, trace)?;
                let enough = (1.0 - self.replanning.detour) * repaired.cost.unwrap_or(0.0);
                Ok(if fresh.cost.is_some_and(|cost| cost < enough) {
                    fresh
                } else {
                    Replan {
                        iterations: fresh.iterations,
                        cut_short: fresh.cut_short,
                        trace: fresh.trace,
                        ..repaired
                    }
                })
            }
            None => self.afresh(meter, trace),
        }
    }

    /// A path around what blocks the old one, how far it was made with care, m, if not all the way, and the length (m) of the taut
    /// polyline it follows.
    fn repair(
        &self,
        meter: &mut Meter<'_>,
        trace: &mut Vec<TraceEntry>,
    ) -> Option<(CurvePath, Option<f64>, f64)> {
        let guide = repair::way_round(
            self.previous.curves,
            self.previous.at,
            &self.validity,
            &self.params,
            &self.discs,
            self.seed,
            meter,
        )?;
        let length = guide.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
        trace.push(TraceEntry {
            iteration: meter.iterations(),
            stage: Stage::Taut,
            length,
            cost: self.params.length_weight * length,
            certified: false,
        });
        let (path, careful) = match self.replanning.horizon {
            Some(horizon) => self.near_and_far(&guide, horizon, meter)?,
            None => {
                let full = self.full(&self.problem, &self.params);
                let best = full.curve_along(&guide, meter, &mut |step: &Step<'_>| {
                    trace.push(TraceEntry {
                        iteration: step.iteration,
                        stage: step.stage,
                        length: step.length,
                        cost: step.cost,
                        certified: step.curves.is_some(),
                    });
                });
                (CurvePath::new(best?.curves).ok()?, None)
            }
        };
        Some((path, careful, length))
    }

    fn afresh(
        &self,
        mut meter: Meter<'_>,
        mut trace: Vec<TraceEntry>,
    ) -> Result<Replan, PlanError> {
        if let Some(horizon) = self.replanning.horizon {
            let guide = self.guide_afresh(&mut meter);
            let found = guide
                .as_ref()
                .and_then(|guide| self.near_and_far(guide, horizon, &mut meter));
            if found.is_some() {
                return Ok(self.answer(Decision::Afresh, found, &meter, trace));
            }
            if !self.replanning.thorough {
                let reason = match guide {
                    Some(_) => Reason::NoCurve,
                    None => Reason::Iterations,
                };
                return Ok(self.blocked(Blockage::NoPath(reason), &meter, trace));
            }
        }
        let report = plan_metered(
            &self.problem,
            &self.params,
            self.seed,
            meter,
            &mut |_, _| {},
        )?;
        trace.extend(report.trace);
        let path = match report.path {
            Some(PlannedPath::Curves(path)) => Some(path),
            _ => None,
        };
        let decision = match path {
            Some(_) => Decision::Afresh,
            None => Decision::Blocked {
                free_until: self.validity.free_until,
                why: Blockage::NoPath(report.reason),
            },
        };
        Ok(Replan {
            decision,
            metrics: report.metrics.filter(|_| path.is_some()),
            careful_until: None,
            cost: path.as_ref().map(|path| self.cost(path.segments())),
            path,
            validity: self.validity,
            iterations: report.iterations,
            cut_short: report.cut_short,
            trace,
        })
    }

    fn blocked(&self, why: Blockage, meter: &Meter<'_>, trace: Vec<TraceEntry>) -> Replan {
        let decision = Decision::Blocked {
            free_until: self.validity.free_until,
            why,
        };
        self.answer(decision, None, meter, trace)
    }

    fn answer(
        &self,
        decision: Decision,
        path: Option<(CurvePath, Option<f64>)>,
        meter: &Meter<'_>,
        trace: Vec<TraceEntry>,
    ) -> Replan {
        let (path, careful_until) = match path {
            Some((path, careful)) => (Some(path), careful),
            None => (None, None),
        };
        let cost = path.as_ref().map(|path| self.cost(path.segments()));
        let path = path.map(PlannedPath::Curves);
        let metrics = path.as_ref().map(|path| {
            let goal = self.problem.goal.position;
            let straight = (goal - self.problem.start.position).norm();
            let tolerance =
                pipeline::clearance_tolerance(&self.params, meter.cut_short().is_some());
            let mut metrics = PathMetrics::of(path, &self.checker, goal, Some(straight), tolerance);
            metrics.min_clearance = metrics.min_clearance.max(self.params.margin);
            metrics
        });
        Replan {
            decision,
            path: path.and_then(|path| path.curves().cloned()),
            metrics,
            careful_until,
            cost,
            validity: self.validity,
            iterations: meter.iterations(),
            cut_short: meter.cut_short(),
            trace,
        }
    }

    /// Whether the old path ends where this problem's goal is.
    fn leads_to_the_goal(&self) -> bool {
        let (end, goal) = (self.previous.curves.end_pose(), &self.problem.goal);
        match self.params.goal {
            GoalMode::Ball => (end.position - goal.position).norm() <= goal.tolerance + SAME_PLACE,
            GoalMode::Pose => {
                (end.position - goal.position).norm() <= SAME_PLACE
                    && goal.heading.is_none_or(|heading| {
                        angle::difference(end.heading, heading).abs() <= SAME_PLACE
                    })
            }
        }
    }

    /// What is left of the old path from `at` on.
    fn old_cost(&self) -> f64 {
        self.cost(&remainder(self.previous.curves, self.previous.at))
    }

    /// w_p (L + w_J J); w_p counts as 1 where it is 0.
    fn cost(&self, curves: &[FergusonCurve]) -> f64 {
        let jerk_weight = refine::jerk_weight(self.params.corner_length());
        let value = curves.iter().map(|curve| {
            let (length, bending) = curve.length_and_bending_fine();
            length + jerk_weight * bending
        });
        self.weight() * value.sum::<f64>()
    }

    fn weight(&self) -> f64 {
        if self.params.length_weight > 0.0 {
            self.params.length_weight
        } else {
            1.0
        }
    }
}

/// The curves of `path` from arc length `at` (m) on; empty at its end.
#[must_use]
pub fn remainder(path: &CurvePath, at: f64) -> Vec<FergusonCurve> {
    let (first, t) = path.locate(at);
    let mut curves = path.segments()[first..].to_vec();
    if path.segment_start(first + 1) - at <= NO_PIECE {
        curves.remove(0);
    } else if t > 0.0 {
        curves[0] = curves[0].sub_curve(t, 1.0);
    }
    curves
}
