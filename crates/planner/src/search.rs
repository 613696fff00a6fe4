//! What the searches over positions (RRT, RRT*, BiRRT) are given and what they give back.

use crate::budget::Meter;
use crate::chance::Chance;
use crate::motion::MotionChecker;
use crate::params::GoalMode;
use bikebot_geometry::Point2;

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

    /// A position uniform over the field.
    pub(crate) fn sample(&self, chance: &mut Chance) -> Point2 {
        let bounds = self.checker.world().bounds();
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
