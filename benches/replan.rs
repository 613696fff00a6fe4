//! Claim: on the yard it takes microseconds to see that a path is still free, and milliseconds to lead it around a block of 4 × 4 m
//! that has come to stand on it.
//!
//! The baseline is a first plan from the same place in the same world: what replanning costs without a kernel for it. The world with the block
//! is prepared beforehand; `with_changes` shows what making it costs.

use std::hint::black_box;

use bikebot_geometry::{CurvePath, Point2};
use bikebot_planner::{
    Budget, Decision, EndPose, Enough, GoalRegion, MotionChecker, PlannerParams, PlanningProblem,
    Previous, ReplanParams, Validity, plan, replan,
};
use bikebot_world::formats::{LoadedMap, MapOptions, load};
use bikebot_world::{Footprint, Obstacle, World, WorldChanges};
use criterion::{Criterion, criterion_group, criterion_main};

fn scene(name: &str) -> LoadedMap {
    let path = format!("{}/scenarios/maps/{name}.json", env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(&path).expect("the scenes are part of the repository");
    load(&path, &bytes, &MapOptions::default(), &mut |name| {
        Err(name.to_owned())
    })
    .expect("a scene that can be read")
}

fn problem<'w>(scene: &LoadedMap, world: &'w World) -> PlanningProblem<'w> {
    let (start, goal) = (scene.start.expect("a start"), scene.goal.expect("a goal"));
    PlanningProblem {
        world,
        footprint: Footprint::Point,
        start: EndPose {
            position: start.position,
            heading: start.heading,
            curvature: None,
        },
        goal: GoalRegion {
            position: goal.position,
            heading: goal.heading,
            tolerance: 0.0,
        },
        max_curvature: 1.0,
    }
}

fn planned(problem: &PlanningProblem<'_>, params: &PlannerParams) -> CurvePath {
    let report = plan(problem, params, 1, &Budget::of_iterations(10_000)).expect("a problem");
    let path = report.path.expect("a path");
    path.curves().expect("curves").clone()
}

/// What the world becomes when a block appears around the middle of the path.
fn block_on(path: &CurvePath) -> WorldChanges {
    let middle = path.at(0.5 * path.length()).position;
    let corner = |by: f64| Point2::new(middle.x + by, middle.y + by);
    WorldChanges {
        added: vec![Obstacle::Block {
            min: corner(-2.0),
            max: corner(2.0),
        }],
        ..WorldChanges::default()
    }
}

fn yard(c: &mut Criterion) {
    let scene = scene("fig6");
    let params = PlannerParams::default();
    let path = planned(&problem(&scene, &scene.world), &params);
    let changes = block_on(&path);
    let world = scene.world.with_changes(&changes).expect("a world");
    let (free, blocked) = (problem(&scene, &scene.world), problem(&scene, &world));
    let previous = Previous {
        curves: &path,
        now: 5.0,
        at: 6.0,
    };
    // The first path ends the search of a plan: that is when a robot could ride on.
    let first = Budget {
        enough: Some(Enough {
            cost: f64::INFINITY,
            settled: None,
        }),
        ..Budget::unlimited()
    };
    let mut group = c.benchmark_group("replan/yard");
    group.bench_function("with_changes", |b| {
        b.iter(|| scene.world.with_changes(black_box(&changes)));
    });
    let checker = MotionChecker::new(
        free.world,
        &free.footprint,
        params.margin,
        params.clearance_resolution(),
    );
    group.bench_function("validity", |b| {
        b.iter(|| Validity::of(black_box(&path), 5.0, &checker));
    });
    let ask = |problem: &PlanningProblem<'_>, replanning: &ReplanParams, seed| {
        replan(problem, &params, replanning, &previous, seed, &first).expect("a sensible problem")
    };
    let default = ReplanParams::default();
    group.bench_function("kept", |b| {
        b.iter(|| {
            let answer = ask(&free, &default, black_box(1));
            assert_eq!(answer.decision, Decision::Kept);
        });
    });
    let mut seed = 0..;
    let mut next_seed = move || seed.next().expect("seeds do not run out") % 20;
    group.bench_function("repaired", |b| {
        b.iter(|| {
            let answer = ask(&blocked, &default, black_box(next_seed()));
            assert_eq!(answer.decision, Decision::Repaired);
        });
    });
    let afresh = PlanningProblem {
        start: previous.start(),
        ..blocked.clone()
    };
    group.bench_function("baseline_afresh", |b| {
        b.iter(|| plan(&afresh, &params, black_box(1), &first).expect("a sensible problem"));
    });
    group.finish();
}

criterion_group!(benches, yard);
criterion_main!(benches);
