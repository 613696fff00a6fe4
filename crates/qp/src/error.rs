//! Input that makes no sense. How a solve *ended* is [`Status`](crate::Status), not an error.

use thiserror::Error;

/// Why a problem could not be stated. The problem held before the failing call is unchanged.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum QpError {
    /// A problem has at least one unknown.
    #[error("a quadratic programme needs at least one unknown")]
    NoUnknowns,
    /// More of something than room was set aside for when the solver was made.
    #[error("no room for more than {capacity} {what}")]
    Full {
        /// What there are too many of: `unknowns`, `rows` or `equality rows`.
        what: &'static str,
        /// How many there is room for.
        capacity: usize,
    },
    /// A slice of the wrong length.
    #[error("{what} needs {expected} values, {found} were given")]
    Dimension {
        /// Which argument.
        what: &'static str,
        /// The length it must have.
        expected: usize,
        /// The length it had.
        found: usize,
    },
    /// An unknown that does not exist.
    #[error("unknown {index} does not exist, there are {unknowns}")]
    IndexOutOfRange {
        /// The index given.
        index: usize,
        /// Number of unknowns; valid indices are below it.
        unknowns: usize,
    },
    /// An inequality row that does not exist.
    #[error("row {index} does not exist, there are {rows}")]
    NoSuchRow {
        /// The index given.
        index: usize,
        /// Number of rows; valid indices are below it.
        rows: usize,
    },
    /// A Hessian entry too far from the diagonal.
    #[error("Hessian entry ({row}, {column}) lies outside the band |row − column| < {window}")]
    OutsideBand {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// The band's window.
        window: usize,
    },
    /// A row whose unknowns are not consecutive enough, or do not exist.
    #[error(
        "a row on unknowns {first}..{first}+{length} does not fit a window of {window} among {unknowns} unknowns"
    )]
    WindowOutOfRange {
        /// First unknown the row touches.
        first: usize,
        /// How many consecutive unknowns it touches.
        length: usize,
        /// The most it may touch.
        window: usize,
        /// Number of unknowns.
        unknowns: usize,
    },
    /// A NaN or an infinity where a number is needed.
    #[error("{what} is {value}, which is not a finite number")]
    NotFinite {
        /// Which argument.
        what: &'static str,
        /// The value given.
        value: f64,
    },
    /// A dense Hessian whose two triangles differ.
    #[error(
        "the Hessian is not symmetric: entry ({row}, {column}) differs from its mirror by {by}"
    )]
    NotSymmetric {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// H_ij − H_ji.
        by: f64,
    },
    /// The price of violating an elastic row, which must be positive and finite.
    #[error("the weight of an elastic row must be positive and finite, not {weight}")]
    Weight {
        /// The weight given.
        weight: f64,
    },
    /// A box that is empty, or whose side is NaN or on the wrong side of everything.
    #[error("the box [{lower}, {upper}] of unknown {index} holds no number")]
    EmptyBox {
        /// The unknown.
        index: usize,
        /// Lower side.
        lower: f64,
        /// Upper side.
        upper: f64,
    },
}

/// `value` if it is a finite number.
pub(crate) fn finite(what: &'static str, value: f64) -> Result<f64, QpError> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(QpError::NotFinite { what, value })
    }
}

/// Every value a finite number, and as many as expected.
pub(crate) fn finite_values(
    what: &'static str,
    values: &[f64],
    expected: usize,
) -> Result<(), QpError> {
    if values.len() != expected {
        return Err(QpError::Dimension {
            what,
            expected,
            found: values.len(),
        });
    }
    values.iter().try_for_each(|&v| finite(what, v).map(drop))
}

/// The price of an elastic row, positive and finite.
pub(crate) fn positive_weight(weight: f64) -> Result<f64, QpError> {
    if weight > 0.0 && weight.is_finite() {
        Ok(weight)
    } else {
        Err(QpError::Weight { weight })
    }
}

/// Whether one more fits.
pub(crate) fn room(what: &'static str, held: usize, capacity: usize) -> Result<(), QpError> {
    if held < capacity {
        Ok(())
    } else {
        Err(QpError::Full { what, capacity })
    }
}
