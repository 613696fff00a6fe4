//! The methods of Table 2 as short compositions of stages — Sect. 3.2, Algorithm 1.
//!
//! | stage               | lines | ignores            | yields                    |
//! |---------------------|-------|--------------------|---------------------------|
//! | [`birrt::search`]   | 1–4   | heading, curvature | a collision-free polyline |
//! | [`shortcut::apply`] | 5     | heading, curvature | a shorter polyline        |
//! | [`taut::pull`]      | –     | heading, curvature | the same, tight (a switch) |
//! | [`corridor::search`] | 6–38 | nothing            | curves the bike can track |
//! | [`baseline::way`]   | –     | heading, curvature | a polyline found on a grid |
//! | [`baseline::mpc::track`] | – | nothing           | curves of continuous curvature |
//!
//! Stages that ignore heading plan for the largest disc about the footprint's reference point: what that disc cannot
//! do, the footprint cannot. Where the listing is silent or ambiguous we chose; see [`PlannerParams`].

use crate::baseline::{self, GridSearch, NoWay};
use crate::birrt;
use crate::budget::{Budget, CutShort, Meter};
use crate::chance::{Chance, Purpose};
use crate::connectivity;
use crate::error::PlanError;
use crate::full::Full;
use crate::metrics::PathMetrics;
use crate::motion::{MAX_QUERIES, MotionChecker, Tolerance};
use crate::params::{GoalMode, Method, PlannerParams};
use crate::problem::{EndPose, PlanningProblem};
use crate::report::{Outcome, PlanReport, PlannedPath, Reason, Stage, Stages, TraceEntry};
use crate::search::{PointQuery, PointSearch};
use crate::shortest::shortest;
use crate::taut::{self, Rivals};
use crate::{corridor, dead_end, rrt, rrt_star, shortcut};
use bikebot_geometry::{CurvePath, FergusonCurve, Point2, Polyline, Pose2, angle};
use std::f64::consts::PI;

/// Iterations for the lower bound of methods that do not need it themselves: a millisecond or two.
const BOUND_ITERATIONS: u64 = 1000;

/// Plans a path for `problem.footprint` from `problem.start` into `problem.goal`.
///
/// The curvature limit is the problem's; `params.max_curvature` and `params.footprint` are what a scenario builds a problem
/// from and are not read here. Equal problem, parameters, seed and iteration budget give an equal report, bit for bit.
///
/// # Errors
///
/// Only for a problem that makes no sense, such as a start inside an obstacle. A search that comes to nothing is
/// an ordinary result: see [`Outcome`].
pub fn plan(
    problem: &PlanningProblem<'_>,
    params: &PlannerParams,
    seed: u64,
    budget: &Budget<'_>,
) -> Result<PlanReport, PlanError> {
    plan_observed(problem, params, seed, budget, &mut |_, _| {})
}

/// [`plan`], telling `observe` of every entry of the trace as it is made: for callers who have a clock, or who would rather have the best so far
/// now. Of "full" each certified entry comes with its path, which is what `plan` would return if it were stopped there.
///
/// # Errors
///
/// As [`plan`].
pub fn plan_observed(
    problem: &PlanningProblem<'_>,
    params: &PlannerParams,
    seed: u64,
    budget: &Budget<'_>,
    observe: &mut dyn FnMut(&TraceEntry, Option<&[FergusonCurve]>),
) -> Result<PlanReport, PlanError> {
    plan_metered(problem, params, seed, Meter::new(budget), observe)
}

