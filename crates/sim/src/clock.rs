//! Simulated time in whole nanoseconds, and periods that divide one another.
//!
//! Whole numbers, because a simulation that adds 0.0025 s four hundred times in
//! floating point does not arrive at 1 s, and a sensor rate compared against
//! such a sum fires a tick early or late. Wall clocks have no part in this.

use std::ops::Add;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Nanoseconds in a second.
const NANOSECONDS: f64 = 1e9;

/// A moment of simulated time, counted from the start of the run.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
pub struct SimTime(u64);

impl SimTime {
    /// The start of the run.
    pub const ZERO: Self = Self(0);

    /// The moment this many nanoseconds after the start.
    #[must_use]
    pub const fn from_nanoseconds(nanoseconds: u64) -> Self {
        Self(nanoseconds)
    }

    /// The nearest whole nanosecond to `seconds` after the start.
    ///
    /// A negative or undefined value is the start, one too large for the count
    /// (584 years) the last moment there is.
    #[must_use]
    pub fn from_seconds(seconds: f64) -> Self {
        // A float-to-integer cast saturates and takes NaN to zero.
        Self((seconds * NANOSECONDS).round() as u64)
    }

    /// Nanoseconds since the start.
    #[must_use]
    pub const fn nanoseconds(self) -> u64 {
        self.0
    }

    /// Seconds since the start; exact to a nanosecond for the first 104 days.
    #[must_use]
    pub fn seconds(self) -> f64 {
        self.0 as f64 / NANOSECONDS
    }

    /// The seconds from `earlier` to this moment, negative if it lies ahead.
    #[must_use]
    pub fn seconds_since(self, earlier: Self) -> f64 {
        if self >= earlier {
            Self(self.0 - earlier.0).seconds()
        } else {
            -Self(earlier.0 - self.0).seconds()
        }
    }
}

impl Add<Period> for SimTime {
    type Output = Self;

    fn add(self, period: Period) -> Self {
        Self(self.0.saturating_add(period.0))
    }
}

/// A length of simulated time that is a whole, positive number of nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Period(u64);

/// A step or rate that cannot be kept by whole steps.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum ClockError {
    /// The length is not positive, not finite, or finer than a nanosecond.
    #[error("a period must be positive and a whole number of nanoseconds, got {seconds} s")]
    NotAPeriod {
        /// What was asked for, s.
        seconds: f64,
    },
    /// One period is not a whole number of the other.
    #[error("a period of {period_s} s is not a whole number of steps of {step_s} s")]
    DoesNotDivide {
        /// The shorter period, s.
        step_s: f64,
        /// The longer period, s.
        period_s: f64,
    },
}

impl Period {
    /// A period of `seconds`.
    ///
    /// # Errors
    ///
    /// [`ClockError::NotAPeriod`] unless the length is positive and a whole
    /// number of nanoseconds, to a hundredth of one.
    pub fn from_seconds(seconds: f64) -> Result<Self, ClockError> {
        let exact = seconds * NANOSECONDS;
        let whole = exact.round();
        // 2^53 ns is 104 days; beyond it the product is no longer exact.
        if whole >= 1.0 && whole <= 2f64.powi(53) && (exact - whole).abs() <= 0.01 {
            Ok(Self(whole as u64))
        } else {
            Err(ClockError::NotAPeriod { seconds })
        }
    }

    /// The period of a rate in hertz.
    ///
    /// # Errors
    ///
    /// [`ClockError::NotAPeriod`] for a rate whose period is no whole number of
    /// nanoseconds, such as 30 Hz.
    pub fn from_hertz(rate_hz: f64) -> Result<Self, ClockError> {
        Self::from_seconds(1.0 / rate_hz)
    }

    /// How long, s.
    #[must_use]
    pub fn seconds(self) -> f64 {
        self.0 as f64 / NANOSECONDS
    }

    /// How long, ns.
    #[must_use]
    pub const fn nanoseconds(self) -> u64 {
        self.0
    }

    /// How many of `step` make one of this period.
    ///
    /// # Errors
    ///
    /// [`ClockError::DoesNotDivide`] unless that is a whole number.
    pub fn in_steps_of(self, step: Self) -> Result<u64, ClockError> {
        if self.0.is_multiple_of(step.0) {
            Ok(self.0 / step.0)
        } else {
            Err(ClockError::DoesNotDivide {
                step_s: step.seconds(),
                period_s: self.seconds(),
            })
        }
    }

    /// The moment `count` periods after the start.
    #[must_use]
    pub const fn times(self, count: u64) -> SimTime {
        SimTime(self.0.saturating_mul(count))
    }

    /// Whether `time` falls on a whole number of these periods.
    #[must_use]
    pub const fn is_due(self, time: SimTime) -> bool {
        time.0.is_multiple_of(self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_hundred_steps_of_two_and_a_half_milliseconds_make_exactly_a_second() {
        let step = Period::from_seconds(0.0025).unwrap();
        let mut time = SimTime::ZERO;
        for _ in 0..400 {
            time = time + step;
        }
        assert_eq!(time, SimTime::from_seconds(1.0));
        assert_eq!(time, step.times(400));
        assert_eq!(time.seconds(), 1.0);
        assert_eq!(time.seconds_since(step.times(399)), 0.0025);
        assert_eq!(step.times(399).seconds_since(time), -0.0025);
    }

    #[test]
    fn rates_that_divide_are_counted_and_others_refused() {
        let physics = Period::from_seconds(0.0025).unwrap();
        let control = Period::from_seconds(0.005).unwrap();
        assert_eq!(control.in_steps_of(physics), Ok(2));
        assert_eq!(
            Period::from_seconds(0.006).unwrap().in_steps_of(physics),
            Err(ClockError::DoesNotDivide {
                step_s: 0.0025,
                period_s: 0.006
            })
        );
        assert_eq!(Period::from_hertz(20.0).unwrap().nanoseconds(), 50_000_000);
        assert!(Period::from_hertz(30.0).is_err());
    }

    #[test]
    fn nonsense_is_no_period_and_never_a_wrapped_time() {
        for seconds in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-10, 1e30] {
            assert!(Period::from_seconds(seconds).is_err(), "{seconds}");
        }
        assert_eq!(SimTime::from_seconds(-1.0), SimTime::ZERO);
        assert_eq!(SimTime::from_seconds(f64::NAN), SimTime::ZERO);
        assert_eq!(SimTime::from_seconds(1e30).nanoseconds(), u64::MAX);
    }

    #[test]
    fn a_period_is_due_on_its_own_multiples_only() {
        let period = Period::from_hertz(20.0).unwrap();
        assert!(period.is_due(SimTime::ZERO));
        assert!(period.is_due(SimTime::from_seconds(0.05)));
        assert!(!period.is_due(SimTime::from_seconds(0.0525)));
    }
}
