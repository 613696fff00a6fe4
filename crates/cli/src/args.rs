//! What the user typed: the verbs, and the flags several verbs share. Each
//! verb's own flags stand beside its code in [`crate::commands`].

use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use clap::{ArgAction, Args, Parser, Subcommand, ValueEnum};

use crate::commands;

/// Plan, balance and ride a two-wheeled robot in simulation.
///
/// bikebot plans a path that a bicycle can ride, balances the bicycle with a
/// moving mass, follows the path, and records the whole ride. Everything is
/// simulated and repeatable: the same scenario and seed give the same bits.
#[derive(Debug, Parser)]
#[command(
    name = "bikebot",
    version,
    arg_required_else_help = true,
    max_term_width = 100,
    after_help = "Start with:\n  bikebot init            write a commented scenario.toml\n  bikebot run scenario.toml\n\n'bikebot help VERB' shows a verb's flags and examples.",
    after_long_help = "\
Examples:
  bikebot init                                 # write a commented scenario.toml
  bikebot run scenario.toml                    # plan, ride and record it
  bikebot plan maps/yard.yaml --start 1,1,0 --goal 8,8
  bikebot sweep scenario.toml --vary bike.m1_kg=30:50:5 --runs 20 -o masses.csv

Results go to standard output, everything else to standard error.

Exit codes:
    0  done: arrived, found, or every expectation and check holds
    1  ran, but the goal was not reached, or a check or claim does not hold
    2  bad usage, scenario or map
    3  input or output failed, or a log was saved with losses
  130  interrupted; the recording is closed and readable

Environment:
  BIKEBOT_SEED  the seed, where --seed is not given
  BIKEBOT_LOG   what to log on standard error: error, warn, info, debug, trace,
                or per part, like info,bikebot_planner=debug
  NO_COLOR      no colour, whatever the terminal can do"
)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub verb: Verb,
    /// Flags every verb takes.
    #[command(flatten)]
    pub common: Common,
}

/// The verbs.
#[derive(Debug, Subcommand)]
pub enum Verb {
    Run(commands::run::RunArgs),
    Plan(commands::plan::PlanArgs),
    Verify(commands::verify::VerifyArgs),
    Table2(commands::table2::Table2Args),
    Reproduce(commands::reproduce::ReproduceArgs),
    Plot(commands::plot::PlotArgs),
    Report(commands::report::ReportArgs),
    Sweep(commands::sweep::SweepArgs),
    Compare(commands::compare::CompareArgs),
    Eigenvalues(commands::eigenvalues::EigenvaluesArgs),
    Check(commands::check::CheckArgs),
    Explain(commands::explain::ExplainArgs),
    Schema(commands::schema::SchemaArgs),
    Init(commands::init::InitArgs),
    /// Look at map files, and make them from laser logs
    #[command(subcommand, arg_required_else_help = true)]
    Map(MapVerb),
    Info(commands::info::InfoArgs),
    /// Check recordings, and save what a cut one holds
    #[command(subcommand, arg_required_else_help = true)]
    Log(LogVerb),
    Completions(commands::completions::CompletionsArgs),
    Man(commands::man::ManArgs),
}

/// `bikebot map …`
#[derive(Debug, Subcommand)]
pub enum MapVerb {
    Info(commands::map::InfoArgs),
    Build(commands::map_build::BuildArgs),
}

/// `bikebot log …`
#[derive(Debug, Subcommand)]
pub enum LogVerb {
    Check(commands::log::CheckArgs),
    Recover(commands::log::RecoverArgs),
}

/// Flags every verb takes.
#[derive(Debug, Args)]
#[command(next_help_heading = "Common options")]
pub struct Common {
    /// Say less: errors only, no warnings, no progress
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Log more on standard error; twice for even more
    #[arg(short, long, global = true, action = ArgAction::Count)]
    pub verbose: u8,
    /// No progress bar (there is one only where standard error is a terminal)
    #[arg(long, global = true)]
    pub no_progress: bool,
    /// Colour messages
    #[arg(
        long,
        global = true,
        value_name = "WHEN",
        default_value = "auto",
        hide_possible_values = true,
        help = "Colour messages: auto, always or never"
    )]
    pub color: ColorChoice,
}

