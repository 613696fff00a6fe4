//! The paper, measured again: a page of HTML and one of Markdown with a verdict for each claim, and the figures.
//!
//! ```text
//! sim::study::reproduce ─▶ Measured, Judged, Material ─▶ Reproduction ┬▶ figures ─▶ svg, png
//!                                                                     ├▶ html: one page, its figures in it
//!                                                                     └▶ markdown: beside its figures
//! ```
//!
//! What is measured, and what has to hold, is `sim`'s; here stand words and pictures. The pictures depend on scenario,
//! seed and version alone; of the pages only the times of Table 2 change from run to run.

mod html;
mod markdown;
#[cfg(test)]
mod tests;

use bikebot_planner::Method;
use bikebot_sim::Metrics;
use bikebot_sim::study::reproduce::{
    FIG6, FIG7, Judged, Material, Measured, TABLE_1, Table1Row, Verdict, table_1,
};
use bikebot_sim::study::table2::Row;

use crate::axis::significant;
use crate::drawing::Drawing;
use crate::error::ReportError;
use crate::histories_figure::HistoriesFigure;
use crate::paths_figure::{NamedPath, PathsFigure};
use crate::plan_figure::{PlanFigure, PlanStyle, PlanView};
use crate::plan_file::PlanFile;
use crate::ride_figure::{Ride, RideFigure};
use crate::scenery::Ground;

/// What has to be known before any row is read.
const TO_KNOW: [&str; 5] = [
    "The claims are in our words; the sentences of the paper are not repeated here.",
    "The paper shows its fields only as pictures. Ours are drawn after them and honour the sizes and poses of its text (D8): lengths compare \
     methods with each other, and beside the paper's they show the order, not the metre.",
    "The parameters of the laboratory's bike could not be read; ours are those of an e-bike with a balancer (D15). The balance output and the \
     gains of the follower are our own derivation (D9).",
    "As printed, Algorithm 1 finds no path. What is measured as `paper` has the slips of the listing put right (D1, D4, D5, D18).",
    "The numbers D1, D2, … are choices, and stand with their reasons in docs/paper.md.",
];

/// A study of the paper, with a verdict for each of its claims.
#[derive(Debug, Clone, Copy)]
pub struct Reproduction<'a> {
    /// The numbers.
    pub measured: &'a Measured,
    /// The claims, judged.
    pub judged: &'a [Judged],
    /// What the figures are drawn from.
    pub material: &'a Material,
    /// The command that makes all of it.
    pub again: &'a str,
    /// Version of the program.
    pub version: &'a str,
}

/// One figure with its words.
#[derive(Debug)]
pub struct Figure {
    /// Its name, for files: `fig5`.
    pub name: &'static str,
    /// What it is called.
    pub title: &'static str,
    /// What it shows.
    pub caption: String,
    /// The commands that draw it.
    pub commands: Vec<String>,
    /// The picture.
    pub drawing: Drawing,
}

