//! `bikebot plan`: a path only.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bikebot_planner::{
    Budget, CutShort, Enough, Method, Outcome, PlanError, PlanReport, PlanningProblem, Reason,
    Stage, plan_observed,
};
use bikebot_sim::plan_file::{PlanFile, PlanJson, Times};
use bikebot_sim::{Override, Setup};
use clap::Args;

use crate::args::{Changes, EndArg, Force, count, duration, positive, runs, threads};
use crate::diag::Diagnostic;
use crate::exit::{Ending, Exit, Failure};
use crate::input::{Given, Kind, Loaded};
use crate::output::Output;
use crate::progress;
use crate::render::{self, Sheet, significant};
use crate::stopwatch::Stopwatch;
use crate::terminal::Terminal;
use crate::{in_order, interrupt};

/// Plan a path, for a scenario or straight on a map
///
/// Reads a scenario (.toml) or a map: map_server .yaml, .png, .pgm, .bmp, MovingAI
/// .map, polygon scene .json. A heading left out of --start or --goal is free.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot plan scenario.toml
  bikebot plan yard.yaml --start 1,1,0 --goal 8,8,90 --max-curvature 0.8
  bikebot plan scene.json --runs 20 --json | jq .length_m
  bikebot plan scenario.toml --method rrt_star --time-limit 200ms -o plan.json
  bikebot plan scenario.toml --method full --min-time 5ms --target-cost 20 --time-limit 50ms")]
pub struct PlanArgs {
    /// Scenario (.toml) or map file
    #[arg(value_name = "SCENARIO|MAP")]
    pub input: PathBuf,
    /// Planning method [default: the scenario's]
    #[arg(long, value_name = "METHOD")]
    pub method: Option<String>,
    /// Start position in metres, and heading in degrees
    #[arg(long, value_name = "X,Y[,DEG]", allow_hyphen_values = true)]
    pub start: Option<EndArg>,
    /// Goal position in metres, and heading in degrees
    #[arg(long, value_name = "X,Y[,DEG]", allow_hyphen_values = true)]
    pub goal: Option<EndArg>,
    /// Largest curvature of the path, 1/m
    #[arg(long, value_name = "K", allow_hyphen_values = true, value_parser = positive)]
    pub max_curvature: Option<f64>,
    /// What must not touch anything: bike, point, disc:R, capsule:LxW, box:LxW, polygon:X,Y;… (metres)
    #[arg(
        long,
        value_name = "SPEC",
        long_help = "What must not touch anything, in metres: bike (the bike's own outline), point, \
            disc:0.4 (radius), capsule:1.8x0.6 or box:1.8x0.6 (length x width), \
            polygon:-0.4,-0.3;1.4,0;-0.4,0.3 (vertices; x forward, the reference point at 0,0). \
            Default: the scenario's; for a bare map, point"
    )]
    pub footprint: Option<String>,
    /// Stop the search after this many iterations
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = iterations)]
    pub iterations: Option<u64>,
    /// Stop the search after this time, like 10ms or 1.5s; a plan cut by time may not repeat
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub time_limit: Option<Duration>,
    /// Stop as soon as a certified path costs no more than this; the cost is the path's length in metres and a little for its bending
    #[arg(long, value_name = "C", allow_hyphen_values = true, value_parser = positive)]
    pub target_cost: Option<f64>,
    /// With --target-cost: search for at least this time, like 5ms, for what may be cheaper still
    #[arg(long, value_name = "TIME", value_parser = duration, requires = "target_cost")]
    pub min_time: Option<Duration>,
    /// Plan N times with seeds SEED, SEED+1, …; one line each
    #[arg(long, value_name = "N", default_value_t = 1, allow_hyphen_values = true, value_parser = runs)]
    pub runs: u64,
    /// Threads: plans made at the same time, or of one plan the searches; the results are the same for any number
    #[arg(long, value_name = "N", default_value_t = 1, allow_hyphen_values = true, value_parser = threads)]
    pub threads: usize,
    #[command(flatten)]
    pub changes: Changes,
    /// Write the plan, with its curves and the stages of the search, to this JSON file
    #[arg(short, long, value_name = "PLAN.json")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub force: Force,
    /// One JSON object for each run, instead of the summary
    #[arg(long)]
    pub json: bool,
}

