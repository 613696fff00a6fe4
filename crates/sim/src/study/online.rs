//! The campaign on unknown fields: random ones from seeds, with and without a block that comes to stand on the way, and real maps.
//!
//! Every ride is watched by a [`BrakingCheck`], which shares no code with the navigator: at each tick it plays the braking manoeuvre along the path
//! in force and samples the bike's outline densely, in the true world and on the recorded belief.

use std::fmt::Write as _;

use bikebot_geometry::{Point2, Pose2, Vector2};
use bikebot_planner::{
    Budget, EndPose, Outcome, PlannedPath, PlannerParams, PlanningProblem, plan,
};
use bikebot_world::{Cell, Footprint, OccupancyGrid};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use crate::clock::SimTime;
use crate::closed_loop::{RunControl, run};
use crate::outcome::RunOutcome;
use crate::record::{Event, NoticeKind, RecordError, Recorder};
use crate::scenario::ScenarioFile;
use crate::setup::Setup;

/// Side of a random field, m.
pub const SIDE: f64 = 30.0;
/// The two modes, as a scenario writes them.
pub const MODES: [&str; 2] = ["flywheel", "balancer"];
/// Iterations of a plan with full knowledge.
const KNOWING: u64 = 60_000;
/// The braking that is checked: reaction, s, deceleration, m/s², and what is kept before the line, m.
const REACTION: f64 = 0.1;
const DECELERATION: f64 = 0.5;
const KEPT: f64 = 0.05;
/// Spacing of the places and of the points of the outline at which the check looks, m.
const SPACING: f64 = 0.1;
/// A surprise stands this far beyond the braking distance, m, and is so large, m.
const BEYOND: f64 = 1.0;
const BLOCK: f64 = 0.8;

/// Ends on a map lie at least this far apart, m, and are drawn at most so often.
const APART: f64 = 4.0;
const TRIES: u32 = 5000;

/// Noise of laser and sensors that every ride of the campaign has.
const NOISE: &str = "\
[laser]
range_sigma_m = 0.01
dropout_probability = 0.005
[noise]
roll_sigma_deg = 0.1
roll_rate_sigma_radps = 0.01
speed_sigma_mps = 0.01
position_sigma_m = 0.01
heading_sigma_deg = 0.2
pose_rate_hz = 20.0
";

/// One ride to be made.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Which part of the campaign it belongs to.
    pub suite: String,
    /// What it is made from.
    pub seed: u64,
    /// The scenario.
    pub text: String,
    /// Whether a block comes to stand on the way.
    pub has_surprise: bool,
}

/// What one ride came to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Which part of the campaign it belongs to.
    pub suite: String,
    /// What it was made from.
    pub seed: u64,
    /// Length of the path that is planned with full knowledge, m; absent where there is none.
    pub known_length_m: Option<f64>,
    /// How it ended.
    pub outcome: RunOutcome,
    /// Why.
    pub reason: String,
    /// Way ridden, m.
    pub distance_m: f64,
    /// Simulated time, s.
    pub time_s: f64,
    /// New paths on the way.
    pub replans: u64,
    /// Least distance of the outline from a true obstacle, m.
    pub min_clearance_m: f64,
    /// Ticks in which braking would have met a true obstacle.
    pub unsafe_ticks: u64,
    /// Ticks in which braking would have led over what was not believed free.
    pub unproved_ticks: u64,
    /// Times at which what was believed free was so no more within the stopping distance.
    pub emergencies: u64,
}