/// When to colour messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ColorChoice {
    /// On a terminal, unless NO_COLOR is set.
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// What alters a scenario without editing its file.
#[derive(Debug, Clone, Default, Args)]
pub struct Changes {
    /// Seed of everything random; wins over the scenario's `run.seed`
    #[arg(
        long,
        value_name = "N",
        env = "BIKEBOT_SEED",
        hide_env_values = true,
        allow_hyphen_values = true,
        value_parser = seed
    )]
    pub seed: Option<u64>,
    /// Set one key of the scenario, like follow.max_speed_mps=2 (repeatable)
    #[arg(
        long = "set",
        value_name = "KEY=VALUE",
        long_help = "Set one key of the scenario, as if it stood in the file: \
            --set follow.max_speed_mps=2 --set bike.mode=balancer. The value is TOML; what is \
            not TOML is taken as text. May be given several times; the last one counts"
    )]
    pub set: Vec<String>,
}

/// `--force`, beside an output name.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct Force {
    /// Replace an existing output file
    #[arg(long)]
    pub force: bool,
}

/// A point with or without a heading, as in `--start 1,1,90`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EndArg {
    /// x [m].
    pub x: f64,
    /// y [m].
    pub y: f64,
    /// Heading from the x axis, counter-clockwise [°].
    pub heading_deg: Option<f64>,
}

impl FromStr for EndArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text
            .split(',')
            .map(|part| {
                let number: f64 = part
                    .trim()
                    .parse()
                    .map_err(|_| format!("`{}` is not a number", part.trim()))?;
                if number.is_finite() {
                    Ok(number)
                } else {
                    Err(format!("`{}` is not a finite number", part.trim()))
                }
            })
            .collect::<Result<Vec<f64>, String>>()?;
        match numbers[..] {
            [x, y] => Ok(Self {
                x,
                y,
                heading_deg: None,
            }),
            [x, y, heading] => Ok(Self {
                x,
                y,
                heading_deg: Some(heading),
            }),
            _ => Err(format!(
                "{} number{} given; say X,Y in metres, or X,Y,DEG with a heading in degrees",
                numbers.len(),
                if numbers.len() == 1 { "" } else { "s" }
            )),
        }
    }
}

/// A span of time with its unit: `10ms`, `1.5s`, `2min`.
pub fn duration(text: &str) -> Result<Duration, String> {
    let split = text
        .find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-' | '+')))
        .unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let factor = match unit.trim() {
        "us" => 1e-6,
        "ms" => 1e-3,
        "s" => 1.0,
        "min" => 60.0,
        "" => return Err(format!("say the unit: {text}ms or {text}s")),
        other => return Err(format!("unknown unit `{other}`; use us, ms, s or min")),
    };
    let number: f64 = number
        .parse()
        .map_err(|_| format!("`{number}` is not a number"))?;
    match Duration::try_from_secs_f64(number * factor) {
        Ok(duration) if !duration.is_zero() => Ok(duration),
        _ => Err("it must be longer than nothing".into()),
    }
}

/// A seed: a whole number that TOML can hold.
pub fn seed(text: &str) -> Result<u64, String> {
    match text.parse::<u64>() {
        Ok(seed) if i64::try_from(seed).is_ok() => Ok(seed),
        _ => Err(format!("it takes a whole number from 0 to {}", i64::MAX)),
    }
}

/// A number that is finite and above zero.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() && number > 0.0 => Ok(number),
        Ok(_) => Err("it must be a finite number above 0".into()),
        Err(_) => Err(format!("`{text}` is not a number")),
    }
}

/// A time that is finite and not negative, s.
pub fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() && number >= 0.0 => Ok(number),
        Ok(_) => Err("it must be a finite number of seconds, not below 0".into()),
        Err(_) => Err(format!("`{text}` is not a number of seconds")),
    }
}

/// A count of at least one and at most `most`.
pub fn count(text: &str, most: u64) -> Result<u64, String> {
    match text.parse::<u64>() {
        Ok(count) if (1..=most).contains(&count) => Ok(count),
        _ if most == u64::MAX => Err("it takes a whole number of at least 1".into()),
        _ => Err(format!("it takes a whole number from 1 to {most}")),
    }
}

/// How many runs to make.
pub fn runs(text: &str) -> Result<u64, String> {
    count(text, 1_000_000)
}

/// How many threads to work with.
pub fn threads(text: &str) -> Result<usize, String> {
    count(text, 4096).map(|count| count as usize)
}

/// How many things to do at once.
#[derive(Debug, Clone, Copy, Args)]
pub struct Jobs {
    /// Threads to work with; the rows are the same for any number [default: all cores]
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = threads)]
    pub jobs: Option<usize>,
}

