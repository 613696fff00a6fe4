//! Before the ride: the ground that the scenario vouches for, and the first plan.

use bikebot_geometry::{CurvePath, FergusonCurve, Vector2};
use bikebot_planner::lattice::Grain;
use bikebot_planner::{Budget, Outcome, PlanError, PlanReport, PlannedPath, plan};
use bikebot_world::Cell;

use super::search::{Fit, PATIENCE};
use super::{Navigator, Route, Task};
use crate::online::belief::Belief;
use crate::online::status::{Cause, Halt};
use crate::online::sweep::{STEP, Sweep};

impl Navigator {
    /// The first plan, with the bike at rest at the start: the report, where there was something to search for, and why there is no
    /// path, if there is none.
    ///
    /// # Errors
    ///
    /// If the problem makes no sense, as a goal off the map.
    pub fn begin(&mut self) -> Result<(Option<PlanReport>, Option<Halt>), PlanError> {
        self.belief.world();
        let budget = Budget::of_iterations(self.online.iterations.saturating_mul(PATIENCE));
        let (mut last, mut halt) = (None, None);
        for (fit, (outline, margin)) in [Fit::Roomy, Fit::Tight].into_iter().zip(self.rooms.clone())
        {
            let problem = self.problem(outline);
            let report = match plan(&problem, &self.with_margin(margin), self.seed, &budget) {
                Ok(report) => report,
                Err(PlanError::StartInObstacle { .. }) => {
                    halt = halt.or(Some(Halt::BlockedAhead));
                    continue;
                }
                Err(PlanError::GoalInObstacle { .. }) => {
                    halt = halt.or(Some(Halt::GoalBlocked));
                    continue;
                }
                Err(error) => return Err(error),
            };
            if let (Outcome::Found, Some(PlannedPath::Curves(curves))) =
                (report.outcome, &report.path)
            {
                self.route = Some(Route {
                    curves: curves.clone(),
                    sweep: self.sweep(curves, 0.0, fit),
                    joint: 0.0,
                    cause: Cause::First,
                    iterations: report.iterations,
                    is_tight: fit != Fit::Roomy,
                    careful_until: f64::INFINITY,
                    ready: 0.0,
                });
                return Ok((Some(report), None));
            }
            halt = Some(report.reason.into());
            last = last.or(Some(report));
        }
        if !matches!(halt, Some(Halt::GoalBlocked | Halt::Disconnected))
            && let Some((curves, states)) =
                self.search_states(self.start, &self.narrow, Grain::COARSE, PATIENCE)
        {
            self.route = Some(Route {
                sweep: self.sweep(&curves, 0.0, Fit::Narrow),
                curves,
                joint: 0.0,
                cause: Cause::First,
                iterations: states,
                is_tight: true,
                careful_until: f64::INFINITY,
                ready: 0.0,
            });
            return Ok((last, None));
        }
        self.halt = halt;
        Ok((last, halt))
    }
}

/// Counts cells about the bike as free that were not seen: whoever put it down there knows.
pub(super) fn vouch_for_the_start(belief: &mut Belief, task: &Task<'_>) {
    let Some(heading) = task.start.heading else {
        return;
    };
    let line = FergusonCurve::straight(
        task.start.position,
        task.start.position + Vector2::new(heading.cos(), heading.sin()) * 1e-3,
    );
    let Ok(place) = CurvePath::new(vec![line]) else {
        return;
    };
    let sweep = Sweep::new(
        &place,
        0.0,
        &task.bike,
        task.online.start_zone,
        belief.cells(),
        STEP,
    );
    let width = belief.cells().width;
    let cells: Vec<_> = sweep
        .all()
        .map(|cell| (cell as usize % width, cell as usize / width))
        .filter(|&(x, y)| belief.cells().cell(x, y) == Some(Cell::Unknown))
        .map(|(x, y)| (x, y, Cell::Free))
        .collect();
    belief.observe(&cells);
}
