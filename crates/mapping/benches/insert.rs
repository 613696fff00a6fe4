//! Claim: a scan of 1081 beams of 10 m on average, on cells of 0.1 m, is inserted in at most 0.5 ms on one core.
//!
//! The baseline is the plain way: every beam walks the grid by itself and adds to each cell it crosses, in floating point. The two
//! have to agree on the free cells well before the walls before anything is timed. Beside criterion's figures the distribution over single
//! scans of a ride is printed, in processor time, which a busy machine disturbs least.

#![allow(missing_docs, clippy::print_stdout)]

use std::hint::black_box;

use bikebot_dynamics::{LaserParams, LaserScan, LaserScanner};
use bikebot_geometry::{Point2, Pose2};
use bikebot_mapping::{BeliefGrid, Mapper, MapperParams};
use bikebot_world::{Bounds, Cell, Footprint, Obstacle, OccupancyGrid, World};
use cpu_time::ThreadTime;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Half the side of the field, m.
const HALF: f64 = 9.7;

/// Cells along each side.
const CELLS: usize = 194;

fn bounds() -> Bounds {
    Bounds {
        min: Point2::new(-HALF, -HALF),
        max: Point2::new(HALF, HALF),
    }
}

/// A walled field with posts and blocks; seen along the ride below the beams are 10 m long on average.
fn field() -> World {
    let disc = |x: f64, y: f64, radius: f64| Obstacle::Disc {
        center: Point2::new(x, y),
        radius,
    };
    let block = |x: f64, y: f64, w: f64, h: f64| Obstacle::Block {
        min: Point2::new(x, y),
        max: Point2::new(x + w, y + h),
    };
    let obstacles = vec![
        disc(5.0, 4.0, 0.6),
        disc(8.0, -3.5, 0.8),
        disc(-7.0, 6.0, 1.0),
        disc(1.0, -8.0, 0.5),
        block(-3.0, -6.0, 1.5, 1.0),
        block(8.0, 7.0, 2.0, 2.0),
        block(-1.0, 9.0, 3.0, 0.5),
    ];
    World::new(bounds(), obstacles).expect("a field")
}

/// Scans along a weaving ride through the middle, with the poses they were taken from.
fn ride(world: &World, laser: &LaserParams, count: usize) -> Vec<(LaserScan, Pose2, f64)> {
    let scanner = LaserScanner::new(laser).expect("a laser");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    (0..count)
        .map(|i| {
            let t = i as f64 / count as f64;
            let pose = Pose2::new(-6.0 + 6.0 * t, 1.5 * (6.0 * t).sin(), (6.0 * t).cos());
            let roll = 0.05 * (9.0 * t).sin();
            (scanner.scan(world, &pose, roll, &mut rng), pose, roll)
        })
        .collect()
}

/// The plain way.
struct Plain {
    grid: OccupancyGrid,
    log_odds: Vec<f64>,
    scanner: LaserScanner,
}

impl Plain {
    fn insert(&mut self, scan: &LaserScan, pose: &Pose2, roll: f64) {
        let origin = self.scanner.mount(pose, roll).position;
        for i in 0..scan.ranges.len() {
            let Some(end) = self.scanner.hit_point(scan, i, pose, roll) else {
                continue;
            };
            let last = self.grid.world_to_cell(end);
            for (x, y) in self.grid.traverse(origin, end) {
                let change = if Some((x, y)) == last { 1.4 } else { -0.5 };
                let index = y * self.grid.width + x;
                let log_odds = &mut self.log_odds[index];
                *log_odds = (*log_odds + change).clamp(-2.0, 2.5);
                self.grid.cells[index] = match *log_odds {
                    l if l >= 0.7 => Cell::Occupied,
                    l if l <= -1.0 => Cell::Free,
                    _ => Cell::Unknown,
                };
            }
        }
    }
}

/// Cells that the beams of a scan cross, and how long a beam is (m), on average.
fn visits(scanner: &LaserScanner, scans: &[(LaserScan, Pose2, f64)]) -> (f64, f64) {
    let belief = BeliefGrid::over(bounds(), 0.1).expect("a grid");
    let (mut cells, mut length, mut beams) = (0, 0.0, 0);
    for (scan, pose, roll) in scans {
        let origin = scanner.mount(pose, *roll).position;
        for i in 0..scan.ranges.len() {
            if let Some(end) = scanner.hit_point(scan, i, pose, *roll) {
                cells += belief.grid().traverse(origin, end).count();
                length += (end - origin).norm();
                beams += 1;
            }
        }
    }
    (cells as f64 / scans.len() as f64, length / f64::from(beams))
}

fn insert(c: &mut Criterion) {
    let world = field();
    let laser = LaserParams::default();
    let params = MapperParams {
        cell: 0.1,
        ..MapperParams::default()
    };
    let scanner = LaserScanner::new(&laser).expect("a laser");
    let scans = ride(&world, &laser, 200);
    let belief = || BeliefGrid::over(bounds(), params.cell).expect("a grid");
    let mapper =
        || Mapper::new(&params, &laser, Some(&Footprint::bike()), belief()).expect("a mapper");
    let plain = || Plain {
        grid: belief().into_grid(),
        log_odds: vec![0.0; CELLS * CELLS],
        scanner: scanner.clone(),
    };
    let (cells, length) = visits(&scanner, &scans);
    println!("a scan: {cells:.0} cells visited, mean range {length:.2} m");

    let (mut ours, mut theirs) = (mapper(), plain());
    for (scan, pose, roll) in &scans {
        ours.insert(scan, |_| (*pose, *roll)).expect("a scan");
        theirs.insert(scan, pose, *roll);
    }
    for y in 0..CELLS {
        for x in 0..CELLS {
            let centre = theirs.grid.cell_centre(x, y);
            if ours.belief().cell(x, y) == Some(Cell::Free) && world.clearance(centre) > 0.3 {
                assert_eq!(theirs.grid.cell(x, y), Some(Cell::Free), "{centre}");
            }
        }
    }

    // Single scans, as a ride has them.
    let mut spans = Vec::new();
    let mut ours = mapper();
    for (scan, pose, roll) in scans.iter().cycle().take(20_000) {
        let begin = ThreadTime::now();
        black_box(ours.insert(scan, |_| (*pose, *roll)).expect("a scan"));
        spans.push(begin.elapsed().as_secs_f64() * 1e3);
    }
    spans.sort_by(f64::total_cmp);
    let share = |q: f64| spans[((spans.len() - 1) as f64 * q) as usize];
    println!(
        "single scans: p50 {:.3} ms, p99 {:.3} ms, p99.9 {:.3} ms, worst {:.3} ms",
        share(0.5),
        share(0.99),
        share(0.999),
        share(1.0)
    );

    let mut group = c.benchmark_group("insert/1081_beams_10_m");
    group.throughput(Throughput::Elements(1081));
    let mut next = 0;
    group.bench_function("mapper", |b| {
        b.iter(|| {
            next = (next + 1) % scans.len();
            let (scan, pose, roll) = &scans[next];
            ours.insert(black_box(scan), |_| (*pose, *roll))
                .expect("a scan")
                .len()
        });
    });
    group.bench_function("baseline_plain", |b| {
        b.iter(|| {
            next = (next + 1) % scans.len();
            let (scan, pose, roll) = &scans[next];
            theirs.insert(black_box(scan), pose, *roll);
        });
    });
    group.finish();
}

criterion_group!(benches, insert);
criterion_main!(benches);
