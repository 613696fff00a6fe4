//! Proof that start and goal lie in different rooms, so that a search need not spin.
//!
//! The field is cut into square cells. A cell is blocked if nowhere in it the footprint has the margin and half the resolution
//! to spare: the clearance at which a motion may be refused. The cells that are not blocked cover all that can be ridden with
//! that much room, so if a flood over these (across sides and corners) from the start dries up before it meets the flood from
//! the goal, no path keeps it from one to the other. The proof is up to the resolution δ, not beyond: a gap whose
//! narrowest place has less than δ/2 to spare counts as closed, because one with nothing at all to spare, the seam of two walls that
//! touch, could not be told from it. The converse does not hold: floods that meet prove nothing. Finer cells see thinner walls.
//!
//! Both floods advance in turn, so the cost is that of the smaller room.
//!
//! Two proofs that the world keeps for all questions come before the floods, and are ready at once on a prepared map: pieces of
//! a grid's free cells that do not meet, which are asked for with the first sample, and the
//! [room](bikebot_world::World::are_apart) that the widest way leaves at its narrowest.

use crate::budget::Meter;
use crate::motion::MotionChecker;
use crate::params::GoalMode;
use crate::search::PointQuery;
use crate::shortest::shortest;
use bikebot_geometry::{Point2, Vector2};
use std::collections::VecDeque;

/// Cells along the longer side of the field in the coarsest flood.
const COARSEST: usize = 64;
/// Refinements: the finest flood has 64 · 2⁴ = 1024 cells along the longer side, a megabyte of marks.
const REFINEMENTS: u32 = 5;
/// Most cells along the longer side that anyone may ask for: 16 MiB of marks.
const FINEST: usize = 4096;
/// Samples in vain before the coarsest flood; each finer one, four times dearer, waits until twice as many.
const PATIENCE: u64 = 1024;
/// Cells that count as one iteration of the budget, so that a deadline holds here too.
const CELLS_PER_ITERATION: u32 = 64;
/// Iterations for the exact shortest way: among hundreds of obstacles it is found or ruled out.
const SHORTEST_ITERATIONS: u64 = 2000;
/// Questions about clearance that do, where cells take many of them: some 0.1 ms.
const QUERIES_PER_ITERATION: u32 = 512;

/// Times a cell may be cut into quarters: to a thousandth of its side.
const QUARTERINGS: usize = 10;
/// Most queries for one cell; a cell still undecided is taken as passable, so that nothing is proven by it.
const QUERIES_PER_CELL: u32 = 300;

/// Decides when a search that has not found anything should look for a proof that there is nothing to find.
#[derive(Debug, Default)]
pub(crate) struct Doubt {
    has_asked_map: bool,
    refinement: u32,
    /// Radius of the ball about the goal in which a path may end, m; 0 where it must reach the goal.
    ball: f64,
}

impl Doubt {
    /// Of a search for this query.
    pub(crate) fn of(query: &PointQuery<'_, '_>) -> Self {
        Self {
            ball: match query.goal_mode {
                GoalMode::Pose => 0.0,
                GoalMode::Ball => query.tolerance,
            },
            ..Self::default()
        }
    }

    /// To be called with the number of samples drawn in vain for `query`. `true` is a proof: there is no path.
    pub(crate) fn settles(
        &mut self,
        query: &PointQuery<'_, '_>,
        samples: u64,
        meter: &mut Meter<'_>,
    ) -> bool {
        self.proves_separation(samples, query.checker, query.start, query.goal, meter)
    }

    /// To be called with the number of samples drawn in vain. `true` is a proof: nothing connects the two.
    pub(crate) fn proves_separation(
        &mut self,
        samples: u64,
        checker: &MotionChecker<'_>,
        start: Point2,
        goal: Point2,
        meter: &mut Meter<'_>,
    ) -> bool {
        if self.ball > 0.0 {
            // That the ball's middle cannot be reached says nothing of the rest of it, which may lie on this side of a wall.
            let is_due = self.refinement == 0 && samples >= PATIENCE;
            self.refinement += u32::from(is_due);
            return is_due && has_no_shortest_way(checker, start, goal, self.ball, meter);
        }
        if !self.has_asked_map {
            self.has_asked_map = true;
            if are_in_separate_regions(checker, start, goal, meter) {
                return true;
            }
        }
        if self.refinement >= REFINEMENTS || samples < PATIENCE << self.refinement {
            return false;
        }
        if self.refinement == 0
            && (are_in_separate_rooms(checker, start, goal, meter)
                || has_no_shortest_way(checker, start, goal, 0.0, meter))
        {
            return true;
        }
        let cells = COARSEST << self.refinement;
        self.refinement += 1;
        are_separated(checker, start, goal, cells, meter)
    }
}

