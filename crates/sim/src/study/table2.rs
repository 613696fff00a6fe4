//! Table 2 of the paper: every method on one field, measured, beside the printed figures.
//!
//! Settings are those of Table 1 ([`PlannerParams::table_1`]) on the field, footprint, ends and curvature limit of the
//! problem at hand. Methods without chance are run once; their row says so. Length and roughness are over the runs that found
//! a path, time is over all.

use super::Spread;
use bikebot_planner::{
    Budget, GoalMode, Method, PlanError, PlannerParams, PlanningProblem, StopReason, plan,
};
use serde::Serialize;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

/// The scenario of our reconstruction of the paper's yard.
pub const PAPER_SCENARIO: &str = include_str!("../../../../scenarios/planning/fig6.toml");
/// The map it names, by the name it uses.
pub const PAPER_MAP: (&str, &[u8]) = (
    "../maps/fig6.json",
    include_bytes!("../../../../scenarios/maps/fig6.json"),
);

/// Corner length of the row "full_smooth", in scales: shorter than the paper's own row and smoother than its smoothest at once.
const SMOOTH_CORNER: f64 = 18.0;

/// Figures of one row as the paper prints them; what it does not print, or we could not read, is absent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PaperFigures {
    /// Computing time, s, in MATLAB on a computer of 2016.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
    /// Length, m.
    pub length_m: f64,
    /// Roughness, of a definition the paper does not print (choice D7).
    pub roughness: f64,
}

/// One row to be measured.
#[derive(Debug, Clone, PartialEq)]
pub struct RowPlan {
    /// Its name: that of the method, with an ending where a method has several rows.
    pub name: &'static str,
    /// What is set for it.
    pub params: PlannerParams,
    /// The paper's row.
    pub paper: Option<PaperFigures>,
}

/// One run of one row.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Time taken, s, by the caller's clock.
    pub time: f64,
    /// The figures of the path, if one was found.
    pub metrics: Option<bikebot_planner::PathMetrics>,
}

/// One row, measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The row's name.
    pub method: &'static str,
    /// Whether the path keeps to the curvature limit and to the heading of the start.
    pub curvature_limited: bool,
    /// Whether every run gives the same path: then one was made for all.
    pub deterministic: bool,
    /// Runs the row speaks for.
    pub runs: u64,
    /// How many of them found a path.
    pub found: u64,
    /// Time, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_s: Option<Spread>,
    /// Length, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length_m: Option<Spread>,
    /// Roughness, 1/m⁵: of curves exactly, of polylines on their own vertices.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness: Option<Spread>,
    /// Roughness, 1/m⁵, after resampling at 0.5 m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness_fixed_step: Option<Spread>,
    /// Largest curvature of any run, 1/m; absent for polylines, which turn on the spot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_curvature_per_m: Option<f64>,
    /// Largest jump of curvature of any run, 1/m; absent for polylines.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curvature_jump_per_m: Option<f64>,
    /// Distance from the path's end to the goal, m: up to the ball's radius where a path may end in the ball.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal_gap_m: Option<Spread>,
    /// The paper's row.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub paper: Option<PaperFigures>,
}

/// The whole table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table2 {
    /// Its rows, in the order of the paper, then ours.
    pub rows: Vec<Row>,
    /// Runs asked for, of each row with chance.
    pub runs: u64,
    /// Seed of the first run; the others follow on.
    pub seed: u64,
    /// Whether it was ended before all runs were made.
    pub interrupted: bool,
}

/// What is to be measured, and how.
#[derive(Clone, Copy)]
pub struct Table2Study<'a> {
    /// The field, the ends, the footprint, the curvature limit.
    pub problem: &'a PlanningProblem<'a>,
    /// Where the scale, the goal mode, the margin, the resolution and the settings of grid and MPC are taken from.
    pub params: &'a PlannerParams,
    /// Runs of each row with chance.
    pub runs: u64,
    /// Seed of the first run.
    pub seed: u64,
    /// Threads. More than one disturb each other's times, and nothing else.
    pub jobs: usize,
    /// Seconds since whenever.
    pub clock: &'a (dyn Fn() -> f64 + Sync),
    /// Asked often; `true` ends it with what there is.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

const fn figures(time_s: Option<f64>, length_m: f64, roughness: f64) -> Option<PaperFigures> {
    Some(PaperFigures {
        time_s,
        length_m,
        roughness,
    })
}

/// The paper's row for a method, Table 2.
#[must_use]
pub fn paper_figures(method: Method) -> Option<PaperFigures> {
    match method {
        // One row "LP", whichever of the two it means; and one of MPC along it.
        Method::Laplace | Method::LinearProgram => figures(Some(16.0), 198.1, 7.61e-4),
        Method::Rrt => figures(None, 270.2, 3.40e-2),
        Method::RrtStar => figures(None, 263.6, 1.02e-3),
        Method::Birrt => figures(None, 261.2, 1.45e-3),
        Method::BirrtSmooth => figures(None, 178.7, 3.70),
        Method::MpcLaplace | Method::MpcLinearProgram => figures(Some(2.70e3), 188.2, 6.08e-7),
        Method::Paper => figures(Some(1.41), 177.2, 5.61e-5),
        #[allow(
            unreachable_patterns,
            reason = "methods of ours have no row in the paper"
        )]
        _ => None,
    }
}

