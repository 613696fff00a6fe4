//! The paper again: its tables and figures measured, and each of its claims held against them.
//!
//! ```text
//! ReproduceStudy ─▶ Measured ─▶ judge ─▶ a verdict for each of CLAIMS
//!               └─▶ Material: what the figures are drawn from
//! ```
//!
//! Everything is measured on shipped scenarios ([`FILES`]). What the paper prints, and what has to hold, stands in
//! [`claims`] and nowhere else; no result does.

mod built_in;
pub mod claims;
mod measured;
mod table1;

pub use built_in::{BuiltIn, FILES};
pub use claims::{CLAIMS, Claim, Finding, Judged, Verdict, judge};
pub use measured::{Found, Measured, Ridden, Rides};
pub use table1::{Table1Row, table_1};

use bikebot_planner::{Budget, Method, Outcome, PlanError, PlannedPath, StopReason, plan};

use super::table2::Table2Study;
use super::{CompareError, CompareStudy, Comparison, Known};
use crate::outcome::RunOutcome;
use crate::plan_file::{PlanFile, PlanJson, Times};
use crate::record::Trace;
use crate::sweep::{self, Case, Row, SweepError};
use crate::{Override, RunControl, ScenarioError, ScenarioFile, Setup, SetupError};

/// The ride of Fig. 7 and 8.
pub const FIG7: &str = "scenarios/fig7.toml";
/// The same in balancer mode.
pub const FIG7_BALANCER: &str = "scenarios/fig7-balancer.toml";
/// The field of Table 2.
pub const FIG6: &str = "scenarios/planning/fig6.toml";
/// The same, Algorithm 1 to the letter.
pub const FIG6_AS_PRINTED: &str = "scenarios/planning/fig6-as-printed.toml";
/// What makes the planner of that scenario the one of Table 2, key and value.
pub const TABLE_1: [(&str, &str); 4] = [
    ("planner.tangent", "\"chord\""),
    ("planner.guides", "1"),
    ("planner.structured_seeds", "false"),
    ("planner.end_arcs", "false"),
];
/// A field the bike does not know.
pub const UNKNOWN: &str = "scenarios/unknown-yard.toml";
/// The bike at rest, leaning.
pub const LEANING: &str = "scenarios/balance-recover.toml";

/// Most rides on the unknown field: each takes as long as eight in the arena.
const MOST_UNKNOWN: u64 = 10;
/// Steps in which leans are tried, °.
const LEAN_STEP_DEG: f64 = 0.05;
/// Most of these steps: at 40° a bike counts as fallen.
const LEAN_STEPS: u32 = 800;
/// Rides it takes to find one of them, by halving.
const LEAN_RIDES: u64 = 10;
/// Spacing of the points of a path in a picture, m.
const PICTURE_STEP: f64 = 0.25;

/// What is drawn of Table 2 in Fig. 6.
const DRAWN: [Method; 6] = [
    Method::Laplace,
    Method::Birrt,
    Method::BirrtSmooth,
    Method::MpcLaplace,
    Method::Paper,
    Method::Full,
];

