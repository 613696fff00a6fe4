//! What the searches over positions (RRT, RRT*, BiRRT) are given and what they give back.

use crate::budget::Meter;
use crate::chance::Chance;
use crate::motion::MotionChecker;
use crate::params::GoalMode;
use bikebot_geometry::{Point2, Vector2};

/// Draws for one point of an ellipse; a field that holds so little of it is sampled as a whole.
const ELLIPSE_DRAWS: u32 = 64;

/// A question to a search that ignores heading and curvature.
#[derive(Debug, Clone, Copy)]
pub struct PointQuery<'c, 'w> {
    /// Decides which straight motions are free. For any footprint but a point or a disc, give the
    /// [inscribed](MotionChecker::inscribed) one: there is no heading here to turn an outline to.
    pub checker: &'c MotionChecker<'w>,
    /// x_init, m.
    pub start: Point2,
    /// x_goal, m.
    pub goal: Point2,
    /// Whether the path may end in the ball about the goal, or at the goal only.
    pub goal_mode: GoalMode,
    /// Radius of the ball, l, m.
    pub tolerance: f64,
    /// Longest edge, ε, m.
    pub max_step: f64,
    /// Most samples to draw.
    pub max_samples: u64,
    /// Only points on ways from start to goal shorter than this are of interest, m (Gammell, Srinivasa & Barfoot 2014);
    /// infinite if all are.
    pub shorter_than: f64,
}

impl PointQuery<'_, '_> {
    /// Whether a path may end at `position`.
    #[must_use]
    pub fn is_arrival(&self, position: Point2) -> bool {
        match self.goal_mode {
            GoalMode::Ball => (position - self.goal).norm() <= self.tolerance,
            GoalMode::Pose => position == self.goal,
        }
    }

    /// Whether a new node at `position` can be joined to the goal by one more edge.
    pub(crate) fn reaches_goal(&self, position: Point2) -> bool {
        self.goal_mode == GoalMode::Pose
            && (position - self.goal).norm() <= self.max_step
            && self.checker.is_segment_free(position, self.goal)
    }

    /// A position uniform over the part of the field that is of interest: all of it, or what of it lies in the ellipse about
    /// start and goal whose points are on ways of the length given.
    pub(crate) fn sample(&self, chance: &mut Chance) -> Point2 {
        let bounds = self.checker.world().bounds();
        let between = self.goal - self.start;
        let distance = between.norm();
        let length = self.shorter_than.max(distance);
        if length.is_infinite() || distance <= 0.0 {
            return chance.point_in(bounds.min, bounds.max);
        }
        let along = between * (0.5 * length / distance);
        let minor = 0.5 * (length * length - distance * distance).sqrt();
        let across = Vector2::new(-between.y, between.x) * (minor / distance);
        let middle = self.start + between * 0.5;
        for _ in 0..ELLIPSE_DRAWS {
            let unit = chance.point_in(Point2::new(-1.0, -1.0), Point2::new(1.0, 1.0));
            let p = middle + along * unit.x + across * unit.y;
            if unit.coords.norm_squared() <= 1.0 && self.checker.world().is_inside(p) {
                return p;
            }
        }
        chance.point_in(bounds.min, bounds.max)
    }
}

/// What a search over positions came to.
#[derive(Debug, Clone, Default)]
pub struct PointSearch {
    /// The path's vertices from start to arrival, if one was found.
    pub path: Option<Vec<Point2>>,
    /// Every edge of every tree, parent first.
    pub edges: Vec<[Point2; 2]>,
    /// Whether it is proven that there is no path.
    pub disconnected: bool,
    /// Samples drawn.
    pub samples: u64,
}

/// Counts the samples of one search against its own cap and against the budget of the whole plan.
pub(crate) fn next_sample(drawn: &mut u64, most: u64, meter: &mut Meter<'_>) -> bool {
    if *drawn >= most || !meter.step() {
        return false;
    }
    *drawn += 1;
    true
}
