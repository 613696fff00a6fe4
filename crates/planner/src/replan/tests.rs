//! Blocks appear, vanish and stand beside; the path is ridden on.

use super::*;
use crate::problem::GoalRegion;
use crate::test_scenes::{Scene, block, load, room};
use bikebot_geometry::{ParametricCurve, Point2, Pose2};
use bikebot_world::{Footprint, Obstacle, World, WorldChanges};
use std::sync::OnceLock;

/// Enough for a plan of the yard; counts, not time, so that tests repeat.
const ITERATIONS: u64 = 6000;

fn problem<'w>(
    world: &'w World,
    start: &Pose2,
    goal: &Pose2,
    footprint: Footprint,
) -> PlanningProblem<'w> {
    PlanningProblem {
        world,
        footprint,
        start: EndPose::pose(start.position.x, start.position.y, start.heading),
        goal: GoalRegion {
            position: goal.position,
            heading: Some(goal.heading),
            tolerance: 0.0,
        },
        max_curvature: 1.0,
    }
}

fn planned(problem: &PlanningProblem<'_>) -> CurvePath {
    let report = crate::plan(
        problem,
        &PlannerParams::default(),
        1,
        &Budget::of_iterations(ITERATIONS),
    )
    .unwrap();
    report.path.unwrap().curves().unwrap().clone()
}

/// The yard and a path across it.
fn yard() -> &'static (Scene, CurvePath) {
    static YARD: OnceLock<(Scene, CurvePath)> = OnceLock::new();
    YARD.get_or_init(|| {
        let scene = load("fig6");
        let path = planned(&problem(
            &scene.world,
            &scene.start,
            &scene.goal,
            Footprint::Point,
        ));
        (scene, path)
    })
}

fn yard_problem(world: &World) -> PlanningProblem<'_> {
    let scene = &yard().0;
    problem(world, &scene.start, &scene.goal, Footprint::Point)
}

fn with(world: &World, added: Vec<Obstacle>) -> World {
    world
        .with_changes(&WorldChanges {
            added,
            ..WorldChanges::default()
        })
        .unwrap()
}

fn square(centre: Point2, half: f64) -> Obstacle {
    block(
        centre.x - half,
        centre.y - half,
        centre.x + half,
        centre.y + half,
    )
}

fn ask(
    problem: &PlanningProblem<'_>,
    replanning: &ReplanParams,
    previous: &Previous<'_>,
    seed: u64,
) -> Replan {
    let budget = Budget::of_iterations(ITERATIONS);
    replan(
        problem,
        &PlannerParams::default(),
        replanning,
        previous,
        seed,
        &budget,
    )
    .unwrap()
}

/// Checks what is promised of every new path: it begins like the old one, ends at the goal, and may be ridden.
fn check(problem: &PlanningProblem<'_>, previous: &Previous<'_>, path: &CurvePath) {
    let (old, new) = (previous.curves.at(previous.at), path.at(0.0));
    assert_eq!(old.position, new.position);
    assert!(angle::difference(old.heading, new.heading).abs() < 1e-12);
    let jump = (old.curvature - path.segments()[0].curvature(0.0)).abs();
    assert!(jump < 1e-9, "{jump}");
    assert!(path.max_curvature_jump() < 1e-9);
    assert!(path.max_heading_jump() < 1e-9);
    assert!(path.max_curvature() <= problem.max_curvature);
    assert_eq!(path.end_pose().position, problem.goal.position);
    if let Some(heading) = problem.goal.heading {
        assert!(angle::difference(path.end_pose().heading, heading).abs() < 1e-12);
    }
    // Independent of the motion check.
    for place in path.sample(0.02) {
        let pose = Pose2 {
            position: place.position,
            heading: place.heading,
        };
        assert!(problem.world.footprint_clearance(&problem.footprint, &pose) >= 0.0);
    }
}

#[test]
fn an_unchanged_world_keeps_the_path_from_wherever_it_is_asked() {
    let (scene, path) = yard();
    let problem = yard_problem(&scene.world);
    for k in 0..=50 {
        let at = path.length() * f64::from(k) / 50.0;
        let previous = Previous {
            curves: path,
            now: at,
            at,
        };
        let answer = ask(&problem, &ReplanParams::default(), &previous, 1);
        assert_eq!(answer.decision, Decision::Kept);
        assert!(answer.path.is_none() && answer.iterations == 0);
        assert_eq!(answer.validity.free_until, path.length());
    }
    assert_eq!(remainder(path, 0.0), path.segments());
    let half = CurvePath::new(remainder(path, 0.5 * path.length())).unwrap();
    assert!((half.length() - 0.5 * path.length()).abs() < 1e-6);
    assert!(remainder(path, path.length()).is_empty());
}

