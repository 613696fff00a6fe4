//! Claim: a certified path of continuous curvature takes about as long as the peers take for a polyline, and is closer to the shortest.
//!
//! The six scenes of `scenarios/maps` with a point robot, medians over 100 seeds, processor time of one thread. First our
//! own figures beside their limits; then the crates `oxmpl` and `rrt` on the same exact world: a state is valid where
//! `World::clearance` is positive, and motions are sampled at the resolution they are given. What they return is a
//! polyline that heeds neither headings nor curvature. `PEERS_SEEDS=10` is quicker. OMPL itself: `benches/ompl/run.sh`.

#![expect(clippy::print_stdout, reason = "a table is what this prints")]

use std::cell::{Cell, RefCell};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use bikebot_geometry::Point2;
use bikebot_planner::chance::{Chance, Purpose};
use bikebot_planner::{
    Budget, EndPose, GoalRegion, MotionChecker, Outcome, PlannerParams, PlanningProblem,
    StopReason, TraceEntry, plan_observed,
};
use bikebot_world::formats::{MapOptions, load};
use bikebot_world::{Bounds, Footprint, Obstacle, World};
use cpu_time::ThreadTime;
use oxmpl::base::error::StateSamplingError;
use oxmpl::base::goal::{Goal, GoalRegion as PeerRegion, GoalSampleableRegion};
use oxmpl::base::planner::{Planner, PlannerConfig};
use oxmpl::base::problem_definition::ProblemDefinition;
use oxmpl::base::space::RealVectorStateSpace;
use oxmpl::base::state::RealVectorState;
use oxmpl::base::validity::StateValidityChecker;
use oxmpl::geometric::{RRTConnect, RRTStar};

/// Seeds of the peers, fewer because some of them take a second each.
const PEER_SEEDS: u64 = 20;
/// What a peer may take, s by the clock.
const PEER_SECONDS: f64 = 1.0;

/// A scene with what is asked of us there.
struct Scene {
    name: &'static str,
    world: Arc<World>,
    start: EndPose,
    goal: EndPose,
    params: PlannerParams,
    /// Length of the shortest path of a point, headings ignored, m.
    exact: f64,
    /// Deadline, ms, and length by then, in exact shortest lengths.
    deadline: f64,
    within: f64,
    /// First certified path: prepared, cold and dreamt of, ms.
    first: [f64; 3],
}

impl Scene {
    /// The name, σ_MAX (1/m), the scale (m), the exact length (m), the deadline (ms), the length by then, and the first path (ms).
    fn load(
        name: &'static str,
        max_curvature: f64,
        scale: f64,
        exact: f64,
        deadline: f64,
        within: f64,
        first: [f64; 3],
    ) -> Self {
        let path = format!("{}/scenarios/maps/{name}.json", env!("CARGO_MANIFEST_DIR"));
        let bytes = std::fs::read(&path).expect("the scenes are part of the repository");
        let no_other_file = &mut |name: &str| Err(name.to_owned());
        let map = load(&path, &bytes, &MapOptions::default(), no_other_file);
        let map = map.expect("a scene that can be read");
        let end = |pose: Option<bikebot_world::formats::MapPose>| {
            let pose = pose.expect("the scene names its ends");
            EndPose {
                position: pose.position,
                heading: pose.heading,
                curvature: None,
            }
        };
        Self {
            name,
            start: end(map.start),
            goal: end(map.goal),
            world: Arc::new(map.world),
            params: PlannerParams {
                max_curvature,
                scale,
                ..PlannerParams::default()
            },
            exact,
            deadline,
            within,
            first,
        }
    }

    fn all() -> Vec<Self> {
        let load = Self::load;
        vec![
            load("fig6", 1.0, 1.0, 174.737, 10.0, 1.010, [2.0, 5.0, 0.2]),
            load("fig7", 1.0, 0.4, 9.963, 10.0, 1.05, [1.0, 2.0, 0.1]),
            load("narrow", 1.0, 1.0, 184.866, 30.0, 1.02, [3.0, 7.0, 0.5]),
            load("maze", 1.0, 1.0, 187.772, 30.0, 1.025, [6.0, 14.0, 1.0]),
            load(
                "clutter200",
                0.25,
                4.0,
                1373.862,
                100.0,
                1.005,
                [8.0, 30.0, 2.0],
            ),
            load(
                "clutter2000",
                0.5,
                2.0,
                1388.943,
                100.0,
                1.005,
                [15.0, 80.0, 5.0],
            ),
        ]
    }

