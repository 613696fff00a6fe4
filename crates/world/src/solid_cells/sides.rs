//! The sides of the solid, found tile by tile when asked for.

use bikebot_geometry::{Point2, Vector2};

use super::{SIDE, SolidCells};
use crate::boundary::BoundaryPiece;
use crate::obstacle::Bounds;

/// A side's number is that of the cell it begins at, times four, plus one of these: below the cell and so on counter-clockwise,
/// which is also the order in which the boundary of a single cell is gone round.
const BELOW: u32 = 0;
const RIGHT: u32 = 1;
const ABOVE: u32 = 2;
const LEFT: u32 = 3;

/// The bits of the first column of a tile.
const FIRST_COLUMN: u64 = 0x0101_0101_0101_0101;

impl SolidCells {
    /// Calls `visit` with the sides between solid and free cells, the solid on their left, in straight pieces no longer than a tile,
    /// until it returns false; and passes over the nodes whose box (m) `keep` does not hold for. Sides on the edge of the grid
    /// are among them.
    pub(crate) fn visit_sides(
        &self,
        keep: &mut impl FnMut(&Bounds) -> bool,
        visit: &mut impl FnMut(u32, BoundaryPiece) -> bool,
    ) -> bool {
        self.descend_to_sides(self.levels.len() - 1, 0, 0, keep, visit)
    }

    /// The direction in which the boundary arrives at the convex corner where a side begins.
    pub(crate) fn direction_before_side(&self, number: u32) -> Vector2 {
        let along = match number % 4 {
            BELOW => -Vector2::y(),
            RIGHT => Vector2::x(),
            ABOVE => Vector2::y(),
            _ => -Vector2::x(),
        };
        self.frame.to_world(along) - self.frame.origin
    }

    fn descend_to_sides(
        &self,
        level: usize,
        column: usize,
        row: usize,
        keep: &mut impl FnMut(&Bounds) -> bool,
        visit: &mut impl FnMut(u32, BoundaryPiece) -> bool,
    ) -> bool {
        let nodes = &self.levels[level];
        let solid = nodes.solid[row * nodes.columns + column];
        if solid == 0 || self.is_buried(level, column, row) {
            return true;
        }
        let size = (SIDE << (super::SHIFT * level)) as f64;
        let low = Vector2::new(column as f64 * size, row as f64 * size);
        if !keep(&self.box_around(low, low + Vector2::repeat(size))) {
            return true;
        }
        if level == 0 {
            return self.sides_of_tile(column, row, solid, visit);
        }
        let mut bits = solid;
        while bits != 0 {
            let bit = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let (x, y) = (column * SIDE + bit % SIDE, row * SIDE + bit / SIDE);
            if !self.descend_to_sides(level - 1, x, y, keep, visit) {
                return false;
            }
        }
        true
    }

    /// Whether neither a node nor its neighbours hold anything free. What lies beyond the grid does not count.
    fn is_buried(&self, level: usize, column: usize, row: usize) -> bool {
        let nodes = &self.levels[level];
        let is_full = |x: usize, y: usize| {
            x >= nodes.columns || y >= nodes.rows || nodes.mask::<false>(y * nodes.columns + x) == 0
        };
        is_full(column, row)
            && is_full(column.wrapping_sub(1), row)
            && is_full(column + 1, row)
            && is_full(column, row.wrapping_sub(1))
            && is_full(column, row + 1)
    }

    fn box_around(&self, low: Vector2, high: Vector2) -> Bounds {
        let (a, b) = (self.frame.to_world(low), self.frame.to_world(high));
        if !self.frame.is_turned {
            return Bounds { min: a, max: b };
        }
        let c = self.frame.to_world(Vector2::new(high.x, low.y));
        let d = self.frame.to_world(Vector2::new(low.x, high.y));
        Bounds {
            min: a.inf(&b).inf(&c).inf(&d),
            max: a.sup(&b).sup(&c).sup(&d),
        }
    }

    fn tile(&self, column: usize, row: usize) -> u64 {
        let tiles = &self.levels[0];
        if column < tiles.columns && row < tiles.rows {
            tiles.solid[row * tiles.columns + column]
        } else {
            0
        }
    }