#[test]
fn a_block_on_the_path_is_led_around_without_a_jump() {
    let (scene, path) = yard();
    let mut repaired = 0;
    for k in 0..20_u32 {
        // Ahead of the robot by 15 m at least, and off the goal.
        let (now, at) = (
            path.length() * 0.02,
            path.length() * (0.03 + 0.005 * f64::from(k % 5)),
        );
        let on = path.length() * (0.16 + 0.035 * f64::from(k));
        let world = with(&scene.world, vec![square(path.at(on).position, 2.0)]);
        let problem = yard_problem(&world);
        let previous = Previous {
            curves: path,
            now,
            at,
        };
        let answer = ask(&problem, &ReplanParams::default(), &previous, u64::from(k));
        let new = answer
            .path
            .unwrap_or_else(|| panic!("{k}: {:?}", answer.decision));
        check(&problem, &previous, &new);
        match answer.decision {
            Decision::Repaired => repaired += 1,
            Decision::Afresh => {}
            other => panic!("{k}: {other:?}"),
        }
        assert!(answer.cost.is_some() && answer.metrics.unwrap().min_clearance >= 0.0);
    }
    assert!(repaired >= 15, "{repaired}");
}

#[test]
fn an_outline_with_a_heading_is_led_around_too() {
    let scene = load("fig6");
    let whole = problem(&scene.world, &scene.start, &scene.goal, Footprint::bike());
    let path = planned(&whole);
    for k in 0..8_u32 {
        let on = path.length() * (0.2 + 0.08 * f64::from(k));
        let world = with(&scene.world, vec![square(path.at(on).position, 2.0)]);
        let problem = PlanningProblem {
            world: &world,
            ..whole.clone()
        };
        let previous = Previous {
            curves: &path,
            now: 3.0,
            at: 4.0,
        };
        let answer = ask(&problem, &ReplanParams::default(), &previous, u64::from(k));
        let new = answer
            .path
            .unwrap_or_else(|| panic!("{k}: {:?}", answer.decision));
        check(&problem, &previous, &new);
    }
}

/// Where there is room a repair is about as short as planning the whole anew.
#[test]
fn a_repair_is_nearly_as_short_as_a_fresh_plan() {
    let (scene, path) = yard();
    let mut worst: f64 = 0.0;
    for k in 0..6_u32 {
        let on = path.length() * (0.2 + 0.1 * f64::from(k));
        let world = with(&scene.world, vec![square(path.at(on).position, 2.0)]);
        let previous = Previous {
            curves: path,
            now: 1.0,
            at: 2.0,
        };
        let problem = PlanningProblem {
            start: previous.start(),
            ..yard_problem(&world)
        };
        let answer = ask(&problem, &ReplanParams::default(), &previous, 1);
        let fresh = planned(&problem);
        let ratio = answer.path.unwrap().length() / fresh.length();
        worst = worst.max(ratio);
    }
    // Measured: 1.0009. The classes of other ways round are longer by per cents.
    assert!(worst < 1.01, "{worst}");
}

#[test]
fn a_block_beside_the_path_changes_nothing() {
    let (scene, path) = yard();
    let place = path.at(0.5 * path.length());
    let pose = Pose2 {
        position: place.position,
        heading: place.heading,
    };
    let world = with(
        &scene.world,
        vec![square(place.position + pose.left_normal() * 4.0, 1.0)],
    );
    let previous = Previous {
        curves: path,
        now: 1.0,
        at: 2.0,
    };
    let answer = ask(
        &yard_problem(&world),
        &ReplanParams::default(),
        &previous,
        1,
    );
    assert_eq!(answer.decision, Decision::Kept);
}

/// Two rooms, joined by a gap from (10, 9) to (11, 11).
fn rooms() -> World {
    room(
        20.0,
        vec![block(10.0, 0.0, 11.0, 9.0), block(10.0, 11.0, 11.0, 20.0)],
    )
}

#[test]
fn a_closed_gap_is_blocked_and_says_how_far_the_path_is_free() {
    let rooms = rooms();
    let ends = [Pose2::new(2.0, 4.0, 0.0), Pose2::new(18.0, 16.0, 0.0)];
    for footprint in [
        Footprint::Point,
        Footprint::Disc { radius: 0.3 },
        Footprint::bike(),
    ] {
        let path = planned(&problem(&rooms, &ends[0], &ends[1], footprint.clone()));
        let world = with(&rooms, vec![block(10.2, 9.0, 10.8, 11.0)]);
        let problem = problem(&world, &ends[0], &ends[1], footprint);
        let previous = Previous {
            curves: &path,
            now: 0.5,
            at: 1.0,
        };
        let answer = ask(&problem, &ReplanParams::default(), &previous, 3);
        let Decision::Blocked { free_until, why } = answer.decision else {
            panic!("{:?}", answer.decision);
        };
        assert_eq!(why, Blockage::NoPath(Reason::Disconnected));
        // The first contact among samples a millimetre apart.
        let touched = path
            .sample(1e-3)
            .into_iter()
            .find(|place| {
                let pose = Pose2 {
                    position: place.position,
                    heading: place.heading,
                };
                world.footprint_clearance(&problem.footprint, &pose) < 0.0
            })
            .unwrap();
        // Up to a step of the samples, and a hundredth of δ at the pace at which the obstacle comes near: no less than half its own.
        assert!(
            free_until <= touched.s && free_until > touched.s - 2e-3,
            "{free_until} {}",
            touched.s
        );
    }
}

