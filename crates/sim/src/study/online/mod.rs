//! The campaign on unknown fields: random ones from seeds, with and without a block that comes to stand on the way, and real maps.
//!
//! Every ride is watched by a [`BrakingCheck`], which shares no code with the navigator: at each tick it plays the braking manoeuvre along the path
//! in force and samples the bike's outline densely, in the true world and on the recorded belief.

use std::fmt::Write as _;

mod braking_check;
mod cases;
mod table;

use bikebot_planner::{
    Budget, EndPose, Meter, MotionChecker, Outcome, PlannedPath, PlannerParams, PlanningProblem,
    lattice, plan,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use crate::clock::SimTime;
use crate::closed_loop::{RunControl, run};
use crate::outcome::RunOutcome;
use crate::scenario::ScenarioFile;
use crate::setup::Setup;

pub use braking_check::BrakingCheck;
pub use cases::{Case, MODES, SIDE, corridor, field, on_map};
pub use table::{Summary, markdown, summaries};

use braking_check::{BLOCK, Surprise};
use cases::unit;

/// Iterations of a plan with full knowledge, and states of the search after it.
const KNOWING: u64 = 60_000;
const STATES: u64 = 400_000;

/// What one ride came to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Which part of the campaign it belongs to.
    pub suite: String,
    /// What it was made from.
    pub seed: u64,
    /// Length of the way with full knowledge, m; absent where there is none. A block that comes to stand on the way is known from the moment on
    /// in which it does: what was ridden until then, and the way from there.
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
    /// Times at which the path in force went over to the other side of the block in the corridor.
    pub side_changes: u64,
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
    let (text, met) = with_its_surprise(case, read)?;
    let setup = resolve(&text, read)?;
    let start = setup.start_pose.map(|start| EndPose {
        curvature: Some(0.0),
        ..start
    });
    // What could not be known before it was there is known from then on.
    let (start, ridden) = met.map_or((start, 0.0), |met| (Some(met.from), met.ridden));
    let known_length = start
        .and_then(|start| with_full_knowledge(&setup, start))
        .map(|length| ridden + length);
    let mut check = BrakingCheck::new(&setup);
    check.two_sides_of = case.two_sides_of;
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
        side_changes: check.side_changes(),
    })
}

/// The scenario that is ridden in the end, as text: with the block that comes to stand on the way, if one does.
///
/// # Errors
///
/// What is wrong with the scenario.
pub fn scenario(case: &Case, read: Read<'_>) -> Result<String, String> {
    Ok(with_its_surprise(case, read)?.0)
}

fn with_its_surprise(case: &Case, read: Read<'_>) -> Result<(String, Option<Surprise>), String> {
    let mut text = case.text.clone();
    let mut met = None;
    if case.has_surprise {
        let mut rng = ChaCha8Rng::seed_from_u64(case.seed ^ 0x5A5A);
        let after = 4.0 + 14.0 * unit(&mut rng);
        let setup = resolve(&text, read)?;
        let mut check = BrakingCheck::new(&setup);
        check.look_out_after = after;
        play(&setup, &mut check)?;
        met = check.surprise;
        if let Some(Surprise { time, place, .. }) = met {
            let _ = write!(
                text,
                "[[obstacle]]\nshape = \"box:{BLOCK}x{BLOCK}\"\nwaypoints_m = [[{}, {}]]\nappear_s = {time}\nhidden = true\n",
                place.x, place.y
            );
        }
    }
    Ok((text, met))
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

/// Length of the way from `start` that is found with full knowledge, m: of the map and of what comes to stand there.
///
/// The planner looks for it, and where that finds nothing a search over poses, with no more room than the bike needs: whoever
/// knows everything may take his time.
fn with_full_knowledge(setup: &Setup, start: EndPose) -> Option<f64> {
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
    let mut problem = PlanningProblem {
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
    let budget = Budget::of_iterations(KNOWING);
    if let Ok(report) = plan(&problem, &params, setup.seed, &budget)
        && let (Outcome::Found, Some(PlannedPath::Curves(path))) = (report.outcome, report.path)
    {
        return Some(path.length());
    }
    let allowance = setup.online.as_ref()?.params.tracking_allowance;
    problem.footprint = setup.footprint.grown(allowance);
    let resolution = setup.planner.clearance_resolution();
    let checker = MotionChecker::new(&world, &problem.footprint, 0.0, resolution);
    let budget = Budget::of_iterations(STATES);
    let found = lattice::search(
        &problem,
        &checker,
        lattice::Grain::COARSE,
        &mut Meter::new(&budget),
    );
    Some(found.path?.length())
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

    #[test]
    fn of_two_equal_ways_one_is_chosen_and_kept() {
        let cases: Vec<Case> = (0..4)
            .map(|seed| corridor("corridor", seed, MODES[(seed % 2) as usize]))
            .collect();
        for row in ride_all(&cases, &no_files).expect("scenarios that make sense") {
            assert_eq!(row.outcome, RunOutcome::Arrived, "{row:?}");
            assert!(row.side_changes <= 1, "{row:?}");
        }
    }
}
