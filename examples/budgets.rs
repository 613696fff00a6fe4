//! What a budget promises: that an anytime search never gets worse, and that a deadline holds.
//!
//! `cargo run --release --example budgets -- 1000`
//!
//! * So many searches over random fields, each told of every path it finds: their cost never rises, and the last is what is returned.
//! * Deadlines of 1, 10, 100 and 1000 ms on the shipped scenes and on a grid of 4096 x 4096 cells, prepared and not, for a point, a disc and
//!   the bike's outline. A deadline holds where the plan is there within 2 ms or a hundredth of it, in processor time of this thread, the report
//!   and what it prepared of the map included.
//!
//! Ends with 1 if a cost rose, or if less than 99.9 % of the deadlines held.

#![allow(clippy::print_stdout, reason = "an example shows what it found")]

use bikebot::geometry::{Point2, Pose2};
use bikebot::planner::chance::{Chance, Purpose};
use bikebot::planner::{
    Budget, EndPose, GoalRegion, Outcome, PlannerParams, PlanningProblem, StopReason, plan,
    plan_observed,
};
use bikebot::world::formats::{MapOptions, load};
use bikebot::world::{Bounds, Cell, Footprint, Obstacle, OccupancyGrid, World};
use cpu_time::ThreadTime;
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

const DEADLINES: [u64; 4] = [1, 10, 100, 1000];

fn region(end: &EndPose, tolerance: f64) -> GoalRegion {
    GoalRegion {
        position: end.position,
        heading: end.heading,
        tolerance,
    }
}

/// Searches whose cost rose on the way, of so many.
fn rises(searches: u64) -> u64 {
    let (mut rises, mut found, mut steps) = (0, 0_u64, 0_u64);
    for seed in 0..searches {
        let mut chance = Chance::new(seed, Purpose::Rrt, 2);
        let obstacles = (0..chance.between(3.0, 60.0) as usize)
            .map(|_| Obstacle::Disc {
                center: chance.point_in(Point2::new(8.0, 0.0), Point2::new(92.0, 100.0)),
                radius: chance.between(0.5, 8.0),
            })
            .collect();
        let Ok(world) = World::new(Bounds::new(0.0, 0.0, 100.0, 100.0), obstacles) else {
            continue;
        };
        let problem = PlanningProblem {
            world: &world,
            footprint: Footprint::Disc { radius: 0.5 },
            start: EndPose::pose(3.0, chance.between(5.0, 95.0), chance.between(-3.1, 3.1)),
            goal: region(&EndPose::point(97.0, chance.between(5.0, 95.0)), 0.0),
            max_curvature: chance.between(0.2, 1.5),
        };
        let params = PlannerParams {
            starts_without_gain: 16,
            ..PlannerParams::default()
        };
        let mut costs = Vec::new();
        let report = plan_observed(
            &problem,
            &params,
            seed,
            &Budget::of_iterations(20_000),
            &mut |entry, curves| {
                if curves.is_some() {
                    costs.push(entry.cost);
                }
            },
        );
        let Ok(report) = report else { continue };
        steps += costs.len() as u64;
        found += u64::from(report.outcome == Outcome::Found);
        let falls = costs.windows(2).all(|pair| pair[1] < pair[0]);
        rises += u64::from(!falls || costs.is_empty() != (report.outcome != Outcome::Found));
    }
    println!(
        "{searches} anytime searches, {found} found, {steps} better paths on the way: the cost rose in {rises}"
    );
    rises
}

/// What deadlines came to on one map.
#[derive(Default)]
struct Held {
    asked: u32,
    held: u32,
    found: u32,
    /// Most by which a plan was late, ms.
    latest: f64,
}

struct Field {
    name: String,
    build: Box<dyn Fn() -> World>,
    start: EndPose,
    goal: EndPose,
    max_curvature: f64,
    scale: f64,
}

