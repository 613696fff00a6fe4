//! `bikebot report`: one page that shows a ride, or several side by side.

use std::path::{Path, PathBuf};

use bikebot_report::page::{self, Recording};
use bikebot_sim::Setup;
use bikebot_sim::record::log::{self, LogError, LogInfo};
use bikebot_sim::record::{SCHEMA_VERSION, Trace};
use clap::Args;
use serde::Serialize;

use crate::args::{Changes, Force};
use crate::diag::Diagnostic;
use crate::exit::{Ending, Exit, Failure};
use crate::input::Loaded;
use crate::output::{Output, is_same_file};
use crate::recording;
use crate::render::{self, Sheet};
use crate::terminal::Terminal;

/// Most recordings on one page.
const MOST_RECORDINGS: usize = 6;

/// Make a page that shows a ride, or several side by side
///
/// One HTML file that any browser opens, without a network: how the ride ended and how near it came to each limit,
/// the ride from above with a slider for time, the bike seen from behind, histories, events, the scenario, and how to
/// ride it again. A recording that was cut is shown as far as it goes, and the page says what is missing.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot report fig7-1.mcap
  bikebot report fig7-1.mcap -o report.html --force
  bikebot report pvfc.mcap stanley.mcap -o compared.html
  bikebot report cut.mcap.part")]
pub struct ReportArgs {
    /// Recordings (.mcap), up to six
    #[arg(value_name = "FILE.mcap", required = true, num_args = 1..)]
    pub input: Vec<PathBuf>,
    /// The page [default: <recording>.html in the current folder, report.html for several]
    #[arg(short, long, value_name = "REPORT.html")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub force: Force,
    /// One JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct ReportJson {
    report: String,
    bytes: usize,
    rides: Vec<RideJson>,
}

/// One ride of it.
#[derive(Debug, Serialize)]
struct RideJson {
    log: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    scenario: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    outcome: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<String>,
    /// What could not be shown, and why.
    missing: Vec<String>,
}

/// A recording as far as it could be read.
struct Read {
    file: String,
    info: LogInfo,
    trace: Trace,
    scenario_text: Option<String>,
    setup: Option<Setup>,
    missing: Vec<String>,
}

impl Read {
    fn shown(&self) -> Recording<'_> {
        Recording {
            file: self.file.clone(),
            info: &self.info,
            trace: &self.trace,
            scenario_text: self.scenario_text.as_deref(),
            setup: self.setup.as_ref(),
            missing: self.missing.clone(),
        }
    }
}

/// Makes it.
pub fn run(args: &ReportArgs, terminal: &Terminal) -> Ending {
    if args.input.len() > MOST_RECORDINGS {
        return Err(Failure::usage(
            Diagnostic::error(format!(
                "{} recordings are named; one page holds at most {MOST_RECORDINGS}",
                args.input.len()
            ))
            .help("`bikebot sweep` tables many rides"),
        ));
    }
    let path = path_of(args)?;
    if let Some(input) = args.input.iter().find(|input| is_same_file(input, &path)) {
        return Err(Failure::usage(
            Diagnostic::error(format!(
                "cannot write {}: it is a recording to be shown",
                path.display()
            ))
            .help(format!("choose another name than {}", input.display())),
        ));
    }
    let output = Output::create(&path, args.force.force)?;
    let read = args
        .input
        .iter()
        .map(|path| read(path, terminal))
        .collect::<Result<Vec<_>, Failure>>()?;
    let shown: Vec<Recording<'_>> = read.iter().map(Read::shown).collect();
    let page = page::write(&shown, env!("CARGO_PKG_VERSION"));
    for (path, read) in args.input.iter().zip(&read) {
        for text in &read.missing {
            terminal.warn(
                &Diagnostic::warning(text.clone()).at_line(&path.display().to_string(), None),
            );
        }
    }
    let path = output.write_all(page.as_bytes())?;
    if args.json {
        terminal.print_json(&ReportJson {
            report: render::path(&path),
            bytes: page.len(),
            rides: args.input.iter().zip(&read).map(ride_json).collect(),
        })?;
    } else {
        let names: Vec<String> = args.input.iter().map(|path| render::path(path)).collect();
        let mut sheet = Sheet::new(&names.join(", "), "shown");
        for read in &read {
            sheet.say("ride", told(&read.info));
        }
        let size = render::bytes(page.len() as u64);
        sheet.say("report", format!("{}, {size}", render::path(&path)));
        terminal.print(&sheet.finish())?;
    }
    Ok(Exit::Done)
}

/// A ride in a line.
fn told(info: &LogInfo) -> String {
    let run = |key: &str| info.run().and_then(|it| it.get(key));
    let result = |key: &str| info.result().and_then(|it| it.get(key));
    let name = run("scenario").map_or("a recording", String::as_str);
    let seed = run("seed").map_or_else(String::new, |seed| format!(", seed {seed}"));
    match (result("outcome"), result("reason")) {
        (Some(outcome), Some(reason)) => format!("{name}{seed}: {outcome} ({reason})"),
        _ => format!("{name}{seed}: was cut off"),
    }
}