fn iterations(text: &str) -> Result<u64, String> {
    count(text, u64::MAX)
}

/// Plans, and tells.
pub fn run(args: &PlanArgs, terminal: &Terminal) -> Ending {
    if args.output.is_some() && args.runs > 1 {
        return Err(Failure::usage(
            Diagnostic::error("-o writes one plan, and --runs asks for several")
                .help("leave out --runs, or redirect the lines of --json to a file"),
        ));
    }
    let loaded = load(args)?;
    let began = Instant::now();
    let mut setup = loaded.setup(terminal)?;
    free_headings(args, &mut setup);
    let Some(problem) = setup.problem() else {
        return Err(Failure::usage(loaded.tell(&loaded.file().error_at(
            "path",
            "there is nothing to plan: the scenario has no map with a start and a goal",
            "add [map] and [goal], or run it as it is",
        ))));
    };
    if args.target_cost.is_some() && setup.planner.method != Method::Full {
        return Err(Failure::usage(
            Diagnostic::error(format!(
                "--target-cost ends a search that goes on for better paths, and \"{}\" stops at the one it finds",
                setup.planner.method
            ))
            .help("leave it out, or plan with --method full"),
        ));
    }
    if let (Some(least), Some(most)) = (args.min_time, args.time_limit)
        && least > most
    {
        return Err(Failure::usage(
            Diagnostic::error("--min-time is longer than --time-limit")
                .help("give a --min-time of at most the --time-limit"),
        ));
    }
    interrupt::install()?;
    let output = match &args.output {
        Some(path) => Some(Output::create(path, args.force.force)?),
        None => None,
    };
    // All that a second question on this map would find ready. A single plan under a time limit prepares only what it comes by,
    // within its limit.
    if args.runs > 1 || args.time_limit.is_none() {
        problem.world.prepare(&interrupt::asked);
    }
    let prepare = began.elapsed().as_secs_f64();
    tracing::info!("map ready after {}", render::time(prepare));
    let question = Question {
        args,
        setup: &setup,
        problem: &problem,
        prepare,
    };
    match output {
        Some(output) => question.write_to(output, &loaded, terminal),
        None => question.told(&loaded, terminal),
    }
}

/// One problem, prepared, and how it is to be asked.
struct Question<'a> {
    args: &'a PlanArgs,
    setup: &'a Setup,
    problem: &'a PlanningProblem<'a>,
    /// What building the shared structures took, s.
    prepare: f64,
}

/// A report, and how it is told to programs.
struct Planned {
    report: PlanReport,
    json: PlanJson,
}

