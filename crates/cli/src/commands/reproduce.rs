//! `bikebot reproduce`: the paper's tables and figures, measured now, with a verdict for each claim.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use bikebot_report::reproduction::Reproduction;
use bikebot_sim::study::reproduce::{FILES, Judged, ReproduceStudy, Verdict, judge};
use clap::Args;
use serde::Serialize;

use crate::args::{Force, Jobs, runs, seed};
use crate::diag::Diagnostic;
use crate::exit::{Ending, Exit, Failure, plain};
use crate::interrupt;
use crate::output::{Output, make_folder};
use crate::picture::Format;
use crate::render::{self, Sheet};
use crate::terminal::Terminal;

/// Plans of every method that has chance in it, and rides of each kind.
const RUNS: u64 = 20;
/// The plans of `--quick`: as many as the paper's.
const QUICK_RUNS: u64 = 10;
/// The rides of `--quick`.
const QUICK_RIDES: u64 = 3;
/// What is written last: a folder with it is whole.
const PAGE: &str = "index.html";

/// Measure the paper again: its tables and figures, and a verdict for each claim
///
/// Plans and rides what the paper does, on the shipped scenarios, and writes a folder: index.html (one page, without
/// a network), the same as report.md, Fig. 5 to 8 as SVG and PNG, Table 2 as CSV, every number as JSON, and the scenarios,
/// so that each command of the page works from there. Ends with 1 if a claim fails; one that differs for a reason that
/// is known, and told, does not fail.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot reproduce
  bikebot reproduce -o paper --runs 100
  bikebot reproduce --quick -o /tmp/paper
  bikebot reproduce --json | jq '.claims[] | {id, verdict, ours, paper}'")]
pub struct ReproduceArgs {
    /// Folder for the pages and figures, made if it is not there
    #[arg(short, long, value_name = "DIR", default_value = "reproduction")]
    pub output: PathBuf,
    /// Plans of every method, and rides of each kind, with seeds SEED, SEED+1, … [default: 20]
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = runs)]
    pub runs: Option<u64>,
    /// All claims and figures of 10 plans of every method and 3 rides of each kind
    #[arg(long, conflicts_with = "runs")]
    pub quick: bool,
    /// Seed of the first run
    #[arg(
        long,
        value_name = "N",
        env = "BIKEBOT_SEED",
        hide_env_values = true,
        default_value_t = 1,
        allow_hyphen_values = true,
        value_parser = seed
    )]
    pub seed: u64,
    #[command(flatten)]
    pub jobs: Jobs,
    #[command(flatten)]
    pub force: Force,
    /// One JSON object instead of the list of claims
    #[arg(long)]
    pub json: bool,
}

/// What `--json` prints, and what claims.json holds.
#[derive(Debug, Serialize)]
struct ReproduceJson<'a> {
    runs: u64,
    rides: u64,
    seed: u64,
    holds: usize,
    differs: usize,
    fails: usize,
    not_measured: usize,
    claims: &'a [Judged],
    #[serde(skip_serializing_if = "Option::is_none")]
    output: Option<String>,
    version: &'static str,
}

/// Measures, judges, writes.
pub fn run(args: &ReproduceArgs, terminal: &Terminal) -> Ending {
    interrupt::install()?;
    let folder = Folder::prepare(&args.output, args.force.force)?;
    let began = Instant::now();
    let (runs, rides) = match (args.runs, args.quick) {
        (Some(runs), _) => (runs, runs),
        (None, true) => (QUICK_RUNS, QUICK_RIDES),
        (None, false) => (RUNS, RUNS),
    };
    let effort = match (args.runs, args.quick) {
        (Some(runs), _) => format!(" --runs {runs}"),
        (None, true) => " --quick".into(),
        (None, false) => String::new(),
    };
    let again = format!("bikebot reproduce{effort} --seed {} -o again", args.seed);
    let study = ReproduceStudy {
        runs,
        rides,
        seed: args.seed,
        jobs: args.jobs.count(),
        clock: &|| began.elapsed().as_secs_f64(),
        stop: &interrupt::asked,
    };
    let broken = |error: &dyn std::fmt::Display| {
        Failure::usage(
            Diagnostic::error(error.to_string())
                .note("the scenarios come with the program: this is a mistake of ours"),
        )
    };
    let bar = terminal.rows(study.steps().map_err(|error| broken(&error))?, "Table 2");
    let made = study.measure(&mut |what| {
        bar.done_before(what);
    });
    drop(bar);
    let Some((measured, material)) = made.map_err(|error| broken(&error))? else {
        return Ok(Exit::Interrupted);
    };
    let judged = judge(&measured);
    let it = Reproduction {
        measured: &measured,
        judged: &judged,
        material: &material,
        again: &again,
        version: env!("CARGO_PKG_VERSION"),
    };
    let figures = it.figures().map_err(|error| broken(&error))?;
    let told = |output| ReproduceJson {
        runs: measured.runs,
        rides: measured.rides,
        seed: measured.seed,
        holds: it.count(Verdict::Holds),
        differs: it.count(Verdict::Differs),
        fails: it.count(Verdict::Fails),
        not_measured: it.count(Verdict::NotMeasured),
        claims: &judged,
        output,
        version: env!("CARGO_PKG_VERSION"),
    };
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for file in FILES {
        files.push((file.path.to_owned(), file.text.as_bytes().to_owned()));
    }
    for figure in &figures {
        for format in [Format::Svg, Format::Png] {
            let name = format!("{}.{}", figure.name, format.ending());
            files.push((name, format.write(&figure.drawing, 1.0, "")?));
        }
    }
    files.push(("table2.csv".into(), measured.table2.to_csv().into_bytes()));
    files.push(("claims.json".into(), in_json(&told(None))?));
    files.push(("measured.json".into(), in_json(&measured)?));
    files.push(("report.md".into(), it.markdown(&figures).into_bytes()));
    files.push((PAGE.into(), it.html(&figures).into_bytes()));
    if interrupt::asked() {
        return Ok(Exit::Interrupted);
    }
    let page = folder.fill(files)?;
    if args.json {
        terminal.print_json(&told(Some(render::path(&args.output))))?;
    } else {
        terminal.print(&summary(&it, &page, began.elapsed().as_secs_f64()))?;
    }
    Ok(if it.count(Verdict::Fails) > 0 {
        Exit::NotReached
    } else {
        Exit::Done
    })
}

