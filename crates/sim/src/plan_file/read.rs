//! A plan file read back.

use bikebot_geometry::{CurvePath, FergusonCurve, Point2, Polyline};
use bikebot_planner::{
    EndPose, GoalRegion, Method, Outcome, PathKind, PathMetrics, PlanReport, PlannedPath,
    PlannerParams, PlanningProblem, Promises, Reason, Stage, Stages, Terms, TraceEntry,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::write::{map_hash, name};

/// Most curves that are read.
const MAX_SEGMENTS: usize = 200_000;

/// Why a text is no plan.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PlanFileError {
    /// It is no JSON, or a key is missing or of another kind.
    #[error("{0}")]
    NotAPlan(String),
    /// It names a method that there is not.
    #[error("there is no method \"{0}\"")]
    Method(String),
    /// Its segments do not join to a path.
    #[error("segments: {0}")]
    Segments(String),
}

/// A plan as it stands in a file written by `bikebot plan -o` or `Plan.to_json`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct StoredPlan {
    /// Which method planned.
    pub method: Method,
    /// How it ended; what does not say it is taken for a path.
    #[serde(default = "found")]
    pub outcome: Outcome,
    /// Why.
    #[serde(default = "for_found")]
    pub reason: Reason,
    /// Its seed.
    #[serde(default)]
    pub seed: u64,
    /// The search, s.
    #[serde(default)]
    pub time_s: f64,
    /// What was built before it, s.
    #[serde(default)]
    pub prepare_s: f64,
    /// Iterations of all stages.
    #[serde(default)]
    pub iterations: u64,
    /// Length, m.
    pub length_m: Option<f64>,
    /// No path is shorter than this, m.
    pub lower_bound_m: Option<f64>,
    /// 1/m⁵.
    pub roughness: Option<f64>,
    /// 1/m⁵, after resampling.
    pub roughness_fixed_step: Option<f64>,
    /// 1/m.
    pub max_curvature_per_m: Option<f64>,
    /// 1/m.
    pub curvature_jump_per_m: Option<f64>,
    /// m.
    pub min_clearance_m: Option<f64>,
    /// `[x0, y0, vx0, vy0, x1, y1, vx1, vy1]`: Ferguson-Coons pieces.
    pub segments: Vec<[f64; 8]>,
    /// What was asked.
    pub problem: StoredProblem,
    /// Samples of the path: `[x_m, y_m, heading_rad, curvature_per_m, s_m]`.
    pub path: Option<Vec<[f64; 5]>>,
    #[serde(default)]
    trace: Vec<StoredStep>,
    #[serde(default)]
    stages: StoredStages,
}

fn found() -> Outcome {
    Outcome::Found
}

fn for_found() -> Reason {
    Reason::Found
}

/// What was asked.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct StoredProblem {
    /// The map's name.
    pub map: Option<String>,
    /// min x, min y, max x, max y, m.
    pub bounds_m: [f64; 4],
    /// The outline, as in scenarios.
    pub footprint: String,
    /// Clearance kept, m.
    pub margin_m: f64,
    /// Curvature limit, 1/m.
    pub max_curvature_per_m: f64,
    /// Start.
    pub start: StoredEnd,
    /// Goal.
    pub goal: StoredEnd,
    /// Radius of the goal ball, m.
    pub tolerance_m: f64,
    /// "pose" or "ball": where the path may end.
    pub ends_in: Option<String>,
    /// See [`map_hash`].
    pub map_hash: Option<String>,
}

/// A place with or without a heading.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct StoredEnd {
    /// m.
    pub x_m: f64,
    /// m.
    pub y_m: f64,
    /// rad; absent: any.
    pub heading_rad: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct StoredStep {
    #[serde(default)]
    time_s: f64,
    #[serde(default)]
    iteration: u64,
    stage: Stage,
    length_m: f64,
    cost: f64,
    #[serde(default)]
    certified: bool,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
struct StoredStages {
    tree: Vec<[[f64; 2]; 2]>,
    corridor_tree: Vec<[f64; 8]>,
    coarse: Option<Vec<[f64; 2]>>,
    guide: Option<Vec<[f64; 2]>>,
    corridor_guide: Option<Vec<[f64; 2]>>,
    corridor_half_width_m: Option<f64>,
}

/// Something that the plan's problem and the given one differ in.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Mismatch {
    /// What.
    pub what: &'static str,
    /// As the plan has it.
    pub plan: String,
    /// As it is given.
    pub given: String,
}

