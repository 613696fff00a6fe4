//! A whole ride in memory: scenario text in, outcome and numbers out.
//!
//! `cargo run --release --example closed_loop`

#![allow(clippy::print_stdout, reason = "an example shows what it found")]

use bikebot::sim::record::Trace;
use bikebot::sim::{RunControl, ScenarioFile, Setup, run};

// A scenario is TOML; everything it leaves out has a default.
const SCENARIO: &str = r#"
format = 1
name = "slalom"

[path]
waypoints = [[0.0, 0.0, 0.0], [5.0, 2.0, 0.0], [10.0, 0.0, 0.0], [15.0, 2.0, 0.0]]

[bike]
mode = "balancer"
"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // ANCHOR: run
    let file = ScenarioFile::parse(SCENARIO, &[])?;
    // This scenario names no files; one that does gets them from here.
    let setup = Setup::resolve(&file, &mut |name| {
        std::fs::read(name).map_err(|error| error.to_string())
    })?;
    let mut trace = Trace::default();
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    let report = run(&setup, &mut trace, control)?;
    // ANCHOR_END: run

    println!("{} ({})", report.outcome, report.reason);
    for (name, value) in report.metrics.iter() {
        println!("{name:28} {value:10.4}");
    }
    let (time, roll) = trace.column("roll_rad").ok_or("the trace holds the roll")?;
    for (t, roll) in time.iter().zip(roll).step_by(200) {
        println!("{t:6.2} s  roll {:6.2}°", roll.to_degrees());
    }
    Ok(())
}
