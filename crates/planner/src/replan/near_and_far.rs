//! A path in two parts: with care as far as the horizon, and beyond it the first curve that is certified.
//!
//! What lies far ahead of a robot that is still finding out what stands there is planned again before it is ridden. Care costs by the
//! metre, so that it is spent where it pays. Both parts are one curve: the second begins with the place, heading and curvature in which the first
//! ends, and what either keeps of clearance and curvature the other does too.

use super::Case;
use crate::budget::Meter;
use crate::full::Full;
use crate::guide;
use crate::params::{GoalMode, PlannerParams};
use crate::problem::{EndPose, GoalRegion, PlanningProblem};
use crate::taut::{self, Rivals};
use bikebot_geometry::{CurvePath, Point2, Vector2};

/// The horizon lies where the guide is straight: between it and so many times as far.
const ROOM: f64 = 1.5;
/// Less than this part of the horizon left beyond it is worth no second part.
const LEAST_REST: f64 = 0.3;
/// The guide is looked for on every so many cells along x and y.
const PITCHES: [usize; 2] = [4, 2];

/// Where a guide is cut in two.
struct Cut {
    /// The vertex before it.
    after: usize,
    place: Point2,
    /// Of the leg it lies on, rad.
    heading: f64,
}

impl Case<'_, '_> {
    /// A taut polyline from the start to the goal, by search on the grid; `None` proves nothing.
    pub(super) fn guide_afresh(&self, meter: &mut Meter<'_>) -> Option<Vec<Point2>> {
        let [start, goal] = [self.problem.start.position, self.problem.goal.position];
        let coarse = PITCHES
            .into_iter()
            .find_map(|pitch| guide::search(&self.discs, start, goal, pitch, meter))?;
        (coarse.len() > 1).then(|| taut::pull(&coarse, &Rivals::none(), &self.discs, meter).path)
    }

    /// A certified path along `guide`, in two parts where it is long enough, and how far it was made with care, m, if not all the way.
    pub(super) fn near_and_far(
        &self,
        guide: &[Point2],
        horizon: f64,
        meter: &mut Meter<'_>,
    ) -> Option<(CurvePath, Option<f64>)> {
        if let Some(cut) = cut(guide, horizon) {
            return self.in_two_parts(guide, &cut, meter);
        }
        let full = self.full(&self.problem, &self.params);
        let refined = full.sketch_along(guide, meter)?;
        Some((CurvePath::new(refined.curves).ok()?, None))
    }

    fn in_two_parts(
        &self,
        guide: &[Point2],
        cut: &Cut,
        meter: &mut Meter<'_>,
    ) -> Option<(CurvePath, Option<f64>)> {
        let near = PlanningProblem {
            goal: GoalRegion {
                position: cut.place,
                heading: Some(cut.heading),
                ..self.problem.goal
            },
            ..self.problem.clone()
        };
        let to_a_pose = PlannerParams {
            goal: GoalMode::Pose,
            ..self.params.clone()
        };
        let mut vertices = guide[..=cut.after].to_vec();
        vertices.push(cut.place);
        let mut curves = self
            .full(&near, &to_a_pose)
            .sketch_along(&vertices, meter)?
            .curves;
        let careful = CurvePath::new(curves.clone()).ok()?;
        let end = careful.at(careful.length());
        let far = PlanningProblem {
            start: EndPose {
                position: end.position,
                heading: Some(end.heading),
                curvature: Some(end.curvature),
            },
            ..self.problem.clone()
        };
        let mut vertices = vec![end.position];
        vertices.extend_from_slice(&guide[cut.after + 1..]);
        let far =
            meter.content(|meter| self.full(&far, &self.params).sketch_along(&vertices, meter))?;
        curves.extend(far.curves);
        Some((CurvePath::new(curves).ok()?, Some(careful.length())))
    }

    pub(super) fn full<'f>(
        &'f self,
        problem: &'f PlanningProblem<'f>,
        params: &'f PlannerParams,
    ) -> Full<'f, 'f> {
        Full {
            problem,
            params,
            seed: self.seed,
            checker: &self.checker,
            discs: &self.discs,
        }
    }
}

/// Where to cut: on the straightest piece beyond the horizon, as far as can be from the guide's vertices; `None` if too little is left behind it.
fn cut(guide: &[Point2], horizon: f64) -> Option<Cut> {
    let length: f64 = guide.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
    if length < (ROOM + LEAST_REST) * horizon {
        return None;
    }
    let mut start = 0.0;
    let mut best: Option<(f64, Cut)> = None;
    for (after, leg) in guide.windows(2).enumerate() {
        let along: Vector2 = leg[1] - leg[0];
        let way = along.norm();
        let (from, to) = (start, start + way);
        start = to;
        if to < horizon || way <= 0.0 {
            continue;
        }
        if from > ROOM * horizon {
            break;
        }
        let at = (0.5 * (from + to))
            .clamp(horizon, ROOM * horizon)
            .clamp(from, to);
        let room = (at - from).min(to - at);
        if best.as_ref().is_none_or(|best| room > best.0) {
            let place = leg[0] + along * ((at - from) / way);
            let heading = along.y.atan2(along.x);
            best = Some((
                room,
                Cut {
                    after,
                    place,
                    heading,
                },
            ));
        }
    }
    let (room, cut) = best?;
    (room > 0.0).then_some(cut)
}