impl Question<'_> {
    /// Plans, telling `searched` each stage and the length it has.
    fn plan(&self, seed: u64, searched: &mut dyn FnMut(Stage, f64)) -> Result<Planned, PlanError> {
        let watch = Stopwatch::start(self.args.time_limit);
        let is_settled = || {
            self.args
                .min_time
                .is_none_or(|least| watch.seconds() >= least.as_secs_f64())
        };
        let budget = Budget {
            enough: self.args.target_cost.map(|cost| Enough {
                cost,
                settled: Some(&is_settled),
            }),
            iterations: self.args.iterations,
            stop: Some(&|| watch.ask()),
            // Of several plans as many are made at the same time; a single one is searched for on all of them.
            threads: if self.args.runs > 1 {
                1
            } else {
                self.args.threads
            },
        };
        let mut times = Times {
            prepare: self.prepare,
            ..Times::default()
        };
        let report = plan_observed(
            self.problem,
            &self.setup.planner,
            seed,
            &budget,
            &mut |entry, _| {
                times.trace.push(watch.seconds());
                searched(entry.stage, entry.length);
            },
        )?;
        times.plan = watch.seconds();
        let json = PlanJson::new(&report, self.problem, &times);
        Ok(Planned { report, json })
    }

    /// As [`Question::plan`], showing how far it has come.
    fn plan_shown(&self, seed: u64, terminal: &Terminal) -> Result<Planned, PlanError> {
        let mut shown = progress::Ride::begin(terminal.is_watched());
        self.plan(seed, &mut |stage, length| shown.searched(stage, length))
    }

    /// One plan, to a file and to the terminal.
    fn write_to(&self, output: Output, loaded: &Loaded, terminal: &Terminal) -> Ending {
        let planned = match self.plan_shown(self.setup.seed, terminal) {
            Ok(planned) => planned,
            Err(error) => return self.invalid(self.setup.seed, &error, loaded, terminal),
        };
        let file = PlanFile::new(
            &planned.json,
            &planned.report,
            self.problem,
            &self.setup.planner,
            loaded.map_name(),
        );
        let mut text = serde_json::to_string(&file).map_err(|error| {
            Failure::io(Diagnostic::error(format!("cannot write the plan: {error}")))
        })?;
        text.push('\n');
        let path = output.write_all(text.as_bytes())?;
        self.show(&planned, Some(&path), terminal)?;
        Ok(exit_of(&planned.report))
    }

    /// All plans, to the terminal, in the order of their seeds.
    fn told(&self, loaded: &Loaded, terminal: &Terminal) -> Ending {
        let (args, runs) = (self.args, self.args.runs);
        let seed = |index: u64| self.setup.seed.saturating_add(index);
        if runs == 1 {
            return match self.plan_shown(seed(0), terminal) {
                Ok(planned) => {
                    self.show(&planned, None, terminal)?;
                    Ok(exit_of(&planned.report))
                }
                Err(error) => self.invalid(seed(0), &error, loaded, terminal),
            };
        }
        let bar = terminal.rows(runs, "planning");
        let mut worst = Exit::Done;
        let mut tally = Tally::default();
        let ended = in_order::run(
            runs,
            args.threads,
            |index| self.plan(seed(index), &mut |_, _| {}),
            |index, planned| {
                bar.done();
                match planned {
                    Ok(planned) => {
                        worst = worst.max_of(exit_of(&planned.report));
                        bar.aside(|| {
                            if args.json {
                                self.show(&planned, None, terminal)
                            } else {
                                terminal.print(&tally.row(index == 0, &planned))
                            }
                        })?;
                        Ok(worst != Exit::Interrupted)
                    }
                    Err(error) => {
                        worst = self.invalid(seed(index), &error, loaded, terminal)?;
                        Ok(false)
                    }
                }
            },
        );
        drop(bar);
        ended?;
        if !args.json {
            terminal.print(&tally.total())?;
        }
        Ok(worst)
    }

    fn show(
        &self,
        planned: &Planned,
        written: Option<&Path>,
        terminal: &Terminal,
    ) -> Result<(), Failure> {
        if self.args.json {
            terminal.print_json(&planned.json)
        } else {
            terminal.print(&self.summary(planned, written))
        }
    }

    /// A problem that makes no sense: told to programs on standard output, to people
    /// on standard error.
    fn invalid(
        &self,
        seed: u64,
        error: &PlanError,
        loaded: &Loaded,
        terminal: &Terminal,
    ) -> Ending {
        if self.args.json {
            terminal.print_json(&PlanJson::invalid(error, self.setup.planner.method, seed))?;
        }
        Err(Failure::usage(loaded.tell_plan(error)))
    }

    fn summary(&self, planned: &Planned, written: Option<&Path>) -> String {
        let Planned { report, json } = planned;
        let headline = match (json.length_m, report.reason) {
            (Some(length), Reason::Found) => {
                format!(
                    "{}: found a path of {} m",
                    self.setup.name,
                    significant(length)
                )
            }
            _ => format!(
                "{}: {} ({})",
                self.setup.name,
                json.outcome,
                words(report.reason)
            ),
        };
        let mut sheet = Sheet::new(&headline, &format!("seed {}, {}", json.seed, json.method));
        let number = |value: Option<f64>, text: &dyn Fn(String) -> String| {
            value.map(|value| text(significant(value)))
        };
        let mut line = |label: &str, parts: Vec<Option<String>>| {
            sheet.line(label, &parts.into_iter().flatten().collect::<Vec<_>>());
        };
        line(
            "length",
            vec![
                number(json.length_m, &|n| format!("{n} m")),
                number(json.lower_bound_m, &|n| {
                    format!("no path is shorter than {n} m")
                }),
            ],
        );
        let limit = significant(self.problem.max_curvature);
        line(
            "curvature",
            match (json.max_curvature_per_m, &report.path) {
                (Some(most), _) => vec![
                    Some(format!(
                        "up to {} /m of the {limit} /m allowed",
                        significant(most)
                    )),
                    number(json.curvature_jump_per_m, &|n| {
                        format!("jumps of up to {n} /m")
                    }),
                ],
                (None, Some(_)) if !report.method.is_curvature_limited() => {
                    vec![Some("unbounded: this method joins straight legs".into())]
                }
                // Nothing was found, or the start is the goal.
                (None, _) => Vec::new(),
            },
        );
        line(
            "shape",
            vec![
                number(json.roughness, &|n| format!("roughness {n}")),
                number(json.roughness_fixed_step, &|n| {
                    format!("{n} on a fixed step")
                }),
            ],
        );
        line(
            "clearance",
            vec![number(json.min_clearance_m, &|n| {
                format!(
                    "at least {n} m around the footprint {}",
                    self.problem.footprint
                )
            })],
        );
        line(
            "search",
            vec![
                json.iterations.map(|count| format!("{count} iterations")),
                json.time_s.map(render::time),
                json.first_s
                    .map(|seconds| format!("first path after {}", render::time(seconds))),
                json.prepare_s
                    .map(|seconds| format!("map prepared in {}", render::time(seconds))),
            ],
        );
        if let Some(cut_short) = report.cut_short {
            let by = match cut_short {
                CutShort::Iterations => "by the iterations allowed",
                CutShort::Deadline => "by the time limit",
                CutShort::Cancelled => "by the user",
            };
            let again = format!("--iterations {} repeats it", report.iterations);
            let again = Some(again).filter(|_| cut_short != CutShort::Iterations);
            line("cut short", vec![Some(by.to_owned()), again]);
        }
        if let Some(path) = written {
            sheet.say("plan", render::path(path));
        }
        sheet.finish()
    }
}

