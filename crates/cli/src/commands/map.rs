//! `bikebot map`: what a map file says.

use std::path::{Path, PathBuf};

use bikebot_world::formats::{self, LoadedMap, MapOptions, MapPose};
use bikebot_world::{Cell, Obstacle, OccupancyGrid};
use clap::Args;
use serde::Serialize;

use crate::args::positive;
use crate::diag::Diagnostic;
use crate::exit::{Ending, Exit, Failure};
use crate::input;
use crate::render::{self, Sheet, coordinate as at, significant};
use crate::terminal::Terminal;

/// Tell what is in a map file
///
/// Reads map_server .yaml (with its image), .png, .pgm, .bmp, MovingAI .map, and polygon
/// scenes .json.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot map info yard.yaml
  bikebot map info floor.png --meters-per-cell 0.05
  bikebot map info yard.yaml --json")]
pub struct InfoArgs {
    /// Map file
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Side of a cell in metres, for formats that do not say
    #[arg(long, value_name = "M", allow_hyphen_values = true, value_parser = positive)]
    pub meters_per_cell: Option<f64>,
    /// One JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

/// What `--json` prints. What does not apply is absent.
#[derive(Debug, Serialize)]
struct InfoJson {
    file: String,
    kind: String,
    name: String,
    /// `[min x, min y, max x, max y]`.
    bounds_m: [f64; 4],
    #[serde(skip_serializing_if = "Option::is_none")]
    grid: Option<GridJson>,
    obstacles: usize,
    /// `[x_m, y_m, heading_deg]`; without a heading it is free.
    #[serde(skip_serializing_if = "Option::is_none")]
    start: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    goal: Option<Vec<f64>>,
    warnings: Vec<String>,
}

#[derive(Debug, Serialize)]
struct GridJson {
    width: usize,
    height: usize,
    resolution_m: f64,
    /// Lower left corner, and how the grid is turned: `[x_m, y_m, yaw_deg]`.
    origin: [f64; 3],
    free: usize,
    occupied: usize,
    unknown: usize,
}

impl From<&OccupancyGrid> for GridJson {
    fn from(grid: &OccupancyGrid) -> Self {
        let origin = grid.origin;
        Self {
            width: grid.width,
            height: grid.height,
            resolution_m: grid.resolution,
            origin: [
                origin.position.x,
                origin.position.y,
                origin.heading.to_degrees(),
            ],
            free: grid.count(Cell::Free),
            occupied: grid.count(Cell::Occupied),
            unknown: grid.count(Cell::Unknown),
        }
    }
}

/// Tells it.
pub fn info(args: &InfoArgs, terminal: &Terminal) -> Ending {
    let bytes = input::read_map(&args.file)?;
    let name = args.file.display().to_string();
    let folder = args.file.parent().unwrap_or(Path::new("")).to_owned();
    let options = MapOptions {
        meters_per_cell: args.meters_per_cell,
        ..MapOptions::default()
    };
    let loaded = formats::load(&name, &bytes, &options, &mut |inner| {
        input::read_inner(&folder.join(inner))
    })
    .map_err(|error| {
        let cell_size = "give it by --meters-per-cell M";
        Failure::usage(input::tell_map(
            &error,
            &name,
            &name,
            Some(&bytes),
            cell_size,
        ))
    })?;
    for warning in &loaded.warnings {
        terminal.warn(&Diagnostic::warning(warning.clone()));
    }
    let json = describe(&name, &loaded);
    if args.json {
        terminal.print_json(&json)?;
    } else {
        terminal.print(&sheet(&json, loaded.world.obstacles()))?;
    }
    Ok(Exit::Done)
}

fn describe(file: &str, loaded: &LoadedMap) -> InfoJson {
    let bounds = loaded.world.bounds();
    let end = |end: MapPose| {
        let mut numbers = vec![end.position.x, end.position.y];
        numbers.extend(end.heading.map(f64::to_degrees));
        numbers
    };
    InfoJson {
        file: file.to_owned(),
        kind: loaded.kind.to_string(),
        name: loaded.name.clone(),
        bounds_m: [bounds.min.x, bounds.min.y, bounds.max.x, bounds.max.y],
        grid: loaded.world.grid().map(GridJson::from),
        obstacles: loaded.world.obstacles().len(),
        start: loaded.start.map(end),
        goal: loaded.goal.map(end),
        warnings: loaded.warnings.clone(),
    }
}

/// A coordinate for people: to the millimetre (or a thousandth of a degree), without idle digits.
fn thousandths(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}

fn sheet(info: &InfoJson, obstacles: &[Obstacle]) -> String {
    let mut sheet = Sheet::new(&info.file, &info.kind);
    let [x0, y0, x1, y1] = info.bounds_m;
    sheet.line(
        "field",
        &[
            format!("{} × {} m", significant(x1 - x0), significant(y1 - y0)),
            format!(
                "from ({}, {}) to ({}, {})",
                thousandths(x0),
                thousandths(y0),
                thousandths(x1),
                thousandths(y1)
            ),
        ],
    );
    if let Some(grid) = &info.grid {
        let [x, y, yaw] = grid.origin;
        sheet.line(
            "grid",
            &[
                format!(
                    "{} × {} cells of {} m",
                    grid.width,
                    grid.height,
                    significant(grid.resolution_m)
                ),
                format!("origin ({}, {})", thousandths(x), thousandths(y)),
                format!("turned by {}°", thousandths(yaw)),
            ],
        );
        let all = (grid.width * grid.height).max(1) as f64;
        let share =
            |count: usize, what: &str| format!("{:.1} % {what}", 100.0 * count as f64 / all);
        sheet.line(
            "cells",
            &[
                share(grid.free, "free"),
                share(grid.occupied, "occupied"),
                share(grid.unknown, "unknown"),
            ],
        );
    }
    let count = |what: &str, is: &dyn Fn(&Obstacle) -> bool| {
        let count = obstacles.iter().filter(|obstacle| is(obstacle)).count();
        (count > 0).then(|| render::count(count as u64, what))
    };
    let shapes: Vec<String> = [
        count("polygon", &|obstacle| {
            matches!(obstacle, Obstacle::Polygon { .. })
        }),
        count("disc", &|obstacle| {
            matches!(obstacle, Obstacle::Disc { .. })
        }),
        count("block", &|obstacle| {
            matches!(obstacle, Obstacle::Block { .. })
        }),
    ]
    .into_iter()
    .flatten()
    .collect();
    sheet.line("obstacles", &shapes);
    for (label, end) in [("start", &info.start), ("goal", &info.goal)] {
        match end.as_deref() {
            Some([x, y]) => sheet.say(label, format!("({}, {}) m, any heading", at(*x), at(*y))),
            Some([x, y, heading]) => {
                sheet.say(
                    label,
                    format!("({x}, {y}) m, heading {}°", significant(*heading)),
                );
            }
            _ => {}
        }
    }
    sheet.finish()
}