fn ride_json((path, read): (&PathBuf, &Read)) -> RideJson {
    let entry = |key: &str| read.info.result().and_then(|it| it.get(key)).cloned();
    RideJson {
        log: render::path(path),
        scenario: read.info.run().and_then(|it| it.get("scenario")).cloned(),
        outcome: entry("outcome"),
        reason: entry("reason"),
        missing: read.missing.clone(),
    }
}

/// Where the page goes.
fn path_of(args: &ReportArgs) -> Result<PathBuf, Failure> {
    match (&args.output, &args.input[..]) {
        (Some(path), _) => Ok(path.clone()),
        (None, [input]) => {
            let stem = input.file_stem().and_then(|stem| stem.to_str());
            let stem = stem.ok_or_else(|| {
                Failure::usage(
                    Diagnostic::error(format!("the name of {} is not UTF-8", input.display()))
                        .help("name the page by -o"),
                )
            })?;
            // `fig7-1.mcap.part`, as a run that was cut leaves it.
            let stem = stem.strip_suffix(".mcap").unwrap_or(stem);
            Ok(PathBuf::from(format!("{stem}.html")))
        }
        (None, _) => Ok(PathBuf::from("report.html")),
    }
}

/// Reads a recording, and notes what of it cannot be read.
fn read(path: &Path, terminal: &Terminal) -> Result<Read, Failure> {
    let broken = |error| recording::tell(path, &error);
    let info = log::inspect(&mut recording::open(path)?).map_err(broken)?;
    let kept = Trace::with_scans().with_beliefs();
    let trace = log::read_trace(&mut recording::open(path)?, kept).map_err(broken)?;
    let mut missing = Vec::new();
    match (&info.damage, info.closed, info.result().is_some()) {
        (Some(damage), ..) => missing.push(format!(
            "The file is broken {damage}. What stands before that is shown."
        )),
        (None, false, _) => missing.push("The recording was cut: it has no end.".to_owned()),
        (None, true, false) => missing
            .push("The recording has no result: the run in it did not come to its end.".to_owned()),
        (None, true, true) => {}
    }
    let unseen = if trace.map.is_some() {
        "limits are not shown, and obstacles as the cells of the recorded map"
    } else {
        "obstacles and limits are not shown"
    };
    let (scenario_text, setup) = scenario(path, &info, unseen, terminal, &mut missing)?;
    if trace.state.is_empty() {
        missing.push("It has no states: nothing was ridden, or it was not recorded.".to_owned());
    } else if setup.as_ref().is_none_or(|setup| setup.goal.is_some()) && trace.plans.is_empty() {
        missing.push("It has no plan.".to_owned());
    }
    let read = Read {
        file: path.file_name().map_or_else(
            || path.display().to_string(),
            |name| name.to_string_lossy().into_owned(),
        ),
        info,
        trace,
        scenario_text,
        setup,
        missing,
    };
    if read.info.run().is_none() && !read.shown().has_anything() {
        return Err(Failure::io(
            Diagnostic::error(format!(
                "{} holds nothing that a report could show",
                path.display()
            ))
            .note("it has neither a run of bikebot's nor any of its messages")
            .help("was it recorded by another program? `bikebot info` tells what is in it"),
        ));
    }
    Ok(read)
}

/// The scenario a recording carries, and what it means; without it, `unseen` says what the page lacks.
fn scenario(
    path: &Path,
    info: &LogInfo,
    unseen: &str,
    terminal: &Terminal,
    missing: &mut Vec<String>,
) -> Result<(Option<String>, Option<Setup>), Failure> {
    let run = match log::read_run(&mut recording::open(path)?) {
        Ok(run) => run,
        Err(error) => {
            let schema = info.run().and_then(|run| run.get("schema_version"));
            missing.push(match schema.and_then(|it| it.parse::<u32>().ok()) {
                Some(found) if found > SCHEMA_VERSION => format!(
                    "It was recorded by a newer bikebot (messages of version {found}, this one knows {SCHEMA_VERSION}): \
                     quantities may be missing; {unseen}."
                ),
                _ => format!("Without its scenario {unseen}: {error}."),
            });
            let text = match log::read_attachment(&mut recording::open(path)?, "scenario.toml") {
                Ok(bytes) => String::from_utf8(bytes).ok(),
                Err(LogError::File(error)) => return Err(Failure::file("read", path, &error)),
                Err(_) => None,
            };
            return Ok((text, None));
        }
    };
    let text = run.scenario_text.clone();
    let setup = Loaded::recorded(path, run.scenario_text, run.files, &Changes::default())
        .and_then(|loaded| loaded.setup(terminal));
    match setup {
        Ok(setup) => Ok((Some(text), Some(setup))),
        Err(failure) => {
            let why = failure
                .diagnostic()
                .map_or_else(String::new, |it| format!(": {}", it.message()));
            missing.push(format!(
                "Its scenario is not understood by this version: {unseen}{why}."
            ));
            Ok((Some(text), None))
        }
    }
}
