//! Which cells a scan passed through and which it hit: each once, however many beams.

use bikebot_geometry::Vector2;
use bikebot_world::overlap_with_grid;

/// A beam passed.
pub(crate) const PASSED: u8 = 1;
/// A beam ended on something.
pub(crate) const HIT: u8 = 2;

/// Binary digits of a coordinate within a cell: a 4096th, 24 µm in a cell of 0.1 m.
const DIGITS: u32 = 12;
const ONE: i64 = 1 << DIGITS;

/// One byte a cell, with a frame of one cell about the grid, and the window that is in use.
#[derive(Debug, Clone)]
pub(crate) struct Marks {
    bytes: Vec<u8>,
    width: usize,
    height: usize,
    stride: usize,
    /// Columns and rows of the grid in use: first, last.
    window: Option<[usize; 4]>,
}

impl Marks {
    pub(crate) fn new(width: usize, height: usize) -> Self {
        Self {
            bytes: vec![0; (width + 2) * (height + 2)],
            width,
            height,
            stride: width + 2,
            window: None,
        }
    }

    /// Marks a cell as hit.
    pub(crate) fn hit(&mut self, x: usize, y: usize) {
        if x < self.width && y < self.height {
            self.bytes[(y + 1) * self.stride + x + 1] = HIT;
            self.widen(x, y);
        }
    }

    /// Marks the cells a segment crosses as passed; its ends are in cells from the lower left corner.
    ///
    /// After Amanatides & Woo 1987 in whole numbers: the ends are rounded to a 4096th of a cell, and from there on
    /// nothing is rounded, so it ends where it has to.
    pub(crate) fn pass(&mut self, from: Vector2, to: Vector2) {
        let Some((from, to)) = self.clipped(from, to) else {
            return;
        };
        // Inside the grid after clipping, hence not negative and below 2²⁷.
        let fixed = |v: f64| (v * ONE as f64) as i64;
        let (x0, y0, x1, y1) = (fixed(from.x), fixed(from.y), fixed(to.x), fixed(to.y));
        let (cx, cy) = (x0 >> DIGITS, y0 >> DIGITS);
        let (ex, ey) = (x1 >> DIGITS, y1 >> DIGITS);
        self.widen(cx as usize, cy as usize);
        self.widen(ex as usize, ey as usize);
        let (dx, dy) = ((x1 - x0).abs(), (y1 - y0).abs());
        let to_line = |a: i64, b: i64, cell: i64| {
            if b >= a {
                ((cell + 1) << DIGITS) - a
            } else {
                a - (cell << DIGITS)
            }
        };
        // Negative while the next grid line is an upright one.
        let mut ahead = to_line(x0, x1, cx) * dy - to_line(y0, y1, cy) * dx;
        let (past_upright, past_level) = (dy << DIGITS, dx << DIGITS);
        let along_x: isize = if x1 >= x0 { 1 } else { -1 };
        let stride = self.stride as isize;
        let along_y = if y1 >= y0 { stride } else { -stride };
        let mut index = (cy as isize + 1) * stride + cx as isize + 1;
        let steps = (ex - cx).abs() + (ey - cy).abs();
        self.bytes[index as usize] = PASSED;
        for _ in 0..steps {
            // Without a branch, which could not be foreseen.
            let upright = ahead >> 63;
            ahead += (past_upright & upright) - (past_level & !upright);
            let upright = upright as isize;
            index += (along_x & upright) | (along_y & !upright);
            self.bytes[index as usize] = PASSED;
        }
    }

    /// The part of a segment on the grid.
    fn clipped(&self, from: Vector2, to: Vector2) -> Option<(Vector2, Vector2)> {
        let size = [self.width as f64, self.height as f64];
        let inside = |p: Vector2| p.x >= 0.0 && p.y >= 0.0 && p.x < size[0] && p.y < size[1];
        if inside(from) && inside(to) {
            return Some((from, to));
        }
        let span = to - from;
        let (enter, leave) = overlap_with_grid(size, from, span)?;
        // Half a 4096th inside the edge: the last cell is on the grid.
        let inset = 0.5 / ONE as f64;
        let at = |t: f64| {
            let p = from + span * t;
            Vector2::new(
                p.x.clamp(0.0, size[0] - inset),
                p.y.clamp(0.0, size[1] - inset),
            )
        };
        Some((at(enter), at(leave)))
    }

    fn widen(&mut self, x: usize, y: usize) {
        let (x, y) = (x.min(self.width - 1), y.min(self.height - 1));
        self.window = Some(match self.window {
            None => [x, x, y, y],
            Some([x0, x1, y0, y1]) => [x0.min(x), x1.max(x), y0.min(y), y1.max(y)],
        });
    }

