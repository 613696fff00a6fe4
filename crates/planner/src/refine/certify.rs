//! Whether a curve may be ridden: the exact curvature limit, and the whole footprint free on every segment.

use crate::motion::MotionChecker;
use bikebot_geometry::FergusonCurve;

/// Why a segment may not be ridden.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    /// Tighter than σ_MAX.
    Tight,
    /// Not free of obstacles by the margin.
    Blocked,
    /// Ridden against the prescribed heading at an end.
    Backward,
}

/// After so many curves it is asked whether to go on.
const ASKED_EVERY: usize = 64;

/// What is wrong with each of `curves` that has a fault, in their order; nothing means the curve is certified. `None` if `go_on` says no
/// on the way.
pub(crate) fn faults(
    curves: &[FergusonCurve],
    max_curvature: f64,
    checker: &MotionChecker<'_>,
    go_on: &dyn Fn() -> bool,
) -> Option<Vec<(usize, Fault)>> {
    let mut faults = Vec::new();
    for (i, curve) in curves.iter().enumerate() {
        if i % ASKED_EVERY == ASKED_EVERY - 1 && !go_on() {
            return None;
        }
        if !(curve.is_finite() && curve.is_within_curvature(max_curvature)) {
            faults.push((i, Fault::Tight));
        } else if !checker.is_curve_free(curve) {
            faults.push((i, Fault::Blocked));
        }
    }
    Some(faults)
}
