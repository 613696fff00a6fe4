//! The campaign behind "certified": plans over random fields, the shipped scenes and, where they are at hand, real maps, each
//! checked twice by code that the planner does not use.
//!
//! `cargo run --release --example certify -- 2000 scenarios/maps/fig6.json ../shared/data/movingai`
//!
//! The first argument is the number of plans over random fields. Of the others, a map with a start and a goal of its own is asked for its
//! way with 100 seeds; a map without, for 100 ways between random ends, with a point, discs, capsules and boxes; a folder of MovingAI maps,
//! for its problems. Every plan found is proven again by `planner::verify` and sampled densely against the exact shapes. Ends with 1 if
//! anything does not hold.

#![allow(clippy::print_stdout, reason = "an example shows what it found")]

use bikebot::geometry::{ParametricCurve, Point2, Pose2};
use bikebot::planner::chance::{Chance, Purpose};
use bikebot::planner::{
    Budget, EndPose, GoalRegion, Outcome, PathKind, PlanReport, PlannerParams, PlanningProblem,
    Promises, StopReason, Terms, plan, verify,
};
use bikebot::world::formats::{MapOptions, load};
use bikebot::world::{Bounds, Cell, Footprint, Obstacle, OccupancyGrid, World};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// What came of the plans of one kind.
#[derive(Default)]
struct Tally {
    asked: u64,
    refused: u64,
    found: u64,
    /// Reasons of those not found.
    reasons: BTreeMap<String, u64>,
    /// Not proven by `verify`, or touching at a sample.
    wrong: Vec<String>,
    longest: Duration,
}

impl Tally {
    fn take(
        &mut self,
        what: &str,
        problem: &PlanningProblem<'_>,
        params: &PlannerParams,
        seed: u64,
    ) {
        self.asked += 1;
        let began = Instant::now();
        let stop = || (began.elapsed() > Duration::from_secs(1)).then_some(StopReason::Deadline);
        let report = plan(problem, params, seed, &Budget::until(&stop));
        self.longest = self.longest.max(began.elapsed());
        match report {
            Err(_) => self.refused += 1,
            Ok(report) if report.outcome == Outcome::Found => {
                self.found += 1;
                self.wrong.extend(
                    faults(problem, &report).map(|fault| format!("{what}, seed {seed}: {fault}")),
                );
            }
            Ok(report) => {
                *self
                    .reasons
                    .entry(format!("{:?}", report.reason))
                    .or_default() += 1
            }
        }
    }

    fn tell(&self, name: &str) {
        println!(
            "{name}: {} asked, {} make no sense, {} found and certified, others {:?}; {} wrong; longest {:.0?}",
            self.asked,
            self.refused,
            self.found,
            self.reasons,
            self.wrong.len(),
            self.longest
        );
        for fault in self.wrong.iter().take(10) {
            println!("   {fault}");
        }
    }
}

/// What does not hold of a plan, by the independent proof and by dense samples.
fn faults(problem: &PlanningProblem<'_>, report: &PlanReport) -> Option<String> {
    let (path, metrics) = (report.path.as_ref()?, report.metrics.as_ref()?);
    let segments = path.segments();
    let terms = Terms {
        kind: PathKind::Curves,
        margin: 0.0,
        goal_radius: 0.0,
        promises: Promises {
            max_curvature: metrics.max_curvature,
            curvature_jump: metrics.curvature_jump,
            min_clearance: Some(metrics.min_clearance),
            length: Some(metrics.length),
        },
    };
    if segments.is_empty() {
        return None;
    }
    let verdict = verify(problem, &segments, &terms);
    if !verdict.holds() {
        return Some(format!("not proven: {:?}", verdict.violations));
    }
    let step = problem
        .world
        .clearance_cell_size()
        .min(1.0 / problem.max_curvature)
        / 50.0;
    for (number, curve) in segments.iter().enumerate() {
        let samples = (curve.length() / step).ceil().max(1.0);
        for i in 0..=samples as usize {
            let t = i as f64 / samples;
            let pose = Pose2 {
                position: curve.point(t),
                heading: curve.heading(t),
            };
            if problem.world.footprint_clearance(&problem.footprint, &pose) <= 0.0 {
                return Some(format!("touches on segment {number} at T = {t}"));
            }
            if curve.curvature(t).abs() > problem.max_curvature * (1.0 + 1e-9) {
                return Some(format!("too tight on segment {number} at T = {t}"));
            }
        }
    }
    None
}

