//! A planner that is prepared once and asked often.

use crate::budget::Budget;
use crate::error::PlanError;
use crate::metrics::PathMetrics;
use crate::motion::MotionChecker;
use crate::params::PlannerParams;
use crate::pipeline::{clearance_tolerance, plan_observed, resolution};
use crate::problem::{EndPose, GoalRegion, PlanningProblem};
use crate::report::{Outcome, PlanReport, PlannedPath, Reason, Stages, TraceEntry};
use bikebot_geometry::{CurvePath, FergusonCurve};
use bikebot_world::{Footprint, World};

/// A field, an outline and the parameters of the search: everything of a question but its ends.
///
/// What queries on the field need is made by [`Planner::prepare`], or by the first questions as they come by; it belongs to the
/// [`World`], so that planners on one world share it. No answer depends on it.
///
/// ```
/// use bikebot_planner::{Budget, EndPose, GoalRegion, Planner, PlannerParams};
/// use bikebot_world::{Bounds, Footprint, World};
/// use bikebot_geometry::Point2;
///
/// let world = World::new(Bounds::new(0.0, 0.0, 10.0, 10.0), vec![])?;
/// let planner = Planner::new(&world, Footprint::Point, PlannerParams::default());
/// planner.prepare(&|| false);
/// let goal = GoalRegion { position: Point2::new(9.0, 9.0), heading: None, tolerance: 0.3 };
/// let mut lengths = Vec::new();
/// let report = planner.refine(EndPose::pose(1.0, 1.0, 0.0), goal, 1, &Budget::of_iterations(2000), &mut |better| {
///     lengths.push(better.entry.length);
/// })?;
/// let last = lengths.last().copied().unwrap_or(f64::NAN);
/// assert!(report.path.is_some_and(|path| (path.length() - last).abs() < 1e-6));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Planner<'w> {
    world: &'w World,
    footprint: Footprint,
    params: PlannerParams,
}

/// A certified path found on the way, cheaper than all before it.
#[derive(Debug, Clone, Copy)]
pub struct Better<'a> {
    /// Iteration, stage, length and cost.
    pub entry: &'a TraceEntry,
    /// The path.
    pub curves: &'a [FergusonCurve],
}

impl<'w> Planner<'w> {
    /// For `footprint` on `world`; the curvature limit is that of `params`, whose own footprint is not read.
    #[must_use]
    pub fn new(world: &'w World, footprint: Footprint, params: PlannerParams) -> Self {
        Self {
            world,
            footprint,
            params,
        }
    }

    /// The parameters.
    #[must_use]
    pub fn params(&self) -> &PlannerParams {
        &self.params
    }

    /// Makes now what questions would make as they come by; false if `stop` said so first.
    pub fn prepare(&self, stop: &dyn Fn() -> bool) -> bool {
        self.world.prepare(stop)
    }