    fn sides_of_tile(
        &self,
        column: usize,
        row: usize,
        solid: u64,
        visit: &mut impl FnMut(u32, BoundaryPiece) -> bool,
    ) -> bool {
        let last = SIDE - 1;
        let top_row = SIDE * last;
        let below = solid << SIDE | self.tile(column, row.wrapping_sub(1)) >> top_row;
        let above = solid >> SIDE | self.tile(column, row + 1) << top_row;
        let left = (solid & !(FIRST_COLUMN << last)) << 1
            | self.tile(column.wrapping_sub(1), row) >> last & FIRST_COLUMN;
        let right =
            (solid & !FIRST_COLUMN) >> 1 | (self.tile(column + 1, row) & FIRST_COLUMN) << last;
        let (x0, y0) = (column * SIDE, row * SIDE);
        let vertex = |x: usize, y: usize| self.frame.to_world(Vector2::new(x as f64, y as f64));
        let mut side = |place: u32, first: (usize, usize), before: bool, ends: [Point2; 2]| {
            let cell = (first.1 * self.width + first.0) as u32;
            let piece = BoundaryPiece::Side {
                start: ends[0],
                end: ends[1],
                begins_convex: !before,
            };
            visit(cell * 4 + place, piece)
        };
        for (place, bare) in [(BELOW, solid & !below), (ABOVE, solid & !above)] {
            for y in 0..SIDE {
                let mut bits = bare >> (SIDE * y) & 0xFF;
                while bits != 0 {
                    let from = bits.trailing_zeros() as usize;
                    let length = (bits >> from).trailing_ones() as usize;
                    bits &= !(((1 << length) - 1) << from);
                    let (a, b, y) = (x0 + from, x0 + from + length, y0 + y);
                    let goes_on = if place == BELOW {
                        let before = self.is_solid(a.wrapping_sub(1), y);
                        side(place, (a, y), before, [vertex(a, y), vertex(b, y)])
                    } else {
                        let before = self.is_solid(b, y);
                        let ends = [vertex(b, y + 1), vertex(a, y + 1)];
                        side(place, (b - 1, y), before, ends)
                    };
                    if !goes_on {
                        return false;
                    }
                }
            }
        }
        for (place, bare) in [(RIGHT, solid & !right), (LEFT, solid & !left)] {
            for x in 0..SIDE {
                let line = bare >> x & FIRST_COLUMN;
                let mut y = 0;
                while line >> (SIDE * y) != 0 {
                    y += (line >> (SIDE * y)).trailing_zeros() as usize / SIDE;
                    let from = y;
                    while y < SIDE && line >> (SIDE * y) & 1 == 1 {
                        y += 1;
                    }
                    let (x, a, b) = (x0 + x, y0 + from, y0 + y);
                    let goes_on = if place == RIGHT {
                        let before = self.is_solid(x, a.wrapping_sub(1));
                        let ends = [vertex(x + 1, a), vertex(x + 1, b)];
                        side(place, (x, a), before, ends)
                    } else {
                        let before = self.is_solid(x, b);
                        side(place, (x, b - 1), before, [vertex(x, b), vertex(x, a)])
                    };
                    if !goes_on {
                        return false;
                    }
                    if y == SIDE {
                        break;
                    }
                }
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Cell, OccupancyGrid};
    use bikebot_geometry::Pose2;

    /// Unit sides, by twice their middles and the direction, with the corners that begin convex.
    type Units = Vec<(i64, i64, i64, i64, bool)>;

    fn push_units(units: &mut Units, start: Point2, end: Point2, begins_convex: bool) {
        let length = (end - start).norm().round();
        let along = (end - start) / length;
        for k in 0..length as usize {
            let middle = start + along * (k as f64 + 0.5);
            let twice = |v: f64| (2.0 * v).round() as i64;
            units.push((
                twice(middle.x),
                twice(middle.y),
                twice(along.x),
                twice(along.y),
                k == 0 && begins_convex,
            ));
        }
    }

    #[test]
    fn the_sides_are_those_of_the_boundary_and_begin_at_the_same_corners() {
        for (width, height, share) in [(8, 8, 2), (30, 17, 2), (65, 70, 6), (70, 9, 40)] {
            // Multiplied by an odd number the upper bits of a counter are as good as chance.
            let hash = |i: usize| (i as u64 + 7).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
            let cells = (0..width * height)
                .map(|i| match hash(i * i) % share {
                    0 => Cell::Free,
                    _ => Cell::Occupied,
                })
                .collect();
            let origin = Pose2::new(0.0, 0.0, 0.0);
            let grid = OccupancyGrid::new(width, height, 1.0, origin, cells).unwrap();
            let solid = SolidCells::new(&grid, &|| false).unwrap();
            let (mut found, mut expected) = (Units::new(), Units::new());
            let mut numbers = Vec::new();
            solid.visit_sides(&mut |_| true, &mut |number, piece| {
                let BoundaryPiece::Side {
                    start,
                    end,
                    begins_convex,
                } = piece
                else {
                    panic!("cells have sides only");
                };
                push_units(&mut found, start, end, begins_convex);
                numbers.push(number);
                // A right angle, turning left.
                let before = solid.direction_before_side(number);
                assert!(before.perp(&(end - start)) > 0.0 && before.dot(&(end - start)) == 0.0);
                true
            });
            for edge in grid.boundary(0) {
                push_units(&mut expected, edge.start, edge.end(), edge.begins_convex());
            }
            found.sort_unstable();
            expected.sort_unstable();
            // Where the grid ends everything else may be buried; within it nothing may be missing.
            let within = |u: &(i64, i64, i64, i64, bool)| {
                u.0 > 0 && u.1 > 0 && u.0 < 2 * width as i64 && u.1 < 2 * height as i64
            };
            found.retain(within);
            expected.retain(within);
            assert_eq!(found, expected);
            numbers.sort_unstable();
            numbers.dedup();
            assert!(!numbers.is_empty());
        }
    }
}
