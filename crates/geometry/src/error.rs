//! What can be wrong with geometry handed to this crate.

/// Geometry that makes no sense.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GeometryError {
    /// A polyline or a path without a single element.
    #[error("{what} needs at least one element")]
    Empty {
        /// What was to be built.
        what: &'static str,
    },
    /// A coordinate that is not a finite number.
    #[error("element {index} of the {what} has a coordinate that is not finite")]
    NotFinite {
        /// What was to be built.
        what: &'static str,
        /// Zero-based index of the offending vertex or segment.
        index: usize,
    },
    /// A curve segment without length: it has no heading, so nothing can follow it.
    #[error("segment {index} of the path has no length")]
    NoLength {
        /// Zero-based index of the offending segment.
        index: usize,
    },
    /// Two neighbouring segments that do not meet.
    #[error("segment {index} of the path starts {gap} m away from the end of the one before")]
    Gap {
        /// Zero-based index of the later segment.
        index: usize,
        /// Distance between the two ends, m.
        gap: f64,
    },
}
