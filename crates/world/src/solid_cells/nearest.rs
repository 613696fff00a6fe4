//! The nearest cells of a kind: a descent that leaves out whatever is farther than the best found.

use bikebot_geometry::{Point2, Vector2};

use super::{CellId, SHIFT, SIDE, SolidCells};
use crate::obstacle::Bounds;

/// An axis-aligned rectangle in cell coordinates; a point, if its corners coincide.
#[derive(Debug, Clone, Copy)]
pub(super) struct Around {
    pub(super) min: Vector2,
    pub(super) max: Vector2,
}

impl Around {
    /// The cells of a tile, given its first, that are not farther than `reach` along either axis.
    #[inline]
    pub(super) fn window(&self, reach: f64, x0: usize, y0: usize) -> u64 {
        // Casts saturate: no shift is beyond the word.
        let along = |axis: usize, start: usize| {
            let low = self.min[axis] - reach - start as f64;
            let high = self.max[axis] + reach - start as f64;
            if high < 0.0 {
                return (SIDE, 0);
            }
            (low as usize, (high as usize).min(SIDE - 1))
        };
        let ((first_x, last_x), (first_y, last_y)) = (along(0, x0), along(1, y0));
        if first_x > last_x || first_y > last_y {
            return 0;
        }
        let columns = (0xFF << first_x) & (0xFF >> (SIDE - 1 - last_x));
        let rows = (u64::MAX << (SIDE * first_y)) & (u64::MAX >> (SIDE * (SIDE - 1 - last_y)));
        (columns * 0x0101_0101_0101_0101) & rows
    }

    /// Squared gaps along an axis to `SIDE` neighbouring intervals of length `step`, the first of which begins at `start`.
    #[inline]
    pub(super) fn squared_gaps(&self, axis: usize, start: f64, step: f64) -> [f64; SIDE] {
        let (min, max) = (self.min[axis], self.max[axis]);
        let mut gaps = [0.0; SIDE];
        for (i, gap) in gaps.iter_mut().enumerate() {
            let low = start + step * i as f64;
            let g = (low - max).max(min - (low + step)).max(0.0);
            *gap = g * g;
        }
        gaps
    }
}

/// The best cell so far, and its squared distance in cells².
///
/// Of cells that are equally far the one of the least id is the best, so that the answer does not depend on where a search began.
#[derive(Debug, Clone, Copy)]
pub(super) struct Best {
    pub(super) squared: f64,
    pub(super) cell: CellId,
}

impl Best {
    #[inline]
    pub(super) fn improve(&mut self, squared: f64, cell: CellId) {
        if squared < self.squared || (squared == self.squared && cell.0 < self.cell.0) {
            *self = Self { squared, cell };
        }
    }
}

impl SolidCells {
    /// Improves on `best` with the cells of a kind around a point. A search without a bound would weigh whole nodes against
    /// each other, so wider and wider discs are tried instead.
    pub(super) fn search<const SOLID: bool>(&self, q: Vector2, best: &mut Best) {
        let around = Around { min: q, max: q };
        let mut radius = SIDE as f64;
        while best.squared > radius * radius {
            let widest = (self.width + self.height) as f64
                + (q.x.abs() + q.y.abs()).min(f64::from(u32::MAX));
            if radius > widest {
                break;
            }
            if best.cell.is_cell() {
                // A cell is known already: its distance is a better bound than any guess.
                break;
            }
            let mut trial = Best {
                squared: radius * radius,
                cell: CellId::NONE,
            };
            self.search_within::<SOLID>(&around, &mut trial);
            if trial.cell != CellId::NONE {
                *best = trial;
                return;
            }
            radius *= SIDE as f64;
        }
        self.search_within::<SOLID>(&around, best);
    }

    fn search_within<const SOLID: bool>(&self, around: &Around, best: &mut Best) {
        let mut leaf = |x0: usize, y0: usize, mask: u64, best: &mut Best| {
            nearest_in_tile(around.min, x0, y0, mask, best);
        };
        self.visit::<SOLID>(around, best, &mut leaf);
    }

