//! Occupancy grids: cells, the frame they lie in, and the lines that cross them.

use bikebot_geometry::{Point2, Pose2, Vector2};

use crate::error::{MAX_COORDINATE, MAX_GRID_CELLS, MAX_GRID_SIDE, WorldError};
use crate::grid_traversal::GridTraversal;
use crate::obstacle::{Bounds, Obstacle};
#[cfg(test)]
use crate::primitive::{Corner, Edge};

/// What is known about one cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Cell {
    /// Nothing is in the way.
    Free,
    /// Something solid.
    Occupied,
    /// Never seen, or seen without a verdict. A [`crate::World`] treats it as solid.
    Unknown,
}

/// A rectangle of whole cells: columns `x0..x1`, rows `y0..y1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CellRectangle {
    /// First column.
    pub x0: usize,
    /// First row.
    pub y0: usize,
    /// One past the last column.
    pub x1: usize,
    /// One past the last row.
    pub y1: usize,
}

/// A rectangle of square cells laid into the plane.
///
/// Column 0, row 0 is the lower-left cell in the grid's own frame, whatever the file it came
/// from does. `origin` is the lower-left *corner* of that cell in the world frame, with the
/// direction of the grid's x axis as its heading.
#[derive(Debug, Clone, PartialEq)]
pub struct OccupancyGrid {
    /// Cells along the grid's x axis.
    pub width: usize,
    /// Cells along the grid's y axis.
    pub height: usize,
    /// Side of a cell, m.
    pub resolution: f64,
    /// Lower-left corner of the lower-left cell, and the yaw of the grid (m, rad).
    pub origin: Pose2,
    /// `height` rows of `width` cells, bottom row first.
    pub cells: Vec<Cell>,
}

impl OccupancyGrid {
    /// A grid from its cells, bottom row first.
    ///
    /// # Errors
    ///
    /// If the size is 0 or beyond 16 384 cells a side or 64 Mi cells in all, if `cells` has
    /// another length, or if resolution or origin are not usable numbers.
    pub fn new(
        width: usize,
        height: usize,
        resolution: f64,
        origin: Pose2,
        cells: Vec<Cell>,
    ) -> Result<Self, WorldError> {
        let grid = Self {
            width,
            height,
            resolution,
            origin,
            cells,
        };
        grid.check()?;
        Ok(grid)
    }

    /// A grid with the same verdict in every cell.
    ///
    /// # Errors
    ///
    /// As [`OccupancyGrid::new`].
    pub fn filled(
        width: usize,
        height: usize,
        resolution: f64,
        origin: Pose2,
        cell: Cell,
    ) -> Result<Self, WorldError> {
        check_size(width, height)?;
        Self::new(
            width,
            height,
            resolution,
            origin,
            vec![cell; width * height],
        )
    }

    pub(crate) fn check(&self) -> Result<(), WorldError> {
        check_size(self.width, self.height)?;
        let expected = self.width * self.height;
        if self.cells.len() != expected {
            return Err(WorldError::GridCells {
                width: self.width,
                height: self.height,
                expected,
                found: self.cells.len(),
            });
        }
        let extent = self.resolution * self.width.max(self.height) as f64;
        // A cell below a nanometre is lost in the rounding of the coordinates.
        if !(self.resolution >= 1e-9 && extent <= MAX_COORDINATE) {
            return Err(WorldError::Resolution {
                resolution: self.resolution,
            });
        }
        let Pose2 { position, heading } = self.origin;
        if !(position.x.abs() <= MAX_COORDINATE
            && position.y.abs() <= MAX_COORDINATE
            && heading.is_finite())
        {
            return Err(WorldError::GridOrigin {
                x: position.x,
                y: position.y,
                yaw: heading,
            });
        }
        Ok(())
    }

    /// The cell in column `x`, row `y`; `None` off the grid.
    #[must_use]
    pub fn cell(&self, x: usize, y: usize) -> Option<Cell> {
        (x < self.width && y < self.height).then(|| self.cells[y * self.width + x])
    }

    /// Writes one cell; off the grid nothing happens.
    pub fn set(&mut self, x: usize, y: usize, cell: Cell) {
        if x < self.width && y < self.height {
            self.cells[y * self.width + x] = cell;
        }
    }

    /// How many cells hold this verdict.
    #[must_use]
    pub fn count(&self, cell: Cell) -> usize {
        self.cells.iter().filter(|&&c| c == cell).count()
    }