fn in_json(value: &impl Serialize) -> Result<Vec<u8>, Failure> {
    let mut text = serde_json::to_vec_pretty(value).map_err(|error| {
        Failure::io(Diagnostic::error(format!(
            "cannot write the claims: {error}"
        )))
    })?;
    text.push(b'\n');
    Ok(text)
}

/// The claims for people, one paragraph each.
fn summary(it: &Reproduction<'_>, page: &Path, seconds: f64) -> String {
    let measured = it.measured;
    let (runs, rides) = (
        render::count(measured.runs, "plan"),
        render::count(measured.rides, "ride"),
    );
    let mut sheet = Sheet::new(
        &it.sentence(),
        &format!("{runs}, {rides} from seed {}", measured.seed),
    );
    for judged in it.judged {
        let ours = judged.finding.as_ref().map_or("", |it| it.ours.as_str());
        let mut parts = vec![format!("{}: {}", judged.id, ours.replace('`', ""))];
        let paper = judged.finding.as_ref().map_or("", |it| it.paper.as_str());
        if !paper.is_empty() {
            parts.push(format!("paper: {paper}"));
        }
        sheet.line(judged.verdict.word(), &parts);
    }
    sheet.say("took", render::time(seconds));
    sheet.say("page", render::path(page));
    sheet.finish()
}

/// Where it all goes.
struct Folder<'a> {
    path: &'a Path,
    /// It was not there before: taken away again if nothing comes of it.
    is_new: bool,
    force: bool,
}

impl<'a> Folder<'a> {
    /// Looks, before any work is done, whether it can be written to and whether anything would be replaced.
    fn prepare(path: &'a Path, force: bool) -> Result<Self, Failure> {
        let is_new = !path.exists();
        make_folder(path)?;
        let mut inside = fs::read_dir(path).map_err(|error| Failure::file("read", path, &error))?;
        if !force && inside.next().is_some() {
            return Err(Failure::usage(
                Diagnostic::error(format!("the folder {} is not empty", path.display()))
                    .help("name another one by -o, or replace what is in it with --force"),
            ));
        }
        let folder = Self {
            path,
            is_new,
            force,
        };
        // Found out now, and not after a minute of measuring.
        Output::create(&path.join("claims.json"), force)?.discard();
        Ok(folder)
    }

    /// Writes all files, the page last, and gives the page's name.
    fn fill(self, files: Vec<(String, Vec<u8>)>) -> Result<PathBuf, Failure> {
        let page = self.path.join(PAGE);
        // An old page would tell of new figures.
        if self.force
            && let Err(error) = fs::remove_file(&page)
            && error.kind() != std::io::ErrorKind::NotFound
        {
            return Err(Failure::io(Diagnostic::error(format!(
                "cannot replace {}: {}",
                page.display(),
                plain(&error)
            ))));
        }
        for (name, bytes) in files {
            let path = self.path.join(&name);
            if let Some(folder) = path.parent() {
                make_folder(folder)?;
            }
            Output::create(&path, self.force)?.write_all(&bytes)?;
        }
        Ok(page)
    }
}

impl Drop for Folder<'_> {
    fn drop(&mut self) {
        if self.is_new {
            // Only where it is empty; what cannot be removed stays.
            let _ = fs::remove_dir(self.path);
        }
    }
}
