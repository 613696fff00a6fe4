//! What a search for a path is: repair or afresh with room to spare, with none, then over poses and steering angles.

use bikebot_geometry::{CurvePath, FergusonCurve};
use bikebot_planner::lattice::{self, Grain};
use bikebot_planner::replan::remainder;
use bikebot_planner::{
    Blockage, Budget, Decision, EndPose, Meter, MotionChecker, PlannerParams, PlanningProblem,
    Previous, ReplanParams, replan,
};
use bikebot_world::Footprint;

use super::{Motion, Navigator, Route, View, look};
use crate::online::status::{Cause, Halt, Searched};
use crate::online::sweep::{Covered, SHORT_STEP, STEP, Sweep};

/// At rest a search may take so many times the iterations: nothing is in a hurry then.
pub(super) const PATIENCE: u64 = 4;
/// Whatever the latency says, a new path begins so far ahead, m: the bike may ride a little faster than it thinks.
const HEADWAY: f64 = 0.05;
/// A last piece shorter than this is left out, m.
const NO_PIECE: f64 = 1e-9;

/// Rounds of quadratic programmes for one curve while riding: what needs more seldom succeeds with more.
const QUICK_ROUNDS: u32 = 12;

/// What a search is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Aim {
    /// The route is blocked.
    AnyWay,
    /// The route is free; something clearly cheaper.
    Better,
    /// The route is free; the same way with care as far as the horizon.
    Renewal,
}

/// How much room a path leaves to both sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fit {
    /// What it should.
    Roomy,
    /// What the bike and the proof of free space need.
    Tight,
    /// The same with a proof in shorter steps.
    Narrow,
}

/// What is looked for.
struct Query<'q> {
    previous: Previous<'q>,
    aim: Aim,
    stands: bool,
    /// The first place where a new path can begin, m: where the bike is when it is done.
    near: f64,
    /// Times the iterations that a search may take while riding.
    patience: u64,
    /// When the answer may be taken over, s.
    ready: f64,
}

/// Nothing was found.
struct InVain {
    halt: Halt,
    /// Nothing else needs to be tried.
    is_settled: bool,
}

impl Navigator {
    /// A plan that leaves the route ahead of the bike.
    pub(super) fn search(
        &mut self,
        motion: &Motion,
        view: View,
        aim: Aim,
        stands: bool,
    ) -> Result<Route, Halt> {
        self.plans += 1;
        self.belief.world();
        let Some(route) = &self.route else {
            return Err(Halt::NoPath);
        };
        let old = &route.curves;
        let near = self.s + motion.speed.max(0.0) * self.online.latency + HEADWAY;
        let reach = near + self.online.lead;
        let before = |place: Option<Covered>| {
            place.map_or(f64::INFINITY, |place| place.first - self.online.stop_margin)
        };
        let at = reach
            .min(before(view.solid).min(before(view.unproved)).max(self.s))
            .min(old.length());
        let query = Query {
            previous: Previous {
                curves: old,
                now: self.s,
                at,
            },
            aim,
            stands,
            near,
            patience: if stands { PATIENCE } else { 1 },
            ready: motion.time + self.online.latency,
        };
        let mut over_poses = false;
        let mut is_thorough = aim == Aim::Better;
        let found = if aim == Aim::AnyWay {
            self.along_guides(&query, false).or_else(|vain| {
                if vain.is_settled {
                    return Err(vain.halt);
                }
                over_poses = true;
                if let Some(route) = self.over_poses(&query) {
                    return Ok(route);
                }
                // While the bike rides, the next place is a better help than a longer search.
                if !stands {
                    return Err(vain.halt);
                }
                is_thorough = true;
                self.along_guides(&query, true).map_err(|vain| vain.halt)
            })
        } else {
            let found = self.along_guides(&query, is_thorough);
            found.map_err(|vain| vain.halt)
        };
        self.searched = Some(Searched {
            at,
            at_rest: stands,
            is_improvement: aim != Aim::AnyWay,
            found: found.as_ref().ok().map(|route| route.cause),
            over_poses,
            is_thorough,
        });
        found
    }

