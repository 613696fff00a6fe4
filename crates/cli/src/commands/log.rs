//! `bikebot log`: is a recording whole, and what can be saved of one that is not.

use std::path::{Path, PathBuf};

use bikebot_sim::record::log::{self, LogReport};
use clap::Args;
use serde::Serialize;

use crate::args::Force;
use crate::diag::Diagnostic;
use crate::exit::{Ending, Exit, Failure};
use crate::output::{Output, is_same_file};
use crate::recording;
use crate::render::{self, Sheet};
use crate::terminal::Terminal;

/// Read a recording through and tell whether it is whole
///
/// Exit code 0: whole. 3: cut or damaged; what can be read is told.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot log check ride.mcap
  bikebot log check ride.mcap.part")]
pub struct CheckArgs {
    /// Recording
    #[arg(value_name = "FILE.mcap")]
    pub file: PathBuf,
    /// One JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

/// Save what a cut or damaged recording still holds
///
/// Reads up to the first broken record and writes a whole recording. Exit code 0:
/// nothing was lost. 3: saved with losses, which are told.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot log recover ride.mcap.part
  bikebot log recover ride.mcap.part -o ride.mcap")]
pub struct RecoverArgs {
    /// Recording, often a .part left by a crash
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Where to write [default: <name>.recovered.mcap beside it]
    #[arg(short, long, value_name = "OUT.mcap")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub force: Force,
}

/// Problems told one by one; the rest are counted.
const SHOWN: usize = 10;

/// What `log check --json` prints.
#[derive(Debug, Serialize)]
struct CheckJson<'a> {
    file: String,
    whole: bool,
    bytes: u64,
    messages: u64,
    decoded: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    until_s: Option<f64>,
    finished: bool,
    problem_count: u64,
    problems: Vec<ProblemJson<'a>>,
}

#[derive(Debug, Serialize)]
struct ProblemJson<'a> {
    offset: u64,
    text: &'a str,
}

/// Reads it through.
pub fn check(args: &CheckArgs, terminal: &Terminal) -> Ending {
    let mut file = recording::open(&args.file)?;
    let report = log::check(&mut file).map_err(|error| recording::tell(&args.file, &error))?;
    if args.json {
        terminal.print_json(&CheckJson {
            file: render::path(&args.file),
            whole: report.is_whole(),
            bytes: report.info.bytes,
            messages: report.info.messages,
            decoded: report.decoded,
            until_s: report.info.span.map(|(_, last)| last.seconds()),
            finished: report.info.result().is_some(),
            problem_count: report.problem_count,
            problems: report
                .problems
                .iter()
                .map(|problem| ProblemJson {
                    offset: problem.offset,
                    text: &problem.text,
                })
                .collect(),
        })?;
    } else {
        terminal.print(&verdict(&args.file, &report))?;
        if !report.is_whole() {
            terminal.remark(&format!(
                "help: `bikebot log recover {}` saves what can be read",
                render::path(&args.file)
            ));
        }
    }
    Ok(if report.is_whole() {
        Exit::Done
    } else {
        Exit::Io
    })
}

fn verdict(path: &Path, report: &LogReport) -> String {
    let headline = if report.is_whole() {
        "whole"
    } else {
        "not whole"
    };
    let mut sheet = Sheet::new(
        &format!("{}: {headline}", render::path(path)),
        &render::bytes(report.info.bytes),
    );
    let until = report
        .info
        .span
        .map(|(_, last)| format!("up to {:.3} s", last.seconds()));
    let counted = format!(
        "{} can be read",
        render::count(report.info.messages, "message")
    );
    sheet.line(
        "content",
        &[Some(counted), until]
            .into_iter()
            .flatten()
            .collect::<Vec<_>>(),
    );
    if report.info.result().is_none() && report.is_whole() {
        sheet.say("note", "the run in it did not come to its end");
    }
    let shown = report.problems.iter().take(SHOWN);
    for (index, problem) in shown.enumerate() {
        sheet.say(
            if index == 0 { "problems" } else { "" },
            problem.to_string(),
        );
    }
    let more = report.problem_count.saturating_sub(SHOWN as u64);
    if more > 0 {
        sheet.say("", format!("and {more} more"));
    }
    sheet.finish()
}

/// Saves what can be saved.
pub fn recover(args: &RecoverArgs, terminal: &Terminal) -> Ending {
    let mut source = recording::open(&args.file)?;
    // Asked first, so that a file that is no recording leaves nothing behind.
    log::inspect(&mut source).map_err(|error| recording::tell(&args.file, &error))?;
    if let Some(path) = args
        .output
        .as_ref()
        .filter(|path| is_same_file(path, &args.file))
    {
        return Err(Failure::usage(
            Diagnostic::error(format!(
                "cannot write {}: it is the recording to be saved",
                path.display()
            ))
            .help("choose another name: what cannot be read would be gone"),
        ));
    }
    let output = match &args.output {
        // The usual source is `NAME.part` and the usual target `NAME`.
        Some(path) => Output::create_as(path, ".saving", args.force.force)?,
        None => {
            let stem = stem(&args.file);
            let folder = args.file.parent().unwrap_or(Path::new(""));
            Output::numbered(folder, &format!("{stem}.recovered"), "mcap")?
        }
    };
    let mut saved = output.handle()?;
    let report = match log::recover(&mut source, &mut saved) {
        Ok(report) => report,
        Err(error) => {
            let failure = recording::tell(&args.file, &error);
            output.discard();
            return Err(failure);
        }
    };
    drop(saved);
    let path = output.finish()?;
    let mut sheet = Sheet::new(
        &format!("{}: saved", render::path(&path)),
        &render::bytes(report.written.info.bytes),
    );
    sheet.line(
        "saved",
        &[
            render::count(report.messages, "message"),
            render::count(report.attachments, "attachment"),
            render::count(report.metadata, "metadata record"),
        ],
    );
    if let Some((_, last)) = report.written.info.span {
        sheet.say(
            "until",
            format!("{:.3} s of simulated time", last.seconds()),
        );
    }
    match &report.stopped {
        Some(problem) => sheet.say("stopped", problem.to_string()),
        None => sheet.say("lost", "nothing: it was whole"),
    }
    if report.stopped.is_some() && report.nothing_lost {
        sheet.say(
            "lost",
            "nothing: only the index behind the messages was cut",
        );
    }
    for problem in report.written.problems.iter().take(SHOWN) {
        sheet.say("problem", problem.to_string());
    }
    terminal.print(&sheet.finish())?;
    Ok(if report.nothing_lost && report.written.is_whole() {
        Exit::Done
    } else {
        Exit::Io
    })
}

/// `ride` of `ride.mcap` and of `ride.mcap.part`.
fn stem(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name = name.strip_suffix(".part").unwrap_or(&name);
    name.strip_suffix(".mcap").unwrap_or(name).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_saved_is_named_after_the_ride() {
        assert_eq!(stem(Path::new("a/ride.mcap.part")), "ride");
        assert_eq!(stem(Path::new("ride.2.mcap")), "ride.2");
        assert_eq!(stem(Path::new("ride")), "ride");
    }
}
