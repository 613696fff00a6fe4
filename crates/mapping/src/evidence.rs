//! How much one scan says about a cell, and when a cell changes its mind.

use bikebot_world::Cell;

use crate::params::MapperParams;

/// Units of one log-odd: whole numbers add up alike in any order.
pub(crate) const UNIT: f64 = 1000.0;

/// Entries of the table of weights, at most.
const MOST_WEIGHTS: u64 = 4096;

/// What a hit and a passing beam add to a cell, by its distance from the scanner.
#[derive(Debug, Clone)]
pub(crate) struct Weights {
    /// (hit, miss) by squared distance in cells, `shift` bits of it left out.
    table: Vec<(i16, i16)>,
    shift: u32,
}

impl Weights {
    /// For cells of side `cell` (m), up to `range` (m); farther away what counts there.
    ///
    /// Evidence that is blurred by σ across the beam is spread over `√(1 + (σ / cell)²)` cells and more; its weight is
    /// one over the square of that.
    pub(crate) fn new(params: &MapperParams, cell: f64, range: f64) -> Self {
        let cells = (range / cell).ceil().clamp(1.0, 1e6) as u64 + 2;
        let farthest = cells * cells;
        let mut shift = 0;
        while farthest >> shift >= MOST_WEIGHTS {
            shift += 1;
        }
        let unit = |log_odds: f64, weight: f64| {
            (log_odds * weight * UNIT)
                .round()
                .clamp(1.0, f64::from(i16::MAX)) as i16
        };
        let table = (0..=farthest >> shift)
            .map(|k| {
                // The far end of what falls into this entry.
                let squared = (((k + 1) << shift) - 1) as f64 * cell * cell;
                let blur = params.lateral_variance(squared.sqrt()) / (cell * cell);
                let weight = 1.0 / (1.0 + blur);
                (
                    unit(params.hit_log_odds, weight),
                    -unit(params.miss_log_odds, weight),
                )
            })
            .collect();
        Self { table, shift }
    }

    /// (hit, miss) for a cell `squared` cells² away.
    #[inline]
    pub(crate) fn at(&self, squared: u64) -> (i16, i16) {
        let last = self.table.len() - 1;
        self.table[((squared >> self.shift) as usize).min(last)]
    }
}

/// The thresholds in units.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Thresholds {
    pub(crate) least: i16,
    pub(crate) most: i16,
    free_at: i16,
    free_until: i16,
    occupied_until: i16,
    occupied_at: i16,
}

impl Thresholds {
    pub(crate) fn new(params: &MapperParams) -> Self {
        let unit = |log_odds: f64| (log_odds * UNIT).round() as i16;
        Self {
            least: unit(-params.free_limit),
            most: unit(params.occupied_limit),
            free_at: unit(params.free_at),
            free_until: unit(params.free_until),
            occupied_until: unit(params.occupied_until),
            occupied_at: unit(params.occupied_at),
        }
    }

    /// What a cell is with these log-odds, if it was `was` before.
    #[inline]
    pub(crate) fn verdict(&self, was: Cell, log_odds: i16) -> Cell {
        if log_odds >= self.occupied_at {
            Cell::Occupied
        } else if log_odds <= self.free_at {
            Cell::Free
        } else {
            match was {
                Cell::Occupied if log_odds >= self.occupied_until => Cell::Occupied,
                Cell::Free if log_odds <= self.free_until => Cell::Free,
                _ => Cell::Unknown,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_evidence_weighs_less_as_the_heading_blurs_it() {
        let params = MapperParams {
            position_sigma: 0.0,
            heading_sigma_deg: 0.5,
            ..MapperParams::default()
        };
        let weights = Weights::new(&params, 0.1, 30.0);
        let (hit, miss) = weights.at(0);
        assert!(hit > 1590 && miss < -496, "{hit} {miss}");
        // At 0.1 m / sin 0.5° = 11.459 m the blur is one cell: half the weight. An entry of the table is 32 cells² wide.
        let (hit, miss) = weights.at(114 * 114);
        assert!((f64::from(hit) - 800.0).abs() < 5.0, "{hit}");
        assert!((f64::from(miss) + 250.0).abs() < 2.0, "{miss}");
        assert_eq!(weights.at(u64::MAX), weights.at(302 * 302));
    }

    #[test]
    fn without_blur_everything_weighs_the_same() {
        let params = MapperParams {
            position_sigma: 0.0,
            heading_sigma_deg: 0.0,
            ..MapperParams::default()
        };
        let weights = Weights::new(&params, 0.1, 1000.0);
        assert_eq!(weights.at(0), weights.at(1_000_000));
    }

    #[test]
    fn a_cell_keeps_its_mind_between_the_thresholds() {
        let t = Thresholds::new(&MapperParams::default());
        for (was, log_odds, is) in [
            (Cell::Unknown, 699, Cell::Unknown),
            (Cell::Unknown, 700, Cell::Occupied),
            (Cell::Occupied, 0, Cell::Occupied),
            (Cell::Occupied, -1, Cell::Unknown),
            (Cell::Occupied, -1000, Cell::Free),
            (Cell::Free, -900, Cell::Free),
            (Cell::Free, -899, Cell::Unknown),
            (Cell::Free, 700, Cell::Occupied),
            (Cell::Unknown, -999, Cell::Unknown),
        ] {
            assert_eq!(t.verdict(was, log_odds), is, "{was:?} at {log_odds}");
        }
    }
}
