//! `bikebot plot`: pictures of plans and rides.

use std::path::{Path, PathBuf};

use bikebot_report::{
    Ground, Moments, MomentsFigure, PlanFigure, PlanFile, PlanStyle, PlanView, ReportError, Ride,
    RideFigure, drawing::Drawing,
};
use bikebot_sim::record::{Trace, log};
use bikebot_world::World;
use bikebot_world::formats::{self, MapOptions};
use clap::Args;
use serde::Serialize;

use crate::args::{Changes, Force, positive, seconds};
use crate::diag::Diagnostic;
use crate::exit::{Ending, Exit, Failure};
use crate::input::{self, Kind, Loaded};
use crate::output::{Output, make_folder};
use crate::picture;
use crate::plan_text::{self, tell};
use crate::recording;
use crate::render::{self, Sheet, significant};
use crate::terminal::Terminal;

/// Moments of a ride on one picture.
const MOST_MOMENTS: usize = 24;

/// Draw a plan or a ride
///
/// A plan (plan.json, as written by `bikebot plan -o`) is drawn on its map with all that the search made, its
/// curvature along the way and the search against time. A recording (.mcap) is drawn with the planned path, what was
/// ridden, and speed, roll and lateral error against time.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot plot plan.json
  bikebot plot plan.json -o figures --format png --zoom 2
  bikebot plot plan.json --separate --color-by-curvature
  bikebot plot plan.json --map yard.yaml
  bikebot plot fig7-1.mcap
  bikebot plot unknown-yard-1.mcap --at 1,10,25,40")]
pub struct PlotArgs {
    /// Plan (.json) or recording (.mcap)
    #[arg(value_name = "FILE.mcap|PLAN.json")]
    pub input: PathBuf,
    /// Folder for the pictures, made if it is not there [default: the current one]
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// What to write
    #[arg(
        long,
        value_name = "svg|png",
        default_value = "svg",
        hide_possible_values = true
    )]
    pub format: picture::Format,
    /// Scenario or map a plan was made on, where it is not found under the name the plan gives
    #[arg(long, value_name = "SCENARIO|MAP")]
    pub map: Option<PathBuf>,
    /// Pixels of a PNG to one of the drawing, which is 1200 wide
    #[arg(long, value_name = "X", default_value_t = 1.0, allow_hyphen_values = true, value_parser = positive)]
    pub zoom: f64,
    /// The parts of a plan's picture in files of their own: -map, -curvature, -search
    #[arg(long)]
    pub separate: bool,
    /// Colour a plan's path by its curvature
    #[arg(long)]
    pub color_by_curvature: bool,
    /// Show a ride at these times, s: what was believed of the field, the path in force, what had been ridden
    #[arg(long, value_name = "S,S,…", value_delimiter = ',', allow_hyphen_values = true, value_parser = seconds)]
    pub at: Vec<f64>,
    #[command(flatten)]
    pub force: Force,
    /// One JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct PlotJson {
    files: Vec<String>,
}

/// Draws it.
pub fn run(args: &PlotArgs, terminal: &Terminal) -> Ending {
    let drawings = if Kind::of(&args.input) == Kind::Recording {
        let ending = if args.at.is_empty() { "" } else { "-moments" };
        vec![(ending, ride(args, terminal)?)]
    } else {
        plan(args, terminal)?
    };
    let mut pictures = Vec::new();
    for (ending, drawing) in &drawings {
        let help = "give another --zoom";
        pictures.push((
            path_of(args, ending)?,
            args.format.write(drawing, args.zoom, help)?,
        ));
    }
    if let Some(folder) = &args.output {
        make_folder(folder)?;
    }
    let mut outputs = Vec::new();
    for (path, picture) in pictures {
        outputs.push((Output::create(&path, args.force.force)?, picture));
    }
    let mut files = Vec::new();
    for (output, picture) in outputs {
        files.push((output.write_all(&picture)?, picture.len() as u64));
    }
    if args.json {
        terminal.print_json(&PlotJson {
            files: files.iter().map(|(path, _)| render::path(path)).collect(),
        })?;
    } else {
        let mut sheet = Sheet::new(&render::path(&args.input), "drawn");
        for (path, size) in &files {
            sheet.say(
                "picture",
                format!("{}, {}", render::path(path), render::bytes(*size)),
            );
        }
        terminal.print(&sheet.finish())?;
    }
    Ok(Exit::Done)
}

