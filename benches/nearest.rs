//! Claim: the kd-tree answers nearest, near and k-nearest in logarithmic time, also for points that
//! arrive in the order of a path, where splitting alone would make it a list. Goals: insertion and nearest
//! together at most 0.5 µs at 10⁴ points, the 40 nearest at most 2 µs, a radius query at most 20 ns
//! per point found.
//!
//! The baseline, measured in the same run, is a linear scan. Both have to agree before anything is timed.

use std::hint::black_box;

use bikebot_geometry::Point2;
use bikebot_planner::chance::{Chance, Purpose};
use bikebot_planner::kd_tree::KdTree;
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};

/// Samples along a winding path of 177 m, 2 m to either side, in its order.
fn along_a_path(n: usize) -> Vec<Point2> {
    let mut chance = Chance::new(1, Purpose::Corridor, 0);
    (0..n)
        .map(|i| {
            let s = 177.0 * i as f64 / n as f64;
            Point2::new(s, 20.0 * (0.1 * s).sin() + chance.between(-2.0, 2.0))
        })
        .collect()
}

/// Samples uniform over a field of 100 m.
fn over_a_field(n: usize) -> Vec<Point2> {
    let mut chance = Chance::new(2, Purpose::Rrt, 0);
    let corner = Point2::new(100.0, 100.0);
    (0..n)
        .map(|_| chance.point_in(Point2::origin(), corner))
        .collect()
}

fn tree_of(points: &[Point2]) -> KdTree {
    let mut tree = KdTree::new();
    for (id, point) in points.iter().enumerate() {
        tree.insert(*point, id as u32);
    }
    tree
}

fn scan(points: &[Point2], query: Point2) -> u32 {
    let mut best = (f64::INFINITY, 0);
    for (id, point) in points.iter().enumerate() {
        let distance = (point - query).norm_squared();
        if distance < best.0 {
            best = (distance, id as u32);
        }
    }
    best.1
}

type Order = (&'static str, fn(usize) -> Vec<Point2>);
const ORDERS: [Order; 2] = [("path", along_a_path), ("field", over_a_field)];

fn build(c: &mut Criterion) {
    let mut group = c.benchmark_group("nearest/insert_and_nearest");
    for (order, points) in ORDERS {
        for n in [1_000, 10_000, 100_000] {
            let points = points(n);
            group.throughput(Throughput::Elements(n as u64));
            group.sample_size(10);
            group.bench_with_input(BenchmarkId::new(order, n), &points, |b, points| {
                b.iter(|| {
                    let mut tree = KdTree::new();
                    let mut sum = 0u64;
                    for (id, point) in points.iter().enumerate() {
                        sum += tree.nearest(*point).map_or(0, |n| u64::from(n.id));
                        tree.insert(*point, id as u32);
                    }
                    black_box(sum)
                });
            });
        }
    }
    group.finish();
}

fn query(c: &mut Criterion) {
    for (order, points) in ORDERS {
        for n in [1_000, 10_000, 100_000] {
            let points = points(n);
            let tree = tree_of(&points);
            let queries: Vec<Point2> = (0..512)
                .map(|i| points[i * 7919 % n].map(|x| x + 0.01))
                .collect();
            for query in &queries[..32] {
                let found = tree.nearest(*query).map(|n| n.id);
                assert_eq!(found, Some(scan(&points, *query)));
            }
            let mut group = c.benchmark_group(format!("nearest/query/{order}/{n}"));
            let mut at = queries.iter().cycle();
            let mut next = move || *at.next().expect("a cycle has no end");
            if n <= 10_000 {
                group.bench_function("baseline_linear_scan", |b| {
                    b.iter(|| scan(&points, black_box(next())));
                });
            }
            group.bench_function("nearest", |b| b.iter(|| tree.nearest(black_box(next()))));
            let mut found = Vec::new();
            group.bench_function("40_nearest", |b| {
                b.iter(|| {
                    tree.nearest_within(black_box(next()), 40, f64::INFINITY, &mut found);
                    found.len()
                });
            });
            // A radius that holds about a hundred points: divide the time by the throughput's count.
            let area = if order == "path" { 177.0 * 4.0 } else { 1e4 };
            let radius = (100.0 / n as f64 * area / std::f64::consts::PI).sqrt();
            let hits: usize = queries
                .iter()
                .map(|query| {
                    tree.within(*query, radius, &mut found);
                    found.len()
                })
                .sum();
            group.throughput(Throughput::Elements((hits / queries.len()) as u64));
            group.bench_function("within", |b| {
                b.iter(|| {
                    tree.within(black_box(next()), radius, &mut found);
                    found.len()
                });
            });
            group.finish();
        }
    }
}

criterion_group!(benches, build, query);
criterion_main!(benches);
