//! Claim: riding on what the laser shows costs, on one core, at most half a millisecond for a scan entered in the belief, 20 µs for the look along
//! the path ahead, 3 ms for a repair and 5 ms for a plan from nothing (medians), and all of it together a twentieth of the time that is ridden.
//!
//! The rides are the shipped ones and random unknown fields (`ONLINE_RIDES` of them, 24 unless told), ridden once with a clock of the thread's
//! processor time, which a busy machine disturbs least. Every search they make is a case: its time is that of the ride itself, cold caches, changed
//! cells and all. Then worlds, paths and places of those searches are asked again by themselves. Beside the medians stand the
//! tails. Baselines of the same run: cells entered beam by beam; the world built anew from the belief and a plan from nothing in it.

#![allow(clippy::print_stdout, reason = "a bench shows what it found")]

use std::hint::black_box;
use std::path::Path;

use bikebot::dynamics::{LaserParams, LaserScan, LaserScanner};
use bikebot::geometry::{CurvePath, Point2, Pose2};
use bikebot::mapping::{BeliefGrid, Mapper, MapperParams};
use bikebot::planner::{
    Budget, Decision, Enough, MotionChecker, PlannerParams, PlanningProblem, Previous,
    ReplanParams, Validity, lattice, plan, replan,
};
use bikebot::sim::clock::SimTime;
use bikebot::sim::online::{Cause, Searched};
use bikebot::sim::record::{Event, OrderSample, RecordError, Recorder};
use bikebot::sim::study::online::{MODES, field};
use bikebot::sim::{RunControl, RunReport, ScenarioFile, Setup, run};
use bikebot::world::{Bounds, Footprint, Obstacle, World, WorldChanges};
use cpu_time::ThreadTime;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The shipped rides that plan from what the laser shows.
const SHIPPED: [&str; 5] = [
    "unknown-yard",
    "blocked-way",
    "street",
    "dead-end",
    "crossing",
];
/// Obstacles on the 900 m² of a random field.
const DENSITIES: [usize; 6] = [40, 60, 80, 100, 120, 140];
/// Seed of the first random field.
const FIRST: u64 = 1000;

/// Processor time that `work` takes, s, and what it answers.
fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let begin = ThreadTime::now();
    let answer = work();
    (begin.elapsed().as_secs_f64(), answer)
}

/// Times of one kind, s.
#[derive(Default)]
struct Times(Vec<f64>);

impl Times {
    fn print(mut self, name: &str) {
        let count = self.0.len();
        if count == 0 {
            println!("{name}: no case");
            return;
        }
        self.0.sort_by(f64::total_cmp);
        let share = |q: f64| 1e3 * self.0[((count - 1) as f64 * q).round() as usize];
        println!(
            "{name}: p50 {:.4} ms, p99 {:.4} ms, p99.9 {:.4} ms, worst {:.4} ms of {count}",
            share(0.5),
            share(0.99),
            share(0.999),
            share(1.0)
        );
    }
}

/// Where a search was made.
struct Situation {
    ride: usize,
    world: World,
    path: CurvePath,
    s: f64,
    search: Searched,
}

/// Keeps what the navigator said on a ride.
#[derive(Default)]
struct Watch {
    ride: usize,
    looks: Times,
    searches: Vec<(Searched, f64)>,
    situations: Vec<Situation>,
}

impl Recorder for Watch {
    fn record(&mut self, _: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
        let Event::Order(order) = event else {
            return Ok(());
        };
        let OrderSample {
            s,
            path,
            world,
            search,
            took,
            ..
        } = *order;
        match (search, path) {
            (Some(search), Some(path)) => {
                self.searches.push((search, took));
                let same = world.with_changes(&WorldChanges::default());
                self.situations.push(Situation {
                    ride: self.ride,
                    world: same.expect("a copy"),
                    path: path.clone(),
                    s,
                    search,
                });
            }
            _ if order.is_fresh => self.looks.0.push(took),
            _ => {}
        }
        Ok(())
    }
}

fn resolve(text: &str) -> Setup {
    let file = ScenarioFile::parse(text, &[]).expect("a valid scenario");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    Setup::resolve(&file, &mut |name| {
        std::fs::read(folder.join(name)).map_err(|error| error.to_string())
    })
    .expect("a scenario that resolves")
}

fn rides() -> Vec<Setup> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    let shipped = SHIPPED.iter().map(|name| {
        let path = folder.join(format!("{name}.toml"));
        resolve(&std::fs::read_to_string(path).expect("a shipped scenario"))
    });
    let count = std::env::var("ONLINE_RIDES").map_or(24, |n| n.parse().expect("a number"));
    let fields = (FIRST..FIRST + count).map(|seed| {
        let count = DENSITIES[(seed / 2) as usize % DENSITIES.len()];
        let mode = MODES[(seed % 2) as usize];
        resolve(&field("field", seed, count, mode, false).text)
    });
    shipped.chain(fields).collect()
}

