//! The clearance of a point from a grid of candidates, built block by block when asked for.
//!
//! Each cell keeps the exact clearance d_c of its centre c and the few primitives that can be
//! nearest to any of its points. Clearance changes by no more than the way travelled, so with h
//! the half diagonal of the cell, and for every point p in it:
//!
//! * d_c − |p − c| is a lower bound, for nothing more than finding the cell;
//! * what is nearest to p lies within |d_c| + 2h of c: those are the candidates, and the least
//!   of their distances *is* the clearance.
//!
//! The solid cells of an occupancy grid are in no list. There a cell keeps the one that is nearest
//! to its centre, which bounds the search for the one that is nearest to p.
//!
//! A block of cells is filled at once ([`crate::clearance_block`]), by whichever thread comes
//! first, from the scene alone. Its content, and with it every answer, does not depend on which
//! thread that was or on what was asked before.

use std::sync::{Arc, OnceLock};

use bikebot_geometry::Point2;

use crate::clearance_block::{Block, CellData};
use crate::field_edge::FieldEdge;
use crate::obstacle::Bounds;
use crate::primitive::Primitive;
use crate::query::{Decider, Scene};

/// Cells of a field with few obstacles: 1 m cells on a 100 m field.
const LEAST_CELLS: f64 = 10_000.0;

/// Cells at most; at 16 bytes each they are allocated in blocks as they are touched.
const MOST_CELLS: f64 = (1 << 20) as f64;

/// Cells per primitive in between: lists then stay near ten entries on evenly cluttered ground.
const CELLS_PER_PRIMITIVE: f64 = 25.0;

/// Cells along the side of a block, the unit of filling.
pub(crate) const BLOCK: usize = 16;

/// Where the cells of a clearance field lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Layout {
    min: Point2,
    /// Side of a cell, m.
    pub(crate) size: f64,
    inverse_size: f64,
    pub(crate) columns: usize,
    pub(crate) rows: usize,
    block_columns: usize,
    /// h, m.
    pub(crate) half_diagonal: f64,
}

impl Layout {
    /// Cells for a field with so many primitives, and a grid of cells with the side `resolution` (m).
    ///
    /// Sizes go in steps, so that a few obstacles more or less leave the cells where they are. Over a grid they are its own
    /// cells doubled or halved.
    fn new(bounds: &Bounds, primitives: usize, resolution: Option<f64>) -> Self {
        let (width, height) = (bounds.width(), bounds.height());
        let longer = width.max(height);
        let of_primitives =
            (primitives as f64 * CELLS_PER_PRIMITIVE).clamp(LEAST_CELLS, MOST_CELLS);
        // Square cells by area; a very slender field is bounded by its length instead.
        let size_for =
            |cells: f64| (width.sqrt() * height.sqrt() / cells.sqrt()).max(longer / cells);
        let size = match resolution {
            None => {
                let halves = (2.0 * (of_primitives / LEAST_CELLS).log2()).round();
                size_for((LEAST_CELLS * (0.5 * halves).exp2()).min(MOST_CELLS))
            }
            Some(resolution) => {
                let of_grid = width / resolution * (height / resolution);
                // The hair less: as many cells as there may be are still that many after rounding.
                let least = size_for(of_grid.clamp(of_primitives, MOST_CELLS)) * (1.0 - 1e-9);
                resolution * (least / resolution).log2().ceil().exp2()
            }
        };
        let count = |extent: f64| ((extent / size - 1e-9).ceil().max(1.0)) as usize;
        let (columns, rows) = (count(width), count(height));
        Self {
            min: bounds.min,
            size,
            inverse_size: size.recip(),
            columns,
            rows,
            block_columns: columns.div_ceil(BLOCK),
            half_diagonal: size * std::f64::consts::FRAC_1_SQRT_2,
        }
    }

    fn blocks(&self) -> usize {
        self.block_columns * self.rows.div_ceil(BLOCK)
    }

    /// Column and row of the first cell of a block.
    pub(crate) fn block_origin(&self, block: usize) -> (usize, usize) {
        (
            block % self.block_columns * BLOCK,
            block / self.block_columns * BLOCK,
        )
    }

    /// Centre (m) of a square of `side` cells whose first is given.
    pub(crate) fn square_centre(&self, column: usize, row: usize, side: usize) -> Point2 {
        let half = 0.5 * side as f64;
        Point2::new(
            self.min.x + (column as f64 + half) * self.size,
            self.min.y + (row as f64 + half) * self.size,
        )
    }

