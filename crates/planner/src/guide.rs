//! The grid guide: A* over the centres of the clearance grid, the first guide of the full method.
//!
//! The clearance grid is there already, so this costs a fraction of a sampling search and finds the right side of most
//! obstacles, which a tree finds by luck. It is not complete: a gap that holds no cell centre is not seen. `None` is
//! therefore no proof of anything, and BiRRT remains the method that finds what there is.
//!
//! Arcs lead to 16 neighbours (king's and knight's moves), whose lengths exceed the straight distance by 2.8 % at most. The
//! discs about two centres that their clearances prove free cover the arc between them when together they are as long; only
//! other arcs are asked for. Ties are broken by the index of the cell, so a guide depends on the world alone.

use crate::budget::Meter;
use crate::motion::MotionChecker;
use bikebot_geometry::{Point2, Vector2};
use bikebot_world::World;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::SQRT_2;

/// Steps to the 16 neighbours, in cells.
const MOVES: [(i32, i32); 16] = [
    (1, 0),
    (0, 1),
    (-1, 0),
    (0, -1),
    (1, 1),
    (-1, 1),
    (-1, -1),
    (1, -1),
    (2, 1),
    (1, 2),
    (-1, 2),
    (-2, 1),
    (-2, -1),
    (-1, -2),
    (1, -2),
    (2, -1),
];
/// Not reached yet. Zero, so that fresh memory need not be written.
const UNSEEN: u8 = 0;
/// Reached by `MOVES[arrival - 1]`, or by this: from the start itself.
const FROM_START: u8 = 17;
/// Added to the arrival of a cell that is settled.
const SETTLED: u8 = 0x80;
/// The ends are joined to the cells this far around their own, so that an end in a corner finds a centre to go to.
const ENDS_REACH: i32 = 2;
/// Length of a knight's move.
const SQRT_5: f64 = 2.236_067_977_499_79;
/// Most cells of a grid to search: far above what any world makes, and 150 MB of marks.
const MOST_CELLS: usize = 1 << 24;
/// Cells that count as one iteration of the budget: where none has been filled and all arcs are asked for, some 0.1 ms.
const CELLS_PER_ITERATION: u32 = 8;
/// Cells after which the stop condition is asked: on a map not looked at before, each may have its part of the clearance field computed.
const CELLS_PER_QUESTION: u32 = 32;

