//! Measures every row of the paper's Table 2 on the yard and prints it in Markdown.
//!
//! `cargo run --release --example table2 [RUNS]`

#![allow(
    clippy::print_stdout,
    reason = "a program for a terminal: what it prints is its result"
)]

use bikebot::planner::{EndPose, GoalRegion, PlannerParams, PlanningProblem};
use bikebot::sim::study::Table2Study;
use bikebot::world::Footprint;
use bikebot::world::formats::{MapOptions, load};
use std::time::Instant;

/// Our reconstruction of the paper's field, with the poses to start from and to reach.
const YARD: &[u8] = include_bytes!("../scenarios/maps/fig6.json");

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let runs = match std::env::args().nth(1) {
        Some(text) => text.parse()?,
        None => 20,
    };
    let no_other_file = &mut |name: &str| Err(name.to_owned());
    let map = load("fig6.json", YARD, &MapOptions::default(), no_other_file)?;
    let (Some(start), Some(goal)) = (map.start, map.goal) else {
        return Err("the yard names its ends".into());
    };
    let params = PlannerParams::table_1();
    let problem = PlanningProblem {
        world: &map.world,
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
    // The libraries read no clock; whoever wants times lends one.
    let began = Instant::now();
    let study = Table2Study {
        problem: &problem,
        params: &params,
        runs,
        seed: 1,
        jobs: 1,
        clock: &|| began.elapsed().as_secs_f64(),
        stop: &|| false,
    };
    print!("{}", study.measure(&mut || {})?.to_markdown(true));
    Ok(())
}
