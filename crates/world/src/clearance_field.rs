//! The clearance of a point from a grid of candidates, built cell by cell when asked for.
//!
//! Each cell keeps the exact clearance d_c of its centre c and the few primitives that can be
//! nearest to any of its points. Clearance changes by no more than the way travelled, so with h
//! the half diagonal of the cell, and for every point p in it:
//!
//! * d_c − |p − c| is a lower bound, for nothing more than finding the cell;
//! * what is nearest to p lies within |d_c| + 2h of c: those are the candidates, and the least
//!   of their distances *is* the clearance.
//!
//! A cell is filled once, by whichever thread comes first, from the scene alone. Its content,
//! and with it every answer, does not depend on which thread that was or on what was asked
//! before.

use std::sync::OnceLock;

use bikebot_geometry::Point2;

use crate::field_edge::FieldEdge;
use crate::obstacle::Bounds;
use crate::primitive::Primitive;
use crate::query::Scene;

/// Cells of a field with few obstacles: 1 m cells on a 100 m field.
const LEAST_CELLS: f64 = 10_000.0;

/// Cells at most; at 40 bytes each they are allocated in blocks as they are touched.
const MOST_CELLS: f64 = 1_000_000.0;

/// Cells per primitive in between: lists then stay near ten entries on evenly cluttered ground.
const CELLS_PER_PRIMITIVE: f64 = 25.0;

/// Cells along the side of a block, the unit of allocation.
const BLOCK: usize = 16;

/// A primitive that may decide the clearance somewhere in a cell.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    /// Distance (m) from the cell's centre, rounded down.
    from_centre: f32,
    index: u32,
}

#[derive(Debug)]
struct CellData {
    /// d_c, m.
    centre_clearance: f64,
    candidates: Box<[Candidate]>,
    /// A boundary may pass through the cell: distances to edges need their sign, found per
    /// solid. Candidates are then in scene order, which keeps each solid's edges together;
    /// otherwise they are sorted by distance from the centre.
    signed: bool,
}

type Block = Box<[OnceLock<CellData>]>;

#[derive(Debug)]
pub(crate) struct ClearanceField {
    min: Point2,
    size: f64,
    inverse_size: f64,
    columns: usize,
    rows: usize,
    block_columns: usize,
    /// h, m.
    half_diagonal: f64,
    blocks: Box<[OnceLock<Block>]>,
}

impl ClearanceField {
    pub(crate) fn new(bounds: &Bounds, primitives: usize) -> Self {
        let wanted = (primitives as f64 * CELLS_PER_PRIMITIVE).clamp(LEAST_CELLS, MOST_CELLS);
        let (width, height) = (bounds.width(), bounds.height());
        let longer = width.max(height);
        // Square cells by area; a very slender field is bounded by its length instead.
        let size = (width.sqrt() * height.sqrt() / wanted.sqrt()).max(longer / wanted);
        let count = |extent: f64| ((extent / size).ceil().max(1.0)) as usize;
        let (columns, rows) = (count(width), count(height));
        let block_columns = columns.div_ceil(BLOCK);
        let blocks = block_columns * rows.div_ceil(BLOCK);
        Self {
            min: bounds.min,
            size,
            inverse_size: size.recip(),
            columns,
            rows,
            block_columns,
            half_diagonal: size * std::f64::consts::FRAC_1_SQRT_2,
            blocks: (0..blocks).map(|_| OnceLock::new()).collect(),
        }
    }

    pub(crate) fn cell_size(&self) -> f64 {
        self.size
    }

