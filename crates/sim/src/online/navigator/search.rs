//! What a search for a path is: repair or afresh with room to spare, with none, then over poses and steering angles.

use bikebot_geometry::{CurvePath, FergusonCurve};
use bikebot_planner::replan::remainder;
use bikebot_planner::{
    Blockage, Budget, Decision, EndPose, Meter, MotionChecker, PlannerParams, PlanningProblem,
    Previous, ReplanParams, lattice, replan,
};
use bikebot_world::Footprint;

use super::{Motion, Navigator, Route, View, look};
use crate::online::status::{Cause, Halt};
use crate::online::sweep::{Covered, Sweep};

/// At rest a search may take so many times the iterations: nothing is in a hurry then.
pub(super) const PATIENCE: u64 = 2;
/// A last piece shorter than this is left out, m.
const NO_PIECE: f64 = 1e-9;

impl Navigator {
    /// A plan that leaves the route ahead of the bike.
    pub(super) fn search(
        &mut self,
        motion: &Motion,
        view: View,
        is_improvement: bool,
        stands: bool,
    ) -> Result<Route, Halt> {
        self.plans += 1;
        let seed = self
            .seed
            .wrapping_add(self.plans.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        self.belief.world();
        let Some(route) = &self.route else {
            return Err(Halt::NoPath);
        };
        let old = &route.curves;
        let reach = self.s + motion.speed.max(0.0) * self.online.latency + self.online.lead;
        let before = |place: Option<Covered>| {
            place.map_or(f64::INFINITY, |place| place.first - self.online.stop_margin)
        };
        let at = reach
            .min(before(view.solid).min(before(view.unproved)).max(self.s))
            .min(old.length());
        let previous = Previous {
            curves: old,
            now: self.s,
            at,
        };
        let patience = if stands { PATIENCE } else { 1 };
        let budget = Budget::of_iterations(self.online.iterations.saturating_mul(patience));
        let replanning = ReplanParams {
            improve: is_improvement,
            gain: self.online.gain,
            detour: self.online.detour,
        };
        let mut halt = Halt::BlockedAhead;
        for (index, (outline, margin)) in self.rooms.iter().enumerate() {
            let problem = self.problem(outline.clone());
            let params = self.with_margin(*margin);
            // Nonsense was refused by the first plan; what is left is a start curvature a hair beyond the limit.
            let Ok(found) = replan(&problem, &params, &replanning, &previous, seed, &budget) else {
                continue;
            };
            let cause = match found.decision {
                Decision::Repaired => Cause::Repaired,
                Decision::Afresh => Cause::Afresh,
                Decision::Improved => Cause::Improved,
                Decision::Kept => return Err(halt),
                Decision::Blocked { why, .. } => {
                    let why = match why {
                        Blockage::Ahead => Halt::BlockedAhead,
                        Blockage::Goal => Halt::GoalBlocked,
                        Blockage::NoPath(reason) => reason.into(),
                    };
                    halt = why;
                    continue;
                }
            };
            let Some(new) = found.path else {
                continue;
            };
            if is_improvement && new.length() > (1.0 - self.online.gain) * (old.length() - at) {
                return Err(halt);
            }
            let Some(curves) = joined(old, at, &new) else {
                continue;
            };
            let sweep = self.sweep(&curves, self.s);
            if look(&sweep, self.s, &self.belief).solid.is_some() {
                continue;
            }
            return Ok(Route {
                curves,
                sweep,
                joint: at,
                cause: if is_improvement {
                    Cause::Improved
                } else {
                    cause
                },
                iterations: found.iterations,
                is_tight: index > 0,
                ready: motion.time + self.online.latency,
            });
        }
        // A proof for the tighter outline is one for all.
        let is_proved = match halt {
            Halt::GoalBlocked | Halt::Disconnected => true,
            Halt::CurvatureInfeasible => !stands,
            _ => false,
        };
        if is_proved || is_improvement {
            return Err(halt);
        }
        let (outline, margin) = &self.rooms[1];
        let start = previous.start();
        let found = self.search_states(start, outline, *margin, patience);
        // At rest nothing less than the bike itself is in the way.
        let found = found.or_else(|| {
            stands
                .then(|| self.search_states(start, &self.bike, 0.0, patience))
                .flatten()
        });
        let (new, states) = found.ok_or(halt)?;
        let curves = joined(old, at, &new).ok_or(halt)?;
        let sweep = self.sweep(&curves, self.s);
        if look(&sweep, self.s, &self.belief).solid.is_some() {
            return Err(halt);
        }
        Ok(Route {
            curves,
            sweep,
            joint: at,
            cause: Cause::Afresh,
            iterations: states,
            is_tight: true,
            ready: motion.time + self.online.latency,
        })
    }

    /// A rough path by search over poses and steering angles, and the states it took.
    pub(super) fn search_states(
        &self,
        start: EndPose,
        outline: &Footprint,
        margin: f64,
        patience: u64,
    ) -> Option<(CurvePath, u64)> {
        let problem = PlanningProblem {
            start,
            ..self.problem(outline.clone())
        };
        let resolution = self.planner.clearance_resolution();
        let checker = MotionChecker::new(problem.world, outline, margin, resolution);
        let budget = Budget::of_iterations(self.online.states.saturating_mul(patience));
        let found = lattice::search(&problem, &checker, &mut Meter::new(&budget));
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

    pub(super) fn sweep(&self, curves: &CurvePath, from: f64) -> Sweep {
        let allowance = self.online.tracking_allowance;
        Sweep::new(curves, from, &self.bike, allowance, self.belief.cells())
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
