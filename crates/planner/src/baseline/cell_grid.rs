//! Square cells over the field, free where the disc fits at their centre: what the grid searches walk on.

use crate::budget::Meter;
use crate::motion::MotionChecker;
use bikebot_geometry::{Point2, Vector2};

/// An end that its own cell does not serve is joined to a free cell at most this many cells away.
const ENDS_REACH: usize = 2;
/// Cells laid or visited that count as one iteration of the budget: some 0.01 ms.
pub(crate) const CELLS_PER_ITERATION: usize = 16;

/// Cells from the lower left corner of the field, row by row, with the room at each centre.
#[derive(Debug)]
pub struct CellGrid<'c, 'w> {
    checker: &'c MotionChecker<'w>,
    origin: Point2,
    side: f64,
    columns: usize,
    rows: usize,
    /// Clearance of the inscribed disc at each centre less what a motion needs, m: free from 0 on.
    room: Vec<f64>,
}

impl<'c, 'w> CellGrid<'c, 'w> {
    /// Lays cells of the given side (m) over the field of an [inscribed](MotionChecker::inscribed) checker; `None` if the
    /// budget ended first.
    #[must_use]
    pub fn lay(checker: &'c MotionChecker<'w>, side: f64, meter: &mut Meter<'_>) -> Option<Self> {
        let bounds = checker.world().bounds();
        let count = |extent: f64| ((extent / side).ceil() as usize).max(1);
        let mut grid = Self {
            checker,
            origin: bounds.min,
            side,
            columns: count(bounds.width()),
            rows: count(bounds.height()),
            room: Vec::new(),
        };
        let need = checker.margin() + 0.5 * checker.resolution();
        grid.room.reserve(grid.columns * grid.rows);
        for cell in 0..grid.columns * grid.rows {
            if cell.is_multiple_of(CELLS_PER_ITERATION) && !meter.step() {
                return None;
            }
            let room = checker.position_clearance(grid.centre(cell)) - need;
            grid.room.push(room);
        }
        Some(grid)
    }

    /// Side of a cell, m.
    #[must_use]
    pub fn side(&self) -> f64 {
        self.side
    }

    /// Number of columns, along x.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of rows, along y.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of cells; cell `c` is in row `c / columns` and column `c % columns`.
    #[must_use]
    pub fn cells(&self) -> usize {
        self.room.len()
    }

    /// Centre of a cell, m.
    #[must_use]
    pub fn centre(&self, cell: usize) -> Point2 {
        let (column, row) = (cell % self.columns, cell / self.columns);
        self.origin + Vector2::new(column as f64 + 0.5, row as f64 + 0.5) * self.side
    }

    /// Whether the disc fits at the centre.
    #[must_use]
    pub fn is_free(&self, cell: usize) -> bool {
        self.room[cell] >= 0.0
    }

    /// The neighbour `dx` columns and `dy` rows away, if that is on the field.
    #[must_use]
    pub fn neighbour(&self, cell: usize, dx: isize, dy: isize) -> Option<usize> {
        let column = (cell % self.columns).checked_add_signed(dx)?;
        let row = (cell / self.columns).checked_add_signed(dy)?;
        (column < self.columns && row < self.rows).then(|| row * self.columns + column)
    }

    /// Whether the straight motion between two free centres is free.
    #[must_use]
    pub fn is_arc_free(&self, a: usize, b: usize) -> bool {
        let (from, to) = (self.centre(a), self.centre(b));
        // The free discs about both ends cover the arc between them when together they are as long.
        self.room[a] + self.room[b] >= (to - from).norm() || self.checker.is_segment_free(from, to)
    }

    /// The free cell to join `p` (m) to: its own if the way to the centre is free, or else the nearest for which it is.
    #[must_use]
    pub fn attach(&self, p: Point2) -> Option<usize> {
        let at = (p - self.origin) / self.side;
        let index = |x: f64, count: usize| (x.max(0.0) as usize).min(count - 1);
        let (column, row) = (index(at.x, self.columns), index(at.y, self.rows));
        let serves =
            |cell: usize| self.is_free(cell) && self.checker.is_segment_free(p, self.centre(cell));
        let own = row * self.columns + column;
        if serves(own) {
            return Some(own);
        }
        let around =
            |i: usize, count: usize| i.saturating_sub(ENDS_REACH)..(i + ENDS_REACH + 1).min(count);
        let mut near: Vec<(f64, usize)> = around(row, self.rows)
            .flat_map(|row| {
                around(column, self.columns).map(move |column| row * self.columns + column)
            })
            .map(|cell| ((self.centre(cell) - p).norm_squared(), cell))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.into_iter()
            .map(|(_, cell)| cell)
            .find(|&cell| serves(cell))
    }

    /// Fractional column and row of `p` (m), counted from the centre of cell 0.
    pub(crate) fn coordinates(&self, p: Point2) -> Vector2 {
        (p - self.origin) / self.side - Vector2::new(0.5, 0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::test_scenes::{block, room};
    use bikebot_world::Footprint;

    #[test]
    fn cells_cover_the_field_and_are_free_where_the_disc_fits() {
        let world = room(10.0, vec![block(4.0, 0.0, 6.0, 7.0)]);
        let disc = Footprint::Disc { radius: 0.4 };
        let checker = MotionChecker::new(&world, &disc, 0.0, 0.02);
        let grid = CellGrid::lay(&checker, 0.75, &mut Meter::new(&Budget::unlimited())).unwrap();
        assert_eq!((grid.columns(), grid.rows(), grid.cells()), (14, 14, 196));
        for cell in 0..grid.cells() {
            let clearance = world.clearance(grid.centre(cell)) - 0.4;
            assert_eq!(grid.is_free(cell), clearance >= 0.01, "{cell}");
        }
        assert_eq!(grid.neighbour(0, -1, 0), None);
        assert_eq!(grid.neighbour(13, 1, 0), None);
        assert_eq!(grid.neighbour(15, -1, -1), Some(0));
    }

    #[test]
    fn an_end_in_a_cell_whose_centre_is_walled_off_is_joined_to_another() {
        let world = room(10.0, vec![block(0.0, 2.4, 10.0, 2.6)]);
        let checker = MotionChecker::new(&world, &Footprint::Point, 0.0, 0.02);
        let grid = CellGrid::lay(&checker, 1.0, &mut Meter::new(&Budget::unlimited())).unwrap();
        let p = Point2::new(5.5, 2.9);
        let cell = grid.attach(p).unwrap();
        assert_eq!(grid.centre(cell), Point2::new(5.5, 3.5));
        assert!(!grid.is_arc_free(cell, grid.neighbour(cell, 0, -2).unwrap()));
    }
}