/// Where a picture goes: the name of the input, in the folder asked for.
fn path_of(args: &PlotArgs, ending: &str) -> Result<PathBuf, Failure> {
    let Some(stem) = args.input.file_stem().and_then(|stem| stem.to_str()) else {
        return Err(Failure::usage(Diagnostic::error(format!(
            "the name of {} is not UTF-8",
            args.input.display()
        ))));
    };
    let folder = args.output.clone().unwrap_or_default();
    Ok(folder.join(format!("{stem}{ending}.{}", args.format.ending())))
}

fn plan(args: &PlotArgs, terminal: &Terminal) -> Result<Vec<(&'static str, Drawing)>, Failure> {
    let place = args.input.display().to_string();
    if args
        .input
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
    {
        return Err(Failure::usage(
            Diagnostic::error(format!("{place} is a scenario, and `plot` draws what came of one"))
                .help(format!("first `bikebot plan {place} -o plan.json` or `bikebot run {place}`, then plot what they wrote")),
        ));
    }
    if !args.at.is_empty() {
        return Err(Failure::usage(Diagnostic::error(
            "--at is for rides: a plan has no times",
        )));
    }
    let text = plan_text::read(
        &args.input,
        "neither a plan nor a recording",
        ", or a recording .mcap",
    )?;
    let plan = PlanFile::parse(&text).map_err(|error| tell(&error, &place, &text))?;
    let own = plan.obstacles();
    let world = match (&args.map, &own) {
        (None, Some(_)) => None,
        (named, _) => Some(world_of(&plan, named.as_deref(), args, terminal)?),
    };
    let ground = match (&world, &own) {
        (Some(world), _) => Ground::from(world),
        (None, obstacles) => Ground {
            bounds: plan.bounds(),
            obstacles: obstacles.as_deref().unwrap_or_default(),
            grid: None,
        },
    };
    let named = args
        .map
        .clone()
        .or_else(|| plan.problem.map.as_deref().map(PathBuf::from));
    let name = named.as_deref().unwrap_or(&args.input).file_stem();
    let name = name.map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let style = PlanStyle {
        colour_by_curvature: args.color_by_curvature,
    };
    let figure =
        PlanFigure::new(&plan, ground, name, style).map_err(|error| tell(&error, &place, &text))?;
    if !args.separate {
        return Ok(vec![("", figure.draw(PlanView::Sheet))]);
    }
    let ending = |view| match view {
        PlanView::Sheet => "",
        PlanView::Map => "-map",
        PlanView::Curvature => "-curvature",
        PlanView::Search => "-search",
    };
    let views = figure.views().into_iter();
    Ok(views
        .map(|view| (ending(view), figure.draw(view)))
        .collect())
}

/// The map of a plan: the one named, or the one the plan names, seen from here or from the plan's folder.
fn world_of(
    plan: &PlanFile,
    named: Option<&Path>,
    args: &PlotArgs,
    terminal: &Terminal,
) -> Result<World, Failure> {
    let help = "name the scenario or the map by --map";
    let path = match (named, &plan.problem.map) {
        (Some(path), _) => path.to_owned(),
        (None, Some(own)) => {
            let beside = args.input.parent().map(|folder| folder.join(own));
            let found = [Some(PathBuf::from(own)), beside];
            let found = found.into_iter().flatten().find(|path| path.is_file());
            found.ok_or_else(|| {
                Failure::usage(
                    Diagnostic::error(format!("the plan's map {own} is not there")).help(help),
                )
            })?
        }
        (None, None) => {
            return Err(Failure::usage(
                Diagnostic::error("the plan names no map").help(help),
            ));
        }
    };
    let world = if Kind::of(&path) == Kind::Map {
        bare_map(&path)?
    } else {
        let loaded = Loaded::read(&path, &Changes::default())?;
        loaded.setup(terminal)?.world.ok_or_else(|| {
            Failure::usage(Diagnostic::error(format!("{} has no map", path.display())).help(help))
        })?
    };
    let other = |error: ReportError| {
        Failure::usage(
            Diagnostic::error(format!("{} is not the map of this plan", path.display()))
                .note(error.to_string())
                .help(help),
        )
    };
    // A map may have been stretched, by its cell size or by `map.scale`.
    let scale = plan.scale_of(world.bounds()).map_err(other)?;
    if (scale - 1.0).abs() < 1e-9 {
        return Ok(world);
    }
    world
        .scaled(scale)
        .map_err(|error| Failure::usage(Diagnostic::error(error.to_string())))
}