    /// Hands over the marked cells, row by row from below and left to right, and wipes them out.
    pub(crate) fn take(&mut self, mut visit: impl FnMut(usize, usize, u8)) {
        let Some([x0, x1, y0, y1]) = self.window.take() else {
            return;
        };
        // Rounding may have left a mark in the frame beside the window, never farther out.
        for y in y0..=y1 + 2 {
            let first = y * self.stride + x0;
            let row = &mut self.bytes[first..=first + (x1 - x0) + 2];
            let on_grid = (1..=self.height).contains(&y);
            let mut chunks = row.chunks_exact_mut(8);
            let mut at = x0;
            let mut look = |at: usize, cell: &mut u8| {
                if *cell != 0 {
                    if on_grid && (1..=self.width).contains(&at) {
                        visit(at - 1, y - 1, *cell);
                    }
                    *cell = 0;
                }
            };
            for chunk in &mut chunks {
                // Eight cells that nothing touched are passed over at once.
                if chunk.iter().any(|cell| *cell != 0) {
                    for (k, cell) in chunk.iter_mut().enumerate() {
                        look(at + k, cell);
                    }
                }
                at += 8;
            }
            for (k, cell) in chunks.into_remainder().iter_mut().enumerate() {
                look(at + k, cell);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::{Point2, Pose2};
    use bikebot_world::{Cell, OccupancyGrid};
    use proptest::prelude::*;

    fn taken(marks: &mut Marks) -> Vec<(usize, usize, u8)> {
        let mut cells = Vec::new();
        marks.take(|x, y, mark| cells.push((x, y, mark)));
        cells
    }

    #[test]
    fn level_and_upright_lines_stay_in_their_row_and_column() {
        let mut marks = Marks::new(12, 9);
        // On a grid line, forth and back.
        for (a, b) in [(1.5, 10.5), (10.5, 1.5)] {
            marks.pass(Vector2::new(a, 3.0), Vector2::new(b, 3.0));
            let cells: Vec<_> = (1..=10).map(|x| (x, 3, PASSED)).collect();
            assert_eq!(taken(&mut marks), cells);
            marks.pass(Vector2::new(4.0, a * 0.5), Vector2::new(4.0, b * 0.5));
            let cells: Vec<_> = (0..=5).map(|y| (4, y, PASSED)).collect();
            assert_eq!(taken(&mut marks), cells);
        }
    }

    #[test]
    fn a_hit_outlasts_what_passes_before_it_and_nothing_is_left_behind() {
        let mut marks = Marks::new(5, 5);
        marks.pass(Vector2::new(0.5, 0.5), Vector2::new(3.5, 0.5));
        marks.hit(2, 0);
        marks.hit(7, 0);
        assert_eq!(
            taken(&mut marks),
            [(0, 0, PASSED), (1, 0, PASSED), (2, 0, HIT), (3, 0, PASSED)]
        );
        assert_eq!(taken(&mut marks), []);
        assert!(marks.bytes.iter().all(|b| *b == 0));
    }

    #[test]
    fn lines_off_the_grid_or_of_no_numbers_mark_nothing() {
        let mut marks = Marks::new(5, 5);
        for (a, b) in [
            ((-1.0, 2.0), (-3.0, 2.0)),
            ((0.0, 6.0), (4.0, 6.0)),
            ((f64::NAN, 1.0), (2.0, 2.0)),
            ((1.0, 1.0), (f64::INFINITY, 2.0)),
            ((-1e300, 1.0), (1e300, 1.0)),
        ] {
            marks.pass(Vector2::new(a.0, a.1), Vector2::new(b.0, b.1));
        }
        // The last one has a span without end.
        assert!(marks.bytes.iter().all(|b| *b <= PASSED));
    }

    proptest! {
        /// Against the traversal in floating point of the world's own grid.
        #[test]
        fn a_line_marks_the_cells_it_crosses(
            ax in -6.0..26.0_f64, ay in -6.0..18.0_f64, bx in -6.0..26.0_f64, by in -6.0..18.0_f64,
        ) {
            let (a, b) = (Point2::new(ax, ay), Point2::new(bx, by));
            let grid = OccupancyGrid::filled(20, 12, 1.0, Pose2::new(0.0, 0.0, 0.0), Cell::Free).unwrap();
            let mut marks = Marks::new(20, 12);
            marks.pass(a.coords, b.coords);
            let marked: Vec<_> = taken(&mut marks).into_iter().map(|(x, y, _)| (x, y)).collect();
            prop_assert!(marks.bytes.iter().all(|b| *b == 0), "the frame is wiped too");
            // Where the two differ, the line passes within a 2048th of a corner of the cell.
            let near = |(x, y): (usize, usize)| {
                let d = (b - a).normalize();
                let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
                corners.iter().any(|(i, j)| {
                    let c = Point2::new(x as f64 + i, y as f64 + j) - a;
                    (c.x * d.y - c.y * d.x).abs() < 1.0 / 2048.0
                }) || [a, b].iter().any(|end| {
                    let (u, v) = (end.x - x as f64, end.y - y as f64);
                    [u, v, u - 1.0, v - 1.0].iter().any(|w| w.abs() < 1.0 / 2048.0)
                })
            };
            let exact: Vec<_> = grid.traverse(a, b).collect();
            for cell in &exact {
                prop_assert!(marked.contains(cell) || near(*cell), "{cell:?} is missing");
            }
            for cell in &marked {
                prop_assert!(exact.contains(cell) || near(*cell), "{cell:?} is too much");
            }
        }
    }
}
