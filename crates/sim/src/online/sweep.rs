//! Which cells of the belief the bike will ride over, and where on its path it first reaches each.
//!
//! The outline, grown by what the follower is allowed, is carried along the path once. After that one look along the list answers both
//! questions that are asked after every scan, without any clearance field: how far is all of it known to be free, and where does
//! the first thing stand that is known to be in the way?
//!
//! Places are taken every so often, [`STEP`] or [`SHORT_STEP`]; between two of them no point of the outline moves farther than half a step times
//! √((1 + κ·aside)² + (κ·ahead)²), and by so much the outline is grown on top. So a cell may be listed a centimetre too early, never
//! too late, and none is left out.

use bikebot_geometry::{CurvePath, FergusonCurve};
use bikebot_world::{Footprint, OccupancyGrid};

use super::hull::{Posed, Rim, RoundedBox};

/// Spacing of the places at which the outline is put down, m.
pub(crate) const STEP: f64 = 0.01;
/// The same for a path through the narrowest of gaps, m: half the growth for twice the work.
pub(crate) const SHORT_STEP: f64 = 0.005;
/// What rounding may take off an outline, in cells.
const ROUNDING: f64 = 1e-9;
/// In place of a cell: beyond the edge of the grid.
pub(crate) const OUTSIDE: u32 = u32::MAX;

/// A stretch of the path on which the bike covers a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Covered {
    /// Row times width plus column, or [`OUTSIDE`].
    pub cell: u32,
    /// Arc length at which the outline reaches it, m.
    pub first: f64,
}

/// The cells under one part of the outline at one place: of each row from the first on, the first column and one past the last.
#[derive(Debug, Clone, Default)]
struct Shadow {
    first_row: usize,
    rows: Vec<[u32; 2]>,
}

impl Shadow {
    /// Of the outline within `rim`, on a grid of so many cells.
    fn cast(&mut self, rim: &Rim, width: usize, height: usize) {
        // Casts saturate: what is off the grid is no cell of it.
        self.first_row = (rim.low - ROUNDING) as usize;
        let end = ((rim.high + ROUNDING).floor().max(-1.0) + 1.0) as usize;
        self.rows.clear();
        for row in self.first_row..end.min(height) {
            let span = rim.row(row as f64).map(|(least, most)| {
                let past = (most + ROUNDING).floor().max(-1.0) + 1.0;
                [(least - ROUNDING) as u32, (past as u32).min(width as u32)]
            });
            self.rows.push(span.unwrap_or([0, 0]));
        }
    }

    fn row(&self, row: usize) -> [u32; 2] {
        row.checked_sub(self.first_row)
            .and_then(|k| self.rows.get(k))
            .copied()
            .unwrap_or([0, 0])
    }

    fn holds(&self, row: usize, column: u32) -> bool {
        let [begin, end] = self.row(row);
        (begin..end).contains(&column)
    }
}

/// All cells that a ride covers, in the order in which it reaches them.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Sweep {
    covered: Vec<Covered>,
}

