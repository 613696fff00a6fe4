//! Rides among things that move: 200 fields drawn from seeds, in both modes, with noise, judged by the truth.
//!
//! ```sh
//! cargo run --release --example crossing -- --seeds 0..200 --jobs 0
//! ```
//!
//! Exit code 1 if the bike met something that had left it room.

#![allow(clippy::print_stdout, reason = "an example shows what it found")]

use bikebot::sim::study::crossing;
use std::process::ExitCode;

fn main() -> Result<ExitCode, String> {
    let (mut seeds, mut jobs) = (0..200, 0);
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let value = words
            .next()
            .ok_or_else(|| format!("{word} lacks its value"))?;
        let number = |text: &str| {
            text.parse::<u64>()
                .map_err(|error| format!("{word} {value}: {error}"))
        };
        match word.as_str() {
            "--seeds" => {
                let (from, to) = value
                    .split_once("..")
                    .ok_or_else(|| format!("--seeds {value}? FROM..TO"))?;
                seeds = number(from)?..number(to)?;
            }
            "--jobs" => jobs = number(&value)? as usize,
            _ => return Err(format!("{word}? --seeds FROM..TO or --jobs N")),
        }
    }
    let rows = crossing::ride_all(seeds, jobs)?;
    print!("{}", crossing::text(&rows));
    Ok(if rows.iter().any(crossing::Row::is_violation) {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    })
}
