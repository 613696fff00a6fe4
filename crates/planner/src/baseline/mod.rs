//! The rows of Table 2 that the paper compares with and that are no random trees: two searches on a grid, and model
//! predictive control (MPC) along what they find.
//!
//! | method | stage | yields |
//! |---|---|---|
//! | `laplace` | [`laplace`]: a streamline of a harmonic potential (Sato 1993) | a polyline |
//! | `linear_program` | [`linear_program`]: a minimum-cost flow on the grid | a polyline |
//! | `mpc_laplace`, `mpc_linear_program` | the same, then [`mpc`]: receding-horizon tracking | curves |
//!
//! The paper names its row "LP" and does not say which of the two it means; both are here (choice D22). They ignore heading
//! and plan for the inscribed disc, like every stage before the last. All of them go to the goal itself, whatever
//! [`GoalMode`](crate::params::GoalMode) says: a grid has a goal cell and a horizon a goal point, not a ball. Nothing in them
//! is random.
//!
//! A grid is first laid with the cells the parameters ask for. Where it shows no way, or the one it shows touches something
//! between the centres, it is laid again with cells half as wide, as often as the limit on cells allows.

pub mod cell_grid;
mod clothoid;
mod curvature_spline;
mod envelope;
mod horizon;
pub mod laplace;
pub mod linear_program;
pub mod mpc;

use self::cell_grid::CellGrid;
use crate::budget::Meter;
use crate::connectivity;
use crate::motion::MotionChecker;
use crate::params::{GridParams, Method, PlannerParams};
use bikebot_geometry::{Point2, Polyline};

/// Cells along the longer side of the field in the flood that looks for a proof that there is no way when the first grid shows
/// none. Each further grid is followed by a flood with twice as many.
const PROOF_CELLS: usize = 256;

/// Which search on the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GridSearch {
    /// Up the gradient of a harmonic potential.
    Laplace,
    /// The flow of least cost.
    LinearProgram,
}

impl GridSearch {
    /// The search that a method begins with; `None` for one that uses no grid.
    #[must_use]
    pub fn of(method: Method) -> Option<Self> {
        match method {
            Method::Laplace | Method::MpcLaplace => Some(Self::Laplace),
            Method::LinearProgram | Method::MpcLinearProgram => Some(Self::LinearProgram),
            _ => None,
        }
    }
}

/// Why a search on the grid has no way to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoWay {
    /// It is proven that there is none.
    Disconnected,
    /// None was found with the finest cells allowed, or the budget ended first, which the meter tells.
    NotFound,
}

/// A free polyline from `start` to `goal` found on the grid, both ends included.
///
/// For any footprint but a point or a disc, give the [inscribed](MotionChecker::inscribed) checker.
///
/// # Errors
///
/// [`NoWay`], if it found none.
pub fn way(
    search: GridSearch,
    checker: &MotionChecker<'_>,
    [start, goal]: [Point2; 2],
    params: &PlannerParams,
    meter: &mut Meter<'_>,
) -> Result<Polyline, NoWay> {
    if checker.is_segment_free(start, goal) && (goal - start).norm() <= cell_side(checker, params) {
        return Polyline::new(vec![start, goal]).map_err(|_| NoWay::NotFound);
    }
    let mut proof_cells = PROOF_CELLS;
    for side in sides(checker, params) {
        let Some(grid) = CellGrid::lay(checker, side, meter) else {
            break;
        };
        let path = match search {
            GridSearch::Laplace => laplace::search(&grid, start, goal, meter),
            GridSearch::LinearProgram => linear_program::search(&grid, start, goal, meter),
        };
        let path = path.map(|path| trimmed(path, checker));
        let path = path.filter(|path| {
            path.windows(2)
                .all(|leg| checker.is_segment_free(leg[0], leg[1]))
        });
        if let Some(line) = path.and_then(|path| Polyline::new(path).ok()) {
            return Ok(line);
        }
        if meter.cut_short().is_some() {
            break;
        }
        if connectivity::are_separated(checker, start, goal, proof_cells, meter) {
            return Err(NoWay::Disconnected);
        }
        proof_cells *= 2;
    }
    Err(NoWay::NotFound)
}

/// The path without its first and last points but one where its ends can do without: an end somewhere in a cell need not
/// call at the centre.
fn trimmed(mut path: Vec<Point2>, checker: &MotionChecker<'_>) -> Vec<Point2> {
    if path.len() > 3 && checker.is_segment_free(path[0], path[2]) {
        path.remove(1);
    }
    let n = path.len();
    if n > 3 && checker.is_segment_free(path[n - 3], path[n - 1]) {
        path.remove(n - 2);
    }
    path
}

