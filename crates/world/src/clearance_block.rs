//! A block of cells of the clearance field, and how it is filled.
//!
//! What can be nearest to a point of a square lies within |d| + 2h of the square's centre, with d the centre's clearance and h
//! half the square's diagonal. That holds for the block, for its quarters, and for theirs down to the cells. So the trees are
//! asked once for the whole block, and each smaller square picks its own from the list of the one around it: the lists shrink as
//! the squares do, and a cell comes to little more than the distances to its own candidates.

use bikebot_geometry::Point2;

use crate::clearance_field::{BLOCK, Layout, signed_distances, signed_reach};
use crate::field_edge::FieldEdge;
use crate::obstacle::Bounds;
use crate::primitive::Primitive;
use crate::query::{Decider, Scene};
use crate::solid_cells::CellId;

/// A primitive that may decide the clearance somewhere in a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Candidate {
    /// Distance (m) from the cell's centre, rounded down.
    pub(crate) from_centre: f32,
    pub(crate) index: u32,
}

/// One cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CellData {
    /// d_c, m.
    pub(crate) centre_clearance: f64,
    first: u32,
    /// Twice the number of candidates, and one more if the cell is signed.
    count: u32,
}

impl CellData {
    /// A boundary may pass through the cell: distances to edges need their sign, found per
    /// solid. Candidates are then in scene order, which keeps each solid's edges together;
    /// otherwise they are sorted by distance from the centre.
    #[inline]
    pub(crate) fn is_signed(&self) -> bool {
        self.count & 1 == 1
    }
}

/// A square of cells, row by row.
#[derive(Debug)]
pub(crate) struct Block {
    pub(crate) cells: [CellData; BLOCK * BLOCK],
    candidates: Box<[Candidate]>,
    /// The cell of the occupancy grid that is nearest to each centre; empty in a world without a grid.
    pub(crate) nearest_cells: Box<[CellId]>,
}

impl Block {
    #[cold]
    #[inline(never)]
    pub(crate) fn fill(layout: &Layout, scene: &Scene, edge: &FieldEdge, index: usize) -> Self {
        let nothing = CellData {
            centre_clearance: f64::NEG_INFINITY,
            first: 0,
            count: 0,
        };
        let grid_cells = if scene.solid_cells().is_some() {
            BLOCK * BLOCK
        } else {
            0
        };
        let mut filling = Filling {
            layout,
            scene,
            edge,
            origin: layout.block_origin(index),
            lists: Default::default(),
            block: Self {
                cells: [nothing; BLOCK * BLOCK],
                candidates: Box::default(),
                nearest_cells: vec![CellId::NONE; grid_cells].into(),
            },
            candidates: Vec::new(),
        };
        filling.fill();
        filling.block.candidates = filling.candidates.into();
        filling.block
    }

    #[inline]
    pub(crate) fn candidates(&self, cell: &CellData) -> &[Candidate] {
        let first = cell.first as usize;
        &self.candidates[first..first + (cell.count >> 1) as usize]
    }

    /// Whether something within `changed` may have a part in the content of one of the cells.
    pub(crate) fn is_touched(&self, layout: &Layout, index: usize, changed: &[Bounds]) -> bool {
        let (first_column, first_row) = layout.block_origin(index);
        let h = layout.half_diagonal;
        // No centre is farther from the first than the diagonal, nor its clearance farther from that of the first.
        let diagonal = 2.0 * h * BLOCK as f64;
        let first = layout.centre(first_column, first_row);
        let far = reach(self.cells[0].centre_clearance, h) + 2.0 * diagonal;
        let is_near = |change: &Bounds, centre: Point2, reach: f64| {
            change.distance_squared(centre) <= reach * reach * (1.0 + 1e-9)
        };
        changed.iter().any(|change| {
            is_near(change, first, far)
                && (0..BLOCK * BLOCK).any(|i| {
                    let (column, row) = (first_column + i % BLOCK, first_row + i / BLOCK);
                    let reach = reach(self.cells[i].centre_clearance, h);
                    column < layout.columns
                        && row < layout.rows
                        && is_near(change, layout.centre(column, row), reach)
                })
        })
    }

    pub(crate) fn bytes(&self) -> usize {
        size_of::<Self>() + size_of_val(&*self.candidates) + size_of_val(&*self.nearest_cells)
    }
}

/// |d| + 2h and a hair, for the rounding of the distances compared with it.
#[inline]
fn reach(clearance: f64, half_diagonal: f64) -> f64 {
    (clearance.abs() + 2.0 * half_diagonal) * (1.0 + 1e-12) + 1e-9
}

/// A primitive, and its distance (m) from the centre of a square: signed for a solid, plain for an edge.
#[derive(Debug, Clone, Copy)]
struct Listed {
    distance: f64,
    index: u32,
}

/// A square of cells whose clearance at the centre is known.
#[derive(Debug, Clone, Copy)]
struct Square {
    column: usize,
    row: usize,
    /// Cells along a side.
    side: usize,
    clearance: f64,
    half_diagonal: f64,
    nearest_cell: CellId,
}

impl Square {
    /// No boundary of a shape passes through the square, nor does it lie inside one.
    fn is_outside(&self) -> bool {
        self.clearance > self.half_diagonal * (1.0 + 1e-9)
    }
}

/// One list for each size of square: the block, …, the cell.
const LISTS: usize = BLOCK.ilog2() as usize + 1;