/// A field of 10 to 100 m with shapes, or with cells, scattered over it.
fn field(chance: &mut Chance) -> (World, f64) {
    let size = chance.between(10.0, 100.0);
    if chance.unit() < 0.3 {
        let cells = chance.between(20.0, 120.0) as usize;
        let density = chance.between(0.0, 0.2);
        let grid = OccupancyGrid {
            width: cells,
            height: cells,
            resolution: size / cells as f64,
            origin: Pose2::new(0.0, 0.0, 0.0),
            cells: (0..cells * cells)
                .map(|_| {
                    if chance.unit() < density {
                        Cell::Occupied
                    } else {
                        Cell::Free
                    }
                })
                .collect(),
        };
        return (World::from_grid(grid).expect("a sound grid"), size);
    }
    let count = chance.between(0.0, 40.0) as usize;
    let obstacles = (0..count)
        .map(|_| {
            let center = chance.point_in(Point2::origin(), Point2::new(size, size));
            let extent = size * chance.between(0.01, 0.1);
            match chance.between(0.0, 3.0) as u32 {
                0 => Obstacle::Disc {
                    center,
                    radius: extent,
                },
                1 => {
                    let (w, h) = (extent, extent * chance.between(0.1, 3.0));
                    Obstacle::Block {
                        min: Point2::new(center.x - w, center.y - h),
                        max: Point2::new(center.x + w, center.y + h),
                    }
                }
                _ => {
                    let corners = 3 + chance.between(0.0, 5.0) as usize;
                    let vertices = (0..corners)
                        .map(|i| {
                            let turn = std::f64::consts::TAU * i as f64 / corners as f64;
                            let r = extent * chance.between(0.3, 1.5);
                            Point2::new(center.x + r * turn.cos(), center.y + r * turn.sin())
                        })
                        .collect();
                    Obstacle::Polygon { vertices }
                }
            }
        })
        .collect();
    (
        World::new(Bounds::new(0.0, 0.0, size, size), obstacles).expect("sound shapes"),
        size,
    )
}

fn end(chance: &mut Chance, size: f64) -> EndPose {
    let p = chance.point_in(Point2::origin(), Point2::new(size, size));
    if chance.unit() < 0.5 {
        EndPose::pose(p.x, p.y, chance.between(-3.1, 3.1))
    } else {
        EndPose::point(p.x, p.y)
    }
}

/// A point, a disc, a capsule or a box by turns, of the size of a bike on a field of 100 units.
fn footprint(chance: &mut Chance, turn: u64, unit: f64) -> Footprint {
    match turn % 4 {
        0 => Footprint::Point,
        1 => Footprint::Disc {
            radius: unit * chance.between(0.1, 1.0),
        },
        2 => Footprint::Capsule {
            rear: -0.2 * unit,
            front: unit * chance.between(0.5, 2.0),
            radius: unit * chance.between(0.1, 0.6),
        },
        _ => Footprint::Rectangle {
            rear: -0.4 * unit,
            front: unit * chance.between(0.5, 2.0),
            half_width: unit * chance.between(0.1, 0.6),
        },
    }
}

fn random_fields(plans: u64) -> Tally {
    let mut tally = Tally::default();
    for seed in 0..plans {
        let mut chance = Chance::new(seed, Purpose::Rrt, 0);
        let (world, size) = field(&mut chance);
        let unit = size / 100.0;
        let footprint = footprint(&mut chance, seed, unit);
        let (start, goal) = (end(&mut chance, size), end(&mut chance, size));
        let max_curvature = chance.between(0.2, 2.0) / unit;
        let params = PlannerParams {
            scale: unit.clamp(1e-3, 10.0),
            starts_without_gain: 8,
            ..PlannerParams::default()
        };
        let problem = PlanningProblem {
            world: &world,
            footprint,
            start,
            goal: GoalRegion {
                position: goal.position,
                heading: goal.heading,
                tolerance: 0.0,
            },
            max_curvature,
        };
        tally.take("random field", &problem, &params, seed);
    }
    tally
}