/// A field with `count` discs, blocks and triangles, a start in its lower left and a goal in its upper right.
#[must_use]
pub fn field(suite: &str, seed: u64, count: usize, mode: &str, has_surprise: bool) -> Case {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut uniform = |from: f64, to: f64| from + (to - from) * unit(&mut rng);
    let (start, goal) = (Point2::new(2.0, 2.0), Point2::new(SIDE - 2.5, SIDE - 2.5));
    let mut text = format!(
        "format = 1\nname = \"{suite}-{seed}\"\n[map]\nknown = false\nbounds_m = [0, 0, {SIDE}, {SIDE}]\n"
    );
    let mut stands = 0;
    while stands < count {
        let centre = Point2::new(uniform(0.0, SIDE), uniform(0.0, SIDE));
        let size = uniform(0.2, 1.0);
        let (kind, turn, other) = (
            uniform(0.0, 1.0),
            uniform(0.0, std::f64::consts::TAU),
            uniform(0.2, 1.0),
        );
        let reach = 1.5 * size.max(other);
        let is_clear = |end: Point2| (centre - end).norm() > reach + 2.2;
        if !(is_clear(start) && is_clear(goal)) {
            continue;
        }
        stands += 1;
        let (x, y) = (centre.x, centre.y);
        let shape = if kind < 0.4 {
            format!("[[map.disc]]\ncenter_m = [{x}, {y}]\nradius_m = {size}\n")
        } else if kind < 0.7 {
            format!(
                "[[map.box]]\nmin_m = [{}, {}]\nmax_m = [{}, {}]\n",
                x - size,
                y - other,
                x + size,
                y + other
            )
        } else {
            let corner = |i: f64| {
                let p = centre + turned(turn + std::f64::consts::TAU * i / 3.0) * 1.3 * size;
                format!("[{}, {}]", p.x, p.y)
            };
            format!(
                "[[map.polygon]]\nvertices_m = [{}, {}, {}]\n",
                corner(0.0),
                corner(1.0),
                corner(2.0)
            )
        };
        text.push_str(&shape);
    }
    let _ = write!(
        text,
        "[start]\nx_m = {}\ny_m = {}\nheading_deg = 45\n[goal]\nx_m = {}\ny_m = {}\n\
         [planner]\nscale_m = 0.5\n[bike]\nmode = \"{mode}\"\n{NOISE}[run]\nduration_s = 300\nseed = {seed}\n",
        start.x, start.y, goal.x, goal.y
    );
    Case {
        suite: suite.to_owned(),
        seed,
        text,
        has_surprise,
    }
}

/// A ride across a map file, at a scale, between two places of it where the bike fits with room to spare; `None` if the seed finds none.
#[must_use]
pub fn on_map(suite: &str, file: &str, scale: f64, seed: u64, read: Read<'_>) -> Option<Case> {
    let head = format!(
        "format = 1\nname = \"{suite}-{seed}\"\n[map]\nknown = false\nfile = \"{file}\"\nscale = {scale}\n"
    );
    let ends = |x: f64, y: f64, heading: f64, goal: Point2| {
        format!(
            "[start]\nx_m = {x}\ny_m = {y}\nheading_deg = {heading}\n[goal]\nx_m = {}\ny_m = {}\n",
            goal.x, goal.y
        )
    };
    let mode = MODES[(seed % 2) as usize];
    let tail = format!(
        "[planner]\nscale_m = 0.5\n[bike]\nmode = \"{mode}\"\n{NOISE}[run]\nduration_s = 300\nseed = {seed}\n"
    );
    // Any ends, to have the world.
    let any = format!("{head}{}{tail}", ends(0.0, 0.0, 0.0, Point2::origin()));
    let setup = resolve(&any, read).ok()?;
    let world = setup.world.as_ref()?;
    let (bounds, outline) = (world.bounds(), setup.footprint.grown(0.4));
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut place = || {
        let x = bounds.min.x + bounds.width() * unit(&mut rng);
        let y = bounds.min.y + bounds.height() * unit(&mut rng);
        Pose2::new(x, y, std::f64::consts::TAU * (unit(&mut rng) - 0.5))
    };
    let mut free = |from: Option<Point2>| {
        (0..TRIES).find_map(|_| {
            let pose = place();
            let is_far = from.is_none_or(|from| (pose.position - from).norm() > APART);
            (is_far && !world.overlaps(&outline, &pose)).then_some(pose)
        })
    };
    let start = free(None)?;
    let goal = free(Some(start.position))?;
    let p = start.position;
    let text = format!(
        "{head}{}{tail}",
        ends(p.x, p.y, start.heading.to_degrees(), goal.position)
    );
    Some(Case {
        suite: suite.to_owned(),
        seed,
        text,
        has_surprise: false,
    })
}

/// Opens the files that a scenario names.
pub type Read<'a> = &'a (dyn Fn(&str) -> Result<Vec<u8>, String> + Sync);

/// Makes the rides, on as many threads as there are; the rows come in the order of the cases.
///
/// # Errors
///
/// What is wrong with a scenario.
pub fn ride_all(cases: &[Case], read: Read<'_>) -> Result<Vec<Row>, String> {
    cases.par_iter().map(|case| ride(case, read)).collect()
}

