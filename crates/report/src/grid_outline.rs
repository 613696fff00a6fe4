//! The rim of a grid's cells: what is drawn of a map of millions of cells is where solid meets free.

use bikebot_world::{Cell, OccupancyGrid};

/// Corners beyond which a grid is drawn coarser: about half a megabyte of picture.
const MAX_CORNERS: usize = 60_000;

/// The rims of the cells that `keep` wants, as closed loops of corners in cell coordinates of the grid, solid on
/// the left. A grid with more than [`MAX_CORNERS`] corners is drawn in blocks of 2, 4, 8, … cells, each solid
/// where any of its cells is.
pub(crate) fn rims(grid: &OccupancyGrid, keep: impl Fn(Cell) -> bool) -> Vec<Vec<[f64; 2]>> {
    let mut mask = Mask {
        width: grid.width,
        height: grid.height,
        solid: grid.cells.iter().map(|cell| keep(*cell)).collect(),
    };
    let mut block = 1_usize;
    while mask.corners() > MAX_CORNERS {
        mask = mask.halved();
        block *= 2;
    }
    // The last block of a row may reach beyond the grid.
    let place = |[x, y]: [usize; 2]| {
        [
            (x * block).min(grid.width) as f64,
            (y * block).min(grid.height) as f64,
        ]
    };
    mask.loops()
        .into_iter()
        .map(|rim| rim.into_iter().map(place).collect())
        .collect()
}

struct Mask {
    width: usize,
    height: usize,
    solid: Vec<bool>,
}

/// Directions along the rim: east, north, west, south.
const DIRECTIONS: [[isize; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

impl Mask {
    fn is_solid(&self, x: isize, y: isize) -> bool {
        x >= 0
            && y >= 0
            && (x as usize) < self.width
            && (y as usize) < self.height
            && self.solid[y as usize * self.width + x as usize]
    }

    fn halved(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut solid = vec![false; width * height];
        for y in 0..self.height {
            for x in 0..self.width {
                solid[y / 2 * width + x / 2] |= self.solid[y * self.width + x];
            }
        }
        Self {
            width,
            height,
            solid,
        }
    }

    /// How many corners the rim has: lattice points whose four cells are neither all alike nor split by a line.
    fn corners(&self) -> usize {
        let mut count = 0;
        for y in 0..=self.height as isize {
            for x in 0..=self.width as isize {
                let [a, b, c, d] = [(-1, -1), (0, -1), (-1, 0), (0, 0)]
                    .map(|(dx, dy)| self.is_solid(x + dx, y + dy));
                let is_straight = (a == b && c == d) || (a == c && b == d);
                count += usize::from(!is_straight);
            }
        }
        count
    }

    fn loops(&self) -> Vec<Vec<[usize; 2]>> {
        let stride = self.width + 1;
        // For each lattice point the directions in which a piece of rim leaves it, one bit each.
        let mut leaving = vec![0_u8; stride * (self.height + 1)];
        for y in 0..self.height {
            for x in 0..self.width {
                let (left, below) = (x as isize, y as isize);
                if !self.is_solid(left, below) {
                    continue;
                }
                let at = y * stride + x;
                let sides = [
                    (left, below - 1, at, 0),
                    (left + 1, below, at + 1, 1),
                    (left, below + 1, at + stride + 1, 2),
                    (left - 1, below, at + stride, 3),
                ];
                for (nx, ny, from, direction) in sides {
                    if !self.is_solid(nx, ny) {
                        leaving[from] |= 1 << direction;
                    }
                }
            }
        }
        let mut loops = Vec::new();
        for start in 0..leaving.len() {
            while leaving[start] != 0 {
                loops.push(follow(&mut leaving, start, stride));
            }
        }
        loops
    }
}

/// Takes the loop that leaves `start` off the rim; at every point as much goes out as comes in, so it closes.
fn follow(leaving: &mut [u8], start: usize, stride: usize) -> Vec<[usize; 2]> {
    let mut corners = Vec::new();
    let (mut at, mut before) = (start, usize::MAX);
    while leaving[at] != 0 {
        // Where two loops touch: turn left, so that each keeps to its own cell.
        let direction = if before == usize::MAX {
            leaving[at].trailing_zeros() as usize
        } else {
            [before + 1, before, before + 3]
                .map(|direction| direction % 4)
                .into_iter()
                .find(|direction| leaving[at] & (1 << direction) != 0)
                .unwrap_or(leaving[at].trailing_zeros() as usize)
        };
        leaving[at] &= !(1 << direction);
        if direction != before {
            corners.push([at % stride, at / stride]);
        }
        before = direction;
        let [dx, dy] = DIRECTIONS[direction];
        at = at.wrapping_add_signed(dx + dy * stride as isize);
        if at == start {
            break;
        }
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::Pose2;
    use proptest::prelude::*;

    fn grid(rows: &[&str]) -> OccupancyGrid {
        let cells = rows
            .iter()
            .rev()
            .flat_map(|row| row.chars())
            .map(|c| if c == '#' { Cell::Occupied } else { Cell::Free })
            .collect();
        OccupancyGrid::new(
            rows[0].len(),
            rows.len(),
            1.0,
            Pose2::new(0.0, 0.0, 0.0),
            cells,
        )
        .unwrap()
    }

    /// Twice the area left of the loop.
    fn doubled_area(rim: &[[f64; 2]]) -> f64 {
        (0..rim.len())
            .map(|i| {
                let (a, b) = (rim[i], rim[(i + 1) % rim.len()]);
                a[0] * b[1] - a[1] * b[0]
            })
            .sum()
    }

    #[test]
    fn a_block_with_a_hole_has_two_rims() {
        let rims = rims(&grid(&["###", "#.#", "###"]), |cell| cell == Cell::Occupied);
        assert_eq!(rims.len(), 2);
        assert_eq!(rims[0], [[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]]);
        assert_eq!(doubled_area(&rims[1]), -2.0);
    }

    #[test]
    fn cells_that_touch_at_a_corner_keep_their_own_rims() {
        let rims = rims(&grid(&["#.", ".#"]), |cell| cell == Cell::Occupied);
        assert_eq!(rims.len(), 2);
        assert!(
            rims.iter()
                .all(|rim| rim.len() == 4 && doubled_area(rim) == 2.0)
        );
    }

    #[test]
    fn a_grid_of_noise_is_drawn_in_blocks() {
        let side = 400;
        let cells = (0..side * side)
            .map(|i| {
                if (i % side + i / side) % 2 == 0 {
                    Cell::Occupied
                } else {
                    Cell::Free
                }
            })
            .collect();
        let grid = OccupancyGrid::new(side, side, 1.0, Pose2::new(0.0, 0.0, 0.0), cells).unwrap();
        let rims = rims(&grid, |cell| cell == Cell::Occupied);
        assert_eq!(
            rims,
            [[[0.0, 0.0], [400.0, 0.0], [400.0, 400.0], [0.0, 400.0]]]
        );
    }

    proptest! {
        #[test]
        fn the_rims_enclose_as_much_as_there_is(solid in prop::collection::vec(any::<bool>(), 63)) {
            let cells: Vec<Cell> = solid.iter().map(|s| if *s { Cell::Occupied } else { Cell::Free }).collect();
            let grid = OccupancyGrid::new(9, 7, 1.0, Pose2::new(0.0, 0.0, 0.0), cells).unwrap();
            let area: f64 = rims(&grid, |cell| cell == Cell::Occupied).iter().map(|rim| doubled_area(rim) / 2.0).sum();
            prop_assert_eq!(area, solid.iter().filter(|s| **s).count() as f64);
        }
    }
}
