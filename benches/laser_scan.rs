//! Claim: a scan of 1081 beams, 30 m far, takes at most a millisecond (median), on a map of
//! 1000 × 1000 cells as well as in a yard of shapes.
//!
//! Each group carries its baseline, measured in the same run on the same rays: testing every
//! shape for every beam in the yard, walking cell by cell on the grid. Before anything is
//! timed the two have to agree.

use std::hint::black_box;

use bikebot_dynamics::laser::Prisms;
use bikebot_dynamics::{LaserParams, LaserScan, LaserScanner};
use bikebot_geometry::{Point2, Pose2, Vector2};
use bikebot_world::formats::{self, MapOptions};
use bikebot_world::{Bounds, Cell, Obstacle, OccupancyGrid, World};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Half the side of the square world, m.
const HALF: f64 = 50.0;

fn uniform(rng: &mut ChaCha8Rng) -> f64 {
    (rng.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}

/// 300 discs of 0.2 to 1 m in a fenced yard, none within 2 m of its centre.
fn yard() -> Vec<(Point2, f64)> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut discs = Vec::new();
    while discs.len() < 300 {
        let mut coordinate = || (2.0 * uniform(&mut rng) - 1.0) * HALF;
        let center = Point2::new(coordinate(), coordinate());
        let radius = 0.2 + 0.8 * uniform(&mut rng);
        if center.coords.norm() > radius + 2.0 {
            discs.push((center, radius));
        }
    }
    discs
}

/// 1000 × 1000 cells of 0.1 m with 400 boxes of up to 2 m, none at its centre.
fn map() -> OccupancyGrid {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let origin = Pose2::new(-HALF, -HALF, 0.0);
    let mut grid = OccupancyGrid::filled(1000, 1000, 0.1, origin, Cell::Free).expect("a grid");
    for _ in 0..400 {
        let mut below = |n: f64| (uniform(&mut rng) * n) as usize;
        let (x, y, width, height) = (below(980.0), below(980.0), 1 + below(20.0), 1 + below(20.0));
        let away = |from: usize, size: usize| from + size < 470 || from > 530;
        if away(x, width) || away(y, height) {
            for row in y..y + height {
                for column in x..x + width {
                    grid.set(column, row, Cell::Occupied);
                }
            }
        }
    }
    grid
}

/// The beams of a scan from `origin`: unit vectors.
fn beams(scan: &LaserScan, heading: f64) -> Vec<Vector2> {
    (0..scan.ranges.len())
        .map(|i| {
            let (sin, cos) = (heading + scan.angle_min + scan.angle_step * i as f64).sin_cos();
            Vector2::new(cos, sin)
        })
        .collect()
}

/// Every disc and the fence, for one beam.
fn test_every_shape(discs: &[(Point2, f64)], origin: Point2, beam: &Vector2) -> f64 {
    let fence = |o: f64, u: f64| (HALF.copysign(u) - o) / u;
    let mut nearest = fence(origin.x, beam.x).min(fence(origin.y, beam.y));
    for (center, radius) in discs {
        let to = center - origin;
        let along = to.dot(beam);
        let gap = radius * radius - (to.norm_squared() - along * along);
        if gap >= 0.0 && along > 0.0 {
            nearest = nearest.min(along - gap.sqrt());
        }
    }
    nearest
}

/// Cell after cell along one beam, then the entry into the occupied one.
fn walk_cells(grid: &OccupancyGrid, origin: Point2, beam: &Vector2, range_max: f64) -> f64 {
    let hit = grid
        .traverse(origin, origin + beam * range_max)
        .find(|&(x, y)| grid.cell(x, y) == Some(Cell::Occupied));
    let Some((x, y)) = hit else {
        return f64::INFINITY;
    };
    let near = |cell: usize, low: f64, o: f64, u: f64| {
        let side = low + grid.resolution * (cell as f64 + if u > 0.0 { 0.0 } else { 1.0 });
        (side - o) / u
    };
    near(x, grid.origin.position.x, origin.x, beam.x).max(near(
        y,
        grid.origin.position.y,
        origin.y,
        beam.y,
    ))
}

/// Beams that graze a corner may fall either way; all others have to agree.
fn assert_agree(scan: &LaserScan, baseline: impl Fn(usize) -> f64) {
    let differing = scan
        .ranges
        .iter()
        .enumerate()
        .filter(|&(i, range)| {
            let other = baseline(i);
            let none = range.is_infinite() && other > 30.0 - 1e-9;
            !none && (range - other).abs() > 1e-9
        })
        .count();
    assert!(differing <= 5, "{differing} beams differ from the baseline");
}

