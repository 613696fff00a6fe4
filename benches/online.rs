//! Claim: riding on what the laser shows costs, on one core, at most half a millisecond for a scan entered in the belief, 20 µs for the look along
//! the path ahead, 3 ms for a repair and 5 ms for a plan from nothing (medians), and all of it together a twentieth of the time that is ridden.
//!
//! The rides are the shipped ones and random unknown fields (`ONLINE_RIDES` of them, 24 unless told), ridden once with a clock of the thread's
//! processor time, which a busy machine disturbs least. Every search they make is a case: its time is that of the ride itself, cold caches, changed
//! cells and all. Then worlds, paths and places of those searches are asked again by themselves. Beside the medians stand the
//! tails. The baseline of the same run: the world built anew from the belief, and a plan from nothing in it.

#![allow(clippy::print_stdout, reason = "a bench shows what it found")]

use std::collections::BTreeMap;
use std::hint::black_box;
use std::path::Path;

use bikebot::dynamics::{LaserParams, LaserScan, LaserScanner};
use bikebot::geometry::{CurvePath, Point2, Pose2};
use bikebot::mapping::{BeliefGrid, Mapper, MapperParams};
use bikebot::planner::{
    Budget, Decision, EndPose, MotionChecker, PlannerParams, PlanningProblem, Previous, Replan,
    ReplanParams, Validity, plan, replan,
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
    fn print(&self, name: &str) {
        let mut times = self.0.clone();
        let count = times.len();
        if count == 0 {
            println!("{name}: no case");
            return;
        }
        times.sort_by(f64::total_cmp);
        let share = |q: f64| 1e3 * times[((count - 1) as f64 * q).round() as usize];
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
    let quick =
        |search: &Searched| !(search.over_poses || search.is_thorough || search.is_improvement);
    of(&|s| quick(s) && s.found == Some(Cause::Repaired)).print("  repaired");
    of(&|s| quick(s) && s.found == Some(Cause::Afresh)).print("  afresh");
    of(&|s| s.is_improvement).print("  a look for something better");
    of(&|s| s.over_poses && !s.is_thorough && s.found.is_some()).print("  found over poses");
    of(&|s| s.over_poses && s.is_thorough && s.found.is_some()).print("  found thoroughly");
    let in_vain = |s: &Searched| s.found.is_none() && !s.is_improvement;
    of(&|s| in_vain(s) && !s.at_rest).print("  nothing found, riding");
    of(&|s| in_vain(s) && s.at_rest).print("  nothing found, at rest");

    replay(&setups, &watch.situations, c);
}

/// A search asked again, with the room that is tried first.
fn ask(setup: &Setup, situation: &Situation) -> Option<(Replan, f64)> {
    let online = &setup.online.as_ref()?.params;
    let problem = PlanningProblem {
        world: &situation.world,
        footprint: setup.planning_footprint.clone(),
        start: setup.start_pose?,
        goal: setup.goal?,
        max_curvature: setup.planner.max_curvature,
    };
    let params = PlannerParams {
        margin: setup.planner.margin + online.plan_margin,
        starts: online.starts,
        refine_rounds: 12,
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
        horizon: Some(online.horizon),
        renew: false,
        thorough: false,
    };
    let budget = Budget::of_iterations(online.iterations);
    let (took, answer) = timed(|| replan(&problem, &params, &replanning, &previous, 1, &budget));
    Some((answer.ok()?, took))
}

/// What the planner says of the path ahead in the world as it is believed, and the searches themselves; then everything by criterion, in turn.
fn replay(setups: &[Setup], situations: &[Situation], c: &mut Criterion) {
    let mut validity = Times::default();
    let mut kinds: BTreeMap<&str, (Times, Vec<&Situation>)> = BTreeMap::new();
    for situation in situations.iter().filter(|s| !s.search.is_improvement) {
        let setup = &setups[situation.ride];
        let checker = checker(setup, situation);
        black_box(Validity::of(&situation.path, situation.s, &checker));
        validity
            .0
            .push(timed(|| black_box(Validity::of(&situation.path, situation.s, &checker))).0);
        let Some((answer, took)) = ask(setup, situation) else {
            continue;
        };
        let kind = match answer.decision {
            Decision::Repaired => "  repaired",
            Decision::Afresh => "  afresh",
            _ => "  neither",
        };
        let (times, cases) = kinds.entry(kind).or_default();
        times.0.push(took);
        cases.push(situation);
    }
    println!("asked again by itself, with room to spare:");
    validity.print("  the planner's validity of a path that is blocked");
    for (kind, (times, _)) in &kinds {
        times.print(kind);
    }
    let none = Vec::new();
    let cases = |kind: &str| kinds.get(kind).map_or(&none, |(_, cases)| cases);
    let mut group = c.benchmark_group("online");
    group.sample_size(20);
    for (name, kind) in [("repaired", "  repaired"), ("afresh", "  afresh")] {
        let mut next = cases(kind).iter().cycle();
        group.bench_function(name, |b| {
            b.iter(|| next.next().map(|case| ask(&setups[case.ride], case)));
        });
    }
    let mut next = cases("  repaired").iter().cycle();
    group.bench_function("baseline_world_built_anew_and_a_plan", |b| {
        b.iter(|| {
            next.next()
                .map(|case| from_nothing(&setups[case.ride], case))
        });
    });
    group.finish();
}

fn checker<'w>(setup: &Setup, situation: &'w Situation) -> MotionChecker<'w> {
    let resolution = setup.planner.clearance_resolution();
    let margin = setup.planner.margin;
    MotionChecker::new(
        &situation.world,
        &setup.planning_footprint,
        margin,
        resolution,
    )
}

