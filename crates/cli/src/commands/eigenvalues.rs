//! `bikebot eigenvalues`: critical speeds and modes of a bicycle.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use bikebot_dynamics::whipple::{
    CriticalSpeeds, Modes, ParameterFile, ParameterFileError, SpeedRange, SteeringAssembly,
};
use bikebot_dynamics::{BalancerMode, BikeParams, Whipple, WhippleParams};
use bikebot_report::EigenvalueFigure;
use clap::Args;
use serde::Serialize;

use crate::args::{Changes, Force, positive};
use crate::diag::Diagnostic;
use crate::exit::{Ending, Exit, Failure};
use crate::input::{self, Loaded};
use crate::output::Output;
use crate::picture;
use crate::render::{self, Sheet};
use crate::terminal::Terminal;

/// Largest parameter file that is read, bytes; real ones have a thousand.
const MAX_PARAMETER_BYTES: u64 = 1 << 20;
/// Name of the benchmark bicycle among the presets.
const BENCHMARK: &str = "benchmark";
/// Highest speed that is asked for, m/s, and most speeds in one table.
const MAX_SPEED: f64 = 1000.0;
const MAX_SPEEDS: usize = 100_000;
/// Points along each curve of the figure.
const CURVE_POINTS: usize = 301;

/// Critical speeds and eigenvalues of a bicycle, as a table and as a picture
///
/// PARAMETERS is a file of the 25 parameters of Meijaard et al. (2007) as the
/// BicycleParameters collection writes them (`w = 1.02+/-0.002` or YAML), or a
/// preset: `benchmark` is the article's bicycle, `default` and `low_pivot` are
/// the bike robot with its balancer locked in flywheel mode and the wheels, fork
/// and steering axis of an e-bike. A scenario (.toml) stands for its own bike. A
/// preset's name wins over a file of the same name; write ./benchmark for the file.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot eigenvalues benchmark
  bikebot eigenvalues benchmark -o benchmark.svg
  bikebot eigenvalues BrowserBenchmark.txt --speeds 0:8:33 -o browser.csv -o browser.png
  bikebot eigenvalues scenarios/fig7.toml --speeds 1,2,3
  bikebot eigenvalues default --json | jq .stable

The collection: https://github.com/moorepants/BicycleParameters")]
pub struct EigenvaluesArgs {
    /// Parameter file, scenario (.toml), or a preset: benchmark, default or low_pivot
    #[arg(value_name = "PARAMETERS")]
    pub parameters: PathBuf,
    /// Speeds of the table in m/s, A:B:N (N values from A to B) or A,B,… [default: 0 to 10 or
    /// past the critical speeds, every half metre a second]
    #[arg(long, value_name = "A:B:N|A,B,…", allow_hyphen_values = true)]
    pub speeds: Option<Speeds>,
    /// Write the table (.csv) or the picture (.svg, .png) to this file; repeatable
    #[arg(short, long, value_name = "FILE.csv|.svg|.png")]
    pub output: Vec<PathBuf>,
    /// Pixels of a PNG to one of the drawing, which is 1200 wide
    #[arg(long, value_name = "X", default_value_t = 1.0, allow_hyphen_values = true, value_parser = positive)]
    pub zoom: f64,
    #[command(flatten)]
    pub force: Force,
    /// One JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

/// The speeds of a table, m/s.
#[derive(Debug, Clone, PartialEq)]
pub struct Speeds(Vec<f64>);

impl FromStr for Speeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let speed = |text: &str| {
            let text = text.trim();
            match text.parse::<f64>() {
                Ok(speed) if (0.0..=MAX_SPEED).contains(&speed) => Ok(speed),
                Ok(speed) => Err(format!(
                    "a speed of {speed} m/s is not from 0 to {MAX_SPEED}"
                )),
                Err(_) => Err(format!(
                    "`{text}` is not a number; say 0:10:21 for 21 speeds from 0 to 10 m/s, or 1,2,5"
                )),
            }
        };
        let parts: Vec<&str> = text.split(':').collect();
        let [from, to, count] = parts[..] else {
            if parts.len() > 1 {
                return Err("a range is A:B:N, such as 0:10:21".into());
            }
            let list = text.split(',').map(speed).collect::<Result<Vec<_>, _>>()?;
            return if list.len() > MAX_SPEEDS {
                Err(format!("more than {MAX_SPEEDS} speeds"))
            } else {
                Ok(Self(list))
            };
        };
        let (from, to) = (speed(from)?, speed(to)?);
        let count = count
            .trim()
            .parse::<usize>()
            .ok()
            .filter(|count| (1..=MAX_SPEEDS).contains(count))
            .ok_or_else(|| format!("`{count}` is not a whole number from 1 to {MAX_SPEEDS}"))?;
        Ok(Self(evenly(from, to, count)))
    }
}