    #[inline]
    pub(crate) fn centre(&self, column: usize, row: usize) -> Point2 {
        self.square_centre(column, row, 1)
    }

    /// Column and row of the cell that holds `p`; `None` off the field or for NaN.
    #[inline]
    pub(crate) fn locate(&self, p: Point2) -> Option<(usize, usize)> {
        let x = (p.x - self.min.x) * self.inverse_size;
        let y = (p.y - self.min.y) * self.inverse_size;
        let inside = x >= 0.0 && y >= 0.0 && x < self.columns as f64 && y < self.rows as f64;
        inside.then_some((x as usize, y as usize))
    }
}

#[derive(Debug)]
pub(crate) struct ClearanceField {
    layout: Layout,
    blocks: Box<[OnceLock<Arc<Block>>]>,
}

impl ClearanceField {
    pub(crate) fn new(bounds: &Bounds, scene: &Scene) -> Self {
        let resolution = scene.solid_cells().map(|cells| cells.resolution());
        let layout = Layout::new(bounds, scene.live_primitives(), resolution);
        Self {
            layout,
            blocks: (0..layout.blocks()).map(|_| OnceLock::new()).collect(),
        }
    }

    /// The field of a scene that differs from this one's only within `changed`, with every block that cannot have changed:
    /// the content of a cell depends on nothing farther from its centre than |d_c| + 2h.
    pub(crate) fn with_changes(&self, bounds: &Bounds, scene: &Scene, changed: &[Bounds]) -> Self {
        let new = Self::new(bounds, scene);
        if new.layout != self.layout {
            return new;
        }
        for (index, (old, new)) in self.blocks.iter().zip(&new.blocks).enumerate() {
            if let Some(block) = old.get()
                && !block.is_touched(&self.layout, index, changed)
            {
                // The lock is fresh: nothing is refused.
                let _ = new.set(Arc::clone(block));
            }
        }
        new
    }

    pub(crate) fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Fills the blocks nobody has asked for yet; false if `stop` said so before all were.
    pub(crate) fn fill(&self, scene: &Scene, edge: &FieldEdge, stop: &dyn Fn() -> bool) -> bool {
        for index in 0..self.blocks.len() {
            if self.blocks[index].get().is_none() {
                if stop() {
                    return false;
                }
                self.block(scene, edge, index);
            }
        }
        true
    }

    /// Cells filled so far.
    pub(crate) fn filled_cells(&self) -> usize {
        let filled = self.blocks.iter().filter(|b| b.get().is_some()).count();
        filled * BLOCK * BLOCK
    }

    /// Bytes held on the heap.
    pub(crate) fn bytes(&self) -> usize {
        let of_blocks: usize = self
            .blocks
            .iter()
            .filter_map(|b| b.get())
            .map(|b| b.bytes())
            .sum();
        of_blocks + self.blocks.len() * size_of::<OnceLock<Arc<Block>>>()
    }

    #[inline]
    fn block(&self, scene: &Scene, edge: &FieldEdge, index: usize) -> &Block {
        self.blocks[index].get_or_init(|| Arc::new(Block::fill(&self.layout, scene, edge, index)))
    }

    #[inline]
    fn cell(&self, scene: &Scene, edge: &FieldEdge, column: usize, row: usize) -> (&Block, usize) {
        let index = row / BLOCK * self.layout.block_columns + column / BLOCK;
        let cell = row % BLOCK * BLOCK + column % BLOCK;
        (self.block(scene, edge, index), cell)
    }

    /// The exact clearance (m) of a cell's centre.
    pub(crate) fn centre_clearance(
        &self,
        scene: &Scene,
        edge: &FieldEdge,
        column: usize,
        row: usize,
    ) -> f64 {
        let (block, cell) = self.cell(scene, edge, column, row);
        block.cells[cell].centre_clearance
    }

    /// A number (m) not above the clearance of `p`.
    #[inline]
    pub(crate) fn lower_bound(&self, scene: &Scene, edge: &FieldEdge, p: Point2) -> f64 {
        let Some((column, row)) = self.layout.locate(p) else {
            return exact_without_field(scene, edge, p).0;
        };
        let d = self.centre_clearance(scene, edge, column, row);
        let way = (p - self.layout.centre(column, row)).norm();
        // The second term outweighs the rounding of d and of the distances it stands for.
        d - way - 1e-12 * (1.0 + d.abs())
    }