/// A way from `start` to `goal` over cell centres, every leg of which is free for the checker; the vertices, both ends
/// included.
///
/// Of the cells of the clearance grid every `pitch`-th along x and y is used: 1 for all of them. A coarser search takes a fraction of
/// the time, and sees fewer of the narrow ways.
///
/// For any footprint but a point or a disc, give the [inscribed](MotionChecker::inscribed) checker. `None` if no way was
/// found, which proves nothing, or the budget ended first, which the meter tells.
#[must_use]
pub fn search(
    checker: &MotionChecker<'_>,
    start: Point2,
    goal: Point2,
    pitch: usize,
    meter: &mut Meter<'_>,
) -> Option<Vec<Point2>> {
    if start == goal {
        return Some(vec![start]);
    }
    let grid = Grid::new(checker, pitch)?;
    let start_cell = grid.cell_of(start)?;
    let goal_cell = grid.cell_of(goal)?;
    if !meter.step() {
        return None;
    }
    if checker.is_segment_free(start, goal) {
        return Some(vec![start, goal]);
    }

    let mut arrivals = vec![UNSEEN; grid.cells() + 1];
    let mut lengths = vec![0.0; grid.cells() + 1];
    // The goal is one more node, past the last cell. Its arrival is not a move, but the cell it was reached from.
    let goal_node = grid.cells() as u32;
    let mut before_goal = None;
    let mut open = BinaryHeap::new();

    for (column, row) in grid.around(start_cell) {
        let node = grid.index(column, row);
        let (centre, room) = grid.centre(column, row);
        if room > 0.0 && checker.is_segment_free(start, centre) {
            let length = (centre - start).norm();
            arrivals[node as usize] = FROM_START;
            lengths[node as usize] = length;
            open.push(Open {
                estimate: length + least_way(goal - centre),
                length,
                node,
            });
        }
    }

    let steps = MOVES.map(|(x, y)| grid.cell_size * f64::from(x * x + y * y).sqrt());
    let mut expanded = 0u32;
    while let Some(Open { length, node, .. }) = open.pop() {
        if node == goal_node {
            let way = grid.way(start, goal, before_goal?, &arrivals);
            return way
                .windows(2)
                .all(|leg| checker.is_segment_free(leg[0], leg[1]))
                .then_some(way);
        }
        let arrival = &mut arrivals[node as usize];
        if *arrival & SETTLED != 0 {
            continue;
        }
        *arrival |= SETTLED;
        let goes_on = if expanded.is_multiple_of(CELLS_PER_QUESTION) {
            meter.step_dearly()
        } else {
            !expanded.is_multiple_of(CELLS_PER_ITERATION) || meter.step()
        };
        if !goes_on {
            return None;
        }
        expanded += 1;

        let (column, row) = grid.place(node);
        let (centre, room) = grid.centre(column, row);
        if column.abs_diff(goal_cell.0).max(row.abs_diff(goal_cell.1)) <= ENDS_REACH as usize {
            let total = length + (goal - centre).norm();
            if (before_goal.is_none() || total < lengths[goal_node as usize])
                && checker.is_segment_free(centre, goal)
            {
                lengths[goal_node as usize] = total;
                before_goal = Some(node);
                open.push(Open {
                    estimate: total,
                    length: total,
                    node: goal_node,
                });
            }
        }
        for (number, (&(dx, dy), &step)) in MOVES.iter().zip(&steps).enumerate() {
            let Some((column, row)) = grid.moved((column, row), dx, dy) else {
                continue;
            };
            let next = grid.index(column, row);
            let arrival = arrivals[next as usize];
            let total = length + step;
            if arrival & SETTLED != 0 || (arrival != UNSEEN && total >= lengths[next as usize]) {
                continue;
            }
            let (next_centre, next_room) = grid.centre(column, row);
            if next_room <= 0.0
                || (room + next_room <= step && !checker.is_segment_free(centre, next_centre))
            {
                continue;
            }
            arrivals[next as usize] = number as u8 + 1;
            lengths[next as usize] = total;
            open.push(Open {
                estimate: total + least_way(goal - next_centre),
                length: total,
                node: next,
            });
        }
    }
    None
}

/// Length of the shortest way of moves by `by`, were nothing in the way and the moves short: a sum of the two moves between whose
/// directions it lies. The straight distance is up to 2.8 % less, and would have the search look at all that could be reached with such a detour.
fn least_way(by: Vector2) -> f64 {
    let (long, short) = (by.x.abs().max(by.y.abs()), by.x.abs().min(by.y.abs()));
    if 2.0 * short <= long {
        // of (1, 0) and (2, 1)
        long + (SQRT_5 - 2.0) * short
    } else {
        // of (2, 1) and (1, 1)
        (SQRT_5 - SQRT_2) * long + (2.0 * SQRT_2 - SQRT_5) * short
    }
}

/// The clearance grid as a graph.
struct Grid<'w> {
    world: &'w World,
    /// Every so many cells of the field, along x and y, one is a cell here.
    pitch: usize,
    columns: usize,
    rows: usize,
    /// Distance between neighbouring centres, m.
    cell_size: f64,
    /// Clearance that every place of an accepted motion is to have, m.
    need: f64,
}

impl<'w> Grid<'w> {
    /// `None` for a grid that is too large to be searched, or makes no sense.
    fn new(checker: &MotionChecker<'w>, pitch: usize) -> Option<Self> {
        let pitch = pitch.max(1);
        let world = checker.world();
        let (columns, rows) = world.clearance_cells();
        let (columns, rows) = (columns.div_ceil(pitch), rows.div_ceil(pitch));
        let cell_size = world.clearance_cell_size() * pitch as f64;
        let need = checker.inscribed_radius() + checker.margin() + 0.5 * checker.resolution();
        let cells = columns.checked_mul(rows)?;
        let is_usable = cells <= MOST_CELLS && cell_size.is_finite() && need.is_finite();
        is_usable.then_some(Self {
            world,
            pitch,
            columns,
            rows,
            cell_size,
            need,
        })
    }

    fn cell_of(&self, p: Point2) -> Option<(usize, usize)> {
        let (column, row) = self.world.clearance_cell(p)?;
        Some((column / self.pitch, row / self.pitch))
    }

    fn cells(&self) -> usize {
        self.columns * self.rows
    }

    fn index(&self, column: usize, row: usize) -> u32 {
        (row * self.columns + column) as u32
    }

