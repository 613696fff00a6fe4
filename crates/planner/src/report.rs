//! What planning came to: the path, its figures, every stage's product, and how it ended.

use crate::budget::CutShort;
use crate::metrics::PathMetrics;
use crate::params::Method;
use crate::problem::PlanningProblem;
use bikebot_geometry::{CurvePath, FergusonCurve, PathPoint, Point2, Polyline};
use serde::{Deserialize, Serialize};

/// How a plan ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// There is a path, and it is certified.
    Found,
    /// It is proven that there is none that keeps the margin and half the clearance resolution.
    NoPath,
    /// The iterations are used up; there may be a path.
    Exhausted,
    /// The caller's stop condition ended the search before anything was found.
    TimedOut,
}

/// Why it ended so.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// A path was found.
    Found,
    /// Start and goal lie in different rooms for this footprint.
    Disconnected,
    /// It is proven that no path within the curvature limit leaves the start, or reaches the goal, along the heading prescribed there.
    CurvatureInfeasible,
    /// A way through was found, but no path along it within the curvature limit and the prescribed headings; there may be one.
    NoCurve,
    /// The iterations ran out.
    Iterations,
    /// The deadline passed.
    Deadline,
    /// The search was cancelled.
    Cancelled,
}

/// A stage of planning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Plain RRT.
    Rrt,
    /// Plain RRT*.
    RrtStar,
    /// Bidirectional RRT.
    Birrt,
    /// Search on the clearance grid.
    Guide,
    /// The exact shortest way.
    Shortest,
    /// Shortcut.
    Shortcut,
    /// Pulling tight.
    Taut,
    /// RRT* in the corridor.
    Corridor,
    /// A search on a grid: the potential's streamline or the linear programme's flow.
    Grid,
    /// Model predictive control.
    Mpc,
    /// Smoothing to continuous curvature.
    Refine,
}

/// One step forward of the search: a stage's product, or a better path within a stage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TraceEntry {
    /// Iterations of all stages until then.
    pub iteration: u64,
    /// The stage at work.
    pub stage: Stage,
    /// Length of what it then had, m.
    #[serde(rename = "length_m")]
    pub length: f64,
    /// Its cost.
    pub cost: f64,
    /// Whether it is a path that the method may return: certified, in a method that keeps to headings and curvature. The costs of
    /// these never rise.
    pub certified: bool,
}

/// What each stage made, for pictures and for study.
#[derive(Debug, Clone, Default)]
pub struct Stages {
    /// Edges of the trees over positions, parent first.
    pub tree: Vec<[Point2; 2]>,
    /// Edges of the tree in the corridor.
    pub corridor_tree: Vec<FergusonCurve>,
    /// P_BiRRT: what the first search found.
    pub coarse: Option<Polyline>,
    /// P_smooth: the shortened path.
    pub guide: Option<Polyline>,
    /// Middle of the corridor: the guide with its ends bent onto the prescribed headings.
    pub corridor_guide: Option<Polyline>,
    /// w, m.
    pub corridor_half_width: Option<f64>,
}

/// A planned path.
#[derive(Debug, Clone)]
pub enum PlannedPath {
    /// Straight legs, from a method that ignores headings and curvature.
    Polyline(Polyline),
    /// Ferguson curves joined end to end with continuous heading.
    Curves(CurvePath),
}

impl PlannedPath {
    /// Arc length, m.
    #[must_use]
    pub fn length(&self) -> f64 {
        match self {
            Self::Polyline(line) => line.length(),
            Self::Curves(curves) => curves.length(),
        }
    }

    /// The position at arc length `s` (m), clamped to the path.
    #[must_use]
    pub fn position_at(&self, s: f64) -> Point2 {
        match self {
            Self::Polyline(line) => line.point_at(s),
            Self::Curves(curves) => curves.at(s).position,
        }
    }

    /// Where it ends.
    #[must_use]
    pub fn end(&self) -> Point2 {
        match self {
            Self::Polyline(line) => line.vertices()[line.vertices().len() - 1],
            Self::Curves(curves) => curves.end_pose().position,
        }
    }

