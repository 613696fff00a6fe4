//! Turns laser scans into what is known: free, occupied, unknown.
//!
//! `cargo run --release --example mapping`

#![allow(
    clippy::print_stdout,
    reason = "a program for a terminal: what it prints is its result"
)]

use bikebot::dynamics::{LaserParams, LaserScanner};
use bikebot::geometry::{Point2, Pose2};
use bikebot::mapping::{BeliefGrid, Mapper, MapperParams};
use bikebot::world::{Bounds, Cell, Footprint, Obstacle, World};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The truth: a room with a pillar, and a bike that stands in it.
    let bounds = Bounds::new(0.0, 0.0, 12.0, 8.0);
    let pillar = Obstacle::Disc {
        center: Point2::new(6.0, 4.5),
        radius: 0.6,
    };
    let world = World::new(bounds, vec![pillar])?;
    let start = Pose2::new(2.0, 4.0, 0.0);
    let laser = LaserParams::default();
    let scanner = LaserScanner::new(&laser)?;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let scan = scanner.scan(&world, &start, 0.0, &mut rng);

    let params = MapperParams {
        cell: 0.25,
        ..MapperParams::default()
    };
    let footprint: Footprint = "capsule:1.8x0.6@0.56".parse()?;
    // ANCHOR: mapper
    let belief = BeliefGrid::over(bounds, params.cell)?;
    let mut mapper = Mapper::new(&params, &laser, Some(&footprint), belief)?;
    // The bike stands there.
    mapper.declare_free(&footprint, &start);
    // Where it was, and how it leaned, when each beam was fired.
    let changes = mapper.insert(&scan, |_time| (start, 0.0))?;
    // ANCHOR_END: mapper

    println!("{} cells have changed", changes.len());
    // What was unknown is free once two scans have looked through it.
    for _ in 0..3 {
        let scan = scanner.scan(&world, &start, 0.0, &mut rng);
        mapper.insert(&scan, |_time| (start, 0.0))?;
    }
    let grid = mapper.belief().grid();
    for y in (0..grid.height).rev() {
        let cells = (0..grid.width).map(|x| match grid.cell(x, y) {
            Some(Cell::Free) => '.',
            Some(Cell::Occupied) => '#',
            Some(Cell::Unknown) | None => ' ',
        });
        println!("{}", cells.collect::<String>());
    }
    Ok(())
}
