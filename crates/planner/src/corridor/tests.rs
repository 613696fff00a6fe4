use super::*;
use crate::birrt;
use crate::budget::Budget;
use crate::chance::Purpose;
use crate::params::{Errata, TangentRule};
use crate::problem::{EndPose, GoalRegion};
use crate::search::PointQuery;
use crate::shortcut;
use crate::test_scenes::{Scene, block, load, room};
use bikebot_geometry::{CurvePath, ParametricCurve};
use bikebot_world::Footprint;

fn problem<'w>(
    scene: &'w Scene,
    footprint: Footprint,
    params: &PlannerParams,
) -> PlanningProblem<'w> {
    let Pose2 { position, heading } = scene.goal;
    PlanningProblem {
        world: &scene.world,
        footprint,
        start: EndPose {
            position: scene.start.position,
            heading: Some(scene.start.heading),
            curvature: None,
        },
        goal: GoalRegion {
            position,
            heading: Some(heading),
            tolerance: params.table_goal_tolerance(),
        },
        max_curvature: params.max_curvature,
    }
}

/// Lines 1–38 with one guide, or as many as the parameters allow.
fn plan(problem: &PlanningProblem<'_>, params: &PlannerParams, seed: u64) -> CorridorSearch {
    let budget = Budget::unlimited();
    let mut meter = Meter::new(&budget);
    let delta = params.clearance_resolution();
    let motion = MotionChecker::new(problem.world, &problem.footprint, params.margin, delta);
    let discs = motion.inscribed();
    let query = PointQuery {
        checker: &discs,
        start: problem.start.position,
        goal: problem.goal.position,
        goal_mode: GoalMode::Pose,
        tolerance: 0.0,
        max_step: params.max_step(),
        max_samples: params.search_iterations,
        shorter_than: f64::INFINITY,
    };
    let mut start = 0;
    loop {
        let chance = |purpose| Chance::new(seed, purpose, start);
        let coarse = birrt::search(
            &query,
            params.birrt_connect,
            &mut chance(Purpose::Birrt),
            &mut meter,
        );
        let mut guide = coarse.path.unwrap();
        shortcut::apply(
            &mut guide,
            params.shortcut_attempts,
            &discs,
            &mut chance(Purpose::Shortcut),
            &mut meter,
        );
        let found = search(
            problem,
            params,
            &motion,
            &Polyline::new(guide).unwrap(),
            &mut chance(Purpose::Corridor),
            &mut meter,
            &mut |_| {},
        );
        start += 1;
        if found.path.is_some() || start == params.guides {
            return found;
        }
    }
}

/// Looks at the path every 2 mm: no contact, no curvature above the limit, no gap, no kink; returns it.
fn examined(problem: &PlanningProblem<'_>, found: &CorridorSearch) -> CurvePath {
    let path = CurvePath::new(found.path.clone().unwrap()).unwrap();
    assert_eq!(path.start_pose().position, problem.start.position);
    assert!(path.max_heading_jump() < 1e-9);
    for curve in path.segments() {
        let steps = (curve.length() / 0.002).ceil();
        for i in 0..=steps as usize {
            let t = i as f64 / steps;
            // Rounding of two formulas for one number.
            assert!(curve.curvature(t).abs() <= problem.max_curvature * (1.0 + 1e-9));
            let position = curve.point(t);
            let pose = Pose2 {
                position,
                heading: curve.heading(t),
            };
            assert!(problem.world.footprint_clearance(&problem.footprint, &pose) > 0.0);
        }
    }
    path
}

/// Mean length over twenty seeds, every path found and examined.
fn mean_length(problem: &PlanningProblem<'_>, params: &PlannerParams) -> f64 {
    let total: f64 = (0..20)
        .map(|seed| {
            let found = plan(problem, params, seed);
            assert!(found.path.is_some(), "seed {seed} found nothing");
            let path = examined(problem, &found);
            if params.goal == GoalMode::Pose {
                let end = path.end_pose();
                assert_eq!(end.position, problem.goal.position);
                let heading = problem.goal.heading.unwrap();
                assert!(angle::difference(end.heading, heading).abs() < 1e-9);
            } else {
                assert!(problem.goal.contains(path.end_pose().position));
            }
            path.length()
        })
        .sum();
    total / 20.0
}

#[test]
fn the_yard_is_crossed_into_the_ball_as_in_table_2() {
    let (scene, params) = (load("fig6"), PlannerParams::table_1());
    let mean = mean_length(&problem(&scene, Footprint::Point, &params), &params);
    assert!(mean < 181.5, "{mean}");
}