    /// The same grid with unknown cells read as `cell`, for instance as free.
    #[must_use]
    pub fn with_unknown_as(mut self, cell: Cell) -> Self {
        for c in &mut self.cells {
            if *c == Cell::Unknown {
                *c = cell;
            }
        }
        self
    }

    /// A world point (m) in the grid's frame, counted in cells from its lower-left corner.
    #[must_use]
    pub fn to_cell_coordinates(&self, p: Point2) -> Vector2 {
        let offset = p - self.origin.position;
        let local = if self.origin.heading == 0.0 {
            offset
        } else {
            let (sin, cos) = self.origin.heading.sin_cos();
            Vector2::new(
                cos * offset.x + sin * offset.y,
                cos * offset.y - sin * offset.x,
            )
        };
        local / self.resolution
    }

    /// A point counted in cells from the lower-left corner, in the world frame (m).
    #[must_use]
    pub fn from_cell_coordinates(&self, cells: Vector2) -> Point2 {
        let local = Point2::from(cells * self.resolution);
        if self.origin.heading == 0.0 {
            // Without a yaw corners must fall on origin + k · resolution exactly.
            self.origin.position + local.coords
        } else {
            self.origin.transform(local)
        }
    }

    /// The cell that contains a world point (m); `None` off the grid.
    ///
    /// A point on the line between two cells belongs to the one on the right or above.
    #[must_use]
    pub fn world_to_cell(&self, p: Point2) -> Option<(usize, usize)> {
        let c = self.to_cell_coordinates(p);
        let inside =
            c.x >= 0.0 && c.y >= 0.0 && c.x < self.width as f64 && c.y < self.height as f64;
        inside.then_some((c.x as usize, c.y as usize))
    }

    /// Centre of a cell in the world frame (m).
    #[must_use]
    pub fn cell_centre(&self, x: usize, y: usize) -> Point2 {
        self.from_cell_coordinates(Vector2::new(x as f64 + 0.5, y as f64 + 0.5))
    }