impl Reproduction<'_> {
    /// How many claims came out so.
    #[must_use]
    pub fn count(&self, verdict: Verdict) -> usize {
        let so = |judged: &&Judged| judged.verdict == verdict;
        self.judged.iter().filter(so).count()
    }

    /// `24 of 26 claims hold, 2 differ for reasons we know, none fails.`
    #[must_use]
    pub fn sentence(&self) -> String {
        let count = |verdict| self.count(verdict);
        let mut parts = vec![format!(
            "{} of {} claims hold",
            count(Verdict::Holds),
            self.judged.len()
        )];
        match count(Verdict::Differs) {
            0 => {}
            1 => parts.push("1 differs for a reason we know".into()),
            n => parts.push(format!("{n} differ for reasons we know")),
        }
        match count(Verdict::NotMeasured) {
            0 => {}
            1 => parts.push("1 could not be measured".into()),
            n => parts.push(format!("{n} could not be measured")),
        }
        parts.push(match count(Verdict::Fails) {
            0 => "none fails".into(),
            1 => "1 fails".into(),
            n => format!("{n} fail"),
        });
        parts.join(", ")
    }

    /// Fig. 5 to 8.
    ///
    /// # Errors
    ///
    /// [`ReportError`] where there is nothing to draw: no plan of the yard, no ride.
    pub fn figures(&self) -> Result<Vec<Figure>, ReportError> {
        Ok(vec![
            self.stages()?,
            self.paths(),
            self.ride()?,
            self.histories()?,
        ])
    }

    /// The page, its figures in it.
    #[must_use]
    pub fn html(&self, figures: &[Figure]) -> String {
        html::page(self, figures)
    }

    /// The same in Markdown, with its figures beside it as SVG.
    #[must_use]
    pub fn markdown(&self, figures: &[Figure]) -> String {
        markdown::page(self, figures)
    }

    fn stages(&self) -> Result<Figure, ReportError> {
        let plan = PlanFile::parse(&self.material.stages)?;
        let obstacles = plan.obstacles().unwrap_or_default();
        let ground = Ground {
            bounds: plan.bounds(),
            obstacles: &obstacles,
            grid: None,
        };
        let figure = PlanFigure::new(&plan, ground, "yard", PlanStyle::default())?;
        Ok(Figure {
            name: "fig5",
            title: "Fig. 5: what Algorithm 1 makes on its way",
            caption: "BiRRT's trees and the coarse path they meet in, the guide that shortcuts make of it, the corridor about the guide with the \
                      tree of Ferguson-Coons curves in it, and the path. The field is a reconstruction."
                .into(),
            commands: vec![
                self.plan_command("paper", &[]),
                "bikebot plot yard.json --separate".into(),
            ],
            drawing: figure.draw(PlanView::Map),
        })
    }

    fn paths(&self) -> Figure {
        let seed = self.measured.seed;
        let paths: Vec<NamedPath> = self
            .material
            .paths
            .iter()
            .map(|path| NamedPath {
                name: format!("{}, {:.1} m", spoken(path.method), path.length),
                points: path.points.clone(),
            })
            .collect();
        let yard = &self.material.yard;
        let place = |heading_and_place: Option<(bikebot_geometry::Point2, Option<f64>)>| {
            heading_and_place.unwrap_or((bikebot_geometry::Point2::new(0.0, 0.0), None))
        };
        let start = yard.start_pose.map(|pose| (pose.position, pose.heading));
        let goal = yard.goal.as_ref().map(|goal| (goal.position, goal.heading));
        let no_obstacles = Ground {
            bounds: bikebot_world::Bounds::new(0.0, 0.0, 100.0, 100.0),
            obstacles: &[],
            grid: None,
        };
        let ground = yard.world.as_ref().map_or(no_obstacles, Ground::from);
        Figure {
            name: "fig6",
            title: "Fig. 6: the paths of the methods on one field",
            caption: format!(
                "One path of each method with seed {seed}; means over {} runs are in Table 2. RRT and RRT* are left out: they look like BiRRT. \
                 The field is a reconstruction.",
                self.measured.runs
            ),
            commands: vec![
                self.plan_command("mpc_laplace", &[]),
                self.plan_command("full", &["planner.goal=pose", "planner.end_arcs=true"]),
            ],
            drawing: PathsFigure::new(
                &paths,
                ground,
                [place(start), place(goal)],
                "yard · paths of the methods of Table 2",
                format!("footprint point  ·  curvature limit 1 /m  ·  seed {seed}"),
            )
            .draw(),
        }
    }

    /// The command that makes a path of Table 2.
    fn plan_command(&self, method: &str, more: &[&str]) -> String {
        let mut command = format!(
            "bikebot plan {FIG6} --method {method} --seed {}",
            self.measured.seed
        );
        for (key, value) in TABLE_1 {
            command += &format!(" --set {key}={}", value.replace('"', ""));
        }
        for change in more {
            command += &format!(" --set {change}");
        }
        command + " -o yard.json"
    }

    /// A line of facts about the ride of Fig. 7.
    fn ride_facts(&self) -> String {
        let seed = self.measured.seed;
        let rides = &self.measured.flywheel.0;
        let mut facts = Vec::new();
        if let Some(ride) = rides.iter().find(|ride| ride.seed == seed) {
            let metrics: &Metrics = &ride.metrics;
            facts.push(ride.outcome.to_string());
            for (value, before, after) in [
                (metrics.time_s, "", " s"),
                (metrics.distance_m, "", " m"),
                (metrics.lateral_error_max_m, "lateral error up to ", " m"),
                (metrics.roll_max_deg, "roll up to ", "°"),
                (metrics.min_clearance_m, "clearance ", " m"),
            ] {
                facts.extend(value.map(|it| format!("{before}{}{after}", significant(it, 3))));
            }
        }
        facts.push(format!("flywheel mode  ·  seed {seed}"));
        facts.join("  ·  ")
    }

    fn ride(&self) -> Result<Figure, ReportError> {
        let arena = &self.material.arena;
        let ride = Ride::new(&self.material.ride, &arena.footprint)?;
        let ground = arena.world.as_ref().map(Ground::from);
        Ok(Figure {
            name: "fig7",
            title: "Fig. 7: the desired path and the ride along it",
            caption: "From (1, 1, 0°) to (8, 8, 90°). The bike's outline every second, the stronger the more it leans. The arena is a \
                      reconstruction with one block moved, because a bike with a wheelbase of 1.12 m could not leave the original's start."
                .into(),
            commands: self.ride_commands(),
            drawing: RideFigure::new(&ride, ground, "arena · ride", self.ride_facts()).draw(),
        })
    }

    fn histories(&self) -> Result<Figure, ReportError> {
        let figure = HistoriesFigure::new(
            &self.material.ride,
            "arena · speed and curvature",
            self.ride_facts(),
        )?;
        Ok(Figure {
            name: "fig8",
            title: "Fig. 8: speed and curvature of that ride",
            caption: "Where the curve turns, the bike has slowed down before. Curvature is that of the rear contact's path; the dashed line is that of \
                      the plan where the rear contact is. It jumps at the plan's joints, which no steering can follow (D16): what is ridden is the plan \
                      with its steps rounded off."
                .into(),
            commands: self.ride_commands(),
            drawing: figure.draw(),
        })
    }

    fn ride_commands(&self) -> Vec<String> {
        vec![
            format!(
                "bikebot run {FIG7} --seed {} -o fig7.mcap",
                self.measured.seed
            ),
            "bikebot plot fig7.mcap".into(),
            "bikebot report fig7.mcap".into(),
        ]
    }
}