/// [`plan_observed`] with a meter that has counted other work before.
pub(crate) fn plan_metered(
    problem: &PlanningProblem<'_>,
    params: &PlannerParams,
    seed: u64,
    meter: Meter<'_>,
    observe: &mut dyn FnMut(&TraceEntry, Option<&[FergusonCurve]>),
) -> Result<PlanReport, PlanError> {
    params.check()?;
    problem.check(params.margin)?;
    let checker = MotionChecker::new(
        problem.world,
        &problem.footprint,
        params.margin,
        resolution(problem, params),
    );
    let mut run = Run {
        problem,
        params,
        seed,
        discs: checker.inscribed(),
        checker,
        meter,
        stages: Stages::default(),
        lower_bound: None,
        trace: Vec::new(),
        observe,
    };
    let (end, path) = if run.is_dead_end() {
        (End::Trapped, None)
    } else {
        run.method()
    };
    Ok(run.report(end, path))
}

/// How a composition of stages ended.
enum End {
    Found,
    Disconnected,
    /// No curve leaves the start, or reaches the goal, along the heading prescribed.
    Trapped,
    /// No polyline was found.
    NoWay,
    /// A polyline was found, but no curves along it.
    NoCurve,
}

/// Everything the stages share.
struct Run<'r, 'w, 'b> {
    problem: &'r PlanningProblem<'w>,
    params: &'r PlannerParams,
    seed: u64,
    /// For the whole footprint.
    checker: MotionChecker<'w>,
    /// For its inscribed disc.
    discs: MotionChecker<'w>,
    meter: Meter<'b>,
    stages: Stages,
    /// m; `None` if the method has not asked for it.
    lower_bound: Option<f64>,
    trace: Vec<TraceEntry>,
    observe: &'r mut dyn FnMut(&TraceEntry, Option<&[FergusonCurve]>),
}

