//! Draws a ride as SVG: planned and ridden path, the bike's outline as time goes by, speed, roll and lateral error.
//!
//! `cargo run --release --example draw -- scenarios/fig7.toml > fig7.svg`

#![allow(clippy::print_stdout, reason = "an example shows what it found")]

use bikebot::report::{Ground, Ride, RideFigure, svg};
use bikebot::sim::{RunControl, ScenarioFile, Setup, record::Trace, run};
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = PathBuf::from(std::env::args().nth(1).ok_or("name a scenario")?);
    let folder = path.parent().map(Path::to_owned).unwrap_or_default();
    let file = ScenarioFile::parse(&std::fs::read_to_string(&path)?, &[])?;
    let setup = Setup::resolve(&file, &mut |name| {
        std::fs::read(folder.join(name)).map_err(|error| error.to_string())
    })?;
    let mut trace = Trace::default();
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    let report = run(&setup, &mut trace, control)?;
    let ride = Ride::new(&trace, &setup.footprint)?;
    let ground = setup.world.as_ref().map(Ground::from);
    let facts = format!("{}, seed {}", report.outcome, setup.seed);
    let figure = RideFigure::new(&ride, ground, setup.name.as_str(), facts);
    print!("{}", svg::write(&figure.draw()));
    Ok(())
}