/// Makes one ride; where there is to be a surprise it is ridden twice, first to know where the way leads.
///
/// # Errors
///
/// What is wrong with the scenario.
pub fn ride(case: &Case, read: Read<'_>) -> Result<Row, String> {
    let mut text = case.text.clone();
    if case.has_surprise {
        let mut rng = ChaCha8Rng::seed_from_u64(case.seed ^ 0x5A5A);
        let after = 4.0 + 14.0 * unit(&mut rng);
        let setup = resolve(&text, read)?;
        let mut check = BrakingCheck::new(&setup);
        check.look_out_after = after;
        play(&setup, &mut check)?;
        if let Some((time, place)) = check.surprise {
            let _ = write!(
                text,
                "[[obstacle]]\nshape = \"box:{BLOCK}x{BLOCK}\"\nwaypoints_m = [[{}, {}]]\nappear_s = {time}\nhidden = true\n",
                place.x, place.y
            );
        }
    }
    let setup = resolve(&text, read)?;
    let known_length = with_full_knowledge(&setup);
    let mut check = BrakingCheck::new(&setup);
    let report = play(&setup, &mut check)?;
    let m = &report.metrics;
    Ok(Row {
        suite: case.suite.clone(),
        seed: case.seed,
        known_length_m: known_length,
        outcome: report.outcome,
        reason: report.reason,
        distance_m: m.distance_m.unwrap_or(0.0),
        time_s: m.time_s.unwrap_or(0.0),
        replans: m.replans.unwrap_or(0),
        min_clearance_m: m.min_clearance_m.unwrap_or(f64::INFINITY),
        unsafe_ticks: check.unsafe_ticks,
        unproved_ticks: check.unproved_ticks,
        emergencies: check.emergencies,
    })
}

fn resolve(text: &str, read: Read<'_>) -> Result<Setup, String> {
    let file = ScenarioFile::parse(text, &[]).map_err(|error| error.to_string())?;
    Setup::resolve(&file, &mut |name| read(name)).map_err(|error| error.to_string())
}

fn play(setup: &Setup, check: &mut BrakingCheck<'_>) -> Result<crate::RunReport, String> {
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    run(setup, check, control).map_err(|error| format!("{}: {error}", setup.name))
}

/// Length of the path that the planner finds with full knowledge, m: of the map and of what comes to stand there.
fn with_full_knowledge(setup: &Setup) -> Option<f64> {
    let world = setup.world.as_ref()?;
    let end = SimTime::from_seconds(1e4).seconds();
    let later = setup
        .traffic
        .obstacles()
        .iter()
        .filter_map(|obstacle| obstacle.outline_at(end));
    let obstacles = world.obstacles().iter().cloned().chain(later).collect();
    let world =
        bikebot_world::World::build(world.bounds(), obstacles, world.grid().cloned()).ok()?;
    let start = EndPose {
        curvature: Some(0.0),
        ..setup.start_pose?
    };
    let problem = PlanningProblem {
        world: &world,
        footprint: setup.planning_footprint.clone(),
        start,
        goal: setup.goal?,
        max_curvature: setup.planner.max_curvature,
    };
    let params = PlannerParams {
        starts: 16,
        ..setup.planner.clone()
    };
    let report = plan(
        &problem,
        &params,
        setup.seed,
        &Budget::of_iterations(KNOWING),
    )
    .ok()?;
    match (report.outcome, report.path) {
        (Outcome::Found, Some(PlannedPath::Curves(path))) => Some(path.length()),
        _ => None,
    }
}

/// Watches a ride, and whether it could have been stopped safely at each tick.
pub struct BrakingCheck<'s> {
    setup: &'s Setup,
    path: Vec<Pose2>,
    belief: Option<OccupancyGrid>,
    /// Index of the bike on the path.
    at: usize,
    distance: f64,
    last: Option<Point2>,
    /// Way after which to say where a surprise would stand, m.
    look_out_after: f64,
    /// When, s, and where.
    surprise: Option<(f64, Point2)>,
    unsafe_ticks: u64,
    unproved_ticks: u64,
    emergencies: u64,
}

impl<'s> BrakingCheck<'s> {
    /// Of a ride of this setup.
    #[must_use]
    pub fn new(setup: &'s Setup) -> Self {
        Self {
            setup,
            path: Vec::new(),
            belief: None,
            at: 0,
            distance: 0.0,
            last: None,
            look_out_after: f64::INFINITY,
            surprise: None,
            unsafe_ticks: 0,
            unproved_ticks: 0,
            emergencies: 0,
        }
    }

    /// Ticks in which braking would have met a true obstacle, and in which it would have led over what was not believed free.
    #[must_use]
    pub fn violations(&self) -> (u64, u64) {
        (self.unsafe_ticks, self.unproved_ticks)
    }

