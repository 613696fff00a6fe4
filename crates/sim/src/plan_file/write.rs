//! A plan as JSON: what `plan --json` prints and what `plan -o` writes.

use bikebot_geometry::Point2;
use bikebot_planner::report::sampling_step;
use bikebot_planner::{
    EndPose, Method, PlanError, PlanReport, PlannerParams, PlanningProblem, Stage, TraceEntry,
};
use bikebot_world::{Cell, Obstacle, World};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::record::ResultHasher;

/// What `bikebot plan --json` prints for each run. What does not apply is absent.
#[derive(Debug, Clone, Serialize)]
pub struct PlanJson {
    /// `found`, `no_path`, `exhausted`, `timed_out`, or `invalid`.
    pub outcome: String,
    /// One of a closed list.
    pub reason: String,
    /// Which method planned.
    pub method: &'static str,
    /// Its seed.
    pub seed: u64,
    /// The planning call on a prepared map, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
    /// Until the first certified path, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_s: Option<f64>,
    /// Building what a second query on the same map would reuse, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prepare_s: Option<f64>,
    /// Iterations of all stages.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations: Option<u64>,
    /// Length of the path, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length_m: Option<f64>,
    /// No path is shorter than this, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lower_bound_m: Option<f64>,
    /// Roughness on the path's own samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness: Option<f64>,
    /// Roughness on samples of a fixed step.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness_fixed_step: Option<f64>,
    /// Largest curvature, 1/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_curvature_per_m: Option<f64>,
    /// Largest jump of curvature, 1/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curvature_jump_per_m: Option<f64>,
    /// Least clearance of the footprint, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_clearance_m: Option<f64>,
    /// `[x_m, y_m, heading_rad, curvature_per_m, s_m]`, dense enough to show the curvature.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<Vec<[f64; 5]>>,
    /// How the search went.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trace: Option<Vec<TraceJson>>,
    /// SHA-256 over outcome, reason and segments.
    pub result_hash: String,
    /// Version of this program.
    pub version: &'static str,
}

/// One step forward of the search.
#[derive(Debug, Clone, Serialize)]
pub struct TraceJson {
    time_s: f64,
    iteration: u64,
    stage: Stage,
    length_m: f64,
    cost: f64,
    certified: bool,
}

/// When what happened, as the caller's clock saw it, s.
#[derive(Debug, Clone, Default)]
pub struct Times {
    /// Building what searches on this map share.
    pub prepare: f64,
    /// The search.
    pub plan: f64,
    /// Each entry of the trace, from the start of the search.
    pub trace: Vec<f64>,
}

/// The name an enum has in files.
pub(super) fn name(value: &impl Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(Value::String(name)) => name,
        _ => String::new(),
    }
}

impl PlanJson {
    /// What a search came to.
    #[must_use]
    pub fn new(report: &PlanReport, problem: &PlanningProblem<'_>, times: &Times) -> Self {
        let (outcome, reason) = (name(&report.outcome), name(&report.reason));
        let result_hash = plan_hash(report);
        let metrics = report.metrics.as_ref();
        let trace = report
            .trace
            .iter()
            .zip(&times.trace)
            .map(|(entry, time)| TraceJson {
                time_s: *time,
                iteration: entry.iteration,
                stage: entry.stage,
                length_m: entry.length,
                cost: entry.cost,
                certified: entry.certified,
            })
            .collect();
        // What a method that ignores headings and curvature returns is known when its last stage begins to know it.
        let last_stage = report.trace.last().map(|entry| entry.stage);
        let is_first = |entry: &TraceEntry| {
            entry.certified
                || (!report.method.is_curvature_limited() && Some(entry.stage) == last_stage)
        };
        let first = report.path.is_some().then(|| {
            report
                .trace
                .iter()
                .zip(&times.trace)
                .find(|(entry, _)| is_first(entry))
                .map_or(times.plan, |(_, time)| *time)
        });
        Self {
            outcome,
            reason,
            method: report.method.name(),
            seed: report.seed,
            time_s: Some(times.plan),
            first_s: first,
            prepare_s: Some(times.prepare),
            iterations: Some(report.iterations),
            length_m: metrics.map(|metrics| metrics.length),
            lower_bound_m: metrics.and_then(|metrics| metrics.lower_bound),
            roughness: metrics.map(|metrics| metrics.roughness),
            roughness_fixed_step: metrics.map(|metrics| metrics.roughness_fixed_step),
            max_curvature_per_m: metrics.and_then(|metrics| metrics.max_curvature),
            curvature_jump_per_m: metrics.and_then(|metrics| metrics.curvature_jump),
            min_clearance_m: metrics.map(|metrics| metrics.min_clearance),
            path: report.path.as_ref().map(|path| {
                path.sample(sampling_step(problem))
                    .iter()
                    .map(|point| {
                        let at = point.position;
                        [at.x, at.y, point.heading, point.curvature, point.s]
                    })
                    .collect()
            }),
            trace: Some(trace),
            result_hash,
            version: env!("CARGO_PKG_VERSION"),
        }
    }

