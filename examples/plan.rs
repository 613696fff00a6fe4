//! Plans a path through a small yard and prints it.
//!
//! `cargo run --release --example plan`

#![allow(
    clippy::print_stdout,
    reason = "a program for a terminal: what it prints is its result"
)]

use bikebot::geometry::Point2;
use bikebot::planner::{
    Budget, EndPose, GoalRegion, Outcome, PlannerParams, PlanningProblem, plan,
};
use bikebot::world::{Bounds, Obstacle, World};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // ANCHOR: world
    // A yard of 20 m by 20 m with a shed, a tree and a fence. Its edge is a wall.
    let shed = Obstacle::Block {
        min: Point2::new(6.0, 0.0),
        max: Point2::new(9.0, 11.0),
    };
    let tree = Obstacle::Disc {
        center: Point2::new(12.0, 14.0),
        radius: 1.0,
    };
    let fence = Obstacle::Polygon {
        vertices: vec![
            Point2::new(13.0, 7.0),
            Point2::new(20.0, 9.0),
            Point2::new(20.0, 9.4),
            Point2::new(13.0, 7.4),
        ],
    };
    let world = World::new(Bounds::new(0.0, 0.0, 20.0, 20.0), vec![shed, tree, fence])?;
    // ANCHOR_END: world

    // ANCHOR: plan
    // The steps of the search suit a field of 100 m; this one is smaller.
    let params = PlannerParams {
        scale: 0.5,
        ..PlannerParams::default()
    };
    let problem = PlanningProblem {
        world: &world,
        // The bike's own outline, carried by its rear contact point.
        footprint: params.parse_footprint()?,
        start: EndPose::pose(2.0, 2.0, 0.5 * std::f64::consts::PI),
        goal: GoalRegion {
            position: Point2::new(17.0, 3.0),
            heading: None,
            tolerance: 0.3,
        },
        max_curvature: params.max_curvature,
    };
    // The same seed gives the same path, on any machine.
    let report = plan(&problem, &params, 1, &Budget::unlimited())?;
    // ANCHOR_END: plan

    // That there is no path is an answer, not an error.
    let (Outcome::Found, Some(path), Some(metrics)) =
        (report.outcome, &report.path, &report.metrics)
    else {
        println!("{:?}: {:?}", report.outcome, report.reason);
        return Ok(());
    };
    println!("found after {} iterations", report.iterations);
    println!("length          {:8.3} m", metrics.length);
    println!("least clearance {:8.3} m", metrics.min_clearance);
    if let Some(curvature) = metrics.max_curvature {
        println!(
            "max curvature   {curvature:8.3} 1/m of {}",
            problem.max_curvature
        );
    }
    println!("\n   x, m    y, m  heading, deg  curvature, 1/m");
    for point in path.sample(1.0) {
        println!(
            "{:7.3} {:7.3} {:13.1} {:15.3}",
            point.position.x,
            point.position.y,
            point.heading.to_degrees(),
            point.curvature
        );
    }
    Ok(())
}
