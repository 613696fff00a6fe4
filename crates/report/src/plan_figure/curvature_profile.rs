//! Curvature along a path.

use bikebot_geometry::{ArcLength, CurvePath, FergusonCurve, ParametricCurve};

/// Curvature along a path: enough points to see every bend, and the exact extreme.
pub(super) struct CurvatureProfile {
    /// Arc length and curvature, growing in arc length; two points where it jumps.
    pub(super) points: Vec<[f64; 2]>,
    /// Arc length and curvature of the largest |σ|.
    pub(super) most: (f64, f64),
}

impl CurvatureProfile {
    pub(super) fn of(path: &CurvePath) -> Self {
        const ROUGH: usize = 16;
        let mut points = Vec::new();
        let mut most = (0.0, 0.0_f64);
        for (index, segment) in path.segments().iter().enumerate() {
            let table = ArcLength::new(segment);
            let start = path.segment_start(index);
            let share = table.length() / path.length();
            let pieces = ((2400.0 * share).ceil() as usize).clamp(ROUGH, 2400);
            for piece in 0..=pieces {
                let t = piece as f64 / pieces as f64;
                let s = start + table.arc_length_at(t);
                let curvature = segment.curvature(t);
                points.push([s, curvature]);
            }
            let (t, curvature) = largest(segment, pieces);
            if curvature.abs() > most.1.abs() {
                most = (start + table.arc_length_at(t), curvature);
            }
        }
        Self { points, most }
    }
}

/// Parameter and value of the largest |σ| of a curve: the best of `pieces`, then narrowed down.
pub(super) fn largest(curve: &FergusonCurve, pieces: usize) -> (f64, f64) {
    let size = |t: f64| curve.curvature(t).abs();
    let best = (0..=pieces)
        .map(|piece| piece as f64 / pieces as f64)
        .max_by(|a, b| size(*a).total_cmp(&size(*b)))
        .unwrap_or(0.0);
    let (mut low, mut high) = (
        (best - 1.0 / pieces as f64).max(0.0),
        (best + 1.0 / pieces as f64).min(1.0),
    );
    for _ in 0..60 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if size(a) < size(b) {
            low = a;
        } else {
            high = b;
        }
    }
    let middle = (low + high) / 2.0;
    let t = if size(middle) > size(best) {
        middle
    } else {
        best
    };
    (t, curve.curvature(t))
}