    fn look(&mut self, time: f64, pose: &Pose2, speed: f64) {
        if let Some(last) = self.last {
            self.distance += (pose.position - last).norm();
        }
        self.last = Some(pose.position);
        if self.path.is_empty() {
            return;
        }
        let away = |i: usize| (self.path[i].position - pose.position).norm_squared();
        let window = self.at.saturating_sub(20)..(self.at + 40).min(self.path.len());
        self.at = window
            .min_by(|a, b| away(*a).total_cmp(&away(*b)))
            .unwrap_or(self.at);
        let braking = REACTION * speed + speed * speed / (2.0 * DECELERATION) + KEPT;
        if self.surprise.is_none() && self.distance >= self.look_out_after {
            // Where the front would stand after braking, and a metre more.
            let front = 1.46;
            let ahead = braking + front + BEYOND + 0.5 * BLOCK;
            let index = self.at + (ahead / STEP) as usize;
            if index + 60 < self.path.len() {
                self.surprise = Some((time, self.path[index].position));
            } else {
                self.look_out_after = f64::INFINITY;
            }
        }
        let last = (self.at + (braking / STEP).ceil() as usize).min(self.path.len() - 1);
        let every = (SPACING / STEP) as usize;
        let places = (self.at..=last).step_by(every).chain([last]);
        let (mut is_safe, mut is_proved) = (true, true);
        for index in places {
            let place = self.path[index];
            is_safe &= self.is_safe(time, &place);
            is_proved = is_proved && self.is_proved(pose, &place);
        }
        self.unsafe_ticks += u64::from(!is_safe);
        self.unproved_ticks += u64::from(!is_proved);
    }

    fn is_safe(&self, time: f64, place: &Pose2) -> bool {
        let (setup, outline) = (self.setup, &self.setup.footprint);
        let stands = setup
            .world
            .as_ref()
            .is_some_and(|world| world.overlaps(outline, place));
        !stands && setup.traffic.clearance(outline, place, time) >= 0.0
    }

    /// Whether the outline at `place` covers only cells believed free, or that it stands on at `now`, or stood on at the start.
    fn is_proved(&self, now: &Pose2, place: &Pose2) -> bool {
        let Some(belief) = &self.belief else {
            return true;
        };
        let zone = self
            .setup
            .online
            .as_ref()
            .map_or(0.0, |online| online.params.start_zone);
        let covers = |pose: &Pose2, p: Point2, by: f64| {
            let local = pose.inverse().transform(p);
            match self.setup.footprint {
                Footprint::Capsule {
                    rear,
                    front,
                    radius,
                } => (local.x - local.x.clamp(rear, front)).hypot(local.y) <= radius + by,
                _ => local.coords.norm() <= self.setup.footprint.reach() + by,
            }
        };
        let reach = self.setup.footprint.reach();
        let steps = (2.0 * reach / SPACING).ceil() as i32;
        for i in 0..=steps {
            for j in 0..=steps {
                let local = Point2::new(
                    -reach + SPACING * f64::from(i),
                    -reach + SPACING * f64::from(j),
                );
                let p = place.transform(local);
                if !covers(place, p, 0.0)
                    || covers(now, p, 0.15)
                    || covers(&self.setup.start.pose, p, zone)
                {
                    continue;
                }
                let cell = belief.world_to_cell(p).and_then(|(x, y)| belief.cell(x, y));
                if cell != Some(Cell::Free) {
                    return false;
                }
            }
        }
        true
    }
}

/// Spacing of the path in force, m.
const STEP: f64 = 0.05;

impl Recorder for BrakingCheck<'_> {
    fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
        match event {
            Event::Plan(plan) => {
                // Joints of the curves come in between: spaced evenly again.
                self.path.clear();
                let mut next = 0.0;
                for sample in plan.path {
                    while sample.s >= next - 1e-9 {
                        self.path
                            .push(Pose2::new(sample.x, sample.y, sample.heading));
                        next += STEP;
                    }
                }
            }
            Event::Belief(grid) => self.belief = Some((*grid).clone()),
            Event::State(state) => {
                let pose = Pose2::new(state.x_m, state.y_m, state.heading_rad);
                self.look(time.seconds(), &pose, state.speed_mps);
            }
            Event::Notice {
                kind: NoticeKind::Emergency,
                ..
            } => self.emergencies += 1,
            _ => {}
        }
        Ok(())
    }
}

fn unit(rng: &mut ChaCha8Rng) -> f64 {
    (rng.next_u64() >> 11) as f64 * 2.0_f64.powi(-53)
}

