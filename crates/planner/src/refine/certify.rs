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

/// What is wrong with each of `curves` that has a fault, in their order; nothing means the curve is certified.
pub(crate) fn faults(
    curves: &[FergusonCurve],
    max_curvature: f64,
    checker: &MotionChecker<'_>,
) -> Vec<(usize, Fault)> {
    curves
        .iter()
        .enumerate()
        .filter_map(|(i, curve)| {
            let fault = if !(curve.is_finite() && curve.is_within_curvature(max_curvature)) {
                Fault::Tight
            } else if !checker.is_curve_free(curve) {
                Fault::Blocked
            } else {
                return None;
            };
            Some((i, fault))
        })
        .collect()
}
