//! The two distributions the sensors need, fixed here so that a new release of `rand` cannot
//! change a recording.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Uniform in `[0, 1)`: the top 53 bits of one word.
pub(crate) fn uniform(rng: &mut ChaCha8Rng) -> f64 {
    const ULP: f64 = 1.0 / (1_u64 << 53) as f64;
    (rng.next_u64() >> 11) as f64 * ULP
}

/// Two independent standard normal numbers (Box and Muller 1958).
///
/// Always two words of the generator, so that the place in the stream does not depend on the
/// numbers drawn.
pub(crate) fn standard_normals(rng: &mut ChaCha8Rng) -> (f64, f64) {
    // 1 − u lies in (0, 1], where the logarithm is finite.
    let radius = (-2.0 * (1.0 - uniform(rng)).ln()).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * uniform(rng)).sin_cos();
    (radius * cos, radius * sin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    const N: usize = 100_000;

    #[test]
    fn uniform_numbers_fill_the_unit_interval_evenly() {
        let mut rng = ChaCha8Rng::seed_from_u64(42);
        // The first word of seed 42 is 12578764544318200737.
        assert_eq!(
            uniform(&mut rng),
            12578764544318200737.0_f64 / 2f64.powi(64)
        );
        let mean = (0..N).map(|_| uniform(&mut rng)).sum::<f64>() / N as f64;
        // Three standard errors of a uniform mean, 1/√12/√N.
        assert!((mean - 0.5).abs() < 3.0 * (1.0 / 12.0_f64).sqrt() / (N as f64).sqrt());
    }

    #[test]
    fn normal_pairs_have_unit_variance_no_mean_and_no_correlation() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let (mut sum, mut square, mut cross, mut fourth) = (0.0, 0.0, 0.0, 0.0);
        for _ in 0..N {
            let (a, b) = standard_normals(&mut rng);
            sum += a + b;
            square += a * a + b * b;
            fourth += a.powi(4) + b.powi(4);
            cross += a * b;
        }
        let n = 2.0 * N as f64;
        // Three standard errors: of the mean 1/√n, of the variance √(2/n), of the fourth
        // moment √(96/n), of the product of N pairs 1/√N.
        assert!((sum / n).abs() < 3.0 / n.sqrt());
        assert!((square / n - 1.0).abs() < 3.0 * (2.0 / n).sqrt());
        assert!((fourth / n - 3.0).abs() < 3.0 * (96.0 / n).sqrt());
        assert!((cross / N as f64).abs() < 3.0 / (N as f64).sqrt());
    }
}