    /// Calls `leaf` for the tiles that hold cells of a kind nearer than `best`, which it may improve.
    fn visit<const SOLID: bool>(
        &self,
        around: &Around,
        best: &mut Best,
        leaf: &mut impl FnMut(usize, usize, u64, &mut Best),
    ) {
        // A hair more, so that of cells at equal distances none is lost.
        let reach = best.squared.sqrt() * (1.0 + 1e-12) + 1e-9;
        let mut level = 0;
        let mut size = SIDE as f64;
        // A few more tiles are soon looked through; to enter a node costs more.
        let mut most = 2.0 * size;
        while most < reach && level + 1 < self.levels.len() {
            level += 1;
            size *= SIDE as f64;
            most = size;
        }
        let nodes = &self.levels[level];
        let inverse = size.recip();
        // Casts saturate: a window off the grid is empty or clamped, and so is one without bound.
        let first = |min: f64| ((min - reach) * inverse) as usize;
        let end = |max: f64, n: usize| {
            let last = (max + reach) * inverse;
            if last < 0.0 {
                0
            } else {
                n.min((last as usize).saturating_add(1))
            }
        };
        let columns = first(around.min.x)..end(around.max.x, nodes.columns);
        let rows = first(around.min.y)..end(around.max.y, nodes.rows);
        let side = SIDE << (SHIFT * level);
        let gap = |axis: usize, start: usize| {
            let low = start as f64;
            let gap = (low - around.max[axis])
                .max(around.min[axis] - (low + size))
                .max(0.0);
            gap * gap
        };
        for row in rows {
            let rise = gap(1, row * side);
            for column in columns.clone() {
                let mask = nodes.mask::<SOLID>(row * nodes.columns + column);
                if mask == 0 || rise + gap(0, column * side) > best.squared {
                } else if level == 0 {
                    let (x0, y0) = (column * SIDE, row * SIDE);
                    let near = mask & around.window(reach, x0, y0);
                    if near != 0 {
                        leaf(x0, y0, near, best);
                    }
                } else {
                    self.descend::<SOLID>(level, column, row, around, best, leaf);
                }
            }
        }
    }

    fn descend<const SOLID: bool>(
        &self,
        level: usize,
        column: usize,
        row: usize,
        around: &Around,
        best: &mut Best,
        leaf: &mut impl FnMut(usize, usize, u64, &mut Best),
    ) {
        let nodes = &self.levels[level];
        let mask = nodes.mask::<SOLID>(row * nodes.columns + column);
        if mask == 0 {
            return;
        }
        if level == 0 {
            leaf(column * SIDE, row * SIDE, mask, best);
            return;
        }
        let below = &self.levels[level - 1];
        let step = SIDE.pow(level as u32) as f64;
        let dx = around.squared_gaps(0, (column * SIDE) as f64 * step, step);
        let dy = around.squared_gaps(1, (row * SIDE) as f64 * step, step);
        let child = |bit: usize| (column * SIDE + bit % SIDE, row * SIDE + bit / SIDE);
        let mut nearest = (f64::INFINITY, usize::MAX);
        let mut open = 0u64;
        let near_columns = dx.iter().enumerate().fold(0u64, |near, (x, gap)| {
            near | u64::from(*gap <= best.squared) << x
        });
        for (y, gap) in dy.iter().enumerate() {
            if *gap > best.squared {
                continue;
            }
            let mut bits = mask >> (SIDE * y) & near_columns;
            while bits != 0 {
                let x = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                let squared = gap + dx[x];
                if squared <= best.squared {
                    open |= 1 << (SIDE * y + x);
                    if squared < nearest.0 {
                        nearest = (squared, SIDE * y + x);
                    }
                }
            }
        }
        if open == 0 {
            return;
        }
        let mut enter = |bit: usize, best: &mut Best| {
            let (x, y) = child(bit);
            // The bits beyond the edge of the grid, which is free, have no child.
            if x < below.columns && y < below.rows {
                self.descend::<SOLID>(level - 1, x, y, around, best, leaf);
            }
        };
        enter(nearest.1, best);
        open &= !(1 << nearest.1);
        while open != 0 {
            let bit = open.trailing_zeros() as usize;
            open &= open - 1;
            if dx[bit % SIDE] + dy[bit / SIDE] <= best.squared {
                enter(bit, best);
            }
        }
    }

