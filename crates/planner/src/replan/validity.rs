//! How far ahead a path is still free, in a world that is not the one it was planned in.

use crate::motion::MotionChecker;
use bikebot_geometry::{CurvePath, FergusonCurve};

/// Halvings in search of the place where a curve stops being free: to 2⁻³⁰ of its parameter.
const HALVINGS: u32 = 30;
/// The resolution of the second look, in units of that of the plan: what is refused only because it nearly touches is looked at again.
const FINER: f64 = 0.01;

/// What is known of the rest of a path in a new world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Validity {
    /// Arc length up to which the whole footprint is proved free, m: the path's length if nothing is in the way.
    pub free_until: f64,
    /// The first and the last segment that is not free; `None` if all are.
    pub blocked: Option<[usize; 2]>,
}

impl Validity {
    /// Of `path` from arc length `from` (m) on, with no margin beyond touching.
    ///
    /// `checker` is the one the path was planned with: what it accepts has its margin and is free. Only where it refuses is the
    /// curve looked at with no margin and a hundredth of its resolution. So a path is always still valid in the world it was planned in.
    #[must_use]
    pub fn of(path: &CurvePath, from: f64, checker: &MotionChecker<'_>) -> Self {
        let touching = MotionChecker::new(
            checker.world(),
            checker.footprint(),
            0.0,
            FINER * checker.resolution(),
        );
        let is_free =
            |curve: &FergusonCurve| checker.is_curve_free(curve) || touching.is_curve_free(curve);
        let (first, t) = path.locate(from);
        let segments = path.segments();
        let mut free_until = path.length();
        let mut blocked: Option<[usize; 2]> = None;
        for (i, segment) in segments.iter().enumerate().skip(first) {
            // Of the first segment only the rest matters; nothing of it may be left.
            let begin = if i == first { t } else { 0.0 };
            if checker.is_curve_free(segment)
                || begin >= 1.0
                || is_free(&segment.sub_curve(begin, 1.0))
            {
                continue;
            }
            match &mut blocked {
                Some([_, last]) => *last = i,
                None => {
                    blocked = Some([i, i]);
                    let end = last_free(segment, begin, &touching);
                    let piece = segment.sub_curve(0.0, end);
                    let length = if end > 0.0 { piece.length() } else { 0.0 };
                    let at_most = path.segment_start(i + 1);
                    free_until = (path.segment_start(i) + length).min(at_most).max(from);
                }
            }
        }
        Self {
            free_until,
            blocked,
        }
    }

    /// Whether nothing is in the way.
    #[must_use]
    pub fn is_free(&self) -> bool {
        self.blocked.is_none()
    }
}

/// The largest parameter up to which the curve is proved free from `begin` on.
fn last_free(curve: &FergusonCurve, begin: f64, checker: &MotionChecker<'_>) -> f64 {
    let (mut free, mut blocked) = (begin, 1.0);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (free + blocked);
        // What lies before `free` is proved already.
        if checker.is_curve_free(&curve.sub_curve(free, middle)) {
            free = middle;
        } else {
            blocked = middle;
        }
    }
    free
}
