//! Claim: RRT* in the corridor grows nearly linearly. 10⁵ samples take at most 2 s of one core, 10⁶ at most 30 s, and a node
//! costs at most 200 bytes, everything counted.
//!
//! The yard of Table 2, to the goal pose, about a taut guide. The radius shrinks as RRT* requires it for asymptotic
//! optimality; the paper's fixed radius stands beside it where it can keep up. Processor time of the thread, and the most
//! memory that was held at once during the search, counted in the allocator. `CORRIDOR_SAMPLES=1000000` adds a row.

#![expect(
    unsafe_code,
    reason = "an allocator that counts can only be written with unsafe functions"
)]
#![expect(clippy::print_stdout, reason = "a table is what this prints")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use bikebot_geometry::{FergusonCurve, Polyline};
use bikebot_planner::chance::{Chance, Purpose};
use bikebot_planner::corridor::{self, CorridorSearch};
use bikebot_planner::taut::{self, Rivals};
use bikebot_planner::{
    Budget, EndPose, GoalMode, GoalRegion, Meter, MotionChecker, PlannerParams, PlanningProblem,
    guide,
};
use bikebot_world::Footprint;
use bikebot_world::formats::{LoadedMap, MapOptions, load};
use cpu_time::ThreadTime;

/// The system's allocator, with the bytes held now and the most held at once.
struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

fn grow(bytes: usize) {
    let held = HELD.fetch_add(bytes, Ordering::Relaxed) + bytes;
    MOST.fetch_max(held, Ordering::Relaxed);
}

// SAFETY: every call is passed on to the system's allocator as it is.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }

    // Large blocks are remapped, not copied, so both are never there at once.
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        grow(size);
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn yard() -> LoadedMap {
    let path = format!("{}/scenarios/maps/fig6.json", env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(&path).expect("the scenes are part of the repository");
    let no_other_file = &mut |name: &str| Err(name.to_owned());
    load(&path, &bytes, &MapOptions::default(), no_other_file).expect("a scene that can be read")
}

/// One search: what it found, its processor time (s) and the most memory it held (bytes).
fn measured(yard: &LoadedMap, params: &PlannerParams) -> (CorridorSearch, f64, usize) {
    let (start, goal) = (yard.start.expect("a start"), yard.goal.expect("a goal"));
    let problem = PlanningProblem {
        world: &yard.world,
        footprint: Footprint::Point,
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
    };
    let delta = params.clearance_resolution();
    let motion = MotionChecker::new(problem.world, &problem.footprint, params.margin, delta);
    let budget = Budget::unlimited();
    let mut meter = Meter::new(&budget);
    let coarse = guide::search(&motion, start.position, goal.position, 1, &mut meter);
    let coarse = coarse.expect("the yard has a way through");
    let pulled = taut::pull(&coarse, &Rivals::none(), &motion, &mut meter);
    let guide = Polyline::new(pulled.path).expect("a guide");
    let mut chance = Chance::new(1, Purpose::Corridor, 0);

    let held = HELD.load(Ordering::Relaxed);
    MOST.store(held, Ordering::Relaxed);
    let since = ThreadTime::now();
    let found = corridor::search(
        &problem,
        params,
        &motion,
        &guide,
        &mut chance,
        &mut meter,
        &mut |_| {},
    );
    let seconds = since.elapsed().as_secs_f64();
    (found, seconds, MOST.load(Ordering::Relaxed) - held)
}

fn main() {
    let yard = yard();
    yard.world.prepare(&|| false);
    let largest = std::env::var("CORRIDOR_SAMPLES")
        .ok()
        .and_then(|text| text.parse::<u64>().ok());
    println!("corridor RRT* on the yard, to the pose, taut guide (processor time of one thread)");
    println!(
        "{:>9} {:>10} {:>8} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "samples", "radius", "seconds", "us/sample", "nodes", "B/node", "length m", "cost"
    );
    let all = [1_000, 10_000, 100_000].into_iter().chain(largest);
    for samples in all {
        for shrinks in [false, true] {
            if !shrinks && samples > 100_000 {
                continue;
            }
            let params = PlannerParams {
                iterations: samples,
                goal: GoalMode::Pose,
                structured_seeds: true,
                end_arcs: true,
                rewire_radius_shrinks: shrinks,
                ..PlannerParams::table_1()
            };
            let (found, seconds, bytes) = measured(&yard, &params);
            let nodes = found.edges.len() + 1;
            let length: f64 = found.path.iter().flatten().map(FergusonCurve::length).sum();
            println!(
                "{samples:>9} {:>10} {seconds:>8.3} {:>9.2} {nodes:>9} {:>9.0} {length:>9.3} {:>9.3}",
                if shrinks { "shrinking" } else { "fixed" },
                seconds / samples as f64 * 1e6,
                bytes as f64 / nodes as f64,
                found.cost,
            );
        }
    }
}