fn scenes() -> std::io::Result<Vec<Field>> {
    let mut fields = Vec::new();
    for (name, max_curvature, scale) in [
        ("fig6", 0.8, 1.0),
        ("fig7", 0.8, 0.1),
        ("narrow", 0.5, 1.0),
        ("maze", 0.5, 1.0),
        ("clutter200", 0.5, 1.0),
        ("clutter2000", 0.5, 2.0),
    ] {
        let path = format!("scenarios/maps/{name}.json");
        let bytes = std::fs::read(Path::new(&path))?;
        let read = move || {
            load(&path, &bytes, &MapOptions::default(), &mut |name| {
                Err(name.to_owned())
            })
            .expect("a shipped scene")
        };
        let map = read();
        let (Some(start), Some(goal)) = (map.start, map.goal) else {
            continue;
        };
        let end = |pose: bikebot::world::formats::MapPose| EndPose {
            position: pose.position,
            heading: pose.heading,
            curvature: None,
        };
        fields.push(Field {
            name: name.to_owned(),
            build: Box::new(move || read().world),
            start: end(start),
            goal: end(goal),
            max_curvature,
            scale,
        });
    }
    // Rooms with doors, at 0.25 m a cell.
    let cells = 4096;
    let build = move || {
        let mut chance = Chance::new(1, Purpose::Rrt, 3);
        let mut grid = vec![Cell::Free; cells * cells];
        for _ in 0..6000 {
            let (x, y) = (
                chance.between(0.0, 4000.0) as usize,
                chance.between(0.0, 4000.0) as usize,
            );
            let (w, h) = (
                chance.between(4.0, 60.0) as usize,
                chance.between(4.0, 60.0) as usize,
            );
            for row in y..(y + h).min(cells) {
                grid[row * cells + x..row * cells + (x + w).min(cells)].fill(Cell::Occupied);
            }
        }
        for corner in [0, cells - 120] {
            for row in corner..corner + 120 {
                grid[row * cells + corner..row * cells + corner + 120].fill(Cell::Free);
            }
        }
        World::from_grid(OccupancyGrid {
            width: cells,
            height: cells,
            resolution: 0.25,
            origin: Pose2::new(0.0, 0.0, 0.0),
            cells: grid,
        })
        .expect("a sound grid")
    };
    fields.push(Field {
        name: "4096 x 4096".to_owned(),
        build: Box::new(build),
        start: EndPose::pose(12.0, 12.0, 0.8),
        goal: EndPose::point(1010.0, 1010.0),
        max_curvature: 0.5,
        scale: 2.0,
    });
    Ok(fields)
}

fn deadlines(field: &Field) -> Held {
    let mut held = Held::default();
    for prepared in [true, false] {
        let world = (field.build)();
        if prepared {
            world.prepare(&|| false);
        }
        for limit in DEADLINES {
            let rounds: u64 = if limit == 1000 { 1 } else { 12 };
            for round in 0..rounds * 3 {
                // A map that has been asked is prepared in part.
                let fresh = (!prepared).then(|| (field.build)());
                let problem = PlanningProblem {
                    world: fresh.as_ref().unwrap_or(&world),
                    footprint: match round % 3 {
                        0 => Footprint::Point,
                        1 => Footprint::Disc {
                            radius: 0.3 * field.scale,
                        },
                        _ => Footprint::Capsule {
                            rear: -0.04 * field.scale,
                            front: 1.16 * field.scale,
                            radius: 0.3 * field.scale,
                        },
                    },
                    start: field.start,
                    goal: region(&field.goal, 0.0),
                    max_curvature: field.max_curvature,
                };
                let params = PlannerParams {
                    scale: field.scale,
                    starts: 1_000_000,
                    starts_without_gain: 1_000_000,
                    ..PlannerParams::default()
                };
                let limit = Duration::from_millis(limit);
                // The clock itself cannot be shared between threads.
                let began = ThreadTime::now().as_duration();
                let used = || ThreadTime::now().as_duration().saturating_sub(began);
                let stop = || (used() >= limit).then_some(StopReason::Deadline);
                let report = plan(&problem, &params, round, &Budget::until(&stop));
                let late = used().saturating_sub(limit);
                let Ok(report) = report else { continue };
                held.asked += 1;
                held.found += u32::from(report.outcome == Outcome::Found);
                held.held += u32::from(late <= Duration::from_millis(2).max(limit / 100));
                if late > Duration::from_millis(2).max(limit / 100) {
                    println!(
                        "   {}: {late:.1?} late of {limit:?}, {}prepared, for {}",
                        field.name,
                        if prepared { "" } else { "not " },
                        problem.footprint
                    );
                }
                held.latest = held.latest.max(late.as_secs_f64() * 1e3);
            }
        }
    }
    println!(
        "{}: {} of {} deadlines held, {} found, at most {:.2} ms late",
        field.name, held.held, held.asked, held.found, held.latest
    );
    held
}

fn main() -> std::io::Result<ExitCode> {
    let searches = std::env::args()
        .nth(1)
        .and_then(|n| n.parse().ok())
        .unwrap_or(100);
    let rose = rises(searches);
    let (mut asked, mut held) = (0, 0);
    for field in scenes()? {
        let of_field = deadlines(&field);
        asked += of_field.asked;
        held += of_field.held;
    }
    println!("{held} of {asked} deadlines held");
    let holds = rose == 0 && f64::from(held) >= 0.999 * f64::from(asked);
    Ok(if holds {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}