    /// The exact clearance (m) of `p`.
    #[inline]
    pub(crate) fn clearance(&self, scene: &Scene, edge: &FieldEdge, p: Point2) -> f64 {
        self.nearest(scene, edge, p).0
    }

    /// The exact clearance (m) of `p`, and what decides it; the limit is the field's edge.
    #[inline]
    pub(crate) fn nearest(&self, scene: &Scene, edge: &FieldEdge, p: Point2) -> (f64, Decider) {
        let Some((column, row)) = self.layout.locate(p) else {
            return exact_without_field(scene, edge, p);
        };
        let (block, index) = self.cell(scene, edge, column, row);
        let cell = &block.cells[index];
        let to_edge = edge.distance(p);
        let mut best = if cell.is_signed() {
            self.nearest_signed(block, cell, scene.primitives(), p, to_edge)
        } else {
            let way = (p - self.layout.centre(column, row)).norm();
            let mut best = (to_edge, Decider::Limit);
            for candidate in block.candidates(cell) {
                if f64::from(candidate.from_centre) - way >= best.0 {
                    break;
                }
                let distance = scene.primitives()[candidate.index as usize].distance(p);
                if distance < best.0 {
                    best = (distance, Decider::Primitive(candidate.index));
                }
            }
            best
        };
        if let Some(cells) = scene.solid_cells() {
            let (distance, solid) = cells.signed_distance(p, best.0, block.nearest_cells[index]);
            if distance < best.0 {
                best = (distance, Decider::Cell(solid));
            }
        }
        best
    }

    fn nearest_signed(
        &self,
        block: &Block,
        cell: &CellData,
        primitives: &[Primitive],
        p: Point2,
        limit: f64,
    ) -> (f64, Decider) {
        let reach = signed_reach(cell.centre_clearance, self.layout.half_diagonal);
        let mut best = (limit, Decider::Limit);
        let indices = block.candidates(cell).iter().map(|c| c.index);
        signed_distances(indices, primitives, p, reach, |distance, index| {
            if distance < best.0 {
                best = (distance, Decider::Primitive(index));
            }
        });
        best
    }
}

/// How far (m) from a point of a square what decides its clearance may be, given the clearance (m) of the square's centre and
/// half its diagonal (m). Of a solid that is farther only some edges are listed, and the side of a wrong edge is a wrong side.
#[inline]
pub(crate) fn signed_reach(centre_clearance: f64, half_diagonal: f64) -> f64 {
    (centre_clearance.abs() + half_diagonal) * (1.0 + 1e-9) + 1e-9
}

/// Calls `found` with the signed distance (m) to each solid that is within `reach` (m), and the primitive that decides it.
/// Candidates are in scene order, which keeps each solid's edges together.
#[inline]
pub(crate) fn signed_distances(
    candidates: impl Iterator<Item = u32>,
    primitives: &[Primitive],
    p: Point2,
    reach: f64,
    mut found: impl FnMut(f64, u32),
) {
    let mut rest = candidates.peekable();
    while let Some(index) = rest.next() {
        let Primitive::Edge(first) = &primitives[index as usize] else {
            found(primitives[index as usize].distance(p), index);
            continue;
        };
        let (mut squared, mut inside) = first.distance_squared_and_side(p);
        let mut nearest = index;
        while let Some(&next) = rest.peek()
            && let Primitive::Edge(other) = &primitives[next as usize]
            && other.shape == first.shape
        {
            rest.next();
            let (other_squared, other_inside) = other.distance_squared_and_side(p);
            if other_squared < squared {
                (squared, inside, nearest) = (other_squared, other_inside, next);
            }
        }
        let distance = squared.sqrt();
        if distance <= reach {
            found(if inside { -distance } else { distance }, nearest);
        }
    }
}

/// The clearance (m) from the scene's trees alone.
#[cold]
pub(crate) fn exact_without_field(scene: &Scene, edge: &FieldEdge, p: Point2) -> (f64, Decider) {
    if !(p.x.is_finite() && p.y.is_finite()) {
        // Nowhere is as far from free as it gets.
        return (f64::NEG_INFINITY, Decider::Limit);
    }
    scene.nearest(p, edge.distance(p))
}