    /// The question how to get from `start` to `goal`.
    #[must_use]
    pub fn problem(&self, start: EndPose, goal: GoalRegion) -> PlanningProblem<'w> {
        PlanningProblem {
            world: self.world,
            footprint: self.footprint.clone(),
            start,
            goal,
            max_curvature: self.params.max_curvature,
        }
    }

    /// Answers it.
    ///
    /// # Errors
    ///
    /// As [`plan`](crate::plan).
    pub fn plan(
        &self,
        start: EndPose,
        goal: GoalRegion,
        seed: u64,
        budget: &Budget<'_>,
    ) -> Result<PlanReport, PlanError> {
        self.refine(start, goal, seed, budget, &mut |_| {})
    }

    /// [`Planner::plan`], telling `on_better` of every path on the way that is certified and cheaper than those before. The last of
    /// them is the path of the report. Only [`Method::Full`](crate::Method::Full) has any to tell of.
    ///
    /// # Errors
    ///
    /// As [`plan`](crate::plan).
    pub fn refine(
        &self,
        start: EndPose,
        goal: GoalRegion,
        seed: u64,
        budget: &Budget<'_>,
        on_better: &mut dyn FnMut(Better<'_>),
    ) -> Result<PlanReport, PlanError> {
        self.observe(start, goal, seed, budget, &mut |_, better| {
            if let Some(better) = better {
                on_better(better);
            }
        })
    }

    /// [`Planner::refine`], telling of every entry of the trace as it is made, and of the better path where it brings one.
    ///
    /// # Errors
    ///
    /// As [`plan`](crate::plan).
    pub fn observe(
        &self,
        start: EndPose,
        goal: GoalRegion,
        seed: u64,
        budget: &Budget<'_>,
        observe: &mut dyn FnMut(&TraceEntry, Option<Better<'_>>),
    ) -> Result<PlanReport, PlanError> {
        let problem = self.problem(start, goal);
        let mut least = f64::INFINITY;
        plan_observed(
            &problem,
            &self.params,
            seed,
            budget,
            &mut |entry, curves| {
                let curves = curves.filter(|_| entry.cost < least);
                if curves.is_some() {
                    least = entry.cost;
                }
                observe(entry, curves.map(|curves| Better { entry, curves }));
            },
        )
    }

    /// What a search stopped at `better` would have reported, but for the stages and the lower bound. `None` if the curves do not
    /// join, which those that [`Planner::refine`] tells of always do.
    #[must_use]
    pub fn report_of(
        &self,
        better: Better<'_>,
        start: EndPose,
        goal: GoalRegion,
        seed: u64,
    ) -> Option<PlanReport> {
        let problem = self.problem(start, goal);
        let path = PlannedPath::Curves(CurvePath::new(better.curves.to_vec()).ok()?);
        let checker = MotionChecker::new(
            self.world,
            &self.footprint,
            self.params.margin,
            resolution(&problem, &self.params),
        );
        let tolerance = clearance_tolerance(&self.params, true);
        let mut metrics = PathMetrics::of(&path, &checker, goal.position, None, tolerance);
        metrics.min_clearance = metrics.min_clearance.max(self.params.margin);
        Some(PlanReport {
            outcome: Outcome::Found,
            reason: Reason::Found,
            method: self.params.method,
            seed,
            iterations: better.entry.iteration,
            cut_short: None,
            path: Some(path),
            metrics: Some(metrics),
            stages: Stages::default(),
            trace: vec![*better.entry],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::certificate::{PathKind, Promises, Terms, verify};
    use crate::test_scenes::{block, room};
    use bikebot_geometry::Point2;

    #[test]
    fn every_better_path_is_proven_by_the_independent_checker_and_the_last_is_the_answer() {
        let world = room(
            10.0,
            vec![block(4.0, 0.0, 5.0, 6.0), block(7.0, 4.0, 8.0, 10.0)],
        );
        let planner = Planner::new(
            &world,
            Footprint::Disc { radius: 0.3 },
            PlannerParams::default(),
        );
        let start = EndPose::pose(1.0, 1.0, 1.0);
        let goal = GoalRegion {
            position: Point2::new(9.0, 9.0),
            heading: Some(0.5),
            tolerance: 0.3,
        };
        let mut reports = Vec::new();
        let report = planner
            .refine(
                start,
                goal,
                5,
                &Budget::of_iterations(6000),
                &mut |better| {
                    reports.push(planner.report_of(better, start, goal, 5).expect("a path"));
                },
            )
            .expect("a problem");
        assert!(!reports.is_empty());
        let problem = planner.problem(start, goal);
        for report in &reports {
            let metrics = report.metrics.as_ref().expect("figures");
            let terms = Terms {
                kind: PathKind::Curves,
                margin: planner.params().margin,
                goal_radius: 0.0,
                promises: Promises {
                    max_curvature: metrics.max_curvature,
                    curvature_jump: metrics.curvature_jump,
                    min_clearance: Some(metrics.min_clearance),
                    length: Some(metrics.length),
                },
            };
            let segments = report.path.as_ref().expect("a path").segments();
            let verdict = verify(&problem, &segments, &terms);
            assert!(verdict.holds(), "{:?}", verdict.violations);
        }
        let costs: Vec<f64> = reports.iter().map(|report| report.trace[0].cost).collect();
        assert!(costs.is_sorted_by(|a, b| a > b), "{costs:?}");
        let last = reports.last().and_then(|report| report.path.as_ref());
        assert_eq!(
            last.map(PlannedPath::segments),
            report.path.as_ref().map(PlannedPath::segments)
        );
    }
}