    /// The least of `limit` (m²) and the squared distances (m²) from a convex shape to the solid cells, which `measure` finds:
    /// it is given rectangles of solid cells as rings in the world frame.
    pub(crate) fn least_distance_squared(
        &self,
        vertices: &[Point2],
        limit: f64,
        mut measure: impl FnMut(&[Point2; 4]) -> f64,
    ) -> f64 {
        let local = vertices
            .iter()
            .map(|v| Point2::from(self.frame.to_cells(*v)));
        let Some(b) = Bounds::around(local) else {
            return limit;
        };
        let around = Around {
            min: b.min.coords,
            max: b.max.coords,
        };
        let to_cells = (self.frame.resolution * self.frame.resolution).recip();
        let mut least = limit;
        let mut best = Best {
            squared: limit * to_cells * (1.0 + 1e-9) + 1e-12,
            cell: CellId::NONE,
        };
        let frame = self.frame;
        self.visit::<true>(&around, &mut best, &mut |x0, y0, mask, best| {
            for y in 0..SIDE {
                let mut row = mask >> (SIDE * y) & 0xFF;
                while row != 0 {
                    let first = row.trailing_zeros() as usize;
                    let length = (row >> first).trailing_ones() as usize;
                    row &= !(((1 << length) - 1) << first);
                    let low = Vector2::new((x0 + first) as f64, (y0 + y) as f64);
                    let high = low + Vector2::new(length as f64, 1.0);
                    let gap = |axis: usize| {
                        (low[axis] - around.max[axis])
                            .max(around.min[axis] - high[axis])
                            .max(0.0)
                    };
                    let (gap_x, gap_y) = (gap(0), gap(1));
                    if gap_x * gap_x + gap_y * gap_y >= best.squared {
                        continue;
                    }
                    let squared = measure(&[
                        frame.to_world(low),
                        frame.to_world(Vector2::new(high.x, low.y)),
                        frame.to_world(high),
                        frame.to_world(Vector2::new(low.x, high.y)),
                    ]);
                    if squared < least {
                        least = squared;
                        best.squared = squared * to_cells * (1.0 + 1e-9);
                    }
                }
            }
        });
        least
    }
}

/// Squared distance in cells² from `q` to the square of a cell.
#[inline]
pub(super) fn square_distance_squared(q: Vector2, x: usize, y: usize) -> f64 {
    let (x, y) = (x as f64, y as f64);
    let dx = (x - q.x).max(q.x - (x + 1.0)).max(0.0);
    let dy = (y - q.y).max(q.y - (y + 1.0)).max(0.0);
    dx * dx + dy * dy
}

/// Improves on `best` with the cells of a tile, the rows nearest to `q` first.
#[inline]
fn nearest_in_tile(q: Vector2, x0: usize, y0: usize, mask: u64, best: &mut Best) {
    if mask.count_ones() <= 4 {
        let mut bits = mask;
        while bits != 0 {
            let bit = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let (x, y) = (x0 + bit % SIDE, y0 + bit / SIDE);
            best.improve(square_distance_squared(q, x, y), CellId::new(x, y));
        }
        return;
    }
    let last = (SIDE - 1) as f64;
    let column = (q.x - x0 as f64).clamp(0.0, last) as usize;
    let middle = (q.y - y0 as f64).clamp(0.0, last) as usize;
    let row = |r: usize, best: &mut Best| -> bool {
        let low = (y0 + r) as f64;
        let dy = (low - q.y).max(q.y - (low + 1.0)).max(0.0);
        if dy * dy > best.squared {
            // The rows beyond are farther still.
            return false;
        }
        let byte = mask >> (SIDE * r) & 0xFF;
        let right = byte >> column;
        if right != 0 {
            let (x, y) = (x0 + column + right.trailing_zeros() as usize, y0 + r);
            best.improve(square_distance_squared(q, x, y), CellId::new(x, y));
        }
        let left = byte & ((1 << column) - 1);
        if left != 0 {
            let (x, y) = (x0 + 63 - left.leading_zeros() as usize, y0 + r);
            best.improve(square_distance_squared(q, x, y), CellId::new(x, y));
        }
        true
    };
    for r in middle..SIDE {
        if !row(r, best) {
            break;
        }
    }
    for r in (0..middle).rev() {
        if !row(r, best) {
            break;
        }
    }
}
