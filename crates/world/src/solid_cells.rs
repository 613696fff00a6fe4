//! The solid cells of a grid as bits, and a pyramid over them.
//!
//! A tile is 8 × 8 cells in one word, a bit for each solid cell. A node of the next level is 8 × 8 tiles in two words: which of
//! them hold anything solid, and which hold anything free; and so on until one node holds all. The nearest solid cell of a free
//! point, or the nearest free cell of a solid one, is then a descent that leaves out whatever is farther than the best found,
//! and a ray crosses an empty node in one step. No edge is stored anywhere: 1.03 bits a cell is all there is.

mod level;
mod nearest;
mod sides;

use bikebot_geometry::{Point2, Vector2};

use crate::grid::OccupancyGrid;
use crate::primitive::{block_distance, inverse_direction, slab};
use level::{Level, level_over, solid_bits, write_bit};
use nearest::{Best, square_distance_squared};

/// Cells along the side of a tile, and children along the side of a node.
const SIDE: usize = 1 << SHIFT;

/// log₂ of that.
const SHIFT: usize = 3;

/// Cells looked at between two questions to the stop condition while the bits are gathered: some 0.1 ms.
const CELLS_BETWEEN_STOPS: usize = 1 << 17;

/// Rows of nodes between two such questions while the pyramid is built.
const ROWS_BETWEEN_STOPS: usize = 32;

/// A cell of the grid in one word: column and row, 16 bits each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct CellId(u32);

impl CellId {
    /// No cell at all.
    pub(crate) const NONE: Self = Self(u32::MAX);
    /// What lies beyond the edge of the grid, which is free.
    const OUTSIDE: Self = Self(u32::MAX - 1);

    fn new(x: usize, y: usize) -> Self {
        // A grid has at most 16 384 cells a side.
        Self(x as u32 | (y as u32) << 16)
    }

    fn place(self) -> (usize, usize) {
        ((self.0 & 0xFFFF) as usize, (self.0 >> 16) as usize)
    }

    fn is_cell(self) -> bool {
        self.0 < Self::OUTSIDE.0
    }
}

/// Where the grid lies in the world.
#[derive(Debug, Clone, Copy)]
struct Frame {
    origin: Point2,
    resolution: f64,
    cos: f64,
    sin: f64,
    is_turned: bool,
}

impl Frame {
    /// A vector (m) in the grid's axes.
    #[inline]
    fn turned(&self, v: Vector2) -> Vector2 {
        if self.is_turned {
            Vector2::new(
                self.cos * v.x + self.sin * v.y,
                self.cos * v.y - self.sin * v.x,
            )
        } else {
            v
        }
    }

    /// A point (m) counted in cells from the grid's lower-left corner.
    #[inline]
    fn to_cells(self, p: Point2) -> Vector2 {
        self.turned(p - self.origin) / self.resolution
    }

    fn to_world(self, cells: Vector2) -> Point2 {
        let local = cells * self.resolution;
        if self.is_turned {
            self.origin
                + Vector2::new(
                    self.cos * local.x - self.sin * local.y,
                    self.sin * local.x + self.cos * local.y,
                )
        } else {
            self.origin + local
        }
    }
}

/// All solid cells of a grid.
#[derive(Debug, Clone)]
pub(crate) struct SolidCells {
    width: usize,
    height: usize,
    frame: Frame,
    /// Tiles first, the single node that holds all last.
    levels: Vec<Level>,
}

