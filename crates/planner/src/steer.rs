//! Line 10 of Algorithm 1: from the nearest node toward the sample, at most one step.

use bikebot_geometry::Point2;

/// The point on the way from `from` to `toward`, at most `max_step` (the paper's ε, m) away from `from`.
///
/// `toward` itself if it is near enough. Headings are not steered; whoever has one draws it again
/// where the node ends up.
#[must_use]
pub fn steer(from: Point2, toward: Point2, max_step: f64) -> Point2 {
    let way = toward - from;
    let distance = way.norm();
    if distance <= max_step {
        toward
    } else {
        from + way * (max_step / distance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_near_sample_is_kept_as_it_is() {
        let sample = Point2::new(0.1, 0.7);
        assert_eq!(steer(Point2::origin(), sample, 1.0), sample);
        assert_eq!(steer(sample, sample, 1.0), sample);
    }

    proptest! {
        #[test]
        fn a_far_sample_is_approached_by_one_step_in_its_direction(
            x in -50.0..50.0_f64, y in -50.0..50.0_f64, step in 0.1..5.0_f64,
        ) {
            let (from, sample) = (Point2::new(1.0, 2.0), Point2::new(x, y));
            let new = steer(from, sample, step);
            let (before, after) = ((sample - from).norm(), (sample - new).norm());
            // 50 m times a few roundings.
            prop_assert!((new - from).norm() <= step + 1e-12);
            prop_assert!(((new - from).norm() + after - before).abs() < 1e-12);
        }
    }
}