fn turned(angle: f64) -> Vector2 {
    let (sin, cos) = angle.sin_cos();
    Vector2::new(cos, sin)
}

/// The figures of one suite.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Its name.
    pub suite: String,
    /// Rides made.
    pub rides: usize,
    /// Those for which there is a path with full knowledge.
    pub solvable: usize,
    /// Of those, the ones that arrived.
    pub arrived: usize,
    /// Stopped or never set off, upright, with a reason.
    pub stopped: usize,
    /// Collisions.
    pub collided: usize,
    /// Falls.
    pub fell: usize,
    /// Neither arrived nor given up in time.
    pub timed_out: usize,
    /// Median of the ridden length over that with full knowledge, of those that arrived.
    pub ratio_median: f64,
    /// Ticks in which braking would have met a true obstacle.
    pub unsafe_ticks: u64,
    /// Ticks in which braking would have led over what was not believed free.
    pub unproved_ticks: u64,
    /// Times at which what was believed free was so no more within the stopping distance.
    pub emergencies: u64,
}

/// The figures of each suite, in the order in which they come.
#[must_use]
pub fn summaries(rows: &[Row]) -> Vec<Summary> {
    let mut suites: Vec<&str> = rows.iter().map(|row| row.suite.as_str()).collect();
    suites.dedup();
    suites
        .into_iter()
        .map(|suite| {
            let of: Vec<&Row> = rows.iter().filter(|row| row.suite == suite).collect();
            let ended =
                |outcome: RunOutcome| of.iter().filter(|row| row.outcome == outcome).count();
            let solvable: Vec<&&Row> = of
                .iter()
                .filter(|row| row.known_length_m.is_some())
                .collect();
            let mut ratios: Vec<f64> = solvable
                .iter()
                .filter(|row| row.outcome == RunOutcome::Arrived)
                .filter_map(|row| Some(row.distance_m / row.known_length_m?))
                .collect();
            ratios.sort_by(f64::total_cmp);
            Summary {
                suite: suite.to_owned(),
                rides: of.len(),
                solvable: solvable.len(),
                arrived: ratios.len(),
                stopped: ended(RunOutcome::Stopped) + ended(RunOutcome::NoPath),
                collided: ended(RunOutcome::Collided),
                fell: ended(RunOutcome::Fell),
                timed_out: ended(RunOutcome::TimedOut),
                ratio_median: ratios.get(ratios.len() / 2).copied().unwrap_or(f64::NAN),
                unsafe_ticks: of.iter().map(|row| row.unsafe_ticks).sum(),
                unproved_ticks: of.iter().map(|row| row.unproved_ticks).sum(),
                emergencies: of.iter().map(|row| row.emergencies).sum(),
            }
        })
        .collect()
}

/// The summaries as a Markdown table.
#[must_use]
pub fn markdown(summaries: &[Summary]) -> String {
    let mut text = String::from(
        "| suite | rides | solvable | arrived | stopped | collided | fell | timed out | ridden / known | unsafe ticks | unproved ticks | emergencies |\n\
         |---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n",
    );
    for s in summaries {
        let share = 100.0 * s.arrived as f64 / s.solvable.max(1) as f64;
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} ({share:.0} %) | {} | {} | {} | {} | {:.3} | {} | {} | {} |",
            s.suite,
            s.rides,
            s.solvable,
            s.arrived,
            s.stopped,
            s.collided,
            s.fell,
            s.timed_out,
            s.ratio_median,
            s.unsafe_ticks,
            s.unproved_ticks,
            s.emergencies
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn no_files(_: &str) -> Result<Vec<u8>, String> {
        Err("no files here".into())
    }

    #[test]
    fn some_random_fields_are_crossed_without_a_touch_in_both_modes() {
        let cases: Vec<Case> = (0..4)
            .map(|seed| field("small", seed, 50, MODES[(seed % 2) as usize], seed > 1))
            .collect();
        let rows = ride_all(&cases, &no_files).expect("scenarios that make sense");
        for row in &rows {
            assert_ne!(row.outcome, RunOutcome::Collided, "{row:?}");
            assert_ne!(row.outcome, RunOutcome::Fell, "{row:?}");
            assert!(row.min_clearance_m > 0.0, "{row:?}");
            assert_eq!(row.unsafe_ticks, 0, "{row:?}");
        }
        let summary = &summaries(&rows)[0];
        assert!(summary.arrived + 1 >= summary.solvable, "{rows:?}");
        assert!(markdown(&summaries(&rows)).lines().count() == 3);
    }
}
