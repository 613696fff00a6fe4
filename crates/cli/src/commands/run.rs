//! `bikebot run`: plan, ride, record.

use std::io::{BufWriter, Seek, Write};
#[cfg(feature = "live")]
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
#[cfg(feature = "live")]
use std::thread;
#[cfg(feature = "live")]
use std::time::Duration;
use std::time::Instant;

use bikebot_sim::clock::SimTime;
use bikebot_sim::record::{Event, McapRecorder, RecordError, Recorder, ResultInfo, RunInfo, log};
#[cfg(feature = "live")]
use bikebot_sim::record::{LiveError, LiveOptions, LiveServer};
use bikebot_sim::setup::PathSource;
use bikebot_sim::{
    Error, ExpectCheck, Metrics, Progress, RunControl, RunOutcome, RunReport, Setup,
};
use clap::{ArgGroup, Args};
use serde::Serialize;

use crate::args::{Changes, Force};
use crate::diag::Diagnostic;
use crate::exit::{Ending, Exit, Failure, plain};
use crate::input::Loaded;
use crate::interrupt;
use crate::output::Output;
use crate::progress;
use crate::recording;
use crate::render::{self, Sheet};
use crate::terminal::Terminal;

use super::live::{self, Paced, Speed};

/// Plan a path, ride it, and record the ride
///
/// Prints a summary; the recording (MCAP, opens in Foxglove, Lichtblick, Rerun and
/// PlotJuggler) carries everything needed to run it again. Without -o it is named
/// <name>-<seed>.mcap in the current folder, and numbered on where that exists.
#[derive(Debug, Args)]
#[command(
    group(ArgGroup::new("what").required(true).args(["scenario", "from"])),
    after_help = "\
Examples:
  bikebot run scenario.toml
  bikebot run scenario.toml --seed 7 -o ride.mcap
  bikebot run scenario.toml --set follow.max_speed_mps=1.2 --json
  bikebot run scenario.toml --live           # watch it in Foxglove: ws://127.0.0.1:8765
  bikebot run scenario.toml --live :9000 --speed 0.5
  bikebot run --from ride.mcap               # the same ride again, from the recording alone"
)]
pub struct RunArgs {
    /// Scenario file (TOML); '-' reads standard input
    #[arg(value_name = "SCENARIO")]
    pub scenario: Option<PathBuf>,
    /// Run again what this recording carries, instead of a scenario file
    #[arg(long, value_name = "FILE.mcap")]
    pub from: Option<PathBuf>,
    #[command(flatten)]
    pub changes: Changes,
    /// Where to record [default: <name>-<seed>.mcap]
    #[arg(short, long, value_name = "FILE.mcap")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub force: Force,
    /// Serve the ride to viewers while it goes on (Foxglove, Lichtblick) [default address: 127.0.0.1:8765]
    #[cfg(feature = "live")]
    #[arg(
        long,
        value_name = "ADDR:PORT",
        num_args = 0..=1,
        default_missing_value = "127.0.0.1:8765",
        value_parser = live::address
    )]
    pub live: Option<SocketAddr>,
    /// Simulated seconds in a second: 1 is real time, max as fast as it goes [default: max, with --live 1]
    #[arg(long, value_name = "X", allow_hyphen_values = true)]
    pub speed: Option<Speed>,
    /// One JSON object instead of the summary
    #[arg(long)]
    pub json: bool,
}

/// What viewers have to take in the end of a ride.
#[cfg(feature = "live")]
const LAST_LOOK: Duration = Duration::from_millis(300);

/// What `--json` prints (`docs`: the keys are a promise).
#[derive(Debug, Serialize)]
struct RunJson<'a> {
    outcome: &'a str,
    reason: &'a str,
    scenario: &'a str,
    seed: u64,
    plant: &'a str,
    mode: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    log: Option<String>,
    result_hash: &'a str,
    run_id: &'a str,
    metrics: &'a Metrics,
    expect: &'a [ExpectCheck],
    version: &'a str,
}

