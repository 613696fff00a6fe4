//! Polynomials on [0, 1] in Bernstein form: bounds, subdivision and all real roots.
//!
//! The coefficients bound the polynomial from both sides, and the number of their sign
//! changes bounds the number of roots (Descartes' rule in Bernstein form). Bisecting until
//! at most one sign change is left therefore isolates every root of odd multiplicity;
//! nothing is sampled.

/// Deepest bisection. An interval of 2⁻⁴⁰ is narrower than the places where the curvature of a
/// metre-sized curve can be told apart, so what is left there is reported as one root.
const MAX_DEPTH: u32 = 40;

/// Newton steps before a bracketed root is accepted as it stands; each step at least halves
/// the bracket, so 60 exhaust the resolution of a double.
const MAX_POLISH: u32 = 60;

/// Bernstein coefficients of the polynomial with power coefficients `power` (constant first).
pub(crate) fn from_power<const M: usize>(power: &[f64; M]) -> [f64; M] {
    // b_i = Σ_{j≤i} C(i,j)/C(n,j) q_j, by repeated differences: scale then accumulate.
    let n = M - 1;
    let mut b = [0.0; M];
    let mut binomial = 1.0;
    for j in 0..M {
        b[j] = power[j] / binomial;
        binomial = binomial * (n - j) as f64 / (j + 1) as f64;
    }
    for level in 1..M {
        for i in (level..M).rev() {
            b[i] += b[i - 1];
        }
    }
    b
}

/// Value and derivative at `t` of the polynomial with power coefficients `power`.
#[inline]
pub(crate) fn value_and_slope<const M: usize>(power: &[f64; M], t: f64) -> (f64, f64) {
    let mut value = power[M - 1];
    let mut slope = 0.0;
    for &q in power[..M - 1].iter().rev() {
        slope = slope * t + value;
        value = value * t + q;
    }
    (value, slope)
}

/// Calls `visit` with every root of odd multiplicity in (0, 1) of the polynomial `power`
/// (constant first). A root of even multiplicity, and numbers that rounding cannot tell from a
/// root, may be visited as well; the roots come in ascending order.
pub(crate) fn for_each_root<const M: usize>(power: &[f64; M], visit: &mut impl FnMut(f64)) {
    let b = from_power(power);
    isolate(power, &b, 0.0, 1.0, 0, visit);
}

fn isolate<const M: usize>(
    power: &[f64; M],
    b: &[f64; M],
    low: f64,
    high: f64,
    depth: u32,
    visit: &mut impl FnMut(f64),
) {
    let changes = sign_changes(b);
    if changes == 0 {
        return;
    }
    if changes == 1 && b[0] * b[M - 1] < 0.0 {
        visit(polish(power, low, high, b[0] < 0.0));
        return;
    }
    let middle = 0.5 * (low + high);
    if depth >= MAX_DEPTH {
        visit(middle);
        return;
    }
    let (left, right) = split(b);
    isolate(power, &left, low, middle, depth + 1, visit);
    if right[0] == 0.0 {
        visit(middle);
    }
    isolate(power, &right, middle, high, depth + 1, visit);
}

fn sign_changes<const M: usize>(b: &[f64; M]) -> u32 {
    let mut changes = 0;
    let mut last = 0.0;
    for &x in b {
        if x != 0.0 {
            if last * x.signum() < 0.0 {
                changes += 1;
            }
            last = x.signum();
        }
    }
    changes
}

/// De Casteljau at one half: the coefficients on the two halves of the interval.
fn split<const M: usize>(b: &[f64; M]) -> ([f64; M], [f64; M]) {
    let mut right = *b;
    let mut left = [0.0; M];
    for (level, first) in left.iter_mut().enumerate() {
        *first = right[0];
        for i in 0..M - 1 - level {
            right[i] = 0.5 * (right[i] + right[i + 1]);
        }
    }
    (left, right)
}

/// The one root between `low` and `high`, by Newton steps kept inside the shrinking bracket.
fn polish<const M: usize>(power: &[f64; M], mut low: f64, mut high: f64, rising: bool) -> f64 {
    let mut t = 0.5 * (low + high);
    for _ in 0..MAX_POLISH {
        let (value, slope) = value_and_slope(power, t);
        if value == 0.0 {
            return t;
        }
        if (value < 0.0) == rising {
            low = t;
        } else {
            high = t;
        }
        let newton = t - value / slope;
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        // The extremum sought is stationary in t: 1e-12 here is 1e-24 relative there.
        if (next - t).abs() < 1e-12 {
            return next;
        }
        t = next;
    }
    t
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn roots<const M: usize>(power: [f64; M]) -> Vec<f64> {
        let mut found = Vec::new();
        for_each_root(&power, &mut |t| found.push(t));
        found
    }

    /// Power coefficients of the product of (t − r).
    fn product(roots: [f64; 5]) -> [f64; 6] {
        let mut p = [0.0; 6];
        p[0] = 1.0;
        for (done, r) in roots.iter().enumerate() {
            for i in (0..=done + 1).rev() {
                p[i] = if i > 0 { p[i - 1] } else { 0.0 } - r * p[i];
            }
        }
        p
    }

    #[test]
    fn five_separate_roots_are_all_found() {
        let found = roots(product([0.1, 0.3, 0.5, 0.7, 0.9]));
        assert_eq!(found.len(), 5);
        for (f, r) in found.iter().zip([0.1, 0.3, 0.5, 0.7, 0.9]) {
            assert!((f - r).abs() < 1e-11, "{f} against {r}");
        }
    }

    #[test]
    fn a_root_exactly_on_the_first_split_is_not_lost() {
        let found = roots(product([0.25, 0.5, 0.75, 2.0, -1.0]));
        assert!(found.iter().any(|t| (t - 0.5).abs() < 1e-12), "{found:?}");
    }

    #[test]
    fn roots_outside_are_not_reported_and_zero_has_none() {
        assert!(roots(product([-0.5, 1.5, 2.0, -3.0, 4.0])).is_empty());
        assert!(roots([0.0; 6]).is_empty());
    }

    #[test]
    fn the_coefficients_bound_the_polynomial() {
        let p = [0.3, -2.0, 1.0, 4.0, -3.5, 0.25];
        let b = from_power(&p);
        let (low, high) = b
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), &x| (l.min(x), h.max(x)));
        for i in 0..=100 {
            let (value, _) = value_and_slope(&p, f64::from(i) / 100.0);
            assert!(value >= low - 1e-14 && value <= high + 1e-14);
        }
        assert_eq!(b[0], p[0]);
        assert!((b[5] - p.iter().sum::<f64>()).abs() < 1e-14);
    }

    proptest! {
        #[test]
        fn every_sign_change_between_samples_has_a_root(p in prop::array::uniform6(-1.0..1.0_f64)) {
            let found = roots(p);
            for i in 0..200 {
                let (t0, t1) = (f64::from(i) / 200.0, f64::from(i + 1) / 200.0);
                let (v0, _) = value_and_slope(&p, t0);
                let (v1, _) = value_and_slope(&p, t1);
                if v0 * v1 < 0.0 {
                    prop_assert!(found.iter().any(|t| *t >= t0 - 1e-9 && *t <= t1 + 1e-9));
                }
            }
            for t in found {
                prop_assert!(t > 0.0 && t < 1.0);
                prop_assert!(value_and_slope(&p, t).0.abs() < 1e-9);
            }
        }
    }
}
