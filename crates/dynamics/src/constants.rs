//! Physical constants.

/// Acceleration of free fall, m/s²; the value every reference vector is computed with.
pub const GRAVITY: f64 = 9.81;
