//! Where a plan must be averaged before it is ridden, and where it may stand as it is.
//!
//! Everything works on tables of equally spaced samples.

/// Share of the averaged value at each sample: one within `reach` samples of a `marked` one, falling to
/// zero over the `fading` samples beyond, with two continuous derivatives.
#[must_use]
pub fn ramp_weights(marked: &[bool], reach: usize, fading: usize) -> Vec<f64> {
    if !marked.contains(&true) {
        return vec![0.0; marked.len()];
    }
    let share = |far: usize| {
        let beyond = far.saturating_sub(reach) as f64 / fading.max(1) as f64;
        let u = (1.0 - beyond).clamp(0.0, 1.0);
        u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
    };
    let mut left_over = vec![1.0; marked.len()];
    let mut since = usize::MAX;
    for (rest, mark) in left_over.iter_mut().zip(marked) {
        since = if *mark { 0 } else { since.saturating_add(1) };
        *rest *= 1.0 - share(since);
    }
    since = usize::MAX;
    for (rest, mark) in left_over.iter_mut().zip(marked).rev() {
        since = if *mark { 0 } else { since.saturating_add(1) };
        *rest *= 1.0 - share(since);
    }
    // The marks on either side join as a product, which has no kink half way between them.
    left_over.into_iter().map(|rest| 1.0 - rest).collect()
}

/// `raw` where the weight is zero, `averaged` where it is one.
#[must_use]
pub fn blend(raw: &[f64], averaged: &[f64], weights: &[f64]) -> Vec<f64> {
    raw.iter()
        .zip(averaged)
        .zip(weights)
        // Where nothing is averaged the plan stands to the last bit.
        .map(|((plan, mean), w)| {
            if *w == 0.0 {
                *plan
            } else {
                plan + w * (mean - plan)
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weighs_one_at_a_jump_and_nothing_far_from_it() {
        let mut marked = vec![false; 101];
        marked[50] = true;
        let w = ramp_weights(&marked, 10, 20);
        assert_eq!((w[40], w[50], w[60]), (1.0, 1.0, 1.0));
        assert_eq!((w[20], w[80]), (0.0, 0.0));
        // Half way down the quintic, and the same on both sides.
        assert!((w[30] - 0.5).abs() < 1e-12 && w[30] == w[70]);
    }

    #[test]
    fn without_a_jump_the_plan_stands() {
        let plan = [1.0, 2.0, 4.0];
        let weights = ramp_weights(&[false; 3], 1, 1);
        assert_eq!(blend(&plan, &[9.0; 3], &weights), plan);
    }
}