    /// The four corners (m) in the world frame: lower left, lower right, upper right, upper left.
    #[must_use]
    pub fn corners(&self) -> [Point2; 4] {
        let (w, h) = (self.width as f64, self.height as f64);
        [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)]
            .map(|(x, y)| self.from_cell_coordinates(Vector2::new(x, y)))
    }

    /// The smallest world-aligned rectangle around the grid.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let [a, b, c, d] = self.corners();
        let over = |f: fn(f64, f64) -> f64, v: [f64; 4]| v.into_iter().reduce(f).unwrap_or(v[0]);
        let (xs, ys) = ([a.x, b.x, c.x, d.x], [a.y, b.y, c.y, d.y]);
        Bounds::new(
            over(f64::min, xs),
            over(f64::min, ys),
            over(f64::max, xs),
            over(f64::max, ys),
        )
    }

    /// The cells crossed by the segment between two world points (m), in order.
    ///
    /// Parts of the segment off the grid are left out. Where the segment passes exactly through
    /// a corner it enters the neighbour along x first, so that successive cells always share a
    /// side.
    #[must_use]
    pub fn traverse(&self, from: Point2, to: Point2) -> GridTraversal {
        GridTraversal::new(
            self.width,
            self.height,
            self.to_cell_coordinates(from),
            self.to_cell_coordinates(to),
        )
    }

    /// The grid with every free or unknown cell occupied whose square comes closer than
    /// `radius` (m) to an occupied cell's square.
    #[must_use]
    pub fn inflated(&self, radius: f64) -> Self {
        let mut inflated = self.clone();
        let reach = radius / self.resolution;
        if reach.is_nan() || reach <= 0.0 {
            return inflated;
        }
        let reach_squared = reach * reach;
        let steps = (reach.floor() as usize)
            .saturating_add(1)
            .min(self.width.max(self.height));
        for y in 0..self.height {
            for x in 0..self.width {
                if self.cells[y * self.width + x] != Cell::Occupied || self.is_interior(x, y) {
                    continue;
                }
                for ny in y.saturating_sub(steps)..(y + steps + 1).min(self.height) {
                    for nx in x.saturating_sub(steps)..(x + steps + 1).min(self.width) {
                        // Between squares: one cell less than between centres, along each axis.
                        let dx = nx.abs_diff(x).saturating_sub(1) as f64;
                        let dy = ny.abs_diff(y).saturating_sub(1) as f64;
                        if dx * dx + dy * dy < reach_squared {
                            inflated.cells[ny * self.width + nx] = Cell::Occupied;
                        }
                    }
                }
            }
        }
        inflated
    }

    /// Whether all eight neighbours of an occupied cell are occupied too.
    fn is_interior(&self, x: usize, y: usize) -> bool {
        x > 0
            && y > 0
            && x + 1 < self.width
            && y + 1 < self.height
            && (y - 1..=y + 1).all(|ny| {
                self.cells[ny * self.width + x - 1..=ny * self.width + x + 1]
                    .iter()
                    .all(|c| *c == Cell::Occupied)
            })
    }

    /// Few rectangles that together cover exactly the cells for which `keep` holds, none twice.
    ///
    /// Greedy: from the lowest, leftmost cell not covered yet, as far right as possible, then
    /// as far up as the whole row allows.
    #[must_use]
    pub fn rectangles(&self, keep: impl Fn(Cell) -> bool) -> Vec<CellRectangle> {
        let everything = CellRectangle {
            x0: 0,
            y0: 0,
            x1: self.width,
            y1: self.height,
        };
        self.rectangles_within(everything, keep)
    }

    /// As [`OccupancyGrid::rectangles`], for the cells of a window that lies on the grid.
    pub(crate) fn rectangles_within(
        &self,
        window: CellRectangle,
        keep: impl Fn(Cell) -> bool,
    ) -> Vec<CellRectangle> {
        let w = window.x1.saturating_sub(window.x0);
        let h = window.y1.saturating_sub(window.y0);
        let mut open: Vec<bool> = Vec::with_capacity(w * h);
        for y in window.y0..window.y0 + h {
            let row = y * self.width;
            let cells = &self.cells[row + window.x0..row + window.x0 + w];
            open.extend(cells.iter().map(|&c| keep(c)));
        }
        let mut rectangles = Vec::new();
        for y0 in 0..h {
            let mut x0 = 0;
            while x0 < w {
                if !open[y0 * w + x0] {
                    x0 += 1;
                    continue;
                }
                let run = open[y0 * w + x0..(y0 + 1) * w]
                    .iter()
                    .take_while(|o| **o)
                    .count();
                let x1 = x0 + run;
                let mut y1 = y0 + 1;
                while y1 < h && open[y1 * w + x0..y1 * w + x1].iter().all(|o| *o) {
                    y1 += 1;
                }
                for row in y0..y1 {
                    open[row * w + x0..row * w + x1].fill(false);
                }
                rectangles.push(CellRectangle {
                    x0: window.x0 + x0,
                    y0: window.y0 + y0,
                    x1: window.x0 + x1,
                    y1: window.y0 + y1,
                });
                x0 = x1;
            }
        }
        rectangles
    }

    /// A rectangle of cells as an obstacle in the world frame.
    #[must_use]
    pub fn rectangle_obstacle(&self, r: CellRectangle) -> Obstacle {
        let corner =
            |x: usize, y: usize| self.from_cell_coordinates(Vector2::new(x as f64, y as f64));
        if self.origin.heading == 0.0 {
            Obstacle::Block {
                min: corner(r.x0, r.y0),
                max: corner(r.x1, r.y1),
            }
        } else {
            Obstacle::Polygon {
                vertices: vec![
                    corner(r.x0, r.y0),
                    corner(r.x1, r.y0),
                    corner(r.x1, r.y1),
                    corner(r.x0, r.y1),
                ],
            }
        }
    }

    /// Whether a cell is solid for a world; off the grid nothing is.
    #[cfg(test)]
    pub(crate) fn is_solid(&self, x: isize, y: isize) -> bool {
        x >= 0
            && y >= 0
            && (x as usize) < self.width
            && (y as usize) < self.height
            && self.cells[y as usize * self.width + x as usize] != Cell::Free
    }

    /// The boundary of all solid cells together, in maximal straight pieces, solid on the left: what the tests hold the cells
    /// themselves against.
    #[cfg(test)]
    pub(crate) fn boundary(&self, shape: u32) -> Vec<Edge> {
        let (w, h) = (self.width as isize, self.height as isize);
        let vertex =
            |x: isize, y: isize| self.from_cell_coordinates(Vector2::new(x as f64, y as f64));
        let corner = |x: isize, y: isize| {
            let solid = [(-1, -1), (0, -1), (-1, 0), (0, 0)]
                .into_iter()
                .filter(|(dx, dy)| self.is_solid(x + dx, y + dy))
                .count();
            // Two solid cells meet here only diagonally; a side of one of them is then nearer
            // than the corner wherever the answer matters.
            if solid == 3 {
                Corner::Reflex
            } else {
                Corner::Convex
            }
        };
        let mut edges = Vec::new();
        let mut push = |from: (isize, isize), to: (isize, isize)| {
            edges.push(Edge::new(
                vertex(from.0, from.1),
                vertex(to.0, to.1),
                shape,
                corner(from.0, from.1),
                corner(to.0, to.1),
            ));
        };
        // Row by row, which is how the cells lie in memory. A grid line bounds the solid where
        // one of its sides is solid and the other is not; a run goes on while the sense stays.
        let mut below = vec![false; self.width + 2];
        let mut row = vec![false; self.width + 2];
        let mut upright: Vec<Option<(isize, bool)>> = vec![None; self.width + 1];
        for y in 0..=h {
            row.fill(false);
            if y < h {
                let first = y as usize * self.width;
                let cells = &self.cells[first..first + self.width];
                for (solid, cell) in row[1..].iter_mut().zip(cells) {
                    *solid = *cell != Cell::Free;
                }
            }
            if row != below {
                let mut level: Option<(isize, bool)> = None;
                for x in 0..=w {
                    let (above, under) = (row[x as usize + 1], below[x as usize + 1]);
                    let now = (above != under).then_some(above);
                    advance(&mut level, x, now, |a, b, above| {
                        if above {
                            push((a, y), (b, y));
                        } else {
                            push((b, y), (a, y));
                        }
                    });
                }
                // Where this row equals the one below, every upright run simply goes on.
                for x in 0..=w {
                    let (left, right) = (row[x as usize], row[x as usize + 1]);
                    let now = (left != right).then_some(left);
                    advance(&mut upright[x as usize], y, now, |a, b, left| {
                        if left {
                            push((x, a), (x, b));
                        } else {
                            push((x, b), (x, a));
                        }
                    });
                }
            }
            std::mem::swap(&mut below, &mut row);
        }
        edges
    }
}