/// What it would take to keep nothing: no world, and no path.
fn from_nothing(setup: &Setup, situation: &Situation) -> Option<usize> {
    let grid = situation.world.grid()?.clone();
    let obstacles = situation.world.obstacles().to_vec();
    let world = World::build(situation.world.bounds(), obstacles, Some(grid)).ok()?;
    let place = situation.path.at(situation.search.at);
    let problem = PlanningProblem {
        world: &world,
        footprint: setup.planning_footprint.clone(),
        start: EndPose::pose(place.position.x, place.position.y, place.heading)
            .with_curvature(place.curvature),
        goal: setup.goal?,
        max_curvature: setup.planner.max_curvature,
    };
    let online = &setup.online.as_ref()?.params;
    let budget = Budget::of_iterations(online.iterations);
    let report = plan(&problem, &setup.planner, 1, &budget).ok()?;
    Some(report.iterations as usize)
}

/// A walled field with posts and blocks, in which the beams of the ride below are 10 m long on average.
fn field_of_posts() -> World {
    let half = 9.7;
    let disc = |x: f64, y: f64, radius: f64| Obstacle::Disc {
        center: Point2::new(x, y),
        radius,
    };
    let obstacles = vec![
        disc(5.0, 4.0, 0.6),
        disc(8.0, -3.5, 0.8),
        disc(-7.0, 6.0, 1.0),
        disc(1.0, -8.0, 0.5),
        disc(-3.0, -6.0, 0.9),
    ];
    World::new(Bounds::new(-half, -half, half, half), obstacles).expect("a field")
}

/// Scans of a weaving ride, entered one by one in cells of a decimetre and of half of one: see `cargo bench -p bikebot-mapping` for the baseline.
fn insertion(c: &mut Criterion) {
    let (world, laser) = (field_of_posts(), LaserParams::default());
    let scanner = LaserScanner::new(&laser).expect("a laser");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let scans: Vec<(LaserScan, Pose2, f64)> = (0..200)
        .map(|i| {
            let t = f64::from(i) / 200.0;
            let pose = Pose2::new(-6.0 + 6.0 * t, 1.5 * (6.0 * t).sin(), (6.0 * t).cos());
            let roll = 0.05 * (9.0 * t).sin();
            (scanner.scan(&world, &pose, roll, &mut rng), pose, roll)
        })
        .collect();
    let ranges = || {
        scans
            .iter()
            .flat_map(|(scan, ..)| &scan.ranges)
            .filter(|r| r.is_finite())
    };
    let mean = ranges().sum::<f64>() / ranges().count() as f64;
    let outline = Footprint::bike();
    let mut group = c.benchmark_group("online");
    group.throughput(Throughput::Elements(1081));
    for cell in [0.1, 0.05] {
        let params = MapperParams {
            cell,
            ..MapperParams::default()
        };
        let belief = BeliefGrid::over(world.bounds(), cell).expect("a grid");
        let mut mapper = Mapper::new(&params, &laser, Some(&outline), belief).expect("a mapper");
        let mut enter = |(scan, pose, roll): &(LaserScan, Pose2, f64)| {
            mapper
                .insert(scan, |_| (*pose, *roll))
                .expect("a scan")
                .len()
        };
        let mut times = Times::default();
        for scan in scans.iter().cycle().take(10_000) {
            times.0.push(timed(|| black_box(enter(scan))).0);
        }
        times.print(&format!(
            "a scan of 1081 beams, {mean:.1} m on average, cells of {cell} m"
        ));
        let mut next = scans.iter().cycle();
        group.bench_function(format!("scan_insertion/{cell}"), |b| {
            b.iter(|| next.next().map(&mut enter));
        });
    }
    group.finish();
}

criterion_group!(benches, insertion, searches);
criterion_main!(benches);
