//! The solid cells of a grid as bits, and a pyramid over them.
//!
//! A tile is 8 × 8 cells in one word, a bit for each solid cell. A node of the next level is 8 × 8 tiles in two words: which of
//! them hold anything solid, and which hold anything free; and so on until one node holds all. The nearest solid cell of a free
//! point, or the nearest free cell of a solid one, is then a descent that leaves out whatever is farther than the best found,
//! and a ray crosses an empty node in one step. No edge is stored anywhere: 1.03 bits a cell is all there is.

mod sides;

use bikebot_geometry::{Point2, Vector2};

use crate::grid::{Cell, OccupancyGrid};
use crate::obstacle::Bounds;
use crate::primitive::{block_distance, inverse_direction, slab};

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

/// One level of the pyramid: 64 bits for each node, row by row.
#[derive(Debug, Clone)]
struct Level {
    columns: usize,
    rows: usize,
    /// Which children hold anything solid. For a tile: which cells are solid.
    solid: Vec<u64>,
    /// Which children hold anything free; empty for tiles, whose free cells are those that are not solid.
    free: Vec<u64>,
}

impl Level {
    #[inline]
    fn mask<const SOLID: bool>(&self, index: usize) -> u64 {
        if SOLID {
            self.solid[index]
        } else if self.free.is_empty() {
            !self.solid[index]
        } else {
            self.free[index]
        }
    }
}

/// An axis-aligned rectangle in cell coordinates; a point, if its corners coincide.
#[derive(Debug, Clone, Copy)]
struct Around {
    min: Vector2,
    max: Vector2,
}

impl Around {
    /// The cells of a tile, given its first, that are not farther than `reach` along either axis.
    #[inline]
    fn window(&self, reach: f64, x0: usize, y0: usize) -> u64 {
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
    fn squared_gaps(&self, axis: usize, start: f64, step: f64) -> [f64; SIDE] {
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
struct Best {
    squared: f64,
    cell: CellId,
}

impl Best {
    #[inline]
    fn improve(&mut self, squared: f64, cell: CellId) {
        if squared < self.squared || (squared == self.squared && cell.0 < self.cell.0) {
            *self = Self { squared, cell };
        }
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

    /// Improves on `best` with the cells of a kind around a point. A search without a bound would weigh whole nodes against
    /// each other, so wider and wider discs are tried instead.
    fn search<const SOLID: bool>(&self, q: Vector2, best: &mut Best) {
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

#[inline]
fn solid_bits(cells: &[Cell]) -> u64 {
    cells
        .iter()
        .enumerate()
        .fold(0, |bits, (i, c)| bits | u64::from(*c != Cell::Free) << i)
}

fn write_bit(word: &mut u64, bit: u64, value: bool) {
    if value {
        *word |= bit;
    } else {
        *word &= !bit;
    }
}

fn level_over(below: &Level, stop: &dyn Fn() -> bool) -> Option<Level> {
    let (columns, rows) = (below.columns.div_ceil(SIDE), below.rows.div_ceil(SIDE));
    let mut level = Level {
        columns,
        rows,
        solid: vec![0; columns * rows],
        free: vec![0; columns * rows],
    };
    for row in 0..below.rows {
        if row % ROWS_BETWEEN_STOPS == 0 && stop() {
            return None;
        }
        for column in 0..below.columns {
            let child = row * below.columns + column;
            let index = row / SIDE * columns + column / SIDE;
            let bit = row % SIDE * SIDE + column % SIDE;
            level.solid[index] |= u64::from(below.mask::<true>(child) != 0) << bit;
            level.free[index] |= u64::from(below.mask::<false>(child) != 0) << bit;
        }
    }
    Some(level)
}

/// Squared distance in cells² from `q` to the square of a cell.
#[inline]
fn square_distance_squared(q: Vector2, x: usize, y: usize) -> f64 {
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

#[cfg(test)]
mod tests;