impl Run<'_, '_, '_> {
    fn method(&mut self) -> (End, Option<PlannedPath>) {
        if self.starts_at_the_goal() {
            return polyline(vec![self.problem.start.position]);
        }
        match self.params.method {
            Method::Rrt | Method::RrtStar | Method::Birrt => match self.coarse(0) {
                Ok(path) => polyline(path),
                Err(end) => (end, None),
            },
            Method::BirrtSmooth => match self.guide(0) {
                Ok(path) => polyline(path),
                Err(end) => (end, None),
            },
            Method::Paper => self.paper(),
            Method::Full => self.full(),
            Method::Laplace
            | Method::LinearProgram
            | Method::MpcLaplace
            | Method::MpcLinearProgram => self.baseline(),
        }
    }

    /// A search on a grid, and for the methods that keep to the curvature limit a receding horizon along what it found.
    fn baseline(&mut self) -> (End, Option<PlannedPath>) {
        let Some(search) = GridSearch::of(self.params.method) else {
            return (End::NoWay, None);
        };
        let ends = [self.problem.start.position, self.problem.goal.position];
        let way = baseline::way(search, &self.discs, ends, self.params, &mut self.meter);
        let reference = match way {
            Ok(reference) => reference,
            Err(NoWay::Disconnected) if self.is_ball_out_of_reach() => {
                return (End::Disconnected, None);
            }
            Err(NoWay::Disconnected | NoWay::NotFound) => return (End::NoWay, None),
        };
        self.stages.coarse = Some(reference.clone());
        self.note_polyline(Stage::Grid, reference.vertices());
        if !self.params.method.is_curvature_limited() {
            return (End::Found, Some(PlannedPath::Polyline(reference)));
        }
        let (problem, params) = (self.problem, self.params);
        let path =
            baseline::mpc::track(problem, params, &self.checker, &reference, &mut self.meter);
        self.stages.guide = Some(reference);
        match path {
            Some(path) => {
                let length = path.length();
                let bending = params.curvature_weight * path.bending() / (length * length);
                let cost = params.length_weight * length + bending;
                self.note(Stage::Mpc, length, cost, true);
                (End::Found, Some(PlannedPath::Curves(path)))
            }
            None => (End::NoCurve, None),
        }
    }

    /// Whether it is proven that an end cannot be left, or reached, along its heading.
    fn is_dead_end(&mut self) -> bool {
        if !self.params.method.is_curvature_limited() {
            return false;
        }
        let (start, goal) = (&self.problem.start, &self.problem.goal);
        let straight = (goal.position - start.position).norm();
        let (goal_heading, at_least) = match self.params.goal {
            GoalMode::Pose => (goal.heading, straight),
            GoalMode::Ball => (None, straight - goal.tolerance),
        };
        let ends = [
            start.heading.map(|heading| (start.position, heading)),
            goal_heading.map(|heading| (goal.position, angle::wrap(heading + PI))),
        ];
        // Travelled backwards, the outline's front is behind.
        let footprints = [&self.checker, &self.discs];
        ends.into_iter().zip(footprints).any(|(end, checker)| {
            end.is_some_and(|(position, heading)| {
                let end = Pose2 { position, heading };
                let limit = self.problem.max_curvature;
                dead_end::is_proven(checker, &end, limit, at_least, &mut self.meter)
            })
        })
    }

    /// Whether there is nothing to ride: the start is an arrival already.
    fn starts_at_the_goal(&self) -> bool {
        let (start, goal) = (&self.problem.start, &self.problem.goal);
        match self.params.goal {
            GoalMode::Ball => goal.contains(start.position),
            GoalMode::Pose => {
                let turns = match (start.heading, goal.heading) {
                    (Some(from), Some(to)) => angle::difference(to, from) != 0.0,
                    _ => false,
                };
                let heeds_headings = self.params.method.is_curvature_limited();
                start.position == goal.position && !(turns && heeds_headings)
            }
        }
    }

    /// Algorithm 1, begun again from another BiRRT path as often as allowed while the corridor holds no curve.
    fn paper(&mut self) -> (End, Option<PlannedPath>) {
        for start in 0..self.params.guides.max(1) {
            let guide = match self.guide(start) {
                Ok(guide) => guide,
                Err(_) if start > 0 => break,
                Err(end) => return (end, None),
            };
            if let Some(path) = self.corridor(&guide, start) {
                return (End::Found, Some(path));
            }
            if self.meter.cut_short().is_some() {
                break;
            }
        }
        (End::NoCurve, None)
    }

    /// The default.
    fn full(&mut self) -> (End, Option<PlannedPath>) {
        let full = Full {
            problem: self.problem,
            params: self.params,
            seed: self.seed,
            checker: &self.checker,
            discs: &self.discs,
        };
        let (trace, observe) = (&mut self.trace, &mut self.observe);
        let found = full.search(&mut self.meter, &mut |step| {
            let entry = TraceEntry {
                iteration: step.iteration,
                stage: step.stage,
                length: step.length,
                cost: step.cost,
                certified: step.curves.is_some(),
            };
            observe(&entry, step.curves);
            trace.push(entry);
        });
        self.stages = found.stages;
        self.lower_bound = (found.lower_bound > 0.0).then_some(found.lower_bound);
        let path = found
            .best
            .and_then(|best| CurvePath::new(best.curves).ok())
            .map(PlannedPath::Curves);
        let end = match (&path, found.disconnected, found.has_way) {
            (Some(_), ..) => End::Found,
            (None, true, _) => End::Disconnected,
            (None, false, true) => End::NoCurve,
            (None, false, false) => End::NoWay,
        };
        (end, path)
    }

    /// Lines 6–38.
    fn corridor(&mut self, guide: &[Point2], start: u32) -> Option<PlannedPath> {
        let guide = Polyline::new(guide.to_vec()).ok()?;
        let mut chance = Chance::new(self.seed, Purpose::Corridor, start);
        let (trace, observe) = (&mut self.trace, &mut self.observe);
        let found = corridor::search(
            self.problem,
            self.params,
            &self.checker,
            &guide,
            &mut chance,
            &mut self.meter,
            &mut |improvement| {
                let entry = TraceEntry {
                    iteration: improvement.iteration,
                    stage: Stage::Corridor,
                    length: improvement.length,
                    cost: improvement.cost,
                    certified: true,
                };
                observe(&entry, None);
                trace.push(entry);
            },
        );
        self.stages.corridor_tree = found.edges;
        self.stages.corridor_guide = Some(found.guide);
        self.stages.corridor_half_width = Some(self.params.corridor_half_width());
        let curves = found.path?;
        CurvePath::new(curves).ok().map(PlannedPath::Curves)
    }

    /// P_BiRRT, or what the plain methods find in its place.
    fn coarse(&mut self, start: u32) -> Result<Vec<Point2>, End> {
        let (stage, purpose) = match self.params.method {
            Method::Rrt => (Stage::Rrt, Purpose::Rrt),
            Method::RrtStar => (Stage::RrtStar, Purpose::RrtStar),
            _ => (Stage::Birrt, Purpose::Birrt),
        };
        let query = PointQuery {
            checker: &self.discs,
            start: self.problem.start.position,
            goal: self.problem.goal.position,
            goal_mode: self.params.goal,
            tolerance: self.problem.goal.tolerance,
            max_step: self.params.max_step(),
            max_samples: self.params.search_iterations,
            shorter_than: f64::INFINITY,
        };
        let mut chance = Chance::new(self.seed, purpose, start);
        let meter = &mut self.meter;
        let PointSearch {
            path,
            edges,
            disconnected,
            ..
        } = match stage {
            Stage::Rrt => rrt::search(&query, &mut chance, meter),
            Stage::RrtStar => {
                rrt_star::search(&query, self.params.rrt_star_radius(), &mut chance, meter)
            }
            _ => birrt::search(&query, self.params.birrt_connect, &mut chance, meter),
        };
        self.stages.tree = edges;
        match path {
            Some(path) => {
                self.stages.coarse = Polyline::new(path.clone()).ok();
                self.note_polyline(stage, &path);
                Ok(path)
            }
            None if disconnected => Err(End::Disconnected),
            None => Err(End::NoWay),
        }
    }

    /// P_smooth.
    fn guide(&mut self, start: u32) -> Result<Vec<Point2>, End> {
        let mut path = self.coarse(start)?;
        let mut chance = Chance::new(self.seed, Purpose::Shortcut, start);
        shortcut::apply(
            &mut path,
            self.params.shortcut_attempts,
            &self.discs,
            &mut chance,
            &mut self.meter,
        );
        self.note_polyline(Stage::Shortcut, &path);
        if self.params.taut_guide && self.params.method == Method::Paper {
            path = taut::pull(&path, &Rivals::none(), &self.discs, &mut self.meter).path;
            self.note_polyline(Stage::Taut, &path);
        }
        self.stages.guide = Polyline::new(path.clone()).ok();
        Ok(path)
    }

    fn note_polyline(&mut self, stage: Stage, path: &[Point2]) {
        let length = path.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
        self.note(stage, length, self.params.length_weight * length, false);
    }

    fn note(&mut self, stage: Stage, length: f64, cost: f64, certified: bool) {
        let entry = TraceEntry {
            iteration: self.meter.iterations(),
            stage,
            length,
            cost,
            certified,
        };
        (self.observe)(&entry, None);
        self.trace.push(entry);
    }

    /// For a goal itself out of reach: whether the ball about it is so too, where anywhere in there will do.
    fn is_ball_out_of_reach(&mut self) -> bool {
        let (start, goal) = (&self.problem.start, &self.problem.goal);
        let (discs, meter) = (&self.discs, &mut self.meter);
        self.params.goal == GoalMode::Pose
            || connectivity::has_no_shortest_way(
                discs,
                start.position,
                goal.position,
                goal.tolerance,
                meter,
            )
    }

    /// The length no path can be shorter than, as far as [`BOUND_ITERATIONS`] tell; `None` if the budget has ended. Not counted as iterations of
    /// the search, which is over.
    fn shortest_length(&self) -> Option<f64> {
        if self.meter.cut_short().is_some() {
            return None;
        }
        let (start, goal) = (&self.problem.start, &self.problem.goal);
        let tolerance = match self.params.goal {
            GoalMode::Pose => 0.0,
            GoalMode::Ball => goal.tolerance,
        };
        let mut meter = self.meter.fork_unlimited();
        let radius = self.discs.inscribed_radius() + self.discs.margin();
        let world = self.problem.world;
        let shortest = meter.at_most(BOUND_ITERATIONS, |meter| {
            shortest(
                world,
                radius,
                start.position,
                goal.position,
                tolerance,
                None,
                meter,
            )
        });
        // A path that touches where the bound has something to spare leaves no claim.
        shortest.length.is_finite().then_some(shortest.length)
    }

    fn report(self, end: End, path: Option<PlannedPath>) -> PlanReport {
        let (outcome, reason) = match (end, self.meter.cut_short()) {
            (End::Found, _) => (Outcome::Found, Reason::Found),
            (End::Disconnected, _) => (Outcome::NoPath, Reason::Disconnected),
            (End::Trapped, _) => (Outcome::NoPath, Reason::CurvatureInfeasible),
            (_, Some(CutShort::Deadline)) => (Outcome::TimedOut, Reason::Deadline),
            (_, Some(CutShort::Cancelled)) => (Outcome::TimedOut, Reason::Cancelled),
            (_, Some(CutShort::Iterations)) | (End::NoWay, None) => {
                (Outcome::Exhausted, Reason::Iterations)
            }
            (End::NoCurve, None) => (Outcome::Exhausted, Reason::NoCurve),
        };
        let lower_bound = self.lower_bound.or_else(|| self.shortest_length());
        let metrics = path.as_ref().map(|path| {
            let goal = &self.problem.goal;
            let tolerance = clearance_tolerance(self.params, self.meter.cut_short().is_some());
            let mut metrics =
                PathMetrics::of(path, &self.checker, goal.position, lower_bound, tolerance);
            // Every motion of the path was accepted, which proves the margin; the search for the least stops a tolerance short.
            metrics.min_clearance = metrics.min_clearance.max(self.params.margin);
            metrics
        });
        PlanReport {
            outcome,
            reason,
            method: self.params.method,
            seed: self.seed,
            iterations: self.meter.iterations(),
            cut_short: self.meter.cut_short(),
            path,
            metrics,
            stages: self.stages,
            trace: self.trace,
        }
    }
}