/// Whether start and goal lie in pieces of a grid's free cells that do not meet: ready at once on a prepared map.
pub(crate) fn are_in_separate_regions(
    checker: &MotionChecker<'_>,
    start: Point2,
    goal: Point2,
    meter: &mut Meter<'_>,
) -> bool {
    let world = checker.world();
    room_needed(checker) > 0.0
        && world.grid().is_some()
        && settled(meter, |stop| {
            world.are_in_separate_regions(start, goal, stop)
        })
}

/// Whether the widest way between start and goal is too narrow at its narrowest, which is ready at once on a prepared map: on another it
/// takes all cells of the clearance field.
pub(crate) fn are_in_separate_rooms(
    checker: &MotionChecker<'_>,
    start: Point2,
    goal: Point2,
    meter: &mut Meter<'_>,
) -> bool {
    let (world, need) = (checker.world(), room_needed(checker));
    [start, goal].iter().all(|p| world.clearance(*p) >= need)
        && settled(meter, |stop| world.are_apart(start, goal, need, stop))
}

/// Whether the search for the exact [shortest](crate::shortest) way runs dry, which walls of any thinness make it do.
pub(crate) fn has_no_shortest_way(
    checker: &MotionChecker<'_>,
    start: Point2,
    goal: Point2,
    ball: f64,
    meter: &mut Meter<'_>,
) -> bool {
    let radius = checker.inscribed_radius() + checker.margin();
    let world = checker.world();
    let shortest = meter.at_most(SHORTEST_ITERATIONS, |meter| {
        shortest(world, radius, start, goal, ball, None, meter)
    });
    shortest.length == f64::INFINITY
}

/// Asks for a proof whose preparation may take long, as two iterations: what was stopped within must not be taken, when it is
/// repeated with the iterations it had, for more than it was.
fn settled(meter: &mut Meter<'_>, proof: impl FnOnce(&dyn Fn() -> bool) -> bool) -> bool {
    if !meter.step_dearly() {
        return false;
    }
    let is_proved = proof(&|| meter.is_stopped());
    meter.step_dearly() && is_proved
}

#[derive(Clone, Copy, PartialEq)]
enum Mark {
    Unseen,
    Blocked,
    Reached(u8),
}

/// Whether a flood over cells, `cells` of them along the longer side of the field, proves that the inscribed disc of the
/// checker's footprint cannot get from `start` to `goal` with its margin and half the resolution to spare.
///
/// `false` proves nothing: the floods met, or the budget ran out. `cells` is at most 4096.
#[must_use]
pub fn are_separated(
    checker: &MotionChecker<'_>,
    start: Point2,
    goal: Point2,
    cells: usize,
    meter: &mut Meter<'_>,
) -> bool {
    let world = checker.world();
    let bounds = world.bounds();
    let extent = bounds.max - bounds.min;
    let cell = extent.x.max(extent.y) / cells.clamp(1, FINEST) as f64;
    if !(cell > 0.0 && cell.is_finite()) {
        return false;
    }
    let columns = ((extent.x / cell).ceil() as usize).max(1);
    let rows = ((extent.y / cell).ceil() as usize).max(1);
    let locate = |p: Point2| {
        let along = |x: f64, n: usize| ((x / cell).floor().max(0.0) as usize).min(n - 1);
        (
            along(p.x - bounds.min.x, columns),
            along(p.y - bounds.min.y, rows),
        )
    };
    let may_pass = |column: usize, row: usize, queries: &mut u32| {
        let centre = Point2::new(
            bounds.min.x + (column as f64 + 0.5) * cell,
            bounds.min.y + (row as f64 + 0.5) * cell,
        );
        has_room(checker, centre, 0.5 * cell, queries)
    };

    let mut marks = vec![Mark::Unseen; columns * rows];
    let mut fronts = [VecDeque::new(), VecDeque::new()];
    for (side, end) in [(0u8, start), (1, goal)] {
        let (column, row) = locate(end);
        let mark = &mut marks[row * columns + column];
        if *mark != Mark::Unseen {
            return false;
        }
        *mark = Mark::Reached(side);
        fronts[usize::from(side)].push_back((column, row));
    }
    let (mut visited, mut queries) = (0u32, 0u32);
    loop {
        for (side, front) in (0u8..).zip(&mut fronts) {
            let is_due =
                visited.is_multiple_of(CELLS_PER_ITERATION) || queries >= QUERIES_PER_ITERATION;
            if is_due && !meter.step_dearly() {
                return false;
            }
            if is_due {
                queries = 0;
            }
            visited += 1;
            let Some((column, row)) = front.pop_front() else {
                return true;
            };
            for near_row in row.saturating_sub(1)..(row + 2).min(rows) {
                for near_column in column.saturating_sub(1)..(column + 2).min(columns) {
                    let mark = &mut marks[near_row * columns + near_column];
                    match *mark {
                        Mark::Reached(by) if by != side => return false,
                        Mark::Reached(_) | Mark::Blocked => {}
                        Mark::Unseen if may_pass(near_column, near_row, &mut queries) => {
                            *mark = Mark::Reached(side);
                            front.push_back((near_column, near_row));
                        }
                        Mark::Unseen => *mark = Mark::Blocked,
                    }
                }
            }
        }
    }
}

