//! The connected pieces of a map's free cells, labelled once.
//!
//! Free cells that share a side belong together. Two that share no more than a corner, with solid cells at its other sides, do
//! not: nothing that keeps any clearance passes between them. So two places in different pieces are apart for every footprint.
//!
//! A row is kept as its runs of free cells, each with the number of its piece: 6 bytes a run.

use crate::solid_cells::SolidCells;

/// Rows between two questions to the stop condition: below 0.1 ms on the widest of grids.
const ROWS_BETWEEN_STOPS: usize = 8;

/// The pieces of the free cells of a grid.
#[derive(Debug)]
pub(crate) struct FreeRegions {
    /// Index of the first run of each row, and the number of all runs.
    rows: Vec<u32>,
    /// First column of each run.
    starts: Vec<u16>,
    /// The piece each run belongs to: the least run in it.
    regions: Vec<u32>,
}

impl FreeRegions {
    /// Labels the free cells; `None` if `stop` said so first.
    pub(crate) fn new(cells: &SolidCells, stop: &dyn Fn() -> bool) -> Option<Self> {
        let mut rows = vec![0];
        let mut starts = Vec::new();
        let mut regions: Vec<u32> = Vec::new();
        // The runs of the row below and of this one: first and one past the last column, and the run's index.
        let (mut below, mut row) = (Vec::<(u32, u32, u32)>::new(), Vec::new());
        for y in 0..cells.height() {
            if y % ROWS_BETWEEN_STOPS == 0 && stop() {
                return None;
            }
            row.clear();
            let mut under = below.iter().peekable();
            cells.free_runs(y, |start, end| {
                let index = regions.len() as u32;
                regions.push(index);
                starts.push(start as u16);
                row.push((start, end, index));
                while let Some(&&(lower_start, lower_end, lower)) = under.peek()
                    && lower_start < end
                {
                    if lower_end > start {
                        join(&mut regions, lower, index);
                    }
                    if lower_end > end {
                        // It may also meet the next run of this row.
                        break;
                    }
                    under.next();
                }
            });
            rows.push(regions.len() as u32);
            std::mem::swap(&mut below, &mut row);
        }
        for index in 0..regions.len() {
            if index % (1 << 16) == 0 && stop() {
                return None;
            }
            // The root of a run comes before it, and is final by now.
            regions[index] = regions[regions[index] as usize];
        }
        rows.shrink_to_fit();
        starts.shrink_to_fit();
        regions.shrink_to_fit();
        Some(Self {
            rows,
            starts,
            regions,
        })
    }

    /// What there is without a grid.
    pub(crate) fn none() -> Self {
        Self {
            rows: vec![0],
            starts: Vec::new(),
            regions: Vec::new(),
        }
    }

    /// The piece a free cell belongs to; `None` off the grid.
    pub(crate) fn region(&self, x: usize, y: usize) -> Option<u32> {
        let (first, end) = (*self.rows.get(y)? as usize, *self.rows.get(y + 1)? as usize);
        let runs = &self.starts[first..end];
        let after = runs.partition_point(|start| usize::from(*start) <= x);
        (after > 0).then(|| self.regions[first + after - 1])
    }

    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&*self.rows) + size_of_val(&*self.starts) + size_of_val(&*self.regions)
    }
}

/// Makes two runs one piece, named after its least run.
fn join(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(parents, a), root(parents, b));
    let (least, other) = (a.min(b), a.max(b));
    parents[other as usize] = least;
}

fn root(parents: &mut [u32], mut run: u32) -> u32 {
    while parents[run as usize] != run {
        let above = parents[parents[run as usize] as usize];
        parents[run as usize] = above;
        run = above;
    }
    run
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Cell, OccupancyGrid};
    use bikebot_geometry::Pose2;
    use proptest::prelude::*;

    /// Pieces by a plain flood, cell by cell.
    fn flooded(grid: &OccupancyGrid) -> Vec<usize> {
        let mut labels = vec![usize::MAX; grid.cells.len()];
        for first in 0..grid.cells.len() {
            if labels[first] != usize::MAX || grid.cells[first] != Cell::Free {
                continue;
            }
            let mut open = vec![first];
            labels[first] = first;
            while let Some(i) = open.pop() {
                let (x, y) = (i % grid.width, i / grid.width);
                let mut near = Vec::new();
                near.extend((x > 0).then(|| i - 1));
                near.extend((x + 1 < grid.width).then_some(i + 1));
                near.extend((y > 0).then(|| i - grid.width));
                near.extend((y + 1 < grid.height).then_some(i + grid.width));
                for n in near {
                    if grid.cells[n] == Cell::Free && labels[n] == usize::MAX {
                        labels[n] = first;
                        open.push(n);
                    }
                }
            }
        }
        labels
    }

    proptest! {
        #[test]
        fn the_pieces_are_those_of_a_flood(
            width in 1..150_usize,
            height in 1..40_usize,
            density in 0.1..0.7_f64,
            seed in any::<u64>(),
        ) {
            let cells = (0..(width * height) as u64)
                .map(|i| {
                    let mut z = (seed ^ i).wrapping_mul(0x9E37_79B9_7F4A_7C15);
                    z = (z ^ (z >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
                    let solid = ((z ^ (z >> 32)) as u32 as f64) < density * f64::from(u32::MAX);
                    if solid { Cell::Occupied } else { Cell::Free }
                })
                .collect();
            let origin = Pose2::new(0.0, 0.0, 0.0);
            let grid = OccupancyGrid::new(width, height, 1.0, origin, cells).expect("valid");
            let bits = SolidCells::new(&grid, &|| false).expect("not stopped");
            let regions = FreeRegions::new(&bits, &|| false).expect("not stopped");
            let expected = flooded(&grid);
            let mut names = std::collections::BTreeMap::new();
            for (i, label) in expected.iter().enumerate() {
                if *label == usize::MAX {
                    continue;
                }
                let found = regions.region(i % width, i / width);
                prop_assert!(found.is_some());
                prop_assert_eq!(*names.entry(*label).or_insert(found), found);
            }
            let mut distinct: Vec<_> = names.values().collect();
            distinct.sort();
            distinct.dedup();
            prop_assert_eq!(distinct.len(), names.len());
        }
    }

    #[test]
    fn cells_that_share_a_corner_are_apart_and_labelling_can_be_stopped() {
        let cells = vec![Cell::Free, Cell::Occupied, Cell::Occupied, Cell::Free];
        let grid = OccupancyGrid::new(2, 2, 1.0, Pose2::new(0.0, 0.0, 0.0), cells).expect("valid");
        let bits = SolidCells::new(&grid, &|| false).expect("not stopped");
        let regions = FreeRegions::new(&bits, &|| false).expect("not stopped");
        assert_ne!(regions.region(0, 0), regions.region(1, 1));
        assert_eq!(regions.region(5, 7), None);
        assert!(FreeRegions::new(&bits, &|| true).is_none());
    }
}
