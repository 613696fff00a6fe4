//! The row "LP" of Table 2 read as *Laplace potential* (Sato 1993): a streamline of a harmonic function.
//!
//! On the free cells of a grid, Δu = 0 with u = 1 in the goal's cell and u = 0 on everything solid, the field's edge included.
//! By the maximum principle u has no other maximum, so its gradient leads to the goal from wherever u > 0; and being
//! least at the walls, it keeps to the middle of what is free. That makes the way safe, and longer than need be.
//!
//! u falls off exponentially, to 1e-9 across the yard and further in a maze. It is solved for directly
//! (Cholesky factors within the envelope), which keeps the digits of the small values; iterations do not.

use super::cell_grid::{CELLS_PER_ITERATION, CellGrid};
use super::envelope::Envelope;
use crate::budget::Meter;
use bikebot_geometry::{Point2, Vector2};

/// Neighbours that share a side, as columns and rows.
const SIDES: [(isize, isize); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];
/// Length of a step along the streamline, in cells.
const STEP: f64 = 0.5;
/// Most steps per cell of the grid; a streamline that circles has lost its way.
const MOST_STEPS_PER_CELL: usize = 8;
/// Not an unknown.
const NONE: usize = usize::MAX;

/// The potential of one goal on one grid.
#[derive(Debug)]
pub struct Potential<'g, 'c, 'w> {
    grid: &'g CellGrid<'c, 'w>,
    goal: usize,
    /// u at each centre; 0 in cells that are not free or that the goal cannot be reached from.
    values: Vec<f64>,
}

impl<'g, 'c, 'w> Potential<'g, 'c, 'w> {
    /// Solves for the potential of the cell `goal`; `None` if the budget ended first.
    #[must_use]
    pub fn solve(grid: &'g CellGrid<'c, 'w>, goal: usize, meter: &mut Meter<'_>) -> Option<Self> {
        let reached = flood(grid, goal, meter)?;
        // Rows of the matrix along the shorter side of the grid, so that the envelope is as narrow.
        let (columns, rows) = (grid.columns(), grid.rows());
        let in_order = |k: usize| {
            if columns <= rows {
                k
            } else {
                k % rows * columns + k / rows
            }
        };
        let mut unknown = vec![NONE; grid.cells()];
        let mut cells = Vec::new();
        for cell in (0..grid.cells()).map(in_order) {
            if reached[cell] && cell != goal {
                unknown[cell] = cells.len();
                cells.push(cell);
            }
        }
        let reached = &reached;
        let coupled = |cell: usize| {
            SIDES
                .iter()
                .filter_map(move |&(dx, dy)| grid.neighbour(cell, dx, dy))
                .filter(move |&other| reached[other] && grid.is_arc_free(cell, other))
        };
        let mut first: Vec<usize> = (0..cells.len()).collect();
        for (i, &cell) in cells.iter().enumerate() {
            for other in coupled(cell).filter(|&other| other != goal) {
                first[i] = first[i].min(unknown[other]);
            }
        }
        let mut matrix = Envelope::new(first);
        let mut u = vec![0.0; cells.len()];
        for (i, &cell) in cells.iter().enumerate() {
            *matrix.entry(i, i) = SIDES.len() as f64;
            for other in coupled(cell) {
                if other == goal {
                    u[i] = 1.0;
                } else if unknown[other] < i {
                    *matrix.entry(i, unknown[other]) = -1.0;
                }
            }
        }
        if !matrix.factor(meter) {
            return None;
        }
        matrix.solve(&mut u);
        let mut values = vec![0.0; grid.cells()];
        values[goal] = 1.0;
        for (&cell, u) in cells.iter().zip(u) {
            values[cell] = u;
        }
        Some(Self { grid, goal, values })
    }

    /// u at the centre of a cell.
    #[must_use]
    pub fn value(&self, cell: usize) -> f64 {
        self.values[cell]
    }

    /// u at `p` in cells from the centre of cell 0, interpolated bilinearly between the centres.
    fn interpolated(&self, p: Vector2) -> f64 {
        let (column, row) = (p.x.floor(), p.y.floor());
        let (fx, fy) = (p.x - column, p.y - row);
        let u = |dx: f64, dy: f64| {
            let (x, y) = (column + dx, row + dy);
            let on_field = x >= 0.0
                && y >= 0.0
                && x < self.grid.columns() as f64
                && y < self.grid.rows() as f64;
            // Beyond the edge lies the wall.
            if on_field {
                self.values[y as usize * self.grid.columns() + x as usize]
            } else {
                0.0
            }
        };
        (u(0.0, 0.0) * (1.0 - fx) + u(1.0, 0.0) * fx) * (1.0 - fy)
            + (u(0.0, 1.0) * (1.0 - fx) + u(1.0, 1.0) * fx) * fy
    }

    /// Direction in which u rises most about `p` (m), by differences over one cell: the gradient of the interpolation itself
    /// jumps from cell to cell, and a streamline of it has a kink at each. `None` where u is level.
    fn direction(&self, p: Point2) -> Option<Vector2> {
        let at = self.grid.coordinates(p);
        let half = 0.5;
        let u = |dx: f64, dy: f64| self.interpolated(at + Vector2::new(dx, dy));
        let [left, right, below, above] =
            [u(-half, 0.0), u(half, 0.0), u(0.0, -half), u(0.0, half)];
        // In units of the largest, or the squares of small values vanish.
        let unit = left.max(right).max(below).max(above);
        if unit <= 0.0 || unit.is_nan() {
            return None;
        }
        let gradient = Vector2::new(right / unit - left / unit, above / unit - below / unit);
        let norm = gradient.norm();
        (norm > 0.0).then(|| gradient / norm)
    }