    /// A problem that makes no sense.
    #[must_use]
    pub fn invalid(error: &PlanError, method: Method, seed: u64) -> Self {
        let reason = reason_of(error);
        Self {
            outcome: "invalid".into(),
            reason: reason.into(),
            method: method.name(),
            seed,
            time_s: None,
            first_s: None,
            prepare_s: None,
            iterations: None,
            length_m: None,
            lower_bound_m: None,
            roughness: None,
            roughness_fixed_step: None,
            max_curvature_per_m: None,
            curvature_jump_per_m: None,
            min_clearance_m: None,
            path: None,
            trace: None,
            result_hash: ResultHasher::new().finish("invalid", reason),
            version: env!("CARGO_PKG_VERSION"),
        }
    }
}

/// In one word why a problem makes no sense: one of a closed list.
#[must_use]
pub fn reason_of(error: &PlanError) -> &'static str {
    match error {
        PlanError::StartInObstacle { .. } => "start_in_obstacle",
        PlanError::GoalInObstacle { .. } => "goal_in_obstacle",
        PlanError::OutsideMap { .. } => "outside_map",
        PlanError::InvalidParameter { .. } | PlanError::InvalidFootprint { .. } => {
            "invalid_parameter"
        }
    }
}

/// SHA-256 over outcome, reason and segments of a plan, hexadecimal.
#[must_use]
pub fn plan_hash(report: &PlanReport) -> String {
    let mut hasher = ResultHasher::new();
    if let Some(path) = &report.path {
        for segment in path.segments() {
            hasher.values(&segment.to_array());
        }
    }
    hasher.finish(&name(&report.outcome), &name(&report.reason))
}

/// What tells one map from another: a hash over its bounds, shapes and cells.
#[must_use]
pub fn map_hash(world: &World) -> String {
    let mut hasher = ResultHasher::new();
    let bounds = world.bounds();
    hasher.values(&[bounds.min.x, bounds.min.y, bounds.max.x, bounds.max.y]);
    for obstacle in world.obstacles() {
        match obstacle {
            Obstacle::Disc { center, radius } => hasher.values(&[1.0, center.x, center.y, *radius]),
            Obstacle::Block { min, max } => hasher.values(&[2.0, min.x, min.y, max.x, max.y]),
            Obstacle::Polygon { vertices } => {
                hasher.values(&[3.0, vertices.len() as f64]);
                for v in vertices {
                    hasher.values(&[v.x, v.y]);
                }
            }
        }
    }
    if let Some(grid) = world.grid() {
        let (at, yaw) = (grid.origin.position, grid.origin.heading);
        let (width, height) = (grid.width as f64, grid.height as f64);
        hasher.values(&[4.0, width, height, grid.resolution, at.x, at.y, yaw]);
        // Thirty-two cells of three kinds are a whole number that a double holds.
        let packed: Vec<f64> = grid
            .cells
            .chunks(32)
            .map(|cells| {
                cells.iter().fold(0.0, |sum, cell| {
                    let digit = match cell {
                        Cell::Free => 0.0,
                        Cell::Occupied => 1.0,
                        Cell::Unknown => 2.0,
                    };
                    3.0 * sum + digit
                })
            })
            .collect();
        hasher.values(&packed);
    }
    hasher.finish("map", "")
}

/// What `-o plan.json` holds: the plan, the curves themselves, and what pictures need.
#[derive(Debug, Serialize)]
pub struct PlanFile<'a> {
    #[serde(flatten)]
    plan: &'a PlanJson,
    /// `[x0, y0, vx0, vy0, x1, y1, vx1, vy1]`: Ferguson-Coons pieces.
    segments: Vec<[f64; 8]>,
    problem: ProblemJson,
    stages: StagesJson,
}

#[derive(Debug, Serialize)]
struct ProblemJson {
    map: Option<String>,
    bounds_m: [f64; 4],
    /// Obstacles that are not cells: with them a picture needs no map file.
    shapes: Shapes,
    /// Whether there are cells too.
    grid: bool,
    footprint: String,
    margin_m: f64,
    max_curvature_per_m: f64,
    start: EndJson,
    goal: EndJson,
    tolerance_m: f64,
    /// "pose" or "ball": where the path may end.
    ends_in: String,
    /// SHA-256 over the map: bounds, shapes, cells.
    map_hash: String,
}