/// Carries a run along a grid line to position `k`, where the boundary's sense is `now`; calls
/// `ended(start, end, sense)` if that ends the run.
#[cfg(test)]
fn advance(
    run: &mut Option<(isize, bool)>,
    k: isize,
    now: Option<bool>,
    ended: impl FnOnce(isize, isize, bool),
) {
    if let Some((start, sense)) = *run
        && now != Some(sense)
    {
        ended(start, k, sense);
        *run = None;
    }
    if run.is_none() {
        *run = now.map(|sense| (k, sense));
    }
}

fn check_size(width: usize, height: usize) -> Result<(), WorldError> {
    let sides = 1..=MAX_GRID_SIDE;
    if sides.contains(&width) && sides.contains(&height) && width * height <= MAX_GRID_CELLS {
        Ok(())
    } else {
        Err(WorldError::GridSize { width, height })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn grid_of(rows_top_first: &[&str]) -> OccupancyGrid {
        crate::map_text::parse("test", &rows_top_first.join("\n"))
            .expect("a picture drawn in a test")
            .grid
    }

    #[test]
    fn a_turned_grid_puts_its_cells_where_the_yaw_says() {
        let mut grid = OccupancyGrid::filled(
            5,
            3,
            0.5,
            Pose2::new(2.0, 1.0, std::f64::consts::FRAC_PI_2),
            Cell::Free,
        )
        .expect("valid");
        grid.set(4, 0, Cell::Occupied);
        // Column 4 lies 2.25 m along the grid's x, which points up; row 0 is 0.25 m to its left.
        let centre = grid.cell_centre(4, 0);
        assert!((centre - Point2::new(1.75, 3.25)).norm() < 1e-15);
        assert_eq!(grid.world_to_cell(centre), Some((4, 0)));
        assert_eq!(grid.world_to_cell(Point2::new(2.1, 3.25)), None);
        let b = grid.bounds();
        assert!((b.min - Point2::new(0.5, 1.0)).norm() < 1e-15);
        assert!((b.max - Point2::new(2.0, 3.5)).norm() < 1e-15);
    }

    #[test]
    fn a_traversal_visits_the_cells_on_the_line_in_order() {
        let grid = grid_of(&["....", "....", "...."]);
        let cells: Vec<_> = grid
            .traverse(Point2::new(0.5, 0.5), Point2::new(3.5, 1.5))
            .collect();
        assert_eq!(cells, [(0, 0), (1, 0), (2, 0), (2, 1), (3, 1)]);
        let back: Vec<_> = grid
            .traverse(Point2::new(-5.0, 2.5), Point2::new(1.5, 2.5))
            .collect();
        assert_eq!(back, [(0, 2), (1, 2)]);
        let outside = grid.traverse(Point2::new(-1.0, 5.0), Point2::new(9.0, 5.0));
        assert_eq!(outside.count(), 0);
        let nan = grid.traverse(Point2::new(f64::NAN, 0.5), Point2::new(1.0, 0.5));
        assert_eq!(nan.count(), 0);
    }

    #[test]
    fn inflation_reaches_as_far_as_the_radius_between_squares() {
        let grid = grid_of(&[".....", ".....", "..#..", ".....", "....."]);
        assert_eq!(grid.inflated(0.0).count(Cell::Occupied), 1);
        assert_eq!(grid.inflated(0.5).count(Cell::Occupied), 9);
        assert_eq!(grid.inflated(1.2).count(Cell::Occupied), 21);
        assert_eq!(grid.inflated(1.5).count(Cell::Occupied), 25);
    }

    #[test]
    fn rectangles_cover_each_cell_once() {
        let grid = grid_of(&["##..#", "##.##", "...##"]);
        let rectangles = grid.rectangles(|c| c == Cell::Occupied);
        assert_eq!(rectangles.len(), 3);
        let mut covered = vec![0; grid.cells.len()];
        for r in &rectangles {
            for y in r.y0..r.y1 {
                for x in r.x0..r.x1 {
                    covered[y * grid.width + x] += 1;
                }
            }
        }
        for (count, cell) in covered.iter().zip(&grid.cells) {
            assert_eq!(*count, i32::from(*cell == Cell::Occupied));
        }
    }

    #[test]
    fn the_boundary_of_a_ring_of_cells_has_eight_pieces() {
        let grid = grid_of(&["###", "#.#", "###"]);
        let boundary = grid.boundary(0);
        assert_eq!(boundary.len(), 8);
        let length: f64 = boundary.iter().map(|e| e.span.norm()).sum();
        assert_eq!(length, 16.0);
        // Solid on the left everywhere: the enclosed area comes out by the shoelace formula.
        let area: f64 = boundary
            .iter()
            .map(|e| e.start.coords.perp(&e.end().coords) / 2.0)
            .sum();
        assert_eq!(area, 8.0);
    }

    #[test]
    fn absurd_grids_are_refused_before_anything_is_allocated() {
        let origin = Pose2::new(0.0, 0.0, 0.0);
        for (w, h) in [
            (0, 5),
            (usize::MAX, usize::MAX),
            (16_385, 1),
            (16_384, 16_384),
        ] {
            assert!(matches!(
                OccupancyGrid::filled(w, h, 1.0, origin, Cell::Free),
                Err(WorldError::GridSize { .. })
            ));
        }
        for resolution in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e300, 1e-300] {
            assert!(matches!(
                OccupancyGrid::filled(2, 2, resolution, origin, Cell::Free),
                Err(WorldError::Resolution { .. })
            ));
        }
        let short = OccupancyGrid::new(2, 2, 1.0, origin, vec![Cell::Free; 3]);
        assert!(matches!(
            short,
            Err(WorldError::GridCells {
                expected: 4,
                found: 3,
                ..
            })
        ));
    }

    proptest! {
        #[test]
        fn a_traversal_is_connected_and_ends_where_the_segment_does(
            ax in -2.0..12.0_f64, ay in -2.0..9.0_f64, bx in -2.0..12.0_f64, by in -2.0..9.0_f64,
            yaw in -3.0..3.0_f64,
        ) {
            let grid = OccupancyGrid::filled(10, 7, 1.0, Pose2::new(0.3, -0.2, yaw), Cell::Free)
                .expect("valid");
            let (a, b) = (Point2::new(ax, ay), Point2::new(bx, by));
            let cells: Vec<_> = grid.traverse(a, b).collect();
            for pair in cells.windows(2) {
                let steps = pair[0].0.abs_diff(pair[1].0) + pair[0].1.abs_diff(pair[1].1);
                prop_assert_eq!(steps, 1);
            }
            if let Some(cell) = grid.world_to_cell(a) {
                prop_assert_eq!(cells.first(), Some(&cell));
            }
            if let Some(cell) = grid.world_to_cell(b) {
                prop_assert_eq!(cells.last(), Some(&cell));
            }
            for k in 0..=200 {
                let q = a + (b - a) * (f64::from(k) / 200.0);
                let c = grid.to_cell_coordinates(q);
                let near_line = (c.x - c.x.round()).abs() < 1e-9 || (c.y - c.y.round()).abs() < 1e-9;
                if let (Some(cell), false) = (grid.world_to_cell(q), near_line) {
                    prop_assert!(cells.contains(&cell));
                }
            }
        }
    }
}