#[test]
fn the_yard_is_crossed_to_the_goal_pose() {
    let params = PlannerParams {
        goal: GoalMode::Pose,
        ..PlannerParams::table_1()
    };
    let scene = load("fig6");
    let mean = mean_length(&problem(&scene, Footprint::Point, &params), &params);
    assert!(mean < 184.5, "{mean}");
}

#[test]
fn to_the_letter_nothing_is_found() {
    let scene = load("fig6");
    let row_1 = Errata {
        curves_run_from_parent_to_child: true,
        ..Errata::as_printed()
    };
    let rows_1_and_2 = Errata {
        continuous_heading_prior: true,
        ..row_1.clone()
    };
    for errata in [Errata::as_printed(), row_1, rows_1_and_2] {
        let params = PlannerParams {
            errata,
            ..PlannerParams::literal()
        };
        let problem = problem(&scene, Footprint::Point, &params);
        for seed in 0..20 {
            assert!(plan(&problem, &params, seed).path.is_none());
        }
    }
}

#[test]
fn tangents_as_long_as_the_chord_are_what_repairs_it() {
    let scene = load("fig6");
    let params = PlannerParams {
        tangent: TangentRule::Chord,
        errata: Errata {
            curves_run_from_parent_to_child: true,
            continuous_heading_prior: true,
            ..Errata::as_printed()
        },
        ..PlannerParams::literal()
    };
    let problem = problem(&scene, Footprint::Point, &params);
    for seed in 0..5 {
        let found = plan(&problem, &params, seed);
        examined(&problem, &found);
        // The first arrival ends it.
        assert_eq!(found.improvements.len(), 1);
        assert!(found.iterations < params.iterations);
    }
}

#[test]
fn the_bike_rides_through_the_arena_to_the_goal_pose() {
    let params = PlannerParams {
        scale: 0.4,
        max_curvature: 0.8,
        ..PlannerParams::default()
    };
    let scene = load("fig7-ride");
    let bike = Footprint::bike().grown(0.12);
    let mean = mean_length(&problem(&scene, bike, &params), &params);
    // About 10.3 m is known to be possible; some guides take the longer way round.
    assert!(mean < 11.5, "{mean}");
}

#[test]
fn the_bike_rides_across_the_yard() {
    let params = PlannerParams {
        max_curvature: 0.8,
        ..PlannerParams::default()
    };
    let scene = load("fig6");
    let bike = Footprint::bike().grown(0.12);
    let mean = mean_length(&problem(&scene, bike, &params), &params);
    assert!(mean < 190.0, "{mean}");
}

fn yard_run(params: &PlannerParams, seed: u64) -> CorridorSearch {
    let scene = load("fig6");
    plan(&problem(&scene, Footprint::Point, params), params, seed)
}

#[test]
fn equal_seeds_give_equal_paths_and_others_do_not() {
    let params = PlannerParams::table_1();
    let (a, b, c) = (
        yard_run(&params, 3),
        yard_run(&params, 3),
        yard_run(&params, 4),
    );
    assert_eq!((a.path.clone(), a.cost, a.edges), (b.path, b.cost, b.edges));
    assert_ne!(a.path, c.path);
}

#[test]
fn the_cost_of_the_path_is_that_of_its_edges_and_only_falls() {
    let params = PlannerParams::table_1();
    let found = yard_run(&params, 1);
    let scene = load("fig6");
    let problem = problem(&scene, Footprint::Point, &params);
    let motion = MotionChecker::new(problem.world, &problem.footprint, 0.0, 0.02);
    let connector = Connector::new(&params, 1.0, &motion);
    let sum: f64 = found
        .path
        .unwrap()
        .iter()
        .map(|curve| connector.judge(*curve, f64::INFINITY).unwrap().cost)
        .sum();
    assert!((sum - found.cost).abs() < 1e-9);
    assert!(found.improvements.len() > 10);
    for pair in found.improvements.windows(2) {
        assert!(pair[1].cost < pair[0].cost && pair[1].iteration >= pair[0].iteration);
    }
    assert_eq!(
        found.improvements[found.improvements.len() - 1].cost,
        found.cost
    );
}

#[test]
fn every_edge_of_the_tree_keeps_the_limit() {
    let found = yard_run(&PlannerParams::table_1(), 2);
    assert!(found.edges.len() > 500);
    assert!(
        found
            .edges
            .iter()
            .all(|edge| edge.max_curvature() <= 1.0 + 1e-12)
    );
}

