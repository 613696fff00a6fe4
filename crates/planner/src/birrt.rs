//! Bidirectional RRT, lines 1–4 of Algorithm 1: one tree from the start, one from the goal.
//!
//! One tree takes a step towards a uniform sample, the other a step (or, with `connect`, as many as it can: RRT-Connect,
//! Kuffner & LaValle 2000) towards the new node; then they change roles.

use crate::budget::Meter;
use crate::chance::Chance;
use crate::connectivity::Doubt;
use crate::point_tree::PointTree;
use crate::search::{PointQuery, PointSearch, next_sample};
use crate::steer::steer;
use crate::tree::NodeId;
use bikebot_geometry::Point2;

/// What came of growing a tree towards a point (LaValle's words).
enum Growth {
    Trapped,
    Advanced(NodeId),
    Reached(NodeId),
}

/// Grows two trees until they meet; the straight line from start to goal is tried first.
///
/// The path always ends at the goal itself, whatever the query's goal mode.
pub fn search(
    query: &PointQuery<'_, '_>,
    connect: bool,
    chance: &mut Chance,
    meter: &mut Meter<'_>,
) -> PointSearch {
    let mut result = PointSearch::default();
    if query.checker.is_segment_free(query.start, query.goal) {
        result.path = Some(vec![query.start, query.goal]);
        result.edges = vec![[query.start, query.goal]];
        return result;
    }
    let mut doubt = Doubt::of(query);
    // `trees[0]` is rooted at the start. `active` is the one that grows towards samples.
    let mut trees = [PointTree::new(query.start), PointTree::new(query.goal)];
    let mut active = 0;
    // Further steps of RRT-Connect. They are no samples, but with steps far too short for the field they would not end.
    let mut extensions = 0;
    while next_sample(&mut result.samples, query.max_samples, meter) {
        let sample = query.sample(chance);
        let grown = extend(&mut trees[active], sample, query);
        if let Growth::Advanced(node) | Growth::Reached(node) = grown {
            let target = trees[active].position(node);
            let other = &mut trees[1 - active];
            let mut growth = extend(other, target, query);
            while connect
                && matches!(growth, Growth::Advanced(_))
                && extensions < query.max_samples
                && meter.step()
            {
                growth = extend(other, target, query);
                extensions += 1;
            }
            if let Growth::Reached(meeting) = growth {
                let ends = if active == 0 {
                    [node, meeting]
                } else {
                    [meeting, node]
                };
                result.path = Some(join(&trees, ends));
                break;
            }
        }
        active = 1 - active;
        // Where a way is known already there is nothing to doubt.
        if query.shorter_than.is_infinite() && doubt.settles(query, result.samples, meter) {
            result.disconnected = true;
            break;
        }
    }
    result.edges = trees.iter().flat_map(PointTree::edges).collect();
    result
}

/// One step of at most ε from the nearest node towards `target`.
fn extend(tree: &mut PointTree, target: Point2, query: &PointQuery<'_, '_>) -> Growth {
    let nearest = tree.nearest(target);
    let from = tree.position(nearest);
    if from == target {
        return Growth::Reached(nearest);
    }
    let new = steer(from, target, query.max_step);
    if !query.checker.is_segment_free(from, new) {
        return Growth::Trapped;
    }
    let node = tree.add(nearest, new);
    if new == target {
        Growth::Reached(node)
    } else {
        Growth::Advanced(node)
    }
}

/// Start to meeting point in the first tree, meeting point to goal in the second.
fn join(trees: &[PointTree; 2], [from_start, from_goal]: [NodeId; 2]) -> Vec<Point2> {
    let mut path = trees[0].path_to(from_start);
    let mut back = trees[1].path_to(from_goal);
    // Both end at the meeting point.
    back.pop();
    path.extend(back.into_iter().rev());
    path
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::chance::Purpose;
    use crate::motion::MotionChecker;
    use crate::params::GoalMode;
    use crate::test_scenes::{Scene, load, room};
    use bikebot_world::Footprint;

    fn run(scene: &Scene, connect: bool, seed: u64, budget: &Budget<'_>) -> (PointSearch, u64) {
        let checker = MotionChecker::new(&scene.world, &Footprint::Point, 0.0, 0.02);
        let query = PointQuery {
            checker: &checker,
            start: scene.start.position,
            goal: scene.goal.position,
            goal_mode: GoalMode::Pose,
            tolerance: 0.0,
            max_step: 5.0,
            max_samples: 100_000,
            shorter_than: f64::INFINITY,
        };
        let mut chance = Chance::new(seed, Purpose::Birrt, 0);
        let mut meter = Meter::new(budget);
        let found = search(&query, connect, &mut chance, &mut meter);
        (found, meter.iterations())
    }

    #[test]
    fn joins_start_and_goal_by_free_edges_of_at_most_one_step() {
        for name in ["fig6", "maze"] {
            let scene = load(name);
            let checker = MotionChecker::new(&scene.world, &Footprint::Point, 0.0, 0.02);
            for (seed, connect) in (0..10).flat_map(|seed| [(seed, false), (seed, true)]) {
                let path = run(&scene, connect, seed, &Budget::unlimited())
                    .0
                    .path
                    .unwrap();
                assert_eq!(path[0], scene.start.position);
                assert_eq!(path[path.len() - 1], scene.goal.position);
                for leg in path.windows(2) {
                    let length = (leg[1] - leg[0]).norm();
                    assert!(length > 0.0 && length <= 5.0 + 1e-12);
                    assert!(checker.is_segment_free(leg[0], leg[1]));
                }
            }
        }
    }

    #[test]
    fn takes_the_straight_line_where_it_is_free() {
        let scene = Scene {
            world: room(100.0, vec![]),
            ..load("fig6")
        };
        let (found, iterations) = run(&scene, false, 1, &Budget::unlimited());
        assert_eq!(found.path.map(|p| p.len()), Some(2));
        assert_eq!(iterations, 0);
    }

    #[test]
    fn stops_at_its_budget_in_either_variant() {
        let scene = load("fig6");
        for connect in [false, true] {
            let (found, iterations) = run(&scene, connect, 1, &Budget::of_iterations(20));
            assert!(found.path.is_none() && !found.edges.is_empty());
            assert_eq!(iterations, 20);
        }
    }
}