/// The clearance (m) at which a motion of the inscribed disc is accepted.
fn room_needed(checker: &MotionChecker<'_>) -> f64 {
    checker.inscribed_radius() + checker.margin() + 0.5 * checker.resolution()
}

/// Whether the square about `centre` with the given half side (m) may hold a position whose clearance suffices.
///
/// Clearance changes by no more than the way travelled, so one query settles a square that is deep in an obstacle.
/// Quarters are looked into where it does not: where two obstacles touch, or one touches the edge of the field, the depth on
/// the seam is zero, and only squares of the size of the resolution see it closed.
fn has_room(checker: &MotionChecker<'_>, centre: Point2, half: f64, queries: &mut u32) -> bool {
    let world = checker.world();
    let need = room_needed(checker);
    let mut open = [(centre, half); 3 * QUARTERINGS + 4];
    let mut height = 1;
    let enough = queries.saturating_add(QUERIES_PER_CELL);
    while height > 0 {
        height -= 1;
        let (centre, half) = open[height];
        *queries += 1;
        if *queries > enough || world.clearance_lower_bound(centre) >= need {
            return true;
        }
        let clearance = world.clearance(centre);
        if clearance >= need {
            return true;
        }
        // The hair more covers the rounding of the centres.
        if clearance + half * std::f64::consts::SQRT_2 * (1.0 + 1e-9) < need {
            continue;
        }
        if height + 4 > open.len() {
            return true;
        }
        let quarter = 0.5 * half;
        for (dx, dy) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
            open[height] = (centre + Vector2::new(dx, dy) * quarter, quarter);
            height += 1;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::test_scenes::{block, load, room};
    use bikebot_geometry::Pose2;
    use bikebot_world::{Cell, Footprint, OccupancyGrid, World};

    fn separated(
        world: &World,
        footprint: Footprint,
        from: Point2,
        to: Point2,
        cells: usize,
    ) -> bool {
        let checker = MotionChecker::new(world, &footprint, 0.0, 0.02);
        are_separated(
            &checker,
            from,
            to,
            cells,
            &mut Meter::new(&Budget::unlimited()),
        )
    }

    /// Two halves, joined by a gap in the wall between them.
    fn halves(wall: f64, gap: f64) -> World {
        room(
            10.0,
            vec![
                block(5.0, 0.0, 5.0 + wall, 5.0 - gap / 2.0),
                block(5.0, 5.0 + gap / 2.0, 5.0 + wall, 10.0),
            ],
        )
    }

    const LEFT: Point2 = Point2::new(2.0, 2.0);
    const RIGHT: Point2 = Point2::new(8.0, 8.0);

    #[test]
    fn a_closed_wall_separates_and_the_finer_the_cells_the_thinner_it_may_be() {
        for (wall, cells) in [(0.5, 64), (0.06, 512)] {
            assert!(separated(
                &halves(wall, 0.0),
                Footprint::Point,
                LEFT,
                RIGHT,
                cells
            ));
        }
    }

    #[test]
    fn a_gap_is_closed_only_to_a_wider_footprint() {
        let world = halves(0.5, 0.5);
        let disc = |radius| Footprint::Disc { radius };
        assert!(!separated(&world, Footprint::Point, LEFT, RIGHT, 256));
        assert!(!separated(&world, disc(0.24), LEFT, RIGHT, 256));
        assert!(separated(&world, disc(0.29), LEFT, RIGHT, 256));
        assert!(separated(&world, Footprint::bike(), LEFT, RIGHT, 256));
    }

    /// However coarse the cells, a passage wider than the resolution is never taken for a wall.
    #[test]
    fn connected_places_are_never_called_separate() {
        let scenes = [
            "fig6",
            "fig7",
            "fig7-ride",
            "narrow",
            "maze",
            "clutter200",
            "clutter2000",
        ];
        for scene in scenes.map(load) {
            for cells in [1, 7, 64, 128] {
                let (start, goal) = (scene.start.position, scene.goal.position);
                assert!(!separated(
                    &scene.world,
                    Footprint::Point,
                    start,
                    goal,
                    cells
                ));
            }
        }
        for gap in [0.03, 0.1] {
            assert!(!separated(
                &halves(0.5, gap),
                Footprint::Point,
                LEFT,
                RIGHT,
                200
            ));
        }
    }

    #[test]
    fn a_room_of_touching_walls_is_closed_even_to_a_point() {
        let walls = vec![
            block(6.0, 6.0, 9.5, 6.2),
            block(6.0, 9.3, 9.5, 9.5),
            block(6.0, 6.2, 6.2, 9.3),
            block(9.3, 6.2, 9.5, 9.3),
        ];
        assert!(separated(
            &room(10.0, walls),
            Footprint::Point,
            LEFT,
            RIGHT,
            256
        ));
    }

    /// A map of 1 m cells, walled off by one row of them around the goal.
    fn walled_map(cells: usize) -> World {
        let (low, high) = (cells / 2, cells / 2 + 40);
        let on_ring = |v: usize| v == low || v == high;
        let within = |v: usize| (low..=high).contains(&v);
        let solid = |i: usize| {
            let (x, y) = (i % cells, i / cells);
            (on_ring(x) && within(y)) || (on_ring(y) && within(x))
        };
        let cell = |i| if solid(i) { Cell::Occupied } else { Cell::Free };
        let list = (0..cells * cells).map(cell).collect();
        let origin = Pose2::new(0.0, 0.0, 0.0);
        World::from_grid(OccupancyGrid::new(cells, cells, 1.0, origin, list).unwrap()).unwrap()
    }

    #[test]
    fn a_goal_walled_off_on_a_map_is_known_with_the_first_sample() {
        let world = walled_map(400);
        let (start, goal) = (Point2::new(9.5, 9.5), Point2::new(220.5, 220.5));
        let checker = MotionChecker::new(&world, &Footprint::Point, 0.0, 0.02);
        let unlimited = Budget::unlimited();
        let mut meter = Meter::new(&unlimited);
        let proves = |from, to, meter: &mut Meter<'_>| {
            Doubt::default().proves_separation(1, &checker, from, to, meter)
        };
        assert!(proves(start, goal, &mut meter));
        assert_eq!(meter.iterations(), 2);
        assert!(!proves(start, Point2::new(390.5, 9.5), &mut meter));
        // One iteration is not enough, whether the map is prepared or not.
        for world in [&world, &walled_map(400)] {
            let checker = MotionChecker::new(world, &Footprint::Point, 0.0, 0.02);
            let mut meter = Meter::new(&Budget::of_iterations(1));
            let mut doubt = Doubt::default();
            assert!(!doubt.proves_separation(1, &checker, start, goal, &mut meter));
        }
    }

    #[test]
    fn a_gap_too_narrow_for_the_disc_is_known_without_a_flood() {
        let world = halves(0.5, 0.5);
        let proves = |radius: f64| {
            let checker = MotionChecker::new(&world, &Footprint::Disc { radius }, 0.0, 0.02);
            let mut meter = Meter::new(&Budget::of_iterations(2));
            Doubt::default().proves_separation(PATIENCE, &checker, LEFT, RIGHT, &mut meter)
        };
        assert!(!proves(0.2));
        assert!(proves(0.5));
    }

    #[test]
    fn the_flood_counts_against_the_budget() {
        let world = room(10.0, vec![block(5.0, 0.0, 5.5, 10.0)]);
        let checker = MotionChecker::new(&world, &Footprint::Point, 0.0, 0.02);
        let mut meter = Meter::new(&Budget::of_iterations(3));
        assert!(!are_separated(&checker, LEFT, RIGHT, 1024, &mut meter));
        assert_eq!(meter.iterations(), 3);
    }
}
