//! `bikebot verify`: an independent check of a plan.

use std::path::{Path, PathBuf};

use bikebot_planner::{Method, PathKind, PlanningProblem, Terms, Verdict, ViolationKind, verify};
use bikebot_report::ReportError;
use bikebot_report::plan_file::read_json;
use bikebot_sim::Override;
use bikebot_sim::plan_file::{Mismatch, StoredPlan, StoredProblem};
use clap::Args;
use serde::Serialize;
use serde_json::Value;

use super::plan::problem_flags;
use crate::args::{Changes, EndArg, positive};
use crate::diag::Diagnostic;
use crate::exit::{Ending, Exit, Failure};
use crate::input::{Given, Kind, Loaded};
use crate::plan_text;
use crate::render::{Sheet, significant};
use crate::terminal::Terminal;

/// Prove again what a plan promises: clearance, curvature, continuity, ends
///
/// Reads a plan written by `bikebot plan -o` and the scenario or map it was made for, and
/// proves every figure by code that shares nothing with the planner's own checks.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot plan scenario.toml -o plan.json && bikebot verify plan.json scenario.toml
  bikebot verify plan.json yard.yaml
  bikebot verify plan.json scenario.toml --footprint capsule:1.8x0.6 --json | jq .violations")]
pub struct VerifyArgs {
    /// Plan written by `bikebot plan -o`
    #[arg(value_name = "PLAN.json")]
    pub plan: PathBuf,
    /// Scenario (.toml) or map file
    #[arg(value_name = "SCENARIO|MAP")]
    pub input: PathBuf,
    /// Start position in metres, and heading in degrees, as given to plan
    #[arg(long, value_name = "X,Y[,DEG]", allow_hyphen_values = true)]
    pub start: Option<EndArg>,
    /// Goal position in metres, and heading in degrees, as given to plan
    #[arg(long, value_name = "X,Y[,DEG]", allow_hyphen_values = true)]
    pub goal: Option<EndArg>,
    /// Largest curvature allowed, 1/m
    #[arg(long, value_name = "K", allow_hyphen_values = true, value_parser = positive)]
    pub max_curvature: Option<f64>,
    /// What must not touch anything: bike, point, disc:R, capsule:LxW, box:LxW, polygon:X,Y;… (metres)
    #[arg(long, value_name = "SPEC")]
    pub footprint: Option<String>,
    #[command(flatten)]
    pub changes: Changes,
    /// One JSON object, instead of the table
    #[arg(long)]
    pub json: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct VerifyJson<'a> {
    holds: bool,
    /// Where the plan was made for something else.
    problem: &'a [Mismatch],
    #[serde(flatten)]
    verdict: &'a Verdict,
    version: &'static str,
}

fn read_plan(path: &Path) -> Result<StoredPlan, Failure> {
    let place = path.display().to_string();
    let text = plan_text::read(path, "no plan", "")?;
    let refused = |error: ReportError| plan_text::tell(&error, &place, &text);
    let json: Value = read_json(&text).map_err(refused)?;
    // How it ended comes first: a plan without a path has little else to tell.
    if let Some(outcome) = json.get("outcome").and_then(Value::as_str)
        && outcome != "found"
    {
        return Err(Failure::usage(
            Diagnostic::error(format!(
                "there is no path in the plan: its outcome is {outcome}"
            ))
            .at_line(&place, None)
            .help("it takes a plan whose outcome is found"),
        ));
    }
    if let Some(method) = json.get("method").and_then(Value::as_str)
        && method.parse::<Method>().is_err()
    {
        let known = Method::ALL.map(Method::name).join(", ");
        return Err(Failure::usage(
            Diagnostic::error(format!("`method`: there is no method \"{method}\""))
                .at_line(&place, None)
                .help(format!("known are {known}")),
        ));
    }
    read_json(&text).map_err(refused)
}

/// Checks, and tells.
pub fn run(args: &VerifyArgs, terminal: &Terminal) -> Ending {
    let plan = read_plan(&args.plan)?;
    let given = problem_flags(
        args.start,
        args.goal,
        args.max_curvature,
        args.footprint.as_deref(),
    );
    let is_map = Kind::of(&args.input) == Kind::Map;
    let loaded = if is_map {
        // A map says nothing about start, goal and limits: the plan does.
        let mut flags = from_plan(&plan.problem, &args.plan);
        flags.extend(given);
        Loaded::bare_map(&args.input, &args.changes, flags)?
    } else {
        Loaded::read_with(&args.input, &args.changes, given)?
    };
    let setup = loaded.setup(terminal)?;
    let Some(mut problem) = setup.problem() else {
        return Err(Failure::usage(loaded.tell(&loaded.file().error_at(
            "path",
            "there is nothing to verify against: the scenario has no map with a start and a goal",
            "give the map instead, or add [map] and [goal]",
        ))));
    };
    // A heading left out on the command line is free, whatever the file says; that of a plan on a bare map is its own.
    match args.start {
        Some(end) if end.heading_deg.is_none() => problem.start.heading = None,
        None if is_map => problem.start.heading = plan.problem.start.heading_rad,
        _ => {}
    }
    match args.goal {
        Some(end) if end.heading_deg.is_none() => problem.goal.heading = None,
        None if is_map => problem.goal.heading = plan.problem.goal.heading_rad,
        _ => {}
    }
    let mismatches = plan.mismatches(&problem, setup.planner.margin);
    let terms = plan.terms(setup.planner.margin, problem.goal.tolerance);
    let verdict = verify(&problem, &plan.curves(), &terms);
    let holds = verdict.holds() && mismatches.is_empty();
    if args.json {
        terminal.print_json(&VerifyJson {
            holds,
            problem: &mismatches,
            verdict: &verdict,
            version: env!("CARGO_PKG_VERSION"),
        })?;
    } else {
        let text = sheet(&args.plan, &plan, &problem, &terms, &verdict, &mismatches);
        terminal.print(&text)?;
    }
    Ok(if holds { Exit::Done } else { Exit::NotReached })
}

