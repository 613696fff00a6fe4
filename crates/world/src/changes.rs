//! A world that differs from another in a few places.

use std::sync::{Arc, OnceLock};

use bikebot_geometry::{Point2, Vector2};

use crate::error::WorldError;
use crate::grid::{Cell, OccupancyGrid};
use crate::obstacle::{Bounds, Obstacle};
use crate::world::World;

/// Changed cells are looked after together in squares of this many cells a side, unless they lie close together anyway.
const PATCH: usize = 64;

/// What is to be different in [`World::with_changes`]. The default is nothing.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WorldChanges {
    /// Cells of the grid: column, row, and what is there now. The last one counts, if a cell is named twice.
    pub cells: Vec<(usize, usize, Cell)>,
    /// Which obstacles are gone, as indices into [`World::obstacles`], in any order.
    pub removed: Vec<usize>,
    /// Obstacles that are new; they come after those that stay.
    pub added: Vec<Obstacle>,
}

impl World {
    /// The same world with some changes, far cheaper than building it afresh: all that is known about places the changes
    /// cannot reach is kept, and shared with this world.
    ///
    /// Every answer of the new world is that of one built afresh, bit for bit, but for
    /// [`World::nearest_obstacle_point`] where two points are equally near.
    ///
    /// # Errors
    ///
    /// If a change names a cell or an obstacle that is not there, or an obstacle to be added makes no sense.
    pub fn with_changes(&self, changes: &WorldChanges) -> Result<Self, WorldError> {
        let count = self.obstacles.len();
        let mut removed = changes.removed.clone();
        removed.sort_unstable();
        removed.dedup();
        if let Some(&obstacle) = removed.last().filter(|last| **last >= count) {
            return Err(WorldError::NoSuchObstacle { obstacle, count });
        }
        let kept = count - removed.len();
        let mut added = Vec::with_capacity(changes.added.len());
        for (i, obstacle) in changes.added.iter().enumerate() {
            added.push(obstacle.normalised(kept + i)?);
        }
        let mut gone = removed.iter().peekable();
        let stay = self
            .obstacles
            .iter()
            .enumerate()
            .filter(|(i, _)| gone.next_if_eq(&i).is_none())
            .map(|(_, obstacle)| obstacle);
        let obstacles: Vec<Obstacle> = stay.chain(&changes.added).cloned().collect();

        let mut scene = self.scene.clone();
        let mut changed = Vec::new();
        scene.change(&removed, added, &mut changed);
        let grid = match self.changed_grid(&changes.cells)? {
            None => self.grid.clone(),
            Some((grid, cells)) => {
                extents(&grid, &cells, &mut changed);
                scene.change_grid(Arc::clone(&grid), &cells);
                Some(grid)
            }
        };
        if scene.dead_primitives() > scene.live_primitives() + 1000 {
            // More has gone than is left. Its room is freed, and the indices with it: nothing can be shared.
            let grid = grid.map(Arc::unwrap_or_clone);
            return Self::build(self.edge.bounds, obstacles, grid);
        }
        let field = self.field.with_changes(&self.edge.bounds, &scene, &changed);
        Ok(Self {
            obstacles,
            grid,
            edge: self.edge,
            scene,
            field,
            regions: OnceLock::new(),
            bottlenecks: OnceLock::new(),
        })
    }

    /// The grid with these cells written, and which of them are no longer what they were; `None` if all are.
    #[allow(clippy::type_complexity)]
    fn changed_grid(
        &self,
        cells: &[(usize, usize, Cell)],
    ) -> Result<Option<(Arc<OccupancyGrid>, Vec<(usize, usize)>)>, WorldError> {
        let (width, height) = self.grid.as_ref().map_or((0, 0), |g| (g.width, g.height));
        let none = |&&(column, row, _): &&(usize, usize, Cell)| column >= width || row >= height;
        if let Some(&(column, row, _)) = cells.iter().find(none) {
            return Err(WorldError::NoSuchCell {
                column,
                row,
                width,
                height,
            });
        }
        let is_news = |grid: &OccupancyGrid, change: &(usize, usize, Cell)| {
            grid.cell(change.0, change.1) != Some(change.2)
        };
        let Some(old) = self.grid.as_deref() else {
            return Ok(None);
        };
        if !cells.iter().any(|change| is_news(old, change)) {
            return Ok(None);
        }
        let mut new = old.clone();
        let mut different = Vec::with_capacity(cells.len());
        for change in cells {
            if is_news(&new, change) {
                new.set(change.0, change.1, change.2);
                different.push((change.0, change.1));
            }
        }
        Ok(Some((Arc::new(new), different)))
    }
}

/// Rectangles (m) around changed cells, in the world frame.
fn extents(grid: &OccupancyGrid, cells: &[(usize, usize)], changed: &mut Vec<Bounds>) {
    let mut patches: Vec<(usize, usize, [usize; 4])> = Vec::new();
    let mut whole: Option<[usize; 4]> = None;
    let widen = |b: [usize; 4], x: usize, y: usize| {
        [b[0].min(x), b[1].min(y), b[2].max(x + 1), b[3].max(y + 1)]
    };
    let mut sorted: Vec<_> = cells
        .iter()
        .map(|&(x, y)| (y / PATCH, x / PATCH, x, y))
        .collect();
    sorted.sort_unstable();
    for (row, column, x, y) in sorted {
        let own = [x, y, x + 1, y + 1];
        whole = Some(whole.map_or(own, |b| widen(b, x, y)));
        match patches.last_mut() {
            Some((r, c, b)) if (*r, *c) == (row, column) => *b = widen(*b, x, y),
            _ => patches.push((row, column, own)),
        }
    }
    let area = |b: &[usize; 4]| (b[2] - b[0]) * (b[3] - b[1]);
    let mut push = |b: &[usize; 4]| {
        let corner =
            |x: usize, y: usize| grid.from_cell_coordinates(Vector2::new(x as f64, y as f64));
        let corners: [Point2; 4] = [
            corner(b[0], b[1]),
            corner(b[2], b[1]),
            corner(b[2], b[3]),
            corner(b[0], b[3]),
        ];
        changed.extend(Bounds::around(corners));
    };
    match whole {
        Some(whole) if area(&whole) <= 4 * cells.len() => push(&whole),
        _ => patches.iter().for_each(|(_, _, b)| push(b)),
    }
}

#[cfg(test)]
mod tests;