impl From<EndPose> for StoredEnd {
    fn from(end: EndPose) -> Self {
        Self {
            x_m: end.position.x,
            y_m: end.position.y,
            heading_rad: end.heading,
        }
    }
}

impl From<StoredEnd> for EndPose {
    fn from(end: StoredEnd) -> Self {
        Self {
            position: Point2::new(end.x_m, end.y_m),
            heading: end.heading_rad,
            curvature: None,
        }
    }
}

impl StoredProblem {
    /// Of `problem`, planned with `params` on the map of that name.
    #[must_use]
    pub fn of(problem: &PlanningProblem<'_>, params: &PlannerParams, map: Option<String>) -> Self {
        let bounds = problem.world.bounds();
        Self {
            map,
            bounds_m: [bounds.min.x, bounds.min.y, bounds.max.x, bounds.max.y],
            footprint: problem.footprint.to_string(),
            margin_m: params.margin,
            max_curvature_per_m: problem.max_curvature,
            start: problem.start.into(),
            goal: problem.goal.end().into(),
            tolerance_m: problem.goal.tolerance,
            ends_in: Some(name(&params.goal)),
            map_hash: Some(map_hash(problem.world)),
        }
    }

    /// What the plan was made for and what it is to be held against, where they differ.
    #[must_use]
    pub fn mismatches(&self, given: &PlanningProblem<'_>, margin: f64) -> Vec<Mismatch> {
        let plan = self;
        let mut found = Vec::new();
        let mut differ = |what, plan: String, given: String| {
            if plan != given {
                found.push(Mismatch { what, plan, given });
            }
        };
        let b = given.world.bounds();
        let bounds = [b.min.x, b.min.y, b.max.x, b.max.y];
        differ(
            "map bounds",
            format!("{:?} m", plan.bounds_m),
            format!("{bounds:?} m"),
        );
        if let Some(hash) = &plan.map_hash {
            // Twelve digits tell two maps apart.
            let shown = |hash: &str| format!("{}…", hash.get(..12).unwrap_or(hash));
            differ("map", shown(hash), shown(&map_hash(given.world)));
        }
        differ(
            "footprint",
            plan.footprint.clone(),
            given.footprint.to_string(),
        );
        let per_metre = |value: f64| format!("{value} /m");
        differ(
            "curvature limit",
            per_metre(plan.max_curvature_per_m),
            per_metre(given.max_curvature),
        );
        differ(
            "margin",
            format!("{} m", plan.margin_m),
            format!("{margin} m"),
        );
        let end = |end: EndPose| {
            let heading = end.heading.map_or_else(
                || "any heading".to_owned(),
                // Degrees and radians do not convert to the last digit.
                |heading| format!("heading {heading:.9} rad"),
            );
            format!("({}, {}) m, {heading}", end.position.x, end.position.y)
        };
        differ("start", end(plan.start()), end(given.start));
        differ("goal", end(plan.goal().end()), end(given.goal.end()));
        differ(
            "goal tolerance",
            format!("{} m", plan.tolerance_m),
            format!("{} m", given.goal.tolerance),
        );
        found
    }

    /// Start of the path.
    #[must_use]
    pub fn start(&self) -> EndPose {
        self.start.into()
    }

    /// Goal of the path.
    #[must_use]
    pub fn goal(&self) -> GoalRegion {
        GoalRegion {
            position: Point2::new(self.goal.x_m, self.goal.y_m),
            heading: self.goal.heading_rad,
            tolerance: self.tolerance_m,
        }
    }
}

impl StoredPlan {
    /// Reads a plan.
    ///
    /// # Errors
    ///
    /// [`PlanFileError`]: in one sentence what keeps the text from being a plan.
    pub fn parse(text: &[u8]) -> Result<Self, PlanFileError> {
        let json = serde_json::from_slice(text)
            .map_err(|error| PlanFileError::NotAPlan(error.to_string()))?;
        Self::from_json(json)
    }

