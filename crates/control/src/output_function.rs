//! The special output of the roll dynamics.
//!
//! The roll axis is unactuated, so the angular momentum `sigma` about the contact line
//! does not see the balancer torque. Together with
//!
//! ```text
//! p = alpha + F(beta),   F(beta) = integral_0^beta M12/M11 db,   p' = sigma / M11
//! ```
//!
//! it forms an output `y = sigma + K (p - p_ref)` of relative degree three, whose zero
//! dynamics `p' = -(K / M11) (p - p_ref)` has one state and decays for every `K > 0`.

use std::f64::consts::PI;

/// The inertia terms of the two-link model as functions of the balancer angle, and `F`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutputFunction {
    a0: f64,
    a2: f64,
    a3: f64,
}

impl OutputFunction {
    /// From the lumped inertias, kg m^2: `a0 = I1x + m1 h1^2 + m2 l^2`,
    /// `a2 = I2x + m2 d^2`, `a3 = m2 l d`. A physical bike has `a0 + a2 > 2 a3`.
    #[must_use]
    pub fn new(a0: f64, a2: f64, a3: f64) -> Self {
        Self { a0, a2, a3 }
    }

    /// `[a0, a2, a3]`, kg m^2.
    pub(crate) fn constants(&self) -> [f64; 3] {
        [self.a0, self.a2, self.a3]
    }

    /// `M11(beta)`, kg m^2: roll inertia.
    #[must_use]
    pub fn m11(&self, balancer: f64) -> f64 {
        self.a0 + self.a2 + 2.0 * self.a3 * balancer.cos()
    }

    /// `M12(beta)`, kg m^2: coupling inertia.
    #[must_use]
    pub fn m12(&self, balancer: f64) -> f64 {
        self.a2 + self.a3 * balancer.cos()
    }

    /// `M22`, kg m^2: balancer inertia.
    #[must_use]
    pub fn m22(&self) -> f64 {
        self.a2
    }

    /// `dM11/dbeta`, kg m^2/rad.
    #[must_use]
    pub fn m11_slope(&self, balancer: f64) -> f64 {
        -2.0 * self.a3 * balancer.sin()
    }

    /// `d^2 M11/dbeta^2`, kg m^2/rad^2.
    #[must_use]
    pub fn m11_curve(&self, balancer: f64) -> f64 {
        -2.0 * self.a3 * balancer.cos()
    }

    /// `F(beta)`, rad, in closed form and continuous over every turn of the balancer.
    ///
    /// With `A = a0 + a2`, `B = 2 a3` and `beta = r + 2 pi k`, `|r| <= pi`:
    /// `F = beta/2 + (a2 - a0)/sqrt(A^2 - B^2) (atan2(sqrt(A-B) sin(r/2), sqrt(A+B) cos(r/2)) + pi k)`.
    #[must_use]
    pub fn value(&self, balancer: f64) -> f64 {
        let a = self.a0 + self.a2;
        if self.a3 == 0.0 {
            return self.a2 / a * balancer;
        }
        let b = 2.0 * self.a3;
        let turns = ((balancer + PI) / (2.0 * PI)).floor();
        let half = 0.5 * (balancer - 2.0 * PI * turns);
        let angle = ((a - b).sqrt() * half.sin()).atan2((a + b).sqrt() * half.cos()) + PI * turns;
        0.5 * balancer + (self.a2 - self.a0) / (a * a - b * b).sqrt() * angle
    }

    /// `dF/dbeta = M12/M11`.
    #[must_use]
    pub fn slope(&self, balancer: f64) -> f64 {
        self.m12(balancer) / self.m11(balancer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DEFAULT: (f64, f64, f64) = (3.2 + 38.0 * 0.52 * 0.52 + 12.0 * 0.64, 1.07, 1.44);

    fn default_function() -> OutputFunction {
        OutputFunction::new(DEFAULT.0, DEFAULT.1, DEFAULT.2)
    }

    #[test]
    fn is_linear_for_a_centred_balancer() {
        let f = OutputFunction::new(21.1552, 0.8, 0.0);
        assert!((f.value(7.3) - 0.8 / 21.9552 * 7.3).abs() < 1e-15);
    }

    #[test]
    fn is_continuous_where_the_balancer_passes_a_half_turn() {
        let f = default_function();
        for k in [-5.0, -3.0, -1.0, 1.0, 3.0, 5.0] {
            let at = k * PI;
            // The slope is below 0.1, so 2e-9 rad of balancer move F by less than 1e-9.
            assert!((f.value(at + 1e-9) - f.value(at - 1e-9)).abs() < 1e-9);
        }
    }

    proptest! {
        #[test]
        fn equals_the_integral_of_its_slope(beta in -20.0f64..20.0) {
            let f = default_function();
            // Composite Simpson, error far below 1e-10 for this smooth periodic integrand.
            let n = 4000;
            let h = beta / f64::from(n);
            let sum: f64 = (0..=n)
                .map(|i| {
                    let weight = if i == 0 || i == n { 1.0 } else if i % 2 == 1 { 4.0 } else { 2.0 };
                    weight * f.slope(h * f64::from(i))
                })
                .sum();
            prop_assert!((f.value(beta) - sum * h / 3.0).abs() < 1e-9);
        }
    }
}
