//! Claim: the time column of Table 2. The paper prints 1.41 s for its planner; ours takes about 18 ms on the yard with
//! n = 3000, BiRRT at most 0.3 ms.
//!
//! The baseline, measured in the same run, is RRT as textbooks write it: nearest by linear scan, motions sampled every
//! 10 cm. The row `rrt` is the same algorithm on our furniture. The map is prepared beforehand, as for a second query.

use std::hint::black_box;

use bikebot_geometry::Point2;
use bikebot_planner::chance::{Chance, Purpose};
use bikebot_planner::{
    Budget, EndPose, GoalMode, GoalRegion, Method, Outcome, PlannerParams, PlanningProblem, plan,
};
use bikebot_world::formats::{LoadedMap, MapOptions, load};
use bikebot_world::{Footprint, World};
use criterion::{Criterion, criterion_group, criterion_main};

fn scene(name: &str) -> LoadedMap {
    let path = format!("{}/scenarios/maps/{name}.json", env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(&path).expect("the scenes are part of the repository");
    load(&path, &bytes, &MapOptions::default(), &mut |name| {
        Err(name.to_owned())
    })
    .expect("a scene that can be read")
}

fn problem<'w>(scene: &'w LoadedMap, params: &PlannerParams) -> PlanningProblem<'w> {
    let (start, goal) = (scene.start.expect("a start"), scene.goal.expect("a goal"));
    PlanningProblem {
        world: &scene.world,
        footprint: params.parse_footprint().expect("a footprint"),
        start: EndPose {
            position: start.position,
            heading: start.heading,
            curvature: None,
        },
        goal: GoalRegion {
            position: goal.position,
            heading: goal.heading,
            tolerance: params.table_goal_tolerance(),
        },
        max_curvature: params.max_curvature,
    }
}

/// The textbook's RRT with a step of 5 m, to within 3 m of the goal: the number of nodes.
fn textbook_rrt(world: &World, start: Point2, goal: Point2, seed: u64) -> usize {
    let mut chance = Chance::new(seed, Purpose::Rrt, 0);
    let bounds = world.bounds();
    let mut nodes = vec![start];
    loop {
        let sample = chance.point_in(bounds.min, bounds.max);
        let mut nearest = (f64::INFINITY, start);
        for node in &nodes {
            let distance = (sample - node).norm();
            if distance < nearest.0 {
                nearest = (distance, *node);
            }
        }
        let from = nearest.1;
        let way = (sample - from) * (5.0 / nearest.0).min(1.0);
        let steps = (way.norm() / 0.1).ceil();
        if (1..=steps as usize).all(|i| world.clearance(from + way * (i as f64 / steps)) > 0.0) {
            nodes.push(from + way);
            if (from + way - goal).norm() <= 3.0 {
                return nodes.len();
            }
        }
    }
}

fn rows(c: &mut Criterion) {
    let yard = scene("fig6");
    let mut group = c.benchmark_group("planning/yard");
    let mut seed = 0..;
    let mut next_seed = move || seed.next().expect("seeds do not run out") % 20;
    let table = PlannerParams::table_1();
    let ends = problem(&yard, &table);
    group.bench_function("baseline_textbook_rrt", |b| {
        b.iter(|| {
            textbook_rrt(
                &yard.world,
                ends.start.position,
                ends.goal.position,
                black_box(next_seed()),
            )
        });
    });
    for method in Method::ALL {
        let params = PlannerParams {
            method,
            ..table.clone()
        };
        let problem = problem(&yard, &params);
        group.sample_size(match method {
            Method::LinearProgram | Method::MpcLinearProgram => 10,
            Method::MpcLaplace | Method::Paper => 20,
            _ => 100,
        });
        group.bench_function(method.name(), |b| {
            b.iter(|| {
                let report = plan(
                    &problem,
                    &params,
                    black_box(next_seed()),
                    &Budget::unlimited(),
                )
                .expect("a problem that makes sense");
                assert_eq!(report.outcome, Outcome::Found);
                report.iterations
            });
        });
    }
    group.finish();
}

fn scenes(c: &mut Criterion) {
    let mut group = c.benchmark_group("planning/paper_to_the_pose");
    group.sample_size(10);
    let of_scale = |scale| PlannerParams {
        scale,
        goal: GoalMode::Pose,
        structured_seeds: true,
        end_arcs: true,
        guides: 5,
        ..PlannerParams::table_1()
    };
    let ride = PlannerParams {
        scale: 0.4,
        ..PlannerParams::default()
    };
    for (name, params) in [
        ("fig7", of_scale(0.4)),
        ("narrow", of_scale(1.0)),
        ("maze", of_scale(1.0)),
        ("fig7-ride", ride),
    ] {
        let scene = scene(name);
        let problem = problem(&scene, &params);
        let what = if problem.footprint == Footprint::Point {
            "point"
        } else {
            "bike"
        };
        group.bench_function(format!("{name}/{what}"), |b| {
            b.iter(|| {
                plan(&problem, &params, black_box(1), &Budget::unlimited())
                    .expect("a problem that makes sense")
                    .iterations
            });
        });
    }
    group.finish();
}

criterion_group!(benches, rows, scenes);
criterion_main!(benches);