#[test]
fn what_blocks_the_stretch_that_is_ridden_meanwhile_or_the_goal_is_named() {
    let (scene, path) = yard();
    let at = |now: f64, at: f64| Previous {
        curves: path,
        now,
        at,
    };
    let near = with(&scene.world, vec![square(path.at(20.0).position, 1.0)]);
    let why = |world: &World, previous: &Previous<'_>| match ask(
        &yard_problem(world),
        &ReplanParams::default(),
        previous,
        1,
    )
    .decision
    {
        Decision::Blocked { free_until, why } => (free_until, why),
        other => panic!("{other:?}"),
    };
    // Before the place of the take-over, and on it.
    for take_over in [25.0, 20.0] {
        let (free_until, blockage) = why(&near, &at(10.0, take_over));
        assert_eq!(blockage, Blockage::Ahead);
        assert!((18.4..19.1).contains(&free_until), "{free_until}");
    }
    let goal = with(&scene.world, vec![square(scene.goal.position, 1.0)]);
    let (free_until, blockage) = why(&goal, &at(10.0, 11.0));
    assert_eq!(blockage, Blockage::Goal);
    assert!((path.length() - free_until - 1.0).abs() < 0.45);
    // The robot itself stands in it.
    let (free_until, _) = why(&near, &at(20.0, 21.0));
    assert_eq!(free_until, 20.0);
}

#[test]
fn a_place_that_is_not_on_the_path_is_refused() {
    let (scene, path) = yard();
    let problem = yard_problem(&scene.world);
    for (now, at) in [
        (-1.0, 1.0),
        (2.0, 1.0),
        (0.0, 1e9),
        (f64::NAN, 1.0),
        (0.0, f64::NAN),
    ] {
        let previous = Previous {
            curves: path,
            now,
            at,
        };
        let answer = replan(
            &problem,
            &PlannerParams::default(),
            &ReplanParams::default(),
            &previous,
            1,
            &Budget::unlimited(),
        );
        assert!(matches!(answer, Err(PlanError::InvalidParameter { .. })));
    }
}

#[test]
fn a_way_that_opens_is_taken_only_if_it_is_worth_it() {
    // Around a wall that reaches up to `top`, which then is gone.
    for (top, is_worth_it) in [(16.0, true), (9.0, false)] {
        let walled = room(20.0, vec![block(9.5, 0.0, 10.5, top)]);
        let ends = [Pose2::new(2.0, 8.0, 0.5), Pose2::new(18.0, 8.0, -0.5)];
        let path = planned(&problem(&walled, &ends[0], &ends[1], Footprint::Point));
        let open = walled
            .with_changes(&WorldChanges {
                removed: vec![0],
                ..WorldChanges::default()
            })
            .unwrap();
        let problem = problem(&open, &ends[0], &ends[1], Footprint::Point);
        let previous = Previous {
            curves: &path,
            now: 0.3,
            at: 0.6,
        };
        let improve = ReplanParams {
            improve: true,
            ..ReplanParams::default()
        };
        let answer = ask(&problem, &improve, &previous, 1);
        if is_worth_it {
            assert_eq!(answer.decision, Decision::Improved);
            check(&problem, &previous, &answer.path.unwrap());
        } else {
            assert_eq!(answer.decision, Decision::Kept);
        }
        // Unasked, a free path is kept.
        let answer = ask(&problem, &ReplanParams::default(), &previous, 1);
        assert_eq!(answer.decision, Decision::Kept);
    }
}

#[test]
fn a_new_goal_is_planned_for_afresh() {
    let (scene, path) = yard();
    let mut problem = yard_problem(&scene.world);
    problem.goal.position = path.at(0.7 * path.length()).position;
    problem.goal.heading = None;
    let previous = Previous {
        curves: path,
        now: 10.0,
        at: 12.0,
    };
    let answer = ask(&problem, &ReplanParams::default(), &previous, 1);
    assert_eq!(answer.decision, Decision::Afresh);
    check(&problem, &previous, &answer.path.unwrap());
}