/// Why the study could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ReproduceError {
    /// A shipped scenario is not understood.
    #[error("{file}: {error}")]
    Scenario {
        /// Which.
        file: &'static str,
        /// What is wrong with it.
        error: Box<ScenarioError>,
    },
    /// A shipped scenario cannot be made sense of.
    #[error("{file}: {error}")]
    Setup {
        /// Which.
        file: &'static str,
        /// What is wrong with it.
        error: Box<SetupError>,
    },
    /// A shipped scenario has nothing to plan or to ride.
    #[error("{0} has nothing to plan")]
    NothingToPlan(&'static str),
    /// A problem that makes no sense.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Rides that could not be made.
    #[error(transparent)]
    Sweep(#[from] SweepError),
    /// A comparison that could not be made.
    #[error(transparent)]
    Compare(#[from] CompareError),
    /// A ride that could not be made.
    #[error(transparent)]
    Run(#[from] crate::Error),
    /// A ride that makes no sense.
    #[error("{file}, seed {seed}: {message}")]
    Ride {
        /// Of which scenario.
        file: &'static str,
        /// With which seed.
        seed: u64,
        /// Why.
        message: String,
    },
}

/// A path of Fig. 6.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawnPath {
    /// The method that made it.
    pub method: Method,
    /// m.
    pub length: f64,
    /// Points along it, m.
    pub points: Vec<[f64; 2]>,
}

/// What the figures are drawn from, all with the first seed.
#[derive(Debug)]
pub struct Material {
    /// The yard of Table 2.
    pub yard: Setup,
    /// The plan of Algorithm 1 on it, as a plan file: trees, guide, corridor, path. Its times are left out: no two runs share them.
    pub stages: String,
    /// Paths of several methods on it.
    pub paths: Vec<DrawnPath>,
    /// The arena of Fig. 7.
    pub arena: Setup,
    /// The ride through it.
    pub ride: Trace,
    /// The same ride on both plants; absent where the program was built without rigid bodies.
    pub plants: Option<Comparison>,
}

/// What is to be measured, and how.
#[derive(Clone, Copy)]
pub struct ReproduceStudy<'a> {
    /// Plans of every method that has chance in it; the paper averages ten.
    pub runs: u64,
    /// Rides of each kind.
    pub rides: u64,
    /// Seed of the first run.
    pub seed: u64,
    /// Threads for the rides. Plans whose time is taken are made one by one.
    pub jobs: usize,
    /// Seconds since whenever.
    pub clock: &'a (dyn Fn() -> f64 + Sync),
    /// Asked often; `true` ends it without a result.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// A shipped scenario, read.
struct Shipped {
    path: &'static str,
    file: ScenarioFile,
    setup: Setup,
}

impl Shipped {
    fn load(path: &'static str, changes: &[Override]) -> Result<Self, ReproduceError> {
        let scenario = |error| ReproduceError::Scenario {
            file: path,
            error: Box::new(error),
        };
        let text = built_in::text(path).map_err(|message| {
            scenario(ScenarioError::plain(message, "it comes with the program"))
        })?;
        let file = ScenarioFile::parse(text, changes).map_err(scenario)?;
        let setup =
            Setup::resolve(&file, &mut |name| built_in::named_in(path, name)).map_err(|error| {
                ReproduceError::Setup {
                    file: path,
                    error: Box::new(error),
                }
            })?;
        Ok(Self { path, file, setup })
    }
}

impl ReproduceStudy<'_> {
    /// How often [`ReproduceStudy::measure`] tells of a step.
    ///
    /// # Errors
    ///
    /// As [`ReproduceStudy::measure`].
    pub fn steps(&self) -> Result<u64, ReproduceError> {
        let yard = Shipped::load(FIG6, &[])?;
        let problem = yard.problem()?;
        let rides = self.rides.saturating_mul(2) + self.unknown_rides() + self.runs;
        let plants = if has_rigid_bodies() { 2 } else { 0 };
        Ok(self.table2(&yard.setup, &problem).plans()
            + rides
            + plants
            + 2 * LEAN_RIDES
            + DRAWN.len() as u64
            + 1)
    }

    /// Rides on the unknown field.
    fn unknown_rides(&self) -> u64 {
        self.rides.min(MOST_UNKNOWN)
    }

    /// Plans and rides; `None` when it was stopped. `on_step` is told what is being made, after each step of it.
    ///
    /// # Errors
    ///
    /// [`ReproduceError`]: a shipped file that does not fit the program.
    pub fn measure(
        &self,
        on_step: &mut dyn FnMut(&'static str),
    ) -> Result<Option<(Measured, Material)>, ReproduceError> {
        let Some(parts) = self.parts(on_step)? else {
            return Ok(None);
        };
        Ok((!(self.stop)()).then_some(parts))
    }

    fn parts(
        &self,
        on_step: &mut dyn FnMut(&'static str),
    ) -> Result<Option<(Measured, Material)>, ReproduceError> {
        let first = [Override::new("run.seed", self.seed)];
        let mut as_in_table_2 = first.to_vec();
        as_in_table_2.extend(TABLE_1.map(|(key, value)| Override::new(key, value)));
        let yard = Shipped::load(FIG6, &as_in_table_2)?;
        let problem = yard.problem()?;
        let table2 = self
            .table2(&yard.setup, &problem)
            .measure(&mut || on_step("Table 2"))?;
        if table2.interrupted {
            return Ok(None);
        }
        let Some(as_printed) = self.as_printed(on_step)? else {
            return Ok(None);
        };
        let stages = self.stages(&yard)?;
        let mut paths = Vec::new();
        for method in DRAWN {
            let Some(path) = self.drawn(&yard, method)? else {
                return Ok(None);
            };
            paths.extend(path);
            on_step("Fig. 6");
        }
        let flywheel = self.rides(FIG7, self.rides, &mut || on_step("Fig. 7, flywheel mode"))?;
        let balancer = self.rides(FIG7_BALANCER, self.rides, &mut || {
            on_step("Fig. 7, balancer mode");
        })?;
        let plants = self.plants(&first, &mut || on_step("other plant"))?;
        let rigid = plants.as_ref().and_then(|plants| {
            let column = plants.columns.get(1)?;
            let result = column.result.clone().ok()?;
            Some(ridden(self.seed, result))
        });
        let lean = |mode, on_step: &mut dyn FnMut(&'static str)| {
            self.largest_lean(mode, &mut || on_step("balance"))
        };
        let lean_flywheel_deg = lean("flywheel", on_step)?;
        let lean_balancer_deg = lean("balancer", on_step)?;
        let unknown = self.rides(UNKNOWN, self.unknown_rides(), &mut || {
            on_step("unknown field")
        })?;
        let arena = Shipped::load(FIG7, &first)?;
        let mut ride = Trace::default();
        crate::run(&arena.setup, &mut ride, self.control(&mut |_| {}))?;
        on_step("Fig. 7 and 8");
        let measured = Measured {
            runs: self.runs,
            rides: self.rides,
            seed: self.seed,
            table2,
            as_printed,
            flywheel,
            balancer,
            rigid,
            unknown,
            lean_flywheel_deg,
            lean_balancer_deg,
        };
        let material = Material {
            yard: yard.setup,
            stages,
            paths,
            arena: arena.setup,
            ride,
            plants,
        };
        Ok(Some((measured, material)))
    }

    fn table2<'s>(
        &'s self,
        setup: &'s Setup,
        problem: &'s bikebot_planner::PlanningProblem<'s>,
    ) -> Table2Study<'s> {
        Table2Study {
            problem,
            params: &setup.planner,
            runs: self.runs,
            seed: self.seed,
            // One at a time: their times are told.
            jobs: 1,
            clock: self.clock,
            stop: self.stop,
        }
    }

    fn control<'c>(&'c self, progress: &'c mut dyn FnMut(crate::Progress)) -> RunControl<'c> {
        RunControl {
            stop: self.stop,
            progress,
            clock: None,
        }
    }

    /// Algorithm 1 to the letter; `None` when stopped.
    fn as_printed(
        &self,
        on_step: &mut dyn FnMut(&'static str),
    ) -> Result<Option<Found>, ReproduceError> {
        let printed = Shipped::load(FIG6_AS_PRINTED, &[])?;
        let problem = printed.problem()?;
        let mut found = 0;
        for run in 0..self.runs {
            let seed = self.seed.saturating_add(run);
            let stop = || (self.stop)().then_some(StopReason::Cancelled);
            let report = plan(
                &problem,
                &printed.setup.planner,
                seed,
                &Budget::until(&stop),
            )?;
            if (self.stop)() {
                return Ok(None);
            }
            found += u64::from(report.outcome == Outcome::Found);
            on_step("Algorithm 1 to the letter");
        }
        Ok(Some(Found {
            runs: self.runs,
            found,
        }))
    }

    /// The plan whose stages Fig. 5 shows.
    fn stages(&self, yard: &Shipped) -> Result<String, ReproduceError> {
        let problem = yard.problem()?;
        let report = crate::plan(&yard.setup, self.stop)?;
        let json = PlanJson::new(&report, &problem, &Times::default());
        let file = PlanFile::new(&json, &report, &problem, &yard.setup.planner, None);
        let mut value = serde_json::to_value(&file).unwrap_or_default();
        if let Some(plan) = value.as_object_mut() {
            for key in ["time_s", "first_s", "prepare_s"] {
                plan.remove(key);
            }
        }
        Ok(value.to_string())
    }

    /// A path of Fig. 6: outer `None` when stopped, inner where the method found none.
    fn drawn(
        &self,
        yard: &Shipped,
        method: Method,
    ) -> Result<Option<Option<DrawnPath>>, ReproduceError> {
        let problem = yard.problem()?;
        let rows = self.table2(&yard.setup, &problem).rows();
        let Some(row) = rows.into_iter().find(|row| row.name == method.name()) else {
            return Ok(Some(None));
        };
        let stop = || (self.stop)().then_some(StopReason::Cancelled);
        let report = plan(&problem, &row.params, self.seed, &Budget::until(&stop))?;
        if (self.stop)() {
            return Ok(None);
        }
        let pair = |p: &bikebot_geometry::Point2| [p.x, p.y];
        Ok(Some(report.path.map(|path| DrawnPath {
            method,
            length: path.length(),
            points: match &path {
                PlannedPath::Polyline(line) => line.vertices().iter().map(pair).collect(),
                PlannedPath::Curves(_) => {
                    let samples = path.sample(PICTURE_STEP);
                    samples.iter().map(|it| pair(&it.position)).collect()
                }
            },
        })))
    }

    /// Rides of a scenario, one for each seed; fewer when stopped.
    fn rides(
        &self,
        path: &'static str,
        runs: u64,
        on_ride: &mut dyn FnMut(),
    ) -> Result<Rides, ReproduceError> {
        let seeds: Vec<u64> = (0..runs).map(|run| self.seed.saturating_add(run)).collect();
        let rows = self.sweep(path, &[], sweep::cases(&[], &seeds), on_ride)?;
        let rides = rows.into_iter().map(|row| match row.result {
            Ok(result) => Ok(ridden(row.case.seed, result)),
            Err(message) => Err(ReproduceError::Ride {
                file: path,
                seed: row.case.seed,
                message,
            }),
        });
        rides.collect::<Result<Vec<_>, _>>().map(Rides)
    }

    fn sweep(
        &self,
        path: &'static str,
        changes: &[Override],
        cases: Vec<Case>,
        on_ride: &mut dyn FnMut(),
    ) -> Result<Vec<Row>, ReproduceError> {
        let shipped = Shipped::load(path, changes)?;
        let mut rows = Vec::new();
        sweep::sweep(
            shipped.file.text(),
            changes,
            cases,
            &|name| built_in::named_in(path, name),
            self.jobs,
            self.stop,
            &mut |row| {
                rows.push(row);
                on_ride();
            },
        )?;
        Ok(rows)
    }

    /// The ride of Fig. 7 on both plants.
    fn plants(
        &self,
        changes: &[Override],
        on_ride: &mut dyn FnMut(),
    ) -> Result<Option<Comparison>, ReproduceError> {
        if !has_rigid_bodies() {
            return Ok(None);
        }
        let arena = Shipped::load(FIG7, changes)?;
        let study = CompareStudy {
            file: &arena.file,
            plants: &["bike3d".to_owned(), RIGID.to_owned()],
            controllers: &[],
            read: &|name| built_in::named_in(FIG7, name),
            jobs: self.jobs,
            stop: self.stop,
        };
        Ok(Some(study.measure(on_ride)?))
    }

    /// The largest lean that is caught, °, on the grid of [`LEAN_STEP_DEG`].
    fn largest_lean(&self, mode: &str, on_ride: &mut dyn FnMut()) -> Result<f64, ReproduceError> {
        let degrees = |step: u32| f64::from(step) * LEAN_STEP_DEG;
        // What is caught grows from nothing: bisection, always with as many rides.
        let (mut caught, mut lost) = (0, LEAN_STEPS + 1);
        for _ in 0..LEAN_RIDES {
            let step = caught + (lost - caught) / 2;
            if step > caught {
                let shipped = Shipped::load(
                    LEANING,
                    &[
                        Override::new("bike.mode", format!("\"{mode}\"")),
                        Override::new("start.roll_deg", degrees(step)),
                    ],
                )?;
                let report = crate::run(&shipped.setup, &mut (), self.control(&mut |_| {}))?;
                if report.outcome == RunOutcome::Arrived {
                    caught = step;
                } else {
                    lost = step;
                }
            }
            on_ride();
        }
        Ok(degrees(caught))
    }
}

impl Shipped {
    fn problem(&self) -> Result<bikebot_planner::PlanningProblem<'_>, ReproduceError> {
        self.setup
            .problem()
            .ok_or(ReproduceError::NothingToPlan(self.path))
    }
}

/// The plant that shares no equation with the models of the controllers.
const RIGID: &str = "rapier3d";

fn has_rigid_bodies() -> bool {
    Known::from_schema()
        .plants
        .iter()
        .any(|plant| plant == RIGID)
}

fn ridden(seed: u64, result: sweep::RowResult) -> Ridden {
    Ridden {
        seed,
        outcome: result.outcome,
        reason: result.reason,
        metrics: result.metrics,
        result_hash: result.result_hash,
    }
}

#[cfg(test)]
mod tests;