    /// By [`replan`]: round what blocks the path, or from nothing; with room to spare, or with none.
    fn along_guides(&self, query: &Query<'_>, thorough: bool) -> Result<Route, InVain> {
        let Query { previous, aim, .. } = *query;
        let is_improvement = aim != Aim::AnyWay;
        let seed = self
            .seed
            .wrapping_add(self.plans.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let budget = Budget::of_iterations(self.online.iterations.saturating_mul(query.patience));
        let replanning = ReplanParams {
            improve: aim == Aim::Better,
            renew: aim == Aim::Renewal,
            gain: self.online.gain,
            detour: self.online.detour,
            horizon: (aim != Aim::Better).then_some(self.online.horizon),
            thorough,
        };
        let settled = |halt| InVain {
            halt,
            is_settled: true,
        };
        let mut halt = Halt::BlockedAhead;
        for (fit, (outline, margin)) in [Fit::Roomy, Fit::Tight].into_iter().zip(&self.rooms) {
            let problem = self.problem(outline.clone());
            let mut params = self.with_margin(*margin);
            if !thorough {
                params.refine_rounds = params.refine_rounds.min(QUICK_ROUNDS);
            }
            // Nonsense was refused by the first plan; what is left is a start curvature a hair beyond the limit.
            let Ok(found) = replan(&problem, &params, &replanning, &previous, seed, &budget) else {
                continue;
            };
            let cause = match found.decision {
                _ if is_improvement && found.path.is_some() => Cause::Improved,
                Decision::Repaired => Cause::Repaired,
                Decision::Afresh => Cause::Afresh,
                Decision::Improved => Cause::Improved,
                Decision::Kept => return Err(settled(halt)),
                Decision::Blocked { why, .. } => {
                    halt = match why {
                        Blockage::Ahead => Halt::BlockedAhead,
                        Blockage::Goal => Halt::GoalBlocked,
                        Blockage::NoPath(reason) => reason.into(),
                    };
                    continue;
                }
            };
            let Some(new) = found.path else {
                continue;
            };
            let left = previous.curves.length() - previous.at;
            if aim == Aim::Better && new.length() > (1.0 - self.online.gain) * left {
                return Err(settled(halt));
            }
            if let Some(route) = self.route_by(query, previous, &new, cause, found.iterations, fit)
            {
                let careful = found.careful_until.map(|careful| previous.at + careful);
                return Ok(Route {
                    careful_until: careful.unwrap_or(f64::INFINITY),
                    ..route
                });
            }
        }
        // A proof for the tighter outline is one for all.
        let is_proved = matches!(halt, Halt::GoalBlocked | Halt::Disconnected);
        Err(InVain {
            halt,
            is_settled: is_proved || is_improvement,
        })
    }

    /// By search over poses and steering angles, through the narrowest of gaps: quickly; then, riding, from a place just ahead of the bike, where
    /// there are turns that there are not farther on; then in smaller steps; then, at rest, with nothing more than the bike itself in the way.
    fn over_poses(&self, query: &Query<'_>) -> Option<Route> {
        let nearer = Previous {
            at: query.near.min(query.previous.at),
            ..query.previous
        };
        let narrow = &self.narrow;
        let mut tries = vec![(query.previous, Grain::COARSE, narrow)];
        if nearer.at < query.previous.at - NO_PIECE {
            tries.push((nearer, Grain::COARSE, narrow));
        }
        tries.push((query.previous, Grain::FINE, narrow));
        if query.stands {
            tries.push((query.previous, Grain::COARSE, &self.bike));
        }
        tries.into_iter().find_map(|(previous, grain, outline)| {
            let (new, states) =
                self.search_states(previous.start(), outline, grain, query.patience)?;
            self.route_by(query, previous, &new, Cause::Afresh, states, Fit::Narrow)
        })
    }

    /// The old path as far as `previous` says, then `new`; `None` if something is on it.
    fn route_by(
        &self,
        query: &Query<'_>,
        previous: Previous<'_>,
        new: &CurvePath,
        cause: Cause,
        iterations: u64,
        fit: Fit,
    ) -> Option<Route> {
        let curves = joined(previous.curves, previous.at, new)?;
        let sweep = self.sweep(&curves, self.s, fit);
        look(&sweep, self.s, &self.belief)
            .solid
            .is_none()
            .then_some(Route {
                curves,
                sweep,
                joint: previous.at,
                cause,
                iterations,
                is_tight: fit != Fit::Roomy,
                careful_until: f64::INFINITY,
                ready: query.ready,
            })
    }

    /// A rough path by search over poses and steering angles, and the states it took.
    pub(super) fn search_states(
        &self,
        start: EndPose,
        outline: &Footprint,
        grain: Grain,
        patience: u64,
    ) -> Option<(CurvePath, u64)> {
        let problem = PlanningProblem {
            start,
            ..self.problem(outline.clone())
        };
        let resolution = self.planner.clearance_resolution();
        let checker = MotionChecker::new(problem.world, outline, 0.0, resolution);
        let budget = Budget::of_iterations(self.online.states.saturating_mul(patience));
        let found = lattice::search(&problem, &checker, grain, &mut Meter::new(&budget));
        Some((found.path?, found.expansions))
    }

    pub(super) fn problem(&self, outline: Footprint) -> PlanningProblem<'_> {
        PlanningProblem {
            world: self.belief.world_as_it_was(),
            footprint: outline,
            start: self.start,
            goal: self.goal,
            max_curvature: self.planner.max_curvature,
        }
    }

    pub(super) fn with_margin(&self, margin: f64) -> PlannerParams {
        PlannerParams {
            margin,
            ..self.planner.clone()
        }
    }

    pub(super) fn sweep(&self, curves: &CurvePath, from: f64, fit: Fit) -> Sweep {
        let allowance = self.online.tracking_allowance;
        let step = match fit {
            Fit::Roomy | Fit::Tight => STEP,
            Fit::Narrow => SHORT_STEP,
        };
        Sweep::new(
            curves,
            from,
            &self.bike,
            allowance,
            self.belief.cells(),
            step,
        )
    }
}

/// `old` up to arc length `at` (m), then `new`, which begins there.
fn joined(old: &CurvePath, at: f64, new: &CurvePath) -> Option<CurvePath> {
    let mut curves = head(old, at);
    curves.extend_from_slice(new.segments());
    CurvePath::new(curves).ok()
}

fn head(path: &CurvePath, at: f64) -> Vec<FergusonCurve> {
    let (last, t) = path.locate(at);
    let mut curves = path.segments()[..last].to_vec();
    if at - path.segment_start(last) > NO_PIECE && t > 0.0 {
        curves.push(if remainder(path, at).is_empty() {
            path.segments()[last]
        } else {
            path.segments()[last].sub_curve(0.0, t)
        });
    }
    curves
}