/// The line per run, and what they come to together.
#[derive(Debug, Default)]
struct Tally {
    runs: u64,
    lengths: Vec<f64>,
    seconds: f64,
}

impl Tally {
    fn row(&mut self, is_first: bool, planned: &Planned) -> String {
        let json = &planned.json;
        self.runs += 1;
        self.lengths.extend(json.length_m);
        self.seconds += json.time_s.unwrap_or_default();
        let head = if is_first {
            format!(
                "{:>8}  {:>8}  {:>13}  {:>9}  {:>8}  outcome\n",
                "seed", "length m", "curvature 1/m", "roughness", "time"
            )
        } else {
            String::new()
        };
        let cell = |value: Option<f64>| value.map_or_else(|| "-".into(), significant);
        // The reason says more than the outcome that it stands for, and both do not fit.
        let outcome = match planned.report.outcome {
            Outcome::Found => &json.outcome,
            _ => &json.reason,
        };
        format!(
            "{head}{:>8}  {:>8}  {:>13}  {:>9}  {:>8}  {outcome}\n",
            json.seed,
            cell(json.length_m),
            cell(json.max_curvature_per_m),
            cell(json.roughness),
            render::time(json.time_s.unwrap_or_default()),
        )
    }

    fn total(&self) -> String {
        let found = self.lengths.len();
        let mean = |sum: f64, count: f64| significant(sum / count.max(1.0));
        let mut text = format!("{found} of {} found", self.runs);
        if found > 0 {
            let length = mean(self.lengths.iter().sum(), found as f64);
            text.push_str(&format!(", {length} m on average"));
        }
        if self.runs > 0 {
            let time = render::time(self.seconds / self.runs as f64);
            text.push_str(&format!(", {time} each"));
        }
        text.push('\n');
        text
    }
}

