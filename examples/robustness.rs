//! The reference course under 44 changes of bike, sensors, pushes and laws, in both modes, beside figures computed
//! independently:
//!
//! ```sh
//! cargo run --release --example robustness -- --plants bike3d,rapier3d --format markdown
//! ```
//!
//! Exit code 1 if a row fails that the reference holds.

#![allow(clippy::print_stdout, reason = "an example shows what it found")]

use bikebot::sim::study::{robustness, robustness_text};
use std::process::ExitCode;

fn main() -> Result<ExitCode, String> {
    let mut plants = vec!["bike3d".to_owned()];
    let mut format = "text".to_owned();
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let value = words
            .next()
            .ok_or_else(|| format!("{word} lacks its value"))?;
        match word.as_str() {
            "--plants" => plants = value.split(',').map(str::to_owned).collect(),
            "--format" => format = value,
            _ => {
                return Err(format!(
                    "{word}? --plants A,B or --format text|markdown|csv"
                ));
            }
        }
    }
    let vectors = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/data/vectors/acceptance.json"
    );
    let json = std::fs::read_to_string(vectors).map_err(|error| format!("{vectors}: {error}"))?;
    let rows = robustness::ride_all(&plants, &robustness::references(&json)?, 0)?;
    match format.as_str() {
        "text" => print!("{}", robustness_text::text(&rows)),
        "markdown" => print!("{}", robustness_text::markdown(&rows)),
        "csv" => print!("{}", robustness_text::csv(&rows)),
        other => return Err(format!("--format {other}? text, markdown or csv")),
    }
    Ok(if rows.iter().all(robustness::Row::is_as_good) {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}
