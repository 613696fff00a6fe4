//! What makes no sense in this crate.

use bikebot_world::WorldError;

/// Parameters, or a scan, from which no belief can be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MappingError {
    /// A grid that cannot be laid out.
    #[error(transparent)]
    Grid(#[from] WorldError),
    /// Thresholds that contradict each other.
    #[error(
        "the mapper's log-odds must not fall along free_limit {free_limit}, free_at {free_at}, free_until {free_until}, occupied_until {occupied_until}, occupied_at {occupied_at}, occupied_limit {occupied_limit}"
    )]
    Thresholds {
        /// Least log-odds a cell may have.
        free_limit: f64,
        /// At most this: free.
        free_at: f64,
        /// A free cell stays free up to this.
        free_until: f64,
        /// An occupied cell stays occupied down to this.
        occupied_until: f64,
        /// At least this: occupied.
        occupied_at: f64,
        /// Largest log-odds a cell may have.
        occupied_limit: f64,
    },
    /// Thresholds that would free a cell for what hit it, or fill one for what passed.
    #[error(
        "the mapper's free_at {free_at} must lie below 0 and occupied_at {occupied_at} above 0, by a thousandth at least: a cell of which nothing is known has log-odds of 0"
    )]
    ThresholdSigns {
        /// At most this: free.
        free_at: f64,
        /// At least this: occupied.
        occupied_at: f64,
    },
    /// Moving things whose least radius is above the largest.
    #[error("the tracker's min_radius_m {min} m is above max_radius_m {max} m")]
    Radii {
        /// Least radius, m.
        min: f64,
        /// Largest radius, m.
        max: f64,
    },
    /// A pose that is not a number, so that nobody knows where the scan was taken.
    #[error(
        "beam {beam} of the scan was fired at ({x} m, {y} m, {heading} rad) with a roll of {roll} rad: each must be finite"
    )]
    Pose {
        /// Which beam, from 0.
        beam: usize,
        /// m.
        x: f64,
        /// m.
        y: f64,
        /// rad.
        heading: f64,
        /// rad.
        roll: f64,
    },
    /// Angles or times of a scan that are not numbers.
    #[error(
        "a scan from angle {angle_min} rad by {angle_step} rad, from time {start} s by {beam_period} s: each must be finite"
    )]
    Scan {
        /// Angle of the first beam, rad.
        angle_min: f64,
        /// Angle between beams, rad.
        angle_step: f64,
        /// Time of the first beam, s.
        start: f64,
        /// Time between beams, s.
        beam_period: f64,
    },
}