/// What the plan says was asked, as changes to a scenario that only names a map.
fn from_plan(problem: &StoredProblem, path: &Path) -> Vec<Given> {
    let typed = path.display().to_string();
    let number = |key: &str, value: f64| Given {
        change: Override::new(key, format!("{value:?}")),
        typed: typed.clone(),
    };
    vec![
        number("start.x_m", problem.start.x_m),
        number("start.y_m", problem.start.y_m),
        number("goal.x_m", problem.goal.x_m),
        number("goal.y_m", problem.goal.y_m),
        number("goal.tolerance_m", problem.tolerance_m),
        number("planner.max_curvature_per_m", problem.max_curvature_per_m),
        number("planner.margin_m", problem.margin_m),
        Given {
            change: Override::new(
                "planner.footprint",
                toml::Value::from(problem.footprint.as_str()).to_string(),
            ),
            typed: typed.clone(),
        },
    ]
}

fn sheet(
    path: &Path,
    plan: &StoredPlan,
    problem: &PlanningProblem<'_>,
    terms: &Terms,
    verdict: &Verdict,
    mismatches: &[Mismatch],
) -> String {
    let holds = verdict.holds() && mismatches.is_empty();
    let word = if holds { "holds" } else { "does not hold" };
    let mut sheet = Sheet::new(&format!("{}: {word}", path.display()), plan.method.name());
    let promised = |value: Option<f64>, unit: &str| {
        value.map_or_else(
            || "nothing promised".to_owned(),
            |value| format!("{} {unit} promised", significant(value)),
        )
    };
    if let Some(c) = &verdict.certificate {
        sheet.line(
            "length",
            &[
                promised(plan.length_m, "m"),
                format!(
                    "{:.6} to {:.6} m proven",
                    c.length_at_least, c.length_at_most
                ),
            ],
        );
        match (c.max_curvature, c.curvature_jump, c.heading_gap) {
            (Some(most), Some(jump), Some(gap)) => {
                sheet.line(
                    "curvature",
                    &[
                        promised(plan.max_curvature_per_m, "/m"),
                        format!(
                            "at most {} /m proven, {} /m allowed",
                            significant(most),
                            significant(problem.max_curvature)
                        ),
                    ],
                );
                sheet.line(
                    "joints",
                    &[
                        format!("curvature jumps by {} /m", significant(jump)),
                        format!("heading by {} rad", significant(gap)),
                        format!("position by {} m", significant(c.position_gap)),
                    ],
                );
            }
            _ => sheet.line(
                "curvature",
                &["unbounded: this method joins straight legs".to_owned()],
            ),
        }
        let around = match terms.kind {
            PathKind::Curves => format!("around the footprint {}", problem.footprint),
            PathKind::Polyline => "around the largest disc in the footprint".to_owned(),
        };
        sheet.line(
            "clearance",
            &[
                promised(plan.min_clearance_m, "m"),
                format!(
                    "at least {} m proven {around}",
                    significant(c.min_clearance)
                ),
            ],
        );
        sheet.line(
            "ends",
            &[
                format!("{} m from the start", significant(c.start_gap)),
                format!("{} m from the goal", significant(c.goal_gap)),
            ],
        );
    }
    for mismatch in mismatches {
        let Mismatch { what, plan, given } = mismatch;
        sheet.say(
            "fails",
            format!("another {what}: {plan} in the plan, {given} given"),
        );
    }
    for violation in &verdict.violations {
        let place = match (violation.segment, violation.parameter) {
            (Some(segment), Some(t)) => format!(", segment {segment} at T = {}", significant(t)),
            (Some(segment), None) => format!(", segment {segment}"),
            _ => String::new(),
        };
        sheet.say(
            "fails",
            format!(
                "{}{place}, by {}",
                words(violation.kind),
                significant(-violation.margin)
            ),
        );
    }
    sheet.finish()
}

/// A kind of violation in words, and its unit.
fn words(kind: ViolationKind) -> &'static str {
    match kind {
        ViolationKind::NotFinite => "a number is not finite",
        ViolationKind::PositionGap => "segments do not meet (m)",
        ViolationKind::HeadingGap => "the heading jumps (rad)",
        ViolationKind::Cusp => "the curve stands still",
        ViolationKind::Curvature => "the curvature exceeds the limit (1/m)",
        ViolationKind::Clearance => "the clearance asked for is not there (m)",
        ViolationKind::StartPosition => "it starts elsewhere (m)",
        ViolationKind::StartHeading => "it starts in another direction (rad)",
        ViolationKind::StartCurvature => "it starts with another curvature (1/m)",
        ViolationKind::EndPosition => "it ends elsewhere (m)",
        ViolationKind::EndHeading => "it ends in another direction (rad)",
        ViolationKind::CurvaturePromise => "the curvature is larger than promised (1/m)",
        ViolationKind::JumpPromise => "the curvature jumps more than promised (1/m)",
        ViolationKind::ClearancePromise => "the clearance is less than promised (m)",
        ViolationKind::LengthPromise => "the length is another than promised (m)",
    }
}