    /// Reads a plan whose text was parsed already.
    ///
    /// # Errors
    ///
    /// As [`StoredPlan::parse`].
    pub fn from_json(json: Value) -> Result<Self, PlanFileError> {
        let refuse = |what: String| Err(PlanFileError::NotAPlan(what));
        if !json.is_object() {
            return refuse("it holds no plan".to_owned());
        }
        if let Some(method) = json.get("method").and_then(Value::as_str)
            && method.parse::<Method>().is_err()
        {
            return Err(PlanFileError::Method(method.to_owned()));
        }
        let plan: Self = match serde_json::from_value(json) {
            Ok(plan) => plan,
            Err(error) => return refuse(error.to_string()),
        };
        if plan.segments.len() > MAX_SEGMENTS {
            return refuse(format!(
                "it has {} segments; at most {MAX_SEGMENTS} are read",
                plan.segments.len()
            ));
        }
        Ok(plan)
    }

    /// The curves of the path, or its straight legs.
    #[must_use]
    pub fn curves(&self) -> Vec<FergusonCurve> {
        let segments = self.segments.iter();
        segments
            .map(|numbers| FergusonCurve::from_array(*numbers))
            .collect()
    }

    /// What the path claims, and what is asked of it with clearance `margin` (m) and the goal's `tolerance` (m).
    #[must_use]
    pub fn terms(&self, margin: f64, tolerance: f64) -> Terms {
        let in_ball = self.problem.ends_in.as_deref() == Some("ball");
        Terms {
            kind: if self.method.is_curvature_limited() {
                PathKind::Curves
            } else {
                PathKind::Polyline
            },
            margin,
            goal_radius: if in_ball { tolerance } else { 0.0 },
            promises: Promises {
                max_curvature: self.max_curvature_per_m,
                curvature_jump: self.curvature_jump_per_m,
                min_clearance: self.min_clearance_m,
                length: self.length_m,
            },
        }
    }

    /// What the plan was made for and what it is to be held against, where they differ.
    #[must_use]
    pub fn mismatches(&self, given: &PlanningProblem<'_>, margin: f64) -> Vec<Mismatch> {
        self.problem.mismatches(given, margin)
    }