#[derive(Debug, Serialize)]
struct EndJson {
    x_m: f64,
    y_m: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    heading_rad: Option<f64>,
}

#[derive(Debug, Serialize)]
struct StagesJson {
    tree: Vec<[[f64; 2]; 2]>,
    corridor_tree: Vec<[f64; 8]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    coarse: Option<Vec<[f64; 2]>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    guide: Option<Vec<[f64; 2]>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    corridor_guide: Option<Vec<[f64; 2]>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    corridor_half_width_m: Option<f64>,
}

fn pair(point: &Point2) -> [f64; 2] {
    [point.x, point.y]
}

impl From<EndPose> for EndJson {
    fn from(end: EndPose) -> Self {
        Self {
            x_m: end.position.x,
            y_m: end.position.y,
            heading_rad: end.heading,
        }
    }
}

impl<'a> PlanFile<'a> {
    /// The file for a plan of `problem` on the map of that name.
    #[must_use]
    pub fn new(
        plan: &'a PlanJson,
        report: &PlanReport,
        problem: &PlanningProblem<'_>,
        params: &PlannerParams,
        map: Option<String>,
    ) -> Self {
        let bounds = problem.world.bounds();
        let stages = &report.stages;
        let vertices =
            |line: &bikebot_geometry::Polyline| line.vertices().iter().map(pair).collect();
        Self {
            plan,
            segments: report
                .path
                .as_ref()
                .map(|path| {
                    path.segments()
                        .iter()
                        .map(|segment| segment.to_array())
                        .collect()
                })
                .unwrap_or_default(),
            problem: ProblemJson {
                map,
                bounds_m: [bounds.min.x, bounds.min.y, bounds.max.x, bounds.max.y],
                shapes: Shapes::of(problem.world),
                grid: problem.world.grid().is_some(),
                footprint: problem.footprint.to_string(),
                margin_m: params.margin,
                max_curvature_per_m: problem.max_curvature,
                start: problem.start.into(),
                goal: problem.goal.end().into(),
                tolerance_m: problem.goal.tolerance,
                ends_in: name(&params.goal),
                map_hash: map_hash(problem.world),
            },
            stages: StagesJson {
                tree: stages
                    .tree
                    .iter()
                    .map(|[a, b]| [pair(a), pair(b)])
                    .collect(),
                corridor_tree: stages
                    .corridor_tree
                    .iter()
                    .map(|curve| curve.to_array())
                    .collect(),
                coarse: stages.coarse.as_ref().map(vertices),
                guide: stages.guide.as_ref().map(vertices),
                corridor_guide: stages.corridor_guide.as_ref().map(vertices),
                corridor_half_width_m: stages.corridor_half_width,
            },
        }
    }
}

/// Obstacles as they stand in a plan file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Shapes {
    /// Centre and radius: `x y r`, m.
    pub discs: Vec<[f64; 3]>,
    /// Corners, m.
    pub polygons: Vec<Vec<[f64; 2]>>,
    /// Lower left and upper right corner: `x0 y0 x1 y1`, m.
    pub blocks: Vec<[f64; 4]>,
}

impl Shapes {
    /// The obstacles of `world` that are not cells of a grid.
    #[must_use]
    pub fn of(world: &World) -> Self {
        let mut shapes = Self::default();
        for obstacle in world.obstacles() {
            match obstacle {
                Obstacle::Disc { center, radius } => {
                    shapes.discs.push([center.x, center.y, *radius]);
                }
                Obstacle::Polygon { vertices } => shapes
                    .polygons
                    .push(vertices.iter().map(|p| [p.x, p.y]).collect()),
                Obstacle::Block { min, max } => {
                    shapes.blocks.push([min.x, min.y, max.x, max.y]);
                }
            }
        }
        shapes
    }

    /// The obstacles.
    #[must_use]
    pub fn obstacles(&self) -> Vec<Obstacle> {
        let discs = self.discs.iter().map(|&[x, y, radius]| Obstacle::Disc {
            center: Point2::new(x, y),
            radius,
        });
        let polygons = self.polygons.iter().map(|vertices| Obstacle::Polygon {
            vertices: vertices.iter().map(|&[x, y]| Point2::new(x, y)).collect(),
        });
        let blocks = self.blocks.iter().map(|&[x0, y0, x1, y1]| Obstacle::Block {
            min: Point2::new(x0, y0),
            max: Point2::new(x1, y1),
        });
        discs.chain(polygons).chain(blocks).collect()
    }
}
