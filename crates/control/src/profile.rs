//! Speed along a path: no faster than the corners, the steering and the drive allow.
//!
//! Everything works on tables of equally spaced samples.

/// The speed that keeps `v^2 |curvature|` within `lateral_acceleration`, m/s.
#[must_use]
pub fn corner_speed(curvature: f64, lateral_acceleration: f64, max_speed: f64) -> f64 {
    // A curvature below 1e-9 1/m would allow any speed; the floor only avoids dividing by zero.
    max_speed.min((lateral_acceleration / curvature.abs().max(1e-9)).sqrt())
}

/// Replaces each sample by the least within `reach` samples on either side.
#[must_use]
pub fn spread_minimum(values: &[f64], reach: usize) -> Vec<f64> {
    let n = values.len();
    let mut least = Vec::with_capacity(n);
    // Candidates in rising order: each is the least of all that come after it in the window.
    let mut candidates = std::collections::VecDeque::with_capacity(2 * reach + 2);
    let mut next = 0;
    for i in 0..n {
        while next < (i + reach + 1).min(n) {
            while candidates
                .back()
                .is_some_and(|&last: &usize| values[last] >= values[next])
            {
                candidates.pop_back();
            }
            candidates.push_back(next);
            next += 1;
        }
        while candidates.front().is_some_and(|&first| first + reach < i) {
            candidates.pop_front();
        }
        // A window of nothing but NaN has no least.
        least.push(candidates.front().map_or(f64::INFINITY, |&k| values[k]));
    }
    least
}

/// Lowers the speeds until neither speeding up nor slowing down exceeds `acceleration`, m/s^2,
/// with `step` m between samples.
pub fn limit_acceleration(speeds: &mut [f64], acceleration: f64, step: f64) {
    let gain = 2.0 * acceleration * step;
    let mut squares: Vec<f64> = speeds.iter().map(|v| v * v).collect();
    for i in 1..squares.len() {
        squares[i] = squares[i].min(squares[i - 1] + gain);
    }
    for i in (1..squares.len()).rev() {
        squares[i - 1] = squares[i - 1].min(squares[i] + gain);
    }
    for (speed, square) in speeds.iter_mut().zip(squares) {
        *speed = square.sqrt();
    }
}

/// Moving average over `window` samples, the end values continued beyond both ends.
#[must_use]
pub fn moving_average(values: &[f64], window: usize) -> Vec<f64> {
    let (n, half) = (values.len(), window / 2);
    if n == 0 || window < 2 {
        return values.to_vec();
    }
    /// A running sum is taken anew after this many samples, so that rounding does not add up.
    const ANEW: usize = 256;
    let at = |i: usize| values[i.saturating_sub(half).min(n - 1)];
    let mut sum = 0.0;
    (0..n)
        .map(|i| {
            if i % ANEW == 0 {
                sum = (i..i + window).map(at).sum::<f64>();
            } else {
                sum += at(i + window - 1) - at(i - 1);
            }
            sum / window as f64
        })
        .collect()
}

/// The full profile of a table of greatest speeds: spread, pinned to a speed at its start and one at its end,
/// limited in acceleration and averaged.
#[must_use]
pub fn speed_profile(
    limits: &[f64],
    step: f64,
    (start_speed, end_speed): (f64, f64),
    acceleration: f64,
) -> Vec<f64> {
    /// Corners are approached this early, m: the lean has to be there before the curvature.
    const SPREAD: f64 = 0.25;
    /// Rounds the kinks between accelerating and braking, m.
    const ROUNDING: f64 = 0.15;
    let mut speeds = spread_minimum(limits, (SPREAD / step) as usize);
    if let Some(first) = speeds.first_mut() {
        *first = first.min(start_speed);
    }
    if let Some(last) = speeds.last_mut() {
        *last = last.min(end_speed);
    }
    limit_acceleration(&mut speeds, acceleration, step);
    moving_average(&speeds, (ROUNDING / step).round() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn averages_with_the_ends_continued() {
        let averaged = moving_average(&[3.0, 0.0, 0.0, 6.0], 3);
        assert_eq!(averaged, vec![2.0, 1.0, 2.0, 4.0]);
    }

    proptest! {
        #[test]
        fn the_least_of_each_window_is_found(
            values in prop::collection::vec(0.0f64..1.0, 0..60), reach in 0usize..80,
        ) {
            let spread = spread_minimum(&values, reach);
            for (i, least) in spread.iter().enumerate() {
                let window = &values[i.saturating_sub(reach)..(i + reach + 1).min(values.len())];
                prop_assert_eq!(*least, window.iter().copied().fold(f64::INFINITY, f64::min));
            }
        }

        #[test]
        fn never_exceeds_the_limits_nor_the_acceleration(
            raw in prop::collection::vec(0.3f64..3.0, 60..200),
        ) {
            let step = 0.01;
            let profile = speed_profile(&raw, step, (0.3, 0.3), 0.3);
            for (i, v) in profile.iter().enumerate() {
                // The spread reaches further than the average, so the average stays below.
                prop_assert!(*v <= raw[i] + 1e-12);
            }
            for pair in profile.windows(2) {
                let rate = (pair[1] * pair[1] - pair[0] * pair[0]).abs() / (2.0 * step);
                // Averaging v instead of v^2 may add a little at the slow end.
                prop_assert!(rate <= 0.3 * 1.1, "{rate}");
            }
        }
    }
}