impl SolidCells {
    /// Gathers the bits of a grid; `None` if `stop` said so before it was done.
    pub(crate) fn new(grid: &OccupancyGrid, stop: &dyn Fn() -> bool) -> Option<Self> {
        let (sin, cos) = grid.origin.heading.sin_cos();
        let columns = grid.width.div_ceil(SIDE);
        let mut tiles = Level {
            columns,
            rows: grid.height.div_ceil(SIDE),
            solid: Vec::with_capacity(columns * grid.height.div_ceil(SIDE)),
            free: Vec::new(),
        };
        let mut since_stop = 0;
        for rows in grid.cells.chunks(grid.width * SIDE) {
            if since_stop >= CELLS_BETWEEN_STOPS {
                since_stop = 0;
                if stop() {
                    return None;
                }
            }
            since_stop += rows.len();
            let first = tiles.solid.len();
            tiles.solid.resize(first + columns, 0);
            let words = &mut tiles.solid[first..];
            for (y, row) in rows.chunks(grid.width).enumerate() {
                let mut eights = row.chunks_exact(SIDE);
                for (word, eight) in words.iter_mut().zip(&mut eights) {
                    *word |= solid_bits(eight) << (SIDE * y);
                }
                if let (Some(word), rest @ [_, ..]) = (words.last_mut(), eights.remainder()) {
                    *word |= solid_bits(rest) << (SIDE * y);
                }
            }
        }
        let mut levels = vec![tiles];
        while let Some(below) = levels.last()
            && below.solid.len() > 1
        {
            let level = level_over(below, stop)?;
            levels.push(level);
        }
        Some(Self {
            width: grid.width,
            height: grid.height,
            frame: Frame {
                origin: grid.origin.position,
                resolution: grid.resolution,
                cos,
                sin,
                is_turned: grid.origin.heading != 0.0,
            },
            levels,
        })
    }

    /// Writes one cell, which must lie on the grid.
    pub(crate) fn set(&mut self, x: usize, y: usize, is_solid: bool) {
        let (mut column, mut row) = (x, y);
        let (mut any_solid, mut any_free) = (is_solid, !is_solid);
        for level in &mut self.levels {
            let bit = 1u64 << (row % SIDE * SIDE + column % SIDE);
            (column, row) = (column / SIDE, row / SIDE);
            let index = row * level.columns + column;
            write_bit(&mut level.solid[index], bit, any_solid);
            any_solid = level.solid[index] != 0;
            any_free = if let Some(free) = level.free.get_mut(index) {
                write_bit(free, bit, any_free);
                *free != 0
            } else {
                level.solid[index] != u64::MAX
            };
        }
    }

    /// Bytes held on the heap.
    pub(crate) fn bytes(&self) -> usize {
        let words = |level: &Level| level.solid.capacity() + level.free.capacity();
        self.levels.iter().map(words).sum::<usize>() * size_of::<u64>()
    }

    /// Side of a cell, m.
    pub(crate) fn resolution(&self) -> f64 {
        self.frame.resolution
    }

    /// Rows of the grid.
    pub(crate) fn height(&self) -> usize {
        self.height
    }

    /// Calls `found` with the first and one past the last column of each run of free cells in a row, left to right.
    pub(crate) fn free_runs(&self, y: usize, mut found: impl FnMut(u32, u32)) {
        let tiles = &self.levels[0];
        let row = &tiles.solid[y / SIDE * tiles.columns..][..tiles.columns];
        let shift = y % SIDE * SIDE;
        let mut begun = None;
        for (word, eight) in row.chunks(SIDE).enumerate() {
            let solid = eight.iter().enumerate().fold(0u64, |bits, (i, tile)| {
                bits | (tile >> shift & 0xFF) << (SIDE * i)
            });
            // Ends of runs, of either kind, one after the other.
            let base = word as u32 * u64::BITS;
            let mut x = 0;
            while x < u64::BITS {
                let rest = solid >> x;
                match begun {
                    None => {
                        x += rest.trailing_ones();
                        if x < u64::BITS {
                            begun = Some(base + x);
                        }
                    }
                    Some(start) if rest != 0 => {
                        x += rest.trailing_zeros();
                        found(start, base + x);
                        begun = None;
                    }
                    Some(_) => break,
                }
            }
        }
        let width = self.width as u32;
        if let Some(start) = begun
            && start < width
        {
            found(start, width);
        }
    }

    /// Column and row of the cell that holds `p` (m), if it is a free one.
    pub(crate) fn free_cell(&self, p: Point2) -> Option<(usize, usize)> {
        self.locate(self.frame.to_cells(p))
            .filter(|(x, y)| !self.is_solid(*x, *y))
    }