#[test]
fn edges_made_again_join_the_poses_of_the_tree() {
    for params in [
        PlannerParams::table_1(),
        PlannerParams::default(),
        PlannerParams {
            tangent: TangentRule::Chord,
            errata: Errata {
                continuous_heading_prior: true,
                ..Errata::as_printed()
            },
            ..PlannerParams::literal()
        },
    ] {
        let found = yard_run(
            &PlannerParams {
                footprint: "point".to_owned(),
                guides: 1,
                ..params
            },
            5,
        );
        let mut ends: Vec<_> = found
            .edges
            .iter()
            .map(|e| e.end_point().coords.map(f64::to_bits))
            .collect();
        ends.push(Point2::new(8.0, 8.0).coords.map(f64::to_bits));
        for edge in &found.edges {
            let start = edge.start_point().coords.map(f64::to_bits);
            assert!(ends.contains(&start), "an edge that hangs nowhere");
        }
    }
}

/// A room with one block in the middle, the guide round its left side.
fn small(
    params: &PlannerParams,
    start: EndPose,
    goal: EndPose,
    budget: &Budget<'_>,
) -> CorridorSearch {
    let world = room(20.0, vec![block(8.0, 0.0, 12.0, 10.0)]);
    let problem = PlanningProblem {
        world: &world,
        footprint: Footprint::bike(),
        start,
        goal: GoalRegion {
            position: goal.position,
            heading: goal.heading,
            tolerance: 1.0,
        },
        max_curvature: 0.8,
    };
    let motion = MotionChecker::new(&world, &problem.footprint, 0.0, 0.02);
    let guide = Polyline::new(vec![
        start.position,
        Point2::new(7.4, 11.0),
        Point2::new(12.6, 11.0),
        goal.position,
    ])
    .unwrap();
    let mut chance = Chance::new(1, Purpose::Corridor, 0);
    let mut meter = Meter::new(budget);
    let found = search(
        &problem,
        params,
        &motion,
        &guide,
        &mut chance,
        &mut meter,
        &mut |_| {},
    );
    if found.path.as_ref().is_some_and(|path| !path.is_empty()) {
        examined(&problem, &found);
    }
    found
}

#[test]
fn ends_without_headings_are_reached_with_any() {
    let (start, goal) = (EndPose::point(3.0, 3.0), EndPose::point(17.0, 3.0));
    let found = small(&PlannerParams::default(), start, goal, &Budget::unlimited());
    let path = CurvePath::new(found.path.unwrap()).unwrap();
    assert_eq!(path.end_pose().position, goal.position);
}

#[test]
fn ends_against_the_guide_are_turned_into() {
    // Looking away from the guide at both ends.
    let start = EndPose::pose(3.0, 5.0, -2.0);
    let goal = EndPose::pose(16.0, 4.0, 2.0);
    let found = small(&PlannerParams::default(), start, goal, &Budget::unlimited());
    let path = CurvePath::new(found.path.unwrap()).unwrap();
    assert!(angle::difference(path.start_pose().heading, -2.0).abs() < 1e-9);
    assert!(angle::difference(path.end_pose().heading, 2.0).abs() < 1e-9);
}

#[test]
fn a_budget_ends_the_search_with_what_there_is() {
    let (start, goal) = (EndPose::pose(3.0, 3.0, 1.0), EndPose::pose(17.0, 3.0, -1.0));
    let run = |n| {
        small(
            &PlannerParams::default(),
            start,
            goal,
            &Budget::of_iterations(n),
        )
    };
    assert!(run(0).path.is_none());
    let (short, long) = (run(600), run(3000));
    // Two were spent on looking for a place to join the arcs, one at each end.
    assert_eq!((short.iterations, long.iterations), (598, 2998));
    // The longer run passes through the shorter one.
    assert_eq!(
        short.improvements[..],
        long.improvements[..short.improvements.len()]
    );
    assert!(long.cost <= short.cost);
}

#[test]
fn a_start_that_has_arrived_needs_no_curve() {
    let start = EndPose::pose(3.0, 3.0, 1.0);
    let budget = Budget::unlimited();
    let found = small(&PlannerParams::default(), start, start, &budget);
    assert_eq!(
        (found.path, found.cost, found.iterations),
        (Some(vec![]), 0.0, 0)
    );
    let ball = PlannerParams::table_1();
    let found = small(&ball, start, EndPose::point(3.5, 3.0), &budget);
    assert_eq!(found.path, Some(vec![]));
    // Facing the other way there is a circle to ride.
    let turned = EndPose::pose(3.0, 3.0, -2.0);
    let found = small(&PlannerParams::default(), start, turned, &budget);
    assert!(found.cost > 0.0);
}

#[test]
fn a_shrinking_radius_finds_a_path_too() {
    let params = PlannerParams {
        rewire_radius_shrinks: true,
        ..PlannerParams::table_1()
    };
    assert!(yard_run(&params, 0).path.is_some());
}