/// A map file; a cell that has no size is a metre, until the plan's field tells.
fn bare_map(path: &Path) -> Result<World, Failure> {
    let bytes = input::read_map(path)?;
    let name = path.display().to_string();
    let folder = path.parent().map(Path::to_owned).unwrap_or_default();
    let options = MapOptions {
        meters_per_cell: Some(1.0),
        ..MapOptions::default()
    };
    let mut read = |inner: &str| input::read_inner(&folder.join(inner));
    let loaded = formats::load(&name, &bytes, &options, &mut read).map_err(|error| {
        let cell_size = "name the scenario by --map";
        Failure::usage(input::tell_map(
            &error,
            &name,
            &name,
            Some(&bytes),
            cell_size,
        ))
    })?;
    Ok(loaded.world)
}

fn ride(args: &PlotArgs, terminal: &Terminal) -> Result<Drawing, Failure> {
    let place = &args.input;
    if let Some(map) = &args.map {
        return Err(Failure::usage(
            Diagnostic::error(format!("--map {} is for plans", map.display()))
                .help("a recording carries its map"),
        ));
    }
    if args.separate || args.color_by_curvature {
        return Err(Failure::usage(Diagnostic::error(
            "--separate and --color-by-curvature are for plans",
        )));
    }
    if args.at.len() > MOST_MOMENTS {
        return Err(Failure::usage(Diagnostic::error(format!(
            "--at names {} times; one picture holds at most {MOST_MOMENTS}",
            args.at.len()
        ))));
    }
    let broken = |error| recording::tell(place, &error);
    let source = log::read_run(&mut recording::open(place)?).map_err(broken)?;
    let kept = if args.at.is_empty() {
        Trace::default()
    } else {
        Trace::default().with_beliefs()
    };
    let trace = log::read_trace(&mut recording::open(place)?, kept).map_err(broken)?;
    let info = log::inspect(&mut recording::open(place)?).map_err(broken)?;
    let title = format!("{} · ride", source.scenario);
    let seed = source.seed;
    let loaded = Loaded::recorded(
        place,
        source.scenario_text,
        source.files,
        &Changes::default(),
    )?;
    let setup = loaded.setup(terminal)?;
    let empty = |error: ReportError| {
        Failure::usage(
            Diagnostic::error(error.to_string()).at_line(&place.display().to_string(), None),
        )
    };
    let mut facts = Vec::new();
    let metric = |name: &str| {
        let value = info.result()?.get(&format!("metrics.{name}"))?;
        value.parse::<f64>().ok()
    };
    match info.result().and_then(|result| result.get("outcome")) {
        Some(outcome) => facts.push(outcome.replace('_', " ")),
        None => facts.push("the recording was cut".into()),
    }
    for (name, before, after) in [
        ("time_s", "", " s"),
        ("distance_m", "", " m"),
        ("lateral_error_max_m", "lateral error up to ", " m"),
        ("roll_max_deg", "roll up to ", "°"),
        ("min_clearance_m", "clearance ", " m"),
    ] {
        facts.extend(metric(name).map(|value| format!("{before}{}{after}", significant(value))));
    }
    facts.push(format!("seed {seed}"));
    let ground = setup.world.as_ref().map(Ground::from);
    let facts = facts.join("  ·  ");
    if args.at.is_empty() {
        let ride = Ride::new(&trace, &setup.footprint).map_err(empty)?;
        return Ok(RideFigure::new(&ride, ground, title, facts).draw());
    }
    let others = |time: f64| {
        let obstacles = setup.traffic.obstacles().iter();
        obstacles.filter_map(|it| it.outline_at(time)).collect()
    };
    let ride = Moments::new(&trace, &args.at, &setup.footprint, &others).map_err(empty)?;
    Ok(MomentsFigure::new(&ride, ground, title, facts).draw())
}