impl Table2Study<'_> {
    /// The rows, in order: those of the paper, the last of them also on a taut guide, then ours.
    #[must_use]
    pub fn rows(&self) -> Vec<RowPlan> {
        let given = self.params;
        let table_1 = PlannerParams {
            max_curvature: given.max_curvature,
            scale: given.scale,
            footprint: given.footprint.clone(),
            goal: given.goal,
            margin: given.margin,
            clearance_resolution_scales: given.clearance_resolution_scales,
            grid: given.grid.clone(),
            mpc: given.mpc.clone(),
            ..PlannerParams::table_1()
        };
        let mut rows = Vec::new();
        for method in Method::ALL {
            let mut row = RowPlan {
                name: method.name(),
                params: PlannerParams {
                    method,
                    ..table_1.clone()
                },
                paper: paper_figures(method),
            };
            if method == Method::Full {
                // To the goal itself, along both headings.
                row.params.goal = GoalMode::Pose;
                row.params.end_arcs = true;
            }
            let taut = (method == Method::Paper).then(|| RowPlan {
                name: "paper_taut",
                params: PlannerParams {
                    taut_guide: true,
                    ..row.params.clone()
                },
                paper: row.paper,
            });
            let smooth = (method == Method::Full).then(|| RowPlan {
                name: "full_smooth",
                params: PlannerParams {
                    corner_length_scales: SMOOTH_CORNER,
                    ..row.params.clone()
                },
                paper: row.paper,
            });
            rows.push(row);
            rows.extend(taut);
            rows.extend(smooth);
        }
        rows
    }

    /// How many plans [`Table2Study::measure`] makes.
    #[must_use]
    pub fn plans(&self) -> u64 {
        self.rows()
            .iter()
            .map(|row| self.plans_of(row))
            .fold(0, u64::saturating_add)
    }

    fn plans_of(&self, row: &RowPlan) -> u64 {
        if row.params.method.is_deterministic() {
            self.runs.min(1)
        } else {
            self.runs
        }
    }

    /// Makes all runs, telling `on_run` after each.
    ///
    /// # Errors
    ///
    /// [`PlanError`] for a problem that makes no sense.
    pub fn measure(&self, on_run: &mut dyn FnMut()) -> Result<Table2, PlanError> {
        let plans = self.rows();
        let mut tasks = Vec::new();
        for (row, plan) in plans.iter().enumerate() {
            for run in 0..self.plans_of(plan) {
                tasks.push((row, self.seed.saturating_add(run)));
            }
        }
        let next = AtomicUsize::new(0);
        let mut runs: Vec<Option<Run>> = vec![None; tasks.len()];
        let mut error = None;
        std::thread::scope(|scope| {
            let (send, receive) = mpsc::channel();
            for _ in 0..self.jobs.clamp(1, tasks.len().max(1)) {
                let (send, next, tasks, plans) = (send.clone(), &next, &tasks, &plans);
                scope.spawn(move || {
                    while !(self.stop)() {
                        let index = next.fetch_add(1, Ordering::Relaxed);
                        let Some(&(row, seed)) = tasks.get(index) else {
                            break;
                        };
                        let run = self.run(&plans[row].params, seed).transpose();
                        let Some(run) = run else { break };
                        // A closed channel: an error ended the study.
                        if send.send((index, run)).is_err() {
                            break;
                        }
                    }
                });
            }
            drop(send);
            for (index, run) in receive {
                match run {
                    Ok(run) => {
                        runs[index] = Some(run);
                        on_run();
                    }
                    Err(found) => {
                        error = Some(found);
                        break;
                    }
                }
            }
        });
        if let Some(error) = error {
            return Err(error);
        }
        let interrupted = runs.iter().any(Option::is_none);
        let rows = plans
            .iter()
            .enumerate()
            .map(|(index, plan)| {
                let own: Vec<Run> = tasks
                    .iter()
                    .zip(&runs)
                    .filter(|((row, _), _)| *row == index)
                    .filter_map(|(_, run)| run.clone())
                    .collect();
                self.row(plan, &own)
            })
            .collect();
        Ok(Table2 {
            rows,
            runs: self.runs,
            seed: self.seed,
            interrupted,
        })
    }

    /// One run; `None` if it was stopped.
    fn run(&self, params: &PlannerParams, seed: u64) -> Result<Option<Run>, PlanError> {
        let stop = || (self.stop)().then_some(StopReason::Cancelled);
        let began = (self.clock)();
        let report = plan(self.problem, params, seed, &Budget::until(&stop))?;
        let time = (self.clock)() - began;
        Ok(report.cut_short.is_none().then_some(Run {
            time,
            metrics: report.metrics,
        }))
    }

    fn row(&self, plan: &RowPlan, runs: &[Run]) -> Row {
        let method = plan.params.method;
        let deterministic = method.is_deterministic();
        let metrics: Vec<_> = runs.iter().filter_map(|run| run.metrics.as_ref()).collect();
        // One run of a method without chance speaks for all that were asked for.
        let each = if deterministic { self.runs } else { 1 };
        let most = |values: &mut dyn Iterator<Item = f64>| values.reduce(f64::max);
        Row {
            method: plan.name,
            curvature_limited: method.is_curvature_limited(),
            deterministic,
            runs: runs.len() as u64 * each,
            found: metrics.len() as u64 * each,
            time_s: Spread::of(runs.iter().map(|run| run.time)),
            length_m: Spread::of(metrics.iter().map(|m| m.length)),
            roughness: Spread::of(metrics.iter().map(|m| m.roughness)),
            roughness_fixed_step: Spread::of(metrics.iter().map(|m| m.roughness_fixed_step)),
            max_curvature_per_m: most(&mut metrics.iter().filter_map(|m| m.max_curvature)),
            curvature_jump_per_m: most(&mut metrics.iter().filter_map(|m| m.curvature_jump)),
            goal_gap_m: Spread::of(metrics.iter().map(|m| m.goal_gap)),
            paper: plan.paper,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::Point2;
    use bikebot_planner::{EndPose, GoalRegion};
    use bikebot_world::{Bounds, Footprint, Obstacle, World};
    use std::sync::atomic::AtomicU64;

    fn world() -> World {
        let block = Obstacle::Block {
            min: Point2::new(12.0, 0.0),
            max: Point2::new(15.0, 18.0),
        };
        World::new(Bounds::new(0.0, 0.0, 30.0, 30.0), vec![block]).unwrap()
    }

    fn problem(world: &World) -> PlanningProblem<'_> {
        PlanningProblem {
            world,
            footprint: Footprint::Point,
            start: EndPose::pose(4.0, 4.0, 1.0),
            goal: GoalRegion {
                position: Point2::new(26.0, 6.0),
                heading: None,
                tolerance: 3.0,
            },
            max_curvature: 1.0,
        }
    }

    fn measured(jobs: usize, runs: u64, most: usize) -> Table2 {
        let world = world();
        let (ticks, asked) = (AtomicU64::new(0), AtomicUsize::new(0));
        let study = Table2Study {
            problem: &problem(&world),
            params: &PlannerParams::table_1(),
            runs,
            seed: 5,
            jobs,
            clock: &|| ticks.fetch_add(1, Ordering::Relaxed) as f64,
            stop: &|| asked.fetch_add(1, Ordering::Relaxed) >= most,
        };
        let mut told = 0;
        let table = study.measure(&mut || told += 1).unwrap();
        if !table.interrupted {
            assert_eq!(told, study.plans());
        }
        table
    }

    /// Everything but the time, which is that of a clock.
    fn timeless(table: Table2) -> Vec<Row> {
        let strip = |row: Row| Row {
            time_s: None,
            ..row
        };
        table.rows.into_iter().map(strip).collect()
    }

    #[test]
    fn rows_come_in_the_papers_order_and_speak_for_all_runs() {
        let table = measured(1, 3, usize::MAX);
        let names: Vec<_> = table.rows.iter().map(|row| row.method).collect();
        assert_eq!(
            names,
            [
                "laplace",
                "linear_program",
                "rrt",
                "rrt_star",
                "birrt",
                "birrt_smooth",
                "mpc_laplace",
                "mpc_linear_program",
                "paper",
                "paper_taut",
                "full",
                "full_smooth"
            ]
        );
        for row in &table.rows {
            assert_eq!((row.runs, row.found), (3, 3), "{}", row.method);
            let length = row.length_m.unwrap();
            assert!(length.p05 <= length.median && length.median <= length.p95);
            let spreads = length.p95 > length.p05;
            // The best path of "full" is that of the shortest way, which needs no chance.
            let needs_chance = !row.deterministic && !row.method.starts_with("full");
            assert_eq!(spreads, needs_chance, "{}", row.method);
            assert_eq!(row.max_curvature_per_m.is_some(), row.curvature_limited);
        }
        assert!(table.rows[..10].iter().all(|row| row.paper.is_some()));
    }

    #[test]
    fn the_rows_are_the_same_on_any_number_of_threads() {
        let one = timeless(measured(1, 4, usize::MAX));
        assert_eq!(timeless(measured(3, 4, usize::MAX)), one);
    }

    #[test]
    fn an_interrupted_table_says_so_and_keeps_what_it_has() {
        let table = measured(1, 2, 0);
        assert!(table.interrupted);
        assert!(
            table
                .rows
                .iter()
                .all(|row| row.runs == 0 && row.length_m.is_none())
        );
    }

    #[test]
    fn a_start_in_a_wall_is_an_error() {
        let world = world();
        let study = Table2Study {
            problem: &PlanningProblem {
                start: EndPose::point(13.0, 4.0),
                ..problem(&world)
            },
            params: &PlannerParams::table_1(),
            runs: 2,
            seed: 1,
            jobs: 2,
            clock: &|| 0.0,
            stop: &|| false,
        };
        let error = study.measure(&mut || {}).unwrap_err();
        assert!(matches!(error, PlanError::StartInObstacle { .. }));
    }
}
