//! Which hits belong to nothing that stands still.

use bikebot_world::Cell;

use super::params::TrackerParams;
use crate::mapper::{Hit, Mapper};

/// When each cell was last free and then hit, s.
#[derive(Debug, Clone, Default)]
pub(crate) struct Memory {
    left_free: Vec<f64>,
}

impl Memory {
    /// Looks at the hits of the last scan; those that nothing settled explains, in the order of their beams.
    pub(crate) fn unexplained(&mut self, mapper: &Mapper, params: &TrackerParams) -> Vec<Hit> {
        let grid = mapper.belief().grid();
        if self.left_free.len() != grid.cells.len() {
            self.left_free = vec![f64::NEG_INFINITY; grid.cells.len()];
        }
        let mut candidates = Vec::new();
        for hit in mapper.hits() {
            let Some((x, y)) = hit.cell else { continue };
            let left_free = &mut self.left_free[y * grid.width + x];
            if hit.before == Cell::Free {
                *left_free = hit.time;
            }
            if hit.time - *left_free < params.settle {
                candidates.push(*hit);
            }
        }
        candidates.retain(|hit| {
            let Some((x, y)) = hit.cell else { return false };
            // As far as noise may carry a hit off its surface, and a cell for the rounding.
            let blur = mapper.blur(hit.distance) / grid.resolution;
            let reach = 1 + blur.min(100.0) as usize;
            let rows = y.saturating_sub(reach)..=(y + reach).min(grid.height - 1);
            let columns = x.saturating_sub(reach)..=(x + reach).min(grid.width - 1);
            !rows.into_iter().any(|row| {
                columns.clone().any(|column| {
                    let index = row * grid.width + column;
                    grid.cells[index] == Cell::Occupied
                        && hit.time - self.left_free[index] >= params.settle
                })
            })
        });
        candidates
    }
}