/// Runs it.
pub fn run(args: &RunArgs, terminal: &Terminal) -> Ending {
    let loaded = load(args, terminal)?;
    let setup = loaded.setup(terminal)?;
    if setup.path == PathSource::Planned {
        loaded.check_ends(&setup)?;
    }
    interrupt::install()?;
    let output = match &args.output {
        Some(path) => Output::create(path, args.force.force)?,
        None => Output::numbered(
            Path::new(""),
            &format!("{}-{}", file_stem(&setup.name), setup.seed),
            "mcap",
        )?,
    };
    let info = RunInfo::of(&setup, &loaded.changes());
    let run_id = info.more.get("run_id").cloned().unwrap_or_default();
    #[cfg(feature = "live")]
    let server = serve(args, &setup, terminal)?;
    #[cfg(feature = "live")]
    let is_live = server.is_some();
    #[cfg(not(feature = "live"))]
    let is_live = false;
    let stream = BufWriter::new(output.handle()?);
    let recorder = McapRecorder::begin(stream, &info, &setup.record)
        .map_err(|error| unwritten(&output, &error))?;
    #[cfg(feature = "live")]
    let recorder = match &server {
        Some(server) => recorder.with_live(server),
        None => recorder,
    };
    let speed = match (args.speed, is_live) {
        (Some(speed), _) => speed,
        (None, true) => Speed::Times(1.0),
        (None, false) => Speed::Max,
    };
    let mut recorder = Paced::new(
        Lenient {
            inner: recorder,
            failure: None,
        },
        speed,
    );

    let report = match ride(&setup, &mut recorder, terminal) {
        Ok(report) => report,
        Err(error) => {
            output.discard();
            return Err(tell(&loaded, error));
        }
    };
    tracing::info!("{} control ticks, {}", report.ticks, report.outcome);
    let Lenient { mut inner, failure } = recorder.into_inner();
    let recorded = match failure {
        Some(failure) => Err(failure),
        None => inner.finish(&ResultInfo::of(&report)),
    };
    let size = inner.bytes_written();
    drop(inner);
    #[cfg(feature = "live")]
    if let Some(server) = server {
        if server.viewers() > 0 {
            thread::sleep(LAST_LOOK);
        }
        server.stop();
    }
    // The ride is worth telling even where its recording failed.
    let recorded = match recorded {
        Ok(()) => output.finish(),
        Err(error) => Err(unwritten(&output, &error)),
    };
    let log = recorded.as_ref().ok().map(PathBuf::as_path);
    if args.json {
        terminal.print_json(&RunJson {
            outcome: report.outcome.name(),
            reason: &report.reason,
            scenario: &setup.name,
            seed: setup.seed,
            plant: setup.plant.name(),
            mode: setup.mode_name().to_owned(),
            log: log.map(render::path),
            result_hash: &report.result_hash,
            run_id: &run_id,
            metrics: &report.metrics,
            expect: &report.expect,
            version: env!("CARGO_PKG_VERSION"),
        })?;
    } else {
        terminal.print(&summary(&setup, &report, log, size))?;
    }
    recorded?;
    Ok(match report.outcome {
        RunOutcome::Interrupted => Exit::Interrupted,
        _ if report.passed() => Exit::Done,
        _ => Exit::NotReached,
    })
}

/// Begins to serve, where that is asked for.
#[cfg(feature = "live")]
fn serve(
    args: &RunArgs,
    setup: &Setup,
    terminal: &Terminal,
) -> Result<Option<LiveServer>, Failure> {
    let Some(address) = args.live else {
        return Ok(None);
    };
    let server = LiveServer::start(&LiveOptions {
        address,
        name: format!("bikebot {}", setup.name),
        ..LiveOptions::default()
    })
    .map_err(|error| {
        let told = match &error {
            LiveError::Listen { address, source } => {
                format!("cannot serve on {address}: {}", plain(source))
            }
            other => other.to_string(),
        };
        Failure::io(
            Diagnostic::error(told)
                .help("is another ride served there? name another port, like --live :8766"),
        )
    })?;
    terminal.remark(&format!("live at ws://{}", server.address()));
    Ok(Some(server))
}