    fn place(&self, node: u32) -> (usize, usize) {
        (node as usize % self.columns, node as usize / self.columns)
    }

    /// Centre of a cell, and the radius of the disc about it in which every position is accepted, m.
    fn centre(&self, column: usize, row: usize) -> (Point2, f64) {
        let (all_columns, all_rows) = self.world.clearance_cells();
        let at = |i: usize, n: usize| (i * self.pitch + self.pitch / 2).min(n - 1);
        let (centre, clearance) = self
            .world
            .clearance_cell_centre(at(column, all_columns), at(row, all_rows));
        (centre, clearance - self.need)
    }

    fn moved(&self, (column, row): (usize, usize), dx: i32, dy: i32) -> Option<(usize, usize)> {
        let column = column.checked_add_signed(dx as isize)?;
        let row = row.checked_add_signed(dy as isize)?;
        (column < self.columns && row < self.rows).then_some((column, row))
    }

    /// A cell and those about it.
    fn around(&self, cell: (usize, usize)) -> impl Iterator<Item = (usize, usize)> + '_ {
        (-ENDS_REACH..=ENDS_REACH).flat_map(move |dy| {
            (-ENDS_REACH..=ENDS_REACH).filter_map(move |dx| self.moved(cell, dx, dy))
        })
    }

    fn way(&self, start: Point2, goal: Point2, last: u32, arrivals: &[u8]) -> Vec<Point2> {
        let mut way = vec![goal];
        let mut place = self.place(last);
        loop {
            way.push(self.centre(place.0, place.1).0);
            let arrival = arrivals[self.index(place.0, place.1) as usize] & !SETTLED;
            let Some(&(dx, dy)) = MOVES.get(usize::from(arrival).wrapping_sub(1)) else {
                break;
            };
            let Some(previous) = self.moved(place, -dx, -dy) else {
                break;
            };
            place = previous;
        }
        way.push(start);
        way.reverse();
        way.dedup_by(|a, b| (*a - *b) == Vector2::zeros());
        way
    }
}

/// A node to be settled: the one of the least estimate first, then the farthest from the start, then the first cell.
struct Open {
    estimate: f64,
    length: f64,
    node: u32,
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        // The greatest leaves the heap first.
        other
            .estimate
            .total_cmp(&self.estimate)
            .then(self.length.total_cmp(&other.length))
            .then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::{Budget, CutShort, StopReason};
    use crate::taut::{self, Rivals};
    use crate::test_scenes::{block, load, room};
    use crate::visibility;
    use bikebot_geometry::Pose2;
    use bikebot_world::{Cell, Footprint, OccupancyGrid};
    use std::sync::atomic::{AtomicU64, Ordering as Memory};

    fn unlimited<'a>() -> Meter<'a> {
        Meter::new(&Budget::unlimited())
    }

    fn length(path: &[Point2]) -> f64 {
        path.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum()
    }

    #[test]
    fn pulled_tight_it_is_within_a_hundredth_of_the_shortest_path() {
        for (name, _) in visibility::KNOWN {
            let scene = load(name);
            let exact = visibility::shortest_length_of(&scene);
            let resolution = if name == "fig7" { 0.008 } else { 0.02 };
            let checker = MotionChecker::new(&scene.world, &Footprint::Point, 0.0, resolution);
            let (start, goal) = (scene.start.position, scene.goal.position);
            let way = search(&checker, start, goal, 1, &mut unlimited())
                .unwrap_or_else(|| panic!("{name}"));
            assert_eq!((way[0], way[way.len() - 1]), (start, goal));
            // Sixteen directions: 2.8 % longer. And it turns up to a cell outside of the corners, of which the maze has many.
            assert!(length(&way) < 1.1 * exact, "{name}: {}", length(&way));
            let pulled = taut::pull(&way, &Rivals::none(), &checker, &mut unlimited());
            let ratio = pulled.length / exact;
            // The path keeps half a resolution off the corners: never shorter than exact.
            assert!((1.0..1.01).contains(&ratio), "{name}: {ratio}");
        }
    }

