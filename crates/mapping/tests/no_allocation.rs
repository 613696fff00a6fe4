//! A scan entered in the belief allocates nothing once its like has been entered before.
//!
//! The counting allocator is the test program's own; it counts on every thread, so this file has one test.

#![allow(unsafe_code, reason = "an allocator that counts is unsafe to write")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use bikebot_dynamics::{LaserParams, LaserScan, LaserScanner};
use bikebot_geometry::{Point2, Pose2};
use bikebot_mapping::{BeliefGrid, Mapper, MapperParams};
use bikebot_world::{Bounds, Footprint, Obstacle, World};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

static COUNT: AtomicUsize = AtomicUsize::new(0);

struct Counting;

// SAFETY: every call is passed on to the system's allocator as it is.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's layout.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: what `alloc` gave.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        COUNT.fetch_add(1, Ordering::Relaxed);
        // SAFETY: what `alloc` gave.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Scans of a noisy laser along a weaving ride.
fn ride(laser: &LaserParams, world: &World) -> Vec<(LaserScan, Pose2, f64)> {
    let scanner = LaserScanner::new(laser).expect("a laser");
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    (0..300)
        .map(|i| {
            let t = 0.05 * f64::from(i);
            let pose = Pose2::new(-8.0 + t, (0.5 * t).sin(), 0.4 * (0.5 * t).cos());
            let roll = 0.06 * t.sin();
            (scanner.scan(world, &pose, roll, &mut rng), pose, roll)
        })
        .collect()
}

#[test]
fn after_the_first_scan_nothing_is_allocated() {
    let bounds = Bounds::new(-12.0, -12.0, 12.0, 12.0);
    let obstacles = (0..12)
        .map(|i| {
            let angle = 0.5 * f64::from(i);
            Obstacle::Disc {
                center: Point2::new(8.0 * angle.cos(), 8.0 * angle.sin()),
                radius: 0.3,
            }
        })
        .collect();
    let world = World::new(bounds, obstacles).expect("a world");
    let laser = LaserParams {
        range_sigma: 0.02,
        dropout_probability: 0.01,
        ..LaserParams::default()
    };
    let params = MapperParams::default();
    let belief = BeliefGrid::over(bounds, params.cell).expect("a grid");
    let mut mapper =
        Mapper::new(&params, &laser, Some(&Footprint::bike()), belief).expect("a mapper");
    let scans = ride(&laser, &world);
    let mut changed = 0;
    let mut insert = |(scan, pose, roll): &(LaserScan, Pose2, f64)| {
        changed += mapper
            .insert(scan, |_| (*pose, *roll))
            .expect("a scan")
            .len();
    };
    // The first scans change more cells than any other will, and say how long the lists get.
    scans[..3].iter().for_each(&mut insert);
    let before = COUNT.load(Ordering::Relaxed);
    scans[3..].iter().for_each(&mut insert);
    assert_eq!(COUNT.load(Ordering::Relaxed) - before, 0);
    assert!(changed > 10_000, "{changed} cells");
}