/// A method as people call it.
fn spoken(method: Method) -> &'static str {
    match method {
        Method::Laplace => "LP (Laplace potential)",
        Method::LinearProgram => "LP (linear programme)",
        Method::Rrt => "RRT",
        Method::RrtStar => "RRT*",
        Method::Birrt => "BiRRT",
        Method::BirrtSmooth => "BiRRT + Smooth",
        Method::MpcLaplace => "MPC + LP",
        Method::MpcLinearProgram => "MPC + LP (linear programme)",
        Method::Paper => "BiRRT + Smooth + RRT*, proposed",
        Method::Full => "default planner of bikebot",
        #[allow(unreachable_patterns, reason = "methods that the planner learns later")]
        _ => "another method",
    }
}

/// The verdict as a sign: it tells it without colour.
fn sign(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Holds => "✓",
        Verdict::Differs => "≠",
        Verdict::Fails => "✕",
        Verdict::NotMeasured => "–",
    }
}

/// Headings and rows of Table 1.
fn table1_cells() -> ([&'static str; 5], Vec<[String; 5]>) {
    let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |it| it.to_string());
    let cells = |row: Table1Row| {
        [
            row.symbol.to_owned(),
            row.meaning.to_owned(),
            row.ours.clone(),
            number(row.paper),
            row.remark.to_owned(),
        ]
    };
    (
        ["", "is", "ours", "paper", "remark"],
        table_1().into_iter().map(cells).collect(),
    )
}

/// What a row of Table 2 is, in words; its name otherwise.
fn row_words(row: &Row) -> String {
    let method = Method::ALL.into_iter().find(|it| it.name() == row.method);
    match (method, row.method) {
        (Some(method), _) => spoken(method).to_owned(),
        (None, "paper_taut") => "proposed, on a guide pulled tight".into(),
        (None, "full_smooth") => "default planner, longer corners".into(),
        (None, name) => name.to_owned(),
    }
}