impl Jobs {
    /// The number of threads to use.
    pub fn count(self) -> usize {
        self.jobs
            .unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
    }
}

/// A file to read, named on the command line.
#[derive(Debug, Clone, Args)]
pub struct ScenarioArg {
    /// Scenario file (TOML); '-' reads standard input
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_surface_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn the_verbs_are_the_promised_ones() {
        let verbs: Vec<String> = Cli::command()
            .get_subcommands()
            .map(|verb| verb.get_name().to_owned())
            .collect();
        assert_eq!(
            verbs,
            [
                "run",
                "plan",
                "verify",
                "table2",
                "reproduce",
                "plot",
                "report",
                "sweep",
                "compare",
                "eigenvalues",
                "check",
                "explain",
                "schema",
                "init",
                "map",
                "info",
                "log",
                "completions",
                "man"
            ]
        );
    }

    #[test]
    fn every_verb_shows_an_example() {
        fn visit(command: &clap::Command, path: &str) {
            let path = format!("{path} {}", command.get_name());
            if command.has_subcommands() {
                for verb in command.get_subcommands() {
                    visit(verb, &path);
                }
            } else {
                let help = command
                    .get_after_help()
                    .or(command.get_after_long_help())
                    .map(ToString::to_string)
                    .unwrap_or_default();
                assert!(help.contains("Examples:"), "{path} has no example");
            }
        }
        for verb in Cli::command().get_subcommands() {
            visit(verb, "bikebot");
        }
    }

    /// The words of a line as a shell takes them apart, one list for each command of it. What is redirected goes.
    fn commands(line: &str) -> Vec<Vec<String>> {
        let mut all = vec![Vec::new()];
        let (mut word, mut is_word, mut is_quoted) = (String::new(), false, false);
        let mut is_target = false;
        for c in line.chars().chain([' ']) {
            match c {
                '\'' => (is_quoted, is_word) = (!is_quoted, true),
                '#' if !is_word && !is_quoted => break,
                '|' | '&' | '>' | ' ' if !is_quoted => {
                    if is_word && !is_target {
                        all.last_mut().unwrap().push(word.clone());
                    }
                    if is_word {
                        is_target = false;
                    }
                    (word, is_word) = (String::new(), false);
                    match c {
                        '>' => is_target = true,
                        '|' | '&' => all.push(Vec::new()),
                        _ => {}
                    }
                }
                c => {
                    word.push(c);
                    is_word = true;
                }
            }
        }
        assert!(!is_quoted, "{line}");
        all.retain(|words| !words.is_empty());
        all
    }

    #[test]
    fn every_example_of_the_help_is_understood() {
        fn visit(command: &clap::Command, seen: &mut usize) {
            let help = [command.get_after_help(), command.get_after_long_help()];
            for text in help.into_iter().flatten().map(ToString::to_string) {
                let text = text.replace("\\\n", " ");
                let examples = text.split_once("Examples:\n").map_or("", |(_, rest)| rest);
                let examples = examples.split("\n\n").next().unwrap_or_default();
                for words in examples.lines().flat_map(commands) {
                    if words[0] == "bikebot" {
                        *seen += 1;
                        if let Err(error) = Cli::try_parse_from(&words) {
                            panic!("{words:?}: {error}");
                        }
                    }
                }
            }
            for verb in command.get_subcommands() {
                visit(verb, seen);
            }
        }
        let mut seen = 0;
        visit(&Cli::command(), &mut seen);
        assert!(seen > 60, "only {seen} were found");
    }

    #[test]
    fn ends_are_two_or_three_numbers() {
        let end: EndArg = "-1.5, 2e1,90".parse().unwrap();
        assert_eq!((end.x, end.y, end.heading_deg), (-1.5, 20.0, Some(90.0)));
        for bad in ["", "1", "1,2,3,4", "1,x", "nan,1", "1,inf"] {
            assert!(bad.parse::<EndArg>().is_err(), "{bad}");
        }
    }

    #[test]
    fn durations_need_a_unit() {
        assert_eq!(duration("10ms"), Ok(Duration::from_millis(10)));
        assert_eq!(duration("1.5s"), Ok(Duration::from_millis(1500)));
        for bad in ["10", "", "ms", "-1s", "0s", "1h", "1e999s", "nan", "NaNs"] {
            assert!(duration(bad).is_err(), "{bad}");
        }
    }
}
