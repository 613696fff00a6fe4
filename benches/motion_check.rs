//! Claim: deciding whether a motion of about 5 m is free takes 0.1 to 1.5 µs for a point, and the answer "free" is a proof.
//!
//! The baseline, measured in the same run on the same motions, is the usual thing: sampling every 2 cm, which proves nothing. The
//! certified check has to be no more permissive than the samples before anything is timed.

use std::hint::black_box;

use bikebot_geometry::{FergusonCurve, ParametricCurve, Point2, Pose2};
use bikebot_planner::MotionChecker;
use bikebot_planner::chance::{Chance, Purpose};
use bikebot_world::formats::{MapOptions, load};
use bikebot_world::{Footprint, World};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

/// Spacing of the baseline's samples, m.
const STEP: f64 = 0.02;

fn world(name: &str) -> World {
    let path = format!("{}/scenarios/maps/{name}.json", env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(&path).expect("the scenes are part of the repository");
    load(&path, &bytes, &MapOptions::default(), &mut |name| {
        Err(name.to_owned())
    })
    .expect("a scene that can be read")
    .world
}

/// Curves of 5 m that start free, turning up to 0.6 rad.
fn curves(world: &World, checker: &MotionChecker<'_>) -> Vec<FergusonCurve> {
    let mut chance = Chance::new(1, Purpose::Corridor, 0);
    let bounds = world.bounds();
    let mut curves = Vec::new();
    while curves.len() < 512 {
        let position = chance.point_in(bounds.min, bounds.max);
        let heading = chance.between(-3.0, 3.0);
        let from = Pose2 { position, heading };
        let (bearing, turn) = (chance.between(-0.3, 0.3), chance.between(-0.6, 0.6));
        let to = Pose2::new(
            position.x + 5.0 * (heading + bearing).cos(),
            position.y + 5.0 * (heading + bearing).sin(),
            heading + turn,
        );
        if checker.is_pose_free(&from) && checker.is_pose_free(&to) {
            curves.push(FergusonCurve::between(from, to, 5.0));
        }
    }
    curves
}

fn sample_curve(checker: &MotionChecker<'_>, curve: &FergusonCurve) -> bool {
    let steps = (curve.speed_bound() / STEP).ceil();
    (0..=steps as usize).all(|i| {
        let t = i as f64 / steps;
        let position = curve.point(t);
        let heading = curve.heading(t);
        checker.pose_clearance(&Pose2 { position, heading }) >= 0.0
    })
}

fn sample_segment(checker: &MotionChecker<'_>, from: Point2, to: Point2) -> bool {
    let way = to - from;
    let steps = (way.norm() / STEP).ceil();
    (0..=steps as usize).all(|i| checker.position_clearance(from + way * (i as f64 / steps)) >= 0.0)
}

fn motion_check(c: &mut Criterion) {
    for scene in ["fig6", "maze", "clutter2000"] {
        let world = world(scene);
        for (name, footprint) in [("point", Footprint::Point), ("bike", Footprint::bike())] {
            let checker = MotionChecker::new(&world, &footprint, 0.0, 0.02);
            let curves = curves(&world, &checker);
            for curve in &curves {
                assert!(!checker.is_curve_free(curve) || sample_curve(&checker, curve));
            }
            let mut at = curves.iter().cycle();
            let mut next = move || at.next().expect("a cycle has no end");
            let mut group = c.benchmark_group(format!("motion_check/{scene}/{name}"));
            group.throughput(Throughput::Elements(1));
            group.bench_function("baseline_sampled_curve", |b| {
                b.iter(|| sample_curve(&checker, black_box(next())));
            });
            group.bench_function("curve", |b| {
                b.iter(|| checker.is_curve_free(black_box(next())));
            });
            if footprint == Footprint::Point {
                group.bench_function("baseline_sampled_segment", |b| {
                    b.iter(|| {
                        let curve = black_box(next());
                        sample_segment(&checker, curve.start_point(), curve.end_point())
                    });
                });
                group.bench_function("segment", |b| {
                    b.iter(|| {
                        let curve = black_box(next());
                        checker.is_segment_free(curve.start_point(), curve.end_point())
                    });
                });
            }
            group.finish();
        }
    }
}

criterion_group!(benches, motion_check);
criterion_main!(benches);