    /// When each entry of the trace was made, s from the start of the search.
    pub fn trace_times(&self) -> impl Iterator<Item = f64> + '_ {
        self.trace.iter().map(|step| step.time_s)
    }

    /// The report that the file was written from, as far as a file holds it.
    ///
    /// # Errors
    ///
    /// [`PlanFileError::Segments`] where the segments do not join to a path.
    pub fn report(&self) -> Result<PlanReport, PlanFileError> {
        let path = self.planned_path()?;
        let goal = Point2::new(self.problem.goal.x_m, self.problem.goal.y_m);
        let metrics = path.as_ref().map(|path| PathMetrics {
            length: self.length_m.unwrap_or_else(|| path.length()),
            lower_bound: self.lower_bound_m,
            goal_gap: (path.end() - goal).norm(),
            roughness: self.roughness.unwrap_or(f64::NAN),
            roughness_fixed_step: self.roughness_fixed_step.unwrap_or(f64::NAN),
            max_curvature: self.max_curvature_per_m,
            curvature_jump: self.curvature_jump_per_m,
            min_clearance: self.min_clearance_m.unwrap_or(f64::NAN),
        });
        let line = |points: &Option<Vec<[f64; 2]>>| {
            let points = points.as_ref()?.iter().map(|&[x, y]| Point2::new(x, y));
            Polyline::new(points.collect()).ok()
        };
        let stages = &self.stages;
        Ok(PlanReport {
            outcome: self.outcome,
            reason: self.reason,
            method: self.method,
            seed: self.seed,
            iterations: self.iterations,
            cut_short: None,
            path,
            metrics,
            stages: Stages {
                tree: stages
                    .tree
                    .iter()
                    .map(|edge| edge.map(|[x, y]| Point2::new(x, y)))
                    .collect(),
                corridor_tree: stages
                    .corridor_tree
                    .iter()
                    .map(|numbers| FergusonCurve::from_array(*numbers))
                    .collect(),
                coarse: line(&stages.coarse),
                guide: line(&stages.guide),
                corridor_guide: line(&stages.corridor_guide),
                corridor_half_width: stages.corridor_half_width_m,
            },
            trace: self
                .trace
                .iter()
                .map(|step| TraceEntry {
                    iteration: step.iteration,
                    stage: step.stage,
                    length: step.length_m,
                    cost: step.cost,
                    certified: step.certified,
                })
                .collect(),
        })
    }

    fn planned_path(&self) -> Result<Option<PlannedPath>, PlanFileError> {
        if self.outcome != Outcome::Found {
            return Ok(None);
        }
        let curves = self.curves();
        let refuse = |error: String| PlanFileError::Segments(error);
        if self.method.is_curvature_limited() && !curves.is_empty() {
            let path = CurvePath::new(curves).map_err(|error| refuse(error.to_string()))?;
            return Ok(Some(PlannedPath::Curves(path)));
        }
        // A path of no legs is one vertex: the start was an arrival already.
        let mut vertices = vec![curves.first().map_or_else(
            || EndPose::from(self.problem.start).position,
            FergusonCurve::start_point,
        )];
        vertices.extend(curves.iter().map(FergusonCurve::end_point));
        let line = Polyline::new(vertices).map_err(|error| refuse(error.to_string()))?;
        Ok(Some(PlannedPath::Polyline(line)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::write::{PlanFile, PlanJson, Times, plan_hash};
    use super::*;
    use bikebot_planner::{Budget, PlannerParams, plan};
    use bikebot_world::{Bounds, Footprint, Obstacle, World};

    fn world() -> World {
        let block = Obstacle::Block {
            min: Point2::new(4.0, 0.0),
            max: Point2::new(5.0, 7.0),
        };
        World::new(Bounds::new(0.0, 0.0, 10.0, 10.0), vec![block]).expect("a room")
    }

    fn problem(world: &World) -> PlanningProblem<'_> {
        PlanningProblem {
            world,
            footprint: Footprint::Disc { radius: 0.3 },
            start: EndPose::pose(1.0, 1.0, 0.5),
            goal: GoalRegion {
                position: Point2::new(9.0, 1.0),
                heading: None,
                tolerance: 0.3,
            },
            max_curvature: 0.8,
        }
    }

    fn written(method: Method) -> (PlanReport, String) {
        let world = world();
        let problem = problem(&world);
        let params = PlannerParams {
            method,
            ..PlannerParams::default()
        };
        let report = plan(&problem, &params, 3, &Budget::of_iterations(3000)).expect("a problem");
        let json = PlanJson::new(&report, &problem, &Times::default());
        let file = PlanFile::new(&json, &report, &problem, &params, None);
        (report, serde_json::to_string(&file).expect("numbers"))
    }

    #[test]
    fn what_was_written_is_read_back_to_the_last_bit() {
        for method in [Method::Full, Method::BirrtSmooth, Method::Paper] {
            let (report, text) = written(method);
            let stored = StoredPlan::parse(text.as_bytes()).expect("a plan");
            let again = stored.report().expect("a report");
            assert_eq!(plan_hash(&again), plan_hash(&report), "{method}");
            assert_eq!(again.metrics, report.metrics, "{method}");
            assert_eq!(again.iterations, report.iterations);
            assert!(stored.mismatches(&problem(&world()), 0.0).is_empty());
        }
    }

    #[test]
    fn a_plan_for_another_problem_says_what_differs() {
        let (_, text) = written(Method::Full);
        let stored = StoredPlan::parse(text.as_bytes()).expect("a plan");
        let world = world();
        let mut other = problem(&world);
        other.max_curvature = 0.5;
        other.goal.heading = Some(1.0);
        let whats: Vec<_> = stored
            .mismatches(&other, 0.0)
            .iter()
            .map(|m| m.what)
            .collect();
        assert_eq!(whats, ["curvature limit", "goal"]);
    }

    #[test]
    fn what_is_no_plan_is_refused() {
        let (_, text) = written(Method::Full);
        for broken in [
            "",
            "[]",
            "{}",
            &text.replace("\"full\"", "\"dijkstra\""),
            &text.replace("\"segments\":[[", "\"segments\":[[true,"),
        ] {
            assert!(
                StoredPlan::parse(broken.as_bytes()).is_err(),
                "{broken:.40}"
            );
        }
        // Curves that do not meet are no path.
        let torn = text.replacen(
            "\"segments\":[[",
            "\"segments\":[[50,50,1,0,60,60,1,0],[",
            1,
        );
        let torn = StoredPlan::parse(torn.as_bytes()).expect("well-formed");
        assert!(matches!(torn.report(), Err(PlanFileError::Segments(_))));
    }
}