    /// What a peer's motions are sampled at, m.
    fn resolution(&self) -> f64 {
        0.1 * self.params.scale
    }
}

fn now() -> Duration {
    ThreadTime::now().as_duration()
}

fn milliseconds_since(start: Duration) -> f64 {
    (now() - start).as_secs_f64() * 1e3
}

/// One run of ours.
struct Ours {
    /// Time of the first certified path, ms.
    first: Option<f64>,
    /// Its length, m.
    first_length: f64,
    /// Length at the end, m.
    length: Option<f64>,
    roughness: f64,
    jump: f64,
    /// All of it, ms.
    total: f64,
}

/// Plans until the deadline (ms), or until the first path if there is none. Time counts from `start`.
fn ours(scene: &Scene, world: &World, seed: u64, deadline: Option<f64>, start: Duration) -> Ours {
    let problem = PlanningProblem {
        world,
        footprint: Footprint::Point,
        start: scene.start,
        goal: GoalRegion {
            position: scene.goal.position,
            heading: scene.goal.heading,
            tolerance: scene.params.table_goal_tolerance(),
        },
        max_curvature: scene.params.max_curvature,
    };
    let has_path = AtomicBool::new(false);
    let stop = || {
        let is_over = deadline.map_or_else(
            || has_path.load(Ordering::Relaxed),
            |limit| milliseconds_since(start) >= limit,
        );
        is_over.then_some(StopReason::Deadline)
    };
    let mut first = None;
    let report = plan_observed(
        &problem,
        &scene.params,
        seed,
        &Budget::until(&stop),
        &mut |entry: &TraceEntry, _| {
            if entry.certified && first.is_none() {
                first = Some((milliseconds_since(start), entry.length));
                has_path.store(true, Ordering::Relaxed);
            }
        },
    )
    .expect("a problem that makes sense");
    let total = milliseconds_since(start);
    let metrics = report.metrics.filter(|_| report.outcome == Outcome::Found);
    Ours {
        first: first.map(|(time, _)| time),
        first_length: first.map_or(f64::NAN, |(_, length)| length),
        length: metrics.as_ref().map(|m| m.length),
        roughness: metrics.as_ref().map_or(f64::NAN, |m| m.roughness),
        jump: metrics
            .as_ref()
            .and_then(|m| m.curvature_jump)
            .unwrap_or(f64::NAN),
        total,
    }
}

/// The median and the largest; infinite where nothing was found.
fn spread(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    match values.last() {
        Some(&worst) => (values[values.len() / 2], worst),
        None => (f64::INFINITY, f64::INFINITY),
    }
}

/// Our row; returns the first path's median time (ms) and the length at the deadline, in exact lengths.
fn our_row(scene: &Scene, seeds: u64) -> (f64, f64) {
    let world = &scene.world;
    world.prepare(&|| false);
    let runs: Vec<Ours> = (0..seeds)
        .map(|seed| ours(scene, world, seed, Some(scene.deadline), now()))
        .collect();
    let (bounds, obstacles): (Bounds, &[Obstacle]) = (world.bounds(), world.obstacles());
    let cold = (0..seeds).map(|seed| {
        let obstacles = obstacles.to_vec();
        let start = now();
        let world = World::new(bounds, obstacles).expect("a world that was one before");
        let run = ours(scene, &world, seed, None, start);
        run.first.unwrap_or(f64::INFINITY)
    });
    let (cold, cold_worst) = spread(cold);
    let (prepared, prepared_worst) = spread(runs.iter().map(|r| r.first.unwrap_or(f64::INFINITY)));
    let (first_ratio, _) = spread(runs.iter().map(|r| r.first_length / scene.exact));
    let (ratio, ratio_worst) = spread(
        runs.iter()
            .map(|r| r.length.map_or(f64::INFINITY, |l| l / scene.exact)),
    );
    let (roughness, _) = spread(runs.iter().map(|r| r.roughness));
    let (_, jump) = spread(runs.iter().map(|r| r.jump));
    let (_, total) = spread(runs.iter().map(|r| r.total));
    let found = runs.iter().filter(|r| r.length.is_some()).count();
    let mark = |value: f64, limit: f64| if value <= limit { "held" } else { "MISSED" };
    let [prepared_limit, cold_limit, dream] = scene.first;
    println!(
        "| {} | {found}/{seeds} | {prepared:.2} [{prepared_worst:.2}] | {prepared_limit} {} | {dream} | {cold:.2} [{cold_worst:.2}] | {cold_limit} {} | {first_ratio:.4} | {} | {ratio:.4} [{ratio_worst:.4}] | {} {} | {roughness:.1e} | {jump:.0e} | {total:.1} |",
        scene.name,
        mark(prepared, prepared_limit),
        mark(cold, cold_limit),
        scene.deadline,
        scene.within,
        mark(ratio, scene.within),
    );
    (prepared, ratio)
}