    #[test]
    fn every_leg_is_free_for_the_footprint() {
        let scene = load("maze");
        for radius in [0.0, 0.3, 1.0] {
            let disc = Footprint::Disc { radius };
            let checker = MotionChecker::new(&scene.world, &disc, 0.05, 0.02);
            let (start, goal) = (scene.start.position, scene.goal.position);
            let way = search(&checker, start, goal, 1, &mut unlimited()).expect("the maze is wide");
            for leg in way.windows(2) {
                assert!(checker.is_segment_free(leg[0], leg[1]));
            }
            assert!(
                checker.least_clearance_of_polyline(&way, crate::motion::Tolerance::of(1e-3))
                    >= 0.05 - 1e-3
            );
        }
    }

    #[test]
    fn a_straight_line_is_taken_and_no_way_is_no_guide() {
        let (from, to) = (Point2::new(2.0, 2.0), Point2::new(8.0, 8.0));
        let find = |world: &World, footprint, from, to| {
            let checker = MotionChecker::new(world, &footprint, 0.0, 0.02);
            search(&checker, from, to, 1, &mut unlimited())
        };
        let open = room(10.0, vec![]);
        assert_eq!(
            find(&open, Footprint::Point, from, to),
            Some(vec![from, to])
        );
        assert_eq!(find(&open, Footprint::Point, from, from), Some(vec![from]));
        let off = Point2::new(f64::NAN, 1.0);
        assert_eq!(find(&open, Footprint::Point, off, to), None);
        assert_eq!(
            find(&open, Footprint::Point, from, Point2::new(99.0, 1.0)),
            None
        );
        let closed = room(10.0, vec![block(5.0, 0.0, 5.5, 10.0)]);
        assert_eq!(find(&closed, Footprint::Point, from, to), None);
        let gap = room(10.0, vec![block(5.0, 1.0, 5.5, 10.0)]);
        assert!(find(&gap, Footprint::Disc { radius: 0.4 }, from, to).is_some());
        assert_eq!(find(&gap, Footprint::Disc { radius: 0.6 }, from, to), None);
        // No way out for a disc that does not fit where it stands, either.
        assert_eq!(find(&gap, Footprint::Disc { radius: 7.0 }, from, to), None);
    }

    #[test]
    fn a_stopped_search_gives_nothing_and_says_why() {
        let scene = load("fig6");
        let checker = MotionChecker::new(&scene.world, &Footprint::Point, 0.0, 0.02);
        let (start, goal) = (scene.start.position, scene.goal.position);
        let mut whole = unlimited();
        let way = search(&checker, start, goal, 1, &mut whole);
        assert!(way.is_some());
        let mut same = Meter::new(&Budget::of_iterations(whole.iterations()));
        assert_eq!(search(&checker, start, goal, 1, &mut same), way);
        for iterations in [0, 1, whole.iterations() - 1] {
            let mut meter = Meter::new(&Budget::of_iterations(iterations));
            assert_eq!(search(&checker, start, goal, 1, &mut meter), None);
            assert_eq!(meter.cut_short(), Some(CutShort::Iterations));
            assert_eq!(meter.iterations(), iterations);
        }
    }

    /// Pillars of one cell at every eighth, on a square map of `cells` a side.
    fn pillars(cells: usize) -> World {
        let solid = |i: usize| (i % cells) % 8 == 3 && (i / cells) % 8 == 3;
        let grid = OccupancyGrid::new(
            cells,
            cells,
            0.05,
            Pose2::new(0.0, 0.0, 0.0),
            (0..cells * cells)
                .map(|i| if solid(i) { Cell::Occupied } else { Cell::Free })
                .collect(),
        )
        .unwrap();
        World::from_grid(grid).unwrap()
    }

    #[test]
    fn a_large_map_is_searched_until_the_deadline() {
        let world = pillars(512);
        let checker = MotionChecker::new(&world, &Footprint::Disc { radius: 0.1 }, 0.0, 0.002);
        let (start, goal) = (Point2::new(0.375, 0.375), Point2::new(24.775, 24.375));
        let way =
            search(&checker, start, goal, 1, &mut unlimited()).expect("a way between pillars");
        assert!(length(&way) < 1.06 * (goal - start).norm());
        let asked = AtomicU64::new(0);
        let stop = || (asked.fetch_add(1, Memory::Relaxed) == 3).then_some(StopReason::Deadline);
        let mut meter = Meter::new(&Budget::until(&stop));
        assert_eq!(search(&checker, start, goal, 1, &mut meter), None);
        assert_eq!(meter.cut_short(), Some(CutShort::Deadline));
        let between = u64::from(CELLS_PER_QUESTION / CELLS_PER_ITERATION);
        assert!(meter.iterations() <= 3 * between);
    }
}
