//! The levels of the pyramid, each made from the one below.

use super::{ROWS_BETWEEN_STOPS, SIDE};
use crate::grid::Cell;

/// One level of the pyramid: 64 bits for each node, row by row.
#[derive(Debug, Clone)]
pub(super) struct Level {
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// Which children hold anything solid. For a tile: which cells are solid.
    pub(super) solid: Vec<u64>,
    /// Which children hold anything free; empty for tiles, whose free cells are those that are not solid.
    pub(super) free: Vec<u64>,
}

impl Level {
    #[inline]
    pub(super) fn mask<const SOLID: bool>(&self, index: usize) -> u64 {
        if SOLID {
            self.solid[index]
        } else if self.free.is_empty() {
            !self.solid[index]
        } else {
            self.free[index]
        }
    }
}

#[inline]
pub(super) fn solid_bits(cells: &[Cell]) -> u64 {
    cells
        .iter()
        .enumerate()
        .fold(0, |bits, (i, c)| bits | u64::from(*c != Cell::Free) << i)
}

pub(super) fn write_bit(word: &mut u64, bit: u64, value: bool) {
    if value {
        *word |= bit;
    } else {
        *word &= !bit;
    }
}

pub(super) fn level_over(below: &Level, stop: &dyn Fn() -> bool) -> Option<Level> {
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