// ----- peers

/// Goal and collisions for `oxmpl`.
struct Target {
    goal: Point2,
    reach: f64,
}

fn distance(state: &RealVectorState, to: Point2) -> f64 {
    (state.values[0] - to.x).hypot(state.values[1] - to.y)
}

impl Goal<RealVectorState> for Target {
    fn is_satisfied(&self, state: &RealVectorState) -> bool {
        distance(state, self.goal) <= self.reach
    }
}

impl PeerRegion<RealVectorState> for Target {
    fn distance_goal(&self, state: &RealVectorState) -> f64 {
        (distance(state, self.goal) - self.reach).max(0.0)
    }
}

impl GoalSampleableRegion<RealVectorState> for Target {
    fn sample_goal(&self, _: &mut impl rand::Rng) -> Result<RealVectorState, StateSamplingError> {
        Ok(state(self.goal))
    }
}

struct Clear(Arc<World>);

impl StateValidityChecker<RealVectorState> for Clear {
    fn is_valid(&self, state: &RealVectorState) -> bool {
        self.0
            .clearance(Point2::new(state.values[0], state.values[1]))
            > 0.0
    }
}

fn state(p: Point2) -> RealVectorState {
    RealVectorState {
        values: vec![p.x, p.y],
    }
}

type Found = Option<Vec<Point2>>;

/// A planner of `oxmpl`, set up and run.
fn oxmpl<P>(scene: &Scene, reach: f64, mut planner: P) -> Found
where
    P: Planner<RealVectorState, RealVectorStateSpace, Target>,
{
    let bounds = scene.world.bounds();
    let sides = vec![(bounds.min.x, bounds.max.x), (bounds.min.y, bounds.max.y)];
    let mut space = RealVectorStateSpace::new(2, Some(sides)).ok()?;
    // A tenth of this part of the extent is its step along motions.
    let extent = space.get_maximum_extent();
    space.set_longest_valid_segment_fraction(10.0 * scene.resolution() / extent);
    let problem = ProblemDefinition {
        space: Arc::new(space),
        start_states: vec![state(scene.start.position)],
        goal: Arc::new(Target {
            goal: scene.goal.position,
            reach,
        }),
    };
    planner.setup(Arc::new(problem), Arc::new(Clear(scene.world.clone())));
    let path = planner.solve(Duration::from_secs_f64(PEER_SECONDS)).ok()?;
    let point = |s: &RealVectorState| Point2::new(s.values[0], s.values[1]);
    Some(path.0.iter().map(point).collect())
}

/// Two trees of the crate `rrt`, which looks at the end of each step only, so that its step is the resolution; then its smoothing.
fn dual_rrt(scene: &Scene, seed: u64, smoothings: usize) -> Found {
    let chance = RefCell::new(Chance::new(seed, Purpose::Birrt, 0));
    let bounds = scene.world.bounds();
    let start = std::time::Instant::now();
    let is_over = Cell::new(false);
    // It knows no deadline: after it nothing is free any more, and its attempts run out.
    let is_free = |p: &[f64]| {
        is_over.set(is_over.get() || start.elapsed().as_secs_f64() > PEER_SECONDS);
        !is_over.get() && scene.world.clearance(Point2::new(p[0], p[1])) > 0.0
    };
    let sample = || {
        let p = chance.borrow_mut().point_in(bounds.min, bounds.max);
        vec![p.x, p.y]
    };
    let ends = [scene.start.position, scene.goal.position].map(|p| [p.x, p.y]);
    let step = scene.resolution();
    let mut path =
        rrt::dual_rrt_connect(&ends[0], &ends[1], is_free, sample, step, 100_000).ok()?;
    rrt::smooth_path(&mut path, is_free, step, smoothings);
    Some(path.iter().map(|p| Point2::new(p[0], p[1])).collect())
}

