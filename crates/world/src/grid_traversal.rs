//! The cells a straight line crosses, in order.

use bikebot_geometry::Vector2;

/// Iterator over the cells a segment crosses; see [`crate::OccupancyGrid::traverse`].
///
/// After Amanatides & Woo 1987, with the number of steps known beforehand: rounding can then
/// neither overshoot the last cell nor loop.
#[derive(Debug, Clone)]
pub struct GridTraversal {
    cell: (isize, isize),
    step: (isize, isize),
    /// Parameter along the segment of the next vertical and the next horizontal grid line.
    next: Vector2,
    /// Parameter between two such lines.
    delta: Vector2,
    /// Cells still to come along each axis.
    left: (usize, usize),
    started: bool,
    empty: bool,
}

/// Between which parameters `t` the segment `from + span t`, 0 ≤ t ≤ 1, is within `[0, size]` (all in cells); `None` for one that never is, or
/// is not finite.
#[must_use]
pub fn overlap_with_grid(size: [f64; 2], from: Vector2, span: Vector2) -> Option<(f64, f64)> {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        if span[axis] == 0.0 {
            // Written so that NaN counts as off the grid.
            if !(from[axis] >= 0.0 && from[axis] < size[axis]) {
                return None;
            }
        } else {
            let a = -from[axis] / span[axis];
            let b = (size[axis] - from[axis]) / span[axis];
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
    }
    (enter <= leave && span.x.is_finite() && span.y.is_finite()).then_some((enter, leave))
}

impl GridTraversal {
    pub(crate) fn new(width: usize, height: usize, from: Vector2, to: Vector2) -> Self {
        let mut traversal = Self {
            cell: (0, 0),
            step: (0, 0),
            next: Vector2::repeat(f64::INFINITY),
            delta: Vector2::repeat(f64::INFINITY),
            left: (0, 0),
            started: false,
            empty: true,
        };
        let size = Vector2::new(width as f64, height as f64);
        let span = to - from;
        let Some((enter, leave)) = overlap_with_grid([size.x, size.y], from, span) else {
            return traversal;
        };
        let cell_at = |t: f64, axis: usize| {
            let last = size[axis] - 1.0;
            (from[axis] + span[axis] * t).floor().clamp(0.0, last) as isize
        };
        let first = (cell_at(enter, 0), cell_at(enter, 1));
        let last = (cell_at(leave, 0), cell_at(leave, 1));
        traversal.cell = first;
        traversal.step = ((last.0 - first.0).signum(), (last.1 - first.1).signum());
        traversal.left = (first.0.abs_diff(last.0), first.1.abs_diff(last.1));
        for (axis, (cell, step)) in [(first.0, traversal.step.0), (first.1, traversal.step.1)]
            .into_iter()
            .enumerate()
        {
            if step != 0 {
                let line = (cell + isize::from(step > 0)) as f64;
                traversal.next[axis] = (line - from[axis]) / span[axis];
                traversal.delta[axis] = span[axis].abs().recip();
            }
        }
        traversal.empty = false;
        traversal
    }
}

impl Iterator for GridTraversal {
    type Item = (usize, usize);

    fn next(&mut self) -> Option<Self::Item> {
        if self.empty {
            return None;
        }
        if self.started {
            let along_x = match self.left {
                (0, 0) => {
                    self.empty = true;
                    return None;
                }
                (0, _) => false,
                (_, 0) => true,
                _ => self.next.x <= self.next.y,
            };
            if along_x {
                self.cell.0 += self.step.0;
                self.next.x += self.delta.x;
                self.left.0 -= 1;
            } else {
                self.cell.1 += self.step.1;
                self.next.y += self.delta.y;
                self.left.1 -= 1;
            }
        }
        self.started = true;
        Some((self.cell.0 as usize, self.cell.1 as usize))
    }
}
