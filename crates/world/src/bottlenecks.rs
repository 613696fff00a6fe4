//! How much room the widest way between two places leaves at its narrowest, for all pairs of places at once.
//!
//! No point of a cell of the clearance field is clearer than the cell's centre by more than h, half its diagonal. Cells taken in the order of
//! d_c + h, the clearest first, and joined to the neighbours taken before them, grow together to one tree; the value at which two
//! places become one piece is a bound on the clearance of every way between them. So a clearance above it is a proof that the two
//! are apart. (Kruskal's algorithm; the tree of its unions, by size, is all that is kept: 8 bytes a cell, and no path in it has
//! more than log₂ n steps.)

use crate::clearance_field::ClearanceField;
use crate::field_edge::FieldEdge;
use crate::query::Scene;

/// Cells between two questions to the stop condition: below 0.5 ms.
const CELLS_BETWEEN_STOPS: usize = 1 << 14;

/// Bits sorted by at a time.
const DIGIT: u32 = 11;

/// The unions of all cells of a clearance field.
#[derive(Debug)]
pub(crate) struct Bottlenecks {
    /// The cell each was hung under; itself for a root.
    parents: Vec<u32>,
    /// The bound (m) at which that was done; for a root nothing.
    bounds: Vec<f32>,
}

impl Bottlenecks {
    /// Fills the field, if that has not been done, and joins its cells; `None` if `stop` said so first.
    pub(crate) fn new(
        field: &ClearanceField,
        scene: &Scene,
        edge: &FieldEdge,
        stop: &dyn Fn() -> bool,
    ) -> Option<Self> {
        if !field.fill(scene, edge, stop) {
            return None;
        }
        let layout = field.layout();
        let (columns, rows) = (layout.columns, layout.rows);
        // The bits of positive numbers are in the order of the numbers.
        let mut keyed: Vec<(u32, u32)> = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            if row % 8 == 0 && stop() {
                return None;
            }
            for column in 0..columns {
                let clearance = field.centre_clearance(scene, edge, column, row);
                let bound = (clearance + layout.half_diagonal) * (1.0 + 1e-9);
                if bound > 0.0 {
                    keyed.push((round_up(bound).to_bits(), (row * columns + column) as u32));
                }
            }
        }
        sort_by_key(&mut keyed, stop)?;
        let mut parents: Vec<u32> = (0..(columns * rows) as u32).collect();
        if stop() {
            return None;
        }
        let mut bounds = vec![f32::NEG_INFINITY; columns * rows];
        // Cells below each root; 0 for cells not taken yet.
        let mut sizes = vec![0u32; columns * rows];
        for (i, &(bits, cell)) in keyed.iter().rev().enumerate() {
            if i % CELLS_BETWEEN_STOPS == 0 && stop() {
                return None;
            }
            let bound = f32::from_bits(bits);
            sizes[cell as usize] = 1;
            let (column, row) = (cell as usize % columns, cell as usize / columns);
            for near_row in row.saturating_sub(1)..(row + 2).min(rows) {
                for near_column in column.saturating_sub(1)..(column + 2).min(columns) {
                    let near = near_row * columns + near_column;
                    if sizes[near] == 0 {
                        continue;
                    }
                    let (a, b) = (top(&parents, near as u32), top(&parents, cell));
                    if a == b {
                        continue;
                    }
                    let (larger, smaller) = if sizes[a as usize] >= sizes[b as usize] {
                        (a, b)
                    } else {
                        (b, a)
                    };
                    parents[smaller as usize] = larger;
                    bounds[smaller as usize] = bound;
                    sizes[larger as usize] += sizes[smaller as usize];
                }
            }
        }
        Some(Self { parents, bounds })
    }

    /// Whether no way between two cells keeps the clearance (m).
    pub(crate) fn separate(&self, a: usize, b: usize, clearance: f64) -> bool {
        let piece = |mut cell: usize| {
            while f64::from(self.bounds[cell]) >= clearance {
                cell = self.parents[cell] as usize;
            }
            cell
        };
        piece(a) != piece(b)
    }

    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&*self.parents) + size_of_val(&*self.bounds)
    }
}

fn top(parents: &[u32], mut cell: u32) -> u32 {
    while parents[cell as usize] != cell {
        cell = parents[cell as usize];
    }
    cell
}

/// The smallest `f32` not below `v`.
fn round_up(v: f64) -> f32 {
    let nearest = v as f32;
    if f64::from(nearest) < v {
        nearest.next_up()
    } else {
        nearest
    }
}

/// Sorts by the first, digit by digit, so that it can be stopped.
fn sort_by_key(items: &mut Vec<(u32, u32)>, stop: &dyn Fn() -> bool) -> Option<()> {
    let mut other = vec![(0, 0); items.len()];
    let buckets = 1 << DIGIT;
    for shift in (0..u32::BITS).step_by(DIGIT as usize) {
        let digit = |key: u32| (key >> shift) as usize & (buckets - 1);
        let mut places = vec![0usize; buckets + 1];
        for chunk in items.chunks(CELLS_BETWEEN_STOPS) {
            if stop() {
                return None;
            }
            for (key, _) in chunk {
                places[digit(*key) + 1] += 1;
            }
        }
        for i in 1..buckets {
            places[i] += places[i - 1];
        }
        for chunk in items.chunks(CELLS_BETWEEN_STOPS) {
            if stop() {
                return None;
            }
            for item in chunk {
                let place = &mut places[digit(item.0)];
                other[*place] = *item;
                *place += 1;
            }
        }
        std::mem::swap(items, &mut other);
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_sorted_and_sorting_can_be_stopped() {
        let mut items: Vec<(u32, u32)> = (0..40_000u32)
            .map(|i| (i.wrapping_mul(2_654_435_761), i))
            .collect();
        let mut expected = items.clone();
        expected.sort();
        assert!(sort_by_key(&mut items, &|| true).is_none());
        assert!(sort_by_key(&mut items, &|| false).is_some());
        assert_eq!(items, expected);
    }
}