/// A hundred plans on one map: for its own start and goal, or for random ends.
fn map_file(path: &Path) -> std::io::Result<Tally> {
    let shown = path.display().to_string();
    let bytes = std::fs::read(path)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut inner =
        |name: &str| std::fs::read(folder.join(name)).map_err(|error| format!("{name}: {error}"));
    // The scale of a bare picture is nobody's but ours.
    let bare = path.extension().is_some_and(|ending| ending == "png");
    let options = MapOptions {
        meters_per_cell: bare.then_some(0.1),
        ..MapOptions::default()
    };
    let map = load(&shown, &bytes, &options, &mut inner)
        .map_err(|error| std::io::Error::other(error.to_string()))?;
    map.world.prepare(&|| false);
    let bounds = map.world.bounds();
    // The shipped scenes, whose ends are their own, are asked for the way of a point.
    let scene = path.file_stem().and_then(|stem| stem.to_str());
    let unit = match scene.filter(|_| map.start.is_some()) {
        Some("fig7") => 0.4,
        Some("clutter200") => 4.0,
        Some("clutter2000") => 2.0,
        Some(_) => 1.0,
        None => bounds.width().min(bounds.height()) / 100.0,
    };
    let mut tally = Tally::default();
    for seed in 0..100 {
        let mut chance = Chance::new(seed, Purpose::Rrt, 1);
        let mut at = || {
            let p = chance.point_in(bounds.min, bounds.max);
            if chance.unit() < 0.5 {
                EndPose::pose(p.x, p.y, chance.between(-3.1, 3.1))
            } else {
                EndPose::point(p.x, p.y)
            }
        };
        let own = map.start.zip(map.goal).map(|ends| {
            [ends.0, ends.1].map(|end| EndPose {
                position: end.position,
                heading: end.heading,
                curvature: None,
            })
        });
        // Most pairs on a real map have an end in a wall: draw until both stand free.
        let [start, goal] = own.unwrap_or_else(|| {
            let mut free = || loop {
                let end = at();
                if map.world.clearance(end.position) > 2.0 * unit {
                    return end;
                }
            };
            [free(), free()]
        });
        let problem = PlanningProblem {
            world: &map.world,
            footprint: if own.is_some() {
                Footprint::Point
            } else {
                footprint(&mut chance, seed, unit)
            },
            start,
            goal: GoalRegion {
                position: goal.position,
                heading: goal.heading,
                tolerance: 0.0,
            },
            max_curvature: if own.is_some() { 1.0 } else { 0.8 } / unit,
        };
        let params = PlannerParams {
            scale: unit.clamp(1e-3, 10.0),
            starts_without_gain: 8,
            ..PlannerParams::default()
        };
        tally.take(&shown, &problem, &params, seed);
    }
    Ok(tally)
}

/// The last hundred problems of every map in a folder, 1 m a cell, at most 0.5 per metre, headings free.
fn moving_ai(folder: &Path) -> std::io::Result<Vec<(String, Tally)>> {
    let mut tallies = Vec::new();
    let mut files: Vec<_> = std::fs::read_dir(folder)?
        .filter_map(Result::ok)
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == "scen"))
        .collect();
    files.sort();
    for scen in files {
        let text = std::fs::read_to_string(&scen)?;
        let problems: Vec<Vec<&str>> = text
            .lines()
            .map(|line| line.split_whitespace().collect::<Vec<_>>())
            .filter(|words| words.len() >= 9)
            .collect();
        let Some(name) = problems
            .first()
            .and_then(|words| Path::new(words[1]).file_name())
        else {
            continue;
        };
        let path = folder.join(name);
        let shown = path.display().to_string();
        let options = MapOptions {
            meters_per_cell: Some(1.0),
            ..MapOptions::default()
        };
        let bytes = std::fs::read(&path)?;
        let Ok(map) = load(&shown, &bytes, &options, &mut |name| Err(name.to_owned())) else {
            println!("{shown}: not read");
            continue;
        };
        map.world.prepare(&|| false);
        let height = map.world.bounds().height();
        let mut tally = Tally::default();
        for words in problems.iter().rev().take(100) {
            let at = |x: usize, y: usize| {
                let number = |i: usize| words[i].parse::<f64>().unwrap_or(0.0);
                EndPose::point(number(x) + 0.5, height - number(y) - 0.5)
            };
            let (start, goal) = (at(4, 5), at(6, 7));
            let problem = PlanningProblem {
                world: &map.world,
                footprint: Footprint::Point,
                start,
                goal: GoalRegion {
                    position: goal.position,
                    heading: None,
                    tolerance: 0.0,
                },
                max_curvature: 0.5,
            };
            let params = PlannerParams {
                starts_without_gain: 8,
                ..PlannerParams::default()
            };
            tally.take(&shown, &problem, &params, 1);
        }
        tallies.push((shown, tally));
    }
    Ok(tallies)
}

fn main() -> std::io::Result<ExitCode> {
    let mut arguments = std::env::args().skip(1);
    let plans = arguments.next().and_then(|n| n.parse().ok()).unwrap_or(200);
    let mut wrong = 0;
    let random = random_fields(plans);
    random.tell("random fields");
    wrong += random.wrong.len();
    for argument in arguments {
        let path = Path::new(&argument);
        let tallies = if path.is_dir() {
            moving_ai(path)?
        } else {
            vec![(argument.clone(), map_file(path)?)]
        };
        for (name, tally) in tallies {
            tally.tell(&name);
            wrong += tally.wrong.len();
        }
    }
    Ok(if wrong == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}