    /// The streamline from `start` to within a cell of `goal` (m) or of the centre of its cell, by the midpoint rule. `None` if
    /// it gets stuck, or the budget ended first.
    #[must_use]
    pub fn streamline(
        &self,
        start: Point2,
        goal: Point2,
        meter: &mut Meter<'_>,
    ) -> Option<Vec<Point2>> {
        let centre = self.grid.centre(self.goal);
        let step = STEP * self.grid.side();
        let mut line = vec![start];
        let mut p = start;
        for _ in 0..MOST_STEPS_PER_CELL * self.grid.cells() {
            let distance = (p - goal).norm().min((p - centre).norm());
            if distance <= self.grid.side() {
                return Some(line);
            }
            if !meter.step() {
                return None;
            }
            let middle = p + self.direction(p)? * (0.5 * step);
            p += self.direction(middle)? * step;
            line.push(p);
        }
        None
    }
}

/// The cells from which the goal's can be reached over free arcs.
fn flood(grid: &CellGrid<'_, '_>, goal: usize, meter: &mut Meter<'_>) -> Option<Vec<bool>> {
    let mut reached = vec![false; grid.cells()];
    reached[goal] = true;
    let mut front = vec![goal];
    let mut visited = 0;
    while let Some(cell) = front.pop() {
        if usize::is_multiple_of(visited, CELLS_PER_ITERATION) && !meter.step() {
            return None;
        }
        visited += 1;
        for &(dx, dy) in &SIDES {
            if let Some(other) = grid.neighbour(cell, dx, dy)
                && !reached[other]
                && grid.is_free(other)
                && grid.is_arc_free(cell, other)
            {
                reached[other] = true;
                front.push(other);
            }
        }
    }
    Some(reached)
}

/// The streamline from `start` to `goal` (m), both included. Its legs between the centres are not checked. `None` if the
/// grid shows no way, or the budget ended first, which the meter tells.
#[must_use]
pub fn search(
    grid: &CellGrid<'_, '_>,
    start: Point2,
    goal: Point2,
    meter: &mut Meter<'_>,
) -> Option<Vec<Point2>> {
    let (from, to) = (grid.attach(start)?, grid.attach(goal)?);
    let potential = Potential::solve(grid, to, meter)?;
    if potential.value(from) <= 0.0 {
        return None;
    }
    let mut path = match potential.streamline(start, goal, meter) {
        Some(line) => line,
        None => {
            let mut line = vec![start];
            line.extend(potential.streamline(grid.centre(from), goal, meter)?);
            line
        }
    };
    path.push(goal);
    Some(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::motion::MotionChecker;
    use crate::test_scenes::{block, load, room};
    use bikebot_world::Footprint;

    #[test]
    fn the_potential_is_harmonic_and_greatest_at_the_goal() {
        let scene = load("fig6");
        let checker = MotionChecker::new(&scene.world, &Footprint::Point, 0.0, 0.02);
        let meter = &mut Meter::new(&Budget::unlimited());
        let grid = CellGrid::lay(&checker, 1.0, meter).unwrap();
        let goal = grid.attach(scene.goal.position).unwrap();
        let potential = Potential::solve(&grid, goal, meter).unwrap();
        let mut least = 1.0_f64;
        for cell in (0..grid.cells()).filter(|&c| grid.is_free(c) && c != goal) {
            let u = potential.value(cell);
            assert!(u > 0.0 && u < 1.0, "{cell}: {u}");
            least = least.min(u);
            let around: f64 = SIDES
                .iter()
                .filter_map(|&(dx, dy)| grid.neighbour(cell, dx, dy))
                .filter(|&other| grid.is_free(other))
                .map(|other| potential.value(other))
                .sum();
            // Relative to the value itself, however small: some 200 roundings.
            assert!(
                (4.0 * u / around - 1.0).abs() < 1e-12,
                "{cell}: {u} {around}"
            );
        }
        assert!(least < 1e-9, "{least}");
    }

    #[test]
    fn the_streamline_rises_all_the_way() {
        let scene = load("fig6");
        let checker = MotionChecker::new(&scene.world, &Footprint::Point, 0.0, 0.02);
        let meter = &mut Meter::new(&Budget::unlimited());
        let grid = CellGrid::lay(&checker, 1.0, meter).unwrap();
        let goal = grid.attach(scene.goal.position).unwrap();
        let potential = Potential::solve(&grid, goal, meter).unwrap();
        let (start, end) = (scene.start.position, scene.goal.position);
        let line = potential.streamline(start, end, meter).unwrap();
        // In steps of a few cells, so that the kinks of the bilinear interpolation do not matter.
        let at = |p: &Point2| potential.value(grid.attach(*p).unwrap());
        for pair in line.iter().step_by(6).collect::<Vec<_>>().windows(2) {
            assert!(at(pair[1]) > at(pair[0]), "{pair:?}");
        }
    }

    #[test]
    fn a_thin_wall_between_two_centres_is_not_jumped() {
        let world = room(10.0, vec![block(0.0, 4.98, 9.0, 5.02)]);
        let checker = MotionChecker::new(&world, &Footprint::Point, 0.0, 0.02);
        let meter = &mut Meter::new(&Budget::unlimited());
        let grid = CellGrid::lay(&checker, 1.0, meter).unwrap();
        let potential = Potential::solve(&grid, grid.attach(Point2::new(1.5, 8.5)).unwrap(), meter);
        let potential = potential.unwrap();
        let at = |x, y| potential.value(grid.attach(Point2::new(x, y)).unwrap());
        // The way round is by the gap on the right.
        assert!(at(1.5, 5.5) > 10.0 * at(1.5, 4.5));
        assert!(at(9.5, 4.5) > at(1.5, 4.5));
    }
}
