//! The rapidly-exploring random tree (LaValle & Kuffner 2001), the plain row of Table 2.
//!
//! No goal bias, as in the paper: every sample is uniform over the field, and the search ends when a
//! node falls into the goal.

use crate::budget::Meter;
use crate::chance::Chance;
use crate::connectivity::Doubt;
use crate::point_tree::PointTree;
use crate::search::{PointQuery, PointSearch, next_sample};
use crate::steer::steer;

/// Grows a tree from the start until a node arrives.
pub fn search(
    query: &PointQuery<'_, '_>,
    chance: &mut Chance,
    meter: &mut Meter<'_>,
) -> PointSearch {
    let mut tree = PointTree::new(query.start);
    let mut doubt = Doubt::of(query);
    let mut result = PointSearch::default();
    if query.is_arrival(query.start) {
        result.path = Some(vec![query.start]);
        return result;
    }
    while next_sample(&mut result.samples, query.max_samples, meter) {
        let sample = query.sample(chance);
        let nearest = tree.nearest(sample);
        let from = tree.position(nearest);
        let new = steer(from, sample, query.max_step);
        if query.checker.is_segment_free(from, new) {
            let node = tree.add(nearest, new);
            result.path = tree.arrival(node, query);
            if result.path.is_some() {
                break;
            }
        }
        if doubt.settles(query, result.samples, meter) {
            result.disconnected = true;
            break;
        }
    }
    result.edges = tree.edges().collect();
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::chance::Purpose;
    use crate::motion::MotionChecker;
    use crate::params::GoalMode;
    use crate::test_scenes::{block, load, room};
    use bikebot_geometry::Point2;
    use bikebot_world::{Footprint, World};

    fn run(world: &World, goal: Point2, goal_mode: GoalMode, seed: u64) -> PointSearch {
        let checker = MotionChecker::new(world, &Footprint::Point, 0.0, 0.02);
        let query = PointQuery {
            checker: &checker,
            start: Point2::new(8.0, 8.0),
            goal,
            goal_mode,
            tolerance: 3.0,
            max_step: 5.0,
            max_samples: 100_000,
            shorter_than: f64::INFINITY,
        };
        let mut chance = Chance::new(seed, Purpose::Rrt, 0);
        search(&query, &mut chance, &mut Meter::new(&Budget::unlimited()))
    }

    #[test]
    fn arrives_in_the_ball_or_at_the_goal_over_edges_of_its_tree() {
        let scene = load("fig6");
        let goal = scene.goal.position;
        for seed in 0..5 {
            let ball = run(&scene.world, goal, GoalMode::Ball, seed);
            let path = ball.path.expect("the yard is connected");
            assert!((path[path.len() - 1] - goal).norm() <= 3.0);
            for leg in path.windows(2) {
                assert!((leg[1] - leg[0]).norm() <= 5.0 + 1e-12);
                assert!(ball.edges.contains(&[leg[0], leg[1]]));
            }
            let exact = run(&scene.world, goal, GoalMode::Pose, seed);
            assert_eq!(
                exact.path.expect("the yard is connected").last(),
                Some(&goal)
            );
        }
    }

    #[test]
    fn gives_up_at_once_on_a_closed_room() {
        let world = room(
            100.0,
            vec![
                block(60.0, 60.0, 95.0, 62.0),
                block(60.0, 93.0, 95.0, 95.0),
                block(60.0, 60.0, 62.0, 95.0),
                block(93.0, 60.0, 95.0, 95.0),
            ],
        );
        let closed = run(&world, Point2::new(80.0, 80.0), GoalMode::Ball, 1);
        assert!(closed.disconnected && closed.path.is_none());
        assert!(closed.samples < 5000, "{}", closed.samples);
    }

    #[test]
    fn a_start_in_the_ball_has_arrived() {
        let world = room(20.0, vec![]);
        let there = run(&world, Point2::new(8.5, 8.5), GoalMode::Ball, 1);
        assert_eq!(there.path, Some(vec![Point2::new(8.0, 8.0)]));
    }
}