impl Sweep {
    /// Of the ride along `path` from arc length `from` (m) on, with a place every `step` (m).
    pub fn new(
        path: &CurvePath,
        from: f64,
        outline: &Footprint,
        allowance: f64,
        frame: &OccupancyGrid,
        step: f64,
    ) -> Self {
        let mut covered: Vec<Covered> = Vec::new();
        let (width, height) = (frame.width, frame.height);
        let curvatures: Vec<f64> = path
            .segments()
            .iter()
            .map(FergusonCurve::max_curvature)
            .collect();
        let body = RoundedBox::of(outline, allowance);
        // Where each part was one place before, and is now.
        let mut before = vec![Shadow::default(); body.len()];
        let mut now = before.clone();
        let mut was_outside = false;
        let (mut tail, mut head) = (path.locate(from).0, 0);
        let steps = ((path.length() - from) / step).ceil().max(1.0) as usize;
        for k in 0..=steps {
            let s = (from + k as f64 * step).min(path.length());
            let (begin, end) = ((s - 0.5 * step).max(from), s + 0.5 * step);
            let place = path.at(s);
            while tail + 1 < curvatures.len() && path.segment_start(tail + 1) <= begin {
                tail += 1;
            }
            head = head.max(tail);
            while head + 1 < curvatures.len() && path.segment_start(head + 1) <= end {
                head += 1;
            }
            let curvature = curvatures[tail..=head].iter().copied().fold(0.0, f64::max);
            let origin = frame.to_cell_coordinates(place.position);
            let turned = (place.heading - frame.origin.heading).sin_cos();
            let mut is_outside = false;
            for (index, part) in body.iter().enumerate() {
                let part = RoundedBox {
                    radius: part.radius + 0.5 * step * part.speed_bound(curvature),
                    ..*part
                };
                let posed = Posed::new(part.scaled(frame.resolution.recip()), origin, turned);
                let [left, right, low, high] = posed.extent();
                // Not a number is outside as well.
                let is_inside =
                    left >= 0.0 && low >= 0.0 && right <= width as f64 && high <= height as f64;
                is_outside |= !is_inside;
                now[index].cast(&Rim::of(&posed), width, height);
                let (earlier, this) = now.split_at(index);
                let this = &this[0];
                for (row, &[begin_column, end_column]) in (this.first_row..).zip(this.rows.iter()) {
                    let [a, b] = before[index].row(row);
                    // What this part has not covered one place before, on either side of what it has.
                    let (a, b) = if a < b {
                        (a, b)
                    } else {
                        (end_column, end_column)
                    };
                    let new =
                        (begin_column..end_column.min(a)).chain(begin_column.max(b)..end_column);
                    for column in new {
                        let is_known = |shadow: &Shadow| shadow.holds(row, column);
                        if !earlier.iter().any(is_known) && !before.iter().any(is_known) {
                            covered.push(Covered {
                                cell: (row * width) as u32 + column,
                                first: begin,
                            });
                        }
                    }
                }
            }
            if is_outside && !was_outside {
                covered.push(Covered {
                    cell: OUTSIDE,
                    first: begin,
                });
            }
            was_outside = is_outside;
            std::mem::swap(&mut before, &mut now);
        }
        Self { covered }
    }