fn exit_of(report: &PlanReport) -> Exit {
    match (report.outcome, report.reason) {
        (Outcome::Found, _) if !interrupt::asked() => Exit::Done,
        (_, Reason::Cancelled) => Exit::Interrupted,
        (Outcome::Found, _) => Exit::Interrupted,
        _ => Exit::NotReached,
    }
}

/// A reason in words.
fn words(reason: Reason) -> &'static str {
    match reason {
        Reason::Found => "found",
        Reason::Disconnected => "start and goal lie in different rooms for this footprint",
        Reason::CurvatureInfeasible => {
            "no path within the curvature limit has the headings asked for"
        }
        Reason::NoCurve => {
            "a way through, but no path along it within the curvature limit was found"
        }
        Reason::Iterations => "the iterations ran out",
        Reason::Deadline => "the time limit passed",
        Reason::Cancelled => "interrupted",
    }
}

/// The flags of this verb, as changes to the scenario: so they are checked and
/// told like everything else.
fn flags(args: &PlanArgs) -> Vec<Given> {
    let mut flags = Vec::new();
    let mut flag = |key: &str, value: String, typed: String| {
        flags.push(Given {
            change: Override::new(key, value),
            typed,
        });
    };
    let quoted = |text: &str| toml::Value::from(text).to_string();
    if let Some(method) = &args.method {
        flag(
            "planner.method",
            quoted(method),
            format!("--method {method}"),
        );
    }
    flags.extend(problem_flags(
        args.start,
        args.goal,
        args.max_curvature,
        args.footprint.as_deref(),
    ));
    flags
}

/// The flags that say what is asked, as changes to the scenario.
pub(super) fn problem_flags(
    start: Option<EndArg>,
    goal: Option<EndArg>,
    max_curvature: Option<f64>,
    footprint: Option<&str>,
) -> Vec<Given> {
    let mut flags = Vec::new();
    let mut flag = |key: &str, value: String, typed: String| {
        flags.push(Given {
            change: Override::new(key, value),
            typed,
        });
    };
    if let Some(footprint) = footprint {
        flag(
            "planner.footprint",
            toml::Value::from(footprint).to_string(),
            format!("--footprint {footprint}"),
        );
    }
    if let Some(curvature) = max_curvature {
        flag(
            "planner.max_curvature_per_m",
            format!("{curvature:?}"),
            format!("--max-curvature {curvature}"),
        );
    }
    for (name, end) in [("start", start), ("goal", goal)] {
        let Some(EndArg { x, y, heading_deg }) = end else {
            continue;
        };
        let heading = heading_deg.map_or_else(String::new, |heading| format!(",{heading}"));
        let typed = format!("--{name} {x},{y}{heading}");
        flag(&format!("{name}.x_m"), format!("{x:?}"), typed.clone());
        flag(&format!("{name}.y_m"), format!("{y:?}"), typed.clone());
        if let Some(heading) = heading_deg {
            flag(
                &format!("{name}.heading_deg"),
                format!("{heading:?}"),
                typed,
            );
        }
    }
    flags
}

fn load(args: &PlanArgs) -> Result<Loaded, Failure> {
    if Kind::of(&args.input) == Kind::Map {
        Loaded::bare_map(&args.input, &args.changes, flags(args))
    } else {
        Loaded::read_with(&args.input, &args.changes, flags(args))
    }
}

/// A heading left out on the command line is free, whatever the file says.
fn free_headings(args: &PlanArgs, setup: &mut Setup) {
    let is_free = |end: Option<EndArg>| end.is_some_and(|end| end.heading_deg.is_none());
    if let Some(start) = setup.start_pose.as_mut().filter(|_| is_free(args.start)) {
        start.heading = None;
    }
    if let Some(goal) = setup.goal.as_mut().filter(|_| is_free(args.goal)) {
        goal.heading = None;
    }
}
