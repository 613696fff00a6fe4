//! The campaign on unknown fields, with the check of every braking manoeuvre:
//!
//! ```sh
//! cargo run --release --example online -- --suites fields,surprise,corridor,maps --rides 300 --format markdown
//! ```
//!
//! With `--write FOLDER` nothing is judged; the scenarios are written there, for `bikebot run` to show one of them.
//!
//! The maps are read from `../shared/data/ros_maps` and left out where that is not there. Exit code 1 for a collision or a fall.

#![allow(clippy::print_stdout, reason = "an example shows what it found")]

use bikebot::sim::study::online::{self, Case, MODES};
use std::process::ExitCode;

/// Obstacles on the 900 m² of a field; up to the last nine of ten fields can be crossed with full knowledge.
const DENSITIES: [usize; 6] = [40, 60, 80, 100, 120, 140];

fn main() -> Result<ExitCode, String> {
    let (mut suites, mut rides, mut format) = (
        "fields,surprise,corridor,maps".to_owned(),
        300,
        "markdown".to_owned(),
    );
    let (mut first, mut density, mut folder) = (0, None, None);
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let value = words
            .next()
            .ok_or_else(|| format!("{word} lacks its value"))?;
        let number = || {
            value
                .parse::<u64>()
                .map_err(|error| format!("{word}: {error}"))
        };
        match word.as_str() {
            "--suites" => suites = value,
            "--rides" => rides = number()?,
            "--first" => first = number()?,
            "--density" => density = Some(number()? as usize),
            "--format" => format = value,
            "--write" => folder = Some(value),
            _ => {
                return Err(format!(
                    "{word}? --suites fields,surprise,corridor,maps, --rides N, --first SEED, --density N, --format markdown|json|rows, --write FOLDER"
                ));
            }
        }
    }
    let read = |name: &str| std::fs::read(name).map_err(|error| error.to_string());
    let mut cases: Vec<Case> = Vec::new();
    for suite in suites.split(',') {
        match suite {
            "fields" | "surprise" => cases.extend((first..first + rides).map(|seed| {
                let which = (seed / 2) as usize % DENSITIES.len();
                let mode = MODES[(seed % 2) as usize];
                let count = density.unwrap_or(DENSITIES[which]);
                online::field(suite, seed, count, mode, suite == "surprise")
            })),
            "corridor" => cases.extend(
                (first..first + rides.min(100))
                    .map(|seed| online::corridor("corridor", seed, MODES[(seed % 2) as usize])),
            ),
            "maps" => {
                let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/ros_maps");
                for (name, file, scale) in [
                    ("turtlebot3", "turtlebot3_world/map.yaml", 4.0),
                    ("depot", "nav2/depot.yaml", 1.0),
                ] {
                    let file = format!("{folder}/{file}");
                    cases.extend(
                        (first..first + rides.min(50))
                            .filter_map(|seed| online::on_map(name, &file, scale, seed, &read)),
                    );
                }
            }
            other => {
                return Err(format!(
                    "--suites {other}? fields, surprise, corridor or maps"
                ));
            }
        }
    }
    if let Some(folder) = folder {
        std::fs::create_dir_all(&folder).map_err(|error| format!("{folder}: {error}"))?;
        for case in &cases {
            let file = format!("{folder}/{}-{}.toml", case.suite, case.seed);
            std::fs::write(&file, online::scenario(case, &read)?)
                .map_err(|error| format!("{file}: {error}"))?;
        }
        return Ok(ExitCode::SUCCESS);
    }
    let rows = online::ride_all(&cases, &read)?;
    let summaries = online::summaries(&rows);
    match format.as_str() {
        "markdown" => print!("{}", online::markdown(&summaries)),
        "json" => println!(
            "{}",
            serde_json::to_string_pretty(&(&summaries, &rows)).map_err(|error| error.to_string())?
        ),
        "rows" => rows.iter().for_each(|row| println!("{row:?}")),
        other => return Err(format!("--format {other}? markdown, json or rows")),
    }
    let is_safe = summaries.iter().all(|s| s.collided == 0 && s.fell == 0);
    Ok(if is_safe {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}