    /// All cells of the grid that it covers, some of them twice.
    pub fn all(&self) -> impl Iterator<Item = u32> + '_ {
        self.covered
            .iter()
            .map(|entry| entry.cell)
            .filter(|cell| *cell != OUTSIDE)
    }

    /// The cells that the bike at arc length `s` (m) does not cover yet, nearest first. What it covers already it stands on.
    pub fn ahead(&self, s: f64) -> &[Covered] {
        let first = self.covered.partition_point(|entry| entry.first <= s);
        &self.covered[first..]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::{Point2, Pose2};
    use bikebot_world::{Bounds, Cell, Obstacle, World};

    fn frame() -> OccupancyGrid {
        OccupancyGrid::filled(200, 120, 0.1, Pose2::new(-2.0, -4.0, 0.0), Cell::Unknown).unwrap()
    }

    fn path() -> CurvePath {
        let poses = [
            (0.0, 0.0, 0.0),
            (5.0, 1.0, 0.6),
            (9.0, 5.0, 0.8),
            (14.0, 5.0, -0.5),
        ];
        let curves = poses.windows(2).map(|pair| {
            let pose = |(x, y, heading): (f64, f64, f64)| Pose2::new(x, y, heading);
            let chord = (pose(pair[1]).position - pose(pair[0]).position).norm();
            FergusonCurve::between(pose(pair[0]), pose(pair[1]), chord)
        });
        CurvePath::new(curves.collect()).unwrap()
    }

    /// The first arc length at which the outline overlaps a cell, by dense sampling.
    fn first_overlap(
        path: &CurvePath,
        from: f64,
        outline: &Footprint,
        x: f64,
        y: f64,
    ) -> Option<f64> {
        let cell = Obstacle::Block {
            min: Point2::new(x, y),
            max: Point2::new(x + 0.1, y + 0.1),
        };
        let world = World::new(Bounds::new(-50.0, -50.0, 50.0, 50.0), vec![cell]).unwrap();
        let mut s = from;
        while s <= path.length() {
            let place = path.at(s);
            let pose = Pose2 {
                position: place.position,
                heading: place.heading,
            };
            if world.overlaps(outline, &pose) {
                return Some(s);
            }
            s += 0.005;
        }
        None
    }

    #[test]
    fn no_cell_is_listed_too_late_and_none_is_left_out() {
        let (path, frame) = (path(), frame());
        let outline = Footprint::bike().grown(0.05);
        let sweep = Sweep::new(&path, 1.0, &Footprint::bike(), 0.05, &frame, STEP);
        let mut checked = 0;
        for y in (0..frame.height).step_by(3) {
            for x in (0..frame.width).step_by(3) {
                let corner = frame.cell_centre(x, y);
                let Some(s) = first_overlap(&path, 1.0, &outline, corner.x - 0.05, corner.y - 0.05)
                else {
                    continue;
                };
                let cell = (y * frame.width + x) as u32;
                let entry = sweep
                    .covered
                    .iter()
                    .find(|entry| entry.cell == cell)
                    .unwrap();
                // Early by a step, and by what the outline is grown for it over the angle at which it arrives.
                assert!(entry.first <= s, "{} {s}", entry.first);
                checked += 1;
            }
        }
        assert!(checked > 100, "{checked}");
    }

    #[test]
    fn a_cell_across_the_way_is_listed_a_few_centimetres_early() {
        let line = CurvePath::new(vec![FergusonCurve::straight(
            Point2::new(0.0, 0.05),
            Point2::new(10.0, 0.05),
        )])
        .unwrap();
        let frame = frame();
        let sweep = Sweep::new(&line, 0.0, &Footprint::bike(), 0.05, &frame, STEP);
        let (x, y) = frame.world_to_cell(Point2::new(7.05, 0.05)).unwrap();
        let entry = sweep
            .ahead(0.0)
            .iter()
            .find(|entry| entry.cell == (y * frame.width + x) as u32)
            .unwrap();
        // Reached when the rear contact is at 7.0 − 1.16 − 0.35.
        let exact = 7.0 - 1.16 - 0.35;
        assert!(
            entry.first <= exact && entry.first > exact - 2.0 * STEP,
            "{}",
            entry.first
        );
    }

    #[test]
    fn what_the_bike_stands_on_is_not_ahead_but_what_it_comes_back_to_is() {
        // Once round a circle of 3 m.
        let quarter = std::f64::consts::FRAC_PI_2;
        let pose = |k: usize| {
            let angle = quarter * k as f64;
            Pose2::new(5.0 + 3.0 * angle.sin(), 1.0 - 3.0 * angle.cos(), angle)
        };
        let speed = 3.0 * 4.0 * (quarter / 4.0).tan();
        let circle = (0..4)
            .map(|k| FergusonCurve::between(pose(k), pose(k + 1), speed))
            .collect();
        let circle = CurvePath::new(circle).unwrap();
        let frame = frame();
        let sweep = Sweep::new(&circle, 0.0, &Footprint::bike(), 0.05, &frame, STEP);
        let start = frame.world_to_cell(Point2::new(5.0, -2.0)).unwrap();
        let cell = (start.1 * frame.width + start.0) as u32;
        let again = sweep
            .ahead(0.0)
            .iter()
            .find(|entry| entry.cell == cell)
            .unwrap();
        // The front comes back before the rear does.
        assert!((circle.length() - 2.0..circle.length()).contains(&again.first));
    }

    #[test]
    fn the_edge_of_the_grid_is_in_the_way() {
        let line = CurvePath::new(vec![FergusonCurve::straight(
            Point2::new(0.0, 0.0),
            Point2::new(20.0, 0.0),
        )])
        .unwrap();
        let sweep = Sweep::new(&line, 0.0, &Footprint::bike(), 0.0, &frame(), STEP);
        let edge = sweep
            .ahead(0.0)
            .iter()
            .find(|entry| entry.cell == OUTSIDE)
            .unwrap();
        assert!(
            (edge.first - (18.0 - 1.46)).abs() < 2.0 * STEP,
            "{}",
            edge.first
        );
    }
}
