//! What is known of each cell, and the world that is planned in.
//!
//! | cell | to plan through | to ride over |
//! |---|---|---|
//! | free | yes | yes |
//! | unknown | yes | no |
//! | occupied | no | no |
//!
//! Where a map was given, a cell that was never seen is as the map has it, and what the laser shows within a cell diagonal and a little of the
//! map's own obstacles is taken for them: the map has their exact shape, which cells have not.

use bikebot_world::{Bounds, Cell, Obstacle, OccupancyGrid, World, WorldChanges, WorldError};

/// Farther than half a cell diagonal and this, m, from all that the map has, a hit is something else. Three times the noise of a usual scanner.
const EXPLAINED: f64 = 0.1;

/// The belief as the navigator reads it, and the optimistic world made of it.
#[derive(Debug)]
pub(crate) struct Belief {
    /// Cells with the map's knowledge put in.
    cells: OccupancyGrid,
    /// Of each cell whether the map has an obstacle there or beside it; empty without a map.
    explained: Vec<bool>,
    /// Cells that are planned around although they were never seen.
    doubted: Vec<bool>,
    /// Everything the map has, and every occupied cell, as of the last time it was asked for.
    world: World,
    /// Cells of the world that are solid, of those that are none of the map's.
    solid: Vec<bool>,
    /// Cells that may be different in the world.
    stale: Vec<u32>,
    /// Whether anything has become free since a better path was last looked for.
    pub has_opened: bool,
}

impl Belief {
    /// From the cells as they are believed now, within `bounds`; `known` is the map, where one was given.
    pub fn new(
        believed: &OccupancyGrid,
        bounds: Bounds,
        known: Option<&World>,
    ) -> Result<Self, WorldError> {
        let count = believed.width * believed.height;
        let mut frame = believed.clone();
        frame.cells.fill(Cell::Free);
        let (world, explained) = match known {
            None => (
                World::build(bounds, Vec::new(), Some(frame.clone()))?,
                Vec::new(),
            ),
            Some(map) => {
                let near = believed.resolution * std::f64::consts::FRAC_1_SQRT_2 + EXPLAINED;
                let explained = (0..count)
                    .map(|i| {
                        let centre = frame.cell_centre(i % frame.width, i / frame.width);
                        map.clearance(centre) <= near
                    })
                    .collect();
                let obstacles: Vec<Obstacle> = map.obstacles().to_vec();
                let grid = match map.grid() {
                    Some(grid) if is_same_frame(grid, &frame) => grid.clone(),
                    _ => frame.clone(),
                };
                (
                    World::build(map.bounds(), obstacles, Some(grid))?,
                    explained,
                )
            }
        };
        let mut belief = Self {
            cells: frame,
            explained,
            doubted: vec![false; count],
            world,
            solid: vec![false; count],
            stale: Vec::new(),
            has_opened: false,
        };
        belief.cells.cells.fill(Cell::Unknown);
        for (i, cell) in believed.cells.iter().enumerate() {
            belief.set(i, *cell);
        }
        Ok(belief)
    }

    /// The grid's frame, with what is known in it.
    pub fn cells(&self) -> &OccupancyGrid {
        &self.cells
    }

    /// Takes over what has changed; what lies off the grid is left out. Whether anything did change.
    pub fn observe(&mut self, changes: &[(usize, usize, Cell)]) -> bool {
        let mut is_news = false;
        for &(x, y, cell) in changes {
            if x < self.cells.width && y < self.cells.height {
                is_news |= self.set(y * self.cells.width + x, cell);
            }
        }
        is_news
    }

    fn set(&mut self, index: usize, cell: Cell) -> bool {
        let cell = match self.explained.get(index) {
            None => cell,
            // The map knows better.
            Some(true) => Cell::Free,
            Some(false) if cell == Cell::Unknown => Cell::Free,
            Some(false) => cell,
        };
        let old = std::mem::replace(&mut self.cells.cells[index], cell);
        let was_doubted = cell != Cell::Unknown && std::mem::take(&mut self.doubted[index]);
        if old == cell && !was_doubted {
            return false;
        }
        if was_doubted || old == Cell::Occupied || cell == Cell::Occupied {
            self.stale.push(index as u32);
            self.has_opened |= cell != Cell::Occupied;
        }
        true
    }

    /// Plans around an unknown cell from now on, until it is seen. Whether it did not before.
    pub fn doubt(&mut self, cell: u32) -> bool {
        let Some(doubted) = self.doubted.get_mut(cell as usize) else {
            return false;
        };
        let is_news =
            self.cells.cells[cell as usize] == Cell::Unknown && !std::mem::replace(doubted, true);
        if is_news {
            self.stale.push(cell);
        }
        is_news
    }

    /// Whether nothing can be in this cell.
    pub fn is_free(&self, cell: u32) -> bool {
        self.cells.cells.get(cell as usize) == Some(&Cell::Free)
    }