fn polyline(path: Vec<Point2>) -> (End, Option<PlannedPath>) {
    // Vertices of a tree are finite, and a path has at least its start.
    match Polyline::new(path) {
        Ok(line) => (End::Found, Some(PlannedPath::Polyline(line))),
        Err(_) => (End::NoWay, None),
    }
}

/// How closely the least clearance of a path is found: to a tenth of δ, 2 mm on the yard, or a twentieth of itself. On a long way round many
/// obstacles every further millimetre costs hundreds of questions. Once the time is up there is none for them: a quarter of a millisecond's worth is asked.
pub(crate) fn clearance_tolerance(params: &PlannerParams, cut_short: bool) -> Tolerance {
    Tolerance {
        absolute: 0.1 * params.clearance_resolution(),
        relative: 0.05,
        questions: if cut_short { 150 } else { MAX_QUERIES },
    }
}

/// δ, m: the parameters', but no more than what the ends have to spare, or every motion out of a tight start would be refused.
pub(crate) fn resolution(problem: &PlanningProblem<'_>, params: &PlannerParams) -> f64 {
    let checker = MotionChecker::new(problem.world, &problem.footprint, params.margin, 0.0);
    let spare = |end: &EndPose| {
        let clearance = match end.heading {
            Some(heading) => checker.pose_clearance(&Pose2 {
                position: end.position,
                heading,
            }),
            None => checker.position_clearance(end.position),
        };
        clearance - params.margin
    };
    params
        .clearance_resolution()
        .min(spare(&problem.start))
        .min(spare(&problem.goal.end()))
}