fn play(setup: &Setup, recorder: &mut dyn Recorder, clock: Option<&dyn Fn() -> f64>) -> RunReport {
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock,
    };
    run(setup, recorder, control).expect("a run")
}

/// Every ride once for its pace, once more to be looked at closely.
fn ride_all(setups: &[Setup]) -> Watch {
    let mut watch = Watch::default();
    let mut paces = Vec::new();
    println!("simulated time over processor time:");
    for (index, setup) in setups.iter().enumerate() {
        let (spent, report) = timed(|| play(setup, &mut (), None));
        let time = report.metrics.time_s.unwrap_or(0.0);
        let pace = time / spent;
        println!(
            "  {}: {pace:.1} ({time:.1} s, {} for {})",
            setup.name, report.outcome, report.reason
        );
        if report.metrics.time_s.is_some() {
            paces.push(pace);
        }
        watch.ride = index;
        let began = ThreadTime::now();
        let clock = || began.elapsed().as_secs_f64();
        play(setup, &mut watch, Some(&clock));
    }
    paces.sort_by(f64::total_cmp);
    if let [least, ..] = paces[..] {
        let median = paces[paces.len() / 2];
        println!("  least {least:.1}, median {median:.1}");
    }
    watch
}

fn searches(c: &mut Criterion) {
    let setups = rides();
    let watch = ride_all(&setups);
    println!("in the ride:");
    watch.looks.print("  order after a scan, no search");
    let of = |keep: &dyn Fn(&Searched) -> bool| {
        let found = watch.searches.iter().filter(|(search, _)| keep(search));
        Times(found.map(|(_, took)| *took).collect())
    };
    of(&|_| true).print("  order with a search");
    let quick = |search: &Searched| !search.over_poses;
    of(&|s| quick(s) && s.found == Some(Cause::Repaired)).print("  repaired");
    of(&|s| quick(s) && s.found == Some(Cause::Afresh)).print("  afresh");
    of(&|s| quick(s) && s.found == Some(Cause::Improved)).print("  improved");
    of(&|s| s.over_poses && s.found.is_some()).print("  found over poses");
    of(&|s| s.found.is_none() && !s.at_rest).print("  nothing found, riding");
    of(&|s| s.found.is_none() && s.at_rest).print("  nothing found, at rest");

    replay(&setups, &watch.situations, c);
}

/// A search asked again: with the room that is tried first, and then with none to spare.
fn ask(
    setup: &Setup,
    situation: &Situation,
    is_tight: bool,
) -> Option<(bikebot::planner::Replan, f64)> {
    let online = &setup.online.as_ref()?.params;
    let (outline, margin) = if is_tight {
        (setup.footprint.grown(online.tracking_allowance + 0.02), 0.0)
    } else {
        (
            setup.planning_footprint.clone(),
            setup.planner.margin + online.plan_margin,
        )
    };
    let problem = PlanningProblem {
        world: &situation.world,
        footprint: outline,
        start: setup.start_pose?,
        goal: setup.goal?,
        max_curvature: setup.planner.max_curvature,
    };
    let params = PlannerParams {
        margin,
        starts: online.starts,
        ..setup.planner.clone()
    };
    let previous = Previous {
        curves: &situation.path,
        now: situation.s,
        at: situation.search.at,
    };
    let replanning = ReplanParams {
        improve: false,
        gain: online.gain,
        detour: online.detour,
    };
    let budget = Budget {
        enough: Some(Enough {
            cost: f64::INFINITY,
            settled: None,
        }),
        ..Budget::of_iterations(online.iterations)
    };
    let (took, answer) = timed(|| replan(&problem, &params, &replanning, &previous, 1, &budget));
    Some((answer.ok()?, took))
}

fn replay(setups: &[Setup], situations: &[Situation], c: &mut Criterion) {
    let mut kinds: std::collections::BTreeMap<String, Times> = std::collections::BTreeMap::new();
    for situation in situations {
        let setup = &setups[situation.ride];
        for is_tight in [false, true] {
            let Some((answer, took)) = ask(setup, situation, is_tight) else {
                continue;
            };
            let room = if is_tight { "tight" } else { "roomy" };
            let kind = match answer.decision {
                Decision::Blocked { why, .. } => format!("{why:?}"),
                other => format!("{other:?}"),
            };
            if std::env::var("ONLINE_CASES").is_ok() {
                println!(
                    "{} {room} {kind} {:.2} ms it {} left {:.1} trace {:?}",
                    setup.name,
                    1e3 * took,
                    answer.iterations,
                    situation.path.length() - situation.s,
                    answer
                        .trace
                        .iter()
                        .map(|t| format!("{:?}@{}:{:.1}", t.stage, t.iteration, t.length))
                        .collect::<Vec<_>>()
                        .join(" ")
                );
            }
            kinds
                .entry(format!("  {room}: {kind}"))
                .or_default()
                .0
                .push(took);
        }
    }
    println!("asked again:");
    for (kind, times) in kinds {
        times.print(&kind);
    }
    let group = c.benchmark_group("online");
    group.finish();
}

criterion_group!(benches, searches);
criterion_main!(benches);