/// One row per peer: how many it found, time, length, how many are truly free, and our ratio to it.
fn peer_rows(scene: &Scene, seeds: u64, ours: (f64, f64)) {
    let scale = scene.params.scale;
    let config = |seed| PlannerConfig { seed: Some(seed) };
    let reach = scene.params.table_goal_tolerance();
    let peers: [(&str, &dyn Fn(u64) -> Found); 4] = [
        ("oxmpl RRT-Connect", &|seed| {
            let planner = RRTConnect::new(5.0 * scale, 0.05, &config(seed));
            oxmpl(scene, 1e-9, planner)
        }),
        ("oxmpl RRT*, first arrival", &|seed| {
            let planner = RRTStar::new(5.0 * scale, 0.05, 5.0 * scale, &config(seed));
            oxmpl(scene, reach, planner)
        }),
        ("rrt", &|seed| dual_rrt(scene, seed, 0)),
        ("rrt + smooth (200)", &|seed| dual_rrt(scene, seed, 200)),
    ];
    let exact = MotionChecker::new(&scene.world, &Footprint::Point, 0.0, 1e-9);
    for (name, run) in peers {
        let mut free = 0;
        let results: Vec<(f64, Option<f64>)> = (0..seeds)
            .map(|seed| {
                let start = now();
                let path = run(seed);
                let time = milliseconds_since(start);
                let length = path.map(|path| {
                    let legs = || path.windows(2);
                    free += usize::from(legs().all(|l| exact.is_segment_free(l[0], l[1])));
                    legs().map(|l| (l[1] - l[0]).norm()).sum::<f64>()
                });
                (time, length)
            })
            .collect();
        let found = results.iter().filter(|r| r.1.is_some()).count();
        if found == 0 {
            println!(
                "| {} | {name} | 0/{seeds} | – | – | – | – | – |",
                scene.name
            );
            continue;
        }
        let (time, worst) = spread(results.iter().map(|r| r.0));
        let (ratio, _) = spread(results.iter().filter_map(|r| r.1).map(|l| l / scene.exact));
        println!(
            "| {} | {name} | {found}/{seeds} | {time:.2} [{worst:.2}] | {ratio:.3} | {free}/{found} | {:.2} | {:.3} |",
            scene.name,
            ours.0 / time,
            ours.1 / ratio,
        );
    }
}

fn main() {
    let seeds: u64 = std::env::var("PEERS_SEEDS")
        .ok()
        .and_then(|text| text.parse().ok())
        .filter(|&seeds| seeds > 0)
        .unwrap_or(100);
    println!(
        "Ours: medians [worst] over {seeds} seeds, ms of processor time, lengths in exact shortest lengths\n"
    );
    println!(
        "| scene | found | first, prepared | limit | dream | first, cold | limit | its length | deadline | length then | limit | roughness | worst jump | longest run |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    let scenes = Scene::all();
    let ours: Vec<(f64, f64)> = scenes.iter().map(|scene| our_row(scene, seeds)).collect();
    let peer_seeds = seeds.min(PEER_SEEDS);
    println!(
        "\nPeers: polylines without headings or curvature, medians [worst] over {peer_seeds} seeds, at most {PEER_SECONDS} s each.\n\
         \"free\": no leg touches anything between its samples. Ratios are ours to theirs: below 1 is faster, shorter.\n"
    );
    println!("| scene | peer | found | ms | length | free | our time ratio | our length ratio |");
    println!("|---|---|---|---|---|---|---|---|");
    for (scene, &ours) in scenes.iter().zip(&ours) {
        peer_rows(scene, peer_seeds, ours);
    }
}