/// Side of the cells to begin with, m: the parameters', or as much more as keeps to the limit on cells.
fn cell_side(checker: &MotionChecker<'_>, params: &PlannerParams) -> f64 {
    let asked = params.grid.cell_scales * params.scale;
    let bounds = checker.world().bounds();
    // Covers ⌈w/a⌉ ⌈h/a⌉ ≤ (w/a + 1)(h/a + 1) cells: a quadratic in 1/a.
    let (w, h, most) = (
        bounds.width(),
        bounds.height(),
        f64::from(params.grid.max_cells) - 1.0,
    );
    let sum = w + h;
    let least = (sum + (sum * sum + 4.0 * most * w * h).sqrt()) / (2.0 * most);
    if least > asked { least } else { asked }
}

/// The sides to try, widest first, m.
fn sides(checker: &MotionChecker<'_>, params: &PlannerParams) -> impl Iterator<Item = f64> + use<> {
    let bounds = checker.world().bounds();
    let (w, h) = (bounds.width(), bounds.height());
    let most = f64::from(params.grid.max_cells);
    let first = cell_side(checker, params);
    std::iter::successors(Some(first), |side| Some(0.5 * side))
        .take(GridParams::MOST_HALVINGS + 1)
        .enumerate()
        .take_while(move |(i, side)| *i == 0 || (w / side).ceil() * (h / side).ceil() <= most)
        .map(|(_, side)| side)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::test_scenes::{block, load, room};
    use bikebot_world::{Footprint, World};

    fn found(
        search: GridSearch,
        world: &World,
        footprint: Footprint,
        ends: [Point2; 2],
    ) -> Result<Polyline, NoWay> {
        let checker = MotionChecker::new(world, &footprint, 0.0, 0.02);
        let meter = &mut Meter::new(&Budget::unlimited());
        let params = PlannerParams::table_1();
        let way = way(search, &checker, ends, &params, meter);
        if let Ok(line) = &way {
            let vertices = line.vertices();
            assert_eq!([vertices[0], vertices[vertices.len() - 1]], ends);
            for leg in vertices.windows(2) {
                assert!(checker.is_segment_free(leg[0], leg[1]), "{leg:?}");
            }
        }
        way
    }

    #[test]
    fn streamlines_touch_nothing_on_any_scene() {
        for name in ["fig6", "narrow", "maze"] {
            let scene = load(name);
            let ends = [scene.start.position, scene.goal.position];
            let line = found(GridSearch::Laplace, &scene.world, Footprint::Point, ends);
            assert!(line.is_ok(), "{name}: {line:?}");
        }
    }

    #[test]
    fn on_the_yard_both_have_the_lengths_of_the_design() {
        let scene = load("fig6");
        let ends = [scene.start.position, scene.goal.position];
        // The design note has 205.9 m and 189.0 m, and the potential's row stops a cell short of the goal.
        for (search, length) in [
            (GridSearch::Laplace, 205.9),
            (GridSearch::LinearProgram, 189.0),
        ] {
            let line = found(search, &scene.world, Footprint::Point, ends).unwrap();
            assert!(
                (line.length() - length).abs() < 1.0,
                "{search:?} {}",
                line.length()
            );
        }
    }

    #[test]
    fn a_gap_between_two_centres_is_found_with_finer_cells() {
        let world = room(
            20.0,
            vec![block(9.0, 0.0, 11.0, 9.8), block(9.0, 10.2, 11.0, 20.0)],
        );
        let ends = [Point2::new(3.0, 3.0), Point2::new(17.0, 17.0)];
        for search in [GridSearch::Laplace, GridSearch::LinearProgram] {
            let line = found(search, &world, Footprint::Point, ends);
            assert!(line.is_ok(), "{search:?}");
        }
    }

    #[test]
    fn what_cannot_be_reached_is_proved_so() {
        let world = room(20.0, vec![block(9.0, 0.0, 11.0, 20.0)]);
        let ends = [Point2::new(3.0, 3.0), Point2::new(17.0, 17.0)];
        for search in [GridSearch::Laplace, GridSearch::LinearProgram] {
            let line = found(search, &world, Footprint::Point, ends);
            assert_eq!(line, Err(NoWay::Disconnected));
        }
    }

    #[test]
    fn cells_are_never_more_than_allowed() {
        let world = World::new(
            bikebot_world::Bounds::new(0.0, 0.0, 5000.0, 70.0),
            Vec::new(),
        )
        .unwrap();
        let checker = MotionChecker::new(&world, &Footprint::Point, 0.0, 0.02);
        let mut params = PlannerParams::table_1();
        for max_cells in [4, 17, 1000, 40_000] {
            params.grid.max_cells = max_cells;
            for side in sides(&checker, &params) {
                let cells = (5000.0 / side).ceil() * (70.0 / side).ceil();
                assert!(cells <= f64::from(max_cells), "{max_cells}: {side} m");
            }
        }
    }
}