/// `count` values from `from` to `to`, exact at both ends.
fn evenly(from: f64, to: f64, count: usize) -> Vec<f64> {
    let last = count.max(2) - 1;
    let share = |i: usize| i as f64 / last as f64;
    (0..count)
        .map(|i| from * (1.0 - share(i)) + to * share(i))
        .collect()
}

/// A bicycle and what is known of it.
struct Bicycle {
    name: String,
    /// What the set is, for people.
    about: String,
    params: WhippleParams,
    deviations: Vec<(&'static str, f64)>,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct EigenvaluesJson<'a> {
    name: &'a str,
    parameters: &'a WhippleParams,
    #[serde(rename = "M")]
    mass: [[f64; 2]; 2],
    #[serde(rename = "C1")]
    damping: [[f64; 2]; 2],
    #[serde(rename = "K0")]
    gravity_stiffness: [[f64; 2]; 2],
    #[serde(rename = "K2")]
    speed_stiffness: [[f64; 2]; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    weave_speed_mps: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    weave_speed_deviation_mps: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    capsize_speed_mps: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    capsize_speed_deviation_mps: Option<f64>,
    stable: &'a [SpeedRange],
    eigenvalues: Vec<ModesJson>,
    remarks: &'a [String],
    files: Vec<String>,
    version: &'static str,
}

/// One row: real and imaginary parts, 1/s and rad/s.
#[derive(Debug, Serialize)]
struct ModesJson {
    speed_mps: f64,
    weave: [[f64; 2]; 2],
    capsize: [f64; 2],
    caster: [f64; 2],
    stable: bool,
}

impl From<&Modes> for ModesJson {
    fn from(modes: &Modes) -> Self {
        Self {
            speed_mps: modes.speed,
            weave: modes.weave.map(|value| [value.re, value.im]),
            capsize: [modes.capsize.re, modes.capsize.im],
            caster: [modes.caster.re, modes.caster.im],
            stable: modes.is_stable(),
        }
    }
}

/// Formats of output files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Csv,
    Picture(picture::Format),
}

/// Computes, writes, tells.
pub fn run(args: &EigenvaluesArgs, terminal: &Terminal) -> Ending {
    let formats = args
        .output
        .iter()
        .map(|path| format_of(path))
        .collect::<Result<Vec<_>, _>>()?;
    let bicycle = bicycle(&args.parameters)?;
    let refused = |error: bikebot_dynamics::DynamicsError| {
        Failure::usage(Diagnostic::error(format!("{}: {error}", bicycle.name)))
    };
    let whipple = Whipple::new(&bicycle.params).map_err(refused)?;
    let critical = whipple.critical_speeds();
    let deviations = CriticalSpeeds::deviations(&bicycle.params, &bicycle.deviations);
    let remarks = bicycle.params.remarks();
    for remark in &remarks {
        terminal.warn(&Diagnostic::warning(remark.clone()));
    }
    let speeds = match &args.speeds {
        Some(speeds) => speeds.0.clone(),
        None => critical.usual_speeds(),
    };
    let table = whipple.modes(&speeds).map_err(refused)?;

    let mut outputs = Vec::new();
    for (path, format) in args.output.iter().zip(formats) {
        let bytes = contents(format, &whipple, &critical, &bicycle, &table, args.zoom)?;
        outputs.push((Output::create(path, args.force.force)?, bytes));
    }
    let mut files = Vec::new();
    for (output, bytes) in outputs {
        files.push(render::path(&output.write_all(&bytes)?));
    }

    if args.json {
        let rows = |m: &dyn Fn(usize, usize) -> f64| [[m(0, 0), m(0, 1)], [m(1, 0), m(1, 1)]];
        let measured = !bicycle.deviations.is_empty();
        terminal.print_json(&EigenvaluesJson {
            name: &bicycle.name,
            parameters: &bicycle.params,
            mass: rows(&|i, j| whipple.mass[(i, j)]),
            damping: rows(&|i, j| whipple.damping[(i, j)]),
            gravity_stiffness: rows(&|i, j| whipple.gravity_stiffness[(i, j)]),
            speed_stiffness: rows(&|i, j| whipple.speed_stiffness[(i, j)]),
            weave_speed_mps: critical.weave,
            weave_speed_deviation_mps: deviations[0].filter(|_| measured),
            capsize_speed_mps: critical.capsize,
            capsize_speed_deviation_mps: deviations[1].filter(|_| measured),
            stable: &critical.stable,
            eigenvalues: table.iter().map(ModesJson::from).collect(),
            remarks: &remarks,
            files,
            version: env!("CARGO_PKG_VERSION"),
        })?;
    } else {
        terminal.print(&text(&bicycle, &critical, deviations, &table, &files))?;
    }
    Ok(Exit::Done)
}

/// The preset or the file of this name.
fn bicycle(named: &Path) -> Result<Bicycle, Failure> {
    let name = named.display().to_string();
    if name == BENCHMARK {
        return Ok(Bicycle {
            about: "the bicycle of Meijaard et al. (2007)".into(),
            params: WhippleParams::benchmark(),
            deviations: Vec::new(),
            name,
        });
    }
    if let Some(bike) = BikeParams::preset(&name) {
        return robot(name, &bike, BalancerMode::Flywheel);
    }
    if named.symlink_metadata().is_err() && named.parent() == Some(Path::new("")) {
        let presets = BikeParams::PRESETS.join(", ");
        return Err(Failure::usage(
            Diagnostic::error(format!("{name} is neither a file nor a preset"))
                .help(format!("presets are {BENCHMARK}, {presets}")),
        ));
    }
    if named.extension().is_some_and(|ending| ending == "toml") {
        let loaded = Loaded::read(named, &Changes::default())?;
        let scenario = &loaded.file().scenario;
        return robot(
            scenario.name.clone(),
            &scenario.bike.params,
            scenario.bike.mode,
        );
    }
    let bytes = input::read(named, MAX_PARAMETER_BYTES)?;
    let text = String::from_utf8(bytes).map_err(|error| {
        let good = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = good.iter().filter(|byte| **byte == b'\n').count() + 1;
        Failure::usage(
            Diagnostic::error("the parameter file is not text: a byte is not UTF-8")
                .at_line(&name, Some(line))
                .help("is this the right file?"),
        )
    })?;
    let file = ParameterFile::parse(&text).map_err(|error| tell(&error, &name, &text))?;
    let stem = named.file_stem().unwrap_or(named.as_os_str());
    Ok(Bicycle {
        name: stem.to_string_lossy().into_owned(),
        about: render::path(named),
        params: file.params,
        deviations: file.deviations,
    })
}

/// The bike robot, balancer locked where `mode` has it.
fn robot(name: String, bike: &BikeParams, mode: BalancerMode) -> Result<Bicycle, Failure> {
    let assembly = SteeringAssembly::e_bike();
    let params = WhippleParams::from_bike(bike, bike.offset(mode), &assembly).map_err(|error| {
        let parts = assembly.rear_wheel.mass + assembly.front_wheel.mass + assembly.fork.mass;
        Failure::usage(Diagnostic::error(format!("{name}: {error}")).note(format!(
            "body B is what remains of the bike once wheels and fork, {} kg, are taken out",
            render::coordinate(parts)
        )))
    })?;
    let mode = match mode {
        BalancerMode::Flywheel => "flywheel",
        BalancerMode::Balancer => "balancer",
    };
    Ok(Bicycle {
        about: format!("balancer locked in {mode} mode, wheels and fork of an e-bike"),
        params,
        deviations: Vec::new(),
        name,
    })
}

/// What is wrong with a parameter file, where it stands.
fn tell(error: &ParameterFileError, name: &str, text: &str) -> Failure {
    let diagnostic = Diagnostic::error(error.message.clone()).maybe_help(error.help.clone());
    let span = error.line.and_then(|line| input::span_of_line(text, line));
    Failure::usage(match span {
        Some(span) => diagnostic.at_span(name, text, span),
        None => diagnostic.at_line(name, error.line),
    })
}

fn format_of(path: &Path) -> Result<Format, Failure> {
    let is_table = |ending: &std::ffi::OsStr| ending.eq_ignore_ascii_case("csv");
    if path.extension().is_some_and(is_table) {
        return Ok(Format::Csv);
    }
    picture::Format::of(path)
        .map(Format::Picture)
        .ok_or_else(|| {
            Failure::usage(
                Diagnostic::error(format!("{} says no format", path.display()))
                    .help("end its name in .csv for the table, in .svg or .png for the picture"),
            )
        })
}

fn contents(
    format: Format,
    whipple: &Whipple,
    critical: &CriticalSpeeds,
    bicycle: &Bicycle,
    table: &[Modes],
    zoom: f64,
) -> Result<Vec<u8>, Failure> {
    let format = match format {
        Format::Csv => return Ok(csv(table).into_bytes()),
        Format::Picture(format) => format,
    };
    let bound = |pick: fn(f64, f64) -> f64| table.iter().map(|modes| modes.speed).reduce(pick);
    let (Some(from), Some(to)) = (bound(f64::min), bound(f64::max)) else {
        return Ok(Vec::new());
    };
    if from == to {
        return Err(Failure::usage(
            Diagnostic::error(format!("one speed, {from} m/s, makes no picture"))
                .help("give a range, such as --speeds 0:10:21"),
        ));
    }
    let curves = whipple
        .mode_curves(from, to, CURVE_POINTS)
        .map_err(|error| Failure::usage(Diagnostic::error(error.to_string())))?;
    let facts = format!(
        "{}  ·  {} kg  ·  wheelbase {} m  ·  trail {} m  ·  {}",
        bicycle.about,
        render::significant(bicycle.params.mass()),
        render::coordinate(bicycle.params.wheelbase),
        render::coordinate(bicycle.params.trail),
        stability(critical, 4)
    );
    let title = format!("{} · eigenvalues", bicycle.name);
    let drawing = EigenvalueFigure::new(&curves, critical, title, facts).draw();
    format.write(&drawing, zoom, "give another --zoom")
}

/// One line per speed; both values of the weave, real and imaginary parts apart.
fn csv(table: &[Modes]) -> String {
    let mut text = String::from(
        "speed_mps,weave_re_per_s,weave_im_radps,weave2_re_per_s,weave2_im_radps,\
         capsize_re_per_s,capsize_im_radps,caster_re_per_s,caster_im_radps,stable\n",
    );
    for modes in table {
        let _ = write!(text, "{:?}", modes.speed);
        for (_, value) in modes.iter() {
            let _ = write!(text, ",{:?},{:?}", value.re, value.im);
        }
        let _ = writeln!(text, ",{}", modes.is_stable());
    }
    text
}

/// Where it is stable, in words.
fn stability(critical: &CriticalSpeeds, digits: usize) -> String {
    if critical.stable.is_empty() {
        return "stable at no speed".into();
    }
    let ranges: Vec<String> = critical
        .stable
        .iter()
        .map(|range| match range.to_mps {
            Some(to) => format!("{:.digits$} to {to:.digits$} m/s", range.from_mps),
            None => format!("above {:.digits$} m/s", range.from_mps),
        })
        .collect();
    format!("stable {}", ranges.join(" and "))
}

fn text(
    bicycle: &Bicycle,
    critical: &CriticalSpeeds,
    deviations: [Option<f64>; 2],
    table: &[Modes],
    files: &[String],
) -> String {
    let mass = format!("{} kg", render::significant(bicycle.params.mass()));
    let headline = format!("{}: {}", bicycle.name, stability(critical, 4));
    let mut sheet = Sheet::new(&headline, &mass);
    if bicycle.about != bicycle.name {
        sheet.say("bicycle", bicycle.about.clone());
    }
    for (label, speed, deviation, meaning) in [
        (
            "weave",
            critical.weave,
            deviations[0],
            "above it the weave dies away",
        ),
        (
            "capsize",
            critical.capsize,
            deviations[1],
            "above it a lean grows",
        ),
    ] {
        let Some(speed) = speed else {
            sheet.say(label, "no critical speed");
            continue;
        };
        let deviation = deviation.filter(|deviation| *deviation > 0.0);
        let parts = match deviation {
            Some(deviation) => format!("{speed:.4} ± {} m/s", render::significant(deviation)),
            None => format!("{speed:.9} m/s"),
        };
        sheet.line(label, &[parts, meaning.to_owned()]);
    }
    sheet.gap();
    sheet.row("   speed                    weave    capsize     caster");
    sheet.row("     m/s                      1/s        1/s        1/s");
    for modes in table {
        let [first, second] = modes.weave;
        let weave = if modes.weave_oscillates() {
            format!("{:.4} ± {:.4}i", second.re, second.im)
        } else {
            format!("{:.4}, {:.4}", first.re, second.re)
        };
        // Where capsize and caster have become one oscillation, both columns show it.
        let one = |re: f64, im: f64| match im {
            0.0 => format!("{re:.4}"),
            im => format!("{re:.2}{im:+.2}i"),
        };
        let verdict = if modes.is_stable() { "  stable" } else { "" };
        sheet.row(&format!(
            "{:>8} {weave:>24} {:>10} {:>10}{verdict}",
            render::coordinate(modes.speed),
            one(modes.capsize.re, modes.capsize.im),
            one(modes.caster.re, modes.caster.im),
        ));
    }
    if !files.is_empty() {
        sheet.gap();
        for file in files {
            sheet.say("wrote", file.clone());
        }
    }
    sheet.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_are_a_range_or_a_list() {
        let speeds = |text: &str| text.parse::<Speeds>().map(|speeds| speeds.0);
        assert_eq!(speeds("0:10:3"), Ok(vec![0.0, 5.0, 10.0]));
        assert_eq!(speeds("5:5:1"), Ok(vec![5.0]));
        assert_eq!(speeds("1, 2.5,4"), Ok(vec![1.0, 2.5, 4.0]));
        for bad in [
            "", "a", "0:10", "0:10:0", "-1:2:3", "nan", "0:1e9:2", "0:1:2:3", "1,,2",
        ] {
            assert!(speeds(bad).is_err(), "{bad}");
        }
    }
}
