//! What many values come to in four numbers.

use serde::Serialize;

/// Mean and quantiles of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Arithmetic mean.
    pub mean: f64,
    /// Half the values are at most this.
    pub median: f64,
    /// One in twenty is at most this.
    pub p05: f64,
    /// One in twenty is at least this.
    pub p95: f64,
}

impl Spread {
    /// The spread of `values`; `None` for none. Quantiles are interpolated linearly between the sorted values.
    #[must_use]
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        if sorted.is_empty() {
            return None;
        }
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len() - 1;
        let quantile = |share: f64| {
            let at = share * last as f64;
            let below = (at.floor() as usize).min(last);
            let above = (below + 1).min(last);
            let part = at - below as f64;
            sorted[below] + (sorted[above] - sorted[below]) * part
        };
        Some(Self {
            mean: sorted.iter().sum::<f64>() / sorted.len() as f64,
            median: quantile(0.5),
            p05: quantile(0.05),
            p95: quantile(0.95),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_of_zero_to_hundred_is_its_numbers() {
        let spread = Spread::of((0..=100).rev().map(f64::from)).unwrap();
        assert_eq!(
            (spread.mean, spread.median, spread.p05, spread.p95),
            (50.0, 50.0, 5.0, 95.0)
        );
    }

    #[test]
    fn quantiles_lie_between_values() {
        let spread = Spread::of([4.0, 1.0]).unwrap();
        assert_eq!((spread.mean, spread.median), (2.5, 2.5));
        // A share of the step from 1 to 4, up to rounding.
        assert!((spread.p05 - 1.15).abs() < 1e-12);
    }

    #[test]
    fn one_value_is_all_of_them_and_none_has_no_spread() {
        let spread = Spread::of([7.0]).unwrap();
        assert_eq!((spread.mean, spread.p05, spread.p95), (7.0, 7.0, 7.0));
        assert_eq!(Spread::of([]), None);
    }
}