    /// Whether a path may not lead over this cell.
    pub fn is_solid(&self, cell: u32) -> bool {
        self.cells
            .cells
            .get(cell as usize)
            .is_none_or(|c| *c == Cell::Occupied || self.doubted[cell as usize])
    }

    /// Whether a path may not lead over this cell only because nobody has seen it.
    pub fn is_doubted(&self, cell: u32) -> bool {
        self.doubted.get(cell as usize) == Some(&true)
    }

    /// The optimistic world, as of now.
    pub fn world(&mut self) -> &World {
        let mut stale = std::mem::take(&mut self.stale);
        stale.sort_unstable();
        stale.dedup();
        let width = self.cells.width;
        let mut cells = Vec::with_capacity(stale.len());
        for index in stale {
            let is_solid = self.is_solid(index);
            let index = index as usize;
            if self.solid[index] != is_solid {
                self.solid[index] = is_solid;
                let cell = if is_solid { Cell::Occupied } else { Cell::Free };
                cells.push((index % width, index / width, cell));
            }
        }
        if !cells.is_empty() {
            let changes = WorldChanges {
                cells,
                ..WorldChanges::default()
            };
            // The grid has all these cells: nothing is refused.
            if let Ok(world) = self.world.with_changes(&changes) {
                self.world = world;
            }
        }
        &self.world
    }

    /// The world as it was last asked for.
    pub fn world_as_it_was(&self) -> &World {
        &self.world
    }
}

fn is_same_frame(a: &OccupancyGrid, b: &OccupancyGrid) -> bool {
    (a.width, a.height, a.resolution, a.origin) == (b.width, b.height, b.resolution, b.origin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::{Point2, Pose2};

    fn unknown() -> OccupancyGrid {
        OccupancyGrid::filled(40, 30, 0.1, Pose2::new(0.0, 0.0, 0.0), Cell::Unknown).unwrap()
    }

    #[test]
    fn unknown_space_is_planned_through_but_not_ridden_over() {
        let mut belief = Belief::new(&unknown(), unknown().bounds(), None).unwrap();
        assert!(!belief.is_free(5) && !belief.is_solid(5));
        assert!(belief.observe(&[(5, 0, Cell::Free), (7, 0, Cell::Occupied)]));
        assert!(belief.is_free(5) && !belief.is_solid(5));
        assert!(!belief.is_free(7) && belief.is_solid(7));
        let clearance = belief.world().clearance(Point2::new(0.75, 0.35));
        assert!((clearance - 0.25).abs() < 1e-12, "{clearance}");
        assert!(!belief.observe(&[(5, 0, Cell::Free), (99, 0, Cell::Free)]));
    }

    #[test]
    fn what_was_taken_away_is_gone_and_an_opening_is_noted() {
        let mut belief = Belief::new(&unknown(), unknown().bounds(), None).unwrap();
        belief.observe(&[(7, 9, Cell::Occupied)]);
        assert!(belief.world().clearance(Point2::new(0.75, 0.95)) < 0.0);
        assert!(!belief.has_opened);
        belief.observe(&[(7, 9, Cell::Free)]);
        assert!(belief.has_opened);
        assert!(belief.world().clearance(Point2::new(0.75, 0.95)) > 0.5);
    }

    #[test]
    fn a_doubted_cell_is_planned_around_until_it_is_seen() {
        let mut belief = Belief::new(&unknown(), unknown().bounds(), None).unwrap();
        assert!(belief.doubt(100) && !belief.doubt(100));
        assert!(belief.is_solid(100));
        belief.observe(&[(20, 2, Cell::Free)]);
        assert!(belief.is_free(100) && !belief.is_solid(100));
        // What is seen is not doubted.
        assert!(!belief.doubt(100));
    }

    #[test]
    fn a_map_is_believed_where_nothing_was_seen_and_explains_what_lies_on_its_obstacles() {
        let disc = Obstacle::Disc {
            center: Point2::new(2.0, 1.5),
            radius: 0.5,
        };
        let map = World::new(Bounds::new(0.0, 0.0, 4.0, 3.0), vec![disc]).unwrap();
        let mut belief = Belief::new(&unknown(), map.bounds(), Some(&map)).unwrap();
        let at = |x: f64, y: f64| unknown().world_to_cell(Point2::new(x, y)).unwrap();
        let index = |(x, y): (usize, usize)| (y * 40 + x) as u32;
        assert!(belief.is_free(index(at(0.5, 2.0))));
        let (surface, away) = (at(1.45, 1.5), at(1.05, 1.5));
        belief.observe(&[
            (surface.0, surface.1, Cell::Occupied),
            (away.0, away.1, Cell::Occupied),
        ]);
        assert!(!belief.is_solid(index(surface)) && belief.is_solid(index(away)));
        // The disc itself is there with its exact shape.
        let clearance = belief.world().clearance(Point2::new(2.0, 2.5));
        assert!((clearance - 0.5).abs() < 1e-12, "{clearance}");
    }
}
