//! Both ends of a corridor search: how its tree begins, and where a path may enter the goal.
//!
//! An end whose heading is prescribed is joined to the guide by an arc ([`crate::end_arcs`], D11). At the start the arc becomes the
//! first branch of the tree. At the goal each of its joints is a place to enter, from where the rest of the path and its
//! cost are known.

use crate::budget::Meter;
use crate::connection::{Connection, Connector, DirectedPose};
use crate::end_arcs::{self, EndArc, GuideEnd};
use crate::motion::MotionChecker;
use crate::params::{GoalMode, PlannerParams};
use crate::problem::PlanningProblem;
use bikebot_geometry::{FergusonCurve, Point2, Polyline, Pose2, angle};

/// A place from where the rest of the path is known: the goal, or a pose on the arc that leads to it.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub(crate) position: Point2,
    /// `None` at a goal that takes any heading.
    pub(crate) pose: Option<DirectedPose>,
    /// Curves from here to the goal.
    pub(crate) rest: Vec<FergusonCurve>,
    pub(crate) cost_to_go: f64,
}

/// Both ends of the search: how the tree starts, and where it may enter.
#[derive(Debug)]
pub(crate) struct Ends {
    /// The guide given, its ends bent onto the prescribed headings.
    pub(crate) guide: Polyline,
    /// Where the tree starts.
    pub(crate) root: DirectedPose,
    /// Curves from the root along the arc onto the guide.
    pub(crate) trunk: Vec<Connection>,
    /// Where a path may enter the goal; the goal itself comes first.
    pub(crate) entries: Vec<Entry>,
}

impl Ends {
    pub(crate) fn new(
        problem: &PlanningProblem<'_>,
        params: &PlannerParams,
        guide: &Polyline,
        connector: &Connector<'_>,
        meter: &mut Meter<'_>,
    ) -> Self {
        let first_heading = guide.heading_at(0.0);
        let motion = connector.motion();
        let root = Pose2 {
            position: problem.start.position,
            heading: problem
                .start
                .heading
                .unwrap_or_else(|| free_heading(motion, problem.start.position, first_heading)),
        };
        let goal_heading = match params.goal {
            GoalMode::Pose => problem.goal.heading,
            GoalMode::Ball => None,
        };
        let mut arc = |guide_end, pose: Pose2| {
            end_arcs::find(
                guide,
                guide_end,
                &pose,
                problem.max_curvature,
                params.max_step(),
                &|curve| connector.judge(*curve, f64::INFINITY).is_some(),
                meter,
            )
        };
        let start_arc = problem
            .start
            .heading
            .filter(|_| params.end_arcs)
            .and_then(|_| arc(GuideEnd::Start, root));
        let goal_arc = goal_heading
            .filter(|_| params.end_arcs)
            .and_then(|heading| {
                let position = problem.goal.position;
                arc(GuideEnd::Goal, Pose2 { position, heading })
            });
        // On a short guide the two arcs may overlap. Then the goal's is not used to bend the guide,
        // but remains as a place to enter.
        let bent = match (&start_arc, &goal_arc) {
            (Some(a), Some(b)) if b.joint < a.joint => end_arcs::bend_guide(guide, Some(a), None),
            (a, b) => end_arcs::bend_guide(guide, a.as_ref(), b.as_ref()),
        };
        let judge = |curve: &FergusonCurve| connector.judge(*curve, f64::INFINITY);
        let trunk = start_arc
            .iter()
            .flat_map(|arc| arc.curves.iter().filter_map(judge))
            .collect();
        Self {
            guide: bent,
            root: root.into(),
            trunk,
            entries: entries(problem, goal_heading, goal_arc, &judge),
        }
    }
}

/// The goal, and each joint of the arc that leads to it.
fn entries(
    problem: &PlanningProblem<'_>,
    goal_heading: Option<f64>,
    arc: Option<EndArc>,
    judge: &dyn Fn(&FergusonCurve) -> Option<Connection>,
) -> Vec<Entry> {
    let position = problem.goal.position;
    let mut entries = vec![Entry {
        position,
        pose: goal_heading.map(|heading| Pose2 { position, heading }.into()),
        rest: Vec::new(),
        cost_to_go: 0.0,
    }];
    let curves = arc.map_or_else(Vec::new, |arc| arc.curves);
    let mut cost_to_go = 0.0;
    for (i, curve) in curves.iter().enumerate().rev() {
        let Some(connection) = judge(curve) else {
            break;
        };
        cost_to_go += connection.cost;
        entries.push(Entry {
            position: curve.start_point(),
            pose: Some(curve.start_pose().into()),
            rest: curves[i..].to_vec(),
            cost_to_go,
        });
    }
    entries
}

/// A heading for an end that takes any: the one asked for, or the nearest to it at which the footprint is free.
fn free_heading(motion: &MotionChecker<'_>, position: Point2, wanted: f64) -> f64 {
    // Every 10° to either side, nearest first.
    (0..=18)
        .flat_map(|k| [f64::from(k), -f64::from(k)])
        .map(|k| angle::wrap(wanted + (10.0 * k).to_radians()))
        .find(|&heading| motion.is_pose_free(&Pose2 { position, heading }))
        .unwrap_or(wanted)
}