    /// The curves, if it has any.
    #[must_use]
    pub fn curves(&self) -> Option<&CurvePath> {
        match self {
            Self::Polyline(_) => None,
            Self::Curves(curves) => Some(curves),
        }
    }

    /// The path as Ferguson curves: its own, or each leg as a straight one.
    #[must_use]
    pub fn segments(&self) -> Vec<FergusonCurve> {
        match self {
            Self::Polyline(line) => line
                .vertices()
                .windows(2)
                .map(|leg| FergusonCurve::straight(leg[0], leg[1]))
                .collect(),
            Self::Curves(curves) => curves.segments().to_vec(),
        }
    }

    /// Points along the path: at most `max_step` (m) apart on curves, the vertices of a polyline.
    ///
    /// At a vertex the heading is that of the leg that begins there, and the curvature is 0, as everywhere between vertices.
    /// A path of one vertex, from a start that is an arrival already, has heading 0.
    #[must_use]
    pub fn sample(&self, max_step: f64) -> Vec<PathPoint> {
        match self {
            Self::Curves(curves) => curves.sample(max_step),
            Self::Polyline(line) => {
                // A path from a start that is an arrival has a vertex and no leg.
                let last_leg = line.segment_count().checked_sub(1);
                line.vertices()
                    .iter()
                    .enumerate()
                    .map(|(i, &position)| PathPoint {
                        position,
                        heading: last_leg.map_or(0.0, |last| line.segment_heading(i.min(last))),
                        curvature: 0.0,
                        s: line.cumulative(i),
                    })
                    .collect()
            }
        }
    }
}

/// Spacing at which a path of this problem shows its curvature, m: 5 % of the smallest turning radius, and of the cell
/// where there is a grid.
#[must_use]
pub fn sampling_step(problem: &PlanningProblem<'_>) -> f64 {
    let radius = 1.0 / problem.max_curvature;
    let cell = problem
        .world
        .grid()
        .map_or(f64::INFINITY, |grid| grid.resolution);
    0.05 * radius.min(cell)
}

/// The answer to one [`plan`](crate::plan).
#[derive(Debug, Clone)]
pub struct PlanReport {
    /// How it ended.
    pub outcome: Outcome,
    /// Why.
    pub reason: Reason,
    /// Which method planned.
    pub method: Method,
    /// The seed it was given.
    pub seed: u64,
    /// Iterations of all stages together. The same problem, parameters and seed with this as the
    /// [budget](crate::Budget::iterations) give the same path bit for bit, also if a clock ended this run.
    pub iterations: u64,
    /// What ended the search before it was done, if anything. With [`Outcome::Found`], a longer budget might find better.
    pub cut_short: Option<CutShort>,
    /// The path, if there is one.
    pub path: Option<PlannedPath>,
    /// Its figures.
    pub metrics: Option<PathMetrics>,
    /// Every stage's product.
    pub stages: Stages,
    /// How it went.
    pub trace: Vec<TraceEntry>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Found in review: asking for the samples of a path of no length panicked.
    #[test]
    fn a_path_of_one_vertex_has_one_sample() {
        let only = Point2::new(2.0, 3.0);
        let path = PlannedPath::Polyline(Polyline::new(vec![only]).unwrap());
        let samples = path.sample(0.1);
        assert_eq!(samples.len(), 1);
        assert_eq!((samples[0].position, samples[0].heading), (only, 0.0));
        assert!(path.segments().is_empty());
    }

    #[test]
    fn a_vertex_has_the_heading_of_the_leg_ahead_and_the_last_that_of_the_leg_behind() {
        let corner = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)].map(|(x, y)| Point2::new(x, y));
        let path = PlannedPath::Polyline(Polyline::new(corner.to_vec()).unwrap());
        let headings: Vec<f64> = path.sample(0.1).iter().map(|p| p.heading).collect();
        let up = std::f64::consts::FRAC_PI_2;
        assert_eq!(headings, [0.0, up, up]);
    }
}