    /// Whether the cell in that column and row is solid; off the grid nothing is.
    #[inline]
    pub(crate) fn is_solid(&self, x: usize, y: usize) -> bool {
        x < self.width && y < self.height && {
            let tile = self.levels[0].solid[y / SIDE * self.levels[0].columns + x / SIDE];
            tile >> (y % SIDE * SIDE + x % SIDE) & 1 == 1
        }
    }

    /// The cell that holds a point given in cell coordinates.
    #[inline]
    fn locate(&self, q: Vector2) -> Option<(usize, usize)> {
        let inside =
            q.x >= 0.0 && q.y >= 0.0 && q.x < self.width as f64 && q.y < self.height as f64;
        inside.then_some((q.x as usize, q.y as usize))
    }

    /// Whether `p` (m) lies in a solid cell.
    #[inline]
    pub(crate) fn contains(&self, p: Point2) -> bool {
        self.locate(self.frame.to_cells(p))
            .is_some_and(|(x, y)| self.is_solid(x, y))
    }

    /// The signed distance (m) from `p` to the boundary of the solid, negative inside, and the cell that decides it: the
    /// nearest of the other kind. From outside the answer is the smaller of that and `limit` (m), without a cell if it is the
    /// limit.
    ///
    /// `hint` may be any cell; one that is near the answer saves most of the search.
    pub(crate) fn signed_distance(&self, p: Point2, limit: f64, hint: CellId) -> (f64, CellId) {
        let q = self.frame.to_cells(p);
        let is_solid = self.locate(q).is_some_and(|(x, y)| self.is_solid(x, y));
        let mut best = if is_solid {
            let (w, h) = (self.width as f64, self.height as f64);
            let out = q.x.min(q.y).min(w - q.x).min(h - q.y);
            Best {
                squared: out * out,
                cell: CellId::OUTSIDE,
            }
        } else {
            // Rounding must not lose a cell that is at the limit to the last bit.
            let cells = limit.max(0.0) / self.frame.resolution * (1.0 + 1e-12) + 1e-12;
            Best {
                squared: cells * cells,
                cell: CellId::NONE,
            }
        };
        if hint.is_cell() {
            let (x, y) = hint.place();
            if self.is_solid(x, y) != is_solid {
                best.improve(square_distance_squared(q, x, y), hint);
            }
        }
        if is_solid {
            self.search::<false>(q, &mut best);
            (-self.distance_to(p, q, best.cell), best.cell)
        } else {
            if limit > 0.0 {
                self.search::<true>(q, &mut best);
            }
            if best.cell == CellId::NONE {
                return (limit, CellId::NONE);
            }
            let distance = self.distance_to(p, q, best.cell);
            if distance < limit {
                (distance, best.cell)
            } else {
                (limit, CellId::NONE)
            }
        }
    }

    /// Distance (m) from `p`, in cell coordinates `q`, to a cell's square or to what lies beyond the grid.
    #[inline]
    fn distance_to(&self, p: Point2, q: Vector2, cell: CellId) -> f64 {
        let Frame {
            origin,
            resolution,
            is_turned,
            ..
        } = self.frame;
        if cell == CellId::OUTSIDE {
            let (w, h) = (self.width as f64, self.height as f64);
            return if is_turned {
                q.x.min(q.y).min(w - q.x).min(h - q.y) * resolution
            } else {
                let max = origin + Vector2::new(w, h) * resolution;
                -block_distance(origin, max, p)
            }
            .max(0.0);
        }
        let (x, y) = cell.place();
        if is_turned {
            return square_distance_squared(q, x, y).sqrt() * resolution;
        }
        // Lines between cells lie at origin + k · resolution to the last bit, and a point on one is at distance 0.
        let low = |o: f64, k: usize| o + k as f64 * resolution;
        let dx = (low(origin.x, x) - p.x)
            .max(p.x - low(origin.x, x + 1))
            .max(0.0);
        let dy = (low(origin.y, y) - p.y)
            .max(p.y - low(origin.y, y + 1))
            .max(0.0);
        if dx > 0.0 && dy > 0.0 {
            (dx * dx + dy * dy).sqrt()
        } else {
            dx.max(dy)
        }
    }

