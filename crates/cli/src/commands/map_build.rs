//! `bikebot map build`: a map from a log of laser scans.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use bikebot_mapping::logs::{
    self, BuildOptions, BuildSummary, LogError, LogFormat, LogOptions, LogProblem, ScanLog,
};
use bikebot_world::formats::map_server;
use bikebot_world::{Cell, OccupancyGrid};
use clap::{Args, ValueEnum};
use serde::Serialize;

use crate::args::{Force, positive};
use crate::diag::Diagnostic;
use crate::exit::{Ending, Exit, Failure};
use crate::input;
use crate::interrupt;
use crate::output::{Output, is_same_file};
use crate::render::{self, Sheet, significant};
use crate::terminal::Terminal;

/// Make a map from a log of laser scans and odometry
///
/// Every scan is entered where the robot's own odometry has it, into cells that are free,
/// occupied or unknown by the evidence. Odometry drifts, and nothing here corrects it (this is
/// no SLAM): walls seen again later may come out double.
///
/// Reads BreezySLAM .dat logs (of the robot they were made with: wheels of 77 mm radius, 330 mm
/// apart, 2000 counts a turn) and CARMEN logs (FLASER lines, with the odometry they carry). Writes
/// a map_server description and, beside it, its image.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot map build corridor.log -o corridor.yaml
  bikebot map build exp2.dat -o exp2.yaml --resolution 0.05
  bikebot map build old.txt --format carmen --max-range 30 -o old.yaml --force")]
pub struct BuildArgs {
    /// Log of laser scans
    #[arg(value_name = "LOG")]
    pub log: PathBuf,
    /// Map to write; its image gets the same name with .pgm
    #[arg(short, long, value_name = "MAP.yaml")]
    pub output: PathBuf,
    /// Side of a cell in metres
    #[arg(long, value_name = "M", default_value = "0.1", allow_hyphen_values = true, value_parser = positive)]
    pub resolution: f64,
    /// Format of the log [default: told by its first line]
    #[arg(long, value_name = "FORMAT")]
    pub format: Option<FormatArg>,
    /// Ranges from this on, in metres, are missing returns [default: 4 for breezy, 80 for carmen]
    #[arg(long, value_name = "M", allow_hyphen_values = true, value_parser = positive)]
    pub max_range: Option<f64>,
    #[command(flatten)]
    pub force: Force,
    /// One JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

/// The formats by name.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum FormatArg {
    /// BreezySLAM's .dat
    Breezy,
    /// CARMEN's text log
    Carmen,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct BuildJson<'a> {
    map: String,
    image: String,
    format: &'static str,
    scans: usize,
    hits: u64,
    silent_beams: u64,
    duration_s: f64,
    distance_m: f64,
    /// Where the poses come from: nothing corrects them.
    poses: &'static str,
    resolution_m: f64,
    width: usize,
    height: usize,
    /// Lower left corner: `[x_m, y_m]`; the robot starts where its odometry says.
    origin: [f64; 2],
    free: usize,
    occupied: usize,
    unknown: usize,
    /// Lines passed over, by their first word.
    skipped: &'a BTreeMap<String, usize>,
    version: &'static str,
}

/// Makes it.
pub fn run(args: &BuildArgs, terminal: &Terminal) -> Ending {
    let image = image_name(&args.output)?;
    for written in [&args.output, &args.output.with_file_name(&image)] {
        if is_same_file(written, &args.log) {
            return Err(Failure::usage(
                Diagnostic::error(format!(
                    "cannot write {}: it is the log itself",
                    written.display()
                ))
                .help("choose another name for the map; its image gets the same with .pgm"),
            ));
        }
    }
    let bytes = input::read(&args.log, logs::MAX_LOG_BYTES as u64)?;
    let name = args.log.display().to_string();
    let format = args.format.map(|format| match format {
        FormatArg::Breezy => LogFormat::Breezy,
        FormatArg::Carmen => LogFormat::Carmen,
    });
    let options = LogOptions {
        max_range: args.max_range,
    };
    let refuse = |error: LogError| Failure::usage(tell(&error));
    let log = logs::read(&name, &bytes, format, &options).map_err(refuse)?;
    drop(bytes);

    interrupt::install()?;
    // Opened before the work: names that are taken are told at once.
    let map = Output::create(&args.output, args.force.force)?;
    let picture = Output::create(&args.output.with_file_name(&image), args.force.force)?;
    let build = BuildOptions {
        resolution: args.resolution,
    };
    let bar = terminal.rows(log.scans.len() as u64, "mapping");
    let built = logs::build(&name, &log, &build, &mut |_| {
        bar.done();
        !interrupt::asked()
    });
    drop(bar);
    let Some((belief, summary)) = built.map_err(refuse)? else {
        terminal.remark("interrupted: no map was written");
        return Ok(Exit::Interrupted);
    };
    let grid = belief.into_grid();
    let (description, pixels) = map_server::write(&grid, &image);
    // The image first: a description never names one that is not there.
    let image = picture.write_all(&pixels)?;
    let map = map.write_all(description.as_bytes())?;
    if args.json {
        terminal.print_json(&json(&map, &image, &log, summary, &grid))?;
    } else {
        terminal.print(&sheet(&map, &image, &log, summary, &grid))?;
    }
    Ok(Exit::Done)
}