struct Filling<'a> {
    layout: &'a Layout,
    scene: &'a Scene,
    edge: &'a FieldEdge,
    origin: (usize, usize),
    lists: [Vec<Listed>; LISTS],
    block: Block,
    candidates: Vec<Candidate>,
}

impl Filling<'_> {
    fn fill(&mut self) {
        let (column, row) = self.origin;
        let centre = self.layout.square_centre(column, row, BLOCK);
        let (clearance, decider) = self.scene.nearest(centre, self.edge.distance(centre));
        let square = Square {
            column,
            row,
            side: BLOCK,
            clearance,
            half_diagonal: self.layout.half_diagonal * BLOCK as f64,
            nearest_cell: match decider {
                Decider::Cell(cell) => cell,
                _ => CellId::NONE,
            },
        };
        let primitives = self.scene.primitives();
        let list = &mut self.lists[0];
        let reach = reach(clearance, square.half_diagonal);
        self.scene.primitives_within(centre, reach, |index| {
            list.push(Listed {
                distance: primitives[index as usize].distance(centre),
                index,
            });
        });
        retain_near(list, primitives, &square);
        list.sort_unstable_by_key(|listed| listed.index);
        self.divide(0, &square);
    }

    fn divide(&mut self, depth: usize, square: &Square) {
        if square.side == 1 {
            return self.write(depth, square);
        }
        let half = square.side / 2;
        for (dx, dy) in [(0, 0), (half, 0), (0, half), (half, half)] {
            let (column, row) = (square.column + dx, square.row + dy);
            if column < self.layout.columns && row < self.layout.rows {
                let quarter = self.quarter(depth, square, column, row);
                self.divide(depth + 1, &quarter);
            }
        }
    }

    /// A quarter of a square whose list is the one at `depth`; its own goes to the next.
    fn quarter(&mut self, depth: usize, whole: &Square, column: usize, row: usize) -> Square {
        let side = whole.side / 2;
        let centre = self.layout.square_centre(column, row, side);
        let half_diagonal = 0.5 * whole.half_diagonal;
        let primitives = self.scene.primitives();
        let (above, below) = self.lists.split_at_mut(depth + 1);
        let (listed, list) = (&above[depth], &mut below[0]);
        list.clear();
        let mut clearance = self.edge.distance(centre);
        if whole.is_outside() {
            // No closer to this centre than to the other, less the way between the two.
            let spare = half_diagonal + 2.0 * half_diagonal + 1e-9;
            for Listed { distance, index } in listed {
                if *distance * (1.0 - 1e-12) > clearance + spare {
                    continue;
                }
                let distance = primitives[*index as usize].distance(centre);
                clearance = clearance.min(distance);
                list.push(Listed {
                    distance,
                    index: *index,
                });
            }
        } else {
            list.extend(listed.iter().map(|l| Listed {
                distance: primitives[l.index as usize].distance(centre),
                index: l.index,
            }));
            let reach = signed_reach(whole.clearance, whole.half_diagonal);
            let indices = listed.iter().map(|l| l.index);
            signed_distances(indices, primitives, centre, reach, |distance, _| {
                clearance = clearance.min(distance);
            });
        }
        let mut nearest_cell = CellId::NONE;
        if let Some(cells) = self.scene.solid_cells() {
            let (distance, cell) = cells.signed_distance(centre, clearance, whole.nearest_cell);
            clearance = clearance.min(distance);
            nearest_cell = cell;
        }
        let square = Square {
            column,
            row,
            side,
            clearance,
            half_diagonal,
            nearest_cell,
        };
        retain_near(list, primitives, &square);
        square
    }

    fn write(&mut self, depth: usize, square: &Square) {
        let list = &mut self.lists[depth];
        let is_signed = !square.is_outside() && !list.is_empty();
        if !is_signed {
            list.sort_unstable_by(|a, b| {
                a.distance
                    .total_cmp(&b.distance)
                    .then(a.index.cmp(&b.index))
            });
        }
        let cell = (square.row - self.origin.1) * BLOCK + square.column - self.origin.0;
        self.block.cells[cell] = CellData {
            centre_clearance: square.clearance,
            first: self.candidates.len() as u32,
            count: (list.len() as u32) << 1 | u32::from(is_signed),
        };
        if let Some(nearest) = self.block.nearest_cells.get_mut(cell) {
            *nearest = square.nearest_cell;
        }
        self.candidates.extend(list.iter().map(|l| Candidate {
            from_centre: round_down(l.distance),
            index: l.index,
        }));
    }
}

/// Keeps what may decide the clearance of a point of the square.
fn retain_near(list: &mut Vec<Listed>, primitives: &[Primitive], square: &Square) {
    let reach = reach(square.clearance, square.half_diagonal);
    // The depth of a solid that is left behind is no candidate, however deep another one is.
    let solid_reach = square.clearance + 2.0 * square.half_diagonal + 1e-9;
    if square.clearance >= 0.0 {
        list.retain(|l| l.distance <= reach);
    } else {
        list.retain(|l| match primitives[l.index as usize] {
            Primitive::Edge(_) => l.distance <= reach,
            _ => l.distance <= solid_reach,
        });
    }
}

/// The largest `f32` not above `v`.
fn round_down(v: f64) -> f32 {
    let nearest = v as f32;
    if f64::from(nearest) > v {
        nearest.next_down()
    } else {
        nearest
    }
}