    /// The point (m) of the solid's boundary nearest to `p`, as `cell` from [`SolidCells::signed_distance`] decides it.
    pub(crate) fn nearest_point(&self, p: Point2, cell: CellId) -> Point2 {
        let q = self.frame.to_cells(p);
        if cell == CellId::NONE {
            return p;
        }
        if cell == CellId::OUTSIDE {
            let edge = crate::primitive::Primitive::Block {
                min: Point2::origin(),
                max: Point2::new(self.width as f64, self.height as f64),
            };
            let nearest = edge.nearest_boundary_point(Point2::from(q));
            return self.frame.to_world(nearest.coords);
        }
        let (x, y) = cell.place();
        let (x, y) = (x as f64, y as f64);
        self.frame
            .to_world(Vector2::new(q.x.clamp(x, x + 1.0), q.y.clamp(y, y + 1.0)))
    }

    /// Distance (m) along the unit vector `direction` to the first solid cell, if below `limit` (m).
    pub(crate) fn cast_ray(&self, origin: Point2, direction: Vector2, limit: f64) -> Option<f64> {
        let q = self.frame.to_cells(origin);
        let d = self.frame.turned(direction);
        let inverse = inverse_direction(d);
        let size = [self.width, self.height];
        let far = Point2::new(self.width as f64, self.height as f64);
        let (enter, leave) = slab(Point2::origin(), far, Point2::from(q), inverse);
        let mut t = enter.max(0.0);
        let last = leave.min(limit / self.frame.resolution);
        if !(enter <= leave && t < last) {
            return None;
        }
        // A cast saturates at 0, which is where a ray that begins on the edge begins.
        let at = |t: f64, axis: usize| ((q[axis] + d[axis] * t) as usize).min(size[axis] - 1);
        let mut cell = [at(t, 0), at(t, 1)];
        let tiles = &self.levels[0];
        loop {
            let [x, y] = cell;
            // The largest node around this cell with nothing in it is crossed at once; its side is a power of 2.
            let mut shift = 0;
            let tile = tiles.solid[y / SIDE * tiles.columns + x / SIDE];
            if tile == 0 {
                shift = SHIFT;
                for level in &self.levels[1..] {
                    let wider = shift + SHIFT;
                    if level.solid[(y >> wider) * level.columns + (x >> wider)] != 0 {
                        break;
                    }
                    shift = wider;
                }
            } else if tile >> (y % SIDE * SIDE + x % SIDE) & 1 == 1 {
                let distance = t * self.frame.resolution;
                return (distance < limit).then_some(distance);
            }
            // Where the ray leaves that square.
            let mut exit = [f64::INFINITY; 2];
            for axis in 0..2 {
                if d[axis] != 0.0 {
                    let index = cell[axis] >> shift;
                    let line = (index + usize::from(d[axis] > 0.0)) << shift;
                    exit[axis] = (line as f64 - q[axis]) * inverse[axis];
                }
            }
            let (axis, other) = if exit[0] <= exit[1] { (0, 1) } else { (1, 0) };
            t = exit[axis].max(t);
            if t >= last {
                return None;
            }
            let low = cell[axis] >> shift << shift;
            cell[axis] = if d[axis] > 0.0 {
                low + (1 << shift)
            } else {
                low.checked_sub(1)?
            };
            if cell[axis] >= size[axis] {
                return None;
            }
            if shift > 0 {
                let low = cell[other] >> shift << shift;
                let end = (low + (1 << shift)).min(size[other]) - 1;
                // It neither leaves the square through the other side nor turns back.
                let (least, most) = if d[other] >= 0.0 {
                    (cell[other], end)
                } else {
                    (low, cell[other])
                };
                cell[other] = at(t, other).clamp(least, most);
            }
        }
    }
}

#[cfg(test)]
mod tests;