/// The image beside the description: its name with another ending.
fn image_name(map: &Path) -> Result<String, Failure> {
    let ending = map.extension().and_then(|ending| ending.to_str());
    if !matches!(ending, Some("yaml" | "yml")) {
        return Err(Failure::usage(
            Diagnostic::error(format!(
                "cannot write {}: a map's name ends in .yaml",
                map.display()
            ))
            .help("its image gets the same name with .pgm"),
        ));
    }
    let image = map.with_extension("pgm");
    let name = image.file_name().and_then(|name| name.to_str());
    // A description has one line for the name.
    let name = name.filter(|name| !name.chars().any(char::is_control));
    name.map(str::to_owned).ok_or_else(|| {
        Failure::usage(Diagnostic::error(format!(
            "cannot write {:?}: the description has to name its image, and this name is no text of one line",
            map.display().to_string()
        )))
    })
}

fn tell(error: &LogError) -> Diagnostic {
    let diagnostic = Diagnostic::error(error.problem.to_string()).at_line(&error.file, error.line);
    let help = match error.problem {
        LogProblem::UnknownFormat => "say which it is: --format breezy or --format carmen",
        LogProblem::TooLarge { width, height, .. } => {
            // A side of 16 384 cells, 64 Mi cells in all; rounded up to two digits.
            let least = (width.max(height) / 16_384.0).max((width * height / 67_108_864.0).sqrt());
            let digit = 10_f64.powf(least.log10().floor() - 1.0);
            let enough = (least / digit).ceil() * digit;
            return diagnostic.help(format!(
                "--resolution {} will do, if the field is as large as that",
                significant(enough)
            ));
        }
        LogProblem::CutShort { .. } | LogProblem::RangeCount { .. } => {
            "if only the end of the file is cut off, remove its last line"
        }
        _ => return diagnostic,
    };
    diagnostic.help(help)
}

fn json<'a>(
    map: &Path,
    image: &Path,
    log: &'a ScanLog,
    summary: BuildSummary,
    grid: &OccupancyGrid,
) -> BuildJson<'a> {
    BuildJson {
        map: render::path(map),
        image: render::path(image),
        format: match log.format {
            LogFormat::Breezy => "breezy",
            LogFormat::Carmen => "carmen",
        },
        scans: log.scans.len(),
        hits: summary.hits,
        silent_beams: summary.silent,
        duration_s: log.duration(),
        distance_m: log.distance(),
        poses: "odometry",
        resolution_m: grid.resolution,
        width: grid.width,
        height: grid.height,
        origin: [grid.origin.position.x, grid.origin.position.y],
        free: grid.count(Cell::Free),
        occupied: grid.count(Cell::Occupied),
        unknown: grid.count(Cell::Unknown),
        skipped: &log.skipped,
        version: env!("CARGO_PKG_VERSION"),
    }
}

fn sheet(
    map: &Path,
    image: &Path,
    log: &ScanLog,
    summary: BuildSummary,
    grid: &OccupancyGrid,
) -> String {
    let mut sheet = Sheet::new(&render::path(map), &log.format.to_string());
    sheet.line(
        "log",
        &[
            render::count(log.scans.len() as u64, "scan"),
            format!("{:.1} s", log.duration()),
            format!("{:.1} m by odometry", log.distance()),
        ],
    );
    sheet.line(
        "beams",
        &[
            format!("{} hits", summary.hits),
            format!("{} that say nothing", summary.silent),
        ],
    );
    sheet.line(
        "grid",
        &[format!(
            "{} × {} cells of {} m",
            grid.width,
            grid.height,
            significant(grid.resolution)
        )],
    );
    let square = |cell: Cell| grid.count(cell) as f64 * grid.resolution * grid.resolution;
    sheet.line(
        "cells",
        &[
            format!("{:.1} m² free", square(Cell::Free)),
            format!("{:.1} m² occupied", square(Cell::Occupied)),
        ],
    );
    if !log.skipped.is_empty() {
        let kinds = log.skipped.iter();
        let kinds: Vec<String> = kinds
            .map(|(kind, count)| format!("{count} × {kind}"))
            .collect();
        sheet.line("skipped", &kinds);
    }
    sheet.say("image", render::path(image));
    sheet.say(
        "note",
        "poses are odometry alone, nothing corrects their drift",
    );
    sheet.finish()
}