fn load(args: &RunArgs, terminal: &Terminal) -> Result<Loaded, Failure> {
    match (&args.scenario, &args.from) {
        (Some(path), _) => Loaded::read(path, &args.changes),
        (None, Some(path)) => {
            let run = log::read_run(&mut recording::open(path)?)
                .map_err(|error| recording::tell(path, &error))?;
            if run.version != env!("CARGO_PKG_VERSION") {
                terminal.warn(&Diagnostic::warning(format!(
                    "{} was recorded by version {}, and this is {}: the result may differ",
                    path.display(),
                    run.version,
                    env!("CARGO_PKG_VERSION")
                )));
            }
            Loaded::recorded(path, run.scenario_text, run.files, &args.changes)
        }
        (None, None) => unreachable!("clap asks for one of the two"),
    }
}

/// Rides, showing how far it has come.
fn ride(
    setup: &Setup,
    recorder: &mut dyn Recorder,
    terminal: &Terminal,
) -> Result<RunReport, Error> {
    let mut shown = progress::Ride::begin(terminal.is_watched());
    let began = Instant::now();
    let report = bikebot_sim::run(
        setup,
        recorder,
        RunControl {
            stop: &interrupt::asked,
            progress: &mut |progress| match progress {
                Progress::Planning => {}
                Progress::Searched { stage, length } => shown.searched(stage, length),
                Progress::Riding {
                    time,
                    distance,
                    length,
                } => shown.riding(time, distance, length, setup.duration.seconds()),
            },
            clock: Some(&|| began.elapsed().as_secs_f64()),
        },
    );
    drop(shown);
    report
}

/// A recorder whose failure does not end the ride: it is told at the end.
struct Lenient<W: Write + Seek> {
    inner: McapRecorder<W>,
    failure: Option<RecordError>,
}

impl<W: Write + Seek> Recorder for Lenient<W> {
    fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
        // Also after a failure: a recorder drops what it cannot keep, and viewers go on.
        if let Err(error) = self.inner.record(time, event)
            && self.failure.is_none()
        {
            self.failure = Some(error);
        }
        Ok(())
    }
}

/// A name as a part of a file name: what separates folders does not belong in it.
fn file_stem(name: &str) -> String {
    let plain: String = name
        .chars()
        .map(|c| {
            if c.is_alphanumeric() || "-_. ".contains(c) {
                c
            } else {
                '_'
            }
        })
        .collect();
    // A leading dot would hide the recording.
    plain.trim_start_matches('.').to_owned()
}

/// A recording that could not be written.
fn unwritten(output: &Output, error: &RecordError) -> Failure {
    let cause = match error {
        RecordError::Write { written, source } => {
            format!("{} after {}", plain(source), render::bytes(*written))
        }
        other => other.to_string(),
    };
    let mut diagnostic = Diagnostic::error(format!(
        "cannot record to {}: {cause}",
        render::path(output.path())
    ));
    if output.part().exists() {
        diagnostic = diagnostic.help(format!(
            "`bikebot log recover {}` saves what was written",
            render::path(output.part())
        ));
    }
    Failure::io(diagnostic)
}

/// A run that makes no sense.
fn tell(loaded: &Loaded, error: Error) -> Failure {
    match error {
        Error::Plan(error) => Failure::usage(loaded.tell_plan(&error)),
        Error::Record(error) => Failure::io(Diagnostic::error(error.to_string())),
        other => Failure::usage(
            Diagnostic::error(other.to_string())
                .at_line(loaded.name(), None)
                .help("`bikebot explain` shows every value and where it comes from"),
        ),
    }
}

/// The summary for people.
fn summary(setup: &Setup, report: &RunReport, log: Option<&Path>, size: u64) -> String {
    let mut sheet = Sheet::new(
        &format!("{}: {} ({})", setup.name, report.outcome, report.reason),
        &format!(
            "seed {}, {}, {}",
            setup.seed,
            setup.plant.name(),
            setup.mode_name()
        ),
    );
    render::metrics(&mut sheet, &report.metrics);
    render::expectations(&mut sheet, &report.expect);
    if let Some(log) = log {
        sheet.say(
            "recording",
            format!("{} ({})", render::path(log), render::bytes(size)),
        );
    }
    sheet.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_recordings_stay_in_their_folder() {
        assert_eq!(file_stem("fig7-balancer"), "fig7-balancer");
        assert_eq!(file_stem("../../etc/x"), "_.._etc_x");
        assert_eq!(file_stem(".hidden"), "hidden");
    }
}
