//! How far it is to the goal, headings and curvature ignored: the bound of the search over poses.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use bikebot_geometry::Point2;

use crate::budget::Meter;
use crate::motion::MotionChecker;

/// Most cells; a larger field has larger ones.
const MOST_CELLS: f64 = 250_000.0;
/// Cells that count as one iteration of the budget.
const CELLS_PER_ITERATION: u32 = 64;

/// Distances over the centres of a coarse grid, from everywhere to the goal.
pub(super) struct DistanceField {
    min: Point2,
    side: f64,
    columns: usize,
    rows: usize,
    distances: Vec<f64>,
}

#[derive(PartialEq)]
struct Front {
    distance: f64,
    cell: usize,
}

impl Eq for Front {}

impl Ord for Front {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .distance
            .total_cmp(&self.distance)
            .then_with(|| other.cell.cmp(&self.cell))
    }
}

impl PartialOrd for Front {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl DistanceField {
    /// To `goal`, over cells of about `side` (m) in which the disc inscribed in the footprint fits somewhere; `None` if the budget
    /// ended.
    pub fn new(
        checker: &MotionChecker<'_>,
        goal: Point2,
        side: f64,
        meter: &mut Meter<'_>,
    ) -> Option<Self> {
        let world = checker.world();
        let bounds = world.bounds();
        let side = side.max((bounds.width() * bounds.height() / MOST_CELLS).sqrt());
        let count = |extent: f64| (extent / side).ceil().max(1.0) as usize;
        let (columns, rows) = (count(bounds.width()), count(bounds.height()));
        let mut field = Self {
            min: bounds.min,
            side,
            columns,
            rows,
            distances: vec![f64::INFINITY; columns * rows],
        };
        let Some(first) = field.cell(goal) else {
            return Some(field);
        };
        // Somewhere in the cell there may be room even if not in its middle.
        let need =
            checker.inscribed_radius() + checker.margin() - side * std::f64::consts::FRAC_1_SQRT_2;
        let mut is_open: Vec<Option<bool>> = vec![None; columns * rows];
        field.distances[first] = 0.0;
        let mut front = BinaryHeap::from([Front {
            distance: 0.0,
            cell: first,
        }]);
        let mut done = 0;
        while let Some(Front { distance, cell }) = front.pop() {
            if distance > field.distances[cell] {
                continue;
            }
            done += 1;
            if done % CELLS_PER_ITERATION == 0 && !meter.step() {
                return None;
            }
            let (x, y) = (cell % columns, cell / columns);
            for (dx, dy) in [
                (1, 0),
                (0, 1),
                (-1, 0),
                (0, -1),
                (1, 1),
                (-1, 1),
                (-1, -1),
                (1, -1),
            ] {
                let (Some(x), Some(y)) = (x.checked_add_signed(dx), y.checked_add_signed(dy))
                else {
                    continue;
                };
                if x >= columns || y >= rows {
                    continue;
                }
                let next = y * columns + x;
                let step = if dx == 0 || dy == 0 {
                    side
                } else {
                    side * std::f64::consts::SQRT_2
                };
                if distance + step >= field.distances[next] {
                    continue;
                }
                let open = *is_open[next].get_or_insert_with(|| {
                    let centre = field.centre(next);
                    world.clearance_lower_bound(centre) >= need || world.clearance(centre) >= need
                });
                if open {
                    field.distances[next] = distance + step;
                    front.push(Front {
                        distance: distance + step,
                        cell: next,
                    });
                }
            }
        }
        Some(field)
    }

    /// From `p`, m; `None` where the goal cannot be reached from.
    pub fn distance(&self, p: Point2) -> Option<f64> {
        let distance = self.distances[self.cell(p)?];
        distance.is_finite().then_some(distance)
    }

    fn centre(&self, cell: usize) -> Point2 {
        let half = |i: usize| self.side * (i as f64 + 0.5);
        Point2::new(
            self.min.x + half(cell % self.columns),
            self.min.y + half(cell / self.columns),
        )
    }

    fn cell(&self, p: Point2) -> Option<usize> {
        let (x, y) = (
            (p.x - self.min.x) / self.side,
            (p.y - self.min.y) / self.side,
        );
        let is_inside = x >= 0.0 && y >= 0.0 && x < self.columns as f64 && y < self.rows as f64;
        is_inside.then(|| y as usize * self.columns + x as usize)
    }
}