    pub(crate) fn columns(&self) -> usize {
        self.columns
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    pub(crate) fn centre(&self, column: usize, row: usize) -> Point2 {
        Point2::new(
            self.min.x + (column as f64 + 0.5) * self.size,
            self.min.y + (row as f64 + 0.5) * self.size,
        )
    }

    /// Column and row of the cell that holds `p`; `None` off the field or for NaN.
    #[inline]
    pub(crate) fn locate(&self, p: Point2) -> Option<(usize, usize)> {
        let x = (p.x - self.min.x) * self.inverse_size;
        let y = (p.y - self.min.y) * self.inverse_size;
        let inside = x >= 0.0 && y >= 0.0 && x < self.columns as f64 && y < self.rows as f64;
        inside.then_some((x as usize, y as usize))
    }

    #[inline]
    fn cell(&self, scene: &Scene, edge: &FieldEdge, column: usize, row: usize) -> &CellData {
        let block = &self.blocks[row / BLOCK * self.block_columns + column / BLOCK];
        let cells = block.get_or_init(|| (0..BLOCK * BLOCK).map(|_| OnceLock::new()).collect());
        cells[row % BLOCK * BLOCK + column % BLOCK]
            .get_or_init(|| self.fill(scene, edge, self.centre(column, row)))
    }

    /// The exact clearance (m) of a cell's centre.
    pub(crate) fn centre_clearance(
        &self,
        scene: &Scene,
        edge: &FieldEdge,
        column: usize,
        row: usize,
    ) -> f64 {
        self.cell(scene, edge, column, row).centre_clearance
    }

    #[cold]
    fn fill(&self, scene: &Scene, edge: &FieldEdge, centre: Point2) -> CellData {
        let to_edge = edge.distance(centre);
        let (centre_clearance, _) = scene.nearest(centre, to_edge);
        let h = self.half_diagonal;
        // A hair more than |d_c| + 2h, for the rounding of the distances compared with it.
        let reach = (centre_clearance.abs() + 2.0 * h) * (1.0 + 1e-12) + 1e-9;
        let solid_reach = centre_clearance + 2.0 * h + 1e-9;
        let mut found: Vec<(f64, u32)> = Vec::new();
        scene.primitives_within(centre, reach, |index| {
            let primitive = &scene.primitives()[index as usize];
            let distance = primitive.distance(centre);
            let limit = match primitive {
                Primitive::Edge(_) => reach,
                _ => solid_reach,
            };
            if distance <= limit {
                found.push((distance, index));
            }
        });
        let signed = centre_clearance <= h * (1.0 + 1e-9);
        if signed {
            found.sort_unstable_by_key(|(_, index)| *index);
        } else {
            found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        }
        CellData {
            centre_clearance,
            candidates: found
                .into_iter()
                .map(|(distance, index)| Candidate {
                    from_centre: round_down(distance),
                    index,
                })
                .collect(),
            signed,
        }
    }

    /// A number (m) not above the clearance of `p`.
    #[inline]
    pub(crate) fn lower_bound(&self, scene: &Scene, edge: &FieldEdge, p: Point2) -> f64 {
        let Some((column, row)) = self.locate(p) else {
            return exact_without_field(scene, edge, p).0;
        };
        let d = self.cell(scene, edge, column, row).centre_clearance;
        let way = (p - self.centre(column, row)).norm();
        // The second term outweighs the rounding of d and of the distances it stands for.
        d - way - 1e-12 * (1.0 + d.abs())
    }

    /// The exact clearance (m) of `p`.
    #[inline]
    pub(crate) fn clearance(&self, scene: &Scene, edge: &FieldEdge, p: Point2) -> f64 {
        match self.locate(p) {
            Some((column, row)) => self.decide(scene, edge, p, column, row).0,
            None => exact_without_field(scene, edge, p).0,
        }
    }

    /// The exact clearance (m) of `p`, and the primitive that decides it; none: the field edge.
    pub(crate) fn nearest(&self, scene: &Scene, edge: &FieldEdge, p: Point2) -> (f64, Option<u32>) {
        match self.locate(p) {
            Some((column, row)) => self.decide(scene, edge, p, column, row),
            None => exact_without_field(scene, edge, p),
        }
    }

    #[inline]
    fn decide(
        &self,
        scene: &Scene,
        edge: &FieldEdge,
        p: Point2,
        column: usize,
        row: usize,
    ) -> (f64, Option<u32>) {
        let cell = self.cell(scene, edge, column, row);
        let primitives = scene.primitives();
        let mut best = (edge.distance(p), None);
        if cell.signed {
            return self.decide_signed(cell, primitives, p, best);
        }
        let way = (p - self.centre(column, row)).norm();
        for candidate in &cell.candidates {
            if f64::from(candidate.from_centre) - way >= best.0 {
                break;
            }
            let distance = primitives[candidate.index as usize].distance(p);
            if distance < best.0 {
                best = (distance, Some(candidate.index));
            }
        }
        best
    }

    fn decide_signed(
        &self,
        cell: &CellData,
        primitives: &[Primitive],
        p: Point2,
        mut best: (f64, Option<u32>),
    ) -> (f64, Option<u32>) {
        // Of a solid that does not matter here only some edges are listed, and the side of a
        // wrong edge is a wrong side. All that matters lies within |d_c| + h of p.
        let reach = (cell.centre_clearance.abs() + self.half_diagonal) * (1.0 + 1e-9) + 1e-9;
        let mut rest = cell.candidates.iter().map(|c| c.index).peekable();
        while let Some(index) = rest.next() {
            let Primitive::Edge(first) = &primitives[index as usize] else {
                let distance = primitives[index as usize].distance(p);
                if distance < best.0 {
                    best = (distance, Some(index));
                }
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
                let value = if inside { -distance } else { distance };
                if value < best.0 {
                    best = (value, Some(nearest));
                }
            }
        }
        best
    }
}

/// The clearance (m) from the scene's trees alone.
pub(crate) fn exact_without_field(
    scene: &Scene,
    edge: &FieldEdge,
    p: Point2,
) -> (f64, Option<u32>) {
    if !(p.x.is_finite() && p.y.is_finite()) {
        // Nowhere is as far from free as it gets.
        return (f64::NEG_INFINITY, None);
    }
    scene.nearest(p, edge.distance(p))
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