fn laser_scan(c: &mut Criterion) {
    let scanner = LaserScanner::new(&LaserParams::default()).expect("the default scanner");
    let range_max = scanner.params().range_max;
    let pose = Pose2::new(0.3, -0.2, 0.5);
    let mount = scanner.mount(&pose, 0.0);
    let mut rng = ChaCha8Rng::seed_from_u64(3);

    let discs = yard();
    let shapes = discs
        .iter()
        .map(|&(center, radius)| Obstacle::Disc { center, radius })
        .collect();
    let yard = World::new(Bounds::new(-HALF, -HALF, HALF, HALF), shapes).expect("a yard");
    let mut scan = scanner.scan(&yard, &pose, 0.0, &mut rng);
    let rays = beams(&scan, mount.heading);
    assert_agree(&scan, |i| {
        test_every_shape(&discs, mount.position, &rays[i])
    });

    let mut group = c.benchmark_group("laser_scan/yard_300_discs");
    group.throughput(Throughput::Elements(rays.len() as u64));
    group.bench_function("baseline_every_shape", |b| {
        b.iter(|| {
            rays.iter()
                .map(|ray| test_every_shape(&discs, mount.position, black_box(ray)))
                .sum::<f64>()
        });
    });
    group.bench_function("scan", |b| {
        b.iter(|| scanner.scan_into(&yard, black_box(&pose), 0.0, &mut rng, &mut scan));
    });
    group.bench_function("scan_leaning_5_deg", |b| {
        let roll = 5_f64.to_radians();
        b.iter(|| scanner.scan_into(&yard, black_box(&pose), roll, &mut rng, &mut scan));
    });
    let noisy = LaserParams {
        range_sigma: 0.02,
        dropout_probability: 0.01,
        ..LaserParams::default()
    };
    let noisy = LaserScanner::new(&noisy).expect("a noisy scanner");
    group.bench_function("scan_with_noise", |b| {
        b.iter(|| noisy.scan_into(&yard, black_box(&pose), 0.0, &mut rng, &mut scan));
    });
    group.finish();

    let grid = map();
    let map = World::from_grid(grid.clone()).expect("a map");
    let mut scan = scanner.scan(&map, &pose, 0.0, &mut rng);
    assert_agree(&scan, |i| {
        walk_cells(&grid, mount.position, &rays[i], range_max)
    });

    let mut group = c.benchmark_group("laser_scan/map_1000_x_1000");
    group.throughput(Throughput::Elements(rays.len() as u64));
    group.bench_function("baseline_cell_walk", |b| {
        b.iter(|| {
            rays.iter()
                .map(|ray| walk_cells(&grid, mount.position, black_box(ray), range_max))
                .filter(|range| range.is_finite())
                .sum::<f64>()
        });
    });
    group.bench_function("scan", |b| {
        b.iter(|| scanner.scan_into(&map, black_box(&pose), 0.0, &mut rng, &mut scan));
    });
    group.bench_function("scan_leaning_5_deg", |b| {
        let roll = 5_f64.to_radians();
        b.iter(|| scanner.scan_into(&map, black_box(&pose), roll, &mut rng, &mut scan));
    });
    group.finish();
}

/// The yard of Table 2 from its middle: ten blocks and the field's edge. Baseline: one ray at a time.
fn scan_of_the_yard(c: &mut Criterion) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/maps/fig6.json");
    let bytes = std::fs::read(path).expect("a shipped scene");
    let world = formats::load("fig6.json", &bytes, &MapOptions::default(), &mut |_| {
        Err("a scene names no files".into())
    })
    .expect("a valid scene")
    .world;
    let scanner = LaserScanner::new(&LaserParams::default()).expect("the default scanner");
    let pose = Pose2::new(50.0, 50.0, 0.5);
    let mount = scanner.mount(&pose, 0.0);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut scan = scanner.scan(&world, &pose, 0.0, &mut rng);
    let mut group = c.benchmark_group("laser_scan/fig6");
    group.throughput(Throughput::Elements(scan.ranges.len() as u64));
    group.bench_function("baseline_ray_by_ray", |b| {
        let range_max = scanner.params().range_max;
        b.iter(|| {
            (0..scan.ranges.len())
                .filter_map(|i| {
                    let angle = mount.heading + scan.angle_min + scan.angle_step * i as f64;
                    world.cast_ray(black_box(mount.position), angle, range_max)
                })
                .sum::<f64>()
        });
    });
    group.bench_function("scan", |b| {
        b.iter(|| scanner.scan_into(&world, black_box(&pose), 0.0, &mut rng, &mut scan));
    });
    // Each beam from a pose of its own, leaning and turning, at 2 m/s.
    let scene = Prisms {
        world: &world,
        height: scanner.params().obstacle_height,
    };
    let motion = |time: f64| (Pose2::new(50.0 + 2.0 * time, 50.0, 0.5 + time), 0.1 - time);
    group.bench_function("sweep_leaning_and_turning", |b| {
        b.iter(|| scanner.sweep(&scene, black_box(0.0), motion, &mut rng));
    });
    group.finish();
}

criterion_group!(benches, scan_of_the_yard, laser_scan);
criterion_main!(benches);