#[test]
fn equal_seeds_and_budgets_give_equal_replans_and_budgets_are_kept() {
    let (scene, path) = yard();
    let world = with(
        &scene.world,
        vec![square(path.at(0.5 * path.length()).position, 2.0)],
    );
    let problem = yard_problem(&world);
    let previous = Previous {
        curves: path,
        now: 5.0,
        at: 6.0,
    };
    let ask = |budget: &Budget<'_>| {
        let params = PlannerParams::default();
        replan(
            &problem,
            &params,
            &ReplanParams::default(),
            &previous,
            7,
            budget,
        )
        .unwrap()
    };
    for iterations in [0, 1, 50, 300, 1000, 3000] {
        let budget = Budget::of_iterations(iterations);
        let [a, b] = [
            ask(&budget),
            ask(&Budget {
                threads: 4,
                ..budget
            }),
        ];
        assert_eq!((a.decision, &a.path), (b.decision, &b.path));
        assert!(a.iterations <= iterations);
        assert_eq!(a.iterations, b.iterations);
    }
    let stop = || Some(crate::StopReason::Deadline);
    let stopped = ask(&Budget::until(&stop));
    assert_eq!(stopped.iterations, 0);
    assert!(matches!(
        stopped.decision,
        Decision::Blocked {
            why: Blockage::NoPath(Reason::Deadline),
            ..
        }
    ));
    // What a clock ended can be repeated by its count.
    let asked = std::sync::atomic::AtomicU64::new(0);
    let later = || {
        let count = asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        (count > 40).then_some(crate::StopReason::Deadline)
    };
    let a = ask(&Budget::until(&later));
    let b = ask(&Budget::of_iterations(a.iterations));
    assert_eq!(a.iterations, b.iterations);
    // Which of the two it was is told, if nothing was found.
    assert_eq!(a.path, b.path);
}

/// Rides the yard with blocks of random sizes appearing ahead and replans at once: what is ridden is one smooth curve.
#[test]
fn riding_through_appearing_blocks_never_jumps() {
    let (scene, path) = yard();
    let mut taken = 0;
    for seed in 0..6 {
        let mut chance = crate::chance::Chance::new(seed, crate::chance::Purpose::Rrt, 99);
        let mut world = with(&scene.world, Vec::new());
        let mut path = path.clone();
        let mut now = 0.0;
        for _ in 0..12 {
            let (ahead, half) = (chance.between(12.0, 30.0), chance.between(0.3, 2.0));
            let side = chance.between(-1.5, 1.5);
            let place = path.at(now + ahead);
            let is_far = (place.position - scene.goal.position).norm() > 8.0;
            if is_far {
                let pose = Pose2 {
                    position: place.position,
                    heading: place.heading,
                };
                world = with(
                    &world,
                    vec![square(place.position + pose.left_normal() * side, half)],
                );
            }
            let problem = yard_problem(&world);
            let previous = Previous {
                curves: &path,
                now,
                at: (now + 2.0).min(path.length()),
            };
            let answer = ask(&problem, &ReplanParams::default(), &previous, seed);
            match answer.decision {
                Decision::Kept => {
                    let rest = path.sample(0.02).into_iter().filter(|place| place.s >= now);
                    for place in rest {
                        assert!(world.clearance(place.position) >= -1e-12);
                    }
                    now = (now + chance.between(2.0, 12.0)).min(path.length());
                }
                Decision::Blocked { free_until, .. } => {
                    assert!(free_until >= now);
                    break;
                }
                _ => {
                    let new = answer.path.unwrap();
                    check(&problem, &previous, &new);
                    taken += 1;
                    path = new;
                    now = 0.0;
                }
            }
        }
    }
    assert!(taken >= 12, "{taken}");
}

#[test]
fn a_plan_begins_with_the_curvature_asked_for() {
    let (scene, _) = yard();
    let params = PlannerParams::default();
    for footprint in [Footprint::Point, Footprint::bike()] {
        for curvature in [-0.9, -0.3, 0.0, 0.2, 0.6, 0.95] {
            let mut problem = problem(&scene.world, &scene.start, &scene.goal, footprint.clone());
            problem.start = problem.start.with_curvature(curvature);
            let report =
                crate::plan(&problem, &params, 1, &Budget::of_iterations(ITERATIONS)).unwrap();
            let path = report.path.unwrap();
            let path = path.curves().unwrap();
            let begins = path.segments()[0].curvature(0.0);
            assert!((begins - curvature).abs() < 1e-9, "{begins}");
            assert!(path.max_curvature() <= problem.max_curvature);
            assert!(path.max_curvature_jump() < 1e-9);
        }
    }
}
