//! Gauss–Legendre rules on the unit interval.

/// `N` nodes and weights on [0, 1]; exact for polynomials up to degree 2`N` − 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussLegendre<const N: usize> {
    /// Nodes in ascending order, in (0, 1).
    pub nodes: [f64; N],
    /// Weights belonging to the nodes; their sum is one.
    pub weights: [f64; N],
}

/// Three nodes: exact to degree 5.
pub const THREE: GaussLegendre<3> =
    from_half([0.0, 0.774_596_669_241_483_4], [8.0 / 9.0, 5.0 / 9.0]);

/// Five nodes: exact to degree 9.
pub const FIVE: GaussLegendre<5> = from_half(
    [0.0, 0.538_469_310_105_683_1, 0.906_179_845_938_664],
    [
        0.568_888_888_888_888_9,
        0.478_628_670_499_366_47,
        0.236_926_885_056_189_08,
    ],
);

/// Eight nodes: exact to degree 15. The planner's rule for length and bending of one edge.
pub const EIGHT: GaussLegendre<8> = from_half(
    [
        0.183_434_642_495_649_8,
        0.525_532_409_916_329,
        0.796_666_477_413_626_7,
        0.960_289_856_497_536_3,
    ],
    [
        0.362_683_783_378_362,
        0.313_706_645_877_887_27,
        0.222_381_034_453_374_48,
        0.101_228_536_290_376_26,
    ],
);

impl<const N: usize> GaussLegendre<N> {
    /// Approximates the integral of `f` over [`from`, `to`].
    #[inline]
    pub fn integrate(&self, from: f64, to: f64, mut f: impl FnMut(f64) -> f64) -> f64 {
        let width = to - from;
        let mut sum = 0.0;
        for (node, weight) in self.nodes.iter().zip(&self.weights) {
            sum += weight * f(from + width * node);
        }
        width * sum
    }
}

/// Rule on [0, 1] from the non-negative nodes of the rule on [−1, 1], as tables print it.
const fn from_half<const H: usize, const N: usize>(
    nodes: [f64; H],
    weights: [f64; H],
) -> GaussLegendre<N> {
    let mut rule = GaussLegendre {
        nodes: [0.0; N],
        weights: [0.0; N],
    };
    let mut i = 0;
    while i < H {
        let upper = N - H + i;
        rule.nodes[upper] = 0.5 * (1.0 + nodes[i]);
        rule.weights[upper] = 0.5 * weights[i];
        rule.nodes[H - 1 - i] = 0.5 * (1.0 - nodes[i]);
        rule.weights[H - 1 - i] = 0.5 * weights[i];
        i += 1;
    }
    rule
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_exact_up_to<const N: usize>(rule: &GaussLegendre<N>) {
        assert!(rule.nodes.windows(2).all(|w| w[0] < w[1]));
        for degree in 0..2 * N {
            let exact = 1.0 / (degree as f64 + 1.0);
            let value = rule.integrate(0.0, 1.0, |x| x.powi(degree as i32));
            assert!(
                (value - exact).abs() < 2e-15,
                "degree {degree}: {value} against {exact}"
            );
        }
        // One degree beyond the promise it is no longer exact.
        let beyond = rule.integrate(0.0, 1.0, |x| x.powi(2 * N as i32));
        assert!((beyond - 1.0 / (2.0 * N as f64 + 1.0)).abs() > 1e-12);
    }

    #[test]
    fn each_rule_is_exact_to_the_degree_it_names() {
        is_exact_up_to(&THREE);
        is_exact_up_to(&FIVE);
        is_exact_up_to(&EIGHT);
    }

    #[test]
    fn an_interval_other_than_the_unit_one_is_scaled() {
        let value = EIGHT.integrate(1.0, 3.0, f64::exp);
        assert!((value - (3.0_f64.exp() - 1.0_f64.exp())).abs() < 1e-13);
    }
}
