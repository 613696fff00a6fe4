//! What is believed about each cell.

use bikebot_geometry::{Point2, Pose2};
use bikebot_world::{Bounds, Cell, OccupancyGrid};

use crate::error::MappingError;
use crate::evidence::{Thresholds, UNIT};

/// A grid of log-odds with the verdict on each cell: free, occupied or unknown.
///
/// A verdict is kept until the evidence has clearly turned, so noise does not flip it.
#[derive(Debug, Clone, PartialEq)]
pub struct BeliefGrid {
    verdicts: OccupancyGrid,
    /// In thousandths, row by row like the verdicts.
    log_odds: Vec<i16>,
}

impl BeliefGrid {
    /// Nothing known: `width` by `height` cells of `resolution` (m), the lower left corner of the lower left cell at
    /// `origin` (m, rad).
    ///
    /// # Errors
    ///
    /// [`MappingError::Grid`] for a size, resolution or origin no grid can have.
    pub fn new(
        width: usize,
        height: usize,
        resolution: f64,
        origin: Pose2,
    ) -> Result<Self, MappingError> {
        let verdicts = OccupancyGrid::filled(width, height, resolution, origin, Cell::Unknown)?;
        let log_odds = vec![0; verdicts.cells.len()];
        Ok(Self { verdicts, log_odds })
    }

    /// Nothing known of a field: cells of `resolution` (m) from its lower left corner until all of it is covered.
    ///
    /// # Errors
    ///
    /// As [`BeliefGrid::new`].
    pub fn over(bounds: Bounds, resolution: f64) -> Result<Self, MappingError> {
        // A hair less, so that 12 m of 0.1 m stay 120 cells whichever way the division rounds.
        let cells = |length: f64| (length / resolution - 1e-9).ceil().max(1.0) as usize;
        Self::new(
            cells(bounds.width()),
            cells(bounds.height()),
            resolution,
            Pose2::new(bounds.min.x, bounds.min.y, 0.0),
        )
    }

    /// The verdicts, as a map.
    #[must_use]
    pub fn grid(&self) -> &OccupancyGrid {
        &self.verdicts
    }

    /// The verdicts, as a map of its own.
    #[must_use]
    pub fn into_grid(self) -> OccupancyGrid {
        self.verdicts
    }

    /// The verdict on the cell in column `x`, row `y`; `None` off the grid.
    #[must_use]
    pub fn cell(&self, x: usize, y: usize) -> Option<Cell> {
        self.verdicts.cell(x, y)
    }

    /// The verdict on the cell that holds a point (m); `None` off the grid.
    #[must_use]
    pub fn at(&self, point: Point2) -> Option<Cell> {
        let (x, y) = self.verdicts.world_to_cell(point)?;
        self.verdicts.cell(x, y)
    }

    /// Log-odds `ln(p / (1 − p))` that the cell in column `x`, row `y` is occupied; `None` off the grid.
    #[must_use]
    pub fn log_odds(&self, x: usize, y: usize) -> Option<f64> {
        let on_grid = x < self.verdicts.width && y < self.verdicts.height;
        on_grid.then(|| f64::from(self.log_odds[y * self.verdicts.width + x]) / UNIT)
    }

    /// Adds evidence to a cell; says what it is now, if it changed its mind.
    #[inline]
    pub(crate) fn add(&mut self, index: usize, evidence: i16, t: &Thresholds) -> Option<Cell> {
        let log_odds = &mut self.log_odds[index];
        *log_odds = log_odds.saturating_add(evidence).clamp(t.least, t.most);
        let verdict = &mut self.verdicts.cells[index];
        let now = t.verdict(*verdict, *log_odds);
        if now == *verdict {
            None
        } else {
            *verdict = now;
            Some(now)
        }
    }

    /// As sure as can be that a cell is free, unless something was met there; says whether that is news.
    pub(crate) fn declare_free(&mut self, index: usize, t: &Thresholds) -> bool {
        let verdict = &mut self.verdicts.cells[index];
        if *verdict == Cell::Occupied {
            return false;
        }
        self.log_odds[index] = t.least;
        std::mem::replace(verdict, Cell::Free) != Cell::Free
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_is_covered_to_its_last_corner() {
        let bounds = Bounds {
            min: Point2::new(-1.0, 2.0),
            max: Point2::new(11.0, 5.05),
        };
        let belief = BeliefGrid::over(bounds, 0.1).expect("a grid");
        let grid = belief.grid();
        assert_eq!((grid.width, grid.height), (120, 31));
        assert_eq!(grid.count(Cell::Unknown), 120 * 31);
        assert_eq!(belief.at(Point2::new(10.99, 5.04)), Some(Cell::Unknown));
        assert_eq!(belief.at(Point2::new(11.01, 5.0)), None);
        assert_eq!(belief.log_odds(119, 30), Some(0.0));
        assert_eq!(belief.log_odds(120, 30), None);
    }

    #[test]
    fn absurd_fields_are_refused() {
        let bounds = Bounds {
            min: Point2::new(0.0, 0.0),
            max: Point2::new(1e9, f64::NAN),
        };
        assert!(BeliefGrid::over(bounds, 0.1).is_err());
        let square = Bounds {
            min: Point2::new(0.0, 0.0),
            max: Point2::new(1.0, 1.0),
        };
        for resolution in [0.0, -1.0, f64::NAN, 1e-12] {
            assert!(
                BeliefGrid::over(square, resolution).is_err(),
                "{resolution}"
            );
        }
    }
}
